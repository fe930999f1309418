# SPDX-License-Identifier: BSD-3-Clause
"""Marks say which steps of a log are an episode.

A session is an episode by itself. Several episodes in one session need marks: lines of a file
`NAME.episodes.jsonl`, by habit in the folder of the logs. The program that controls the robot knows
its steps, so it writes them:

    with EpisodeMarks("logs/run.episodes.jsonl") as marks:
        for _ in range(10):
            begin = robot.append_desired_action(start)
            ...                                      # an episode
            end = robot.append_desired_action(last)
            marks.add(robot, begin, end, task="Push the cube to the middle")
"""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from trifinger.errors import InvalidArgument

if TYPE_CHECKING:
    from trifinger._trifinger import Frontend
    from trifinger.arrays import Array

ENDING = ".episodes.jsonl"
VERSION = 1


@dataclasses.dataclass(frozen=True, kw_only=True)
class Mark:
    """An episode: the steps of a session from `first` to before `end`."""

    session_id: int
    """That of `robot.session_info()` and of the session in the log."""
    first: int
    end: int
    task: str = ""
    """What was to be done, as a sentence. Empty: what the export says."""
    terminated: bool = False
    """True if nothing could follow. Any other end is a truncation."""
    success: bool | None = None
    """None if nobody has judged."""
    decisions: Decisions | None = None
    """What a learning environment saw, chose and got, if one has made the episode."""

    def __post_init__(self) -> None:
        if not 0 <= self.first < self.end:
            raise InvalidArgument(
                f"an episode from step {self.first} to before step {self.end} has no steps"
            )

    def to_json(self) -> str:
        """The mark as a line of a file."""
        numbers = {name: value for name, value in vars(self).items() if value is not None}
        if self.decisions is not None:
            numbers["decisions"] = {
                name: value.tolist() if isinstance(value, np.ndarray) else value
                for name, value in vars(self.decisions).items()
            }
        return json.dumps({"version": VERSION, **numbers})

    @classmethod
    def from_json(cls, text: str) -> Self:
        """A mark from the line that to_json() returned. Raises InvalidArgument."""
        try:
            numbers = json.loads(text)
            if not isinstance(numbers, dict):
                raise TypeError("expected is a JSON object")
            if (version := numbers.pop("version", None)) != VERSION:
                raise ValueError(f"its version is {version}, this program reads {VERSION}")
            decisions = numbers.pop("decisions", None)
            return cls(decisions=None if decisions is None else Decisions(**decisions), **numbers)
        except (TypeError, ValueError) as error:
            raise InvalidArgument(f"no mark of an episode: {error}") from error


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Decisions:
    """An episode of a learning environment: T actions, and T + 1 observations.

    Lists become arrays, because an export has the decisions of all episodes in memory.
    """

    environment: str
    """How the environment is made, JSON: task, options, config and config_overrides of
    `Environment`, the wrappers around it, and the limits of a robot from a file."""
    seed: int
    episode: int
    """The number of the episode among those of the seed."""
    steps: Array
    """The robot's step of each observation: int64[T + 1]."""
    observations: Array
    """The environment's observations: float32[T + 1, ...]."""
    actions: Array
    """float32[T, ...]"""
    rewards: Array
    """float64[T]"""

    def __post_init__(self) -> None:
        for name, dtype, dimensions in (
            ("steps", np.int64, 1),
            ("observations", np.float32, 2),
            ("actions", np.float32, 2),
            ("rewards", np.float64, 1),
        ):
            values = np.asarray(getattr(self, name), dtype)
            if values.ndim != dimensions and not values.ndim > dimensions == 2:
                raise InvalidArgument(
                    f"the {name} of an episode have the shape {values.shape}; expected are "
                    f"{dimensions} dimensions"
                )
            object.__setattr__(self, name, values)
        count = len(self.actions)
        numbers = (len(self.observations), len(self.steps), len(self.rewards))
        if numbers != (count + 1, count + 1, count):
            raise InvalidArgument(
                f"{count} actions need as many rewards, and one more observation and step; there "
                f"are {numbers[2]} rewards, {numbers[0]} observations and {numbers[1]} steps"
            )


class EpisodeMarks:
    """A file of marks that is being written. Each mark is with the kernel when `add` returns."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Begins the file, or goes on at its end. Raises OSError."""
        self.path = Path(path)
        if not self.path.name.endswith(ENDING):
            raise InvalidArgument(f"{self.path} must end in {ENDING}, so that exports find it")
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._file = self.path.open("a", encoding="utf-8")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add(
        self,
        robot: Frontend,
        first: int,
        end: int,
        *,
        task: str = "",
        terminated: bool = False,
        success: bool | None = None,
    ) -> None:
        """Marks the steps from `first` to before `end` of the present session of `robot`."""
        self.write(
            Mark(
                session_id=robot.session_info().session_id,
                first=first,
                end=end,
                task=task,
                terminated=terminated,
                success=success,
            )
        )

    def write(self, mark: Mark) -> None:
        """Adds a mark."""
        self._file.write(mark.to_json() + "\n")
        self._file.flush()

    def close(self) -> None:
        """Closes the file."""
        self._file.close()


def read_marks(path: Path) -> list[Mark]:
    """The marks in a file. A last line that was cut off by a kill is left out.

    Raises InvalidArgument with the number of the line that is no mark; OSError.
    """
    marks = []
    with path.open("rb") as file:
        for number, line in enumerate(file, 1):
            if not line.endswith(b"\n") or not line.strip():
                continue
            try:
                marks.append(Mark.from_json(line.decode()))
            except (InvalidArgument, UnicodeDecodeError) as error:
                raise InvalidArgument(f"{path}, line {number}: {error}") from error
    return marks


def environment_of(decisions: Decisions) -> dict[str, Any]:
    """How the environment of an episode was made; `Decisions.environment` names the keys."""
    made: dict[str, Any] = json.loads(decisions.environment)
    return made
