# SPDX-License-Identifier: BSD-3-Clause
from collections.abc import (
    Callable,
    Iterable,
    Iterator,
    Mapping,
    Sequence
)
import enum
import os
import pathlib
import types
from typing import Annotated, Any, overload

import numpy
import numpy.typing
from numpy.typing import NDArray
import pandas

import trifinger.log_types
import trifinger.session_info


version: str = ...

class Element(numpy.void):  # type: ignore[misc]  # final in NumPy's own stub, not in NumPy
    """
    One element of a series: a record of NumPy whose fields are attributes, too.

    `y.position` and `y["position"]` are the same, `y.stamp.capture_time` is a field of a field.
    """
    def __getattr__(self, name: str) -> Any: ...
    def __setattr__(self, name: str, value: object) -> None: ...

class Action(Element):  # type: ignore[misc]
    """What a user asks for in a step."""
    torque: numpy.typing.NDArray[numpy.float64]
    position: numpy.typing.NDArray[numpy.float64]
    position_kp: numpy.typing.NDArray[numpy.float64]
    position_kd: numpy.typing.NDArray[numpy.float64]

class AppliedAction(Element):  # type: ignore[misc]
    """What a robot says it has applied in a step."""
    torque: numpy.typing.NDArray[numpy.float64]
    position: numpy.typing.NDArray[numpy.float64]
    position_kp: numpy.typing.NDArray[numpy.float64]
    position_kd: numpy.typing.NDArray[numpy.float64]
    reasons: numpy.typing.NDArray[numpy.uint32]
    thermal_margin: numpy.typing.NDArray[numpy.float64]

class Observation(Element):  # type: ignore[misc]
    """What a robot or a companion has measured."""
    position: numpy.typing.NDArray[numpy.float64]
    velocity: numpy.typing.NDArray[numpy.float64]
    torque: numpy.typing.NDArray[numpy.float64]
    tip_force: numpy.typing.NDArray[numpy.float64]

class StatusElement(Element):  # type: ignore[misc]
    """What the back-end has to say about a step."""
    time: numpy.int64
    tick: numpy.int64
    lateness: numpy.int64
    measurement_age: numpy.int64
    flags: numpy.uint32  # type: ignore[assignment]  # every record of NumPy has one
    skipped_ticks: numpy.uint32
    action_repeats: numpy.uint32
    discarded_actions: numpy.uint32
    rejected_actions: numpy.uint32
    lost_frames: numpy.uint32
    fault_code: numpy.int32
    fault_detail: numpy.int32

class Status(enum.IntFlag):
    """What happened in a step: bits of the field `flags` of its status."""

    ACTION_REPEATED = 1
    """
    The action for this step was missing, the previous one was applied again.
    """

    ACAUSAL = 2
    """The action was appended by someone who had already read y_t."""

    ACTION_REJECTED = 4
    """The action was not fit to apply; something safe was applied instead."""

    END = 8
    """The last status of the session: no action was applied at this step."""

    SCHEDULER_LATE = 16
    """The tick began late: the back-end did not get the processor in time."""

    DRIVER_LATE = 32
    """The tick began late: calls of the driver took up the one before."""

def list_sessions() -> list[trifinger.session_info.SessionInfo]:
    """
    What runs on this machine, robots and companions, in the order of their names. Sessions whose
    back-end died are included.
    """

def recover(name: str, timeout: float | None = 5.0) -> None:
    """
    Clears the fault of the robot `name`, as the operator who has looked at it; the next session
    begins.

    Raises SessionNotFound, TimedOut, or RobotStopped if the back-end is gone.
    """

class LatenessHistogram:
    """
    Counts times in bins that widen with the time: eight for each power of two, so a quantile is
    known to an eighth of itself however many times there are.
    """

    def count(self) -> int:
        """How many times there are."""

    def quantile(self, fraction: float) -> float:
        """
        The time [s] below which the share `fraction` of all times lies; 0 if there are none.
        """

    def counts(self) -> list[int]:
        """How many times are in each bin."""

    @staticmethod
    def edges() -> list[float]:
        """
        The shortest time of each bin [s]; that of the last one and all that are longer.
        """

    def max(self) -> float:
        """The longest time [s]."""

    def __str__(self) -> str: ...

    def __repr__(self) -> str: ...

class LateStep:
    """A step that was late."""

    @property
    def time_index(self) -> int: ...

    @property
    def lateness(self) -> float:
        """
        How late the tick began [s]; if the user was to blame, for how long there has been no new
        action.
        """

    @property
    def cause(self) -> str:
        """Who was to blame: "user", "scheduler" or "driver"."""

    def __repr__(self) -> str: ...

class TimingRecord:
    """
    How a session in real time keeps its time; str() tells it in a sentence.

    A step is late because its action was missing ("user"), because the back-end was woken late or
    did not get the processor ("scheduler"), or because calls of the driver took up the tick before
    ("driver").
    """

    def lateness(self) -> LatenessHistogram:
        """`lateness_of` all steps."""

    def steps(self) -> int:
        """Steps so far, the one that ended the session included."""

    def late_steps(self, cause: str | None = ...) -> int:
        """How many steps were late, all of them or because of `cause`."""

    def success_rate(self) -> float:
        """
        The share of the newest 1000 steps that were in time: 1 if all of them were.
        """

    def worst(self) -> list[LateStep]:
        """
        The worst late steps, the worst first. Of steps that are later and later in a row there is
        only the last one.
        """

    def __str__(self) -> str: ...

    def __repr__(self) -> str: ...

def duration_text(seconds: float) -> str:
    """A time for people, as in "12 µs" and "1.2 ms"."""

def lateness_of(statuses: numpy.typing.NDArray[StatusElement], period: float) -> numpy.typing.NDArray[numpy.float64]:
    """
    How late each step was [s]: how long after its deadline the tick began, or after the deadline of
    the first tick that was left out before it; zero without deadlines. `period` is the session's.
    """

class Frontend:
    """
    The user's view of a running robot: append desired actions, read back what happened.

    Reading step t waits until the back-end has filled it in, so a loop that reads y[t] and appends
    a[t+1] is paced by the robot and needs no sleep of its own.

    `y.position` and `y["position"]` read a field of an Element. Ranges of steps are structured
    arrays of NumPy, `ys["position"]` is their field.

    Any number of threads may read; one appends. Every wait ends: with the value, with TimedOut
    (`timeout` is in seconds, None for as long as it takes), with RobotStopped once the session has
    ended and the value will never come, or with Ctrl-C. A handle that went through os.fork() raises
    InheritedHandle.

    As a context manager it calls finish() after a clean end of the block and lets go after an
    exception.
    """

    def append_desired_action(self, action: Action, timeout: float | None = None) -> int:
        """
        Appends `action` and returns the step it is scheduled for: the next one, or the first still open
        if the loop fell behind. The first call starts time 0. Waits only if the queue is full.

        Raises RobotStopped, TimedOut, AcausalAction if strict, InvalidArgument for anything but an
        action of this robot: see new_action.
        """

    def append_desired_actions(self, actions: numpy.typing.NDArray[Action], timeout: float | None = None) -> int:
        """
        Appends a burst: the elements of a one-dimensional array of `action_dtype`, one behind the
        other. Returns the step of the last one.
        """

    def new_action(self, **fields: numpy.typing.ArrayLike) -> Action:
        """
        Returns the robot's default action with `fields` filled in; a number fills the whole field. It
        can be changed and appended as often as you like.
        """

    def get_observation(self, t: int, timeout: float | None = None) -> Observation:
        """
        Returns y[t], waiting for it if `t` lies in the future.

        Raises HistoryLost if y[t] was already overwritten, RobotStopped if it will never come,
        TimedOut.
        """

    def get_desired_action(self, t: int, timeout: float | None = None) -> Action:
        """
        Returns a[t] as the back-end took it; raises as get_observation, like all below.
        """

    def get_applied_action(self, t: int, timeout: float | None = None) -> AppliedAction:
        """Returns a'[t]: what was applied."""

    def get_status(self, t: int, timeout: float | None = None) -> StatusElement:
        """Returns what the back-end has to say about step t."""

    def get_observations(self, first: int, last: int, timeout: float | None = None) -> numpy.typing.NDArray[Observation]:
        """
        Returns the steps from `first` to before `last`, waiting for the last one.
        """

    def get_desired_actions(self, first: int, last: int, timeout: float | None = None) -> numpy.typing.NDArray[Action]: ...

    def get_applied_actions(self, first: int, last: int, timeout: float | None = None) -> numpy.typing.NDArray[AppliedAction]: ...

    def get_statuses(self, first: int, last: int, timeout: float | None = None) -> numpy.typing.NDArray[StatusElement]: ...

    def latest_observation(self, timeout: float | None = None) -> Observation:
        """
        Returns the newest observation, before step 0 too: nobody has to act in order to look.
        """

    def get_latest_at(self, t: int, timeout: float | None = None) -> Observation | None:
        """
        Companions: returns the newest element that arrived at or before the robot's step `t`, waiting
        for that step. None if there was none by then.
        """

    def wait_until_time_index(self, t: int, timeout: float | None = None) -> None:
        """Waits until y[t] is there."""

    def current_time_index(self) -> int:
        """The newest step whose observation is there, -1 before step 0."""

    def range(self, series: str) -> tuple[int, int]:
        """
        The first step of `series` that can still be read, and the first that has not been written: as
        in `robot.get_observations(*robot.range("observation"))`. Series are "desired_action",
        "applied_action", "observation" and "status".
        """

    def finish(self, timeout: float | None = None) -> None:
        """
        Says that no further action will come: the session ends, without a fault, behind the last action
        appended. Returns when it has ended.
        """

    def recover(self, timeout: float | None = None) -> None:
        """
        Clears the fault that ended the session and waits until the back-end has begun the next one.
        This handle remains stopped: connect again.
        """

    def fault(self) -> trifinger.session_info.Fault | None:
        """Why the session ended; None while it goes on."""

    def timing(self) -> TimingRecord | None:
        """
        How the session keeps its time, so far or in the end; None outside real-time mode and before the
        first whole step.
        """

    def companion(self, name: str) -> Frontend:
        """Reads the companion `name` of this robot, as in "object"."""

    def session_info(self) -> trifinger.session_info.SessionInfo:
        """
        What anybody may know about the session: name, type, period, who takes part.
        """

    def documents(self) -> dict[str, str]:
        """
        Texts that belong to the session, by name: "configuration.yml", "model.xml".
        """

    def close(self) -> None:
        """
        Lets go of the session. If actions were appended and it still runs, it ends ("detached").
        """

    @property
    def action_dtype(self) -> numpy.dtype[Action]:
        """The layout of an action."""

    @property
    def applied_action_dtype(self) -> numpy.dtype[AppliedAction]:
        """The layout of what the robot says it has applied."""

    @property
    def observation_dtype(self) -> numpy.dtype[Observation]:
        """The layout of an observation."""

    @property
    def status_dtype(self) -> numpy.dtype[StatusElement]:
        """The layout of a status, the same for every robot."""

    def __repr__(self) -> str: ...

    def __enter__(self) -> Frontend: ...

    def __exit__(self, type: type[BaseException] | None, value: BaseException | None, traceback: types.TracebackType | None) -> None: ...

def connect(name: str, *, strict: bool = False, timeout: float | None = 5.0) -> Frontend:
    """
    Takes control of the robot `name`, which runs in a back-end of its own: `trifinger run`.

    `strict` makes an action that comes after its step was read an error (AcausalAction) instead of
    a mark in the status. `timeout` is how long to wait for a session that is about to begin.

    Raises SessionNotFound with the names there are, ControlHeld naming the process that controls
    it, RobotStopped if a fault must be cleared with recover() first.
    """

def observe(name: str) -> Frontend:
    """Looks at the robot or companion `name` without controlling it."""

class Backend:
    """
    A back-end in a thread of this process, offered to all processes under a name.

    It runs session after session until stop(), or until the end of its `with` block.
    """

    def __repr__(self) -> str: ...

    @property
    def name(self) -> str:
        """For connect() and observe()."""

    def wait(self, timeout: float | None = None) -> None:
        """Waits until the back-end has ended or Ctrl-C is pressed."""

    def stop(self) -> None:
        """Ends the session, brings the robot to rest and gives the name back."""

    def __enter__(self) -> Backend: ...

    def __exit__(self, type: type[BaseException] | None, value: BaseException | None, traceback: types.TracebackType | None) -> None: ...

def fake(*, strict: bool = ..., history: int = ..., sensor_period: int = ..., sensor_delay: int = ..., observation_fault_after: int = ..., action_fault_after: int = ...) -> Frontend:
    """
    Starts the fake robot inside this program: no physics and no joints, for tests of your own code.

    It runs in the waits of the front-end that is returned: without threads, deterministic and fast.
    An action has the field `setpoint`, an observation `setpoint` (the last one applied) and
    `applied_actions` (how many there were). `history` is the number of steps kept. With a
    `sensor_period` [steps] it has the companion "sensor". `observation_fault_after` and
    `action_fault_after` inject a fault after that many calls.
    """

def run_fake(name: str, *, real_time: bool = False, period: float = 0.001, max_action_repeats: int = 0, max_skipped_ticks: int = 5, first_action_timeout: float | None = None, history: int = 16384, sensor_period: int = 0, sensor_delay: int = 0, observation_fault_after: int = -1, action_fault_after: int = -1) -> Backend:
    """
    Runs the fake robot (see fake()) in a thread of this process, for every process of this machine.

    In real-time mode a step takes `period` [s] and a missing action is replaced up to
    `max_action_repeats` times in a row; otherwise the robot waits for every action.

    Raises RobotOwned if another back-end has this name.
    """

class Reason(enum.IntFlag):
    """
    Why a joint was not given what was asked of it: bits of `reasons` in an applied action.
    """

    TORQUE_NOT_FINITE = 1
    """
    the torque asked for is NaN or infinite; the joint holds its last accepted target
    """

    POSITION_NOT_FINITE = 2
    """
    the position asked for is infinite; the joint holds its last accepted target
    """

    KP_OUT_OF_BOUNDS = 4
    """
    position_kp is not between 0 and max_kp; the joint holds its last accepted target
    """

    KD_OUT_OF_BOUNDS = 8
    """
    position_kd is not between 0 and max_kd; the joint holds its last accepted target
    """

    OWN_CHECK = 16
    """a check that was added for this robot or task changed the action"""

    TARGET_CLAMPED = 32
    """the position asked for was beyond a soft limit and was moved to it"""

    PUSHED_BACK = 64
    """the joint is beyond a soft limit and is pushed back"""

    TORQUE_CLIPPED = 128
    """the torque was clipped to the joint's maximum"""

    DAMPED = 256
    """the safety damping acts against the joint's velocity"""

    HARD_LIMIT = 512
    """the joint is beyond its hard limit"""

    BAD_MEASUREMENT = 1024
    """the measured position, velocity or torque is no plausible number"""

    OWN_CHECK_FAILED = 2048
    """a check that was added for this robot or task threw an exception"""

    BRAKING = 4096
    """the robot brakes because of a fault"""

    TORQUE_RATE_LIMITED = 8192
    """
    the torque asked for changed faster than max_torque_rate and follows with delay
    """

    DERATED = 16384
    """the motor is warm and the torque was clipped to what it can carry"""

    TOO_FAST = 32768
    """
    the joint is faster than max_velocity, or than it may be so near to a soft limit, and is braked
    """

    OVERHEATED = 65536
    """the motor is too warm: it has given more torque than it was told"""

    POSITION_JUMPED = 131072
    """the measured position changed faster than a joint can move"""

    VELOCITY_MISMATCH = 262144
    """the measured velocity is not that of the measured position"""

    STUCK = 524288
    """the measurements do not change at all, whatever the torque"""

class Recorder:
    """
    Records a robot of this process in a thread of its own, without loss: the simulation waits for it. The end of
    the program stops it.
    """

    def stop(self) -> None:
        """
        Writes what is there and finishes the file; nothing is recorded from then on.
        """

    @property
    def file(self) -> pathlib.Path | None:
        """The newest file; None before the first session."""

    def __enter__(self) -> Recorder: ...

    def __exit__(self, *exception: object) -> None: ...

class Variation:
    """
    How a simulation differs from its configuration for an episode; the numbers are those of `Simulation.vary`.
    """

    @property
    def object_mass(self) -> float: ...

    @property
    def friction(self) -> float: ...

    @property
    def pair_friction(self) -> dict[str, float]: ...

    @property
    def contact_time(self) -> float: ...

    @property
    def motor_gain(self) -> float: ...

    @property
    def torque_delay(self) -> int: ...

    @property
    def rotor_inertia(self) -> float: ...

    @property
    def joint_damping(self) -> float: ...

    @property
    def joint_friction(self) -> float: ...

    @property
    def stop_margin(self) -> float: ...

class Simulation:
    """
    A simulated robot in this process, with its back-end inside the waits of its front-end: no threads, deterministic,
    as fast as the physics. simulate() is the short form.

    Every session begins in the state that the last reset(), place_object(), set_object_velocity() or restore() has left.
    During a session they take effect at once.
    """

    def __init__(self, config: str = 'sim', overrides: dict[str, object] = {}) -> None:
        """
        `config` is the name of a configuration that comes with the package, or a file; `overrides` changes single
        values: {"fingers.height": 0.3, "simulation.seed": 7}.
        """

    def __repr__(self) -> str: ...

    def connect(self, *, strict: bool = ...) -> Frontend:
        """
        Controls the robot in a new session. Raises ControlHeld while another front-end does.
        """

    def reset(self, position: Sequence[float] | None = ..., seed: int | None = ..., episode: int = ...) -> None:
        """
        Goes back to the beginning: joints at `position` [rad] (default: the configuration's), objects as they are at the start
        of the configuration, random numbers of `episode` of `seed` (default: the configuration's).
        """

    @overload
    def vary(self, variation: Variation) -> None:
        """Differs as the start of an episode says."""

    @overload
    def vary(self, *, object_mass: float = 1.0, friction: float = 1.0, pair_friction: dict[str, float] = {}, contact_time: float = 1.0, motor_gain: float = 1.0, torque_delay: int = 0, rotor_inertia: float = 1.0, joint_damping: float = 1.0, joint_friction: float = 0.0, stop_margin: float = 1.0) -> None:
        """
        Differs from its configuration from now on, whatever is reset. Each number is a factor but for two: the steps until
        motors deliver a torque, and the dry friction that is added in the joints [Nm]. `pair_friction` is by pairs of
        surfaces, as in {"tip_object": 0.8}, besides `friction` of all; docs/simulation.md names them.
        """

    def place_object(self, name: str, position: Sequence[float], orientation: Sequence[float] = ...) -> None:
        """
        Puts an object somewhere, at rest: x, y, z [m] and a quaternion w, x, y, z.
        """

    def set_object_velocity(self, name: str, linear: Sequence[float], angular: Sequence[float] = ...) -> None:
        """
        Lets an object move from where it is, in the world frame: its centre [m/s], and about it [rad/s].
        """

    def push_object(self, name: str, force: Sequence[float]) -> None:
        """
        Lets a force act on an object's centre of mass from the next step of the session on [N], until the next call,
        reset() or session.
        """

    def object_velocity(self, name: str) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]]:
        """
        How an object moves now, without delay and noise: its centre [m/s], and about it [rad/s].
        """

    def object_pose(self, name: str) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], Annotated[NDArray[numpy.float64], dict(shape=(4), order='C')]]:
        """
        Where an object is now, without delay and noise: position [m] and quaternion w, x, y, z.
        """

    def save(self) -> bytes:
        """The whole state: physics, safety chain, delays, random numbers."""

    def restore(self, state: bytes) -> None:
        """Goes on as it went on from `state`, bit for bit."""

    def state_before_divergence(self) -> bytes:
        """The last state before the simulation diverged; empty if it has not."""

    def configuration(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]:
        """MuJoCo's qpos, then qvel, to draw the scene of mjcf()."""

    def add_check(self, function: Callable[[Observation, Action], None]) -> None:
        """
        Adds a safety check of your own, between sessions: `function(observation, action)` changes the action in place.
        The robot's own limits are checked after it. An exception ends the session with a fault that has its text.
        Ctrl-C is no fault: KeyboardInterrupt reaches the program that waits for the robot.
        """

    def record(self, folder: str | os.PathLike[str], *, precision: str = 'double') -> Recorder:
        """
        Records every session from the next one on, without loss, into a file in `folder`; "single" takes half of
        the space.
        """

    def mjcf(self) -> str:
        """The scene in MuJoCo's format."""

def simulate(config: str = 'sim', overrides: dict[str, object] = {}, *, strict: bool = True, record: str | os.PathLike[str] | None = None, checks: Iterable[Callable[[Observation, Action], None]] = ()) -> Frontend:
    """
    Starts a simulated robot in this process and controls it; see Simulation. `record` is the folder for a log,
    `checks` are safety checks of your own, see Simulation.add_check(). connect() is for one that runs elsewhere.
    """

def export_mjcf(config: str = 'sim', overrides: dict[str, object] = {}) -> str:
    """
    The scene of a configuration in MuJoCo's format, with objects, cameras and lights.
    """

def export_urdf(config: str = 'sim', overrides: dict[str, object] = {}) -> str:
    """The robot of a configuration as URDF."""

class Kinematics:
    """
    Kinematics and dynamics of the fingers, without contacts and objects, in the world frame: z up, origin on the
    table. Not for several threads at once: make one each.
    """

    def __init__(self, config: str = 'sim', overrides: dict[str, object] = {}) -> None:
        """
        Of the robot of a configuration: the name of one that comes with the package, or a file.
        """

    @property
    def num_fingers(self) -> int:
        """1 or 3."""

    @property
    def num_joints(self) -> int:
        """Three for each finger."""

    def tip_positions(self, position: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Centres of the tip spheres at the joint positions `position` [rad]: a row x, y, z for each finger [m].
        """

    def tip_jacobian(self, finger: int, position: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Derivative of one tip's position by all joints [m/rad]: 3 rows, `num_joints` columns.
        """

    def tip_jacobians(self, position: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """The Jacobians of all tips below each other [m/rad]."""

    def tip_accelerations(self, position: numpy.typing.ArrayLike, velocity: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        How the tips accelerate with joints of constant `velocity` [rad/s]: a row x, y, z for each finger [m/s^2].
        """

    def gravity_torques(self, position: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """Torques that hold the pose against gravity [Nm]."""

    def bias_torques(self, position: numpy.typing.ArrayLike, velocity: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Torques that keep joints at their `velocity` [rad/s] without acceleration: against gravity, Coriolis and
        centrifugal forces [Nm]. Friction is not part of it.
        """

    def mass_matrix(self, position: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """Inertia seen by the joints, with that of the rotors [kg m^2]."""

    def inverse_kinematics(self, finger: int, tip: numpy.typing.ArrayLike, near: numpy.typing.ArrayLike | None = None) -> tuple[numpy.typing.NDArray[numpy.float64], str]:
        """
        Joint positions of `finger` [rad] that bring its tip to `tip` [m], and whether it can reach it: 'yes',
        'too_far', 'too_close' or 'outside_limits'. Where it cannot, the pose comes near it. Of several poses it is the
        one nearest to `near` [rad], by default to the initial pose.
        """

class Pose:
    """Where a body is and how it is turned. Cannot be changed."""

    def __init__(self, position: numpy.typing.ArrayLike = ..., orientation: numpy.typing.ArrayLike = ...) -> None:
        """
        `position` of the centre of mass [m]; `orientation` from the body's frame, a quaternion w, x, y, z of unit length.
        """

    @property
    def position(self) -> numpy.typing.NDArray[numpy.float64]:
        """Of the centre of mass [m]."""

    @property
    def orientation(self) -> numpy.typing.NDArray[numpy.float64]:
        """From the body's frame: w, x, y, z."""

class Twist:
    """How a body moves. Cannot be changed."""

    def __init__(self, linear: numpy.typing.ArrayLike = ..., angular: numpy.typing.ArrayLike = ...) -> None: ...

    @property
    def linear(self) -> numpy.typing.NDArray[numpy.float64]:
        """Of the centre of mass [m/s]."""

    @property
    def angular(self) -> numpy.typing.NDArray[numpy.float64]:
        """[rad/s], not in the body's frame."""

class Acceleration:
    """How the twist of a body changes. Cannot be changed."""

    def __init__(self, linear: numpy.typing.ArrayLike = ..., angular: numpy.typing.ArrayLike = ...) -> None: ...

    @property
    def linear(self) -> numpy.typing.NDArray[numpy.float64]:
        """[m/s^2]"""

    @property
    def angular(self) -> numpy.typing.NDArray[numpy.float64]:
        """[rad/s^2]"""

class Motion:
    """A body at one instant of a motion. Cannot be changed."""

    def __init__(self, pose: Pose = ..., twist: Twist = ..., acceleration: Acceleration = ...) -> None: ...

    @property
    def pose(self) -> Pose: ...

    @property
    def twist(self) -> Twist: ...

    @property
    def acceleration(self) -> Acceleration: ...

class PointMotion:
    """A point at one instant of a motion. Cannot be changed."""

    def __init__(self, position: numpy.typing.ArrayLike = ..., velocity: numpy.typing.ArrayLike = ..., acceleration: numpy.typing.ArrayLike = ...) -> None: ...

    @property
    def position(self) -> numpy.typing.NDArray[numpy.float64]:
        """[m]"""

    @property
    def velocity(self) -> numpy.typing.NDArray[numpy.float64]:
        """[m/s]"""

    @property
    def acceleration(self) -> numpy.typing.NDArray[numpy.float64]:
        """[m/s^2]"""

def rotation_from_vector(vector: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
    """
    The rotation by `vector` [rad], about its direction and by its length, as w, x, y, z.
    """

def rotation_vector(rotation: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
    """
    The shortest vector that `rotation_from_vector` makes `rotation` of [rad].
    """

def rotation_error(desired: numpy.typing.ArrayLike, actual: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
    """
    By what `actual` must still be turned to become `desired` [rad], in the frame in which both are given.
    """

def moved(pose: Pose, twist: Twist, duration: float) -> Pose:
    """
    Where `pose` is after moving with a constant `twist` for `duration` [s].
    """

def point_of_body(body: Motion, point: numpy.typing.ArrayLike) -> PointMotion:
    """
    How a point moves that is fixed to a body; `point` is in the body's frame, from its centre [m].
    """

class Wrench:
    """A force and a moment. Cannot be changed."""

    def __init__(self, force: numpy.typing.ArrayLike = ..., moment: numpy.typing.ArrayLike = ...) -> None: ...

    @property
    def force(self) -> numpy.typing.NDArray[numpy.float64]:
        """[N]"""

    @property
    def moment(self) -> numpy.typing.NDArray[numpy.float64]:
        """About a point that goes with it [Nm]."""

class Contact:
    """
    A point at which a tip touches an object and pushes, with friction and without adhesion. Cannot be changed.

    A tip that does not touch is a contact with `max_normal_force` 0: it gets no force.
    """

    def __init__(self, position: numpy.typing.ArrayLike, normal: numpy.typing.ArrayLike, friction: float = ..., min_normal_force: float = ..., max_normal_force: float = ...) -> None: ...

    @property
    def position(self) -> numpy.typing.NDArray[numpy.float64]:
        """[m]"""

    @property
    def normal(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Into the object, of any length but zero: the direction in which the tip can push.
        """

    @property
    def friction(self) -> float:
        """What a controller relies on; less than what there is."""

    @property
    def min_normal_force(self) -> float:
        """[N]"""

    @property
    def max_normal_force(self) -> float:
        """[N]"""

def contact_frame(normal: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
    """
    Columns: two tangents and `normal`, orthonormal and right-handed. The first tangent is normal to z, or to x
    where the normal is nearly along z.
    """

def grasp_map(grasp: Sequence[Contact], centre: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
    """
    Turns contact forces into the wrench on the object about `centre` [m]: 6 rows, force and moment; 9 columns,
    three for each of the three contacts.
    """

def wrench_of(grasp: Sequence[Contact], centre: numpy.typing.ArrayLike, forces: numpy.typing.ArrayLike) -> Wrench:
    """
    What nine `forces` [N] at the three contacts amount to about `centre` [m].
    """

class FrictionPyramid:
    """
    The forces that a contact with friction can bear, as a pyramid of 3 to 8 sides inside Coulomb's cone.
    With four sides it is the paper's.
    """

    def __init__(self, sides: int = ...) -> None: ...

    @property
    def sides(self) -> int: ...

    def side(self, i: int, friction: float) -> numpy.typing.NDArray[numpy.float64]:
        """
        Points inward from side `i`, in the contact frame. Its tangential part has the length 1.
        """

    def margin(self, force: numpy.typing.ArrayLike, friction: float) -> float:
        """
        How much more tangential force fits into the pyramid beside `force` [N], which is in the contact frame;
        negative outside.
        """

class TorqueLimits:
    """
    The torques that joints can give, for tips that press. Cannot be changed.
    """

    def __init__(self, jacobians: numpy.typing.ArrayLike, bias: numpy.typing.ArrayLike, limits: numpy.typing.ArrayLike) -> None: ...

    @property
    def jacobians(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        9 x 9, of the contacts in the frame of the grasp [m/rad]; `Kinematics.tip_jacobians` in the world's.
        """

    @property
    def bias(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        What the joints need without any contact [Nm]; `Kinematics.bias_torques`.
        """

    @property
    def limits(self) -> numpy.typing.NDArray[numpy.float64]:
        """[Nm]"""

class ForceStatus(enum.Enum):
    """How good an answer of the force optimisation is, best first."""

    EXACT = 0
    """The wrench is the one wanted."""

    CLOSEST_WRENCH = 1
    """No allowed forces make the wanted wrench; these come closest to it."""

    TORQUE_LIMITS_EXCEEDED = 2
    """
    Even the smallest normal forces ask for more torque than there is. The torque limits were left aside.
    """

    INVALID = 3
    """A number was not finite or out of its range. All forces are zero."""

class ForceDistribution:
    """An answer of the force optimisation."""

    @property
    def forces(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Of the tips on the object [N], in the frame of the grasp: three numbers for each of the three contacts.
        """

    @property
    def wrench(self) -> Wrench:
        """That they amount to."""

    @property
    def status(self) -> ForceStatus: ...

    def __bool__(self) -> bool: ...

class ForceOptimizer:
    """
    Finds the contact forces that make a wanted wrench: the paper's quadratic program, with bounds on normal forces
    and joint torques. Not for several threads at once.
    """

    def __init__(self, friction_sides: int = ..., normal_weight: float = ..., tangential_weight: float = ...) -> None: ...

    def solve(self, grasp: Sequence[Contact], centre: numpy.typing.ArrayLike, wrench: Wrench, torques: TorqueLimits | None = ...) -> ForceDistribution:
        """
        Distributes `wrench`, which is about `centre` [m], over the three contacts. Where it cannot, the answer comes
        closest to it and its `status` says so.
        """

class RigidBody:
    """What moves when a wrench acts. Cannot be changed."""

    def __init__(self, mass: float, inertia: numpy.typing.ArrayLike) -> None: ...

    @property
    def mass(self) -> float:
        """[kg]"""

    @property
    def inertia(self) -> numpy.typing.NDArray[numpy.float64]:
        """About the centre of mass, in the body's frame [kg m^2]."""

def rigid_body(shape: str, size: numpy.typing.ArrayLike, mass: float) -> RigidBody:
    """
    A 'box', a 'stick' along x or a 'ball' of evenly spread mass. `size` has the whole lengths x, y, z of a box, the
    length and diameter of a stick, the diameter of a ball [m].
    """

def gravity() -> numpy.typing.NDArray[numpy.float64]:
    """[m/s^2], in the world frame."""

class ObjectGains:
    """How stiffly an object is held."""

    def __init__(self, stiffness: float = ..., damping: float = ..., rotational_stiffness: float = ..., rotational_damping: float = ...) -> None: ...

    @property
    def stiffness(self) -> float:
        """[N/m]"""

    @stiffness.setter
    def stiffness(self, arg: float, /) -> None: ...

    @property
    def damping(self) -> float:
        """[Ns/m]"""

    @damping.setter
    def damping(self, arg: float, /) -> None: ...

    @property
    def rotational_stiffness(self) -> float:
        """[Nm/rad]"""

    @rotational_stiffness.setter
    def rotational_stiffness(self, arg: float, /) -> None: ...

    @property
    def rotational_damping(self) -> float:
        """[Nms/rad]"""

    @rotational_damping.setter
    def rotational_damping(self, arg: float, /) -> None: ...

def object_impedance(desired: Motion, pose: Pose, twist: Twist, body: RigidBody, gains: ObjectGains = ...) -> Wrench:
    """
    The wrench about the object's centre that keeps it on its way, in the world frame, with its weight and inertia.
    """

class TipGains:
    """How stiffly a tip is held."""

    def __init__(self, stiffness: float = ..., damping: float = ...) -> None: ...

    @property
    def stiffness(self) -> float:
        """[N/m]"""

    @stiffness.setter
    def stiffness(self, arg: float, /) -> None: ...

    @property
    def damping(self) -> float:
        """[Ns/m]"""

    @damping.setter
    def damping(self, arg: float, /) -> None: ...

def tip_impedance(desired: PointMotion, position: numpy.typing.ArrayLike, velocity: numpy.typing.ArrayLike, gains: TipGains = ...) -> numpy.typing.NDArray[numpy.float64]:
    """
    The force that brings a tip to where it should be [N]. What it should press with comes on top.
    """

class Progress:
    """How far a movement is, and how that changes."""

    @property
    def value(self) -> float:
        """0 at the begin, 1 at the end."""

    @property
    def rate(self) -> float:
        """[1/s]"""

    @property
    def acceleration(self) -> float:
        """[1/s^2]"""

def minimum_jerk(time: float, duration: float) -> Progress:
    """The movement of the least jerk from rest to rest; times in [s]."""

class LineTrajectory:
    """A straight line with the least jerk."""

    def __init__(self, start: numpy.typing.ArrayLike, end: numpy.typing.ArrayLike, duration: float) -> None: ...

    @property
    def duration(self) -> float:
        """[s]"""

    def at(self, time: float) -> PointMotion:
        """
        `time` since the begin [s]; before it at rest at the begin, after `duration` at the end.
        """

class PoseTrajectory:
    """
    A straight line and a rotation about a fixed axis, the shorter way round, with the least jerk.
    """

    def __init__(self, start: Pose, end: Pose, duration: float) -> None: ...

    @property
    def duration(self) -> float:
        """[s]"""

    def at(self, time: float) -> Motion:
        """
        `time` since the begin [s]; before it at rest at the begin, after `duration` at the end.
        """

class CircleTrajectory:
    """
    A horizontal circle that gains its speed smoothly and loses it at the end.
    """

    def __init__(self, centre: numpy.typing.ArrayLike, radius: float = ..., start_angle: float = ..., turns: float = ..., period: float = ..., ramp_time: float = ...) -> None:
        """
        `start_angle` from x towards y [rad]; below zero `turns` go clockwise; `period` of one turn at full speed [s].
        """

    @property
    def duration(self) -> float:
        """[s]"""

    def at(self, time: float) -> PointMotion:
        """
        `time` since the begin [s]; before it at rest at the begin, after `duration` at the end.
        """

class LowPassFilter:
    """
    A first-order low-pass for up to nine numbers. Samples may come at uneven intervals.
    """

    def __init__(self, cutoff_frequency: float) -> None: ...

    def update(self, sample: numpy.typing.ArrayLike, elapsed: float) -> numpy.typing.NDArray[numpy.float64]:
        """
        Takes the next sample, `elapsed` [s] after the one before, and returns the filtered signal. The first sample
        passes as it is, and so does one with another number of values.
        """

    def reset(self) -> None:
        """The next sample will be the first."""

class Derivative:
    """The rate at which up to nine numbers change, low-pass filtered."""

    def __init__(self, cutoff_frequency: float) -> None: ...

    def update(self, sample: numpy.typing.ArrayLike, elapsed: float) -> numpy.typing.NDArray[numpy.float64]:
        """
        Takes the next sample, `elapsed` [s] after the one before, and returns the rate [1/s]: zero for the first sample and for one with another number of values.
        """

    def reset(self) -> None:
        """The next sample will be the first."""

class PoseEstimator:
    """
    Where an object is now and how it moves, from poses that are few, noisy and old.

    It filters how far the object is from a motion that is known, such as the one it is led on, and predicts that
    deviation across the delay. Times are those since any begin [s].
    """

    def __init__(self, bandwidth: float = ...) -> None: ...

    def update(self, time: float, pose: Pose, known: Motion = ...) -> bool:
        """
        Takes `pose`, measured at `time`, when the known motion was at `known`. False if it was ignored: not newer than
        the one before, or not finite.
        """

    def predict(self, time: float, known: Motion = ...) -> Motion:
        """Where the object is at `time`, when the known motion is at `known`."""

    @property
    def last_time(self) -> float:
        """Of the newest pose; negative infinity before the first."""

    def reset(self) -> None:
        """Forgets all poses."""

class Touch:
    """
    Where one tip touches an object, in the object's frame. Cannot be changed.
    """

    def __init__(self, point: numpy.typing.ArrayLike, normal: numpy.typing.ArrayLike) -> None: ...

    @property
    def point(self) -> numpy.typing.NDArray[numpy.float64]:
        """On the surface, from the centre [m]."""

    @property
    def normal(self) -> numpy.typing.NDArray[numpy.float64]:
        """Into the object, of unit length."""

class Approach:
    """
    How a tip comes to its touch: through these points, for the centre of its sphere, in the world frame.
    """

    @property
    def above(self) -> numpy.typing.NDArray[numpy.float64]:
        """[m]"""

    @property
    def beside(self) -> numpy.typing.NDArray[numpy.float64]:
        """[m]"""

def approach_to(touch: Touch, object: Pose, tip_radius: float) -> Approach:
    """
    The approach of a tip of `tip_radius` [m] to an object at rest at the pose `object`.
    """

class GraspPlannerConfig:
    """Among what a planner looks, and what it asks for."""

    def __init__(self, *, offsets: Sequence[float] = ..., heights: Sequence[float] = ..., friction: float = ..., friction_sides: int = ..., min_normal_force: float = ..., clearance: float = ..., limit_margin: float = ..., largest_torque: float = ...) -> None: ...

    @property
    def offsets(self) -> list[float]:
        """To both sides of a face's middle [m]."""

    @offsets.setter
    def offsets(self, arg: Sequence[float], /) -> None: ...

    @property
    def heights(self) -> list[float]:
        """Above the object's centre [m]."""

    @heights.setter
    def heights(self, arg: Sequence[float], /) -> None: ...

    @property
    def friction(self) -> float:
        """On which the forces rely."""

    @friction.setter
    def friction(self, arg: float, /) -> None: ...

    @property
    def friction_sides(self) -> int:
        """Of its pyramids, 3 to 8."""

    @friction_sides.setter
    def friction_sides(self, arg: int, /) -> None: ...

    @property
    def min_normal_force(self) -> float:
        """[N]"""

    @min_normal_force.setter
    def min_normal_force(self, arg: float, /) -> None: ...

    @property
    def clearance(self) -> float:
        """Of fingers from all they do not touch with their tips [m]."""

    @clearance.setter
    def clearance(self, arg: float, /) -> None: ...

    @property
    def limit_margin(self) -> float:
        """Of joints from their soft limits [rad]."""

    @limit_margin.setter
    def limit_margin(self, arg: float, /) -> None: ...

    @property
    def largest_torque(self) -> float:
        """Share of the motors' torque that carrying may take."""

    @largest_torque.setter
    def largest_torque(self, arg: float, /) -> None: ...

class PlannedGrasp:
    """What a planner has chosen."""

    @property
    def touches(self) -> list[Touch]:
        """One for each of the three tips, finger 0 first."""

    @property
    def torque_share(self) -> float:
        """
        The largest share of a motor's torque that carrying the object takes, anywhere on the way.
        """

class GraspPlanner:
    """
    Chooses which finger touches which side face of a box, and where. The fingers reach the whole way, touch nothing
    but the box with nothing but their tips, carry it within friction and ask for as little torque as can be. Not for
    several threads at once.
    """

    def __init__(self, config: str = 'sim', overrides: dict[str, object] = {}, object: str = 'cube', settings: GraspPlannerConfig = ...) -> None:
        """
        For the robot, the limits and the scene of a configuration, as in `Kinematics`; `object` is the name of the box.
        """

    def plan(self, way: Sequence[Motion]) -> PlannedGrasp | None:
        """
        The best grasp for leading the object along `way`, which begins where it is grasped; None if there is none. The
        object is as upright on all of the way as where it begins. Takes some milliseconds.
        """

class GraspControllerConfig:
    """How a `GraspController` works."""

    def __init__(self, *, object: ObjectGains = ..., tips: TipGains = ..., friction: float = ..., friction_sides: int = ..., slip_friction: float = ..., min_normal_force: float = ..., max_normal_force: float = ..., touch_force: float = ..., approach_speed: float = ..., closing_speed: float = ..., penetration: float = ..., closing_time: float = ..., engage_time: float = ..., roll_time: float = ..., slip_speed: float = ..., lost_time: float = ..., lost_distance: float = ...) -> None: ...

    @property
    def object(self) -> ObjectGains:
        """How stiffly the object is held."""

    @object.setter
    def object(self, arg: ObjectGains, /) -> None: ...

    @property
    def tips(self) -> TipGains:
        """How stiffly each tip is."""

    @tips.setter
    def tips(self, arg: TipGains, /) -> None: ...

    @property
    def friction(self) -> float:
        """On which the forces that hold the object rely."""

    @friction.setter
    def friction(self, arg: float, /) -> None: ...

    @property
    def friction_sides(self) -> int:
        """Of its pyramids, 3 to 8."""

    @friction_sides.setter
    def friction_sides(self, arg: int, /) -> None: ...

    @property
    def slip_friction(self) -> float:
        """Tangential forces of tips that hold never exceed this share."""

    @slip_friction.setter
    def slip_friction(self, arg: float, /) -> None: ...

    @property
    def min_normal_force(self) -> float:
        """Of each tip while it holds [N]."""

    @min_normal_force.setter
    def min_normal_force(self, arg: float, /) -> None: ...

    @property
    def max_normal_force(self) -> float:
        """Likewise [N]."""

    @max_normal_force.setter
    def max_normal_force(self, arg: float, /) -> None: ...

    @property
    def touch_force(self) -> float:
        """What is felt as a touch [N]."""

    @touch_force.setter
    def touch_force(self, arg: float, /) -> None: ...

    @property
    def approach_speed(self) -> float:
        """Of the tips, on average [m/s]."""

    @approach_speed.setter
    def approach_speed(self, arg: float, /) -> None: ...

    @property
    def closing_speed(self) -> float:
        """With which tips look for the faces [m/s]."""

    @closing_speed.setter
    def closing_speed(self, arg: float, /) -> None: ...

    @property
    def penetration(self) -> float:
        """How far behind a face they look for it [m]."""

    @penetration.setter
    def penetration(self, arg: float, /) -> None: ...

    @property
    def closing_time(self) -> float:
        """In which all tips must have felt their faces [s]."""

    @closing_time.setter
    def closing_time(self, arg: float, /) -> None: ...

    @property
    def engage_time(self) -> float:
        """In which touching becomes holding [s]."""

    @engage_time.setter
    def engage_time(self, arg: float, /) -> None: ...

    @property
    def roll_time(self) -> float:
        """In which the tips' targets follow tips that roll [s]."""

    @roll_time.setter
    def roll_time(self, arg: float, /) -> None: ...

    @property
    def slip_speed(self) -> float:
        """Of a tip along its face, above which it slips [m/s]."""

    @slip_speed.setter
    def slip_speed(self, arg: float, /) -> None: ...

    @property
    def lost_time(self) -> float:
        """Without touch, after which the object is lost [s]."""

    @lost_time.setter
    def lost_time(self, arg: float, /) -> None: ...

    @property
    def lost_distance(self) -> float:
        """From where it should be, likewise [m]."""

    @lost_distance.setter
    def lost_distance(self, arg: float, /) -> None: ...

class GraspPhase(enum.Enum):
    """What a `GraspController` is doing."""

    IDLE = 0
    """The tips stay where they are."""

    APPROACH = 1
    """On the way to the object, without touching it."""

    CLOSE = 2
    """Towards the faces, until all tips feel them."""

    ENGAGE = 3
    """Forces grow until they hold the object."""

    HOLD = 4
    """The object follows the desired motion."""

    RELEASE = 5
    """Off the faces, and up."""

    LOST = 6
    """
    It slipped away, or was not where it should be. The tips stay: release them.
    """

class JointState:
    """
    What the nine joints measure, finger 0 first, from the base to the tip.
    """

    def __init__(self, position: numpy.typing.ArrayLike, velocity: numpy.typing.ArrayLike, torque: numpy.typing.ArrayLike) -> None: ...

    @property
    def position(self) -> numpy.typing.NDArray[numpy.float64]:
        """[rad]"""

    @property
    def velocity(self) -> numpy.typing.NDArray[numpy.float64]:
        """[rad/s]"""

    @property
    def torque(self) -> numpy.typing.NDArray[numpy.float64]:
        """[Nm]"""

class GraspState:
    """What a `GraspController` feels and does."""

    @property
    def phase(self) -> GraspPhase: ...

    @property
    def wanted(self) -> ForceDistribution:
        """Of the contacts while the object is held, in the world frame."""

    @property
    def normal_forces(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        What the three tips press with along their faces' normals, from the joints' torques [N].
        """

    @property
    def tangential_forces(self) -> numpy.typing.NDArray[numpy.float64]:
        """Likewise across the normals [N]."""

    @property
    def travel(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        How far each of the three tips has moved along its face since all of them touched, by rolling and slipping
        [m].
        """

    @property
    def slip_speeds(self) -> numpy.typing.NDArray[numpy.float64]:
        """How fast they do so, without what is faster than 5 Hz [m/s]."""

    @property
    def is_slipping(self) -> bool:
        """A tip moves along its face faster than tips roll."""

    @property
    def torque_share(self) -> float:
        """
        The largest share of a joint's torque limit that is asked for; what is above 1 the safety checks cut off.
        """

class GraspController:
    """
    The paper's controller: grasps an object with three tips, makes it follow a motion, and lets it go. Its equations are
    in docs/control.md. Call `update` once per step. Not for several threads at once.
    """

    def __init__(self, body: RigidBody, config: str = 'sim', overrides: dict[str, object] = {}, settings: GraspControllerConfig = ...) -> None:
        """
        `body` is the object, the robot and its limits are those of a configuration, as in `Kinematics`.
        """

    def grasp(self, touches: Sequence[Touch], object: Pose) -> None:
        """
        Goes to the object, which rests at the pose `object`, and takes it at three `touches`, finger 0 first.
        """

    def release(self) -> None:
        """Lets the object go, whatever the phase."""

    def update(self, elapsed: float, joints: JointState, object: Motion, desired: Motion) -> numpy.typing.NDArray[numpy.float64]:
        """
        The nine joint torques for the next step [Nm], `elapsed` [s] after the step before. `object` is where the object
        is and how it moves, `desired` how it should while it is held; until it is, `desired` should be where it rests.
        """

    @property
    def state(self) -> GraspState:
        """As of the last `update`."""

class Policy:
    """
    A trained policy, computed in C++: actions from observations. Its file is described in docs/policies.md.

    Not for several threads at once.
    """

    def __init__(self, path: str | os.PathLike[str], *, precision: str = 'double') -> None:
        """
        Reads the file at `path`. Sums are 'double' precision, or 'single', which takes about half the time and rounds
        as much as PyTorch does.
        """

    @staticmethod
    def from_layers(layers: Sequence[tuple[Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], str]], *, mean: Sequence[float] | None = ..., variance: Sequence[float] | None = ..., epsilon: float = ..., clip: float = ..., low: Sequence[float] | None = ..., high: Sequence[float] | None = ..., bounding: str = ..., metadata: Mapping[str, str] = ..., precision: str = ...) -> Policy:
        """
        Of layers: weights with a row for each output, bias, and 'identity', 'relu' or 'tanh'. Inputs are normalised with
        `mean` and `variance`; outputs are brought between `low` and `high`, by 'scale' from -1 to 1, or by 'clip'.
        `trifinger.policy_file` makes them from networks of PyTorch.
        """

    def save(self, path: str | os.PathLike[str]) -> None:
        """
        Writes the file at `path`, in one step: what was there is whole until the new one is.
        """

    def __call__(self, observation: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        The action for `observation`. An array of float64 is read where it lies.
        """

    @property
    def num_inputs(self) -> int: ...

    @property
    def num_outputs(self) -> int: ...

    @property
    def widths(self) -> list[int]:
        """Of the inputs and of each layer."""

    @property
    def activations(self) -> list[str]:
        """Of each layer."""

    @property
    def precision(self) -> str:
        """Of its sums: 'double' or 'single'."""

    @property
    def bounds(self) -> tuple[list[float], list[float], str] | None:
        """Of the outputs: low, high, and 'scale' or 'clip'; None for none."""

    @property
    def metadata(self) -> dict[str, str]:
        """What a program needs to know that runs it; a copy."""

class Episodes:
    """
    What makes a decision process of a robot: starts, goals, observations, rewards. `trifinger.environments` uses it.
    """

    def __init__(self, task: str, options: str, config: str, overrides: dict[str, object]) -> None: ...

    def begin(self, seed: int, number: int) -> tuple[list[float], list[float], list[float], list[float], Variation, int]:
        """
        Joints [rad], object's position [m], quaternion and velocity [m/s], variation, series of random numbers.
        """

    def check_robot(self, configuration: str) -> None:
        """Refuses another robot than that of `config`, by its configuration."""

    def way(self, from_position: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Joint positions that bring a robot to where the episode begins: a row for each action [rad].
        """

    def take_action(self, numbers: numpy.typing.NDArray[numpy.float32]) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """Torques [Nm] and positions [rad] of the joints for one action."""

    def observe(self, position: numpy.typing.ArrayLike, velocity: numpy.typing.ArrayLike, object: tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike] | None = None) -> tuple[float, bool, bool, bool]:
        """Reward, terminated, truncated, success; the arrays below change."""

    @property
    def entries(self) -> list[tuple[str, str, list[float], list[float]]]:
        """The parts of an observation: name, unit, bounds."""

    @property
    def goal(self) -> tuple[str, str, list[float], list[float]]: ...

    @property
    def flat_names(self) -> list[str]: ...

    @property
    def episode_actions(self) -> int: ...

    @property
    def num_joints(self) -> int: ...

    @property
    def object_name(self) -> str: ...

    def compute_reward(self, achieved: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], desired: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]:
        """One reward for each row."""

    @property
    def observation(self) -> numpy.typing.NDArray[numpy.float32]: ...

    @property
    def achieved(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def desired(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def distance(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def finger_rewards(self) -> numpy.typing.NDArray[numpy.float64]: ...

class EnvironmentBatch:
    """
    Many simulations of one decision process, on several threads. `trifinger.environments.VectorEnvironment` uses it.
    """

    def __init__(self, task: str, options: str, size: int, num_threads: int, config: str, overrides: dict[str, object]) -> None: ...

    def __len__(self) -> int: ...

    @property
    def num_threads(self) -> int: ...

    def seed(self, index: int, seed: int, episode: int = ...) -> None:
        """The next reset of this simulation begins this episode of `seed`."""

    def reset(self, which: numpy.typing.NDArray[numpy.bool_] | None = None) -> None:
        """Begins an episode in all, or in those that are marked."""

    def step(self, actions: numpy.typing.NDArray[numpy.float32], autoreset: str) -> None:
        """Lets an action act in each; the arrays below change."""

    @property
    def entries(self) -> list[tuple[str, str, list[float], list[float]]]:
        """The parts of an observation: name, unit, bounds."""

    @property
    def goal(self) -> tuple[str, str, list[float], list[float]]: ...

    @property
    def flat_names(self) -> list[str]: ...

    @property
    def episode_actions(self) -> int: ...

    @property
    def num_joints(self) -> int: ...

    @property
    def object_name(self) -> str: ...

    def compute_reward(self, achieved: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], desired: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]:
        """One reward for each row."""

    @property
    def observation(self) -> numpy.typing.NDArray[numpy.float32]: ...

    @property
    def achieved(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def desired(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def final_observation(self) -> numpy.typing.NDArray[numpy.float32]: ...

    @property
    def final_achieved(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def final_desired(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def distance(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def finger_rewards(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def final_distance(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def final_finger_rewards(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def reward(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def terminated(self) -> numpy.typing.NDArray[numpy.uint8]: ...

    @property
    def truncated(self) -> numpy.typing.NDArray[numpy.uint8]: ...

    @property
    def success(self) -> numpy.typing.NDArray[numpy.uint8]: ...

    @property
    def final_success(self) -> numpy.typing.NDArray[numpy.uint8]: ...

    @property
    def fault(self) -> numpy.typing.NDArray[numpy.int32]: ...

def task_names() -> list[str]:
    """Of what `trifinger.environments` has."""

def default_environment_options(task: str) -> str:
    """Of a task, as JSON."""

def environment_overrides(task: str, options: str) -> dict[str, object]:
    """What a robot's configuration must say for a task with options (JSON)."""

def robot_configuration(config: str, config_overrides: dict[str, object] = {}) -> str:
    """
    The whole text of a configuration, with what it extends and its overrides, as sessions have it.
    """

class StepsIterator:
    """What LoggedSession.chunks() goes through."""

    def __iter__(self) -> StepsIterator: ...

    def __next__(self) -> trifinger.log_types.Steps: ...

class LoggedSession:
    """
    A session as it is in a log: of a robot, or of one of its companions, whose elements are its
    observations and are counted by themselves.

        session = trifinger.Log("run.mcap").session("sim")
        session.observations["position"]             # all steps
        session.get_observations(1000, 2000)         # as a front-end has them
        session.get_observations(*session.between(1.5, 3.0), fields=("position",))
        for steps in session.chunks():               # a log larger than memory
            steps.time_index, steps.observations, steps.applied_actions

    Any number of threads may read.
    """

    def __repr__(self) -> str: ...

    @property
    def name(self) -> str: ...

    @property
    def type(self) -> str:
        """Of the robot, as in "trifinger"; of a companion, its own."""

    @property
    def is_companion(self) -> bool: ...

    @property
    def session_id(self) -> int: ...

    @property
    def is_real_time(self) -> bool: ...

    @property
    def realtime_lacks(self) -> list[str] | None:
        """
        In real-time mode what the loop lacked to be a real-time thread, a sentence each; None if the log does not
        say.
        """

    @property
    def period(self) -> float:
        """Of the robot's steps [s]."""

    @property
    def created(self) -> float:
        """When the session began, seconds since 1970."""

    @property
    def host(self) -> str: ...

    @property
    def backend_pid(self) -> int: ...

    @property
    def documents(self) -> dict[str, str]:
        """
        Texts that belong to the session, by name: "configuration.yml", "model.xml".
        """

    @property
    def steps(self) -> int | None:
        """
        Whole steps of the session; None if it went on when the recording ended.
        """

    @property
    def fault(self) -> trifinger.session_info.Fault | None:
        """Why the session ended; None if it went on when the recording ended."""

    @property
    def fault_text(self) -> str:
        """The same in a sentence."""

    @property
    def gaps(self) -> list[trifinger.log_types.Gap]:
        """
        The steps that are not in the log, because the recorder said so or because the file is damaged.
        Looks at the whole log once.
        """

    @property
    def observations(self) -> numpy.typing.NDArray[Observation]:
        """
        Those of all whole steps: a row for each number in `time_index`. Read when first asked for,
        and kept.
        """

    @property
    def desired_actions(self) -> numpy.typing.NDArray[Action]: ...

    @property
    def applied_actions(self) -> numpy.typing.NDArray[AppliedAction]: ...

    @property
    def statuses(self) -> numpy.typing.NDArray[StatusElement]: ...

    @property
    def time_index(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        The whole steps that are in the log; of a companion, the numbers of its elements.
        """

    @property
    def times(self) -> numpy.typing.NDArray[numpy.datetime64]:
        """When they were measured, by the clock on the wall (UTC)."""

    def get_observation(self, t: int) -> Observation:
        """Returns y[t]. Raises NotInLog, like all below."""

    def get_desired_action(self, t: int) -> Action: ...

    def get_applied_action(self, t: int) -> AppliedAction: ...

    def get_status(self, t: int) -> StatusElement: ...

    def get_observations(self, first: int, last: int, fields: str | Sequence[str] | None = None) -> numpy.typing.NDArray[Observation]:
        """
        Returns the steps from `first` to before `last`: row i is step `first + i`, so all of them must
        be in the log. Only these `fields`, if given.

        Where the session ended in step N there are an observation and a status N, but no actions.
        """

    def get_desired_actions(self, first: int, last: int, fields: str | Sequence[str] | None = None) -> numpy.typing.NDArray[Action]: ...

    def get_applied_actions(self, first: int, last: int, fields: str | Sequence[str] | None = None) -> numpy.typing.NDArray[AppliedAction]: ...

    def get_statuses(self, first: int, last: int, fields: str | Sequence[str] | None = None) -> numpy.typing.NDArray[StatusElement]: ...

    def get_latest_at(self, t: int) -> Observation | None:
        """
        Companions: returns the newest element that arrived at or before the robot's step `t`; None if
        there was none by then.
        """

    def range(self, series: str) -> tuple[int, int]:
        """The first step of `series` in the log, and the first behind the last."""

    def between(self, begin: float, end: float) -> tuple[int, int]:
        """
        The range of the steps that were measured from `begin` to before `end`, in seconds since the
        first step in the log.
        """

    def timing(self, first: int = 0, last: int | None = None) -> TimingRecord | None:
        """
        How the session kept its time from step `first` to before `last`, the status of its end
        included: what Frontend.timing() says, if no step is missing. None outside real-time mode, and if
        the statuses are those of another version.
        """

    def read(self, first: int | None = None, last: int | None = None, series: Mapping[str, Sequence[str] | None] | Sequence[str] | None = None) -> trifinger.log_types.Steps:
        """
        Reads several series at once, which takes no longer than one: what there is of the whole steps
        from `first` to before `last`.

        `series` are names, "desired_action", "applied_action", "observation" and "status", or a dict of
        names and fields: `{"observation": ("position",), "status": None}`.
        """

    def chunks(self, count: int = 10000, first: int | None = None, last: int | None = None, series: Mapping[str, Sequence[str] | None] | Sequence[str] | None = None) -> Iterator[trifinger.log_types.Steps]:
        """The same, `count` rows at a time, for a log larger than memory."""

    @property
    def companions(self) -> list[LoggedSession]: ...

    def companion(self, name: str) -> LoggedSession:
        """The companion `name` of this robot, as in "object"."""

    @property
    def observation_dtype(self) -> numpy.dtype[Observation]: ...

    @property
    def action_dtype(self) -> numpy.dtype[Action]: ...

    @property
    def applied_action_dtype(self) -> numpy.dtype[AppliedAction]: ...

    @property
    def status_dtype(self) -> numpy.dtype[StatusElement]: ...

    @property
    def units(self) -> dict[str, dict[str, str]]:
        """
        Of the fields of each series: `units["observation"]["position"]` is "rad".
        """

    def to_pandas(self, first: int | None = None, last: int | None = None, series: Mapping[str, Sequence[str] | None] | Sequence[str] | None = None) -> pandas.DataFrame:
        """
        The same as read() as a pandas.DataFrame: a row per step, a column per number, as in
        "observation.position[0]". Needs the extra "export".
        """

    def to_csv(self, path: str | os.PathLike[str], first: int | None = None, last: int | None = None, series: Mapping[str, Sequence[str] | None] | Sequence[str] | None = None) -> None:
        """
        Writes the same table to a file, in parts, so that it may be larger than memory.
        """

    def to_parquet(self, path: str | os.PathLike[str], first: int | None = None, last: int | None = None, series: Mapping[str, Sequence[str] | None] | Sequence[str] | None = None) -> None:
        """The same as a Parquet file."""

class Log:
    """
    A recording: a file, a list of its parts, or a folder, of which the newest recording is taken.

    Opening reads no messages if the files were finished and are whole. What is damaged is left out
    and named (`damage`, `lost_bytes`, and `gaps` of the sessions); everything else is read.

    Raises Error if it is no log, or one of a later version; InvalidArgument if a folder has no
    recording, or a list has parts of several; OSError.
    """

    def __init__(self, path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]) -> None: ...

    def __repr__(self) -> str: ...

    @property
    def files(self) -> list[pathlib.Path]:
        """In the order of the parts."""

    @property
    def size(self) -> int:
        """Of all files [bytes]."""

    @property
    def is_finished(self) -> bool:
        """Every file has the summary that is written at its end."""

    @property
    def origin(self) -> dict[str, str]:
        """
        Who wrote the log and where: "trifinger_version", "host", "kernel", "created".
        """

    @property
    def sessions(self) -> list[LoggedSession]:
        """Those of robots, in the order in which they began."""

    def session(self, name: str = ...) -> LoggedSession:
        """
        The newest session of the robot or companion `name` that has steps; of the only robot in the log,
        if none is named. Raises InvalidArgument with the names there are.
        """

    @property
    def events(self) -> list[trifinger.log_types.Event]:
        """What was told to people. Looks at the whole log once, like all below."""

    @property
    def damage(self) -> list[trifinger.log_types.Damage]:
        """What could not be read."""

    @property
    def lost_bytes(self) -> int:
        """Bytes of the files that could not be used."""

def replay(log: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | Log | LoggedSession, *, robot: str = '', first: int | None = None, last: int | None = None, strict: bool = True) -> Frontend:
    """
    Plays a session of a log as if it were the robot, inside the waits of the front-end.

    Observations, companions and applied actions are those of the log, whatever the user does. A
    step whose desired action is another one than in the log has ACTION_REJECTED in the flags of its
    status. Behind the last step the session ends with the fault "exhausted", which needs no
    recovery; finish() is content with it.

    Of a log with several robots, `robot` names one; its newest session is played, or the one given.
    The steps from `first` to before `last` are played, `first` as step 0; default: all.

    Raises NotInLog if a step is missing there, InvalidArgument.
    """
