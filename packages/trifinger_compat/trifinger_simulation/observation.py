# SPDX-License-Identifier: BSD-3-Clause
"""Measurements of a robot in simulation."""

from trifinger_compat.types import Array


class Observation:
    """Measurements of all joints and tips; empty lists at first."""

    position: Array  # [rad]
    velocity: Array  # [rad/s]
    torque: Array  # [Nm]
    tip_force: Array  # from 0 to 1, one for each finger

    def __init__(self) -> None:
        self.position = []  # type: ignore[assignment]  # as in the original
        self.velocity = []  # type: ignore[assignment]
        self.torque = []  # type: ignore[assignment]
        self.tip_force = []  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"Observation(position={self.position!r}, velocity={self.velocity!r})"
