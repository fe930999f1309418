# SPDX-License-Identifier: BSD-3-Clause
"""A robot of three fingers."""

from trifinger_compat.robot_types import *  # noqa: F403
from trifinger_compat.robot_types import define as _define

Action, Observation, SingleProcessData, MultiProcessData, Frontend, Logger, BinaryLogReader = (
    _define(__name__, joints=9, tips=3, session_type="trifinger")
)
