# SPDX-License-Identifier: BSD-3-Clause
"""A robot behind time series: append desired actions, read back observations.

The basic control loop, paced by the robot:

    with trifinger.connect("sim") as robot:
        t = robot.append_desired_action(robot.new_action())
        while True:
            y = robot.get_observation(t)
            t = robot.append_desired_action(policy(y))
"""

from trifinger._trifinger import (
    Backend,
    Element,
    Frontend,
    Kinematics,
    LatenessHistogram,
    LateStep,
    Log,
    LoggedSession,
    Policy,
    Reason,
    Recorder,
    Simulation,
    Status,
    TimingRecord,
    connect,
    export_mjcf,
    export_urdf,
    fake,
    list_sessions,
    observe,
    recover,
    replay,
    run_fake,
    simulate,
)
from trifinger._trifinger import version as __version__
from trifinger.errors import (
    AcausalAction,
    ActionMissing,
    AlreadyRecorded,
    ControlHeld,
    Error,
    HistoryLost,
    IncompatibleSession,
    InheritedHandle,
    InvalidArgument,
    NotInLog,
    PolicyFileError,
    RobotOwned,
    RobotStopped,
    SessionNotFound,
    TimedOut,
)
from trifinger.log_types import Damage, Event, Gap, Steps
from trifinger.session_info import Fault, SessionInfo

__all__ = [
    "AcausalAction",
    "ActionMissing",
    "AlreadyRecorded",
    "Backend",
    "ControlHeld",
    "Damage",
    "Element",
    "Error",
    "Event",
    "Fault",
    "Frontend",
    "Gap",
    "HistoryLost",
    "IncompatibleSession",
    "InheritedHandle",
    "InvalidArgument",
    "Kinematics",
    "LateStep",
    "LatenessHistogram",
    "Log",
    "LoggedSession",
    "NotInLog",
    "Policy",
    "PolicyFileError",
    "Reason",
    "Recorder",
    "RobotOwned",
    "RobotStopped",
    "SessionInfo",
    "SessionNotFound",
    "Simulation",
    "Status",
    "Steps",
    "TimedOut",
    "TimingRecord",
    "__version__",
    "connect",
    "export_mjcf",
    "export_urdf",
    "fake",
    "list_sessions",
    "observe",
    "recover",
    "replay",
    "run_fake",
    "simulate",
]
