# SPDX-License-Identifier: BSD-3-Clause
"""Ranges of numbers, as arrays and as spaces of Gymnasium or of the older Gym."""

from __future__ import annotations

import sys
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trifinger_compat.generation import Generation
from trifinger_compat.types import Numbers

if TYPE_CHECKING:
    from gymnasium.spaces import Box


def gym_package() -> Any:
    """The older Gym if the program has imported it, else Gymnasium."""
    if "gym" in sys.modules:
        return sys.modules["gym"]
    import gymnasium

    return gymnasium


def registry() -> dict[str, Any]:
    """The registered environments by their names."""
    environments: dict[str, Any] = gym_package().envs.registration.registry
    return environments


@cache
def _box_class() -> type[Box]:
    spaces = gym_package().spaces

    class LenientBox(spaces.Box):  # type: ignore[misc, name-defined]
        """A Box that also contains lists and arrays of other types, like that of the old Gym."""

        def contains(self, x: Numbers) -> bool:
            """True if all numbers are within the bounds."""
            values = np.asarray(x)
            if values.shape != self.shape or values.dtype.kind not in "fiub":
                return False
            return bool(np.all(values >= self.low) and np.all(values <= self.high))

    return LenientBox


def box(low: Numbers, high: Numbers, dtype: str) -> Box:
    """A space of numbers between `low` and `high`, whatever their type in Python."""
    low, high = np.asarray(low), np.asarray(high)
    return _box_class()(low=low.astype(dtype), high=high.astype(dtype), dtype=np.dtype(dtype).type)


class Range:
    """Lowest, highest and usual numbers of something, float32, and the same as a space."""

    def __init__(self, low: Numbers, high: Numbers, default: Numbers, dtype: str) -> None:
        self.low: NDArray[np.float32] = np.array(low, dtype=np.float32)
        self.high: NDArray[np.float32] = np.array(high, dtype=np.float32)
        self.default: NDArray[np.float32] = np.array(default, dtype=np.float32)
        self._dtype = dtype

    @cached_property
    def gym(self) -> Box:
        """A Box from `low` to `high`."""
        return box(self.low, self.high, self._dtype)

    def __repr__(self) -> str:
        return f"Range(low={self.low!r}, high={self.high!r}, default={self.default!r})"


class Limits:
    """The limits of a TriFingerPro and its object in one generation."""

    def __init__(self, generation: Generation) -> None:
        ones, torque, dtype = np.ones(9), generation.torque_space, generation.space_type
        low, high = generation.position_low * 3, generation.position_high * 3
        self.robot_torque = Range(-torque * ones, torque * ones, 0 * ones, dtype)
        self.robot_position = Range(low, high, generation.position_default * 3, dtype)
        self.robot_velocity = Range(-10 * ones, 10 * ones, 0 * ones, dtype)
        self.object_position = Range([-0.3, -0.3, 0], [0.3, 0.3, 0.3], [0, 0, 0.0325], dtype)
        self.object_orientation = Range([-1] * 4, [1] * 4, [0, 0, 0, 1], dtype)
