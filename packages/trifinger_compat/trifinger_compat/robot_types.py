# SPDX-License-Identifier: BSD-3-Clause
"""The types of a robot with a number of joints: each module of robot_interfaces has a set."""

from typing import Any, NamedTuple

from trifinger_compat.binary_log import BaseBinaryLogReader, LogEntry
from trifinger_compat.generic import Status
from trifinger_compat.logger import BaseLogger
from trifinger_compat.robot_data import (
    BaseData,
    MultiProcessData,
    RobotBackend,
    RobotFrontend,
    SingleProcessData,
)
from trifinger_compat.structures import BaseAction, BaseObservation, BaseTipObservation

# What all robots share.
__all__ = ["Backend", "BaseData", "LogEntry", "Status"]

Backend = RobotBackend  # the name that the original has for it


class RobotTypes(NamedTuple):
    """The types by their names in a module."""

    action: type[BaseAction]
    observation: type[BaseObservation]
    single_process_data: type[SingleProcessData]
    multi_process_data: type[MultiProcessData]
    frontend: type[RobotFrontend]
    logger: type[BaseLogger]
    binary_log_reader: type[BaseBinaryLogReader]


def define(module: str, joints: int, tips: int = 0, session_type: str = "") -> RobotTypes:
    """Makes the types of a module; pickles find them there.

    `tips` is the number of tip sensors. `session_type` is that of the robot's sessions, or empty
    if this project has no such robot.
    """

    def derived(name: str, base: type, **members: Any) -> Any:
        own = {"__module__": module, "__doc__": base.__doc__, **members}
        return type(name, (base,), own)

    action = derived("Action", BaseAction, JOINTS=joints, __slots__=())
    base = BaseTipObservation if tips else BaseObservation
    observation = derived("Observation", base, JOINTS=joints, TIPS=tips, __slots__=())
    classes = {"action_class": action, "observation_class": observation}
    series = {**classes, "session_type": session_type}
    return RobotTypes(
        action,
        observation,
        derived("SingleProcessData", SingleProcessData, **series),
        derived("MultiProcessData", MultiProcessData, **series),
        derived("Frontend", RobotFrontend, Action=action),
        derived("Logger", BaseLogger),
        derived("BinaryLogReader", BaseBinaryLogReader, **classes),
    )
