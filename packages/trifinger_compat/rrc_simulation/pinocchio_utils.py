# SPDX-License-Identifier: BSD-3-Clause
"""Kinematics by the names of 2020. It needs no Pinocchio."""

from robot_properties_fingers.kinematics import Kinematics as Kinematics

PinocchioUtils = Kinematics
