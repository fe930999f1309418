# SPDX-License-Identifier: BSD-3-Clause
"""Moving the cuboid of 2 x 8 x 2 cm, the task of 2020's phase 3."""

from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from trifinger_compat import cube_task as _task
from trifinger_compat.types import Array

from trifinger_simulation.tasks.move_cube import (
    InvalidGoalError as InvalidGoalError,
    NumpyEncoder as NumpyEncoder,
    Pose as Pose,
    _base_orientations as _base_orientations,
    _faces as _faces,
    goal_from_json as goal_from_json,
    goal_to_json as goal_to_json,
)

random: Any = np.random.RandomState()

EPISODE_LENGTH = 2 * 60 * 1000
episode_length = EPISODE_LENGTH

_CUBOID_SIZE = np.array([0.02, 0.08, 0.02])
_CUBOID_HALF_SIZE = _CUBOID_SIZE / 2
_ARENA_RADIUS = _task.ARENA_RADIUS
_min_height = 0.01
_max_height = _task.MAX_HEIGHT

_flat = _task.Box(
    size=(0.02, 0.08, 0.02), flat_goals_from=_min_height, turned_goals_from=0.0, lifted=0.06
)
_cube_3d_radius = _flat.radius
_max_cube_com_distance_to_center = _flat.max_distance
_box = _task.Box(
    size=_flat.size,
    flat_goals_from=_min_height,
    turned_goals_from=_cube_3d_radius,
    lifted=_flat.lifted,
)
_cube_corners = _box.corners


def get_cube_corner_positions(pose: Any) -> Array:
    """The corners of the cuboid at a pose: 8 x 3 [m]."""
    return _task.corners_of(pose, _box)


def sample_goal(difficulty: int) -> Pose:
    """Draws a goal of a level: -1, 1, 2, 3 or 4; else ValueError.

    Level -1 is like the original's: the cuboid may stand on end, and then is partly in the table.
    """
    return Pose(*_task.sample(random, difficulty, _box, _faces))


def validate_goal(goal: Any) -> None:
    """Raises InvalidGoalError, ValueError or KeyError if a goal, a Pose or dict, is not valid."""
    _task.validate(goal, _box, InvalidGoalError)


def validate_goal_file(filename: str | Path) -> None:
    """Raises AssertionError if a file is not JSON with `difficulty` 1 to 4 and a valid `goal`."""
    _task.check_goal_file(filename, validate_goal)


def evaluate_state(goal_pose: Any, actual_pose: Any, difficulty: int) -> float:
    """The cost of being at a pose, at least 0; level 4 counts the angle of the long axis."""
    if difficulty not in (1, 2, 3, 4):
        raise ValueError(f"Invalid difficulty {difficulty}, must be 1, 2, 3 or 4")
    cost = _task.position_cost(goal_pose, actual_pose)
    if difficulty < 4:
        return cost
    goal_axis, actual_axis = (
        Rotation.from_quat(_task.part_of(pose, "orientation")).apply([0, 1, 0])
        for pose in (goal_pose, actual_pose)
    )
    # Rounding keeps equal axes from having a product above 1.
    angle = float(np.arccos(np.round(goal_axis @ actual_axis, 10)))
    return (cost + angle / pi) / 2
