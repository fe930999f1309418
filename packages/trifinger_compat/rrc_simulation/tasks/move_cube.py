# SPDX-License-Identifier: BSD-3-Clause
"""Moving the cube to a goal; an episode has 3750 steps, and begins with a random yaw."""

from pathlib import Path
from typing import Any

import numpy as np
from trifinger_compat import cube_task as _task
from trifinger_compat.generation import FIRST as _FIRST
from trifinger_simulation.tasks.move_cube import (
    _ARENA_RADIUS as _ARENA_RADIUS,
    _CUBE_WIDTH as _CUBE_WIDTH,
    InvalidGoalError as InvalidGoalError,
    NumpyEncoder as NumpyEncoder,
    Pose as Pose,
    _box as _box,
    _cube_3d_radius as _cube_3d_radius,
    _cube_corners as _cube_corners,
    _max_cube_com_distance_to_center as _max_cube_com_distance_to_center,
    _max_height as _max_height,
    _min_height as _min_height,
    evaluate_state as evaluate_state,
    get_cube_corner_positions as get_cube_corner_positions,
    goal_from_json as goal_from_json,
    goal_to_json as goal_to_json,
    validate_goal as validate_goal,
)

# Programs replace this, so it is looked up at each call.
random: Any = np.random.RandomState()

episode_length = _FIRST.episode_length
EPISODE_LENGTH = episode_length


def seed(seed: int) -> None:
    """Makes the next goals those of this seed."""
    global random
    random = np.random.RandomState(seed)


def sample_goal(difficulty: int, current_pose: Any = None) -> Pose:
    """Draws a goal of a level: -1, 1, 2, 3 or 4; else ValueError."""
    del current_pose
    return Pose(*_task.sample(random, difficulty, _box, None))


def validate_goal_file(filename: str | Path) -> None:
    """Raises AssertionError if a file is not JSON with `difficulty` 1 to 4 and a valid `goal`."""
    _task.check_goal_file(filename, validate_goal)
