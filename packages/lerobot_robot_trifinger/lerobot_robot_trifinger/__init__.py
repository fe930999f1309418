# SPDX-License-Identifier: BSD-3-Clause
"""Robots of TriFinger in LeRobot, which imports this package because of its name."""

from importlib.util import find_spec

if find_spec("trifinger") is None:
    raise ModuleNotFoundError(
        "lerobot_robot_trifinger needs the package `trifinger`, which is not installed and on "
        "no index: install it from its sources or its wheel, as docs/installing.md says",
        name="trifinger",
    )

from lerobot_robot_trifinger.camera import TrifingerCamera
from lerobot_robot_trifinger.config_trifinger import (
    TrifingerCameraConfig,
    TrifingerLeaderConfig,
    TrifingerRobotConfig,
)
from lerobot_robot_trifinger.leader import TrifingerLeader
from lerobot_robot_trifinger.robot import TrifingerRobot

__all__ = [
    "TrifingerCamera",
    "TrifingerCameraConfig",
    "TrifingerLeader",
    "TrifingerLeaderConfig",
    "TrifingerRobot",
    "TrifingerRobotConfig",
]
