# SPDX-License-Identifier: BSD-3-Clause
"""Actions of a robot in simulation."""

import numpy as np
from trifinger_compat.types import Array, Numbers


class Action:
    """The torques [Nm] and positions [rad] that are asked for, and the gains of the positions.

    A position that is NaN asks for nothing, and a gain that is NaN stands for the robot's own.
    """

    torque: Array
    position: Array
    position_kp: Array
    position_kd: Array

    def __init__(
        self,
        torque: Numbers,
        position: Numbers,
        kp: Numbers | None = None,
        kd: Numbers | None = None,
    ) -> None:
        """Arrays are kept without a copy. `kp` [Nm/rad] and `kd` [Nms/rad] are NaN by default."""
        self.torque = np.asarray(torque)
        self.position = np.asarray(position)
        size = len(self.position)
        self.position_kp = np.full(size, np.nan) if kp is None else np.asarray(kp)
        self.position_kd = np.full(size, np.nan) if kd is None else np.asarray(kd)

    def __repr__(self) -> str:
        return f"Action(torque={self.torque!r}, position={self.position!r})"
