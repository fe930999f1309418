# SPDX-License-Identifier: BSD-3-Clause
"""A robot with everything that belongs to it, in one object."""

import os
import sys
import time
from collections.abc import Callable, KeysView
from typing import Any

import numpy as np
import robot_interfaces
from trifinger_compat.world import CONFIGURATIONS

from robot_fingers import backends

# The configuration of a real robot, for create_by_name().
VARIABLE = "TRIFINGER_COMPAT_CONFIG"

_ROBOTS: dict[str, tuple[Any, Callable[..., Any], str]] = {
    **{
        name: (
            robot_interfaces.trifinger if name.startswith("tri") else robot_interfaces.finger,
            backends.create_trifinger_backend,
            config,
        )
        for name, config in CONFIGURATIONS.items()
    },
    "trifingerpro_default": (
        robot_interfaces.trifinger,
        backends.create_trifinger_backend,
        "trifinger_pro",
    ),
    "trifingerpro_calib": (
        robot_interfaces.trifinger,
        backends.create_trifinger_backend,
        "trifinger_pro",
    ),
    "onejoint": (robot_interfaces.one_joint, backends.create_one_joint_backend, ""),
    "twojoint": (robot_interfaces.two_joint, backends.create_two_joint_backend, ""),
    "solo8": (robot_interfaces.solo_eight, backends.create_solo_eight_backend, ""),
}


class Robot:
    """A robot with back-end, front-end and logger."""

    def __init__(
        self,
        robot_module: Any,
        create_backend_function: Callable[..., Any],
        config: Any,
        logger_buffer_size: int = 0,
    ) -> None:
        """`config` is a configuration of this project: its name or the path of a file."""
        self.Action = robot_module.Action
        self.config = config
        self.robot_data = robot_module.SingleProcessData()
        self.backend = create_backend_function(self.robot_data, config)
        self.frontend = robot_module.Frontend(self.robot_data)
        self.logger = robot_module.Logger(self.robot_data, logger_buffer_size)

    @classmethod
    def create_by_name(cls, robot_name: str, logger_buffer_size: int = 0) -> "Robot":
        """A robot of this type; ValueError if there is no such type.

        It is the robot of the configuration that TRIFINGER_COMPAT_CONFIG names. Without it, it is
        simulated, which is said on stderr.
        """
        if robot_name not in _ROBOTS:
            raise ValueError(f"Invalid robot '{robot_name}'. Valid ones are {', '.join(_ROBOTS)}")
        robot_module, create_backend, simulated = _ROBOTS[robot_name]
        config = os.environ.get(VARIABLE)
        if not config:
            config = simulated
            print(
                f"the robot '{robot_name}' is simulated: {VARIABLE} does not name the "
                "configuration of a real one",
                file=sys.stderr,
            )
        return cls(robot_module, create_backend, config, logger_buffer_size)

    @staticmethod
    def get_supported_robots() -> KeysView[str]:
        """Names for create_by_name()."""
        return _ROBOTS.keys()

    def initialize(self) -> None:
        """Makes the robot ready."""
        self.backend.initialize()


def demo_print_position(robot: Robot) -> None:
    """Prints where the joints are, without a torque, until Ctrl-C."""
    action = robot.Action()
    while True:
        t = robot.frontend.append_desired_action(action)
        observation = robot.frontend.get_observation(t)
        if t % 100 == 0:
            print(np.array2string(observation.position, precision=3), flush=True)
            time.sleep(0.001)
