# SPDX-License-Identifier: BSD-3-Clause
"""Back-ends of robots. Each is a process of its own: `trifinger run`."""

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
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
            return cls(read_yaml(Path(config_file_name).read_text()))
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


def read_yaml(text: str) -> dict[str, Any]:
    """The part of YAML that these files use: numbers, lists in brackets, and nested keys."""
    try:
        import yaml  # type: ignore[import-untyped]
    except ImportError:
        return _read_simple(text)
    content: dict[str, Any] = yaml.safe_load(text)
    return content


def _read_simple(text: str) -> dict[str, Any]:
    text = re.sub(r"#.*", "", text)
    # Lists in brackets may be long.
    text = re.sub(r"\[[^\]]*\]", lambda match: re.sub(r"\s+", " ", match[0]), text)
    lines = [line.rstrip() for line in text.splitlines() if line.strip() and line.strip() != "---"]
    content, rest = _block(lines, 0)
    if rest or not isinstance(content, dict):
        raise ValueError(f"'{(rest or lines)[0]}' is not understood; install PyYAML to read it")
    return content


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


def _block(lines: list[str], indent: int) -> tuple[Any, list[str]]:
    if lines and lines[0].lstrip().startswith("- "):
        items = []
        while lines and _indent(lines[0]) == indent and lines[0].lstrip().startswith("- "):
            own = [" " * (indent + 2) + lines[0].lstrip()[2:]]
            lines = lines[1:]
            while lines and _indent(lines[0]) > indent:
                own.append(lines[0])
                lines = lines[1:]
            if ":" in own[0] and not own[0].lstrip().startswith("["):
                items.append(_block(own, indent + 2)[0])
            else:
                items.append(_scalar(own[0].strip()))
        return items, lines
    content: dict[str, Any] = {}
    while lines and _indent(lines[0]) == indent:
        match = re.fullmatch(r"\s*([\w-]+):\s*(.*)", lines[0])
        if match is None:
            break
        lines = lines[1:]
        if match[2]:
            content[match[1]] = _scalar(match[2])
        elif lines:
            content[match[1]], lines = _block(lines, _indent(lines[0]))
    return content, lines


def _scalar(text: str) -> Any:
    if text.startswith("["):
        return [_scalar(word.strip()) for word in text.strip("[]").split(",") if word.strip()]
    for convert in (int, float):
        try:
            return convert(text)
        except ValueError:
            continue
    return {"true": True, "false": False}.get(text.lower(), text.strip("\"'"))


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
        "examples/05 and docs/drivers.md"
    )


create_one_joint_backend = _no_such_robot
create_two_joint_backend = _no_such_robot
create_solo_eight_backend = _no_such_robot


def create_fake_finger_backend(robot_data: BaseData) -> RobotBackend:
    """Starts a simulated finger, which stands for the fake one."""
    return RobotBackend(robot_data, "finger_one")
