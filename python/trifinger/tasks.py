# SPDX-License-Identifier: BSD-3-Clause
"""Tasks of your own for `trifinger.environments.Environment`.

    class Middle(Task):
        name = "middle"
        goal_low = (-0.1, -0.1, 0.05)
        goal_high = (0.1, 0.1, 0.15)

        def achieve(self, view):
            return view.tips.mean(axis=0)

    environment = Environment(Middle())

docs/environments.md has the rest. Tasks for `VectorEnvironment` are written in C++.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from trifinger._trifinger import Random as Random
from trifinger.environment_options import OptionFields

Array = npt.NDArray[np.float64]


@dataclasses.dataclass(kw_only=True)
class Start:
    """The beginning of an episode. None leaves the usual position."""

    position: npt.ArrayLike | None = None
    """Joint positions [rad]."""
    object_position: npt.ArrayLike | None = None
    """Centre of the task's object: x, y, z [m]."""
    object_orientation: npt.ArrayLike | None = None
    """Orientation of that object: a quaternion w, x, y, z."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class View:
    """What was measured at one instant, in the world frame."""

    tips: Array
    """Positions of the finger tips, or of the frames of a robot from a file, a row for each [m]."""
    object_position: Array
    """Centre of the task's object [m]; zeros without an object."""
    object_orientation: Array
    """Orientation of that object: a quaternion w, x, y, z with w >= 0."""
    time: float
    """Time since the episode began [s]."""
    position: Array
    """Joint positions [rad], [m]."""
    velocity: Array
    """Joint velocities [rad/s], [m/s]."""
    joint_position: Array
    """Positions of all hinges and slides of a robot from a file, driven or not [rad], [m]."""
    joint_velocity: Array
    """Their velocities [rad/s], [m/s]."""


class Task:
    """What is to be done with a robot: starts, goals, reward and success.

    Derive from it, set the attributes and override the functions that differ. One task serves one
    environment, so it may keep data of an episode in attributes of its own; `draw_start` is the
    place to reset them. All randomness must come from the `random` that it is given: then the same
    seed gives the same episodes.
    """

    name: ClassVar[str] = "my_task"
    options: ClassVar[OptionFields] = OptionFields()
    """Options that this task has by default: a `trifinger.environments.Options`."""
    config_overrides: ClassVar[Mapping[str, object]] = {"objects": []}
    """What the configuration of a TriFinger must say, for example the objects on the table."""
    num_fingers: ClassVar[int] = 3
    """Number of fingers of the TriFingers that this task is for; 0: for none."""
    is_for_files: ClassVar[bool] = False
    """Whether this task is for robots from files: docs/any_robot.md."""
    object_name: ClassVar[str] = ""
    """Name of the object that the task is about; empty for none."""
    has_goals_of_fingers: ClassVar[bool] = False
    """Whether each finger has a goal of its own, of three numbers."""
    goal_unit: ClassVar[str] = "m"
    goal_low: Sequence[float] = ()
    """Lower bounds of a goal, 1 to 9 numbers."""
    goal_high: Sequence[float] = ()

    def draw_start(self, random: Random) -> Start:
        """Draws the beginning of an episode."""
        return Start()

    def draw_goal(self, random: Random) -> npt.ArrayLike:
        """Draws a goal; by default uniformly within its bounds."""
        bounds = zip(self.goal_low, self.goal_high, strict=True)
        return [random.uniform(low, high) for low, high in bounds]

    def num_goals(self, time: float) -> int:
        """Number of goals that an episode has had until `time` [s]."""
        return 1

    def achieve(self, view: View) -> npt.ArrayLike:
        """Says what is achieved, in the numbers of a goal. Called once for each observation."""
        raise NotImplementedError(f"{type(self).__name__}.achieve is missing")

    def reward(self, achieved: Array, desired: Array) -> float:
        """The reward of an action; by default the distance between both, negated."""
        return -float(np.linalg.norm(achieved - desired))

    def is_success(self, achieved: Array, desired: Array) -> bool:
        """Whether the goal is reached; by default to 2 cm."""
        return bool(np.linalg.norm(achieved - desired) <= 0.02)

    def has_ended(self, view: View) -> bool:
        """Whether nothing can follow: then the episode is terminated."""
        return False

    def __repr__(self) -> str:
        return f"{type(self).__name__}()"
