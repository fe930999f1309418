# SPDX-License-Identifier: BSD-3-Clause
"""Evaluates a policy in episodes that it was not trained on: numbers, figures and a film."""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import asdict, dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

# This import comes first because its error says what to install.
from trifinger.arrays import Array
from trifinger.environments import Environment, Options, VectorEnvironment

# isort: split
import numpy as np
from gymnasium.spaces import Space, flatdim
from gymnasium.vector import AutoresetMode

from trifinger._trifinger import Policy
from trifinger.environments.task_environment import Observation
from trifinger.errors import InvalidArgument
from trifinger.picture import FILM_RATE, save_film
from trifinger.whole_file import whole_file

# Takes rows of observations and returns rows of actions.
Act = Callable[[Array], Array]
# Called with the share of the work that is done, from 0 to 1.
Watch = Callable[[float], None]

SEED = 1_000_000  # seed of the first evaluated episode, far from seeds of trainings
FILM_EPISODES = 5
SHOWN_EPISODES = 20  # in the figure of the paths to the goals


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Distances at the end of episodes [`unit`], and the share that ended with success."""

    episodes: int
    lower_quartile: float
    median: float
    upper_quartile: float
    largest: float
    success: float
    unit: str = "m"
    """Unit of the distances: m or rad."""

    def in_words(self, *distances: float) -> str:
        """Distances with their unit: in cm, unless they are angles."""
        scale, unit = (100.0, "cm") if self.unit == "m" else (1.0, self.unit)
        return f"{' to '.join(f'{scale * distance:.2f}' for distance in distances)} {unit}"

    @property
    def in_short(self) -> str:
        """The median and the share of success."""
        return f"{self.in_words(self.median)}, success {100 * self.success:.0f} %"

    def __str__(self) -> str:
        rows = (
            ("episodes", str(self.episodes)),
            ("final distance, median", self.in_words(self.median)),
            ("final distance, quartiles", self.in_words(self.lower_quartile, self.upper_quartile)),
            ("final distance, largest", self.in_words(self.largest)),
            ("success", f"{100 * self.success:.0f} %"),
        )
        return "\n".join(f"{name:<27}{value}" for name, value in rows)

    def to_json(self) -> str:
        """A JSON object with the names of the fields."""
        return json.dumps(asdict(self))


@dataclass(frozen=True)
class Evaluation:
    """Results of some episodes."""

    distances: Array
    """Final distances of each tip or of the object to the goal; a row for each episode [m]."""
    successes: Array
    """Whether each episode ended with success."""
    paths: Array
    """Achieved minus desired goal: episode, action, number; NaN after the end of an episode."""
    unit: str = "m"
    """Unit of the distances."""
    rewards: Array = field(default_factory=lambda: np.zeros((0, 0)))
    """Rewards: episode, action; NaN after the end of an episode."""
    scores: Mapping[str, Array] = field(default_factory=dict)
    """Scores of the task's own by their names, as rewards are."""

    def summary(self) -> Summary:
        """The figures of these results."""
        quartiles = np.percentile(self.distances, (25, 50, 75))
        return Summary(
            episodes=len(self.successes),
            lower_quartile=float(quartiles[0]),
            median=float(quartiles[1]),
            upper_quartile=float(quartiles[2]),
            largest=float(self.distances.max()),
            success=float(self.successes.mean()),
            unit=self.unit,
        )


def interval_of_rate(successes: int, trials: int) -> tuple[float, float]:
    """The 95 % interval of a rate by E. B. Wilson, Probable inference, 1927."""
    z = 1.96
    share, scale = successes / trials, 1 + z * z / trials
    middle = (share + z * z / (2 * trials)) / scale
    half = z / scale * math.sqrt(share * (1 - share) / trials + z * z / (4 * trials**2))
    return max(0.0, middle - half), min(1.0, middle + half)


class Evaluator:
    """Evaluates policies in the same fixed episodes: episode 0 of `episodes` successive seeds.

    The number of threads changes no result; 0 is one for each processor. `scores` are names in the
    task's info that an evaluation keeps, too.
    """

    def __init__(
        self,
        task: str,
        options: Options,
        episodes: int = 50,
        seed: int = SEED,
        config: str | None = None,
        num_threads: int = 1,
        scores: Sequence[str] = (),
    ) -> None:
        self.environment = VectorEnvironment(
            task,
            episodes,
            options=options,
            num_threads=num_threads,
            autoreset_mode=AutoresetMode.SAME_STEP,
            config=config,
        )
        self._seed, self._scores = seed, scores
        self.info: dict[str, Any] = {}
        """What the environment tells beside the observations that are acted upon."""
        self.has_ended = np.zeros(episodes, bool)
        """Which episodes have ended: whatever is done in these has no effect on the results."""

    def __call__(self, act: Act, rows: int = 1, watch: Watch | None = None) -> Evaluation:
        """Lets a policy act in all episodes and returns the results.

        A policy that the fingers share gets `rows` rows for each episode. After each action,
        `watch` is called with the share of the longest episode that is done.
        """
        environment = self.environment
        count = environment.num_envs
        observations, info = environment.reset(seed=self._seed)
        self.info = info
        measured: list[dict[str, Array]] = []
        paths = [info["achieved_goal"] - info["desired_goal"]]
        distances = np.array(info["distance"])
        successes = np.zeros(count, bool)
        self.has_ended = has_ended = np.zeros(count, bool)
        while not has_ended.all():
            seen = vectors_of(observations, count * rows)
            actions = act(seen).reshape(count, -1)
            observations, reward, terminated, truncated, info = environment.step(actions)
            self.info = info
            ended = (terminated | truncated) & ~has_ended
            told = {name: info[name].copy() for name in self._scores}
            offset = np.where(
                has_ended[:, None], np.nan, info["achieved_goal"] - info["desired_goal"]
            )
            if ended.any():
                final = info["final_info"]
                offset[ended] = (final["achieved_goal"] - final["desired_goal"])[ended]
                distances[ended] = final["distance"][ended]
                successes[ended] = final["is_success"][ended]
                for name, score in told.items():
                    score[ended] = final[name][ended]
            paths.append(offset)
            told["reward"] = reward
            measured.append(
                {name: np.where(has_ended, np.nan, score) for name, score in told.items()}
            )
            has_ended |= ended
            if watch:
                watch((len(paths) - 1) / self.episode_actions)
        unit = environment.goal_unit.partition(",")[0]
        series = {name: np.stack([one[name] for one in measured], axis=1) for name in measured[0]}
        rewards = series.pop("reward")
        return Evaluation(
            distances, successes, np.stack(paths, axis=1), unit, rewards=rewards, scores=series
        )

    @property
    def episode_actions(self) -> int:
        """Number of actions in an episode that is not terminated early."""
        return self.environment.episode_actions

    def rows_of(self, policy: Policy) -> int:
        """Number of actions that a policy computes per step: 1, or one per finger if they share it.

        Raises InvalidArgument if the policy does not fit the task.
        """
        environment = self.environment
        return rows_of(
            policy,
            environment.task,
            environment.single_observation_space,
            environment.single_action_space,
        )


def rows_of(policy: Policy, task: str, seen: Space[Any], acted: Space[Any]) -> int:
    """Number of actions that a policy computes per step: 1, or one per finger if they share it.

    `seen` and `acted` are the spaces of observations and actions of one robot. Raises
    InvalidArgument if the policy does not fit them.
    """
    inputs, outputs = flatdim(seen), flatdim(acted)
    rows = outputs // policy.num_outputs
    if (rows * policy.num_inputs, rows * policy.num_outputs) != (inputs, outputs):
        raise InvalidArgument(
            f"the policy turns {policy.num_inputs} numbers into {policy.num_outputs}, the task "
            f"'{task}' needs {inputs} into {outputs}"
        )
    return rows


def vectors_of(observations: Observation, rows: int) -> Array:
    """Observations as vectors, one for each row.

    Parts are in the order of their names, as gymnasium.spaces.flatten has them.
    """
    if not isinstance(observations, dict):
        return observations.reshape(rows, -1)
    parts = [observations[name].reshape(rows, -1) for name in sorted(observations)]
    return np.concatenate(parts, axis=1, dtype=np.float32)


def act_of(policy: Policy) -> Act:
    """Makes a function of a policy that takes rows of observations, as episodes begin."""
    if policy.has_state:
        each: list[Policy] = []  # Every row has a state of its own.

        def act(observations: Array) -> Array:
            while len(each) < len(observations):
                each.append(copy(policy))
                each[-1].reset()
            actions = [one(row) for one, row in zip(each, observations, strict=True)]
            return np.stack(actions)

        return act
    return lambda observations: np.stack([policy(row) for row in observations])


def evaluate(
    policy: Policy,
    task: str,
    episodes: int = 50,
    seed: int = SEED,
    watch: Watch | None = None,
    condition: str | None = None,
) -> Evaluation:
    """Evaluates a policy with the options and the robot that its file names.

    If the file names none, they are the task's options and its usual robot. `condition` is that of
    the simulated robots, if it shall not be that of the options. Raises InvalidArgument if the
    policy does not fit the task, or if there is no such condition.
    """
    text = policy.metadata.get("options")
    options = Options.from_json(text) if text else Options.of(task)
    if condition is not None:
        options = options.changed(condition=condition)
    config = policy.metadata.get("robot")
    evaluator = Evaluator(task, options, episodes, seed, config)
    return evaluator(act_of(policy), evaluator.rows_of(policy), watch)


def save_policy_film(act: Act, environment: Environment, path: Path, rows: int = 1) -> None:
    """Writes a film of some episodes of an environment that draws, at real speed."""
    rate = environment.metadata["render_fps"]
    every = -(-rate // FILM_RATE)

    def images() -> Iterator[Array]:
        for episode in range(FILM_EPISODES):
            observation, _ = environment.reset(seed=SEED + episode)
            has_ended = False
            num_actions = 0
            while not has_ended:
                seen = vectors_of(observation, rows)
                action = act(seen).ravel()
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
    """Draws learning curves: final distances, as medians with quartiles, and shares of success."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    figure = Figure(figsize=(10.0, 3.6), layout="constrained")
    distance, success = figure.subplots(1, 2)
    has_angles = any(summary.unit != "m" for curve in curves.values() for _, summary in curve)
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
    if not has_angles:
        distance.axhline(2.0, color="#888888", linestyle="--", linewidth=0.8)
    unit = "0.01 rad" if has_angles else "cm"
    distance.set(yscale="log", ylabel=f"final distance [{unit}]: median, quartiles")
    distance.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    distance.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    distance.yaxis.set_minor_formatter(NullFormatter())
    distance.legend(frameon=False)
    success.set(ylim=(0, 102), ylabel="episodes that end with success [%]")
    for axes in (distance, success):
        axes.set_xlabel("episodes")
        axes.spines[["top", "right"]].set_visible(False)
    with whole_file(path) as part:
        figure.savefig(part, dpi=110)


def save_paths(evaluations: Mapping[str, Array], path: Path) -> None:
    """Draws paths of tips or objects to their goals in the xy plane, like the paper's figure.

    Each entry of `evaluations` is an `Evaluation.paths` of positions and gets a panel. Starts are
    crosses, ends are dots, and the circle has a radius of 2 cm around the goal.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Ellipse

    figure = Figure(figsize=(4.0 * len(evaluations), 4.2), layout="constrained")
    farthest = (np.nanmax(np.abs(paths.reshape(-1, 3)[:, :2])) for paths in evaluations.values())
    limit = 100 * max(0.25, *farthest)
    for panel, (title, paths) in enumerate(evaluations.items(), 1):
        axes = figure.add_subplot(1, len(evaluations), panel)
        shown = 100 * paths[:SHOWN_EPISODES].reshape(*paths[:SHOWN_EPISODES].shape[:2], -1, 3)
        for line in np.moveaxis(shown, 2, 1).reshape(-1, shown.shape[1], 3):
            axes.plot(line[:, 0], line[:, 1], color="#4477AA", linewidth=0.5, alpha=0.5)
            axes.plot(*line[0, :2], "x", color="#00B7C7", markersize=5)
            axes.plot(*line[-1, :2], ".", color="#EE55AA", markersize=5, zorder=3)
        axes.add_patch(Ellipse((0, 0), 4, 4, facecolor="none", edgecolor="#E0B000", zorder=4))
        axes.set(xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal", title=title)
        axes.set_xlabel("x [cm]")
        axes.spines[["top", "right"]].set_visible(False)
        if panel == 1:
            axes.set_ylabel("y [cm]")
    with whole_file(path) as part:
        figure.savefig(part, dpi=110)
