# SPDX-License-Identifier: BSD-3-Clause
"""Types that all packages use."""

from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
# Of a caller: lists, tuples, and arrays of any type.
Numbers: TypeAlias = ArrayLike
Image: TypeAlias = NDArray[np.uint8]


class ActionLike(Protocol):
    """An action of any of the packages."""

    torque: Any
    position: Any
    position_kp: Any
    position_kd: Any


class PoseLike(Protocol):
    """Whatever has a position x, y, z [m] and an orientation x, y, z, w."""

    @property
    def position(self) -> Any:
        """Position [m]."""

    @property
    def orientation(self) -> Any:
        """Quaternion x, y, z, w."""


def wxyz(orientation: Numbers) -> Array:
    """The quaternion x, y, z, w in this project's order."""
    x, y, z, w = np.asarray(orientation, dtype=float)
    return np.array([w, x, y, z])


def xyzw(orientation: Array) -> Array:
    """The quaternion w, x, y, z of this project in the original's order."""
    w, x, y, z = orientation
    return np.array([x, y, z, w])
