# SPDX-License-Identifier: BSD-3-Clause
"""The series of robots that run in back-ends of their own, by the original's names and rules.

A back-end is `trifinger run`, started by whoever creates it here or by an operator. What the
original calls the data of a robot is the name of its session.
"""

import os
import subprocess
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, ClassVar

import trifinger
from trifinger.commands import program
from trifinger.errors import (
    Error,
    HistoryLost,
    RobotStopped,
    SessionNotFound,
    TimedOut,
)
from trifinger.log.original import error_status_of, tip_forces_of

from trifinger_compat import notes
from trifinger_compat.clock import SINCE_1970
from trifinger_compat.generic import ErrorStatus, RobotBackendTerminationReason, Status
from trifinger_compat.types import ActionLike
from trifinger_compat.world import CONFIGURATIONS

VARIABLE = "TRIFINGER_COMPAT_ROBOT"
_numbers = iter(range(1 << 62))


def session_name(prefix: str) -> str:
    """The session that a program means by "trifinger" or "finger".

    TRIFINGER_COMPAT_ROBOT names another. If nothing of that name runs, but one robot of that type
    does, it is meant.
    """
    if prefix not in ("trifinger", "finger"):
        return prefix
    if chosen := os.environ.get(VARIABLE):
        return chosen
    alive = [info for info in trifinger.list_sessions() if info.backend_is_alive]
    of_type = [info.name for info in alive if info.type == prefix and not info.is_companion]
    is_there = any(info.name == prefix for info in alive)
    return of_type[0] if len(of_type) == 1 and not is_there else prefix


class TimeSeries:
    """One of the series of a robot, for reading."""

    def __init__(self, data: "BaseData", name: str, convert: Callable[[Any], Any]) -> None:
        self._data, self._name, self._convert = data, name, convert
        self._get = f"get_{name}"
        self._tag = -1

    @property
    def _robot(self) -> trifinger.Frontend:
        return self._data.robot

    def newest_timeindex(self, wait: bool = True) -> int:
        """Index of the newest element; waits for the first one, or is -1."""
        if wait:
            self._robot.wait_until_time_index(0)
        return self._robot.range(self._name)[1] - 1

    def oldest_timeindex(self, wait: bool = True) -> int:
        """Index of the oldest element that can be read; waits for the first one, or is -1."""
        return self._robot.range(self._name)[0] if self.newest_timeindex(wait) >= 0 else -1

    def newest_element(self) -> Any:
        """The newest element; waits for the first one."""
        return self.get(self.newest_timeindex())

    def get(self, t: int) -> Any:
        """Element `t`; waits for it. ValueError if it was overwritten."""
        return self._convert(_translated(getattr(self._robot, self._get), t))

    __getitem__ = get

    def timestamp_ms(self, t: int) -> float:
        """When element `t` was written, since 1970 [ms]."""
        return self._data.timestamp_ms(t)

    def timestamp_s(self, t: int) -> float:
        """When element `t` was written, since 1970 [s]."""
        return self.timestamp_ms(t) / 1000

    def wait_for_timeindex(self, t: int, max_duration_s: float = float("inf")) -> bool:
        """Waits for element `t`; False if it has not come in time."""
        limit = None if max_duration_s == float("inf") else max(0.0, max_duration_s)
        try:
            getattr(self._robot, self._get)(t, timeout=limit)
        except TimedOut:
            return False
        except HistoryLost:
            pass
        return True

    def count_appended_elements(self) -> int:
        """Number of elements so far, also of those that were overwritten."""
        return self._robot.range(self._name)[1]

    def length(self) -> int:
        """Number of elements that can be read."""
        first, end = self._robot.range(self._name)
        return end - first

    __len__ = length

    def max_length(self) -> int:
        """Number of elements that are kept."""
        return self._data.history_size

    def is_empty(self) -> bool:
        """True before the first element."""
        return self.count_appended_elements() == 0

    def append(self, element: Any) -> None:
        """Raises RuntimeError: only the back-end writes these series."""
        del element
        raise RuntimeError("only the back-end writes this series; use Frontend for actions")

    def tag(self, t: int) -> None:
        """Remembers an index."""
        self._tag = t

    def tagged_timeindex(self) -> int:
        """The index that was remembered; -1 if there is none."""
        return self._tag

    def has_changed_since_tag(self) -> bool:
        """True if the newest element is another one than the one remembered."""
        return self.newest_timeindex(wait=False) != self._tag


def _translated(get: Callable[..., Any], t: int) -> Any:
    """Element `t`, waiting without a limit; errors are those of the original."""
    if t < 0:
        raise ValueError(f"the time index is {t}, must not be negative")
    try:
        return get(int(t))
    except HistoryLost as error:
        raise ValueError(str(error)) from error


class BaseData:
    """The series of a robot."""

    session_type: ClassVar[str] = ""  # of the robots that have these series; empty: any
    action_class: ClassVar[Any]
    observation_class: ClassVar[Any]

    def __init__(self, name: str, is_master: bool, history_size: int) -> None:
        self.name, self.is_master, self.history_size = name, is_master, history_size
        self._robot: trifinger.Frontend | None = None
        self._controls = False
        self._lock = threading.Lock()
        self.desired_action = TimeSeries(self, "desired_action", self.to_action)
        self.applied_action = TimeSeries(self, "applied_action", self.to_action)
        self.observation = TimeSeries(self, "observation", self.to_observation)
        self.status = TimeSeries(self, "status", to_status)

    @property
    def robot(self) -> trifinger.Frontend:
        """This project's view of the robot; waits for the back-end of this process."""
        with self._lock:
            if self._robot is None:
                self._robot = self._attach(trifinger.observe)
            return self._robot

    def controlled(self) -> trifinger.Frontend:
        """The same with the right to append actions; waits like `robot`."""
        with self._lock:
            if self._robot is None or not self._controls:
                self._robot = self._attach(trifinger.connect)
                self._controls = True
            return self._robot

    def _session(self) -> trifinger.SessionInfo | None:
        return next(
            (
                info
                for info in trifinger.list_sessions()
                if info.name == self.name and info.backend_is_alive
            ),
            None,
        )

    def is_available(self, process: int | None = None) -> bool:
        """True if a back-end runs; only the one with this process id counts if it is given."""
        info = self._session()
        return info is not None and process in (None, info.backend_pid)

    def require_type(self) -> None:
        """Raises RuntimeError if the robot of this name is of another type."""
        info = self._session()
        if info is not None and self.session_type not in ("", info.type):
            raise RuntimeError(
                f"the robot '{self.name}' is of the type '{info.type}', must be "
                f"'{self.session_type}' for this program; name another one with {VARIABLE}, or "
                "control this one with trifinger.connect()"
            )

    def _attach(self, how: Callable[[str], trifinger.Frontend]) -> trifinger.Frontend:
        # Before it is controlled, since letting go would end its session.
        self.require_type()
        try:
            return how(self.name)
        except SessionNotFound:
            # The master exists before its back-end: only here it is worth waiting.
            if not self.is_master:
                raise
        while not self.is_available():
            time.sleep(0.01)
        self.require_type()
        return how(self.name)

    def detach(self) -> None:
        """Lets go, so that another program can control the robot."""
        with self._lock:
            if self._robot is not None:
                self._robot.close()
            self._robot, self._controls = None, False

    def timestamp_ms(self, t: int) -> float:
        """When step `t` was measured, since 1970 [ms]; waits for it."""
        robot = self.robot
        if robot.range("status")[1] <= t:
            _translated(robot.get_observation, t)
        if robot.range("status")[1] > t:
            nanoseconds = int(_translated(robot.get_status, t)["time"])
        else:  # the step has begun, and its status comes with its end
            nanoseconds = time.monotonic_ns()
            if t > 0 and robot.session_info().is_real_time:
                period = robot.session_info().period
                nanoseconds = int(robot.get_status(t - 1)["time"]) + round(period * 1e9)
        return (nanoseconds * 1e-9 + SINCE_1970) * 1000

    def to_action(self, element: Any) -> Any:
        """An action as the original has it."""
        names = ("torque", "position", "position_kp", "position_kd")
        return self.action_class(*(element[name] for name in names))

    def to_observation(self, element: Any) -> Any:
        """An observation as the original has it: tip forces are from 0 to 1."""
        observation = self.observation_class()
        observation.position = element["position"]
        observation.velocity = element["velocity"]
        observation.torque = element["torque"]
        if self.observation_class.TIPS:
            observation.tip_force = tip_forces_of(element["tip_force"])
        return observation


def to_status(element: Any) -> Status:
    """A status as the original has it."""
    status = Status()
    status.action_repetitions = int(element["action_repeats"])
    error = ErrorStatus(int(error_status_of(element["fault_code"])))
    if error is not ErrorStatus.NO_ERROR:
        status.set_error(error, f"fault {int(element['fault_code'])}")
    return status


class SingleProcessData(BaseData):
    """The series of a robot whose back-end belongs to this program."""

    def __init__(self, history_size: int = 1000) -> None:
        name = f"compat-{os.getpid()}-{next(_numbers)}"
        super().__init__(name, is_master=True, history_size=history_size)


class MultiProcessData(BaseData):
    """The series of a robot by its name, for all programs."""

    def __init__(
        self, shared_memory_id_prefix: str, is_master: bool, history_size: int = 1000
    ) -> None:
        """Raises RuntimeError if this is not the master, and no such robot of this type runs."""
        prefix = shared_memory_id_prefix.strip("/_") or "trifinger"
        name = prefix if is_master else session_name(prefix)
        super().__init__(name, is_master, history_size)
        if not is_master and not self.is_available():
            # Says which robots there are.
            trifinger.observe(name)
        if not is_master:
            self.require_type()


class RobotFrontend:
    """Appends actions and reads what happened. Reads wait without a limit."""

    def __init__(self, robot_data: BaseData) -> None:
        self._data = robot_data
        self._desired: Any = None
        self._limit = 0
        self._next = 0

    def append_desired_action(self, action: ActionLike) -> int:
        """Appends an action and returns the step at which it will act.

        Raises RuntimeError if the robot has stopped. After the last action that it takes, waits
        until it stops.
        """
        robot = self._data.controlled()
        if self._desired is None:
            self._desired = robot.new_action()
            self._limit = notes.max_actions(self._data.name, robot.session_info().backend_pid)
        desired = self._desired
        desired["torque"] = action.torque
        desired["position"] = action.position
        desired["position_kp"] = action.position_kp
        desired["position_kd"] = action.position_kd
        try:
            if self._is_full():
                robot.finish()  # waits until the last action has acted
            t = robot.append_desired_action(desired)
        except RobotStopped as error:
            raise RuntimeError(self._why(error)) from error
        self._next = t + 1
        if self._is_full():
            with suppress(TimedOut, RobotStopped):
                robot.finish(timeout=0)
        return t

    def _is_full(self) -> bool:
        return 0 < self._limit <= self._next

    def _why(self, error: RobotStopped) -> str:
        if error.fault is not None and error.fault.code == "finished":
            return "Maximum number of actions reached."
        is_driver = error.fault is not None and error.fault.code.startswith("driver")
        return f"{'Driver' if is_driver else 'Backend'} Error: {error}"

    def get_observation(self, t: int) -> Any:
        """Measurements of step `t`; waits for them. ValueError if they were overwritten."""
        return self._data.to_observation(_translated(self._data.robot.get_observation, t))

    def get_desired_action(self, t: int) -> Any:
        """The action that was asked for in step `t`; waits for it."""
        return self._data.to_action(_translated(self._data.robot.get_desired_action, t))

    def get_applied_action(self, t: int) -> Any:
        """The action that acted in step `t`; waits for it."""
        return self._data.to_action(_translated(self._data.robot.get_applied_action, t))

    def get_status(self, t: int) -> Status:
        """The status of step `t`; waits for it."""
        return to_status(_translated(self._data.robot.get_status, t))

    def get_timestamp_ms(self, t: int) -> float:
        """When step `t` was measured, since 1970 [ms]; waits for it."""
        return self._data.timestamp_ms(t)

    def get_current_timeindex(self) -> int:
        """The newest step; waits for the first one."""
        self._data.robot.wait_until_time_index(0)
        return self._data.robot.current_time_index()

    def wait_until_timeindex(self, t: int) -> None:
        """Waits until step `t` was measured."""
        self._data.robot.wait_until_time_index(t)

    wait_until_time_index = wait_until_timeindex


class RobotBackend:
    """A robot in a process of its own, `trifinger run`. It ends after its first session."""

    def __init__(
        self,
        robot_data: BaseData,
        config: str,
        overrides: dict[str, object] | None = None,
        *,
        real_time: bool = True,
        first_action_timeout: float = float("inf"),
        max_number_of_actions: int = 0,
        record: str | None = None,
    ) -> None:
        """Starts the robot of a configuration; `first_action_timeout` [s].

        Raises RuntimeError if a robot of this name runs already, or if this one cannot begin.
        """
        name = robot_data.name
        if robot_data.is_available():
            raise RuntimeError(
                f"a robot '{name}' runs already; stop it with `trifinger stop {name}`, or choose "
                "another name"
            )
        self._data = robot_data
        self._max_actions = max_number_of_actions
        self._reason = RobotBackendTerminationReason.NOT_TERMINATED
        self._first_signal = threading.Lock()  # whoever gets it sends the signal
        values: dict[str, object] = {
            "backend.history": max(16384, robot_data.history_size),
            "backend.late_action.policy": "repeat",
            "backend.late_action.max_repeats": 1000000,
            **(overrides or {}),
        }
        if first_action_timeout != float("inf"):
            values["backend.first_action_timeout"] = first_action_timeout
        words = [program.path(), "run", config, "--name", name]
        words += ["--real-time" if real_time else "--non-real-time"]
        words += ["--with-process", str(os.getpid())]
        for key, value in values.items():
            words += ["--set", f"{key}={value}"]
        if record is not None:
            words += ["--record", record, "--images", "raw"]
        if max_number_of_actions:
            notes.write(name, max_number_of_actions)
        self._process = subprocess.Popen(words, stdout=subprocess.DEVNULL, start_new_session=True)
        try:
            self._wait_until_it_runs()
            self._robot = trifinger.observe(name)
        except BaseException:  # also Ctrl-C: nobody would end it later
            self._stop()
            raise
        self._watch = threading.Thread(target=self._watch_session, daemon=True)
        self._watch.start()

    def _wait_until_it_runs(self) -> None:
        # Another process may start a robot of this name at the same time.
        while not self._data.is_available(self._process.pid):
            if self._process.poll() is not None:
                raise RuntimeError(
                    f"the back-end '{self._data.name}' ended with the status "
                    f"{self._process.returncode} when it should begin"
                )
            time.sleep(0.01)

    def _watch_session(self) -> None:
        while self._process.poll() is None:
            fault = self._robot.fault()
            if fault is not None:
                self._end(fault.code)
                return
            if self._max_actions and self._robot.current_time_index() > self._max_actions:
                self._end("finished")
                return
            time.sleep(0.005)
        if self._reason is RobotBackendTerminationReason.NOT_TERMINATED:
            self._end("stopped")

    def _end(self, code: str) -> None:
        reasons = RobotBackendTerminationReason
        is_full = self._max_actions and self._robot.current_time_index() >= self._max_actions
        if code in ("finished", "stopped") and is_full:
            self._reason = reasons.MAXIMUM_NUMBER_OF_ACTIONS_REACHED
        elif code in ("finished", "stopped", "detached", "controller_died", "exhausted"):
            self._reason = reasons.SHUTDOWN_REQUESTED
        elif code == "first_action_late":
            self._reason = reasons.FIRST_ACTION_TIMEOUT
        elif code == "action_late":
            self._reason = reasons.NEXT_ACTION_TIMEOUT
        else:
            self._reason = reasons.DRIVER_ERROR
        self._stop()

    def ask_to_end(self) -> None:
        """Like request_shutdown(), without waiting: for handlers of signals."""
        if self._reason is RobotBackendTerminationReason.NOT_TERMINATED:
            self._reason = RobotBackendTerminationReason.SHUTDOWN_REQUESTED
        self._signal_once()

    def _signal_once(self) -> None:
        # A second signal would kill it, and its session would be left behind. Handlers of signals
        # call this, too: they must not wait for a lock that they interrupt.
        if self._first_signal.acquire(blocking=False):
            self._process.terminate()

    def _stop(self) -> None:
        self._signal_once()
        self._process.wait()
        notes.remove(self._data.name)

    def initialize(self) -> None:
        """Does nothing more: the robot is ready when this object exists."""

    def request_shutdown(self) -> None:
        """Brings the robot to rest and ends the back-end."""
        if self._reason is RobotBackendTerminationReason.NOT_TERMINATED:
            self._reason = RobotBackendTerminationReason.SHUTDOWN_REQUESTED
        self._stop()

    def wait_until_first_action(self) -> None:
        """Waits until the first action was applied, or until the back-end has ended."""
        try:
            self._robot.wait_until_time_index(1)
        except Error:  # the session ended before
            return

    def wait_until_terminated(self) -> int:
        """Waits until the back-end has ended and returns the reason."""
        self._process.wait()
        if threading.current_thread() is not self._watch:
            self._watch.join()
        return int(self._reason)

    def is_running(self) -> bool:
        """True until the back-end has ended."""
        return self._process.poll() is None

    def get_termination_reason(self) -> int:
        """Why the back-end has ended, a number of RobotBackendTerminationReason."""
        return int(self._reason)

    def __del__(self) -> None:
        if hasattr(self, "_watch") and self.is_running():
            self.request_shutdown()


def config_of(finger_type: str) -> str:
    """The configuration of a type of robot."""
    return CONFIGURATIONS[finger_type]
