# SPDX-License-Identifier: BSD-3-Clause
"""Every wait ends: with a timeout, by Ctrl-C, when the handle is closed. Other threads go on."""

import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trifinger
from conftest import Child, StartChild

pytestmark = pytest.mark.bindings


def is_asleep(process: int, thread: int) -> bool:
    """True if the thread sleeps in a wait of the core: not for the GIL, whose futex is private."""
    number, *arguments = Path(f"/proc/{process}/task/{thread}/syscall").read_text().split()
    futex, clock_nanosleep = ("202", "98"), ("230", "115")  # on x86-64 and ARM
    return (number in futex and arguments[1] == "0x0") or number in clock_nanosleep


def interrupt_wait(child: Child, number: int = signal.SIGINT) -> None:
    """Sends a signal to the main thread of `child` as soon as that sleeps in a wait."""
    while not is_asleep(child.pid, child.pid):
        assert child.process.poll() is None, child.finish()
        os.sched_yield()
    os.kill(child.pid, number)


def suspend(child: Child) -> None:
    """Stops all threads of `child` and waits until they stand still."""
    os.kill(child.pid, signal.SIGSTOP)
    for thread in Path(f"/proc/{child.pid}/task").iterdir():
        while (thread / "stat").read_text().rpartition(")")[2].split()[0] != "T":
            os.sched_yield()


@pytest.fixture
def remote(start_fake: StartChild) -> trifinger.Frontend:
    """A robot in another process that has done one step."""
    start_fake("robot", sensor_period=1)
    robot = trifinger.connect("robot")
    robot.wait_until_time_index(robot.append_desired_action(robot.new_action()))
    return robot


WAITS: dict[str, Callable[[trifinger.Frontend, float], object]] = {
    "get_observation": lambda robot, timeout: robot.get_observation(9, timeout),
    "get_desired_action": lambda robot, timeout: robot.get_desired_action(9, timeout),
    "get_applied_action": lambda robot, timeout: robot.get_applied_action(9, timeout),
    "get_status": lambda robot, timeout: robot.get_status(9, timeout),
    "get_observations": lambda robot, timeout: robot.get_observations(0, 9, timeout),
    "get_desired_actions": lambda robot, timeout: robot.get_desired_actions(0, 9, timeout),
    "get_applied_actions": lambda robot, timeout: robot.get_applied_actions(0, 9, timeout),
    "get_statuses": lambda robot, timeout: robot.get_statuses(0, 9, timeout),
    "wait_until_time_index": lambda robot, timeout: robot.wait_until_time_index(9, timeout),
    "get_latest_at": lambda robot, timeout: robot.companion("sensor").get_latest_at(9, timeout),
}


@pytest.mark.parametrize("name", WAITS)
@pytest.mark.parametrize("timeout", [0, 0.01])
def test_a_wait_ends_with_its_timeout(
    remote: trifinger.Frontend, name: str, timeout: float
) -> None:
    with pytest.raises(trifinger.TimedOut):
        WAITS[name](remote, timeout)
    assert remote.append_desired_action(remote.new_action()) == 1, (
        "what is waited for may still come"
    )
    remote.wait_until_time_index(1)


def fill_queue(robot: trifinger.Frontend) -> None:
    actions = np.zeros(1_000_000, robot.action_dtype)
    with pytest.raises(trifinger.TimedOut, match="free place in the queue"):
        robot.append_desired_actions(actions, timeout=0)


def test_a_queue_that_stays_full_ends_an_append_with_its_timeout(start_fake: StartChild) -> None:
    child = start_fake("robot")
    robot = trifinger.connect("robot")
    suspend(child)
    fill_queue(robot)
    with pytest.raises(trifinger.TimedOut):
        robot.finish(timeout=0.01)
    os.kill(child.pid, signal.SIGCONT)
    robot.finish()


INTERRUPTED = """
import sys, trifinger
robot = trifinger.connect("robot")
sensor = robot.companion("sensor")
t = robot.append_desired_action(robot.new_action())
robot.wait_until_time_index(t)
print("ready", flush=True)
try:
    {wait}
except KeyboardInterrupt:
    robot.append_desired_action(robot.new_action())
    robot.finish()
    print("interrupted")
"""


@pytest.mark.parametrize(
    "wait",
    [
        "robot.get_observation(9)",
        "robot.get_observation(9, timeout=3600)",
        "robot.get_statuses(0, 9)",
        "robot.wait_until_time_index(9)",
        "sensor.get_latest_at(9)",
    ],
)
def test_ctrl_c_ends_a_wait(start_fake: StartChild, start_python: StartChild, wait: str) -> None:
    start_fake("robot", sensor_period=1)
    child = start_python(INTERRUPTED.format(wait=wait))
    interrupt_wait(child)
    assert child.finish() == (0, "interrupted\n")


INTERRUPTED_WITHOUT_BACKEND = """
import sys, trifinger
robot = trifinger.connect("robot")
robot.append_desired_action(robot.new_action())
if {fault}:
    try:
        robot.get_observation(9)
    except trifinger.RobotStopped:
        pass
print("ready", flush=True)
sys.stdin.readline()
try:
    {wait}
except KeyboardInterrupt:
    print("interrupted")
"""


@pytest.mark.parametrize(
    ("wait", "fault"),
    [
        ("while True: robot.append_desired_action(robot.new_action())", False),
        ("robot.finish()", False),
        ("robot.recover()", True),
        ("trifinger.recover('robot', timeout=None)", True),
    ],
)
def test_ctrl_c_ends_a_wait_for_a_back_end_that_stands_still(
    start_fake: StartChild, start_python: StartChild, wait: str, fault: bool
) -> None:
    backend = start_fake("robot", action_fault_after=0 if fault else -1)
    child = start_python(INTERRUPTED_WITHOUT_BACKEND.format(wait=wait, fault=fault))
    suspend(backend)
    child.write_line()
    interrupt_wait(child)
    assert child.finish() == (0, "interrupted\n")


INTERRUPTED_INLINE = """
import os, signal, threading
import numpy as np
import trifinger
robot = trifinger.fake(history=1_000_000)  # for a reader that wakes late
actions = np.zeros(20_000_000, robot.action_dtype)
def interrupt():
    robot.get_observation(10_000)  # another thread reads while the burst is on its way
    os.kill(os.getpid(), signal.SIGINT)
robot.append_desired_action(actions[0])
thread = threading.Thread(target=interrupt)
thread.start()
print("ready", flush=True)
try:
    robot.append_desired_actions(actions)
except KeyboardInterrupt:
    print("interrupted")
thread.join()
t = robot.append_desired_action(robot.new_action())
robot.wait_until_time_index(t)
assert 10_000 <= t < 20_000_000
"""


def test_ctrl_c_ends_an_inline_wait(start_python: StartChild) -> None:
    assert start_python(INTERRUPTED_INLINE).finish() == (0, "interrupted\n")


def test_a_signal_handler_may_use_the_robot_that_waits(
    start_fake: StartChild, start_python: StartChild
) -> None:
    start_fake("robot")
    child = start_python(
        """
import os, signal, trifinger
robot = trifinger.connect("robot")
signal.signal(signal.SIGUSR1, lambda *_: robot.append_desired_action(robot.new_action()))
print("ready", flush=True)
print(robot.get_observation(0).applied_actions)
"""
    )
    interrupt_wait(child, signal.SIGUSR1)
    assert child.finish() == (0, "0\n")


# ---- threads ----


class Waiting:
    """Makes a call in a thread; `result` is the value that it returned or the error it raised."""

    def __init__(self, call: Callable[[], object]) -> None:
        self.result: object = None

        def run() -> None:
            try:
                self.result = call()
            except trifinger.Error as error:
                self.result = error

        self.thread = threading.Thread(target=run)
        self.thread.start()
        assert self.thread.native_id is not None
        while not is_asleep(os.getpid(), self.thread.native_id):
            os.sched_yield()

    def join(self) -> object:
        self.thread.join()
        return self.result


def test_threads_read_while_others_wait(remote: trifinger.Frontend) -> None:
    waiting = [Waiting(lambda t=t: remote.get_observation(t).applied_actions) for t in (2, 3, 4, 4)]  # type: ignore[misc]
    assert remote.get_observation(0).applied_actions == 0
    for _ in range(4):
        remote.append_desired_action(remote.new_action())
    assert [thread.join() for thread in waiting] == [2, 3, 4, 4]


def test_closing_a_handle_ends_the_waits_with_it(remote: trifinger.Frontend) -> None:
    waiting = Waiting(lambda: remote.get_observation(9))
    remote.close()
    error = waiting.join()
    assert isinstance(error, trifinger.InvalidArgument)
    assert "was closed while a thread waited with it" in str(error)
    assert trifinger.connect("robot"), "the session ends after the last wait"


def test_one_thread_appends(start_fake: StartChild) -> None:
    child = start_fake("robot")
    robot = trifinger.connect("robot")
    suspend(child)
    fill_queue(robot)
    waiting = Waiting(lambda: robot.append_desired_action(robot.new_action()))
    with pytest.raises(trifinger.ControlHeld, match="another thread is appending"):
        robot.append_desired_action(robot.new_action())
    os.kill(child.pid, signal.SIGCONT)
    assert isinstance(waiting.join(), int)


def call_in_thread(call: Callable[[], Any]) -> Any:
    """Calls a function in another thread; returns or raises what it does."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(call).result()


def step_of(robot: trifinger.Frontend) -> int:
    """Controls a robot for a step, and reads what came of it."""
    t = robot.append_desired_action(robot.new_action())
    assert robot.get_observation(t).applied_actions == t
    return t


def test_an_inline_robot_is_moved_by_the_thread_that_controls_it() -> None:
    robot = trifinger.fake(sensor_period=1)
    assert call_in_thread(lambda: step_of(robot)) == 0
    assert step_of(robot) == 1
    assert call_in_thread(lambda: [step_of(robot), step_of(robot)]) == [2, 3]
    t = robot.append_desired_action(robot.new_action())
    waiting = Waiting(lambda: robot.get_observation(t).applied_actions)
    assert robot.companion("sensor").get_latest_at(t) is not None
    assert waiting.join() == t
    call_in_thread(robot.finish)
    call_in_thread(robot.recover)
    call_in_thread(robot.close)


def test_a_simulation_may_be_made_in_one_thread_and_used_in_another() -> None:
    with call_in_thread(trifinger.simulate) as robot:
        action = robot.new_action(position=robot.latest_observation().position)
        t = call_in_thread(lambda: robot.append_desired_action(action))
        t = robot.append_desired_action(action)
        assert robot.get_observation(t).position.shape == (9,)


def test_a_thread_cannot_control_an_inline_robot_while_another_moves_it() -> None:
    is_armed, inside, may_end = threading.Event(), threading.Event(), threading.Event()

    def hold_up(_: trifinger.Element, __: trifinger.Element) -> None:
        if is_armed.is_set():
            inside.set()
            may_end.wait()

    def drive() -> int:
        t = robot.append_desired_action(action)
        robot.wait_until_time_index(t + 1)
        return t

    robot = trifinger.simulate(checks=[hold_up])
    action = robot.new_action(torque=np.zeros(9))
    is_armed.set()
    with ThreadPoolExecutor(1) as pool:
        driving = pool.submit(drive)
        inside.wait()
        for call in (lambda: robot.append_desired_action(action), robot.finish, robot.recover):
            with pytest.raises(trifinger.ControlHeld, match="another thread is moving"):
                call()
        may_end.set()
        assert driving.result() == 0
    assert robot.append_desired_action(action) == 1
    robot.close()


def test_a_range_is_filled_while_it_is_waited_for(remote: trifinger.Frontend) -> None:
    waiting = Waiting(lambda: remote.get_desired_actions(0, 50)["setpoint"].tolist())
    burst = np.zeros(49, remote.action_dtype)
    burst["setpoint"] = np.arange(1, 50)
    remote.append_desired_actions(burst)
    assert waiting.join() == list(range(50))
