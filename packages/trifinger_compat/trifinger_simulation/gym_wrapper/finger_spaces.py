# SPDX-License-Identifier: BSD-3-Clause
"""Spaces of the environments `reach-v0` and `push-v0`."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from trifinger_compat.spaces import box
from trifinger_compat.types import Array

# Of one finger; angles in degrees.
_ACTION_ANGLES = ([-70, -70, -160], [70, 0, -2])
_ANGLES = ([-90, -90, -172], [90, 100, -2])
_ARENA = ([-0.5, -0.5, 0.0], [0.5, 0.5, 0.5])  # [m]


class FingerSpaces:
    """Bounds of all that an observation can have, and spaces of what it has.

    `lower_bounds` and `upper_bounds` are by key; `key_to_index` says where a key is in an
    observation. Angles are in rad, speeds in rad/s, positions in m.
    """

    def __init__(
        self,
        num_fingers: int,
        observations_keys: Sequence[str],
        observations_sizes: Sequence[int],
        separate_goals: bool,
    ) -> None:
        """`separate_goals`: each finger has its own goal. Raises ValueError for wrong sizes."""
        self.num_fingers = num_fingers
        self.observations_keys, self.observations_sizes = observations_keys, observations_sizes
        self.separate_goals = separate_goals
        ends = np.cumsum(observations_sizes).tolist()
        begins = [0, *ends[:-1]]
        self.key_to_index = {
            key: slice(begin, end)
            for key, begin, end in zip(observations_keys, begins, ends, strict=True)
        }
        joints = np.ones(3 * num_fingers)
        goals = joints if separate_goals else np.ones(3)
        actions, angles = np.radians(_ACTION_ANGLES), np.radians(_ANGLES)
        bounds: dict[str, tuple[Any, Any]] = {
            "action_joint_positions": tuple(np.tile(actions, num_fingers)),
            "end_effector_position": tuple(np.tile(_ARENA, num_fingers)),
            "joint_positions": tuple(np.tile(angles, num_fingers)),
            "joint_velocities": (-20 * joints, 20 * joints),
            "end_effector_to_goal": (-0.5 * joints, 0.5 * joints),
            "goal_position": (-0.5 * goals, 0.5 * goals),
            "object_position": tuple(np.array(_ARENA)),
        }
        self.lower_bounds: dict[str, Array] = {key: low for key, (low, _) in bounds.items()}
        self.upper_bounds: dict[str, Array] = {key: high for key, (_, high) in bounds.items()}
        self.action_bounds = {
            "low": self.lower_bounds["action_joint_positions"],
            "high": self.upper_bounds["action_joint_positions"],
        }

    def get_unscaled_observation_space(self) -> Any:
        """The space of observations."""
        keys = self.observations_keys
        low = np.concatenate([self.lower_bounds[key] for key in keys])
        high = np.concatenate([self.upper_bounds[key] for key in keys])
        return box(low, high, "float64")

    def get_unscaled_action_space(self) -> Any:
        """The space of actions."""
        return box(self.action_bounds["low"], self.action_bounds["high"], "float64")

    def get_scaled_observation_space(self) -> Any:
        """The space of observations that were scaled to -1 to 1."""
        return _scaled(self.get_unscaled_observation_space())

    def get_scaled_action_space(self) -> Any:
        """The space of actions that were scaled to -1 to 1."""
        return _scaled(self.get_unscaled_action_space())


def _scaled(space: Any) -> Any:
    return box(-np.ones(space.shape), np.ones(space.shape), "float64")
