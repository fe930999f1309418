# SPDX-License-Identifier: BSD-3-Clause
"""A robot of three fingers."""

from trifinger_compat.binary_log import LogEntry as LogEntry
from trifinger_compat.robot_data import BaseData as BaseData, RobotBackend as Backend
from trifinger_compat.robot_types import define as _define

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

(
    Action,
    Observation,
    SingleProcessData,
    MultiProcessData,
    Frontend,
    Logger,
    BinaryLogReader,
) = _define(__name__, joints=9, tips=3, session_type="trifinger")
