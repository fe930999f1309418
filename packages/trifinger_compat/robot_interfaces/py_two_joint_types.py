# SPDX-License-Identifier: BSD-3-Clause
"""A robot of two joints."""

from trifinger_compat.robot_types import (
    Backend as Backend,
    BaseData as BaseData,
    LogEntry as LogEntry,
    Status as Status,
    define as _define,
)

Action, Observation, SingleProcessData, MultiProcessData, Frontend, Logger, BinaryLogReader = (
    _define(__name__, joints=2)
)
