# SPDX-License-Identifier: BSD-3-Clause
"""The symmetries of a TriFinger: its fingers stand around the vertical, and left is like right."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
from trifinger.errors import InvalidArgument

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from trifinger._trifinger import Kinematics

LARGEST_STEP = 0.5  # [rad]; a larger one is a jump to another solution


@dataclasses.dataclass(frozen=True)
class Mirror:
    """The vertical plane through the axis of a finger's first joint."""

    point: NDArray[np.float64]
    """A point of the plane [m]."""
    normal: NDArray[np.float64]
    """Unit vector perpendicular to the plane, horizontal."""
    partner: tuple[int, ...]
    """The finger that takes the part of each finger."""

    @staticmethod
    def of(kinematics: Kinematics, finger: int) -> Mirror:
        """The plane through `finger`, in the world frame."""
        count = kinematics.num_fingers
        if not 0 <= finger < count:
            raise InvalidArgument(f"finger is {finger}, must be 0 to {count - 1}")
        # A tip goes around the axis of its first joint: half a turn leads to the other side.
        here = np.tile([0.0, 0.9, -1.7], count)
        there = here.copy()
        there[3 * finger] = np.pi
        tip = kinematics.tip_positions(here)[finger]
        point = (tip + kinematics.tip_positions(there)[finger]) / 2
        axis = np.cross(tip - point, kinematics.tip_jacobian(finger, here)[:, 3 * finger])
        normal = np.cross([0.0, 0.0, 1.0], axis)
        partner = tuple((2 * finger - i) % count for i in range(count))
        return Mirror(point, normal / np.linalg.norm(normal), partner)

    def __call__(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """The mirror images of points [m]: shape (..., 3)."""
        distance = (points - self.point) @ self.normal
        image: NDArray[np.float64] = points - 2 * distance[..., None] * self.normal
        return image


def turned(values: NDArray[np.float64], fingers: int) -> NDArray[np.float64]:
    """Gives each finger's three columns to the finger that is `fingers` places further."""
    return np.roll(values, 3 * fingers, axis=1)


def mirrored(
    kinematics: Kinematics,
    times: NDArray[np.float64],
    positions: NDArray[np.float64],
    mirror: Mirror,
) -> NDArray[np.float64]:
    """Positions of the joints [rad] at which the tips are where `mirror` shows them.

    A finger is not its own mirror image: its links lie beside each other. So each sample is found
    by inverse kinematics. Raises InvalidArgument where a finger cannot reach the point.
    """
    result = np.empty_like(positions)
    for finger, source in enumerate(mirror.partner):
        columns = slice(3 * finger, 3 * finger + 3)
        near = positions[0, 3 * source : 3 * source + 3] * [-1.0, 1.0, 1.0]
        for row, position in enumerate(positions):
            tip = mirror(kinematics.tip_positions(position)[source])
            near, reach = kinematics.inverse_kinematics(finger, tip, near)
            result[row, columns] = near
            step = np.abs(near - result[row - 1, columns]).max() if row else 0.0
            if reach != "yes" or step > LARGEST_STEP:
                why = reach.replace("_", " ") if reach != "yes" else "another way to bend"
                raise InvalidArgument(
                    f"finger {finger} cannot follow the mirror image of finger {source} at "
                    f"{times[row]:.3f} s: {why}"
                )
    return result
