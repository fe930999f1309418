# SPDX-License-Identifier: BSD-3-Clause
from collections.abc import Callable, Iterable, Mapping, Sequence
import enum
import os
import pathlib
import types
from typing import Annotated, Any, Literal, overload

import numpy
import numpy.typing
from numpy.typing import NDArray
import pandas

import trifinger.log.types
import trifinger.session_info


version: str

class Element(numpy.void):  # type: ignore[misc]  # final in NumPy's own stub, not in NumPy
    """
    One element of a series: a record of NumPy whose fields are attributes, too.

    `y.position` and `y["position"]` are the same, `y.stamp.capture_time` is a field of a field.
    """
    def __getattr__(self, name: str) -> Any: ...
    def __setattr__(self, name: str, value: object) -> None: ...

class Action(Element):  # type: ignore[misc]
    """The action that a user requests for a step."""
    torque: numpy.typing.NDArray[numpy.float64]
    position: numpy.typing.NDArray[numpy.float64]
    position_kp: numpy.typing.NDArray[numpy.float64]
    position_kd: numpy.typing.NDArray[numpy.float64]

class AppliedAction(Element):  # type: ignore[misc]
    """The action that a robot has applied in a step."""
    torque: numpy.typing.NDArray[numpy.float64]
    position: numpy.typing.NDArray[numpy.float64]
    position_kp: numpy.typing.NDArray[numpy.float64]
    position_kd: numpy.typing.NDArray[numpy.float64]
    reasons: numpy.typing.NDArray[numpy.uint32]
    thermal_margin: numpy.typing.NDArray[numpy.float64]

class Observation(Element):  # type: ignore[misc]
    """The measurements of a robot or a companion."""
    position: numpy.typing.NDArray[numpy.float64]
    velocity: numpy.typing.NDArray[numpy.float64]
    torque: numpy.typing.NDArray[numpy.float64]
    tip_force: numpy.typing.NDArray[numpy.float64]

class StatusElement(Element):  # type: ignore[misc]
    """The status that the back-end has written for a step."""
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
    The action for this step was missing; the previous one was applied again.
    """

    ACAUSAL = 2
    """The action was appended by someone who had already read y_t."""

    ACTION_REJECTED = 4
    """The action could not be applied; a safe one was applied instead."""

    END = 8
    """The last status of the session: no action was applied at this step."""

    SCHEDULER_LATE = 16
    """The tick began late: the back-end did not get the processor in time."""

    DRIVER_LATE = 32
    """The tick began late: calls of the driver used up the tick before."""

def list_sessions() -> list[trifinger.session_info.SessionInfo]:
    """
    All sessions in the session folder, robots and companions, sorted by name. Sessions whose
    back-end died are included; sessions that cannot be opened are left out.
    """

def running_robot(name: str = '') -> str:
    """
    Which robot a command is for: `name`, or the only robot that runs on this machine if `name`
    is empty. Looks once and never waits.

    Raises SessionNotFound with the names of running robots and how to start one,
    InvalidArgument with these names if several run and `name` is empty.
    """

def recover(name: str, timeout: float | None = 5.0) -> None:
    """
    Clears the fault of the robot `name`, so that the next session begins. This is for an
    operator who has looked at the robot.

    Raises SessionNotFound, TimedOut, RobotStopped if the back-end is gone.
    """

class LatenessHistogram:
    """
    Counts times in bins whose width grows with the time: eight bins for each power of two. A
    quantile is therefore known to an eighth of its value, however many times were counted.

    Times are in seconds.
    """

    def count(self) -> int:
        """Number of counted times."""

    def quantile(self, fraction: float) -> float:
        """
        The time below which the share `fraction` of all times lies; zero if no time was counted.
        """

    def counts(self) -> list[int]:
        """Number of times in each bin."""

    @staticmethod
    def edges() -> list[float]:
        """The shortest time of each bin [s]. The last bin has no upper end."""

    def max(self) -> float:
        """The longest time."""

    def __str__(self) -> str: ...

    def __repr__(self) -> str: ...

class LateStep:
    """
    A step that was late.

    Times are in seconds.
    """

    @property
    def time_index(self) -> int: ...

    @property
    def lateness(self) -> float:
        """
        How late the tick began. If the user caused it, the time without a new action.
        """

    @property
    def cause(self) -> str:
        """
        Who caused it.

        One of "user", "scheduler" and "driver".
        """

    def __repr__(self) -> str: ...

class TimingRecord:
    """
    How well a session in real time keeps its time: a summary of all its statuses, including the
    last one. It is plain data of a fixed size. The back-end keeps one for everybody to read,
    and a log gives the same.

    str() tells it in a sentence. A step is late because its action was missing ("user"), because the
    back-end was woken late or did not get the processor ("scheduler"), or because calls of the driver
    used up the tick before ("driver").
    """

    def lateness(self) -> LatenessHistogram:
        """The `lateness_of` all steps."""

    def steps(self) -> int:
        """Number of steps so far, including the one that ended the session."""

    def late_steps(self, cause: str | None = None) -> int:
        """Number of late steps: all of them, or those late because of `cause`."""

    def success_rate(self) -> float:
        """
        The share of the newest 1000 steps that were in time: 1 if all of them were.
        """

    def worst(self) -> list[LateStep]:
        """
        The worst late steps, the worst one first. In a row of steps with growing lateness only the
        last one is listed.
        """

    def __str__(self) -> str: ...

    def __repr__(self) -> str: ...

def duration_text(seconds: float) -> str:
    """
    The duration in words: "850 ns", "12 µs", "1.28 ms", "2 s". With a decimal point it has at
    most three digits.

    `seconds` is the duration [s].
    """

def lateness_of(statuses: numpy.typing.NDArray[StatusElement], period: float) -> numpy.typing.NDArray[numpy.float64]:
    """
    How late the step of `status` was: the time from the deadline to the beginning of the tick.
    If ticks were left out before it, the time counts from the deadline of the first of them.
    Zero without deadlines. Everything that is shown as "lateness" is this value; `TimingRecord`
    keeps its quantiles and its maximum.

    Returns one number [s] for each of `statuses`. `period` is the session's [s].
    """

class Payload:
    """
    Large data of an element, such as images, in the memory of the process that wrote them.

    `payload.copy()` is a copy that is certainly whole. Without a copy:

        with companion.payload(element) as images:  # a read-only structured array
            brightness = images["camera60"].mean()

    If the writer has overwritten the data before the end of the block, the block raises HistoryLost.
    """

    def array(self) -> numpy.typing.NDArray[numpy.void]:
        """
        The data in place, as a read-only structured array without dimensions: `array["camera60"]`.
        Check is_valid() after using it.
        """

    def copy(self) -> numpy.typing.NDArray[numpy.void]:
        """
        A copy like `array()`. Raises HistoryLost if the data were overwritten meanwhile.
        """

    def is_valid(self) -> bool:
        """
        False if the writer has begun to overwrite the data. What was read before a call that returns
        True was whole.
        """

    def __enter__(self) -> numpy.typing.NDArray[numpy.void]: ...

    def __exit__(self, type: type[BaseException] | None, value: BaseException | None, traceback: types.TracebackType | None) -> None: ...

class LiveCameras:
    """The images of a process of cameras, without the robot."""

    def __init__(self, robot: str, calibration: str) -> None: ...

    def next(self, timeout: float | None = None) -> tuple[Element, Payload | None] | None:
        """
        Returns the newest element and its payload if they are others than at the last call. Waits for
        them up to `timeout` [s].
        """

def to_rgb(image: numpy.typing.ArrayLike, pixels: str) -> numpy.typing.NDArray[numpy.uint8]:
    """
    Returns an image in the format `pixels` ("bayer_rggb8", "rgb8", "mono8") as RGB of the same size,
    uint8[height, width, 3]. The colours that a pixel of a Bayer mosaic lacks are the mean of its
    nearest neighbours.
    """

class Frontend:
    """
    The user's view of a running robot: append desired actions, read back what happened.

    Reading step t waits until the back-end has filled it in. A loop that reads y[t] and appends
    a[t+1] is therefore paced by the robot and needs no sleep of its own.

    A front-end is not for real-time code: reads block and failures raise. Any number of threads
    may read; one thread appends. Every wait ends with the value, with TimedOut, or with
    RobotStopped if the session has ended and the value will never come. A handle that went
    through fork() raises InheritedHandle.

    `y.position` and `y["position"]` read a field of an Element. Ranges of steps `ys` are structured
    arrays of NumPy; `ys["position"]` is the field of all steps.

    `timeout` is in seconds; None waits as long as it takes. Waits end with Ctrl-C, too.

    A `with` block calls finish() at its end. If the block raises an exception, it calls close()
    instead.
    """

    def append_desired_action(self, action: Action, timeout: float | None = None) -> int:
        """
        Appends `action` and returns the step for which it is scheduled. This is the next step or,
        if the user's loop is late, the first step that is still open. The first call starts step 0.
        The call waits only if the queue is full.

        Raises RobotStopped, TimedOut, AcausalAction if strict.

        Raises InvalidArgument for anything but an action of this robot: see new_action.
        """

    def append_desired_actions(self, actions: numpy.typing.NDArray[Action], timeout: float | None = None) -> int:
        """
        Appends several actions, one per step, and returns the step of the last one.

        `actions` are a one-dimensional array of `action_dtype`.
        """

    def set_on_late(self, on_late: Literal['nothing', 'repeat', 'hold']) -> None:
        """
        Says what happens from now on if no action is there when nine tenths of the period before its step
        are over, in real-time mode: "nothing", so that the back-end repeats the last action or ends the
        session; "repeat", so that the last action acts on; "hold", so that it acts on for 10 ms, at least a
        step, and then the robot is held where it is. A thread does this, which needs nothing of Python: so
        the program can think as long as it likes. What it appends next is delayed once more, by the time
        that it was late, and at most by 10 ms. Nothing happens before the first action and after finish().
        Raises InvalidArgument for a handle that only observes, and for "hold" if the robot has no joint
        positions; ControlHeld if another thread is appending.
        """

    def is_late(self) -> bool:
        """
        True if the newest action is not the program's, because that did not come in time.
        """

    def new_action(self, **fields: numpy.typing.ArrayLike) -> Action:
        """
        Returns the robot's default action with `fields` filled in; a number fills the whole
        field. The action can be changed and appended as often as you like.
        """

    def latest_observation(self, timeout: float | None = None) -> Observation:
        """
        Returns the newest observation, also before step 0: a user can look without acting.
        """

    def get_latest_at(self, t: int, timeout: float | None = None) -> Observation | None:
        """
        Returns the newest element that arrived at or before the robot's step `t`; waits for that
        step. Returns None if no element had arrived by then.

        Only companions have this.
        """

    def payload(self, element: Observation) -> Payload:
        """
        The payload of `element`, which was read from this companion, in place.

        Raises HistoryLost if it was overwritten, or if its writer was started again;
        InvalidArgument if the element has no payload.

        Only companions have this.
        """

    def wait_until_time_index(self, t: int, timeout: float | None = None) -> None:
        """Waits until y[t] exists."""

    def current_time_index(self) -> int:
        """Newest step whose observation exists; -1 before step 0."""

    def range(self, series: str) -> tuple[int, int]:
        """
        The first index of `series` that can still be read, and the first index not yet written.

        Example: `robot.get_observations(*robot.range("observation"))`. Series are "desired_action",
        "applied_action", "observation" and "status".
        """

    def finish(self, timeout: float | None = None) -> None:
        """
        Says that no further action will come. The session ends without a fault, after the last
        appended action. Returns when it has ended.

        Raises RobotStopped if the session ended for another reason, so that some actions may not
        have been applied; TimedOut.
        """

    def recover(self, timeout: float | None = None) -> None:
        """
        Clears the fault that ended the session and waits until the back-end has begun the next one.
        This handle remains stopped: connect again. Only the controller can call this;
        `trifinger.recover(name)` is for everybody.

        Raises InvalidArgument for a handle that only observes, RobotStopped if the back-end is
        gone.
        """

    def fault(self) -> trifinger.session_info.Fault | None:
        """Why the session ended; None while it runs."""

    def timing(self) -> TimingRecord | None:
        """
        How well the session keeps its time, up to now or up to its end. None outside real-time mode
        and before the first whole step.
        """

    def companion(self, name: str) -> Frontend:
        """Reads the companion `name` of this robot, for example "object"."""

    def session_info(self) -> trifinger.session_info.SessionInfo:
        """
        Facts about a session for everybody: name, type, period, who takes part. Reading them does
        not need a front-end.
        """

    def documents(self) -> dict[str, str]:
        """
        The documents that explain the robot, by name: "configuration.yml", "model.xml". Companions
        have none.

        Raises IncompatibleSession if the file is damaged.
        """

    def close(self) -> None:
        """
        Gives the session and its control back. If actions were appended and the session still
        runs, it ends ("detached").
        """

    def __repr__(self) -> str: ...

    def get_observation(self, t: int, timeout: float | None = None) -> Observation:
        """
        Returns y[t]; waits for it if `t` lies in the future.

        Raises HistoryLost if y[t] was already overwritten, RobotStopped if it will never come,
        TimedOut.
        """

    def get_observations(self, first: int, last: int, timeout: float | None = None) -> numpy.typing.NDArray[Observation]:
        """
        Returns the steps from `first` to before `last`; waits for the last one.
        """

    def get_desired_action(self, t: int, timeout: float | None = None) -> Action:
        """
        Returns a[t] as the back-end took it. This and the functions below raise like
        `get_observation`.
        """

    def get_desired_actions(self, first: int, last: int, timeout: float | None = None) -> numpy.typing.NDArray[Action]:
        """
        Returns the steps from `first` to before `last`; waits for the last one.
        """

    def get_applied_action(self, t: int, timeout: float | None = None) -> AppliedAction:
        """Returns a'[t], the applied action."""

    def get_applied_actions(self, first: int, last: int, timeout: float | None = None) -> numpy.typing.NDArray[AppliedAction]:
        """
        Returns the steps from `first` to before `last`; waits for the last one.
        """

    def get_status(self, t: int, timeout: float | None = None) -> StatusElement:
        """Returns the status that the back-end has written for step t."""

    def get_statuses(self, first: int, last: int, timeout: float | None = None) -> numpy.typing.NDArray[StatusElement]:
        """
        Returns the steps from `first` to before `last`; waits for the last one.
        """

    @property
    def action_dtype(self) -> numpy.dtype[Action]:
        """The layout of an action."""

    @property
    def applied_action_dtype(self) -> numpy.dtype[AppliedAction]:
        """The layout of an applied action."""

    @property
    def observation_dtype(self) -> numpy.dtype[Observation]:
        """The layout of an observation."""

    @property
    def status_dtype(self) -> numpy.dtype[StatusElement]:
        """The layout of a status, the same for every robot."""

    def __enter__(self) -> Frontend: ...

    def __exit__(self, type: type[BaseException] | None, value: BaseException | None, traceback: types.TracebackType | None) -> None: ...

def connect(name: str, *, strict: bool = False, timeout: float | None = 5.0) -> Frontend:
    """
    Takes control of the robot `name`, which runs in a back-end of its own (`trifinger run`).

    Raises SessionNotFound with the names of running robots and how to start one, ControlHeld
    that names the controlling process, IncompatibleSession if it is another robot, RobotStopped
    if a fault must first be cleared with `recover`.

    With `strict`, an action that comes after its step was read is an error (AcausalAction) instead of
    a mark in the status. `timeout` is how long to wait for a session that is about to begin [s].
    """

def observe(name: str) -> Frontend:
    """
    Observes the robot `name` without controlling it.

    `name` may also be that of a companion, for example "sim.object".
    """

class Backend:
    """
    A back-end in a thread of this process, offered to all processes under a name.

    It runs session after session until stop(), or until the end of its `with` block.
    """

    def __repr__(self) -> str: ...

    @property
    def name(self) -> str:
        """Name for connect() and observe()."""

    def wait(self, timeout: float | None = None) -> None:
        """Waits until the back-end has ended, or until Ctrl-C is pressed."""

    def stop(self) -> None:
        """Ends the session, brings the robot to rest and gives the name back."""

    def __enter__(self) -> Backend: ...

    def __exit__(self, type: type[BaseException] | None, value: BaseException | None, traceback: types.TracebackType | None) -> None: ...

def fake(*, strict: bool = False, history: int = 16384, sensor_period: int = 0, sensor_delay: int = 0, observation_fault_after: int = -1, action_fault_after: int = -1) -> Frontend:
    """
    Starts the fake robot inside this program: no physics and no joints, for tests of your own
    code.

    It runs inside the waits of the returned front-end: without threads, deterministic and fast. An
    action has the field `setpoint`. An observation has the fields `setpoint` (the last one applied) and
    `applied_actions` (how many there were). `history` is the number of steps kept. With a
    `sensor_period` [steps] the robot has the companion "sensor". `observation_fault_after` and
    `action_fault_after` inject a fault after that many calls.
    """

def run_fake(name: str, *, real_time: bool = False, period: float = 0.001, max_action_repeats: int = 0, max_skipped_ticks: int = 5, first_action_timeout: float | None = None, history: int = 16384, sensor_period: int = 0, sensor_delay: int = 0, observation_fault_after: int = -1, action_fault_after: int = -1) -> Backend:
    """
    Runs the fake robot (see fake()) in a thread of this process, for every process of this
    machine.

    In real-time mode a step takes `period` [s], and a missing action is replaced up to
    `max_action_repeats` times in a row. Otherwise the robot waits for every action.

    Raises RobotOwned if another back-end has this name.
    """

class Recorder:
    """
    Records a robot of this process in a thread of its own. Outside real-time mode nothing is
    lost, because the robot waits for the recorder.

    The end of the program stops it.
    """

    def stop(self) -> None:
        """
        Writes the available steps and finishes the file. Nothing is recorded after that, and no
        back-end waits.

        Raises OSError if the end could not be written.
        """

    @property
    def file(self) -> pathlib.Path | None:
        """The newest file; None before the first session."""

    def __enter__(self) -> Recorder: ...

    def __exit__(self, type: type[BaseException] | None, value: BaseException | None, traceback: types.TracebackType | None) -> None: ...

class Reason(enum.IntFlag):
    """
    Why a joint did not get the action that was asked for. These are bits of `reasons` in an
    applied action.
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
    """the motor is too warm: it has given more torque than was commanded"""

    POSITION_JUMPED = 131072
    """the measured position changed faster than a joint can move"""

    VELOCITY_MISMATCH = 262144
    """the measured velocity is not that of the measured position"""

    STUCK = 524288
    """the measurements do not change at all, whatever the torque"""

class Variation:
    """
    How a simulation differs from its configuration in an episode. `Simulation.vary` explains the numbers.
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

    @property
    def homing_error(self) -> float: ...

    @property
    def motor_spread(self) -> float: ...

    @property
    def torque_ripple(self) -> float: ...

    @property
    def seed(self) -> int: ...

    @property
    def backlash(self) -> float: ...

    @property
    def measurement_delay(self) -> int: ...

    @property
    def velocity_noise(self) -> float: ...

    @property
    def motor_heat(self) -> float: ...

    @property
    def tip_radius(self) -> float: ...

    @staticmethod
    def of(condition: str, seed: int) -> Variation:
        """
        A robot that is "as documented", "as built" or "worn", for `Simulation.vary`; equal seeds give equal robots.
        docs/simulation.md says how far its joints, motors, encoders and tips are from what is documented.
        Raises InvalidArgument for another condition.
        """

class Simulation:
    """
    A simulated robot in this process. Its back-end runs inside the waits of its front-end: no threads,
    deterministic, as fast as the physics. simulate() is the short form.

    Every session begins in the state that the last reset(), place_object(), set_object_velocity() or
    restore() has left. During a session they take effect at once.
    """

    def __init__(self, config: str = 'sim', overrides: dict[str, object] = {}) -> None:
        """
        `config` is the name of a configuration that comes with the package, or a file; `overrides` changes single
        values: {"fingers.height": 0.3, "simulation.seed": 7}.
        """

    def __repr__(self) -> str: ...

    def connect(self, *, strict: bool = True) -> Frontend:
        """
        Controls the robot, of type R, in a new session.

        Raises ControlHeld while another front-end controls it, Error if its type is another.
        """

    def reset(self, position: Sequence[float] | None = None, seed: int | None = None, episode: int = 0, joints: Sequence[float] | None = None) -> None:
        """
        Resets the simulation: joints at `position` [rad] (default: the configuration's), objects as they
        are at the start of the configuration, random numbers of `episode` of `seed` (default: the
        configuration's). `joints` are positions of the first hinges and slides of a robot from a file, driven or
        not; NaN: as always.
        """

    @overload
    def vary(self, variation: Variation) -> None:
        """
        Makes the simulation differ from its configuration as `variation` says.
        """

    @overload
    def vary(self, *, object_mass: float = 1.0, friction: float = 1.0, pair_friction: dict[str, float] = {}, contact_time: float = 1.0, motor_gain: float = 1.0, torque_delay: int = 0, rotor_inertia: float = 1.0, joint_damping: float = 1.0, joint_friction: float = 0.0, stop_margin: float = 1.0, homing_error: float = 0.0, motor_spread: float = 0.0, torque_ripple: float = 0.0, seed: int = 0, backlash: float = 0.0, measurement_delay: int = 0, velocity_noise: float = 0.0, motor_heat: float = 0.0, tip_radius: float = 1.0) -> None:
        """
        Makes the simulation differ from its configuration from now on. A reset does not change this.
        docs/simulation.md explains every number, and names the pairs of surfaces for which `pair_friction` has
        additional factors, as in {"tip_object": 0.8}.
        """

    def place_object(self, name: str, position: Sequence[float], orientation: Sequence[float] = [1.0, 0.0, 0.0, 0.0]) -> None:
        """
        Places an object at rest at `pose`. The orientation is normalized.

        Raises InvalidArgument that names the existing objects, or if the pose is not valid.

        The pose is `position` x, y, z [m] and `orientation`, a quaternion w, x, y, z.
        """

    def set_object_velocity(self, name: str, linear: Sequence[float], angular: Sequence[float] = [0.0, 0.0, 0.0]) -> None:
        """
        Sets an object in motion from where it is, in the world frame: velocity of its centre [m/s]
        and angular velocity [rad/s].

        Raises InvalidArgument that names the existing objects, or if a number is not finite.
        """

    def push_object(self, name: str, force: Sequence[float]) -> None:
        """
        Applies a force to an object's centre of mass [N], in the world frame, like a hand that
        pushes. It acts from the next step on until the next call, `reset` or session.

        Raises InvalidArgument that names the existing objects, or if the force is not finite.
        """

    def pull(self, body: int | str, target: numpy.typing.ArrayLike, *, point: numpy.typing.ArrayLike = (0.0, 0.0, 0.0), stiffness: float = 300.0) -> None:
        """
        Pulls at a tip or an object, one of `pullable_bodies`, in place of what was pulled before.
        It acts from the next step on until `let_go`, `reset`, `restore` or the next session. It is
        no part of a saved state. A hand in another process counts more while it pulls.

        Raises InvalidArgument that names the existing bodies, or if the pull is not valid.

        `body` is a name or a number in `bodies`, `target` is in the world frame [m], `point` is where
        the spring is fixed, from the centre of the tip or object, in the axes of its body [m], and
        `stiffness` is above 0 and at most 5000 [N/m].
        """

    def let_go(self) -> None:
        """Lets go of what `pull` pulls."""

    @property
    def bodies(self) -> list[str]:
        """
        Names of what can be pulled: "tip_0" and so on, one for each finger, then the names of the
        objects. A robot from a file has no tips: its `end_frames` come after the objects.
        """

    def object_velocity(self, name: str) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')]]:
        """
        The object's velocity now, without delay and noise: velocity of its centre [m/s] and angular
        velocity [rad/s].

        Raises InvalidArgument that names the existing objects.
        """

    def object_pose(self, name: str) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], Annotated[NDArray[numpy.float64], dict(shape=(4), order='C')]]:
        """
        The object's pose now, without delay and noise: position [m] and quaternion w, x, y, z.

        Raises InvalidArgument that names the existing objects.
        """

    def observed_object_pose(self, name: str) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(3), order='C')], Annotated[NDArray[numpy.float64], dict(shape=(4), order='C')]]:
        """
        The object's pose at the newest observation, without delay and noise. The action of that
        step may have moved it since.

        Raises InvalidArgument that names the existing objects.
        """

    def save(self) -> bytes:
        """Saves the state: physics, safety chain, delays, random numbers."""

    def restore(self, state: bytes) -> None:
        """
        Continues from `state` exactly as the saved simulation continued, bit for bit.

        Raises InvalidArgument if it was saved from another model or by another version.
        """

    def state_before_divergence(self) -> bytes:
        """
        The last state before the simulation diverged, for a report or another try. Empty if it has
        not diverged. `trifinger run` saves it in `log_folder()`.
        """

    def configuration(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]:
        """
        Positions and velocities of joints and objects in MuJoCo's layout, to draw the scene:
        `qpos`, then `qvel`.
        """

    def add_check(self, function: Callable[[Observation, Action], None]) -> None:
        """
        Adds a safety check of your own; call it between sessions. `function(observation, action)` changes
        the action in place. The robot's own limits are checked after it. An exception ends the session with
        a fault that has the exception's text. Ctrl-C is no fault: KeyboardInterrupt reaches the program
        that waits for the robot.
        """

    def record(self, folder: str | os.PathLike[str], *, precision: str = 'double', images: str = 'jpeg') -> Recorder:
        """
        Records every session from the next one on, without loss, into a file in `folder`. The precision
        "single" takes half of the space. `images` says what is kept of images: "jpeg", "raw" or "none".
        """

    def mjcf(self) -> str:
        """The scene in MuJoCo's format."""

def simulate(config: str = 'sim', overrides: dict[str, object] = {}, *, strict: bool = True, record: str | os.PathLike[str] | None = None, checks: Iterable[Callable[[Observation, Action], None]] = ()) -> Frontend:
    """
    Starts a simulated robot in this process and controls it strictly: an action that would be
    late on a real robot raises. For a robot that runs elsewhere, use `connect`.

    `record` is the folder for a log. `checks` are safety checks of your own, see
    Simulation.add_check().
    """

def export_mjcf(config: str = 'sim', overrides: dict[str, object] = {}) -> str:
    """
    The whole scene in MuJoCo's own format, with objects, cameras and lights. It needs no other
    file.

    MuJoCo writes six digits, so a model that is read back agrees with the built one to about
    1e-6 m.

    Raises InvalidArgument if the description cannot be built.
    """

def export_urdf(config: str = 'sim', overrides: dict[str, object] = {}) -> str:
    """
    The robot as URDF, for planners and other simulations: links with the source's inertias,
    joints with limits, tips and cameras as frames (cameras as `NAME_optical_frame`: x right, y
    down, z forward). It has no boundary and needs no other file. Gravity points along the root
    link's -z, flipped or not.

    Raises InvalidArgument if the description cannot be built.
    """

def checked_model_text(text: str) -> str:
    """
    Judges the text of a model, MJCF or URDF, that somebody else has written, such as the
    document "model.xml" of a log, and returns it in a form that MuJoCo may read: it names no
    file, and what it asks for stays below limits. MuJoCo itself would open any path and obey
    any number.

    Raises InvalidArgument that names the line, what it asks for and the largest value allowed.
    """

class DirectSimulation:
    """
    A simulated robot that its owner moves step by step. There are no sessions, no limits of
    positions and speeds, and no faults: it is for programs that bring their own rules, such as
    those written for other simulators. `Simulation` is for all others.

    Nothing is random. One object must not be used by several threads at once.
    """

    def __init__(self, config: str = 'sim', overrides: dict[str, object] = {}) -> None:
        """
        `config` is the name of a configuration that comes with the package, or a file. `overrides` changes
        single values.
        """

    def __repr__(self) -> str: ...

    def desire(self, torque: numpy.typing.ArrayLike, position: numpy.typing.ArrayLike, position_kp: numpy.typing.ArrayLike, position_kd: numpy.typing.ArrayLike, kp: numpy.typing.ArrayLike, kd: numpy.typing.ArrayLike, damping: numpy.typing.ArrayLike, max_torque: float) -> None:
        """
        The action for the next step: its torques and those of its positions, clipped to `max_torque`
        [Nm], damped and clipped again.

        A position that is NaN asks for nothing, and a gain that is NaN stands for `kp` [Nm/rad] or `kd`
        [Nms/rad]. `damping` [Nms/rad] acts always.
        """

    def step(self) -> bool:
        """
        Moves on by one step. False if the simulation has diverged: a number is not finite any more.
        """

    def act(self, torque: numpy.typing.ArrayLike, position: numpy.typing.ArrayLike, position_kp: numpy.typing.ArrayLike, position_kd: numpy.typing.ArrayLike, kp: numpy.typing.ArrayLike, kd: numpy.typing.ArrayLike, damping: numpy.typing.ArrayLike, max_torque: float) -> bool:
        """desire() and step() in one call."""

    def observation(self) -> tuple[numpy.typing.NDArray[numpy.float64], ...]:
        """
        The measurements now, in new arrays: position [rad], velocity [rad/s], torque [Nm] and tip_force [N].
        The last two are those of the last step.
        """

    def observation_before(self) -> tuple[numpy.typing.NDArray[numpy.float64], ...]:
        """
        Like observation(), just before the newest step; the torque is that of the step.
        """

    def desired(self) -> tuple[numpy.typing.NDArray[numpy.float64], ...]:
        """
        What was asked for last: torque [Nm], position [rad], position_kp [Nm/rad] and position_kd [Nms/rad].
        """

    def applied(self) -> tuple[numpy.typing.NDArray[numpy.float64], ...]:
        """
        What follows from it: torque [Nm], position [rad], position_kp [Nm/rad] and position_kd [Nms/rad].
        """

    def keep_steps(self, keep: bool = True) -> None:
        """Whether the next steps are kept for kept_steps()."""

    def kept_steps(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        A row for each step: torque and position that were asked for, then position, velocity, torque and
        tip_force of the observation before the step.
        """

    def set_joints(self, position: numpy.typing.ArrayLike, velocity: numpy.typing.ArrayLike) -> None:
        """
        Sets positions [rad] and velocities [rad/s] of all joints, also beyond limits.

        Raises InvalidArgument if a number is not finite.
        """

    def place_object(self, name: str, position: numpy.typing.ArrayLike, orientation: numpy.typing.ArrayLike) -> None:
        """
        Places an object at rest.

        Raises InvalidArgument that names the existing objects, or if the pose is not valid.

        The pose is `position` x, y, z [m] and `orientation`, a quaternion w, x, y, z.
        """

    def continue_from(self, other: DirectSimulation) -> None:
        """
        Continues where `other` is: with its joints, and with the objects that both have by their
        names. The other objects stay.
        """

    def set_object_velocity(self, name: str, linear: numpy.typing.ArrayLike, angular: numpy.typing.ArrayLike) -> None:
        """
        Sets an object in motion from where it is: velocity of its centre [m/s] and angular velocity [rad/s]
        in the world frame.
        """

    def push_object(self, name: str, force: numpy.typing.ArrayLike, moment: numpy.typing.ArrayLike) -> None:
        """
        Lets a force [N] and a moment [Nm] act on an object's centre in the next step, in the world
        frame. Several add up.

        Raises InvalidArgument that names the existing objects, or if a number is not finite.
        """

    def set_object_mass(self, name: str, mass: float) -> None:
        """
        Sets the mass of an object, which must be above 0 [kg]. Its inertia grows with it.

        Raises InvalidArgument that names the existing objects, or if the mass is not valid.
        """

    def use_physics(self, *, stop_lower: numpy.typing.ArrayLike, stop_upper: numpy.typing.ArrayLike, margin: float, link_friction: float, boundary_friction: float, object_margins: Mapping[str, float]) -> None:
        """
        Takes figures of another simulator: where joints are stopped [rad], the distance at which fingers and
        objects touch already, from 0 to 0.01 [m], and the sliding friction of links and of the boundary
        against anything.
        """

    def object_pose(self, name: str) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """Position [m] and quaternion w, x, y, z of an object now."""

    def object_velocity(self, name: str) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        Velocity of an object's centre [m/s] and angular velocity [rad/s], in the world frame.
        """

    def configuration(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Positions and velocities of joints and objects in MuJoCo's layout: `qpos`, and `qvel`.
        """

class FreeRun:
    """
    Moves a simulated robot by the torques of a log, without safety checks, objects and contacts:
    what it would have measured if it were like this. Threads may share one.
    """

    def __init__(self, config: str, overrides: dict[str, object] = {}) -> None:
        """
        `config` is the name of a configuration that comes with the package, or a file.
        """

    @staticmethod
    def of_text(configuration: str) -> FreeRun:
        """
        The robot in the text of a configuration, which may name a file of a robot.
        """

    @property
    def joints(self) -> list[str]:
        """Names of the driven joints."""

    @property
    def delays(self) -> tuple[int, int]:
        """How late torques and measurements are by the configuration [steps]."""

    @property
    def trees(self) -> list[int]:
        """Joints with the same number move each other."""

    @property
    def described(self) -> dict[str, list[float]]:
        """
        What the configuration says of each joint, by the names of `identified` in it.
        """

    def run(self, figures: Mapping[str, Sequence[float]], position: numpy.typing.ArrayLike, velocity: numpy.typing.ArrayLike, begin: Sequence[int], torque: numpy.typing.ArrayLike, lead: int, length: int) -> numpy.typing.NDArray[numpy.float64]:
        """
        Positions that are measured after each step: pieces x `length` x joints. Piece i
        begins with step `begin[i]` of `torque` (steps x joints), where joints are at
        `position[i, 1]` and have `velocity[i, 1]`. `lead` steps before it they are at
        `position[i, 0]` and `velocity[i, 0]`; from there the motors come to where they are
        in their play. Delays do not count. Raises InvalidArgument.
        """

class Hand:
    """
    The hand of a simulated robot that `trifinger run` runs in another process.

    The robot has one hand. A pull acts while the robot holds its pose and while a session runs,
    not during its orderly stop. It begins with the next step, the first one up to 0.1 s after
    the writer was made. It ends with `let_go`, with this object, or with its process: 0.1 s
    after a kill, and 0.3 s after the process was stopped.

    The process of the robot may be started again at any time. The bodies are those of the robot
    that ran when this object was made.
    """

    def __init__(self, robot: str = 'sim') -> None: ...

    def __repr__(self) -> str: ...

    @property
    def bodies(self) -> list[str]:
        """What can be pulled, see `pullable_bodies`."""

    def pull(self, body: int | str, target: numpy.typing.ArrayLike, *, point: numpy.typing.ArrayLike = (0.0, 0.0, 0.0), stiffness: float = 300.0, seconds: float | None = None) -> None:
        """
        Pulls at a body, a name or a number in `bodies`, in place of what was pulled before: a damped
        spring from `point` to `target`. `target` is in the world frame [m]. `point` is where the spring is
        fixed, from the centre of the tip or object, in the axes of its body [m]. `stiffness` is above 0
        and at most 5000 [N/m]. The hand lets go by itself after `seconds`, unless it pulls again. Does not
        block. Raises InvalidArgument.
        """

    def let_go(self) -> None:
        """
        Lets go. Without effect if nothing is pulled, or in a child process after fork.
        """

    def close(self) -> None:
        """
        Lets go and ends. Another hand can then pull. Closing twice does nothing.
        """

    def __enter__(self) -> Hand: ...

    def __exit__(self, type: type[BaseException] | None, value: BaseException | None, traceback: types.TracebackType | None) -> None: ...

def hand(robot: str = 'sim') -> Hand:
    """
    The hand of a simulated robot that `trifinger run` runs, to pull at its tips and objects:

        with trifinger.hand("sim") as hand:
            hand.pull("tip_0", target=(0.0, 0.1, 0.1))
            time.sleep(1.0)
            hand.let_go()

    A robot has one hand. Raises Error with the number of the process that is the hand already.
    """

class CameraRenderer:
    """
    Draws what cameras see of a simulated scene: lens with distortion, Bayer mosaic, blur of
    what moves, noise.

    A point of the scene appears where `camera.Camera.project` says, to a tenth of a pixel.
    Equal arguments give equal images on one machine, bit for bit.

    Any thread may use a renderer, one thread at a time.
    """

    def __init__(self, config: str = 'sim', overrides: dict[str, object] = {}, *, calibration: str | None = None, reduction: int = 1, pixels: str = 'bayer_rggb8', **options: object) -> None:
        """
        The robot of the configuration, with its own cameras or those of the text of a `calibration`. A
        `reduction` of 2 halves width and height. `pixels` are "bayer_rggb8", "rgb8" or "mono8". `options` are
        those of `options`.
        """

    def render(self, configuration: NDArray[numpy.float64], number: int = 0) -> list[NDArray[numpy.uint8]]:
        """
        Draws one image per camera, height x width or height x width x 3. `configuration` is that of
        `Simulation.configuration`: positions, and velocities if what moves shall be blurred. `number` is that of
        the images: each has its own noise.
        """

    @property
    def names(self) -> list[str]:
        """Names of the cameras."""

    @property
    def calibration(self) -> str:
        """The cameras as they are said to be, as text in YAML."""

    @property
    def true_calibration(self) -> str:
        """
        The cameras as they are: others if the options have an error of the calibration.
        """

    @property
    def options(self) -> dict[str, object]:
        """
        What the images look like. docs/simulated_cameras.md explains each value.
        """

    def set_options(self, **options: object) -> None:
        """Changes what the next images look like."""

    def vary(self, seed: int = 0, episode: int = 0) -> None:
        """
        Draws light, colours, dust, noise and the error of the calibration at random.
        """

class Kinematics:
    """
    Kinematics and dynamics of the fingers, without contacts and objects. Everything is in the
    world frame: z up, origin on the table, whether or not the platform is flipped. Positions of
    joints are in rad.

    One object must not be used by several threads at once: make one for each.
    """

    def __init__(self, config: str = 'sim', overrides: dict[str, object] = {}) -> None:
        """
        `config` is the name of a configuration that comes with the package, or a file. `overrides` changes
        single values.
        """

    @property
    def num_fingers(self) -> int:
        """Number of fingers: 1 or 3."""

    @property
    def num_joints(self) -> int:
        """Number of joints: three for each finger."""

    def tip_positions(self, position: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Centres of all tip spheres: x, y, z for each finger [m].

        The result has a row for each finger.
        """

    def tip_jacobian(self, finger: int, position: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Derivative of one tip's position by all joints [m/rad]: 3 rows, `num_joints` columns.
        """

    def tip_jacobians(self, position: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        The Jacobians of all tips, one below the other [m/rad]: square, `num_joints` rows and
        columns.
        """

    def tip_accelerations(self, position: numpy.typing.ArrayLike, velocity: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Accelerations of the tips when joints move with constant `velocity` [rad/s]: x, y, z for
        each finger [m/s^2].

        The result has a row for each finger.
        """

    def gravity_torques(self, position: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """Torques that hold the pose against gravity [Nm]."""

    def bias_torques(self, position: numpy.typing.ArrayLike, velocity: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Torques that keep joints at their `velocity` [rad/s] without acceleration, against gravity,
        Coriolis and centrifugal forces [Nm]. Friction is not included.
        """

    def mass_matrix(self, position: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """Inertia at the joints, including that of the rotors [kg m^2]."""

    def inverse_kinematics(self, finger: int, tip: numpy.typing.ArrayLike, near: numpy.typing.ArrayLike | None = None) -> tuple[numpy.typing.NDArray[numpy.float64], str]:
        """
        Joint positions of `finger` that bring its tip to `tip` [m], and whether it can reach it. If
        it cannot, they are a pose within the hard limits whose tip is near the point. Among up to
        four poses it takes the one within the hard limits that is nearest to `near`.

        Returns the joint positions and 'yes', 'too_far', 'too_close' or 'outside_limits'. `near` is the
        initial pose by default.
        """

class JointSolution:
    """
    A result of the inverse kinematics. It is always finite and within the ranges.
    """

    @property
    def position(self) -> numpy.typing.NDArray[numpy.float64]:
        """One for each driven joint [rad], [m]."""

    @property
    def distance(self) -> float:
        """From the frame to its goal [m]."""

    @property
    def angle(self) -> float:
        """Between their orientations [rad]; 0 if none was asked for."""

    @property
    def is_reached(self) -> bool:
        """Both are at most 1e-6."""

    def __repr__(self) -> str: ...

class ModelKinematics:
    """
    Kinematics and dynamics of any robot, from its model: where named frames are, how joints move them, and
    what torques carry it. Contacts are left out.

    Everything is in the world frame: z up. Joints are the driven ones, in the order of actions [rad], [Nm];
    a joint that slides has m and N. Joints that follow one by an equality go with it. All others, and bodies
    that float, stay where sessions begin.
    """

    def __init__(self, config: str = 'sim', frames: Sequence[str] = (), overrides: dict[str, object] = {}) -> None:
        """
        `config` is the name of a configuration that comes with the package, or a file. `frames` are names of
        sites, bodies or geoms; none: the tips of a TriFinger, or the ends of a robot from a file. `overrides`
        changes single values of the configuration.
        """

    @property
    def joint_names(self) -> list[str]:
        """Names of the driven joints."""

    @property
    def frames(self) -> list[str]:
        """Names of the frames."""

    @property
    def ranges(self) -> numpy.typing.NDArray[numpy.float64]:
        """The soft limits of the joints, N x 2 [rad], [m]."""

    @property
    def initial_position(self) -> numpy.typing.NDArray[numpy.float64]:
        """Where the joints are when a session begins [rad], [m]."""

    def pose(self, frame: str, position: numpy.typing.ArrayLike) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        Place of a frame [m], and its orientation: a quaternion w x y z with w >= 0.
        """

    def jacobian(self, frame: str, position: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Linear velocity of a frame, above its angular velocity, for a velocity of 1 of each joint: 6
        rows, `num_joints` columns.
        """

    def gravity_torques(self, position: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """Torques that hold the pose against gravity and springs."""

    def bias_torques(self, position: numpy.typing.ArrayLike, velocity: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Torques that keep joints at their `velocity` [rad/s], [m/s] without acceleration, against
        gravity, springs, Coriolis and centrifugal forces. Damping and friction are not included.
        """

    def mass_matrix(self, position: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """Inertia at the joints, including that of the rotors [kg m^2], [kg]."""

    def null_space_torques(self, frame: str, position: numpy.typing.ArrayLike, torques: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        The part of `torques` that does not accelerate a frame, only the joints around it: (1 - J'
        (J M^-1 J')^-1 J M^-1) torques. With it an arm of seven joints keeps its elbow where it
        should be. O. Khatib: A unified approach for motion and force control of robot manipulators.
        IEEE Journal on Robotics and Automation, 1987.
        """

    def inverse_kinematics(self, frame: str, point: numpy.typing.ArrayLike, orientation: numpy.typing.ArrayLike | None = None, near: numpy.typing.ArrayLike | None = None) -> JointSolution:
        """
        Finds positions within the soft limits that bring a frame to `point` [m], with this orientation (a
        quaternion w x y z) if one is given: damped least squares from `near` (default: where sessions begin),
        then from poses drawn from a fixed series. Joints that do not move the frame stay as in `near`. If
        nothing reaches it, the nearest pose that was found. It takes some milliseconds.
        """

def configuration_text(config: str = 'sim', overrides: dict[str, object] = {}) -> str:
    """
    The whole configuration of that name, or in that file, as a session's document
    "configuration.yml" has it.
    """

def read_joint_facts(configuration: str, robot: str = '', joints: Sequence[str] = (), opens_file: bool = False) -> tuple[str, tuple[str, ...], dict[str, numpy.typing.NDArray[numpy.float64]]]:
    """
    Name of the robot, names of its joints and the limits in the section `safety` of the text
    of a configuration. A robot from a file is named like the type of its sessions. It has the
    names that are given here, and what only its file says counts as no limit and no gain, unless
    `opens_file`: an untrusted text must open no file. Raises InvalidArgument at the value that is
    wrong.
    """

def named_joints(configuration: str) -> tuple[str, ...]:
    """
    The joints that the text of a configuration of a robot from a file names; empty if it leaves
    them to the file.
    """

def kinematics_of(configuration: str) -> Kinematics | None:
    """
    The kinematics of the robot in the text of a configuration; None for a robot from a file,
    which is not opened.
    """

class Pose:
    """Position and orientation of a body."""

    def __init__(self, position: numpy.typing.ArrayLike = (0.0, 0.0, 0.0), orientation: numpy.typing.ArrayLike = (1.0, 0.0, 0.0, 0.0)) -> None: ...

    @property
    def position(self) -> numpy.typing.NDArray[numpy.float64]:
        """Position of its centre of mass [m]."""

    @property
    def orientation(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Rotation from the body's frame: a quaternion w, x, y, z of unit length.
        """

class Twist:
    """Velocity and angular velocity of a body."""

    def __init__(self, linear: numpy.typing.ArrayLike = (0.0, 0.0, 0.0), angular: numpy.typing.ArrayLike = (0.0, 0.0, 0.0)) -> None: ...

    @property
    def linear(self) -> numpy.typing.NDArray[numpy.float64]:
        """Velocity of its centre of mass [m/s]."""

    @property
    def angular(self) -> numpy.typing.NDArray[numpy.float64]:
        """[rad/s], not in the body's frame."""

class Acceleration:
    """Rate of change of a body's twist."""

    def __init__(self, linear: numpy.typing.ArrayLike = (0.0, 0.0, 0.0), angular: numpy.typing.ArrayLike = (0.0, 0.0, 0.0)) -> None: ...

    @property
    def linear(self) -> numpy.typing.NDArray[numpy.float64]:
        """[m/s^2]"""

    @property
    def angular(self) -> numpy.typing.NDArray[numpy.float64]:
        """[rad/s^2]"""

class Motion:
    """A body at one instant of a motion."""

    def __init__(self, pose: Pose = ..., twist: Twist = ..., acceleration: Acceleration = ...) -> None: ...

    @property
    def pose(self) -> Pose: ...

    @property
    def twist(self) -> Twist: ...

    @property
    def acceleration(self) -> Acceleration: ...

class PointMotion:
    """A point at one instant of a motion."""

    def __init__(self, position: numpy.typing.ArrayLike = (0.0, 0.0, 0.0), velocity: numpy.typing.ArrayLike = (0.0, 0.0, 0.0), acceleration: numpy.typing.ArrayLike = (0.0, 0.0, 0.0)) -> None: ...

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
    The rotation about the direction of `vector` by its length [rad]: the exponential map, as a
    quaternion w, x, y, z.
    """

def rotation_vector(rotation: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
    """
    The shortest vector [rad] that `rotation_from_vector` turns into `rotation`: the logarithm.
    Its length is at most pi.
    """

def rotation_error(desired: numpy.typing.ArrayLike, actual: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
    """
    The rotation that still turns `actual` into `desired` [rad], in the frame in which both are
    given: `log(desired * actual^-1)`.
    """

def moved(pose: Pose, twist: Twist, duration: float) -> Pose:
    """
    The pose after moving from `pose` with a constant `twist` for `duration` [s], which may be
    negative.
    """

def point_of_body(body: Motion, point: numpy.typing.ArrayLike) -> PointMotion:
    """
    The motion of a point that is fixed to a body. `point` is in the body's frame, from its
    centre [m].
    """

class Progress:
    """Progress of a movement, with its derivatives."""

    @property
    def value(self) -> float:
        """0 at the beginning, 1 at the end."""

    @property
    def rate(self) -> float:
        """[1/s]"""

    @property
    def acceleration(self) -> float:
        """[1/s^2]"""

def minimum_jerk(time: float, duration: float) -> Progress:
    """
    The movement of least jerk from rest to rest: `10 s^3 - 15 s^4 + 6 s^5`, where s is the
    share of `duration` that has passed. It is complete if `duration` is not positive.
    """

class LineTrajectory:
    """A straight line with the least jerk."""

    def __init__(self, start: numpy.typing.ArrayLike, end: numpy.typing.ArrayLike, duration: float) -> None: ...

    @property
    def duration(self) -> float:
        """Time from the start to the end [s]."""

    def at(self, time: float) -> PointMotion:
        """
        The motion at `time` since the beginning [s]. Before time 0 it rests at its start, and after
        `duration` at its end.
        """

class PoseTrajectory:
    """
    A straight line, and a rotation about a fixed axis through the smaller angle, with least
    jerk.
    """

    def __init__(self, start: Pose, end: Pose, duration: float) -> None: ...

    @property
    def duration(self) -> float:
        """Time from the start to the end [s]."""

    def at(self, time: float) -> Motion:
        """
        The motion at `time` since the beginning [s]. Before time 0 it rests at its start, and after
        `duration` at its end.
        """

class CircleTrajectory:
    """
    A horizontal circle that gains its speed smoothly and loses it at the end.
    """

    def __init__(self, centre: numpy.typing.ArrayLike, radius: float = 0.05, start_angle: float = 0.0, turns: float = 3.0, period: float = 4.0, ramp_time: float = 1.0) -> None:
        """
        `start_angle` is measured from x towards y [rad]. Negative `turns` go clockwise. `period` is the time of one
        turn at full speed [s], `ramp_time` that from rest to full speed and back.
        """

    @property
    def duration(self) -> float:
        """`|turns| * period + ramp_time` [s]."""

    def at(self, time: float) -> PointMotion:
        """
        The motion at `time` since the beginning [s]. Before time 0 it rests at its start, and after
        `duration` at its end.
        """

class Wrench:
    """
    A force and a moment. The moment is about a point that is stated with each use.
    """

    def __init__(self, force: numpy.typing.ArrayLike = (0.0, 0.0, 0.0), moment: numpy.typing.ArrayLike = (0.0, 0.0, 0.0)) -> None: ...

    @property
    def force(self) -> numpy.typing.NDArray[numpy.float64]:
        """[N]"""

    @property
    def moment(self) -> numpy.typing.NDArray[numpy.float64]:
        """[Nm]"""

class Contact:
    """
    A point at which a tip touches an object and pushes, with friction and without adhesion.

    A tip that does not touch is a contact whose `max_normal_force` is 0. It gets no force.
    """

    def __init__(self, position: numpy.typing.ArrayLike, normal: numpy.typing.ArrayLike, friction: float = 0.5, min_normal_force: float = 0.0, max_normal_force: float = 10.0) -> None: ...

    @property
    def position(self) -> numpy.typing.NDArray[numpy.float64]:
        """[m]"""

    @property
    def normal(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Direction in which the tip can push, into the object; its length must not be zero.
        """

    @property
    def friction(self) -> float:
        """
        Coefficient that a controller relies on; it should be lower than the real one.
        """

    @property
    def min_normal_force(self) -> float:
        """[N], not negative."""

    @property
    def max_normal_force(self) -> float:
        """[N], at least `min_normal_force`."""

def contact_frame(normal: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
    """
    A matrix whose columns are two tangents and `normal`, orthonormal and right-handed. The
    first tangent is perpendicular to z, or to x if the normal is nearly along z.
    """

def grasp_map(grasp: Sequence[Contact], centre: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
    """
    The map from contact forces to the wrench on the object about `centre` [m]. It has 6 rows,
    force and moment, and 9 columns, three for each of the three contacts. Its rank is 6 if the
    contacts do not lie on one line.
    """

def wrench_of(grasp: Sequence[Contact], centre: numpy.typing.ArrayLike, forces: numpy.typing.ArrayLike) -> Wrench:
    """
    The total wrench of nine `forces` [N] at the three contacts, about `centre` [m].
    """

class FrictionPyramid:
    """
    A pyramid of 3 to 8 sides inside Coulomb's friction cone: a contact whose force lies in the
    pyramid does not slip.

    With four sides it is the paper's pyramid: `|tangential_i| <= friction / sqrt(2) * normal`
    for both tangents. Its edges lie on the cone, so more sides use more of the cone.
    """

    def __init__(self, sides: int = 4) -> None: ...

    @property
    def sides(self) -> int: ...

    def side(self, i: int, friction: float) -> numpy.typing.NDArray[numpy.float64]:
        """
        Points inward from side `i`, in the contact frame: forces with `side.dot(force) >= 0` are on
        its inner side. Its tangential part has length 1.
        """

    def margin(self, force: numpy.typing.ArrayLike, friction: float) -> float:
        """
        Tangential force that could be added to `force` [N] before it leaves the pyramid, in the
        direction with the least room. Negative outside. `force` is in the contact frame.
        """

class TorqueLimits:
    """
    The torques that the joints can give to press with the tips. Row i of the Jacobian tells how
    coordinate i of the contacts' positions changes when the joints move.
    """

    def __init__(self, jacobians: numpy.typing.ArrayLike, bias: numpy.typing.ArrayLike, limits: numpy.typing.ArrayLike) -> None: ...

    @property
    def jacobians(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Jacobians of the contacts in the frame of the grasp, 9 x 9 [m/rad]. For the world frame this
        is `Kinematics.tip_jacobians`.
        """

    @property
    def bias(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Torques that the joints need without any contact [Nm]: `Kinematics.bias_torques`.
        """

    @property
    def limits(self) -> numpy.typing.NDArray[numpy.float64]:
        """[Nm], not negative."""

class ForceStatus(enum.Enum):
    """Quality of a result of the force optimization, best first."""

    EXACT = 0
    """The forces make exactly the wanted wrench."""

    CLOSEST_WRENCH = 1
    """No allowed forces make the wanted wrench; these come closest to it."""

    TORQUE_LIMITS_EXCEEDED = 2
    """
    Even the smallest normal forces need more torque than the limits allow. The torque limits
    were ignored. Friction and normal forces are within their limits, and the wrench is the
    closest possible.
    """

    INVALID = 3
    """A number was not finite or out of its range. All forces are zero."""

class ForceDistribution:
    """A result of the force optimization."""

    @property
    def forces(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Forces of the tips on the object [N], in the frame of the grasp: three numbers for each of
        the three contacts.
        """

    @property
    def wrench(self) -> Wrench:
        """The wrench that the forces make."""

    @property
    def status(self) -> ForceStatus: ...

    def __bool__(self) -> bool: ...

class ForceOptimizer:
    """
    Finds the contact forces that make a wanted wrench, with the paper's quadratic program.

        minimise    1/2 f' W f
        subject to  G f = wrench                      (grasp map)
                    f_i in the friction pyramid of contact i
                    min_normal_force <= normal part of f_i <= max_normal_force
                    |J' f + bias| <= limits           (where torque limits are given)

    If the program has no solution, this minimizes `|G f - wrench|` instead. A small part of the
    objective above is added, so that the solution is unique. To compare moments with forces, a
    moment is divided by the contacts' mean distance (r.m.s.) from `centre`.

    Memory is allocated only during construction, and `solve` always ends. One object must not
    be used by several threads at once.
    """

    def __init__(self, friction_sides: int = 4, normal_weight: float = 1.0, tangential_weight: float = 1.0) -> None: ...

    def solve(self, grasp: Sequence[Contact], centre: numpy.typing.ArrayLike, wrench: Wrench, torques: TorqueLimits | None = None) -> ForceDistribution:
        """
        Distributes `wrench`, which is given about `centre` [m], over the three contacts. If that is
        impossible, the result comes closest to it and its `status` says so.
        """

class RigidBody:
    """Mass and inertia of a rigid body."""

    def __init__(self, mass: float, inertia: numpy.typing.ArrayLike) -> None: ...

    @property
    def mass(self) -> float:
        """[kg]"""

    @property
    def inertia(self) -> numpy.typing.NDArray[numpy.float64]:
        """Inertia about the centre of mass, in the body's frame [kg m^2]."""

def rigid_body(shape: str, size: numpy.typing.ArrayLike, mass: float) -> RigidBody:
    """
    Mass and inertia of an object whose mass is evenly spread: a box, a stick along x, or a
    ball. Its size has the whole lengths x, y, z of a box, the length and diameter of a stick,
    or the diameter of a ball [m].

    `shape` is "box", "stick" or "ball".
    """

def gravity() -> numpy.typing.NDArray[numpy.float64]:
    """Standard gravity as in MuJoCo's models [m/s^2], in the world frame."""

class ObjectGains:
    """How stiffly an object is held."""

    def __init__(self, stiffness: float = 100.0, damping: float = 4.0, rotational_stiffness: float = 0.1, rotational_damping: float = 0.006) -> None: ...

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
    The wrench about the object's centre that keeps the object on its way, in the world frame:

        force  = stiffness * dx + damping * dv + mass * (a - gravity)
        moment = rotational_stiffness * dr + rotational_damping * dw + I alpha + w x I w

    where `dx`, `dv`, `dw` are the errors of position, velocity and angular velocity (desired
    minus actual), `dr` is the rotation error, and `a`, `alpha`, `w` belong to the desired
    motion.
    """

class TipGains:
    """How stiffly a tip is held."""

    def __init__(self, stiffness: float = 200.0, damping: float = 2.5) -> None: ...

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
    The force that brings a tip to its desired position [N]: `stiffness * dx + damping * dv`.
    Add the force with which the tip should press. The joint torques for a force are `J' force`
    plus `Kinematics.bias_torques`.
    """

class LowPassFilter:
    """
    A first-order low-pass for up to nine numbers. Samples may come at uneven intervals.
    """

    def __init__(self, cutoff_frequency: float) -> None: ...

    def update(self, sample: numpy.typing.ArrayLike, elapsed: float) -> numpy.typing.NDArray[numpy.float64]:
        """
        Takes the next sample, `elapsed` [s] after the previous one, and returns the filtered
        signal. The first sample passes unchanged. A sample with another number of values passes
        unchanged, too.
        """

    def reset(self) -> None:
        """Treats the next sample as the first one."""

class Derivative:
    """The rate at which up to nine numbers change, low-pass filtered."""

    def __init__(self, cutoff_frequency: float) -> None: ...

    def update(self, sample: numpy.typing.ArrayLike, elapsed: float) -> numpy.typing.NDArray[numpy.float64]:
        """
        Takes the next sample, `elapsed` [s] after the previous one, and returns the rate [1/s]. The
        rate of the first sample is zero. A sample with no time since the previous one changes
        nothing.
        """

    def reset(self) -> None:
        """Treats the next sample as the first one."""

class PoseEstimator:
    """
    Estimates the current pose and motion of an object from poses that are few, noisy and old.

    The estimator needs a known motion, such as the one on which the object is led. It estimates
    how far the object deviates from that motion, and how the deviation changes. The deviation
    changes much more slowly than the object's pose. It can therefore be filtered strongly and
    predicted across the delay. The filter is critically damped and follows a deviation of
    constant rate without lag. If there is no known motion, leave it out: the known pose then
    rests at the origin.

    Times [s] may begin anywhere, but must have the same beginning in all calls.
    """

    def __init__(self, bandwidth: float = 3.0) -> None: ...

    def update(self, time: float, pose: Pose, known: Motion = ...) -> bool:
        """
        Takes `pose`, measured at `time`, when the known motion was at `known`. Ignores a pose that
        is not newer than the previous one or not finite, and then returns False.
        """

    def predict(self, time: float, known: Motion = ...) -> Motion:
        """
        The pose and motion of the object at `time`, when the known motion is at `known`. Before the
        first pose the result is `known`.
        """

    @property
    def last_time(self) -> float:
        """Time of the newest pose; negative infinity before the first."""

    def reset(self) -> None:
        """Forgets all poses."""

class Touch:
    """The place where one tip touches an object, in the object's frame."""

    def __init__(self, point: numpy.typing.ArrayLike, normal: numpy.typing.ArrayLike) -> None: ...

    @property
    def point(self) -> numpy.typing.NDArray[numpy.float64]:
        """Point on the surface, from the centre [m]."""

    @property
    def normal(self) -> numpy.typing.NDArray[numpy.float64]:
        """Direction into the object, of unit length."""

class Approach:
    """
    The path of a tip to its touch. The centre of the tip's sphere passes these points, given in
    the world frame.
    """

    @property
    def above(self) -> numpy.typing.NDArray[numpy.float64]:
        """[m]"""

    @property
    def beside(self) -> numpy.typing.NDArray[numpy.float64]:
        """[m]"""

def approach_to(touch: Touch, object: Pose, tip_radius: float) -> Approach:
    """
    The approach of a tip with radius `tip_radius` [m] to an object that rests at the pose
    `object`.
    """

class GraspPlannerConfig:
    """The candidates that a planner compares, and its requirements."""

    def __init__(self, *, offsets: Sequence[float] = ..., heights: Sequence[float] = ..., friction: float = 0.45, friction_sides: int = 4, min_normal_force: float = 0.9, clearance: float = 0.0005, limit_margin: float = 0.03, largest_torque: float = 1.0, shared_faces: bool = False) -> None: ...

    @property
    def offsets(self) -> list[float]:
        """Candidate offsets to both sides of a face's middle [m]."""

    @offsets.setter
    def offsets(self, arg: Sequence[float], /) -> None: ...

    @property
    def heights(self) -> list[float]:
        """Candidate heights above the object's centre [m]."""

    @heights.setter
    def heights(self, arg: Sequence[float], /) -> None: ...

    @property
    def friction(self) -> float:
        """Friction coefficient that the forces rely on."""

    @friction.setter
    def friction(self, arg: float, /) -> None: ...

    @property
    def friction_sides(self) -> int:
        """Sides of its friction pyramids, 3 to 8."""

    @friction_sides.setter
    def friction_sides(self, arg: int, /) -> None: ...

    @property
    def min_normal_force(self) -> float:
        """[N]"""

    @min_normal_force.setter
    def min_normal_force(self, arg: float, /) -> None: ...

    @property
    def clearance(self) -> float:
        """Distance that fingers keep, except at touching tips [m]."""

    @clearance.setter
    def clearance(self, arg: float, /) -> None: ...

    @property
    def limit_margin(self) -> float:
        """Distance that joints keep from their soft limits [rad]."""

    @limit_margin.setter
    def limit_margin(self, arg: float, /) -> None: ...

    @property
    def largest_torque(self) -> float:
        """Share of the motors' torque that carrying may need."""

    @largest_torque.setter
    def largest_torque(self, arg: float, /) -> None: ...

    @property
    def shared_faces(self) -> bool:
        """Two tips may touch one face, as a long box needs."""

    @shared_faces.setter
    def shared_faces(self, arg: bool, /) -> None: ...

class PlannedGrasp:
    """The result of a planner."""

    @property
    def touches(self) -> list[Touch]:
        """Touches of the three tips, finger 0 first."""

    @property
    def torque_share(self) -> float:
        """
        Largest share of a motor's torque that carrying the object needs anywhere on the way.
        """

class GraspPlanner:
    """
    Chooses which finger touches which side face of a box, and where: a face that is upright at
    the beginning of the trajectory. The fingers reach the whole trajectory. Only their tips
    touch anything, and they touch only the box. They carry it within friction, also during
    upward acceleration, with as little torque as possible. One object must not be used by
    several threads at once.
    """

    def __init__(self, config: str = 'sim', overrides: dict[str, object] = {}, object: str = 'cube', settings: GraspPlannerConfig = ...) -> None:
        """
        `config` and `overrides` give the robot, its limits and the scene, as in `Kinematics`. `object` is
        the name of the box.
        """

    def plan(self, trajectory: Sequence[Motion]) -> PlannedGrasp | None:
        """
        The best grasp to lead the object along `trajectory`, which begins where it is grasped. None
        if there is none. The object may be tilted on the way, which takes longer to plan: up to a
        second instead of some milliseconds. Allocates memory.
        """

class GraspControllerConfig:
    """Settings of a `GraspController`. docs/control.md explains the gains."""

    def __init__(self, *, object: ObjectGains = ..., tips: TipGains = ..., friction: float = 0.45, friction_sides: int = 4, slip_friction: float = 0.55, min_normal_force: float = 0.9, max_normal_force: float = 5.0, touch_force: float = 0.3, approach_speed: float = 0.15, closing_speed: float = 0.02, penetration: float = 0.006, closing_time: float = 4.0, engage_time: float = 0.5, roll_time: float = 0.3, slip_speed: float = 0.03, lost_time: float = 0.1, lost_distance: float = 0.03) -> None: ...

    @property
    def object(self) -> ObjectGains:
        """How stiffly the object is held."""

    @object.setter
    def object(self, arg: ObjectGains, /) -> None: ...

    @property
    def tips(self) -> TipGains:
        """How stiffly each tip is held."""

    @tips.setter
    def tips(self, arg: TipGains, /) -> None: ...

    @property
    def friction(self) -> float:
        """Friction coefficient that the holding forces rely on."""

    @friction.setter
    def friction(self, arg: float, /) -> None: ...

    @property
    def friction_sides(self) -> int:
        """Sides of its friction pyramids, 3 to 8."""

    @friction_sides.setter
    def friction_sides(self, arg: int, /) -> None: ...

    @property
    def slip_friction(self) -> float:
        """Largest ratio of tangential to normal force of holding tips."""

    @slip_friction.setter
    def slip_friction(self, arg: float, /) -> None: ...

    @property
    def min_normal_force(self) -> float:
        """Smallest normal force of each holding tip [N]."""

    @min_normal_force.setter
    def min_normal_force(self, arg: float, /) -> None: ...

    @property
    def max_normal_force(self) -> float:
        """Largest normal force of each holding tip [N]."""

    @max_normal_force.setter
    def max_normal_force(self, arg: float, /) -> None: ...

    @property
    def touch_force(self) -> float:
        """Force that counts as a touch [N]."""

    @touch_force.setter
    def touch_force(self, arg: float, /) -> None: ...

    @property
    def approach_speed(self) -> float:
        """Average speed of the tips on the way [m/s]."""

    @approach_speed.setter
    def approach_speed(self, arg: float, /) -> None: ...

    @property
    def closing_speed(self) -> float:
        """Speed of tips that search for the faces [m/s]."""

    @closing_speed.setter
    def closing_speed(self, arg: float, /) -> None: ...

    @property
    def penetration(self) -> float:
        """Depth inside the object up to which tips search for a face [m]."""

    @penetration.setter
    def penetration(self, arg: float, /) -> None: ...

    @property
    def closing_time(self) -> float:
        """Time in which all tips must have felt their faces [s]."""

    @closing_time.setter
    def closing_time(self, arg: float, /) -> None: ...

    @property
    def engage_time(self) -> float:
        """Time in which a touch becomes a hold [s]."""

    @engage_time.setter
    def engage_time(self, arg: float, /) -> None: ...

    @property
    def roll_time(self) -> float:
        """Time constant with which targets follow rolling tips [s]."""

    @roll_time.setter
    def roll_time(self, arg: float, /) -> None: ...

    @property
    def slip_speed(self) -> float:
        """Speed of a tip along its face above which it slips [m/s]."""

    @slip_speed.setter
    def slip_speed(self, arg: float, /) -> None: ...

    @property
    def lost_time(self) -> float:
        """Time without touch after which the object is lost [s]."""

    @lost_time.setter
    def lost_time(self, arg: float, /) -> None: ...

    @property
    def lost_distance(self) -> float:
        """Distance from its target at which the object is lost [m]."""

    @lost_distance.setter
    def lost_distance(self, arg: float, /) -> None: ...

class GraspPhase(enum.Enum):
    """The phase of a `GraspController`."""

    IDLE = 0
    """The tips stay where they are."""

    APPROACH = 1
    """The tips go to the object without touching it."""

    CLOSE = 2
    """The tips move towards the faces until all of them feel a touch."""

    ENGAGE = 3
    """The forces grow until they hold the object."""

    HOLD = 4
    """The object follows the desired motion."""

    RELEASE = 5
    """The tips move off the faces, and then up."""

    LOST = 6
    """
    The object slipped away or was not at its place. The tips stay; release them.
    """

class JointState:
    """
    Measurements of the nine joints, finger 0 first, from the base to the tip.
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
    """The state of a `GraspController`: its phase and its forces."""

    @property
    def phase(self) -> GraspPhase: ...

    @property
    def wanted(self) -> ForceDistribution:
        """
        The wanted contact forces while the object is held, in the world frame.
        """

    @property
    def normal_forces(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Forces with which the three tips press along their faces' normals [N], computed from the
        joints' torques.
        """

    @property
    def tangential_forces(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Forces with which the three tips press across their faces' normals [N], computed from the
        joints' torques.
        """

    @property
    def travel(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        How far each of the three tips has moved along its face by rolling and slipping, since all
        tips touched [m].
        """

    @property
    def slip_speeds(self) -> numpy.typing.NDArray[numpy.float64]:
        """Speeds of `travel`, low-pass filtered at 5 Hz [m/s]."""

    @property
    def felt(self) -> Twist:
        """
        The motion of the held object as the tips feel it: they roll on its faces without slipping.
        Zero while it is not held.
        """

    @property
    def is_slipping(self) -> bool:
        """True if a tip moves along its face faster than tips roll."""

    @property
    def torque_share(self) -> float:
        """
        The largest ratio of a requested torque to its joint's limit. The safety checks cut off
        everything above 1.
        """

class GraspController:
    """
    The paper's controller (docs/control.md): it grasps an object with three tips, makes it
    follow a motion, and releases it.

    The object's impedance gives the wrench that the object needs. The force optimization gives
    the contact forces that make this wrench. The joint torques are

        torque = J' (forces + tip impedance) + M J^-1 (a - dJ/dt dq) + bias + damping dq

    where `a` is the desired acceleration of the tips. The last term compensates the damping
    that the robot's safety checks add. A round tip rolls on its face. Each contact is therefore
    at the measured tip, and the target of the tip's impedance follows it slowly.

    Call `update` once per step. Memory is allocated only during construction. One object must
    not be used by several threads at once.
    """

    def __init__(self, body: RigidBody, config: str = 'sim', overrides: dict[str, object] = {}, settings: GraspControllerConfig = ...) -> None:
        """
        `body` is the object. `config` and `overrides` give the robot and its limits, as in `Kinematics`.
        """

    def grasp(self, touches: Sequence[Touch], object: Pose) -> None:
        """
        Goes to the object, which rests at the pose `object`, and grasps it at three `touches`,
        finger 0 first.
        """

    def release(self) -> None:
        """Releases the object in any phase."""

    def update(self, elapsed: float, joints: JointState, object: Motion, desired: Motion) -> numpy.typing.NDArray[numpy.float64]:
        """
        Returns the nine joint torques for the next step [Nm], `elapsed` [s] after the previous
        step. `object` is the object's pose and motion. `desired` is its desired motion while it is
        held; before that, pass the pose where it rests.
        """

    @property
    def state(self) -> GraspState:
        """The state after the last `update`."""

class SplineKind(enum.Enum):
    """How values follow from knots."""

    CONSTANT = 0
    """A knot holds until the next one."""

    LINEAR = 1
    """Straight lines between knots."""

    CUBIC = 2
    """
    Cubic polynomials whose rates at the knots are those of the parabolas through the neighbours
    (Catmull and Rom). Values and rates are continuous.
    """

class KnotSpline:
    """
    Numbers as functions of time: `width` values given at knots of equal distance. Before the
    first and after the last knot they rest.

    After its construction, no function allocates memory.
    """

    def __init__(self, kind: SplineKind, num_knots: int, width: int, interval: float, begin: float = 0.0) -> None:
        """
        Knots lie at `begin`, `begin + interval` and so on [s]. All values are 0.
        """

    @property
    def kind(self) -> SplineKind: ...

    @property
    def num_knots(self) -> int:
        """Number of knots."""

    @property
    def width(self) -> int:
        """Number of values at each time."""

    @property
    def interval(self) -> float:
        """Time from one knot to the next [s]."""

    @property
    def begin(self) -> float:
        """Time of the first knot [s]."""

    @property
    def end(self) -> float:
        """Time of the last knot [s]."""

    def move_to(self, begin: float) -> None:
        """Moves all knots, so that the first one lies at `begin`."""

    def knot(self, index: int) -> numpy.typing.NDArray[numpy.float64]:
        """
        The values of one knot.

        The array shows them in place: changes change the spline.
        """

    @property
    def values(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        The values of all knots, with a row per knot. The array shows them in place: changes change the spline.
        """

    @values.setter
    def values(self, values: numpy.typing.ArrayLike, /) -> None: ...

    def at(self, time: float) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """Returns the values at `time` [s], and their rates [1/s]."""

class PlanningState:
    """
    A state from which a plan may begin: everything that moves in a `PlanningModel`.

    Arrays show the numbers in place.
    """

    def __init__(self, time: float, position: numpy.typing.ArrayLike, velocity: numpy.typing.ArrayLike) -> None: ...

    @property
    def time(self) -> float:
        """Time [s] on any clock; the same one for all states of a plan."""

    @time.setter
    def time(self, arg: float, /) -> None: ...

    @property
    def position(self) -> numpy.typing.NDArray[numpy.float64]:
        """MuJoCo's `qpos`: the joints, then the objects."""

    @position.setter
    def position(self, arg: numpy.typing.ArrayLike, /) -> None: ...

    @property
    def velocity(self) -> numpy.typing.NDArray[numpy.float64]:
        """MuJoCo's `qvel`."""

    @velocity.setter
    def velocity(self, arg: numpy.typing.ArrayLike, /) -> None: ...

class PlanningModelOptions:
    """
    What a `PlanningModel` leaves out. docs/planning.md says what each figure costs.
    """

    def __init__(self, *, time_step: float = 0.006, iterations: int = 4, impratio: float = 10.0, lower_links: bool = True, fingers_touch: bool = True, torque_share: float = 0.95) -> None: ...

    @property
    def time_step(self) -> float:
        """[s]; more than 6 ms lets fast tips sink into objects."""

    @time_step.setter
    def time_step(self, arg: float, /) -> None: ...

    @property
    def iterations(self) -> int:
        """Iterations of the solver of contacts in a step, at most."""

    @iterations.setter
    def iterations(self, arg: int, /) -> None: ...

    @property
    def impratio(self) -> float:
        """
        Ratio of the stiffness of friction to that of normal forces; higher: held objects slip less.
        """

    @impratio.setter
    def impratio(self, arg: float, /) -> None: ...

    @property
    def lower_links(self) -> bool:
        """
        The lower links touch objects, each as one capsule. Otherwise only the tips do.
        """

    @lower_links.setter
    def lower_links(self, arg: bool, /) -> None: ...

    @property
    def fingers_touch(self) -> bool:
        """The fingers touch each other, with tips and lower links."""

    @fingers_touch.setter
    def fingers_touch(self, arg: bool, /) -> None: ...

    @property
    def torque_share(self) -> float:
        """
        Share of the largest torque that plans may use; the rest is for feedback.
        """

    @torque_share.setter
    def torque_share(self, arg: float, /) -> None: ...

class PlannedJoint:
    """A joint with a motor, as plans see it."""

    def __init__(self, lower: float, upper: float, max_torque: float) -> None: ...

    @property
    def lower(self) -> float:
        """Range of targets [rad]."""

    @property
    def upper(self) -> float:
        """[rad]"""

    @property
    def max_torque(self) -> float:
        """Largest torque of a plan [Nm]."""

class ObjectAddress:
    """The place of one loose object in the state of a `SceneModel`."""

    @property
    def name(self) -> str: ...

    @property
    def body(self) -> int:
        """Index of the body."""

    @property
    def position(self) -> int:
        """First of 7 numbers in `qpos`: x y z, then the quaternion w x y z."""

    @property
    def velocity(self) -> int:
        """First of 6 numbers in `qvel`."""

class PlanningModel:
    """
    A model for planning, with the same joints and objects in the same order as a `RobotModel`.

    Steps are long. Contacts have pyramids of friction and few iterations. The wall and all
    parts of fingers but tips and lower links touch nothing. The damping of the safety checks is
    damping of the joints. Fingers do not pass through the table, and joints stop at their
    limits.
    """

    def __init__(self, config: str = 'sim', overrides: dict[str, object] = {}, options: PlanningModelOptions = ...) -> None:
        """
        `config` and `overrides` give the robot, its limits and the scene, as in `Kinematics`.
        """

    @staticmethod
    def of_file(path: str | bytes | os.PathLike[str], joints: Sequence[PlannedJoint], tip_sites: Sequence[str] = ()) -> PlanningModel:
        """
        Copies the model of another robot from an MJCF or URDF file. Its first joints must be `joints`:
        hinges or slides, with one motor each in the same order. `tip_sites` are names of sites at the tips
        of its fingers. Its objects are the bodies that float freely.

        Raises InvalidArgument if the file or its joints do not fit.
        """

    @property
    def time_step(self) -> float:
        """Length of a step [s]."""

    @property
    def num_joints(self) -> int:
        """Number of joints with motors."""

    @property
    def position_size(self) -> int:
        """Numbers in `PlanningState.position`."""

    @property
    def velocity_size(self) -> int:
        """Numbers in `PlanningState.velocity`."""

    @property
    def joints(self) -> list[PlannedJoint]:
        """The joints with motors."""

    @property
    def tip_sites(self) -> list[int]:
        """Sites at the tips of the fingers."""

    @property
    def objects(self) -> list[ObjectAddress]:
        """Objects, in the order of `CostTerm.index`."""

    def object(self, name: str) -> ObjectAddress:
        """
        Where the object `name` is in a state.

        Raises InvalidArgument that names the existing objects.
        """

    def initial_state(self) -> PlanningState:
        """The initial pose at rest, at time 0."""

    def set_joints(self, position: numpy.typing.ArrayLike, velocity: numpy.typing.ArrayLike, state: PlanningState) -> None:
        """
        Sets positions [rad] and velocities [rad/s] of the joints. Does not allocate.
        """

    @staticmethod
    def set_object(object: ObjectAddress, pose: Pose, twist: Twist, state: PlanningState) -> None:
        """
        Sets pose and twist of an object, both in the world frame. Does not allocate.
        """

    @staticmethod
    def object_pose(object: ObjectAddress, position: numpy.typing.ArrayLike) -> Pose:
        """
        The pose of an object in the world frame, from `PlanningState.position`.
        """

    @staticmethod
    def object_twist(object: ObjectAddress, position: numpy.typing.ArrayLike, velocity: numpy.typing.ArrayLike) -> Twist:
        """
        The twist of an object in the world frame, from both lists of a `PlanningState`.
        """

    def check(self, state: PlanningState) -> None:
        """
        Raises InvalidArgument if the numbers are too few, too many or not finite.
        """

class CostKind(enum.Enum):
    """A quantity that a cost counts."""

    OBJECT_POSITION = 0
    """Distance of the object's centre from `goal.position` [m]."""

    OBJECT_ORIENTATION = 1
    """Angle between the object's orientation and `goal.orientation` [rad]."""

    OBJECT_VELOCITY = 2
    """Speed of the object's centre [m/s]."""

    OBJECT_ROTATION = 3
    """Angular speed of the object [rad/s]."""

    TIP_OBJECT = 4
    """
    Sum over tips of the distance to the object's centre beyond `distance` [m].
    """

    TIP_POSITION = 5
    """Distance of the tip of finger `index` from `goal.position` [m]."""

    JOINT_POSITION = 6
    """Distance of the joints from `joints`, as a vector [rad]."""

    JOINT_VELOCITY = 7
    """Length of the vector of joint velocities [rad/s]."""

    EFFORT = 8
    """Length of the vector of torques that the plan asks for [Nm]."""

    TARGET_DISTANCE = 9
    """Distance of the joints from the plan's targets [rad]; 0 for torques."""

class CostShape(enum.Enum):
    """How a quantity becomes a cost."""

    LINEAR = 0
    """The quantity itself: the last centimetre counts like the first."""

    SQUARE = 1
    """The square of the quantity."""

    SMOOTH = 2
    """
    `sqrt(q^2 + smoothing^2) - smoothing`: like a square below `smoothing`, linear far beyond
    it.
    """

class CostTerm:
    """One ready-made part of a cost: plain data."""

    def __init__(self, *, kind: CostKind = CostKind.OBJECT_POSITION, weight: float = 1.0, end_weight: float = 0.0, shape: CostShape = CostShape.LINEAR, index: int = 0, goal: Pose = ..., distance: float = 0.0, smoothing: float = 0.0, joints: numpy.typing.ArrayLike = ...) -> None: ...

    @property
    def kind(self) -> CostKind:
        """The quantity that counts."""

    @kind.setter
    def kind(self, arg: CostKind, /) -> None: ...

    @property
    def weight(self) -> float:
        """Weight in the running cost [1/s]."""

    @weight.setter
    def weight(self, arg: float, /) -> None: ...

    @property
    def end_weight(self) -> float:
        """Weight in the cost of the end."""

    @end_weight.setter
    def end_weight(self, arg: float, /) -> None: ...

    @property
    def shape(self) -> CostShape:
        """How the quantity becomes a cost."""

    @shape.setter
    def shape(self, arg: CostShape, /) -> None: ...

    @property
    def index(self) -> int:
        """The object in the model's list, or the finger."""

    @index.setter
    def index(self, arg: int, /) -> None: ...

    @property
    def goal(self) -> Pose:
        """Where the object or the tip should be."""

    @goal.setter
    def goal(self, arg: Pose, /) -> None: ...

    @property
    def distance(self) -> float:
        """Distance of TIP_OBJECT [m]."""

    @distance.setter
    def distance(self, arg: float, /) -> None: ...

    @property
    def smoothing(self) -> float:
        """Scale of SMOOTH, in the unit of the quantity."""

    @smoothing.setter
    def smoothing(self, arg: float, /) -> None: ...

    @property
    def joints(self) -> numpy.typing.NDArray[numpy.float64]:
        """Joint positions of JOINT_POSITION [rad]."""

    @joints.setter
    def joints(self, arg: numpy.typing.ArrayLike, /) -> None: ...

class RolloutBatch:
    """
    All rollouts of a round, for costs that judge them together. Arrays have an axis for rollouts, one for
    their states, and one for the numbers of a state. They may be kept: the next round has others.

    In states after a rollout became infinite all numbers are not finite; that rollout is masked whatever
    its cost.
    """

    @property
    def num_rollouts(self) -> int:
        """
        All samples of a round; 1 when the plan itself is judged, after the last round.
        """

    @property
    def num_states(self) -> int:
        """Per rollout: one more than its steps."""

    @property
    def begin(self) -> float:
        """Time of the first state."""

    @property
    def time_step(self) -> float:
        """Time from one state to the next one."""

    @property
    def positions(self) -> numpy.typing.NDArray[numpy.float64]:
        """MuJoCo's `qpos`."""

    @property
    def velocities(self) -> numpy.typing.NDArray[numpy.float64]:
        """MuJoCo's `qvel`."""

    @property
    def targets(self) -> numpy.typing.NDArray[numpy.float64]:
        """Joint targets or torques, after the last step repeated."""

    @property
    def torques(self) -> numpy.typing.NDArray[numpy.float64]:
        """[Nm]; after the last step 0."""

    @property
    def tips(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Positions of the tips [m]. This array has one more axis: tip, then x y z.
        """

class PlanningTask:
    """
    A cost is the sum of all parts that are given.

    `batch_cost` gets a `RolloutBatch` and returns an array: what each rollout costs. It is called once
    per round, and once for the plan itself.
    """

    def __init__(self, terms: Iterable[CostTerm] = (), batch_cost: Callable[[RolloutBatch], numpy.typing.ArrayLike] | None = None, *, late_share: float = ..., late_factor: float = ...) -> None: ...

    @property
    def terms(self) -> tuple[CostTerm, ...]:
        """The ready-made parts of the cost."""

    @property
    def batch_cost(self) -> Callable[[RolloutBatch], numpy.typing.ArrayLike] | None:
        """What rollouts cost beside their terms."""

    @property
    def late_share(self) -> float:
        """
        The running cost of `terms` and `cost` counts `late_factor` times in the last `late_share`
        of the horizon.
        """

    @property
    def late_factor(self) -> float:
        """How many times `terms` count in the last `late_share` of the horizon."""

class PlanningMethod(enum.Enum):
    """
    How the next plan follows from the rollouts of a round. docs/planning.md has the equations.
    """

    PREDICTIVE_SAMPLING = 0
    """
    The best rollout. T. Howell et al.: Predictive Sampling: Real-time Behaviour Synthesis with
    MuJoCo. 2022.
    """

    CROSS_ENTROPY = 1
    """
    The mean of the best rollouts, around which the next round samples with their deviation. R.
    Y. Rubinstein: Optimization of computer simulation models with rare events. 1997; M.
    Kobilarov: Cross-entropy motion planning. 2012.
    """

    PATH_INTEGRAL = 2
    """
    The mean of all rollouts, weighted with the exponentials of their costs. G. Williams et al.:
    Information theoretic MPC for model-based reinforcement learning. 2017.
    """

class PlannedCommand(enum.Enum):
    """What the numbers of a plan are."""

    POSITION = 0
    """
    Joint targets [rad], which the joints follow like springs with dampers.
    """

    TORQUE = 1
    """Torques [Nm]."""

class PlannerOptions:
    """
    Settings of a planner. The defaults turn and flip cubes; docs/planning.md says what each
    does.
    """

    def __init__(self, *, method: PlanningMethod = PlanningMethod.PATH_INTEGRAL, samples: int = 64, rounds: int = 1, horizon: float = 0.5, knots: int = 4, spline: SplineKind = SplineKind.LINEAR, command: PlannedCommand = PlannedCommand.POSITION, kp: float = 10.0, kd: float = 0.015, least_sigma: float = 0.035, most_sigma: float = 0.35, one_finger_share: float = 0.4, constant_share: float = 0.3, temperature: float = 0.1, elites: int = 8, num_threads: int = 0, seed: int = 0) -> None: ...

    @property
    def method(self) -> PlanningMethod:
        """How the next plan follows from rollouts."""

    @method.setter
    def method(self, arg: PlanningMethod, /) -> None: ...

    @property
    def samples(self) -> int:
        """Rollouts per round. The first one is the plan before the round."""

    @samples.setter
    def samples(self, arg: int, /) -> None: ...

    @property
    def rounds(self) -> int:
        """Rounds per plan."""

    @rounds.setter
    def rounds(self, arg: int, /) -> None: ...

    @property
    def horizon(self) -> float:
        """Rounded to whole steps of the model, at least one."""

    @horizon.setter
    def horizon(self, arg: float, /) -> None: ...

    @property
    def knots(self) -> int:
        """Number of knots of a plan."""

    @knots.setter
    def knots(self, arg: int, /) -> None: ...

    @property
    def spline(self) -> SplineKind:
        """How commands follow from knots."""

    @spline.setter
    def spline(self, arg: SplineKind, /) -> None: ...

    @property
    def command(self) -> PlannedCommand:
        """What the numbers of a plan are."""

    @command.setter
    def command(self, arg: PlannedCommand, /) -> None: ...

    @property
    def kp(self) -> float:
        """Stiffness with which joints follow their targets [Nm/rad]."""

    @kp.setter
    def kp(self, arg: float, /) -> None: ...

    @property
    def kd(self) -> float:
        """Damping with which they follow [Nms/rad]."""

    @kd.setter
    def kd(self, arg: float, /) -> None: ...

    @property
    def least_sigma(self) -> float:
        """
        Each rollout changes the knots by normal numbers with a standard deviation between these
        two, in the unit of the command. Its logarithm is spread evenly. Cross-entropy begins each
        plan with the larger one and does not go below the smaller one.
        """

    @least_sigma.setter
    def least_sigma(self, arg: float, /) -> None: ...

    @property
    def most_sigma(self) -> float:
        """See `least_sigma`."""

    @most_sigma.setter
    def most_sigma(self, arg: float, /) -> None: ...

    @property
    def one_finger_share(self) -> float:
        """Share of rollouts that change one finger only."""

    @one_finger_share.setter
    def one_finger_share(self, arg: float, /) -> None: ...

    @property
    def constant_share(self) -> float:
        """Share of rollouts that change all knots equally."""

    @constant_share.setter
    def constant_share(self, arg: float, /) -> None: ...

    @property
    def temperature(self) -> float:
        """
        The costs' scale of PATH_INTEGRAL, as a share of the median's distance from the least cost.
        """

    @temperature.setter
    def temperature(self, arg: float, /) -> None: ...

    @property
    def elites(self) -> int:
        """Number of best rollouts of CROSS_ENTROPY."""

    @elites.setter
    def elites(self, arg: int, /) -> None: ...

    @property
    def num_threads(self) -> int:
        """
        The calling thread included; 0: one per processor that the process may use.
        """

    @num_threads.setter
    def num_threads(self, arg: int, /) -> None: ...

    @property
    def seed(self) -> int:
        """Seed of all random numbers."""

    @seed.setter
    def seed(self, arg: int, /) -> None: ...

class OnlinePlannerOptions:
    """
    Settings of an `OnlinePlanner`. All times are on the clock of the states.
    """

    def __init__(self, *, period: float = 0.04, lead: float | None = ...) -> None: ...

    @property
    def period(self) -> float:
        """
        Least time from the state of one plan to that of the next one. It is longer if `lead` is:
        the next plan is made from a state after the newest one has begun.
        """

    @period.setter
    def period(self, arg: float, /) -> None: ...

    @property
    def lead(self) -> float | None:
        """
        Time from the state of a plan to the instant from which it is used. Default: as long as
        plans took until now.
        """

    @lead.setter
    def lead(self, arg: float | None, /) -> None: ...

class PlannedStates:
    """The states of one rollout, from its start on: one more than its steps."""

    @property
    def begin(self) -> float:
        """Time of the first state [s]."""

    @property
    def time_step(self) -> float:
        """Time from one state to the next one [s]."""

    @property
    def count(self) -> int:
        """Number of states."""

    @property
    def positions(self) -> numpy.typing.NDArray[numpy.float64]:
        """`PlanningState.position`, one row per state."""

    @property
    def velocities(self) -> numpy.typing.NDArray[numpy.float64]:
        """`PlanningState.velocity`, one row per state."""

class Plan:
    """A plan, and how good it is. All is from the planning model."""

    @property
    def commands(self) -> KnotSpline:
        """Its `begin` is the time of the start."""

    @property
    def cost(self) -> float:
        """Cost of a rollout of this plan; infinite if it diverged."""

    @property
    def previous_cost(self) -> float:
        """Cost of the plan with which this one began."""

    @property
    def least_cost(self) -> float:
        """Cost of the best rollout of the last round."""

    @property
    def median_cost(self) -> float:
        """Median cost of the last round, without masked rollouts."""

    @property
    def num_masked(self) -> int:
        """Rollouts of the last round that diverged."""

    @property
    def number(self) -> int:
        """Counts plans from 1."""

    @property
    def states(self) -> PlannedStates:
        """What this plan leads to."""

class PredictivePlanner:
    """
    Finds joint targets or torques that make a cost small, by trying many in simulations.

    `plan` begins with the previous plan, moved to the new start. In each round it changes this
    plan at random, simulates every change over the horizon, and takes the best or a mean. Only
    the start and the task count, so it plans through contacts that nobody described.

    Results depend on options, seed, task and the starts so far, and not on the number of
    threads. `plan` does not allocate after the first call, unless a cost function does. One
    planner must not be used by several threads at once; its own threads run while `plan` does.

    Other threads of Python run while it plans. If one of them uses the planner meanwhile, it gets an
    Error.
    """

    def __init__(self, model: PlanningModel, task: PlanningTask, options: PlannerOptions = ...) -> None:
        """Raises InvalidArgument that names the first value that makes no sense."""

    def plan(self, start: PlanningState) -> Plan:
        """
        Plans from `start`, and returns the plan. If all rollouts diverge, the previous plan stays and its
        cost is infinite.

        Raises InvalidArgument if `start` does not fit the model or is not finite; what `batch_cost` raises.
        """

    @property
    def newest(self) -> Plan:
        """The newest plan."""

    def restart(self) -> None:
        """
        Forgets the previous plan: the next one begins with targets where the joints are at the
        start, or with zero torques.
        """

    def begin_with(self, commands: KnotSpline) -> None:
        """
        Makes the next plan begin with these commands.

        Raises InvalidArgument if their width is not the number of joints.
        """

    def simulate(self, start: PlanningState, commands: KnotSpline, duration: float) -> tuple[float, PlanningState]:
        """
        Simulates `commands` from `start` for `duration` [s] in the planning model. Returns the cost as a plan
        of that duration, without `batch_cost`, and the last state; the cost is infinite if it diverged.

        Raises InvalidArgument as `plan` does.
        """

    def set_task(self, task: PlanningTask) -> None:
        """
        Changes what the next plans shall achieve.

        Raises InvalidArgument as the constructor does.
        """

    def set_terms(self, terms: Sequence[CostTerm]) -> None:
        """Changes the terms of the task only."""

    @property
    def model(self) -> PlanningModel:
        """The model that was given."""

    @property
    def task(self) -> PlanningTask:
        """The task, with copies of its terms."""

    @property
    def options(self) -> PlannerOptions:
        """A copy of the options."""

    @property
    def num_threads(self) -> int:
        """Number of threads that simulate."""

    @property
    def num_steps(self) -> int:
        """Steps of a rollout."""

    @property
    def costs(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Costs of the rollouts of the last round; infinite for those that diverged.
        """

    @property
    def weights(self) -> numpy.typing.NDArray[numpy.float64]:
        """Weights of these rollouts in the plan; their sum is 1."""

    def knots_of(self, rollout: int) -> numpy.typing.NDArray[numpy.float64]:
        """The knots of one of these rollouts, as in `KnotSpline.values`."""

def path_integral_weights(costs: numpy.typing.ArrayLike, temperature: float) -> numpy.typing.NDArray[numpy.float64]:
    """
    `exp(-(cost - least) / scale)`, divided by the sum, where `scale` is `temperature` times the
    median's distance from the least cost. Adding a number to all costs, or multiplying them
    all, changes nothing.

    Their sum is 1, or 0 if no cost is finite.
    """

def elite_weights(costs: numpy.typing.ArrayLike, count: int) -> numpy.typing.NDArray[numpy.float64]:
    """
    Equal weights for the `count` least costs; of equal costs the first ones.

    Their sum is 1, or 0 if no cost is finite.
    """

class OnlinePlannerStatus:
    """How plans were made. Plain data."""

    @property
    def num_plans(self) -> int:
        """Number of plans that were made."""

    @property
    def num_refused_states(self) -> int:
        """States with numbers that are not finite."""

    @property
    def state_time(self) -> float:
        """Time of the state from which the newest plan was made."""

    @property
    def begin(self) -> float:
        """Instant from which the newest plan is used."""

    @property
    def duration(self) -> float:
        """What the newest plan took, from its state on."""

    @property
    def lateness(self) -> float:
        """How long after its `begin` it was ready; 0 if in time."""

    @property
    def cost(self) -> float:
        """`Plan.cost` of the newest plan."""

    @property
    def median_cost(self) -> float:
        """`Plan.median_cost` of the newest plan."""

    @property
    def num_masked(self) -> int:
        """`Plan.num_masked` of the newest plan."""

    @property
    def has_failed(self) -> bool:
        """A cost function has thrown, so no other plan will come."""

class OnlinePlanner:
    """
    Plans in threads of its own, beside a loop at 1 HZ.

    The loop hands over its newest state, and reads the newest plan at any time. A plan takes
    tens of milliseconds. So the state is first simulated forward along the plan that the loop
    follows, to the instant at which the new plan will be ready, and the new plan begins there.
    Until that instant the loop still follows the old plan.

    The planner's threads are ordinary ones, also if the thread that makes it has real-time
    priority. Results depend on how fast this machine plans; only with `lead` and
    `wait_for_plan` after each state they do not.

    Planning needs the interpreter only while a `batch_cost` runs, once per round. A task of terms alone
    never delays Python's loop.
    """

    def __init__(self, model: PlanningModel, task: PlanningTask, options: PlannerOptions = ..., online: OnlinePlannerOptions = ...) -> None:
        """
        Starts the threads. Returns when they are ready.

        Raises InvalidArgument that names the first value that makes no sense.
        """

    @property
    def model(self) -> PlanningModel:
        """The model, for making states."""

    def set_state(self, state: PlanningState) -> bool:
        """
        Hands over a state, whose time must not be before that of the last one. Ignores a state that
        does not fit the model, and then returns False.
        """

    def at(self, time: float) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]] | None:
        """
        Returns the commands at `time` [s], and their rates [1/s]; None before the first plan.
        """

    @property
    def status(self) -> OnlinePlannerStatus:
        """The status as it is now."""

    def set_terms(self, terms: Sequence[CostTerm]) -> bool:
        """
        Changes the terms of the task from the next plan on. Ignores them and returns False if their
        number is not that of the task, or if one of them does not fit the model or has a number
        that is not finite.
        """

    def wait_for_plan(self, count: int, timeout: float | None = None) -> None:
        """
        Waits until `count` plans were made since the beginning. Any thread may call it.

        Raises TimedOut; and once, the exception of a cost function, which has ended the planning.
        """

class GuideState:
    """
    Where a guided robot is and where it goes. Positions of joints are in rad, those of slides
    in m.

    Arrays of joints have the shape (num_joints,), arrays of frames (number of frames, 3).
    """

    @property
    def step(self) -> int:
        """Step of the newest measurement; -1 before step 0."""

    @property
    def mode(self) -> str:
        """
        What the robot does: "hold", "move_joints", "move_frame", "float" or "home".
        """

    @property
    def joints(self) -> numpy.typing.NDArray[numpy.float64]:
        """Measured positions."""

    @property
    def reference_joints(self) -> numpy.typing.NDArray[numpy.float64]:
        """Where the joints should be now."""

    @property
    def target_joints(self) -> numpy.typing.NDArray[numpy.float64]:
        """Where the joints should end."""

    @property
    def frames(self) -> numpy.typing.NDArray[numpy.float64]:
        """Points that follow from `joints` [m]."""

    @property
    def reference_frames(self) -> numpy.typing.NDArray[numpy.float64]:
        """Points that follow from `reference_joints` [m]."""

    @property
    def target_frames(self) -> numpy.typing.NDArray[numpy.float64]:
        """Points that follow from `target_joints` [m]."""

    @property
    def tips(self) -> numpy.typing.NDArray[numpy.float64]:
        """`frames`, for the tips of a TriFinger."""

    @property
    def reference_tips(self) -> numpy.typing.NDArray[numpy.float64]:
        """`reference_frames`, for the tips of a TriFinger."""

    @property
    def target_tips(self) -> numpy.typing.NDArray[numpy.float64]:
        """`target_frames`, for the tips of a TriFinger."""

    @property
    def has_arrived(self) -> bool:
        """
        The robot has reached all setpoints so far and rests at their target. Always False while
        floating.
        """

    @property
    def refusal(self) -> str:
        """
        One sentence per frame or joint whose last setpoint cannot be reached: what is done instead,
        and why. For a point it comes up to tens of milliseconds after `mode`.
        """

class Guide:
    """
    Lets slow callers steer a robot that must hear from its controller every millisecond.

    A thread of its own drives the robot in every step. It follows the newest setpoints of any
    number of threads and never waits for them. The safety checks of the robot apply as always.
    At first the robot holds the pose in which it is found.

    Any thread may call any function at any time. After a fork only the parent's guide is
    usable: in the child all functions raise InheritedHandle.

    A `with` block calls finish() at its end, also after an exception, which it keeps. trifinger.guide()
    makes a guide of a running robot by its name.
    """

    def __init__(self, frontend: Frontend, *, frames: Sequence[str] = (), joint_speed: float = 1.0, joint_acceleration: float = 5.0, tip_speed: float = 0.15, max_lead: float = 0.15, scheduling: str = 'try') -> None:
        """
        Drives the robot of `frontend`, which must control it. Until the guide has ended, nobody else can
        append actions with `frontend`; everybody can read.

        `frames` are the frames that move_frame() can move: names of sites, bodies or geoms of the robot's
        model, 8 at most; by default the tips of a TriFinger, or the ends of a robot from a file.

        `joint_speed` [rad/s] and `joint_acceleration` [rad/s^2] limit how joints move, `tip_speed` [m/s] how
        frames move. `max_lead` [rad] is how far a joint's reference may be ahead of the joint. For a joint
        that slides, 0.1 m counts as 1 rad. `scheduling` says whether the guide's thread must have real-time
        priority: "require", "try" or "off".
        """

    @property
    def num_joints(self) -> int:
        """Number of joints."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of actions."""

    @property
    def joint_units(self) -> tuple[str, ...]:
        """
        The unit of each joint's position: "rad", or "m" of a joint that slides.
        """

    @property
    def soft_lower(self) -> numpy.typing.NDArray[numpy.float64]:
        """Lower soft limits of the joints [rad], [m]."""

    @property
    def soft_upper(self) -> numpy.typing.NDArray[numpy.float64]:
        """Upper soft limits of the joints [rad], [m]."""

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Names of the frames that move_frame() moves."""

    @property
    def num_fingers(self) -> int:
        """Number of frames; of a TriFinger that of its fingers."""

    @property
    def frontend(self) -> Frontend:
        """The front-end of the robot, for reading."""

    @property
    def realtime_warnings(self) -> list[str]:
        """
        What keeps the guide's thread from being a real-time thread: sentences with the remedies.
        """

    def move_frame(self, frame: int | str, position: numpy.typing.ArrayLike) -> None:
        """
        Moves a frame on a straight line to `position` in the world frame [m]. If the frame cannot
        get there, it goes near it: see `GuideState.refusal`. Joints of other frames keep their
        targets.

        A setpoint returns at once. It replaces earlier ones for the same frames and joints.

        Raises InvalidArgument for numbers that are not finite, a frame that does not exist, or
        after the end of the guide; otherwise what ended the guide.

        A frame is given by number or by name.
        """

    def move_tip(self, finger: int, position: numpy.typing.ArrayLike) -> None:
        """`move_frame` for the tip of a finger."""

    def move_joints(self, positions: numpy.typing.ArrayLike) -> None:
        """
        Moves all joints to `positions` [rad], [m]. Positions beyond soft limits are clamped: see
        `GuideState.refusal`.

        Raises like `move_frame`.
        """

    def move_joint(self, joint: int | str, position: float) -> None:
        """
        `move_joints` for one joint. The other joints keep their targets. If it moves a frame that
        is on its way to a point, this frame gives up its point, and so do frames that share joints
        with it.

        Raises like `move_frame`.

        A joint is given by number or by name.
        """

    def home(self) -> None:
        """
        Moves to the robot's initial pose.

        Raises like `move_frame`.
        """

    def hold(self) -> None:
        """
        Brakes and keeps the pose.

        Raises like `move_frame`.
        """

    def float_freely(self) -> None:
        """
        Lets a hand move the robot: motors carry its weight and overcome the friction that its model
        knows. The robot's safety damping (`safety_kd`) still acts, and its soft limits push back.

        Raises like `move_frame`; InvalidArgument if the robot's motors refuse torques.
        """

    def state(self, timeout: float | None = None) -> GuideState:
        """
        Returns where the robot is. Waits for the first measurement: a robot may first be homing.

        Raises what ended the guide before its first measurement, TimedOut.
        """

    def wait_until_arrived(self, timeout: float | None = None) -> None:
        """
        Waits until the robot rests at the target of all setpoints so far.

        Raises InvalidArgument if the robot floats, what ended the guide, TimedOut.
        """

    def is_running(self) -> bool:
        """True until the guide has ended, for whatever reason."""

    def check(self) -> None:
        """
        Throws what ended the guide, if that was a fault.

        Raises RobotStopped, or another error of the guide's thread.
        """

    def finish(self, timeout: float | None = 5.0) -> None:
        """
        Brakes, ends the session in an orderly way and waits for this. Does nothing more if the
        guide has ended.

        Raises what ended the guide, if that was a fault; TimedOut if the back-end does not answer:
        the guide has then ended, and its session may not have.
        """

    def stop(self, timeout: float | None = 2.0) -> None:
        """
        Ends the session at once, whatever other calls wait for; the robot then stops as its driver
        does. Faults are left to `check`.

        Raises TimedOut like `finish`.
        """

    def __enter__(self) -> Guide: ...

    def __exit__(self, type: type[BaseException] | None, value: BaseException | None, traceback: types.TracebackType | None) -> None: ...

def guide(name: str, *, frames: Sequence[str] = (), joint_speed: float = 1.0, joint_acceleration: float = 5.0, tip_speed: float = 0.15, max_lead: float = 0.15, scheduling: str = 'try', timeout: float | None = 5.0) -> Guide:
    """
    Takes control of the robot `name`, which runs in a back-end of its own (`trifinger run`), and
    guides it: see Guide.

        with trifinger.guide("sim") as guide:
            guide.move_tip(0, (0.0, 0.1, 0.08))
            guide.wait_until_arrived()

    `timeout` is how long to wait for a session that is about to begin [s].

    `frames` are the frames that move_frame() can move: names of sites, bodies or geoms of the robot's
    model, 8 at most; by default the tips of a TriFinger, or the ends of a robot from a file.

    `joint_speed` [rad/s] and `joint_acceleration` [rad/s^2] limit how joints move, `tip_speed` [m/s] how
    frames move. `max_lead` [rad] is how far a joint's reference may be ahead of the joint. For a joint
    that slides, 0.1 m counts as 1 rad. `scheduling` says whether the guide's thread must have real-time
    priority: "require", "try" or "off".
    """

class Lens:
    """
    The lens of a camera in OpenCV's model: a pinhole, and radial and tangential distortion.

    Points are in the camera's frame: x right, y down, z forward. A pixel is (column, row), and
    (0, 0) is the centre of the first one.
    """

    def __init__(self, focal_length: numpy.typing.ArrayLike, principal_point: numpy.typing.ArrayLike, distortion: numpy.typing.ArrayLike = (0.0, 0.0, 0.0, 0.0, 0.0)) -> None: ...

    @property
    def focal_length(self) -> numpy.typing.NDArray[numpy.float64]:
        """Focal lengths [pixel]."""

    @property
    def principal_point(self) -> numpy.typing.NDArray[numpy.float64]:
        """Principal point [pixel]."""

    @property
    def distortion(self) -> numpy.typing.NDArray[numpy.float64]:
        """k1 k2 p1 p2 k3."""

    def unproject(self, pixels: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        The ray (x, y, 1) through a pixel: the inverse of `project`, to 1e-9 of the focal length
        within the part of the image plane where the distortion can be inverted.
        """

    def scaled(self, factor: float) -> Lens:
        """
        The lens of the same camera with images scaled by `factor`, such as 0.5 for half the size.
        """

    def cropped(self, left: int, top: int) -> Lens:
        """The lens of the part of the images that begins at this pixel."""

class Camera:
    """A calibrated camera."""

    def __init__(self, name: str, width: int, height: int, pixels: str, lens: Lens, pose: numpy.typing.ArrayLike, serial: str = 'any') -> None: ...

    @property
    def name(self) -> str:
        """For example "camera60"."""

    @property
    def serial(self) -> str:
        """The number of the device that is meant; "any" if nobody said it."""

    @property
    def width(self) -> int:
        """[pixel]"""

    @property
    def height(self) -> int:
        """[pixel]"""

    @property
    def pixels(self) -> str:
        """
        How the pixels of an image are stored, row by row without gaps, 8 bits per channel.
        """

    @property
    def lens(self) -> Lens:
        """
        The lens of a camera in OpenCV's model: a pinhole, and radial and tangential distortion.

        Points are in the camera's frame: x right, y down, z forward. A pixel is (column, row), and
        (0, 0) is the centre of the first one.
        """

    @property
    def pose(self) -> numpy.typing.NDArray[numpy.float64]:
        """Pose of the camera's frame in the world: z up, origin on the table."""

    def project(self, points: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Where points of the world are seen, a row for each [pixel]; NaN if a point is not in front of the camera.
        The pixel may lie outside the image.
        """

    def reduced(self, factor: int) -> Camera:
        """
        The same camera with smaller images, scaled by 1 / `factor`: 2 makes 270 of 540 pixels.

        Raises InvalidArgument if the size cannot be divided by it.
        """

    def resized(self, width: int) -> Camera:
        """
        The same camera with images of this width: the middle of its images, scaled by a whole
        number. 64 makes a pixel of 8 x 8, of the 512 x 512 in the middle of 540 x 540.

        Raises InvalidArgument if it is larger than that of the images, or below 1.
        """

class CameraCalibration:
    """
    The cameras of a robot as they were calibrated, in the order of its images.
    """

    def __init__(self, cameras: Sequence[Camera], date: str = '', residual: float = 0.0) -> None: ...

    @property
    def date(self) -> str:
        """When it was measured: "2026-11-22 21:50:00 UTC"; empty if unknown."""

    @property
    def residual(self) -> float:
        """Root mean square of what the calibration could not explain [pixel]."""

    @property
    def cameras(self) -> list[Camera]:
        """In the order of the robot's images."""

    def text(self) -> str:
        """Returns the text of a file, in YAML."""

    @staticmethod
    def read(path: str | os.PathLike[str]) -> CameraCalibration:
        """
        Reads the section or file of a calibration.

        Raises config.ConfigError at what makes no sense.
        """

    @staticmethod
    def file_of(robot: str) -> pathlib.Path:
        """
        The file with the calibration of the cameras of the robot `robot`: ROBOT.cameras.yml in the
        folder of calibrations, $TRIFINGER_CALIBRATION_DIR or ~/.config/trifinger/calibration.

        Raises InvalidArgument if the environment names no folder.
        """

class Policy:
    """
    A trained policy: it computes actions from observations, in C++ alone. Its file is of ONNX,
    or of our own format; docs/policies.md describes both.

    One policy must not be used by several threads at once: each needs its own.
    """

    def __init__(self, path: str | os.PathLike[str], *, precision: str = 'double') -> None:
        """
        Reads the file at `path`. Sums have 'double' or 'single' precision. 'single' takes about half the
        time and rounds as much as PyTorch does.
        """

    @staticmethod
    def from_layers(layers: Sequence[tuple[Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], str]], *, mean: Sequence[float] | None = None, variance: Sequence[float] | None = None, epsilon: float = 1e-08, clip: float = 10.0, low: Sequence[float] | None = None, high: Sequence[float] | None = None, bounding: str = 'scale', metadata: Mapping[str, str] = {}, precision: str = 'double') -> Policy:
        """
        Makes a policy from layers: weights with one row per output, bias, and 'identity', 'relu', 'tanh' or 'elu'.
        Inputs are normalised with `mean` and `variance`. Outputs are brought between `low` and `high`, by
        'scale' from -1 to 1, or by 'clip'. `trifinger.policy_file` makes policies from networks of PyTorch.
        """

    def save(self, path: str | os.PathLike[str]) -> None:
        """
        Writes the file at `path` in one step: an old file stays whole until the new one replaces
        it.

        Raises InvalidArgument if the metadata are not UTF-8 or too long, or the policy is of ONNX;
        OSError.
        """

    def __call__(self, observation: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Computes the action for `observation`. An array of float64 is read in place.
        """

    def reset(self) -> None:
        """Forgets earlier observations: an episode begins."""

    def __copy__(self) -> Policy: ...

    @property
    def has_state(self) -> bool:
        """
        True if an action depends on earlier observations, as that of GRU and LSTM does.
        """

    @property
    def num_inputs(self) -> int: ...

    @property
    def num_outputs(self) -> int: ...

    @property
    def layers(self) -> list[tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], str]]:
        """
        Weights with one row per output, bias and activation of each layer; none of ONNX.
        """

    @property
    def normalization(self) -> tuple[list[float], list[float], float, float] | None:
        """
        Mean, variance, epsilon and clip of the inputs. None if they are not normalised.
        """

    @property
    def precision(self) -> str:
        """Precision of the policy's sums: 'double' or 'single'."""

    @property
    def bounds(self) -> tuple[list[float], list[float], str] | None:
        """
        Bounds of the outputs: low, high, and 'scale' or 'clip'. None if there are no bounds.
        """

    @property
    def metadata(self) -> dict[str, str]:
        """
        Facts for the program that runs the policy. docs/policies.md lists the usual names.
        """

class Random:
    """
    Random numbers for robots, one series for each, which only the seed and the number of its
    episode decide.
    """

    @property
    def robots(self) -> numpy.typing.NDArray[numpy.int64]:
        """Places of these robots in their environment, from 0."""

    def __len__(self) -> int: ...

    def __getitem__(self, which: numpy.typing.ArrayLike) -> Random:
        """
        Those of some of the robots, by marks (bool) or indices: to draw again where a draw is not fit.
        """

    def uniform(self, low: numpy.typing.ArrayLike, high: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Numbers from `low` up to but not including `high`: one for each robot, or with k bounds a row of k
        numbers for each.
        """

    def normal(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        A normally distributed number with mean 0 and standard deviation 1 for each robot.
        """

    def integer(self, low: int, high: int) -> numpy.typing.NDArray[numpy.int64]:
        """An integer from `low` up to but not including `high` for each robot."""

class Episodes:
    """
    Makes a decision process of a robot: starts, goals, observations, rewards, ends. The same
    functions serve a robot that is driven through a front-end and thousands of simulations.

    The robot is a TriFinger, one of its fingers, or a robot from a file. The goals, points and
    rewards of fingers are then those of the frames that the option `frames` names.

    An environment is constant. Threads may share one, each with its own episodes.

    `trifinger.environments` uses it.
    """

    def __init__(self, task: object, options: str, config: str, overrides: dict[str, object]) -> None: ...

    def begin(self, seed: int, number: int) -> tuple[list[float], list[float], list[float], list[float], Variation, int, list[float]]:
        """
        Draws the beginning of episode `number` of `seed`. The same arguments give the same episode.

        Returns the joints [rad], the object's position [m], quaternion and velocity [m/s], the variation,
        the series of random numbers, and positions of the first hinges and slides of a robot from a file; NaN: as always.
        """

    def check_robot(self, configuration: str | None) -> None:
        """
        Refuses another robot than that of `config`, by its configuration if that is known, and takes
        the age of its poses from there.
        """

    @property
    def oldest_sure_age(self) -> int:
        """
        Age of a pose up to which it is sure; of a connected robot once it was checked [steps].
        """

    def approach(self, from_position: numpy.typing.ArrayLike) -> numpy.typing.NDArray[numpy.float64]:
        """
        Joint positions that bring a robot to where the episode begins: a row for each action [rad].
        """

    def step(self, robot: Frontend, numbers: numpy.typing.NDArray[numpy.float32], poses: Frontend | None, simulation: Simulation | None) -> tuple[int, float, bool, bool, bool, int]:
        """Applies an action, and looks at what follows it: `look`."""

    def look(self, robot: Frontend, t: int, poses: Frontend | None, simulation: Simulation | None) -> tuple[int, float, bool, bool, bool, int]:
        """
        Looks at what the robot measured at step `t`. `poses` is the companion with the poses of objects;
        `simulation` knows where they really are. Returns the step, reward, terminated, truncated, success
        and the age of the object's pose [steps], -1 if it was not found yet; the arrays below change.
        """

    @property
    def last_step(self) -> int:
        """
        Step of the robot that followed the last action, whatever the task said of it; -1: none.
        """

    @property
    def bodies(self) -> list[str]:
        """Names of the free bodies of a robot from a file."""

    @property
    def cameras(self) -> list[tuple[str, int, int]]:
        """Name, height and width of each camera that is observed."""

    @property
    def entries(self) -> list[tuple[str, str, list[float], list[float]]]:
        """
        The parts of an observation, in the order of `Layout.DICTIONARY`. Images are not among them:
        whoever has cameras adds these.

        Each is name, unit, low and high.
        """

    @property
    def hidden_entries(self) -> list[tuple[str, str, list[float], list[float]]]:
        """
        Entries that are not observed, for a critic (Pinto et al. 2018): where the object really is,
        how it moves, and what varies from robot to robot. Their numbers are in SI units.
        """

    @property
    def goal(self) -> tuple[str, str, list[float], list[float]]: ...

    @property
    def flat_names(self) -> list[str]: ...

    @property
    def episode_actions(self) -> int: ...

    @property
    def oldest_image_age(self) -> int:
        """Images that are older count as this old [steps]."""

    @property
    def judges_by_truth(self) -> bool:
        """
        True if a simulation shall judge the outcome by where the object really is, because its pose
        is not observed, or tracked.
        """

    @property
    def num_parts(self) -> int:
        """
        Number of parts of a goal that are judged one by one: one for each finger or frame if each
        has a goal of its own, else 1.
        """

    @property
    def has_goals_of_fingers(self) -> bool:
        """True if each finger or frame has a goal of its own."""

    @property
    def score_names(self) -> list[str]:
        """Names of the scores of the task."""

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

    @property
    def scores(self) -> numpy.typing.NDArray[numpy.float64]: ...

class EnvironmentBatch:
    """
    Many simulations of one decision process, each in an episode of its own. `Environment`
    computes the decision process and `Simulator` the physics, on the threads of MuJoCo's
    batches.

    Each simulation gives the same results, bit for bit, as an `Environment` with a simulation
    of its own, unless `set_reset_states` is used. One batch must not be used by several threads
    at once. In a forked child `reset` and `step` raise InheritedHandle.

    Simulations with cameras share one vision pipeline per thread. An image is drawn when an
    observation needs it.

    `trifinger.environments.VectorEnvironment` uses it.
    """

    def __init__(self, task: object, options: str, size: int, num_threads: int, physics_step: float, config: str, overrides: dict[str, object]) -> None: ...

    def __len__(self) -> int: ...

    @property
    def num_threads(self) -> int: ...

    @property
    def oldest_sure_age(self) -> int:
        """
        Age of the newest pose of the object just before the next one arrives [steps]. If it is
        older, poses were lost, or the tracker was not sure since then.
        """

    def first_finger(self, index: int) -> int:
        """
        `Environment.first_finger` of simulation `index`.

        Raises InvalidArgument if there is no such simulation.
        """

    def configuration(self, index: int) -> list[float]:
        """
        Positions and velocities of joints and objects of simulation `index` in MuJoCo's layout, to
        draw it: `qpos`, then `qvel`.

        Raises InvalidArgument if there is no such simulation.
        """

    def seed(self, index: int, seed: int, episode: int = 0) -> None:
        """
        Makes the next `reset` of simulation `index` begin this episode of `seed`. Each later reset
        begins the next episode.

        Raises InvalidArgument if there is no such simulation.
        """

    def reset(self, which: numpy.typing.NDArray[numpy.bool_] | None = None) -> None:
        """
        Begins an episode in the simulations that `which` marks with a number other than 0, or in
        all of them without marks.

        Raises InvalidArgument if `which` has another size.
        """

    def step(self, actions: numpy.typing.NDArray[numpy.float32], autoreset: str) -> None:
        """
        Applies one action in each simulation. `actions` has one row of numbers per simulation, as
        for `Environment.take_action`.

        Raises InvalidArgument if there are too many or too few numbers, or one is not finite; then
        nothing moves. Error if an image could not be drawn; then the episode of that simulation has
        ended, and the others have moved on. What a task of many raises; then all episodes have
        ended.

        The arrays below change.
        """

    def set_reset_states(self, position: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], torque: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], object: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], share: float) -> None:
        """
        Lets a share of the later episodes begin in one of these states, for a training. Not for
        tasks that remember where an episode has begun: they remember the start that was drawn.

        Raises InvalidArgument if a robot cannot begin in one of the states.

        Each array has a row for each state: joint positions, torques, and position [m] and
        quaternion (w, x, y, z) of the object, or no numbers where the task has none.
        """

    def set_physics(self, physics: Callable[[numpy.typing.NDArray[numpy.bool_], bool], None]) -> None:
        """
        Lets `physics` move the simulations, in place of MuJoCo. Motors, safety checks and the task
        stay those of this class. What `physics` raises, `step` raises; the episodes that were under
        way have then ended.

        Raises InvalidArgument if images are needed.

        `physics` gets marks of the simulations that it must move, and whether models have changed.
        The caller keeps it alive.
        """

    @property
    def memory(self) -> dict[str, NDArray[numpy.float64]]:
        """
        What other physics read and write: a row for each simulation. They do not write `ctrl`.
        """

    @property
    def substeps(self) -> int:
        """Steps of the model in each call of other physics."""

    @property
    def model_file(self) -> bytes:
        """
        The model as a file of MuJoCo, with all pairs of surfaces that may vary.
        """

    @property
    def varied_fields(self) -> list[str]:
        """
        What of the model may differ from simulation to simulation: names of fields of `mjModel`;
        none if nothing does.
        """

    def varied_field(self, name: str) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]:
        """
        One of these fields of all simulations, one after the other.

        Raises InvalidArgument if it is none of these.
        """

    @property
    def entries(self) -> list[tuple[str, str, list[float], list[float]]]:
        """
        The parts of an observation, in the order of `Layout.DICTIONARY`. Images are not among them:
        whoever has cameras adds these.

        Each is name, unit, low and high.
        """

    @property
    def hidden_entries(self) -> list[tuple[str, str, list[float], list[float]]]:
        """
        Entries that are not observed, for a critic (Pinto et al. 2018): where the object really is,
        how it moves, and what varies from robot to robot. Their numbers are in SI units.
        """

    @property
    def goal(self) -> tuple[str, str, list[float], list[float]]: ...

    @property
    def flat_names(self) -> list[str]: ...

    @property
    def episode_actions(self) -> int: ...

    @property
    def oldest_image_age(self) -> int:
        """Images that are older count as this old [steps]."""

    @property
    def judges_by_truth(self) -> bool:
        """
        True if a simulation shall judge the outcome by where the object really is, because its pose
        is not observed, or tracked.
        """

    @property
    def num_parts(self) -> int:
        """
        Number of parts of a goal that are judged one by one: one for each finger or frame if each
        has a goal of its own, else 1.
        """

    @property
    def has_goals_of_fingers(self) -> bool:
        """True if each finger or frame has a goal of its own."""

    @property
    def score_names(self) -> list[str]:
        """Names of the scores of the task."""

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
    def scores(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def final_scores(self) -> numpy.typing.NDArray[numpy.float64]: ...

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

    @property
    def object_age(self) -> numpy.typing.NDArray[numpy.int64]: ...

    @property
    def final_object_age(self) -> numpy.typing.NDArray[numpy.int64]: ...

    @property
    def hidden(self) -> numpy.typing.NDArray[numpy.float32]: ...

    @property
    def final_hidden(self) -> numpy.typing.NDArray[numpy.float32]: ...

    @property
    def image_age(self) -> numpy.typing.NDArray[numpy.float32]: ...

    @property
    def final_image_age(self) -> numpy.typing.NDArray[numpy.float32]: ...

    @property
    def cameras(self) -> list[tuple[str, int, int]]:
        """
        The cameras of each simulation that are observed; none without `Layout.IMAGES`.
        """

    @property
    def images(self) -> list[numpy.typing.NDArray[numpy.uint8]]: ...

    @property
    def final_images(self) -> list[numpy.typing.NDArray[numpy.uint8]]: ...

def task_names() -> list[str]:
    """Names of all tasks, for example "reach"."""

def num_processors() -> int:
    """
    Number of processors that the calling thread was given, at least 1: those of its affinity
    (taskset, cpusets of containers and of batch systems), but no more than the quota of its
    control groups, rounded up (`docker run --cpus`, `CPUQuota=` of systemd).
    """

def default_environment_options(task: str) -> str:
    """Default options of a task, as JSON."""

def environment_overrides(task: str | dict[str, object], options: str, config: str = 'trifinger_edu', config_overrides: dict[str, object] = {}) -> dict[str, object]:
    """
    The overrides with which a robot's configuration is that of an environment: those that its
    options (JSON) need, those of a task, and the user's own, which win. `task` is the name of a
    task in C++, or what one in Python needs of a TriFinger.
    """

def robot_of_task(task: str) -> str:
    """Name of the configuration of the robot that a task is usually for."""

def describe_environment_options() -> list[tuple[str, str, str, str]]:
    """Name, type, default (JSON) and meaning of each option."""

def limits_of_file_robot(config: str, config_overrides: dict[str, object] = {}) -> dict[str, dict[str, float]]:
    """
    What each joint of a robot from a file may do, whether its configuration or its file says it:
    keys and values of its section in `safety`. Empty for other robots.
    """

def robot_configuration(config: str, config_overrides: dict[str, object] = {}) -> str:
    """
    The whole text of a configuration, with what it extends and its overrides, as sessions have it.
    """

class StepsIterator:
    """Iterator that LoggedSession.chunks() returns."""

    def __iter__(self) -> StepsIterator: ...

    def __next__(self) -> trifinger.log.types.Steps: ...

class LoggedSession:
    """
    A session in a log. It belongs to a robot or to one of its companions. A companion has only
    observations and counts its own elements. Copies refer to the same log. Any number of
    threads may read.

        session = trifinger.Log("run.mcap").session("sim")
        session.observations["position"]             # all steps
        session.get_observations(1000, 2000)         # like those of a front-end
        session.get_observations(*session.between(1.5, 3.0), fields=("position",))
        for steps in session.chunks():               # a log larger than memory
            steps.time_index, steps.observations, steps.applied_actions
    """

    def __getstate__(self) -> tuple[object, str, int]: ...

    def __setstate__(self, arg: tuple[object, str, int], /) -> None: ...

    def __repr__(self) -> str: ...

    @property
    def name(self) -> str:
        """Name of the session, "sim", or "sim.object" for a companion."""

    @property
    def type(self) -> str:
        """Type of the robot, for example "trifinger", or of the companion."""

    @property
    def is_companion(self) -> bool: ...

    @property
    def session_id(self) -> int: ...

    @property
    def is_real_time(self) -> bool: ...

    @property
    def realtime_warnings(self) -> list[str] | None:
        """
        In real-time mode: what kept the loop from being a real-time thread, one sentence each. None
        if it was not recorded.
        """

    @property
    def period(self) -> float:
        """Length of the robot's steps [s]."""

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
        The documents that explain the robot, by name: "configuration.yml", "model.xml". Companions
        have none.

        Raises IncompatibleSession if the file is damaged.
        """

    @property
    def steps(self) -> int | None:
        """
        Number of whole steps of the session. None if it was still running when the recording ended.
        """

    @property
    def fault(self) -> trifinger.session_info.Fault | None:
        """
        Why the session ended; `None` if it was still running when the recording ended.
        """

    @property
    def fault_text(self) -> str:
        """The reason of `fault` as a sentence."""

    @property
    def gaps(self) -> list[trifinger.log.types.Gap]:
        """
        Elements that are missing in the range of the applied actions, because the recorder said so
        or because the file is damaged. Reads the whole log once.
        """

    @property
    def time_index(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        The whole steps that are in the log; for a companion, the numbers of its elements.
        """

    @property
    def times(self) -> numpy.typing.NDArray[numpy.datetime64]:
        """
        Times at which the observations were measured, by the wall clock (UTC).
        """

    def get_latest_at(self, t: int) -> Observation | None:
        """
        For companions: returns the newest element that arrived at or before the robot's step
        `t`. None if none had arrived by then.
        """

    def range(self, series: str) -> tuple[int, int]:
        """
        The first index of `series` in the log, and the first index after the last one. Observations
        and statuses may have one more element than actions: that of the end.
        """

    def between(self, begin: float, end: float) -> tuple[int, int]:
        """
        The range of the elements measured from `begin` to before `end`. Both count from the first
        element in the log.

        Both are in seconds.
        """

    def timing(self, first: int = 0, last: int | None = None) -> TimingRecord | None:
        """
        How well the session kept its time from step `first` to before `last`, including the status
        of its end. It equals the back-end's own record if no step is missing. None outside
        real-time mode, or if the statuses have another version. Reads all statuses.
        """

    def read(self, first: int | None = None, last: int | None = None, series: Mapping[str, Sequence[str] | None] | Sequence[str] | None = None) -> trifinger.log.types.Steps:
        """
        Reads the existing whole steps from `first` to before `last`.

        Reading several series at once takes no longer than reading one. `series` are names,
        "desired_action", "applied_action", "observation" and "status", or a dict of names and fields:
        `{"observation": ("position",), "status": None}`.
        """

    def chunks(self, count: int = 10000, first: int | None = None, last: int | None = None, series: Mapping[str, Sequence[str] | None] | Sequence[str] | None = None) -> StepsIterator:
        """
        Reads like read(), but `count` rows at a time, for a log larger than memory.
        """

    @property
    def companions(self) -> list[LoggedSession]:
        """The companions of a robot."""

    def companion(self, name: str) -> LoggedSession:
        """
        One companion, by "object" or its full name.

        Raises InvalidArgument with the existing names.
        """

    @property
    def units(self) -> dict[str, dict[str, str]]:
        """
        Units of the fields of each series: `units["observation"]["position"]` is "rad".
        """

    def to_pandas(self, first: int | None = None, last: int | None = None, series: Mapping[str, Sequence[str] | None] | Sequence[str] | None = None) -> pandas.DataFrame:
        """
        Reads like read() into a pandas.DataFrame: a row per step, a column per number, for
        example "observation.position[0]". Needs the extra "export".
        """

    def to_csv(self, path: str | os.PathLike[str], first: int | None = None, last: int | None = None, series: Mapping[str, Sequence[str] | None] | Sequence[str] | None = None) -> None:
        """
        Writes the table of to_pandas() to a CSV file, in parts, so that it may be larger than memory.
        """

    def to_parquet(self, path: str | os.PathLike[str], first: int | None = None, last: int | None = None, series: Mapping[str, Sequence[str] | None] | Sequence[str] | None = None) -> None:
        """Writes the table of to_pandas() to a Parquet file, in parts."""

    @property
    def observations(self) -> numpy.typing.NDArray[Observation]:
        """
        The elements of all whole steps: a row for each number in `time_index`. They are read at the
        first request and kept.
        """

    def get_observation(self, t: int) -> Observation:
        """Returns the element of step `t`. Raises NotInLog if it is missing."""

    def get_observations(self, first: int, last: int, fields: str | Sequence[str] | None = None) -> numpy.typing.NDArray[Observation]:
        """
        Returns the steps from `first` to before `last`, with only these `fields` if given. Row
        i is step `first + i`, so all steps must be in the log.

        If the session ended in step N, the log has an observation and a status N, but no actions N.
        """

    @property
    def desired_actions(self) -> numpy.typing.NDArray[Action]:
        """
        The elements of all whole steps: a row for each number in `time_index`. They are read at the
        first request and kept.
        """

    def get_desired_action(self, t: int) -> Action:
        """Returns the element of step `t`. Raises NotInLog if it is missing."""

    def get_desired_actions(self, first: int, last: int, fields: str | Sequence[str] | None = None) -> numpy.typing.NDArray[Action]:
        """
        Returns the steps from `first` to before `last`, with only these `fields` if given. Row
        i is step `first + i`, so all steps must be in the log.

        If the session ended in step N, the log has an observation and a status N, but no actions N.
        """

    @property
    def applied_actions(self) -> numpy.typing.NDArray[AppliedAction]:
        """
        The elements of all whole steps: a row for each number in `time_index`. They are read at the
        first request and kept.
        """

    def get_applied_action(self, t: int) -> AppliedAction:
        """Returns the element of step `t`. Raises NotInLog if it is missing."""

    def get_applied_actions(self, first: int, last: int, fields: str | Sequence[str] | None = None) -> numpy.typing.NDArray[AppliedAction]:
        """
        Returns the steps from `first` to before `last`, with only these `fields` if given. Row
        i is step `first + i`, so all steps must be in the log.

        If the session ended in step N, the log has an observation and a status N, but no actions N.
        """

    @property
    def statuses(self) -> numpy.typing.NDArray[StatusElement]:
        """
        The elements of all whole steps: a row for each number in `time_index`. They are read at the
        first request and kept.
        """

    def get_status(self, t: int) -> StatusElement:
        """Returns the element of step `t`. Raises NotInLog if it is missing."""

    def get_statuses(self, first: int, last: int, fields: str | Sequence[str] | None = None) -> numpy.typing.NDArray[StatusElement]:
        """
        Returns the steps from `first` to before `last`, with only these `fields` if given. Row
        i is step `first + i`, so all steps must be in the log.

        If the session ended in step N, the log has an observation and a status N, but no actions N.
        """

    @property
    def action_dtype(self) -> numpy.dtype[Action]:
        """The layout of an action."""

    @property
    def applied_action_dtype(self) -> numpy.dtype[AppliedAction]:
        """The layout of an applied action."""

    @property
    def observation_dtype(self) -> numpy.dtype[Observation]:
        """The layout of an observation."""

    @property
    def status_dtype(self) -> numpy.dtype[StatusElement]:
        """The layout of a status, the same for every robot."""

class Log:
    """
    A recording: one file, or all its parts.

    If the files are finished and whole, opening reads no messages. Damaged pieces are left out
    and named (`damage`, `lost_bytes`, and `gaps` of the sessions); everything else is read.

    `path` is a file, a list of its parts, or a folder, whose newest recording is taken.

    Raises Error if it is not a log or is one of a later version; InvalidArgument if a folder has no
    recording or the parts belong to several recordings; OSError.
    """

    def __init__(self, path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]) -> None: ...

    def __getstate__(self) -> tuple[object, dict[str, str]]: ...

    def __setstate__(self, arg: tuple[object, Mapping[str, str]], /) -> None: ...

    def __repr__(self) -> str: ...

    @property
    def files(self) -> list[pathlib.Path]:
        """The files, in the order of the parts."""

    @property
    def size(self) -> int:
        """Size of all files together [bytes]."""

    @property
    def is_finished(self) -> bool:
        """True if every file has the summary that is written at its end."""

    @property
    def origin(self) -> dict[str, str]:
        """
        The program and machine that wrote the log: "trifinger_version", "host", "kernel",
        "created". "began" orders the recordings of a folder, even if the clock was set back.
        """

    @property
    def sessions(self) -> list[LoggedSession]:
        """The sessions of robots, in the order in which they began."""

    def session(self, name: str = '') -> LoggedSession:
        """
        The newest session with steps of the robot or companion `name`. With an empty name, that of
        the only robot in the log.

        Raises InvalidArgument with the existing names.
        """

    @property
    def events(self) -> list[trifinger.log.types.Event]:
        """Messages for people. Reads the whole log once."""

    @property
    def damage(self) -> list[trifinger.log.types.Damage]:
        """Pieces of the files that could not be read. Reads the whole log once."""

    @property
    def lost_bytes(self) -> int:
        """
        Number of bytes of the files that could not be used. Reads the whole log once.
        """

class LoggedCameras:
    """
    The images in a log by the number of their element; trifinger.log.images is for users.
    """

    def __init__(self, session: LoggedSession) -> None: ...

    @property
    def calibration(self) -> str:
        """The text of the calibration."""

    @property
    def names(self) -> list[str]:
        """The names of the cameras, in the order of their images."""

    def range(self) -> tuple[int, int]:
        """The first element in the log, and the one after the last."""

    def has(self, index: int, camera: int) -> bool:
        """True if the log has the image."""

    def times(self, index: int) -> list[int]:
        """The middle of each exposure, since 1970 [ns]."""

    def recorded(self, index: int, camera: int) -> tuple[str, bytes]:
        """The encoding of the image in the log, and its bytes."""

    def file(self, index: int, camera: int) -> tuple[str, bytes]:
        """
        The image as a file, ".jpg" as it was recorded or ".png", and its bytes.
        """

    def pixels(self, index: int, camera: int) -> numpy.typing.NDArray[numpy.uint8]:
        """The pixels in the format of the camera."""

    def rgb(self, index: int, camera: int) -> numpy.typing.NDArray[numpy.uint8]:
        """The image in RGB."""

    def index_at(self, t: int) -> int | None:
        """The newest element that had arrived at the robot's step `t`."""

    def find(self, time: int) -> int | None:
        """The first element that arrived at or after this time, since 1970 [ns]."""

class LiveChannel:
    """Messages of one topic and one type."""

    @property
    def topic(self) -> str:
        """For example "/sim/step"."""

    @property
    def type(self) -> str:
        """For example "trifinger_msgs/msg/TrifingerStep"."""

    @property
    def definition(self) -> str:
        """The text of the schema ("ros2msg"), with the types that it uses."""

    @property
    def is_latched(self) -> bool:
        """
        True if viewers that come later need the newest message of each `part`: it will not come
        again.
        """

    @property
    def is_image(self) -> bool:
        """True if these messages only come while images are wanted."""

class LiveMessage:
    """A message in CDR, with the bytes that a log of the same session has."""

    @property
    def channel(self) -> int:
        """Its number in `channels()`."""

    @property
    def log_time(self) -> int:
        """Time since 1970 [ns], as in a log."""

    @property
    def part(self) -> int:
        """Only latched channels have more than part 0."""

    @property
    def data(self) -> bytes:
        """The message in CDR, little endian, with its header of four bytes."""

class LiveBatch:
    """What is new since the call before."""

    @property
    def messages(self) -> list[LiveMessage]:
        """In the order of each channel."""

    @property
    def events(self) -> list[trifinger.log.types.Event]:
        """The same sentences are messages of the topic "/events"."""

    @property
    def lost(self) -> int:
        """
        Number of messages that were left out, because the reader was late or the robot too fast.
        """

class LiveMessages:
    """
    Observes a robot for other programs: gives the messages that a log would have, as soon as
    they can be made. It shows the current session of the robot and those that follow.

    It only reads, so the robot notices nothing. If the reader is late, it continues with what
    is newest. There is at most a second of messages in one batch.

    Times of a session in real-time mode may differ from those in a log by the microseconds with
    which each of them measured the offset of the clocks.
    """

    def __init__(self, name: str, *, rate: float = 100.0, viewer_rate: float = 30.0, jpeg_quality: int = 80) -> None:
        """
        Begins to look for the robot `name`, which need not run yet.

        `rate` is the number of steps, and of elements of each companion, per second of the robot's time
        (0: all), `viewer_rate` that of the poses of links for 3D viewers (0: none), `jpeg_quality` that of
        images, 1 to 100. Raises InvalidArgument if `name` is a companion's or a number is out of range.
        """

    def take(self) -> LiveBatch:
        """
        Returns what is new. Never waits for the robot; call it some 50 times per second.

        Raises InvalidArgument if no robot can have this name.
        """

    @property
    def channels(self) -> list[LiveChannel]:
        """
        All channels so far; more may come with each batch. If two have the same topic, the later
        one counts: the next session has another type.
        """

    def want_images(self, wanted: bool) -> None:
        """
        Says whether somebody looks at images. Only then are they copied and compressed, which takes
        some milliseconds of a processor per image. At the beginning nobody does.
        """

    @property
    def is_running(self) -> bool:
        """True if a session is shown that has not ended."""

def replay(log: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | Log | LoggedSession, *, robot: str = '', first: int | None = None, last: int | None = None, strict: bool = True) -> Frontend:
    """
    Plays a session of a log as if it were the robot, inside the waits of the front-end.

    Observations, companions and applied actions are those of the log, whatever the user does. If a
    desired action differs from the logged one, the status of the step has the flag ACTION_REJECTED.
    After the last step the session ends with the fault "exhausted". It needs no recovery, and finish()
    does not raise because of it.

    `log` may be a session; otherwise the newest session of `robot` is played. `robot` is needed if the
    log has several robots. The steps from `first` to before `last` are played, `first` as step 0;
    default: all.

    Raises NotInLog if a step is missing in the log, InvalidArgument.
    """

def balanced_blocks(image: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu', writable=False)]) -> numpy.typing.NDArray[numpy.float64]:
    """
    The mean red, green and blue of each block, 0 to 255, with a white balance that makes most
    of the image grey.

    Raises InvalidArgument if the image has no colours, or another size than its format says.
    """

def faces_in_blocks(calibration: str, object: TrackedObject, position: numpy.typing.ArrayLike, orientation: numpy.typing.ArrayLike) -> list[list[int]]:
    """
    For each block of a camera's image the index of the face that it shows if the object has
    this `pose`, or a `BlockContent`. Whatever stands in front of the object is not known.
    """

class TrackedObject:
    """A convex object whose faces have known colours."""

    @property
    def name(self) -> str: ...

    @property
    def colours(self) -> list[str]:
        """The colour of each face."""

def coloured_box(name: str, size: numpy.typing.ArrayLike, colours: Sequence[str] = ..., rim: float = 0.0) -> TrackedObject:
    """
    A box with whole lengths `size` [m]. The colour of a face ends `rim` before its edges [m];
    the rest is dark.

    Raises InvalidArgument if the rim leaves nothing of a face.
    """

def tracked_object(config: str = 'sim', overrides: dict[str, object] = {}, name: str = 'cube') -> TrackedObject:
    """
    An object of a scene as the simulation draws it: boxes have colours and rims.

    Raises InvalidArgument if it has no faces with different colours, like a stick or a ball.
    """

def coloured_mesh(name: str, vertices: Sequence[Sequence[float]], triangles: Sequence[Sequence[int]], colours: Sequence[str]) -> TrackedObject:
    """
    A convex mesh: the hull of `vertices` [m], whose triangles have colours. Triangles of one
    colour in one plane become one face.

    Raises InvalidArgument if a triangle has no area or the mesh is not convex.
    """

class Estimate:
    """Where an object is, as images show it."""

    @property
    def is_sure(self) -> bool: ...

    @property
    def is_found(self) -> bool: ...

    @property
    def position(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def orientation(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def position_deviation(self) -> numpy.typing.NDArray[numpy.float64]:
        """Standard deviations [m]."""

    @property
    def rotation_deviation(self) -> numpy.typing.NDArray[numpy.float64]:
        """Standard deviations of a rotation about the world's axes [rad]."""

    @property
    def confidence(self) -> float:
        """Confidence from 0 to 1, at least 0.5 if the state is `SURE`."""

    @property
    def cameras(self) -> int:
        """Cameras that show the object."""

    @property
    def faces(self) -> int:
        """Faces that at least one camera shows."""

    @property
    def residual(self) -> float:
        """Root mean square distance of measured from expected edges [pixel]."""

class Tracker:
    """
    Finds an object with coloured faces in the images of calibrated cameras, taken at one time.

    Knows nothing of earlier images: the same images give the same estimate. Not thread-safe.
    """

    def __init__(self, calibration: str, object: TrackedObject, colours: str | None = None, calibration_error: float = 0.5) -> None: ...

    def track(self, images: Sequence[NDArray[numpy.uint8] | None], guess: tuple[numpy.typing.ArrayLike, numpy.typing.ArrayLike] | None = None) -> Estimate:
        """
        Where the object is in these images, one of each camera. An empty image stands for one that
        is missing or damaged. `guess` is where the object may be, such as its last pose. It saves
        time if it is near, and it is forgotten if the images do not confirm it or if a number in it
        is not finite. Does not allocate.

        Raises InvalidArgument if the number of images or the size of one is wrong.
        """
