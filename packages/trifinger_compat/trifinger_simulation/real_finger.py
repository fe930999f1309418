# SPDX-License-Identifier: BSD-3-Clause
"""A robot that runs, with the interface of SimFinger."""

from typing import Any

import numpy as np
import robot_interfaces
from trifinger_compat.types import Numbers

from trifinger_simulation import finger_types_data


class RealFinger:
    """The robot that runs as "finger" or "trifinger", in place of a simulated one."""

    def __init__(
        self,
        finger_type: str,
        finger_config_suffix: Any = "",
        enable_visualization: bool = False,
    ) -> None:
        """Raises ValueError for an unknown type, RuntimeError if no robot runs."""
        del finger_config_suffix, enable_visualization  # the configuration is that of the back-end
        self.finger_type = finger_types_data.check_finger_type(finger_type)
        self.number_of_fingers = finger_types_data.get_number_of_fingers(finger_type)
        is_single = self.number_of_fingers == 1
        types: Any = robot_interfaces.finger if is_single else robot_interfaces.trifinger
        self.Action = types.Action
        self.robot_data = types.MultiProcessData("finger" if is_single else "trifinger", False)
        self.frontend = types.Frontend(self.robot_data)

    def append_desired_action(self, action: Any) -> int:
        """Appends an action and returns the step at which it will act."""
        return int(self.frontend.append_desired_action(action))

    def get_observation(self, time_index: int) -> Any:
        """Measurements of a step; waits for them."""
        return self.frontend.get_observation(time_index)

    def reset_finger(self, joint_positions: Numbers, num_steps: int = 1000) -> Any:
        """Goes to joint positions [rad] in so many steps, and returns the last measurements."""
        goal = np.asarray(joint_positions, dtype=float)
        t = self.append_desired_action(self.Action())
        begin = self.get_observation(t).position
        for i in range(1, num_steps + 1):
            position = begin + (goal - begin) * i / num_steps
            t = self.append_desired_action(self.Action(position=position))
            observation = self.get_observation(t)
        return observation
