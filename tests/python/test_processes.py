# SPDX-License-Identifier: BSD-3-Clause
"""Robots in other processes, and what happens when one of the processes does not behave."""

import itertools
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import StartChild

pytestmark = pytest.mark.bindings

CONTROLLER = """
import sys, trifinger
robot = trifinger.connect(sys.argv[1])
t = robot.append_desired_action(robot.new_action(setpoint=1.0))
robot.wait_until_time_index(t)
print("ready", flush=True)
sys.stdin.read()
"""


def step(robot: trifinger.Frontend, setpoint: float = 0.0) -> int:
    t = robot.append_desired_action(robot.new_action(setpoint=setpoint))
    robot.wait_until_time_index(t)
    return t


def test_the_basic_control_loop_runs_across_processes(start_fake: StartChild) -> None:
    start_fake("robot")
    with trifinger.connect("robot", strict=True) as robot:
        t = robot.append_desired_action(robot.new_action())
        for k in range(1000):
            y = robot.get_observation(t)
            assert y.applied_actions == k
            t = robot.append_desired_action(robot.new_action(setpoint=2 * k))
        robot.finish()
        assert robot.get_observations(2, 1001)["setpoint"].tolist() == [2 * k for k in range(999)]


def test_an_observer_sees_what_the_controller_does(start_fake: StartChild) -> None:
    start_fake("robot", sensor_period=1)
    observer = trifinger.observe("robot")
    sensor = trifinger.observe("robot.sensor")
    with trifinger.connect("robot") as robot:
        t = step(robot, 3.0)
        assert observer.get_desired_action(t).setpoint == 3.0
        reading = sensor.get_latest_at(t)
        assert reading is not None
        assert reading.applied_actions == 0
    with pytest.raises(trifinger.InvalidArgument, match=r"only observes; use connect\(\)"):
        observer.append_desired_action(observer.new_action())
    with pytest.raises(trifinger.RobotStopped, match="finished"):
        observer.get_observation(5)


def test_sessions_are_listed_with_their_companions(start_fake: StartChild) -> None:
    assert trifinger.list_sessions() == []
    child = start_fake("robot", sensor_period=1)
    robot, sensor = trifinger.list_sessions()
    assert (robot.name, robot.type, robot.is_companion) == ("robot", "fake", False)
    assert (sensor.name, sensor.type, sensor.is_companion) == ("robot.sensor", "fake_sensor", True)
    assert robot.backend_pid == child.pid
    assert robot.backend_is_alive
    assert robot.controller_pid is None
    with trifinger.connect("robot"):
        assert trifinger.list_sessions()[0].controller_pid == os.getpid()


# ---- bad input ----


def test_an_unknown_robot_is_an_error_that_names_those_there_are(start_fake: StartChild) -> None:
    start_fake("left")
    start_fake("right")
    with pytest.raises(
        trifinger.SessionNotFound, match=r"no robot 'lift'.*running: left, right.*trifinger run"
    ):
        trifinger.connect("lift")
    with pytest.raises(trifinger.SessionNotFound):
        trifinger.observe("lift")
    with pytest.raises(trifinger.SessionNotFound):
        trifinger.recover("lift")
    with pytest.raises(trifinger.SessionNotFound, match="no companion 'camera'"):
        trifinger.observe("left").companion("camera")


@pytest.mark.parametrize("name", ["", "a/b", "..", "a b", "a" * 100, "robot\n"])
def test_a_name_must_be_fit_for_a_file(name: str) -> None:
    with pytest.raises(trifinger.InvalidArgument, match="cannot name a robot"):
        trifinger.connect(name)
    with pytest.raises(trifinger.InvalidArgument, match="cannot name a robot"):
        trifinger.run_fake(name)


@pytest.mark.parametrize("content", [b"text", b"\0" * 65536, b"\xff" * 65536])
def test_a_file_that_is_no_session_is_an_error(session_folder: Path, content: bytes) -> None:
    (session_folder / "trifinger.robot.state").write_bytes(content)
    with pytest.raises(trifinger.IncompatibleSession):
        trifinger.connect("robot")
    assert trifinger.list_sessions() == []


def test_what_the_operating_system_refuses_is_an_os_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TRIFINGER_SESSION_DIR", "/nonexistent")
    with pytest.raises(FileNotFoundError, match="/nonexistent"):
        trifinger.run_fake("robot")


def test_fault_19_a_robot_has_one_controller(
    start_fake: StartChild, start_python: StartChild
) -> None:
    start_fake("robot")
    other = start_python(CONTROLLER, "robot")
    with pytest.raises(trifinger.ControlHeld, match=rf"process {other.pid}\b.*observe\(\)"):
        trifinger.connect("robot")
    other.finish()
    with (
        trifinger.connect("robot"),
        pytest.raises(trifinger.ControlHeld, match="another handle in this process"),
    ):
        trifinger.connect("robot")


def test_a_name_has_one_back_end(start_fake: StartChild) -> None:
    child = start_fake("robot")
    with pytest.raises(trifinger.RobotOwned, match=f"process {child.pid}"):
        trifinger.run_fake("robot")


def test_a_back_end_gives_its_name_back(start_fake: StartChild) -> None:
    first = trifinger.run_fake("robot")
    first.stop()
    first.stop()
    with trifinger.run_fake("robot"):
        step(trifinger.connect("robot"))
    assert trifinger.list_sessions() == []
    start_fake("robot")


@pytest.mark.parametrize("options", [{"period": 0.0}, {"period": -1.0}, {"period": float("nan")}])
def test_options_out_of_range_are_errors(options: dict[str, float]) -> None:
    with pytest.raises(trifinger.InvalidArgument):
        trifinger.run_fake("robot", **options)  # type: ignore[arg-type]


# ---- ends of sessions ----


def test_a_with_block_finishes_or_lets_go(start_fake: StartChild) -> None:
    start_fake("robot")
    observer = trifinger.observe("robot")
    with trifinger.connect("robot") as robot:
        step(robot)
    assert observer.fault() == trifinger.Fault("finished", time_index=1)

    def fail() -> None:
        with trifinger.connect("robot") as robot:
            observers.append(trifinger.observe("robot"))
            step(robot)
            raise KeyError

    observers: list[trifinger.Frontend] = []
    with pytest.raises(KeyError):
        fail()
    with pytest.raises(trifinger.RobotStopped, match=r"let go at step 1 without finish\(\)"):
        observers[0].get_observation(7)
    with trifinger.connect("robot") as robot:
        assert step(robot) == 0


def test_a_killed_back_end_ends_every_wait(start_fake: StartChild) -> None:
    child = start_fake("robot")
    robot = trifinger.connect("robot")
    t = step(robot)
    child.kill()
    with pytest.raises(trifinger.RobotStopped, match="the back-end died") as raised:
        robot.get_observation(t + 2)
    assert raised.value.fault is not None
    assert raised.value.fault.code == "backend_died"
    assert robot.get_observation(t).applied_actions == 0, "what was there can still be read"
    with pytest.raises(trifinger.RobotStopped):
        robot.finish()
    with pytest.raises(trifinger.SessionNotFound, match=r"is gone; start it again"):
        trifinger.connect("robot")
    with pytest.raises(trifinger.RobotStopped):
        trifinger.recover("robot")
    assert not trifinger.list_sessions()[0].backend_is_alive


def test_fault_02_a_killed_controller_makes_place_for_the_next(
    start_fake: StartChild, start_python: StartChild
) -> None:
    start_fake("robot")
    controller = start_python(CONTROLLER, "robot")
    observer = trifinger.observe("robot")
    assert observer.get_desired_action(0).setpoint == 1.0
    controller.kill()
    with pytest.raises(trifinger.RobotStopped, match="the controlling process died") as raised:
        observer.get_observation(5)
    assert raised.value.fault is not None
    assert not raised.value.fault.needs_recovery
    with trifinger.connect("robot") as robot:
        assert step(robot) == 0


def test_a_missing_action_stops_a_robot_in_real_time(start_fake: StartChild) -> None:
    start_fake("robot", real_time=True, max_skipped_ticks=1_000_000, max_action_repeats=3)
    robot = trifinger.connect("robot")
    step(robot)
    with pytest.raises(
        trifinger.RobotStopped, match="was not there in time, after 3 repeats"
    ) as raised:
        robot.wait_until_time_index(1000)
    fault = raised.value.fault
    assert fault is not None
    assert (fault.code, fault.detail, fault.needs_recovery) == ("action_late", 3, True)
    assert robot.get_statuses(1, fault.time_index)["action_repeats"].tolist() == [1, 2, 3]
    timing = robot.timing()
    assert timing is not None
    # Steps that the machine began late do not count as late because of the user.
    assert timing.late_steps("user") <= 4 <= timing.late_steps()
    assert timing.steps() == fault.time_index + 1 == timing.lateness().count()
    assert timing.success_rate() == pytest.approx(1 - timing.late_steps() / timing.steps())
    assert str(raised.value).endswith(str(timing))
    robot.close()
    with pytest.raises(trifinger.RobotStopped, match=r"clear this with recover\(\)"):
        trifinger.connect("robot")
    trifinger.recover("robot")
    robot = trifinger.connect("robot")
    step(robot)
    with pytest.raises(trifinger.RobotStopped):
        robot.get_observation(1000)
    robot.recover()
    step(trifinger.connect("robot"))


def test_a_robot_in_real_time_can_be_waited_for_by_its_clock(start_fake: StartChild) -> None:
    start_fake("robot", real_time=True, max_skipped_ticks=1_000_000, max_action_repeats=1_000_000)
    with trifinger.connect("robot") as robot:
        t = robot.append_desired_action(robot.new_action())
        robot.wait_until_time_index(t + 20)
        ticks = robot.get_statuses(0, t + 20)["tick"].astype(np.int64)
        assert (np.diff(ticks) >= 1).all()
        timing = robot.timing()
        assert timing is not None
        lateness = timing.lateness()
        assert 0 <= lateness.quantile(0.5) <= lateness.quantile(0.99) <= lateness.max()
        for worst, other in itertools.pairwise(timing.worst()):
            assert worst.lateness >= other.lateness
        assert {step.cause for step in timing.worst()} <= {"user", "scheduler", "driver"}
        with pytest.raises(trifinger.InvalidArgument, match="'user', 'scheduler' and 'driver'"):
            timing.late_steps("weather")


def test_fault_14_nobody_acts_in_time(start_fake: StartChild) -> None:
    start_fake("robot", real_time=True, first_action_timeout=0.01, max_skipped_ticks=1_000_000)
    with pytest.raises(trifinger.RobotStopped, match="first-action timeout"):
        trifinger.observe("robot").get_observation(0)


# ---- fork ----

FORK = """
import os, sys, trifinger, warnings
warnings.simplefilter("ignore", DeprecationWarning)  # from Python 3.12 on, of every such fork
backend = trifinger.run_fake("mine")
robot = trifinger.connect("robot")
t = robot.append_desired_action(robot.new_action())
robot.wait_until_time_index(t)
child = os.fork()
if child == 0:
    read = lambda: robot.get_observation(0)
    for call in (robot.current_time_index, robot.finish, backend.stop, read):
        try:
            call()
        except trifinger.InheritedHandle as error:
            assert "fork" in str(error)
        else:
            sys.exit("no error")
    assert trifinger.observe("robot").get_observation(0).applied_actions == 0
    try:
        trifinger.connect("robot")
    except trifinger.ControlHeld:
        sys.exit(0)  # closes all handles, like the end of every program
    sys.exit("two controllers")
_, status = os.waitpid(child, 0)
assert os.waitstatus_to_exitcode(status) == 0
t = robot.append_desired_action(robot.new_action())
robot.wait_until_time_index(t)
assert t == 1
robot.finish()
backend.stop()
print("ready", flush=True)
"""


@pytest.mark.without_sanitizer  # its lock may be held by another thread at the fork
def test_fault_64_a_forked_child_neither_uses_nor_harms_its_parents_handles(
    start_fake: StartChild, start_python: StartChild
) -> None:
    start_fake("robot")
    assert start_python(FORK).finish() == (0, "")


# ---- the end of the program ----

DAEMONS = """
import threading, trifinger
backend = trifinger.run_fake(
    "robot", real_time=True, max_skipped_ticks=1_000_000, max_action_repeats=1_000_000)
robot = trifinger.connect("robot")
t = robot.append_desired_action(robot.new_action())
def read(t):
    while True:
        robot.get_observation(t)
        t += 1
for _ in range(8):
    threading.Thread(target=read, args=(t,), daemon=True).start()
robot.wait_until_time_index(20)
print("ready", flush=True)
"""

EVERYTHING = """
import trifinger
with trifinger.run_fake("robot", sensor_period=1):
    robot = trifinger.connect("robot")
    sensor = robot.companion("sensor")
    t = robot.append_desired_action(robot.new_action())
    y, ys, error = robot.get_observation(t), robot.get_observations(0, 1), None
    try:
        robot.get_observation(1, timeout=0)
        robot.get_observation(2, timeout=0)
    except trifinger.TimedOut as caught:
        error = caught
inline = trifinger.fake(sensor_period=1)
inline_sensor = inline.companion("sensor")
trifinger.robot = robot
print("ready", flush=True)
"""


@pytest.mark.parametrize("program", [DAEMONS, EVERYTHING], ids=["DAEMONS", "EVERYTHING"])
def test_a_program_ends_silently_whatever_it_holds(start_python: StartChild, program: str) -> None:
    assert start_python(program).finish() == (0, "")


def test_a_program_that_ends_brings_its_robots_to_rest(start_python: StartChild) -> None:
    child = start_python(
        """
import sys, trifinger
import os
os.backend = trifinger.run_fake("robot")  # a place that is not cleared before the end
print("ready", flush=True)
sys.stdin.read()
"""
    )
    observer = trifinger.observe("robot")
    assert child.finish() == (0, "")
    assert observer.fault() == trifinger.Fault("stopped")
    assert trifinger.list_sessions() == []


def test_ctrl_c_ends_a_back_end_in_an_orderly_way(start_python: StartChild) -> None:
    child = start_python(
        """
import trifinger
with trifinger.run_fake("robot") as backend:
    try:
        print("ready", flush=True)
        backend.wait()
    except KeyboardInterrupt:
        pass
"""
    )
    os.kill(child.pid, signal.SIGINT)
    assert child.finish() == (0, "")
    assert trifinger.list_sessions() == []


def test_the_module_says_its_version() -> None:
    program = "import trifinger; print(trifinger.__version__)"
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert run.stdout.strip() == trifinger.__version__
