# SPDX-License-Identifier: BSD-3-Clause
"""A robot of one finger."""

from trifinger_compat.robot_types import (
    Backend as Backend,
    BaseData as BaseData,
    LogEntry as LogEntry,
    Status as Status,
    define as _define,
)

Action, Observation, SingleProcessData, MultiProcessData, Frontend, Logger, BinaryLogReader = (
    _define(__name__, joints=3, tips=1, session_type="finger")
)
