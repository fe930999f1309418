# SPDX-License-Identifier: BSD-3-Clause
"""Rotations, poses and OpenCV's lens for many points at once."""

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


def rotations(vectors: Matrix) -> Matrix:
    """Rotation matrices (n, 3, 3) of rotation vectors (n, 3)."""
    angles = np.linalg.norm(vectors, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)
    small = angles < 1e-8
    safe = np.where(small, 1, angles)
    first = np.where(small, 1 - angles**2 / 6, np.sin(safe) / safe)
    second = np.where(small, 0.5 - angles**2 / 24, (1 - np.cos(safe)) / safe**2)
    return np.asarray(np.eye(3) + first * cross + second * cross @ cross)


def vector_of(rotation: Matrix) -> Matrix:
    """The rotation vector of a rotation matrix."""
    w, x, y, z = quaternion_of(rotation)
    sine = np.linalg.norm((x, y, z))
    if sine < 1e-12:
        return np.array([x, y, z]) * 2
    return np.asarray(np.array([x, y, z]) * (2 * np.arctan2(sine, w) / sine))


def quaternion_of(rotation: Matrix) -> Matrix:
    """The quaternion w, x, y, z of a rotation matrix, with w at least zero."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    # Each column of this matrix is the quaternion times one of its components; take the longest.
    products = np.array(
        [
            [1 + a + e + i, h - f, c - g, d - b],
            [h - f, 1 + a - e - i, b + d, c + g],
            [c - g, b + d, 1 - a + e - i, f + h],
            [d - b, c + g, f + h, 1 - a - e + i],
        ]
    )
    column = products[:, np.argmax(np.diag(products))]
    quaternion = column / np.linalg.norm(column)
    return np.asarray(quaternion if quaternion[0] >= 0 else -quaternion)


def about_z(angle: float) -> Matrix:
    """The rotation about z [rad]."""
    return np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]]
    )


def angle_between(one: Matrix, other: Matrix) -> float:
    """The angle between two rotations [rad]."""
    return float(np.linalg.norm(vector_of(one.T @ other)))


def project(lens: Matrix, points: Matrix) -> Matrix:
    """Pixels (n, 2) of points (n, 3) in front of a camera. `lens`: fx fy cx cy k1 k2 p1 p2 k3."""
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = np.moveaxis(np.asarray(lens), -1, 0)
    depth = np.maximum(points[:, 2], 1e-3)  # points behind the camera are somewhere far outside
    x, y = points[:, 0] / depth, points[:, 1] / depth
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack([fx * u + cx, fy * v + cy], axis=-1)
