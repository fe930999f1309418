# SPDX-License-Identifier: BSD-3-Clause
"""Poses as matrices (4, 4)."""

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


def pose(rotation: Matrix, position: Matrix) -> Matrix:
    """The pose (4, 4) with a rotation and a position."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, position
    return matrix


def inverse(matrix: Matrix) -> Matrix:
    """The inverse of a pose."""
    turned = matrix[:3, :3].T
    return pose(turned, -turned @ matrix[:3, 3])


def nearest_rotation(matrix: Matrix) -> Matrix:
    """The rotation that is nearest to a matrix."""
    u, _, v = np.linalg.svd(matrix)
    return np.asarray(u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v)
