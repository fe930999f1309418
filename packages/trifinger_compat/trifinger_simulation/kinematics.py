# SPDX-License-Identifier: BSD-3-Clause
"""Kinematics, where programs up to 2022 import it from."""

from robot_properties_fingers.kinematics import Kinematics as Kinematics
