# SPDX-License-Identifier: BSD-3-Clause
"""Tasks of your own, for one robot or many simulations at once.

    class Middle(Task):
        goal_low = (-0.1, -0.1, 0.05)
        goal_high = (0.1, 0.1, 0.15)

        def achieve(self, view):
            return view.tips.mean(axis=1)

    environment = Environment(Middle())
    environments = VectorEnvironment("my_tasks:Middle", 64)

All functions are about N robots: arrays have a row for each. In `Environment` N is 1. After each
action they are called once for all robots, never while physics run. docs/environments.md has the
rest.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from trifinger import own_class
from trifinger._trifinger import Random as Random
from trifinger.arrays import Array
from trifinger.environment_options import OptionFields
from trifinger.errors import InvalidArgument


@dataclasses.dataclass(kw_only=True)
class Start:
    """Where episodes begin: a row for each robot, or one for all.

    None: the usual position of the joints, and the place of the object in the configuration.
    """

    position: npt.ArrayLike | None = None
    """Joint positions, N x joints [rad], [m]."""
    object_position: npt.ArrayLike | None = None
    """Centres of the task's object, N x 3 [m]."""
    object_orientation: npt.ArrayLike | None = None
    """Orientations of that object, N x 4: quaternions w, x, y, z."""


@dataclasses.dataclass(slots=True)
class View:
    """What was measured of N robots, each at one instant, in the world frame."""

    robots: npt.NDArray[np.int64]
    """Places of these robots in their environment, N numbers from 0: rows of data of your own."""
    tips: Array
    """Positions of the finger tips, or of the frames of a robot from a file, N x tips x 3 [m]."""
    object_position: Array
    """Centres of the task's object, N x 3 [m]; zeros without an object."""
    object_orientation: Array
    """Orientations of that object, N x 4: quaternions w, x, y, z with w >= 0."""
    time: Array
    """Times since the episodes began, N numbers [s]."""
    position: Array
    """Joint positions, N x joints [rad], [m]."""
    velocity: Array
    """Joint velocities, N x joints [rad/s], [m/s]."""
    joint_position: Array
    """Positions of all hinges and slides of robots from a file, driven or not [rad], [m]."""
    joint_velocity: Array
    """Their velocities [rad/s], [m/s]."""
    goal: Array
    """Goals, N x numbers of a goal [`goal_unit`]."""
    action: Array
    """Last actions, N x joints, from -1 to 1."""


@dataclasses.dataclass(frozen=True)
class Entry:
    """A part of an observation: a name, and bounds for each of its numbers."""

    name: str
    low: Sequence[float]
    """Values below `low` or above `high` are cut off."""
    high: Sequence[float]
    unit: str = "1"


class Task:
    """What is to be done with robots: starts, goals, observation, reward and success.

    Derive from it, set the attributes and override the functions that differ. An object serves one
    environment, so it may keep data of each robot: `prepare` makes them, `draw_start` resets those
    of the robots `random.robots`. All randomness must come from the `random` that it is given: then
    the same seed gives the same episodes. What is computed for a robot must not depend on others.
    """

    name: ClassVar[str] = "my_task"
    options: ClassVar[OptionFields] = OptionFields()
    """Options that this task has by default: a `trifinger.environments.Options`."""
    robot: ClassVar[str] = "trifinger_edu"
    """Configuration of the robot that this task is usually for."""
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
    """Lower bounds of a goal, 1 to 96 numbers."""
    goal_high: Sequence[float] = ()
    entries: ClassVar[Sequence[Entry]] = ()
    """All that is observed, if `show` says it. Empty: joints, object, last action and goal."""

    def prepare(self, num_robots: int) -> None:
        """Called once, before all others, with the number of robots of the environment."""

    def draw_start(self, random: Random) -> Start:
        """Draws where episodes of the robots `random.robots` begin."""
        return Start()

    def draw_goal(self, random: Random) -> npt.ArrayLike:
        """Draws a goal for each of them, N rows; by default uniformly within its bounds."""
        return random.uniform(self.goal_low, self.goal_high)

    def num_goals(self, time: Array) -> npt.ArrayLike:
        """Numbers of goals that episodes have had until `time` [s], N numbers."""
        return np.ones(len(time))

    def achieve(self, view: View) -> npt.ArrayLike:
        """Says what is achieved, in the numbers of goals, N rows. Called once per observation."""
        raise NotImplementedError(f"{type(self).__name__}.achieve is missing")

    def reward(self, achieved: Array, desired: Array) -> npt.ArrayLike:
        """The rewards of actions, N numbers; by default the distances of both, negated."""
        return -_distances(achieved, desired)

    def cost(self, view: View) -> npt.ArrayLike:
        """What rewards lose for how the robots move, N numbers."""
        return np.zeros(len(view.time))

    def is_success(self, achieved: Array, desired: Array) -> npt.ArrayLike:
        """Whether goals are reached, N truth values; by default to 2 cm."""
        return _distances(achieved, desired) <= 0.02

    def has_ended(self, view: View) -> npt.ArrayLike:
        """Whether nothing can follow, N truth values: then an episode is terminated."""
        return np.zeros(len(view.time), bool)

    def show(self, view: View) -> npt.ArrayLike:
        """What is observed, N rows: the numbers of all `entries`, one entry after the other."""
        raise NotImplementedError(f"{type(self).__name__}.show is missing: it has entries")

    def __repr__(self) -> str:
        return f"{type(self).__name__}()"


def _distances(achieved: Array, desired: Array) -> Array:
    distances: Array = np.linalg.norm(achieved - desired, axis=1)
    return distances


def load(name: str) -> type[Task]:
    """The class of a task by its name MODULE:CLASS, as in "my_tasks:Middle".

    The module is found like any other, or in the current folder. Raises InvalidArgument.
    """
    found = own_class.load("task", name)
    if not (isinstance(found, type) and issubclass(found, Task)):
        module_name, _, class_name = name.partition(":")
        raise InvalidArgument(
            f"the module '{module_name}' has no class '{class_name}' that is derived from "
            "trifinger.tasks.Task"
        )
    return found
