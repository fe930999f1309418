# SPDX-License-Identifier: BSD-3-Clause
"""What the tasks with a cube or cuboid have in common: poses, goals, costs, files."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, pi, sin, sqrt
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from trifinger_compat.types import Array, Numbers

ARENA_RADIUS = 0.195  # [m]
MAX_HEIGHT = 0.1  # of goals [m]
LOWEST_CORNER = -1e-10  # [m]


@dataclass(frozen=True)
class Box:
    """The object of a task; lengths in m."""

    size: tuple[float, float, float]
    flat_goals_from: float  # height of goals without orientation
    turned_goals_from: float  # height of goals with one
    lifted: float  # height of goals of level 2

    @property
    def radius(self) -> float:
        """Distance of the farthest corner from the centre."""
        return 0.5 * sqrt(sum(length**2 for length in self.size))

    @property
    def max_distance(self) -> float:
        """Largest distance of the centre from the middle of the arena."""
        return ARENA_RADIUS - self.radius

    @property
    def corners(self) -> Array:
        """The eight corners, from --- to +++."""
        signs = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
        corners: Array = np.array(signs) * np.array(self.size) / 2
        return corners


def position_of(random: Any, box: Box, height: Callable[[], float]) -> Array:
    """Draws a place in the arena, and then its height."""
    radius = box.max_distance * sqrt(random.random())
    angle = random.uniform(0, 2 * pi)
    return np.array([radius * cos(angle), radius * sin(angle), height()])


def sample(
    random: Any, difficulty: int, box: Box, faces: Sequence[Rotation] | None
) -> tuple[Array, Any]:
    """Draws position and orientation of a goal; with `faces`, level -1 turns one of them up."""
    if difficulty == -1:
        position = position_of(random, box, lambda: box.flat_goals_from)
        face = faces[random.choice(range(6))] if faces is not None else Rotation.identity()
        yaw = random.uniform(0, 2 * pi)
        return position, (Rotation.from_euler("z", yaw) * face).as_quat()
    level = np.array([0, 0, 0, 1])
    if difficulty == 1:
        return position_of(random, box, lambda: box.flat_goals_from), level
    if difficulty == 2:
        return np.array([0.0, 0.0, box.lifted]), level
    if difficulty == 3:
        lowest = box.flat_goals_from
        return position_of(random, box, lambda: random.uniform(lowest, MAX_HEIGHT)), level
    if difficulty == 4:
        lowest = box.turned_goals_from
        position = position_of(random, box, lambda: random.uniform(lowest, MAX_HEIGHT))
        # What SciPy draws for one random rotation, whatever its version.
        return position, Rotation.from_quat(random.normal(size=4)).as_quat()
    raise ValueError(f"Invalid difficulty {difficulty}, must be -1, 1, 2, 3 or 4")


def part_of(pose: Any, name: str) -> Any:
    """The position or orientation of a dict, or of any object that has it."""
    return pose[name] if isinstance(pose, dict) else getattr(pose, name)


def position_cost(goal: Any, actual: Any) -> float:
    """Half of the distance in the plane and half of that in height, relative to the largest."""
    error = np.asarray(part_of(goal, "position")) - np.asarray(part_of(actual, "position"))
    flat = float(np.linalg.norm(error[:2])) / (2 * ARENA_RADIUS)
    return (flat + abs(float(error[2])) / MAX_HEIGHT) / 2


def validate(goal: Any, box: Box, error: Callable[[str, Any, Any], Exception]) -> None:
    """Raises ValueError for wrong sizes, `error` for a goal that cannot be reached."""
    position, orientation = part_of(goal, "position"), part_of(goal, "orientation")
    if len(position) != 3:
        raise ValueError(f"len(goal.position) is {len(position)}, must be 3")
    if len(orientation) != 4:
        raise ValueError(f"len(goal.orientation) is {len(orientation)}, must be 4")
    if np.linalg.norm(np.asarray(position)[:2]) > box.max_distance:
        raise error("Position is outside of the arena circle.", position, orientation)
    if position[2] < box.flat_goals_from:
        raise error("Position is too low.", position, orientation)
    if position[2] > MAX_HEIGHT:
        raise error("Position is too high.", position, orientation)
    if corners_of(goal, box)[:, 2].min() < LOWEST_CORNER:
        raise error("Position of a corner is too low.", position, orientation)


def corners_of(pose: Any, box: Box) -> Array:
    """The corners of the object at a pose, in the world: 8 x 3 [m]."""
    rotation = Rotation.from_quat(part_of(pose, "orientation"))
    turned: Array = rotation.apply(box.corners)
    turned += np.asarray(part_of(pose, "position"))
    return turned


def angle_between(goal: Any, actual: Any) -> float:
    """Angle of the rotation from one pose to the other, 0 to pi [rad]."""
    goal_rotation = Rotation.from_quat(part_of(goal, "orientation"))
    actual_rotation = Rotation.from_quat(part_of(actual, "orientation"))
    return float((goal_rotation.inv() * actual_rotation).magnitude())


class NumpyEncoder(json.JSONEncoder):
    """Writes arrays as lists, and numbers of NumPy as numbers."""

    def default(self, o: Any) -> Any:
        """An array as a list."""
        if isinstance(o, np.ndarray):
            return o.tolist()
        if isinstance(o, np.generic):
            return o.item()
        return super().default(o)


class Pose:
    """Position x, y, z [m] and orientation x, y, z, w."""

    position: Any
    orientation: Any

    def __init__(self, position: Numbers | None = None, orientation: Numbers | None = None) -> None:
        """Arrays are kept without a copy."""
        zeros = np.array([0, 0, 0], dtype=np.float32)
        identity = np.array([0, 0, 0, 1], dtype=np.float32)
        self.position = zeros if position is None else np.asarray(position)
        self.orientation = identity if orientation is None else np.asarray(orientation)

    def to_dict(self) -> dict[str, Any]:
        """{"position": array, "orientation": array}."""
        return {"position": self.position, "orientation": self.orientation}

    def to_json(self) -> str:
        """The dict as JSON."""
        return json.dumps(self.to_dict(), cls=NumpyEncoder)

    @classmethod
    def from_dict(cls, pose_dict: dict[str, Any]) -> "Pose":
        """The pose that to_dict() has given."""
        return cls(pose_dict["position"], pose_dict["orientation"])

    @classmethod
    def from_json(cls, json_str: str) -> "Pose":
        """The pose that to_json() has given."""
        return cls.from_dict(json.loads(json_str))

    def __repr__(self) -> str:
        return f"Pose(position={self.position!r}, orientation={self.orientation!r})"


def check_goal_file(path: str | Path, validate_goal: Callable[[Any], None]) -> None:
    """Raises AssertionError if a file is no JSON with a `difficulty` and perhaps a `goal`."""
    try:
        content = json.loads(Path(path).read_text())
    except (OSError, ValueError) as error:
        raise AssertionError(f"{path} cannot be read as JSON: {error}") from error
    assert isinstance(content, dict), f"{path} must have an object"  # noqa: S101
    assert content.get("difficulty") in (1, 2, 3, 4), f"{path} has no difficulty of 1 to 4"  # noqa: S101
    if "goal" in content:
        try:
            validate_goal(content["goal"])
        except Exception as error:
            raise AssertionError(f"the goal in {path} is not valid: {error}") from error


def goal_from_file(
    path: str | Path,
    sample_goal: Callable[[int], Any],
    validate_goal: Callable[[Any], None],
    to_dict: Callable[[Any], Any],
) -> str:
    """The goal of a file, or a sampled one, as JSON; RuntimeError for whatever is wrong."""
    try:
        content = json.loads(Path(path).read_text())
        difficulty = int(content["difficulty"])
        if difficulty not in (1, 2, 3, 4):
            raise ValueError(f"difficulty is {difficulty}, must be 1 to 4")
        if "goal" in content:
            goal = content["goal"]
            validate_goal(goal)
        else:
            goal = to_dict(sample_goal(difficulty))
        return json.dumps({"difficulty": difficulty, "goal": goal}, cls=NumpyEncoder)
    except Exception as error:
        raise RuntimeError(f"Failed to load goal configuration from {path}: {error}") from error
