# SPDX-License-Identifier: BSD-3-Clause
"""The interface of the original's robots, on top of this project's sessions."""

from robot_interfaces import (
    py_finger_types as py_finger_types,
    py_generic as py_generic,
    py_one_joint_types as py_one_joint_types,
    py_solo_eight_types as py_solo_eight_types,
    py_trifinger_types as py_trifinger_types,
    py_two_joint_types as py_two_joint_types,
)
from robot_interfaces.py_generic import (
    RobotBackendTerminationReason as RobotBackendTerminationReason,
    Status as Status,
)

finger = py_finger_types
one_joint = py_one_joint_types
solo_eight = py_solo_eight_types
trifinger = py_trifinger_types
two_joint = py_two_joint_types
