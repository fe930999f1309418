# SPDX-License-Identifier: BSD-3-Clause
"""A robot of eight joints."""

from trifinger_compat.robot_types import *  # noqa: F403
from trifinger_compat.robot_types import define as _define

Action, Observation, SingleProcessData, MultiProcessData, Frontend, Logger, BinaryLogReader = (
    _define(__name__, joints=8)
)
