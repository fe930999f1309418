# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics of the TriFingerPro in closed form."""

from math import atan2, cos, hypot, pi, radians, sin

import numpy as np
from trifinger_compat.types import Array, Numbers

BASE_HEIGHT = 0.29  # of the axis of joint 0 [m]
TIP_OFFSET = 0.086  # of the tip from the plane of the finger's motion [m]
SHOULDER = 0.0505  # from the robot's axis to that of joint 1 [m]
LINK = 0.16  # length of both links [m]


def fingerpro_ik(tip_position: Numbers) -> Array:
    """Angles of finger 0 that bring its tip to a position [m], with joint 2 at most 0.

    They are NaN if the tip is out of reach. Raises ValueError if it is nearer than 0.086 m to the
    axis of joint 0.
    """
    x, y, z = (float(value) for value in np.asarray(tip_position, dtype=float))
    z -= BASE_HEIGHT
    distance = hypot(x, z)
    if distance < TIP_OFFSET:
        raise ValueError(
            f"the tip would be {distance:.4f} m from the axis of joint 0, must be at least "
            f"{TIP_OFFSET} m"
        )
    down = (distance**2 - TIP_OFFSET**2) ** 0.5
    q0 = atan2(-down, TIP_OFFSET) - atan2(z, x)
    q0 = (q0 + pi) % (2 * pi) - pi
    cosine = ((y - SHOULDER) ** 2 + down**2) / (2 * LINK**2) - 1
    if abs(cosine) > 1:
        return np.full(3, np.nan)
    q2 = -float(np.arccos(cosine))
    return np.array([q0, atan2(y - SHOULDER, down) - q2 / 2, q2])


def trifingerpro_ik(tip_positions: Numbers) -> Array:
    """The nine angles that bring the three tips to their positions [m]; see fingerpro_ik."""
    angles = []
    for finger, (x, y, z) in enumerate(np.asarray(tip_positions, dtype=float).reshape(3, 3)):
        turn = radians(120 * finger)
        c, s = cos(turn), sin(turn)
        angles.append(fingerpro_ik([c * x - s * y, s * x + c * y, z]))
    return np.concatenate(angles)
