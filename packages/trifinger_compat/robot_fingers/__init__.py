# SPDX-License-Identifier: BSD-3-Clause
"""Robots of the original stack, on top of this project's sessions."""

from robot_fingers import pybullet_drivers as pybullet_drivers, utils as utils
from robot_fingers.backends import (
    FingerConfig as FingerConfig,
    OneJointConfig as OneJointConfig,
    SoloEightConfig as SoloEightConfig,
    TriFingerConfig as TriFingerConfig,
    TwoJointConfig as TwoJointConfig,
    create_fake_finger_backend as create_fake_finger_backend,
    create_one_joint_backend as create_one_joint_backend,
    create_real_finger_backend as create_real_finger_backend,
    create_solo_eight_backend as create_solo_eight_backend,
    create_trifinger_backend as create_trifinger_backend,
    create_two_joint_backend as create_two_joint_backend,
)
from robot_fingers.platform import (
    TriFingerPlatformFrontend as TriFingerPlatformFrontend,
    TriFingerPlatformLog as TriFingerPlatformLog,
    TriFingerPlatformWithObjectFrontend as TriFingerPlatformWithObjectFrontend,
    TriFingerPlatformWithObjectLog as TriFingerPlatformWithObjectLog,
)
from robot_fingers.robot import Robot as Robot, demo_print_position as demo_print_position
