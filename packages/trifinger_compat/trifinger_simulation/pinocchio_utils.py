# SPDX-License-Identifier: BSD-3-Clause
"""Kinematics by the names of 2020. It needs no Pinocchio."""

import warnings

from robot_properties_fingers.kinematics import Kinematics as Kinematics

PinocchioUtils = Kinematics

warnings.warn(
    "trifinger_simulation.pinocchio_utils is an old name; use robot_properties_fingers.Kinematics",
    FutureWarning,
    stacklevel=2,
)
