# SPDX-License-Identifier: BSD-3-Clause
"""A robot of one finger."""

from trifinger_compat.robot_types import *  # noqa: F403
from trifinger_compat.robot_types import define as _define

Action, Observation, SingleProcessData, MultiProcessData, Frontend, Logger, BinaryLogReader = (
    _define(__name__, joints=3, tips=1, session_type="finger")
)
