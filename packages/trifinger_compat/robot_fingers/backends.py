# SPDX-License-Identifier: BSD-3-Clause
"""Back-ends of robots. Each is a process of its own: `trifinger run`."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from trifinger import foreign_yaml
from trifinger_compat.robot_data import BaseData, RobotBackend
from trifinger_compat.types import Numbers

_NO_ROBOT = (
    "a robot on motor boards needs a configuration of this project: see "
    "docs/coming_from_the_original.md, section 'The real robot'. Give the path of that file in "
    "place of the original's"
)


@dataclass
class TrajectoryStep:
    """A pose on the way to rest, and the number of steps to get there."""

    target_position_rad: list[float]
    move_steps: int


@dataclass
class Calibration:
    """How a robot finds its zero."""

    endstop_search_torques_Nm: list[float] = field(default_factory=list)  # noqa: N815
    move_steps: int = 0


@dataclass
class PositionControlGains:
    """Gains of positions."""

    kp: list[float] = field(default_factory=list)
    kd: list[float] = field(default_factory=list)


class _Config:
    """A configuration file of the original, to read it."""

    def __init__(self, content: dict[str, Any]) -> None:
        self._content = content
        gains = content.get("position_control_gains", {})
        calibration = content.get("calibration", {})
        self.can_ports: list[str] = content.get("can_ports", [])
        self.max_current_A = content.get("max_current_A", 0.0)
        self.has_endstop = content.get("has_endstop", False)
        self.calibration = Calibration(
            calibration.get("endstop_search_torques_Nm", []), calibration.get("move_steps", 0)
        )
        self.move_to_position_tolerance_rad = content.get("move_to_position_tolerance_rad", 0.0)
        self.safety_kd = content.get("safety_kd", [])
        self.position_control_gains = PositionControlGains(gains.get("kp", []), gains.get("kd", []))
        self.hard_position_limits_lower = content.get("hard_position_limits_lower", [])
        self.hard_position_limits_upper = content.get("hard_position_limits_upper", [])
        self.soft_position_limits_lower = content.get("soft_position_limits_lower", [])
        self.soft_position_limits_upper = content.get("soft_position_limits_upper", [])
        self.home_offset_rad = content.get("home_offset_rad", [])
        self.initial_position_rad = content.get("initial_position_rad", [])
        self.shutdown_trajectory = [
            TrajectoryStep(step["target_position_rad"], step["move_steps"])
            for step in content.get("shutdown_trajectory", [])
        ]

    @classmethod
    def load_config(cls, config_file_name: str | Path) -> "_Config":
        """Reads a file; RuntimeError if it cannot be read."""
        try:
            return cls(foreign_yaml.parse(Path(config_file_name).read_text()))
        except (OSError, ValueError) as error:
            raise RuntimeError(
                f"cannot read the configuration {config_file_name}: {error}"
            ) from error

    def is_within_hard_position_limits(self, position: Numbers) -> bool:
        """True if no joint is beyond its hard limit."""
        values = np.asarray(position, dtype=float)
        low, high = self.hard_position_limits_lower, self.hard_position_limits_upper
        return bool(np.all(values >= low) and np.all(values <= high))

    def print(self) -> None:
        """Prints all values."""
        for key, value in self._content.items():
            print(f"{key}: {json.dumps(value)}")


class TriFingerConfig(_Config):
    """The configuration of a robot of three fingers."""


class FingerConfig(_Config):
    """The configuration of a robot of one finger."""


class OneJointConfig(_Config):
    """The configuration of a robot of one joint."""


class TwoJointConfig(_Config):
    """The configuration of a robot of two joints."""


class SoloEightConfig(_Config):
    """The configuration of the robot Solo 8."""


def create_trifinger_backend(
    robot_data: BaseData,
    config: Any,
    first_action_timeout: float = float("inf"),
    max_number_of_actions: int = 0,
) -> RobotBackend:
    """Starts a robot of a configuration of this project: a name or the path of a file.

    Raises NotImplementedError for a configuration of the original.
    """
    if isinstance(config, _Config):
        raise NotImplementedError(_NO_ROBOT)
    if Path(config).is_file() and "can_ports" in Path(config).read_text():
        raise NotImplementedError(f"{config} is a configuration of the original; {_NO_ROBOT}")
    return RobotBackend(
        robot_data,
        str(config),
        first_action_timeout=first_action_timeout,
        max_number_of_actions=max_number_of_actions,
    )


create_real_finger_backend = create_trifinger_backend


def _no_such_robot(*_: Any, **__: Any) -> RobotBackend:
    raise NotImplementedError(
        "this project has no driver for this robot; a driver of your own is a file of C++, see "
        "examples/05 and `trifinger new robot`"
    )


create_one_joint_backend = _no_such_robot
create_two_joint_backend = _no_such_robot
create_solo_eight_backend = _no_such_robot


def create_fake_finger_backend(robot_data: BaseData) -> RobotBackend:
    """Starts a simulated finger, which stands for the fake one."""
    return RobotBackend(robot_data, "finger_one")
