# SPDX-License-Identifier: BSD-3-Clause
"""The benchmark: fixed tasks, robots and seeds, in which policies and controllers are compared."""

import csv
import hashlib
import inspect
import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, cast

# This import comes first because its error says what to install.
from trifinger.arrays import Array
from trifinger.environments import Options, VectorEnvironment

# isort: split
import numpy as np
import numpy.typing as npt

from trifinger import __version__
from trifinger._trifinger import Policy, robot_of_task
from trifinger.errors import InvalidArgument
from trifinger.evaluation import Act, Evaluator, Watch, act_of, interval_of_rate
from trifinger.own_class import load

SEED = 5_000_000_000  # of the first episode; no seed that is drawn by chance is above 2^32
STEPS_PER_SECOND = 1000  # in which the challenge adds up its cost

AGES = ("object_age", "object_is_sure")
Observation = Mapping[str, Array]
"""The entries of an observation by their names, in SI units, and with an object those of AGES."""


class Controller(Protocol):
    """What acts in one episode; a class makes an object for each, without arguments.

    Its `options` may be names and values of Options: those in OWN, which say how it acts.
    """

    def reset(self, observation: Observation, environment: VectorEnvironment) -> None:
        """Begins the episode; `environment` has its task, options, spaces and scene."""

    def act(self, observation: Observation) -> npt.ArrayLike:
        """The action after an observation: a number from -1 to 1 for each joint."""


class Stateless:
    """A controller that is a function of the observation."""

    def __init__(self, act: Callable[[Observation], npt.ArrayLike]) -> None:
        self.act = act

    def reset(self, _observation: Observation, _environment: VectorEnvironment) -> None:
        """Does nothing."""


class Uniform:
    """A controller by chance, up to a largest number: 0 does nothing, 1 draws from all actions."""

    def __init__(self, seed: int, largest: float) -> None:
        self._random, self._largest = np.random.default_rng(seed), largest

    def reset(self, _observation: Observation, environment: VectorEnvironment) -> None:
        """Learns how many numbers an action has."""
        self._shape = environment.single_action_space.shape

    def act(self, _observation: Observation) -> npt.ArrayLike:
        """Draws an action."""
        return self._random.uniform(-self._largest, self._largest, self._shape)


REFERENCES: Mapping[str, Callable[[int], Controller]] = {
    "zero": lambda seed: Uniform(seed, 0.0),
    "random": lambda seed: Uniform(seed, 1.0),
}


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """What is fixed for a task, apart from its options, which are the task's own."""

    episodes: int = 100
    has_cost: bool = False
    """Whether the reward is the cost of the Real Robot Challenge, negated."""
    scores: tuple[str, ...] = ()
    """What the task's info says of each action, published with the task."""


_CUBE = Benchmark(has_cost=True)
_DCLAW = Benchmark(scores=("points", "joints_near_limit", "fast_joints", "high_currents"))
BENCHMARKS: Mapping[str, Benchmark] = {
    "reach": Benchmark(),
    "push": _CUBE,
    "lift": _CUBE,
    "lift_pose": _CUBE,
    "move_cube_on_trajectory": Benchmark(episodes=20, has_cost=True),
    **{
        f"dclaw_{what}_{kind}": _DCLAW
        for what in ("pose", "turn", "screw")
        for kind in ("fixed", "random", "random_dynamics")
    },
}
OWN = (
    *("steps_per_action", "mapping", "action", "position_change", "leash", "position_kp"),
    *(
        "per_finger",
        "symmetric_view",
        "symmetric_object",
        "object_offsets",
        "keypoints",
        "frames",
        "object_poses",
        "camera_size",
    ),
)
"""Options that whatever acts brings along: what it sees, and how it acts. The benchmark fixes the
others."""


@dataclass(frozen=True, kw_only=True)
class Actor:
    """A policy or controller that is judged."""

    name: str
    act_in: Callable[[Evaluator], tuple[Act, int]]
    """Makes what acts in an evaluator's episodes, and says how many rows it computes for each."""
    task: str | None = None
    """The task that it is for; None: any."""
    robot: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    """Those of OWN that differ from the task's."""
    sha256: str = ""
    """Of the policy's file."""


def policy(file: Path, name: str | None = None) -> Actor:
    """A policy in a file that says its task. Raises InvalidArgument if nothing can judge it."""
    known = Policy(file)
    task = known.metadata.get("task")
    if task is None:
        raise InvalidArgument(
            f"{file} does not say its task: `trifinger policy import` writes a file that does"
        )
    require(task)
    text = known.metadata.get("options")
    options = Options.from_json(text) if text else Options.of(task)
    if options.observation != "flat":
        raise InvalidArgument(
            f'{file} is for observation="{options.observation}", a benchmark needs "flat"'
        )
    return Actor(
        # Others repeat the table elsewhere, so a path of this machine says nothing.
        name=name or (file.name if file.is_absolute() else file.as_posix()),
        act_in=lambda evaluator: (act_of(known), evaluator.rows_of(known)),
        task=task,
        robot=known.metadata.get("robot"),
        options={name: getattr(options, name) for name in OWN},
        sha256=hashlib.sha256(file.read_bytes()).hexdigest(),
    )


def controller(name: str) -> Actor:
    """The controller `zero` or `random`, or MODULE:CLASS of the user's own.

    MODULE:FUNCTION has no state: it returns the action for an observation. Raises InvalidArgument.
    """
    if name in REFERENCES:
        return controllers(name, REFERENCES[name])
    if ":" not in name:
        raise InvalidArgument(f"--controller {name} must be zero, random, or MODULE:CLASS")
    found = load("controller", name)
    is_class = inspect.isclass(found)
    needed = ("reset", "act") if is_class else ("__call__",)
    if not all(callable(getattr(found, part, None)) for part in needed):
        raise InvalidArgument(
            f"'{name}' must be a class with reset(observation, environment) and act(observation), "
            "or a function of an observation"
        )
    options = getattr(found, "options", {})
    return controllers(name, lambda _: found() if is_class else Stateless(found), options)


def controllers(
    name: str, make: Callable[[int], Controller], options: Mapping[str, Any] | None = None
) -> Actor:
    """Controllers that `make` makes, one for the episode of each seed. Raises InvalidArgument."""
    for option in options or {}:
        if option not in OWN:
            raise InvalidArgument.of_name("option of a controller", option, OWN)

    def act_in(evaluator: Evaluator) -> tuple[Act, int]:
        return _act_of(name, make, evaluator), 1

    return Actor(name=name, act_in=act_in, options=dict(options or {}))


def require(task: str) -> Benchmark:
    """The benchmark of a task; raises InvalidArgument if there is none."""
    if task not in BENCHMARKS:
        raise InvalidArgument.of_name("benchmark", task, BENCHMARKS)
    return BENCHMARKS[task]


@dataclass(frozen=True, kw_only=True)
class Row:
    """What was judged, with everything that repeats it, and its figures."""

    task: str
    actor: str
    sha256: str
    robot: str
    condition: str
    first_seed: int
    options: Mapping[str, Any]
    figures: Mapping[str, float | str]
    """SI units; rounded to six digits."""


def judge(
    task: str,
    actor: Actor,
    *,
    episodes: int | None = None,
    condition: str = "as documented",
    robot: str | None = None,
    watch: Watch | None = None,
) -> Row:
    """Judges an actor in a benchmark.

    By default there are as many episodes as the benchmark has, on the task's robot. Raises
    InvalidArgument if the actor is for another task or robot.
    """
    benchmark = require(task)
    config = robot or robot_of_task(task)
    if actor.task not in (None, task):
        raise InvalidArgument(f"{actor.name} is for the task '{actor.task}', not for '{task}'")
    if actor.robot not in (None, config):
        raise InvalidArgument(
            f"{actor.name} is for the robot '{actor.robot}', the benchmark '{task}' is on "
            f"'{config}'; --robot-config {actor.robot} would judge it there"
        )
    options = Options.of(task, condition=condition, **actor.options)
    count = benchmark.episodes if episodes is None else episodes
    evaluator = Evaluator(task, options, count, SEED, config, 0, benchmark.scores)
    act, rows = actor.act_in(evaluator)
    result = evaluator(act, rows, watch)
    low, high = interval_of_rate(int(result.successes.sum()), count)
    quartiles = np.percentile(result.distances, (25, 50, 75))
    figures: dict[str, float | str] = {
        "episodes": count,
        "successes": int(result.successes.sum()),
        "success_low": low,
        "success_high": high,
        "distance_unit": result.unit,
        "distance_lower_quartile": quartiles[0],
        "distance_median": quartiles[1],
        "distance_upper_quartile": quartiles[2],
    }
    rewards = _held(result.rewards, evaluator.episode_actions).mean(axis=1)
    if benchmark.has_cost:
        steps = STEPS_PER_SECOND * options.duration
        figures |= {"cost": -rewards.mean(), "cost_deviation": rewards.std()}
        figures["cost_sum"] = -rewards.mean() * steps
    else:
        figures["reward"] = rewards.mean()
    for name, score in result.scores.items():
        figures[name] = _held(score, evaluator.episode_actions).mean()
    return Row(
        task=task,
        actor=actor.name,
        sha256=actor.sha256,
        robot=config,
        condition=condition,
        first_seed=SEED,
        options=json.loads(options.to_json()),
        figures={
            name: float(f"{one:.6g}") if isinstance(one, float) else one
            for name, one in figures.items()
        },
    )


def table(rows: Sequence[Row]) -> str:
    """A table for readers, in Markdown, and what its rows have in common.

    Columns that all rows leave empty are left out.
    """
    lines = [_cells(row) for row in rows]
    names = [name for name in lines[0] if any(line[name] for line in lines)]
    columns = [[name, *(line[name] for line in lines)] for name in names]
    ruled = [[column[0], "-", *column[1:]] for column in columns]
    padded = [_padded(column) for column in ruled]
    text = "\n".join(f"| {' | '.join(line)} |" for line in zip(*padded, strict=True))
    robots, conditions = (
        ", ".join(sorted({getattr(row, name) for row in rows})) for name in ("robot", "condition")
    )
    return f"{text}\n\nTriFinger {__version__}; {robots}, {conditions}; seeds from {SEED:,}."


def to_csv(rows: Sequence[Row]) -> str:
    """The figures for programs, in SI units."""
    names = dict.fromkeys(name for row in rows for name in row.figures)
    file = io.StringIO()
    writer = csv.DictWriter(file, ["task", "actor", *names], lineterminator="\n")
    writer.writeheader()
    writer.writerows({"task": row.task, "actor": row.actor, **row.figures} for row in rows)
    return file.getvalue()


def to_dictionary(rows: Sequence[Row]) -> dict[str, Any]:
    """All that others need to repeat the rows, and their figures."""
    return {"trifinger": __version__, "rows": [vars(row) for row in rows]}


def _padded(column: Sequence[str]) -> list[str]:
    width = max(map(len, column))
    return [cell.ljust(width, "-" if cell == "-" else " ") for cell in column]


def _cells(row: Row) -> dict[str, str]:
    figures = cast(dict[str, Any], row.figures)
    scale, unit = (100, "cm") if figures["distance_unit"] == "m" else (1, "rad")
    low, median, high = (
        f"{scale * figures[f'distance_{name}']:.2f}"
        for name in ("lower_quartile", "median", "upper_quartile")
    )
    share = 100 * figures["successes"] / figures["episodes"]
    cost = f"{figures['cost']:.4f} ± {figures['cost_deviation']:.4f}" if "cost" in figures else ""
    return {
        "task": row.task,
        "acts": row.actor,
        "episodes": str(figures["episodes"]),
        "success (95 %)": f"{share:.0f} % ({100 * figures['success_low']:.0f} to "
        f"{100 * figures['success_high']:.0f})",
        "distance at the end (quartiles)": f"{median} {unit} ({low} to {high})",
        "challenge's cost per step": cost,
        "its sum": f"{figures['cost_sum']:.0f}" if "cost" in figures else "",
        "D'Claw's points": f"{figures['points']:.2f}" if "points" in figures else "",
    }


# Numbers of each action. After an early end the last one counts for the rest of the episode.
def _held(series: Array, actions: int) -> Array:
    last = np.sum(~np.isnan(series), axis=1, keepdims=True) - 1
    return np.take_along_axis(series, np.minimum(np.arange(actions)[None], last), axis=1)


def _act_of(name: str, make: Callable[[int], Controller], evaluator: Evaluator) -> Act:
    environment = evaluator.environment
    shape = environment.single_action_space.shape
    each: list[Controller] = []

    def split(observations: Array) -> Iterator[dict[str, Array]]:
        ages = {key: evaluator.info[key] for key in AGES if key in evaluator.info}
        entries = environment.entries(observations) | ages
        for i in range(len(observations)):
            yield {key: part[i] for key, part in entries.items()}

    def act(observations: Array) -> Array:
        seen = list(split(observations))
        if not each:
            each.extend(make(SEED + i) for i in range(len(seen)))
            for one, observation in zip(each, seen, strict=True):
                one.reset(observation, environment)
        actions = np.zeros(environment.action_space.shape or ())
        for i in np.flatnonzero(~evaluator.has_ended):
            action = np.asarray(each[i].act(seen[i]))
            if action.shape != shape or not np.isfinite(action).all():
                raise InvalidArgument(
                    f"'{name}' acts by {action!r}, must be {(shape or (0,))[0]} finite numbers"
                )
            actions[i] = action
        return actions

    return act
