# SPDX-License-Identifier: BSD-3-Clause
"""Kinematics by the name of their module in the original. It needs no Pinocchio."""

from robot_properties_fingers.kinematics import Kinematics as Kinematics

__all__ = ["Kinematics"]
