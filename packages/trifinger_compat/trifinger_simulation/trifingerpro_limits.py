# SPDX-License-Identifier: BSD-3-Clause
"""Limits of the TriFingerPro and of the object, as arrays `low`, `high` and `default`."""

from trifinger_compat.generation import chosen as _chosen
from trifinger_compat.spaces import Limits as _Limits

_generation = _chosen()
_limits = _Limits(_generation)

n_joints = 9
n_fingers = 3
max_torque_Nm = _generation.torque_space  # noqa: N816  # the original's name
max_velocity_radps = 10

robot_torque = _limits.robot_torque  # [Nm]
robot_position = _limits.robot_position  # [rad]
robot_velocity = _limits.robot_velocity  # [rad/s]
object_position = _limits.object_position  # [m]
object_orientation = _limits.object_orientation  # quaternion x, y, z, w
