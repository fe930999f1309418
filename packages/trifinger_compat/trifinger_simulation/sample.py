# SPDX-License-Identifier: BSD-3-Clause
"""Random positions of joints and tips. They come from Python's global `random`."""

import random
from collections.abc import Sequence
from math import cos, pi, radians, sin, sqrt
from typing import Any

import numpy as np
from trifinger_compat.types import Array

_LOWER = (radians(-30), radians(-60), radians(-100))
_UPPER = (radians(30), radians(60), radians(2))
# Of joints whose tips are goals.
_REACH_LOWER = (radians(-90), radians(-77.5), radians(-172))
_REACH_UPPER = (radians(90), radians(257.5), radians(-2))


def random_joint_positions(
    number_of_fingers: int,
    lower_bounds: Sequence[float] = _LOWER,
    upper_bounds: Sequence[float] = _UPPER,
) -> list[float]:
    """Angles of all joints within the bounds of one finger [rad]."""
    return [
        random.uniform(low, high)
        for _ in range(number_of_fingers)
        for low, high in zip(lower_bounds, upper_bounds, strict=True)
    ]


def random_position_in_arena(
    height_limits: tuple[float, float] | float = (0.05, 0.15),
    angle_limits: tuple[float, float] = (-2 * pi, 2 * pi),
    radius_limits: tuple[float, float] = (0.0, 0.15),
) -> list[float]:
    """A position x, y, z above the table, evenly spread over its area [m].

    `height_limits` may also be the height itself.
    """
    angle = random.uniform(*angle_limits)
    low, high = radius_limits
    radius = sqrt(random.uniform(low**2, high**2))
    if isinstance(height_limits, int | float):
        height = float(height_limits)
    else:
        height = random.uniform(*height_limits)
    return [radius * cos(angle), radius * sin(angle), height]


def feasible_random_joint_positions_for_reaching(
    finger: Any, action_bounds: Any, sampling_strategy: str = "separated"
) -> Array:
    """Angles of all joints whose tips are good goals for reaching [rad].

    `action_bounds` has `low` and `high`. "separated" draws each finger where it does not touch the
    others, "uniform" draws evenly within the bounds, and "triangle" puts the tips around a point.
    """
    fingers = finger.number_of_fingers
    low, high = np.asarray(action_bounds["low"]), np.asarray(action_bounds["high"])
    if sampling_strategy == "uniform":
        return np.array(random_joint_positions(fingers, low[:3].tolist(), high[:3].tolist()))
    if sampling_strategy == "triangle":
        return _triangle(finger, low, high)
    if sampling_strategy != "separated":
        raise ValueError(
            f"sampling_strategy is '{sampling_strategy}', must be separated, uniform or triangle"
        )
    return np.concatenate([_separated(finger, i, low, high) for i in range(fingers)])


def _separated(finger: Any, index: int, low: Array, high: Array) -> Array:
    own = slice(3 * index, 3 * index + 3)
    while True:
        angles = np.random.uniform(_REACH_LOWER, _REACH_UPPER)  # noqa: NPY002  # clients seed it
        if np.any(angles < low[own]) or np.any(angles > high[own]):
            continue
        whole = np.tile(angles, finger.number_of_fingers)
        x, y, _ = finger.kinematics.forward_kinematics(whole)[0]
        azimuth, distance = np.arctan2(y, x), np.hypot(x, y)
        if radians(30) < azimuth < radians(150) and y > 0 and 0.02 < distance < 0.2:
            return angles


def _triangle(finger: Any, low: Array, high: Array) -> Array:
    while True:
        middle = random_position_in_arena()
        tips = get_tip_positions_around_position(finger.number_of_fingers, middle)
        guess = np.array(random_joint_positions(finger.number_of_fingers))
        angles, errors = finger.kinematics.inverse_kinematics(tips, guess)
        is_inside = np.all(angles >= low) and np.all(angles <= high)
        if is_inside and np.linalg.norm(errors, axis=1).max() < 0.01:
            found: Array = angles
            return found


def get_tip_positions_around_position(
    number_of_fingers: int, position: Sequence[float]
) -> list[Array]:
    """Positions of the tips 5 cm around a point, or at the point for a single finger [m].

    Raises ValueError for any other number of fingers than one and three.
    """
    if number_of_fingers not in (1, 3):
        raise ValueError(f"Invalid number of fingers: {number_of_fingers}, must be 1 or 3")
    if number_of_fingers == 1:
        return [np.array(position, dtype=float)]
    return [
        np.asarray(position) + 0.05 * np.array([cos(turn), sin(turn), 0.0])
        for turn in (radians(-120 * finger) for finger in range(number_of_fingers))
    ]
