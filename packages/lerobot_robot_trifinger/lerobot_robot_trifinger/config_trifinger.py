# SPDX-License-Identifier: BSD-3-Clause
"""The options of the robot and of the teleoperator."""

from dataclasses import dataclass, field

from lerobot.cameras import CameraConfig
from lerobot.robots import RobotConfig
from lerobot.teleoperators import TeleoperatorConfig


def _observation_fields() -> dict[str, int]:
    return {"position": 9, "velocity": 9, "torque": 9, "tip_force": 3}


def _positions() -> dict[str, int]:
    return {"position": 9}


@CameraConfig.register_subclass("trifinger")
@dataclass(kw_only=True)
class TrifingerCameraConfig(CameraConfig):
    """A camera of a robot behind a back-end of TriFinger. LeRobot demands width and height."""

    fps: int | None = 30
    """For LeRobot. The file of the robot says how many images come."""
    robot: str = ""
    """Name of the back-end; as usual that of the robot whose camera this is."""
    camera: str = ""
    """Name of the camera there; as usual that by which LeRobot knows it."""
    first_image: float = 10.0
    """Alone, without a robot: it waits so long for an image [s]."""


@RobotConfig.register_subclass("trifinger")
@dataclass(kw_only=True)
class TrifingerRobotConfig(RobotConfig):
    """A robot behind a back-end of TriFinger."""

    robot: str = "sim"
    """Name of the back-end: `trifinger list` shows those that run."""
    observation_fields: dict[str, int] = field(default_factory=_observation_fields)
    """Fields of the observation, and how many numbers each has."""
    action_fields: dict[str, int] = field(default_factory=_positions)
    """Fields of the action. All others stay as a new action has them."""
    cameras: dict[str, CameraConfig] = field(default_factory=dict)
    """Cameras of this robot (type `trifinger`), or any others that LeRobot has."""
    first_images: float = 10.0
    """connect() waits so long for the first image of each camera, in the robot's time [s]."""
    fps: int = 30
    """Without real time: actions per second of the robot's own time."""
    burst: int = 10
    """In real time: steps that are appended at once."""


@TeleoperatorConfig.register_subclass("trifinger_leader")
@dataclass(kw_only=True)
class TrifingerLeaderConfig(TeleoperatorConfig):
    """A robot that is moved by hand, and that another robot follows."""

    robot: str = "leader"
    """Name of the back-end."""
    fields: dict[str, int] = field(default_factory=_positions)
    """Fields of its observation that become the action, and how many numbers each has."""
