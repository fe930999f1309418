# SPDX-License-Identifier: BSD-3-Clause
"""A robot of three fingers."""

from trifinger_compat.binary_log import BaseBinaryLogReader, LogEntry as LogEntry
from trifinger_compat.logger import BaseLogger
from trifinger_compat.robot_data import (
    BaseData as BaseData,
    MultiProcessData as _MultiProcessData,
    RobotBackend as Backend,
    RobotFrontend,
    SingleProcessData as _SingleProcessData,
)
from trifinger_compat.structures import BaseAction, BaseTipObservation

from robot_interfaces.py_generic import Status as Status

__all__ = [
    "Action",
    "Backend",
    "BaseData",
    "BinaryLogReader",
    "Frontend",
    "LogEntry",
    "Logger",
    "MultiProcessData",
    "Observation",
    "SingleProcessData",
    "Status",
]


class Action(BaseAction):
    """The torques [Nm] and positions [rad] that are asked for, of 9 joints."""

    JOINTS = 9
    __slots__ = ()


class Observation(BaseTipObservation):
    """Measurements of 9 joints."""

    JOINTS = 9
    TIPS = 3
    __slots__ = ()


class SingleProcessData(_SingleProcessData):
    """The series of a robot in this process."""

    action_class = Action
    observation_class = Observation


class MultiProcessData(_MultiProcessData):
    """The series of a robot, for all processes."""

    action_class = Action
    observation_class = Observation


class Frontend(RobotFrontend):
    """Appends actions and reads what happened."""

    Action = Action


class Logger(BaseLogger):
    """Keeps the series of a robot and writes them to a file."""


class BinaryLogReader(BaseBinaryLogReader):
    """Reads the binary log of a robot."""

    action_class = Action
    observation_class = Observation
