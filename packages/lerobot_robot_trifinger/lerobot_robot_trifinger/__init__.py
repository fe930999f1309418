# SPDX-License-Identifier: BSD-3-Clause
"""Robots of TriFinger in LeRobot, which imports this package because of its name."""

from lerobot_robot_trifinger.config_trifinger import TrifingerLeaderConfig, TrifingerRobotConfig
from lerobot_robot_trifinger.leader import TrifingerLeader
from lerobot_robot_trifinger.robot import TrifingerRobot

__all__ = [
    "TrifingerLeader",
    "TrifingerLeaderConfig",
    "TrifingerRobot",
    "TrifingerRobotConfig",
]
