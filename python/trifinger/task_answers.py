# SPDX-License-Identifier: BSD-3-Clause
"""Asks tasks in Python for C++, and checks what they answer.

Each answer is a matrix with a row for every robot.
"""

from typing import Any

import numpy as np

from trifinger.arrays import Array
from trifinger.errors import InvalidArgument
from trifinger.tasks import Random, Start, Task, View


def view(
    robots: Array, time: Array, tips: Array, position: Array, orientation: Array, *joints: Array
) -> View:
    """What a task sees, from the rows of each quantity."""
    return View(robots, tips.reshape(len(tips), -1, 3), position, orientation, time[:, 0], *joints)


def start(task: Task, random: Random, count: int, joints: int) -> Array:
    """Position of the joints, then position and orientation of the object; NaN if not given."""
    drawn = task.draw_start(random)
    if not isinstance(drawn, Start):
        raise InvalidArgument(f"draw_start() of {task!r} is {drawn!r:.100}, must be a Start")
    widths = {"position": joints, "object_position": 3, "object_orientation": 4}
    answer = np.full((count, sum(widths.values())), np.nan)
    column = 0
    for name, width in widths.items():
        given = getattr(drawn, name)
        if given is not None:
            answer[:, column : column + width] = _drawn(task, name, given, (count, width))
        column += width
    return answer


def goal(task: Task, random: Random, count: int, width: int) -> Array:
    """The goals that a task draws."""
    return _drawn(task, "draw_goal()", task.draw_goal(random), (count, width))


def judged(task: Task, seen: View) -> Array:
    """Reward, success, whether nothing can follow, number of goals, and what is achieved."""
    count = len(seen.time)
    answer = np.empty((count, 4 + len(task.goal_low)))
    achieved = _answer(task, "achieve()", task.achieve(seen), (count, len(task.goal_low)))
    answer[:, 4:] = achieved
    one = (count,)
    reward = _answer(task, "reward()", task.reward(achieved, seen.goal), one)
    answer[:, 0] = reward - _answer(task, "cost()", task.cost(seen), one)
    answer[:, 1] = _truth(task, "is_success()", task.is_success(achieved, seen.goal), one)
    answer[:, 2] = _truth(task, "has_ended()", task.has_ended(seen), one)
    answer[:, 3] = _answer(task, "num_goals()", task.num_goals(seen.time), one)
    return answer


def shown(task: Task, seen: View) -> Array:
    """What a task shows of itself: the numbers of its `entries`."""
    width = sum(len(entry.low) for entry in task.entries)
    return _answer(task, "show()", task.show(seen), (len(seen.time), width))


def rewards(task: Task, achieved: Array, desired: Array) -> Array:
    """One reward for each row of goals."""
    return _answer(task, "reward()", task.reward(achieved, desired), (len(achieved),))


# What is drawn may be the same for all robots.
def _drawn(task: Task, name: str, given: Any, shape: tuple[int, int]) -> Array:
    array = _array(task, name, given)
    if array.shape == shape[1:]:
        array = np.broadcast_to(array, shape)
    return _answer(task, name, array, shape)


# A distance is no truth value, though NumPy would take it as one.
def _truth(task: Task, name: str, given: Any, shape: tuple[int, ...]) -> Array:
    array = _answer(task, name, given, shape)
    if not np.isin(array, (0.0, 1.0)).all():
        raise InvalidArgument(f"{name} of {task!r} is {given!r:.100}, must be True or False")
    return array


def _answer(task: Task, name: str, given: Any, shape: tuple[int, ...]) -> Array:
    array = _array(task, name, given)
    if array.shape != shape:
        raise InvalidArgument(
            f"{name} of {task!r} has the shape {array.shape}, must have {shape}: a row for each of "
            f"{shape[0]} robots"
        )
    is_finite = np.isfinite(array)
    if not is_finite.all():
        row = int(np.argmin(is_finite.reshape(shape[0], -1).all(axis=1)))
        raise InvalidArgument(f"{name} of {task!r} is {array[row]} in row {row}, must be finite")
    return array


def _array(task: Task, name: str, given: Any) -> Array:
    try:
        return np.asarray(given, np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(
            f"{name} of {task!r} is {given!r:.100}, must be an array of numbers: {error}"
        ) from error
