# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger teleop` on a terminal, with a simulated robot."""

import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import trifinger
from conftest import PATIENT, Running, StartProgram
from trifinger.commands.command_line import wait_until_measured

PROGRAM = "import sys; from trifinger_view.commands.teleop import main; sys.exit(main())"
# What Linux would say of a gamepad.
PAD = """
import struct
from pathlib import Path
from trifinger_view.teleoperation import gamepad

def ioctl(_, request, buffer):
    if request & 0xFF == 0x06:
        return b"Pad of the test".ljust(len(buffer), b"\\0")
    return struct.pack("@6i", 0, -100, 100, 0, 0, 0)

gamepad.fcntl.ioctl = ioctl
gamepad.find_gamepads = lambda: [Path("event7")]
"""
RIGHT, UP, PAGE_UP = "\x1b[C", "\x1b[A", "\x1b[5~"


class Terminal:
    """`trifinger teleop` on a terminal."""

    def __init__(self, *words: str, cwd: Path | None = None, before: str = "") -> None:
        self.shown, self.terminal = pty.openpty()
        self.before = termios.tcgetattr(self.terminal)
        self.process = subprocess.Popen(
            [sys.executable, "-c", f"{before}\n{PROGRAM}", *words],
            stdin=self.terminal,
            stdout=self.terminal,
            stderr=self.terminal,
            start_new_session=True,
            cwd=cwd,
        )
        self.text = ""

    def wait_for(self, text: str) -> None:
        while text not in self.text:
            assert self.process.poll() is None or self._is_readable(), self.text
            self.text += os.read(self.shown, 4096).decode(errors="replace")

    def _is_readable(self) -> bool:
        os.set_blocking(self.shown, False)
        try:
            self.text += os.read(self.shown, 65536).decode(errors="replace")
        except BlockingIOError:
            return False
        finally:
            os.set_blocking(self.shown, True)
        return True

    def press(self, key: str) -> None:
        self._is_readable()  # a full terminal would keep the program from going on
        os.write(self.shown, key.encode())

    def end(self) -> tuple[int, str]:
        """Waits for the end; returns the exit status and what was shown.

        The terminal is as it was before.
        """
        while self.process.poll() is None:
            self._is_readable()
        while self._is_readable():  # the kernel may hand over what was written in parts
            pass
        assert termios.tcgetattr(self.terminal) == self.before
        return self.process.returncode, self.text

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self.shown)
        os.close(self.terminal)


@pytest.fixture
def start_teleop() -> Iterator[type[Terminal]]:
    terminals: list[Terminal] = []

    class Started(Terminal):
        def __init__(self, *words: str, cwd: Path | None = None, before: str = "") -> None:
            super().__init__(*words, cwd=cwd, before=before)
            terminals.append(self)

    yield Started
    for terminal in terminals:
        terminal.close()


@pytest.fixture(params=["sim", "finger_pro"])
def robot(request: pytest.FixtureRequest, start_program: StartProgram) -> Running:
    running = start_program("run", request.param, "--name", "robot", "--real-time", *PATIENT)
    running.wait_for("waits for a user")
    return running


class Tips:
    """Where the tips of a running robot are."""

    def __init__(self, config: str) -> None:
        self._robot = trifinger.observe("robot")
        self._kinematics = trifinger.Kinematics(config)

    def now(self) -> npt.NDArray[np.float64]:
        return self._kinematics.tip_positions(self._robot.latest_observation().position)

    def wait(self, steps: int) -> None:
        self._robot.wait_until_time_index(self._robot.current_time_index() + steps)


@pytest.fixture
def tips(request: pytest.FixtureRequest, robot: Running) -> Tips:
    assert robot.process.pid
    return Tips(request.node.callspec.params["robot"])


def hold_key_until_moved(terminal: Terminal, tips: Tips, key: str, axis: int) -> None:
    """Holds a key until the tip of finger 1 is a centimetre further along an axis."""
    begin = tips.now()[0]
    while tips.now()[0, axis] < begin[axis] + 0.01:
        terminal.press(key)
        tips.wait(50)


def wait_until_at_rest(tips: Tips) -> None:
    before = tips.now()
    while True:
        tips.wait(200)
        now = tips.now()
        if np.abs(now - before).max() < 1e-4:
            return
        before = now


@pytest.mark.slow
def test_keys_move_a_tip_and_q_ends_the_session_in_order(
    start_teleop: type[Terminal], robot: Running, tips: Tips
) -> None:
    terminal = start_teleop("robot")
    terminal.wait_for("holds its pose")
    begin = tips.now()
    hold_key_until_moved(terminal, tips, PAGE_UP, 2)
    hold_key_until_moved(terminal, tips, RIGHT, 0)
    wait_until_at_rest(tips)  # since no key is pressed
    assert np.abs(tips.now()[1:] - begin[1:]).max(initial=0) < 0.003  # the others stay
    terminal.press("q")
    status, text = terminal.end()
    assert status == 0, text
    assert "comes to rest as its configuration says" in text
    with trifinger.connect("robot") as next_user:
        next_user.latest_observation()
    assert robot.process.poll() is None


def test_stop_ends_the_session_while_a_tip_moves(start_teleop: type[Terminal], tips: Tips) -> None:
    observer = trifinger.observe("robot")
    terminal = start_teleop("robot")
    terminal.wait_for("holds its pose")
    hold_key_until_moved(terminal, tips, PAGE_UP, 2)
    terminal.press(PAGE_UP + "x")
    status, text = terminal.end()
    assert status == 0, text
    assert observer.fault() is not None


one_robot = pytest.mark.parametrize("robot", ["sim"], indirect=True)


@one_robot
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_fault_69_a_signal_lets_the_robot_hold_and_restores_the_terminal(
    start_teleop: type[Terminal], robot: Running, tips: Tips, number: signal.Signals
) -> None:
    observer = trifinger.observe("robot")
    terminal = start_teleop("robot")
    terminal.wait_for("holds its pose")
    hold_key_until_moved(terminal, tips, PAGE_UP, 2)
    terminal.process.send_signal(number)
    assert terminal.end()[0] == 130
    fault = observer.fault()
    assert fault is not None
    assert (fault.code, fault.needs_recovery) == ("finished", False)
    assert robot.process.poll() is None


@one_robot
def test_fault_63_a_robot_that_dies_ends_the_teleoperation(
    start_teleop: type[Terminal], robot: Running
) -> None:
    terminal = start_teleop("robot")
    terminal.wait_for("holds its pose")
    trifinger.observe("robot").wait_until_time_index(10)
    robot.process.kill()
    status, text = terminal.end()
    assert status == 1
    assert "the back-end died" in text


@pytest.mark.slow
@one_robot
@pytest.mark.parametrize("end", ["x", "q", signal.SIGINT])
def test_fault_69_a_back_end_that_stands_still_keeps_nobody_from_ending(
    start_teleop: type[Terminal], robot: Running, tips: Tips, end: str | signal.Signals
) -> None:
    terminal = start_teleop("robot")
    terminal.wait_for("holds its pose")
    hold_key_until_moved(terminal, tips, PAGE_UP, 2)
    robot.process.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, robot.process.pid, os.WSTOPPED)
    if isinstance(end, signal.Signals):
        terminal.process.send_signal(end)
    else:
        terminal.press(end)
    assert terminal.end()[0] != 0


def test_says_so_when_a_robot_is_not_ready(capsys: pytest.CaptureFixture[str]) -> None:
    class HomingRobot:
        def state(self, timeout: float | None = None) -> None:
            if timeout is not None:
                raise trifinger.TimedOut("no measurement yet")

    wait_until_measured(HomingRobot(), "robot")  # type: ignore[arg-type]
    assert "it may be homing" in capsys.readouterr().out


def test_a_robot_that_does_not_run_is_named(start_teleop: type[Terminal]) -> None:
    status, text = start_teleop("nobody").end()
    assert status == 1
    assert "nobody" in text


def refusal(*words: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *words], capture_output=True, text=True, check=False
    )
    assert done.returncode in (1, 2)
    return done.stderr


@one_robot
def test_without_its_device_the_robot_is_not_touched(robot: Running) -> None:
    assert "standard input is not a terminal" in refusal("robot")
    assert "is not a gamepad" in refusal("robot", "--device", "gamepad:/dev/null")
    assert "must be keyboard, gamepad or" in refusal("robot", "--device", "mouse")
    assert trifinger.list_sessions()[0].phase == "holding"
    assert robot.process.poll() is None


@one_robot
def test_a_device_of_your_own_moves_the_robot(
    start_teleop: type[Terminal], robot: Running, tips: Tips, tmp_path: Path
) -> None:
    assert robot.process.pid
    (tmp_path / "up.py").write_text(
        "from trifinger_view.teleoperation import Command\n"
        "left = [Command(velocity=(0, 0, 0.05), frame=2, message='up it goes')] * 25\n"
        "def device(): return left.pop() if left else Command(request='end')\n"
    )
    begin = tips.now()
    status, text = start_teleop("robot", "--device", "up:device", cwd=tmp_path).end()
    assert status == 0, text
    assert text.count("up it goes") == 25
    observer = trifinger.observe("robot")  # of the next session, which begins anew
    assert observer.latest_observation() is not None
    assert begin.shape == (3, 3)


@one_robot
@pytest.mark.parametrize("device", ["gamepad", "gamepad:event7"])
def test_a_gamepad_moves_a_tip_and_stops_the_session(
    start_teleop: type[Terminal], tips: Tips, tmp_path: Path, device: str
) -> None:
    observer = trifinger.observe("robot")
    os.mkfifo(tmp_path / "event7")
    with os.fdopen(os.open(tmp_path / "event7", os.O_RDWR), "wb", buffering=0) as kernel:

        def say(kind: int, code: int, value: int) -> None:
            kernel.write(struct.pack("@llHHi", 0, 0, kind, code, value))
            kernel.write(struct.pack("@llHHi", 0, 0, 0, 0, 0))  # SYN_REPORT

        terminal = start_teleop("robot", "--device", device, cwd=tmp_path, before=PAD)
        terminal.wait_for("Pad of the test (event7)")
        begin = tips.now()[0]
        while tips.now()[0, 2] < begin[2] + 0.01:
            say(3, 4, -100)  # the right stick is pushed up
            terminal.press("")
            tips.wait(50)
        say(1, 0x131, 1)  # the button B
        status, text = terminal.end()
    assert status == 0, text
    assert observer.fault() is not None


def test_the_help_shows_every_key() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, "--help"], capture_output=True, text=True, check=True
    )
    for key in ("left, right", "page down", "space", "home", "float", "shoulder buttons"):
        assert re.search(key, done.stdout)
