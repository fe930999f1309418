# SPDX-License-Identifier: BSD-3-Clause
"""A robot as time series: append desired actions, read back observations.

The basic control loop, paced by the robot:

    with trifinger.connect("sim") as robot:
        t = robot.append_desired_action(robot.new_action())
        while True:
            y = robot.get_observation(t)
            t = robot.append_desired_action(policy(y))
"""

import sys as _sys

if not _sys.platform.startswith("linux"):
    raise ImportError(
        "trifinger needs Linux; on Windows use WSL 2, on macOS a virtual machine or a container"
    )

from trifinger._trifinger import (
    Action as Action,
    AppliedAction as AppliedAction,
    Backend as Backend,
    Camera as Camera,
    CameraCalibration as CameraCalibration,
    CameraRenderer as CameraRenderer,
    Element as Element,
    Frontend as Frontend,
    Guide as Guide,
    GuideState as GuideState,
    Hand as Hand,
    JointSolution as JointSolution,
    Kinematics as Kinematics,
    LatenessHistogram as LatenessHistogram,
    LateStep as LateStep,
    Lens as Lens,
    Log as Log,
    LoggedSession as LoggedSession,
    ModelKinematics as ModelKinematics,
    Observation as Observation,
    Payload as Payload,
    Policy as Policy,
    Reason as Reason,
    Recorder as Recorder,
    Simulation as Simulation,
    Status as Status,
    StatusElement as StatusElement,
    TimingRecord as TimingRecord,
    Variation as Variation,
    connect as connect,
    export_mjcf as export_mjcf,
    export_urdf as export_urdf,
    fake as fake,
    guide as guide,
    hand as hand,
    lateness_of as lateness_of,
    list_sessions as list_sessions,
    observe as observe,
    recover as recover,
    replay as replay,
    run_fake as run_fake,
    running_robot as running_robot,
    simulate as simulate,
    version as _version,
)
from trifinger.errors import (
    AcausalAction as AcausalAction,
    ActionMissing as ActionMissing,
    AlreadyRecorded as AlreadyRecorded,
    CameraLost as CameraLost,
    ControlHeld as ControlHeld,
    Error as Error,
    HistoryLost as HistoryLost,
    IncompatibleSession as IncompatibleSession,
    InheritedHandle as InheritedHandle,
    InvalidArgument as InvalidArgument,
    NotInLog as NotInLog,
    PolicyFileError as PolicyFileError,
    RobotOwned as RobotOwned,
    RobotStopped as RobotStopped,
    SessionNotFound as SessionNotFound,
    TimedOut as TimedOut,
)
from trifinger.log.types import Damage as Damage, Event as Event, Gap as Gap, Steps as Steps
from trifinger.session_info import Fault as Fault, SessionInfo as SessionInfo

__version__ = _version
