# SPDX-License-Identifier: BSD-3-Clause
"""Moving the cube to a goal: sampling, validation and cost of goals.

Level 1: on the table. 2: lifted at the middle. 3: anywhere. 4: anywhere, and turned. Level -1 is
where an episode begins.
"""

import json
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from trifinger_compat import cube_task as _task
from trifinger_compat.cube_task import NumpyEncoder as NumpyEncoder
from trifinger_compat.generation import chosen as _chosen
from trifinger_compat.types import Array

# Programs replace this, so it is looked up at each call.
random: Any = np.random.RandomState()

# Number of steps of an episode.
_generation = _chosen()
EPISODE_LENGTH = _generation.episode_length
episode_length = EPISODE_LENGTH

_CUBE_WIDTH = 0.065
_ARENA_RADIUS = _task.ARENA_RADIUS
_cube_3d_radius = _CUBE_WIDTH * sqrt(3) / 2
_max_cube_com_distance_to_center = _ARENA_RADIUS - _cube_3d_radius
_min_height = _CUBE_WIDTH / 2
_max_height = _task.MAX_HEIGHT

_box = _task.Box(
    size=(_CUBE_WIDTH,) * 3,
    flat_goals_from=_min_height,
    turned_goals_from=_cube_3d_radius,
    lifted=_min_height + 0.05,
)
_cube_corners = _box.corners

_h = sqrt(0.5)
# The face that is up: blue, green, cyan, yellow, red, magenta.
_base_orientations = [
    Rotation.from_quat(quaternion)
    for quaternion in (
        [0, 0, 0, 1],
        [_h, 0, 0, _h],
        [1, 0, 0, 0],
        [-_h, 0, 0, _h],
        [0, -_h, 0, _h],
        [0, _h, 0, _h],
    )
]

# Which of them may be up when an episode begins; None: all episodes begin with the first one.
_faces = _base_orientations if _generation.turns_faces else None

# The cuboid of 2020's phase 3, when this module was its task.
_CUBOID_SIZE = np.array([0.02, 0.08, 0.02])
_CUBOID_HALF_SIZE = _CUBOID_SIZE / 2


class InvalidGoalError(Exception):
    """A goal that cannot be reached; it keeps `position` and `orientation`."""

    def __init__(self, message: str, position: Any, orientation: Any) -> None:
        super().__init__(message)
        self.position = position
        self.orientation = orientation

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (*self.args, self.position, self.orientation)


class Pose(_task.Pose):
    """Position x, y, z [m] and orientation x, y, z, w."""


def seed(seed: int) -> None:
    """Makes the next goals those of this seed."""
    global random
    random = np.random.RandomState(seed)


def get_cube_corner_positions(pose: Any) -> Array:
    """The corners of the cube at a pose: 8 x 3 [m]."""
    return _task.corners_of(pose, _box)


def sample_goal(difficulty: int) -> Pose:
    """Draws a goal of a level: -1, 1, 2, 3 or 4; else ValueError."""
    return Pose(*_task.sample(random, difficulty, _box, _faces))


def validate_goal(goal: Any) -> None:
    """Raises InvalidGoalError, ValueError or KeyError if a goal, a Pose or dict, is not valid."""
    _task.validate(goal, _box, InvalidGoalError)


def validate_goal_file(filename: str | Path) -> None:
    """Raises AssertionError if a file is not JSON with `difficulty` 1 to 4 and a valid `goal`."""
    _task.check_goal_file(filename, validate_goal)


def evaluate_state(goal_pose: Any, actual_pose: Any, difficulty: int) -> float:
    """The cost of being at a pose, at least 0; poses are dicts or have the two attributes.

    Raises ValueError for a level other than 1 to 4.
    """
    if difficulty not in (1, 2, 3, 4):
        raise ValueError(f"Invalid difficulty {difficulty}, must be 1, 2, 3 or 4")
    cost = _task.position_cost(goal_pose, actual_pose)
    if difficulty < 4:
        return cost
    return (cost + _task.angle_between(goal_pose, actual_pose) / pi) / 2


def goal_to_json(goal: Any) -> str:
    """A goal as JSON: {"position": [..], "orientation": [..]}."""
    parts = {name: _task.part_of(goal, name) for name in ("position", "orientation")}
    return json.dumps(parts, cls=NumpyEncoder)


def goal_from_json(json_string: str) -> Pose:
    """The goal that goal_to_json() has written."""
    return Pose(**json.loads(json_string))


def json_goal_from_config(filename: str | Path) -> str:
    """The `difficulty` and `goal` of a file as JSON; without a goal, a sampled one.

    Raises RuntimeError for whatever is wrong.
    """
    return _task.goal_from_file(filename, sample_goal, validate_goal, Pose.to_dict)
