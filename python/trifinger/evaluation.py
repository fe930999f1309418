# SPDX-License-Identifier: BSD-3-Clause
"""How well a policy does in episodes that it was not trained on: numbers, figures and film."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

# First, because it says what to install.
from trifinger.environments import Environment, Options, VectorEnvironment

# isort: split
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode

from trifinger._trifinger import Policy
from trifinger.errors import InvalidArgument
from trifinger.picture import FILM_RATE, View, save_film

Array = npt.NDArray[Any]
# Rows of observations to rows of actions.
Act = Callable[[Array], Array]
# Is told which share of the work is done, from 0 to 1.
Watch = Callable[[float], None]

SEED = 1_000_000  # of the first evaluated episode, far from those of trainings
FILM_EPISODES = 5
SHOWN_EPISODES = 20  # in the figure of the ways to the goals


@dataclass(frozen=True)
class Evaluation:
    """What came of some episodes."""

    distances: Array
    """At the end of each episode, of each tip or of the object: a row for each episode [m]."""
    successes: Array
    """Whether each episode ended with success."""
    ways: Array
    """What was achieved less its goal: episode, action, number; NaN behind the end."""

    def summary(self) -> Summary:
        """Its numbers."""
        quartiles = np.percentile(self.distances, (25, 50, 75))
        return Summary(
            episodes=len(self.successes),
            lower_quartile=float(quartiles[0]),
            median=float(quartiles[1]),
            upper_quartile=float(quartiles[2]),
            largest=float(self.distances.max()),
            success=float(self.successes.mean()),
        )


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Distances at the end of episodes [m], and the share that ended with success."""

    episodes: int
    lower_quartile: float
    median: float
    upper_quartile: float
    largest: float
    success: float

    def __str__(self) -> str:
        quartiles = f"{100 * self.lower_quartile:.2f} to {100 * self.upper_quartile:.2f}"
        rows = (
            ("episodes", str(self.episodes)),
            ("final distance, median", f"{100 * self.median:.2f} cm"),
            ("final distance, quartiles", f"{quartiles} cm"),
            ("final distance, largest", f"{100 * self.largest:.2f} cm"),
            ("success", f"{100 * self.success:.0f} %"),
        )
        return "\n".join(f"{name:<27}{value}" for name, value in rows)

    def to_json(self) -> str:
        """An object with the names of the fields."""
        return json.dumps(asdict(self))


class Evaluator:
    """Fixed episodes: episode 0 of as many seeds, the same for every policy."""

    def __init__(
        self,
        task: str,
        options: Options,
        episodes: int = 50,
        seed: int = SEED,
        config: str = "trifinger_edu",
    ) -> None:
        self._environment = VectorEnvironment(
            task,
            episodes,
            options=options,
            num_threads=1,
            autoreset_mode=AutoresetMode.SAME_STEP,
            config=config,
        )
        self._seed = seed

    def __call__(self, act: Act, rows: int = 1, watch: Watch | None = None) -> Evaluation:
        """Lets a policy act in all of them; one that fingers share is asked for `rows` of each.

        `watch` is told after each action which share of the longest episode is over.
        """
        environment = self._environment
        count = environment.num_envs
        observations, info = environment.reset(seed=self._seed)
        ways = [info["achieved_goal"] - info["desired_goal"]]
        distances = np.array(info["distance"])
        successes = np.zeros(count, bool)
        has_ended = np.zeros(count, bool)
        while not has_ended.all():
            seen = np.asarray(observations).reshape(count * rows, -1)
            actions = act(seen).reshape(count, -1)
            observations, _, terminated, truncated, info = environment.step(actions)
            ended = (terminated | truncated) & ~has_ended
            way = np.where(has_ended[:, None], np.nan, info["achieved_goal"] - info["desired_goal"])
            if ended.any():
                final = info["final_info"]
                way[ended] = (final["achieved_goal"] - final["desired_goal"])[ended]
                distances[ended] = final["distance"][ended]
                successes[ended] = final["is_success"][ended]
            ways.append(way)
            has_ended |= ended
            if watch:
                watch((len(ways) - 1) / self.episode_actions)
        return Evaluation(distances, successes, np.stack(ways, axis=1))

    @property
    def episode_actions(self) -> int:
        """How many actions an episode has that is not terminated."""
        return self._environment.episode_actions

    def rows_of(self, policy: Policy) -> int:
        """How often a policy is asked for an action: 1, or of each finger if they share it.

        Raises InvalidArgument if it is no policy for the task.
        """
        (seen,) = self._environment.single_observation_space.shape or (0,)
        (acted,) = self._environment.single_action_space.shape or (0,)
        rows = acted // policy.num_outputs
        if (rows * policy.num_inputs, rows * policy.num_outputs) != (seen, acted):
            raise InvalidArgument(
                f"the policy makes {policy.num_outputs} numbers of {policy.num_inputs}, the task "
                f"'{self._environment.task}' needs {acted} of {seen}"
            )
        return rows


def act_of(policy: Policy) -> Act:
    """A policy from a file, for rows."""
    return lambda observations: np.stack([policy(row) for row in observations])


def evaluate(
    policy: Policy,
    task: str,
    episodes: int = 50,
    seed: int = SEED,
    watch: Watch | None = None,
) -> Evaluation:
    """Lets a policy act with options and robot of its file; by default, those of the task.

    Raises InvalidArgument if it is no policy for that task.
    """
    text = policy.metadata.get("options")
    options = Options.from_json(text) if text else Options.of(task)
    config = policy.metadata.get("robot", "trifinger_edu")
    evaluator = Evaluator(task, options, episodes, seed, config)
    return evaluator(act_of(policy), evaluator.rows_of(policy), watch)


def save_policy_film(
    act: Act, task: str, options: Options, path: Path, rows: int = 1, view: View | None = None
) -> None:
    """A film of some episodes at the speed of life."""
    environment = Environment(task, options=options, render_mode="rgb_array", view=view)
    rate = environment.metadata["render_fps"]
    every = -(-rate // FILM_RATE)

    def images() -> Iterator[Array]:
        for episode in range(FILM_EPISODES):
            observation, _ = environment.reset(seed=SEED + episode)
            has_ended = False
            num_actions = 0
            while not has_ended:
                action = act(np.reshape(np.asarray(observation), (rows, -1))).ravel()
                observation, _, terminated, truncated, _ = environment.step(action)
                has_ended = terminated or truncated
                num_actions += 1
                if num_actions % every == 0 or has_ended:
                    yield environment.render()

    try:
        save_film(images(), path, Fraction(rate, every))
    finally:
        environment.close()


def save_curve(curves: Mapping[str, Sequence[tuple[int, Summary]]], path: Path) -> None:
    """Learning curves over episodes: medians of final distances with their quartiles, successes."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    figure = Figure(figsize=(10.0, 3.6), layout="constrained")
    distance, success = figure.subplots(1, 2)
    for name, curve in curves.items():
        episodes = [episode for episode, _ in curve]
        numbers = 100 * np.array(
            [(one.lower_quartile, one.median, one.upper_quartile, one.success) for _, one in curve]
        )
        (line,) = distance.plot(episodes, numbers[:, 1], label=name)
        colour = line.get_color()
        distance.fill_between(
            episodes, numbers[:, 0], numbers[:, 2], alpha=0.15, color=colour, linewidth=0
        )
        success.plot(episodes, numbers[:, 3], color=colour)
    distance.axhline(2.0, color="#888888", linestyle="--", linewidth=0.8)
    distance.set(yscale="log", ylabel="final distance [cm]: median, quartiles")
    distance.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    distance.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    distance.yaxis.set_minor_formatter(NullFormatter())
    distance.legend(frameon=False)
    success.set(ylim=(0, 102), ylabel="episodes that end with success [%]")
    for axes in (distance, success):
        axes.set_xlabel("episodes")
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=110)


def save_ways(evaluations: Mapping[str, Array], path: Path) -> None:
    """Ways of tips or objects relative to their goals in the xy plane, as in the paper's figure.

    A panel for each of some `Evaluation.ways`, of places: starts are crosses, ends are dots, and
    the ellipse is 2 cm from the goal.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Ellipse

    figure = Figure(figsize=(4.0 * len(evaluations), 4.2), layout="constrained")
    farthest = (np.nanmax(np.abs(ways.reshape(-1, 3)[:, :2])) for ways in evaluations.values())
    limit = 100 * max(0.25, *farthest)
    for panel, (title, ways) in enumerate(evaluations.items(), 1):
        axes = figure.add_subplot(1, len(evaluations), panel)
        shown = 100 * ways[:SHOWN_EPISODES].reshape(*ways[:SHOWN_EPISODES].shape[:2], -1, 3)
        for way in np.moveaxis(shown, 2, 1).reshape(-1, shown.shape[1], 3):
            axes.plot(way[:, 0], way[:, 1], color="#4477AA", linewidth=0.5, alpha=0.5)
            axes.plot(*way[0, :2], "x", color="#00B7C7", markersize=5)
            axes.plot(*way[-1, :2], ".", color="#EE55AA", markersize=5, zorder=3)
        axes.add_patch(Ellipse((0, 0), 4, 4, facecolor="none", edgecolor="#E0B000", zorder=4))
        axes.set(xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal", title=title)
        axes.set_xlabel("x [cm]")
        axes.spines[["top", "right"]].set_visible(False)
        if panel == 1:
            axes.set_ylabel("y [cm]")
    figure.savefig(path, dpi=110)
