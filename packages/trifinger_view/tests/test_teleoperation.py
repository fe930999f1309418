# SPDX-License-Identifier: BSD-3-Clause
"""Devices, and what a guided robot does as they say; test_teleop_command.py has the command."""

import errno
import itertools
import math
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, strategies as st
from trifinger.errors import Error, InvalidArgument, RobotStopped
from trifinger_view.teleoperation import (
    Command,
    Gamepad,
    Keyboard,
    Request,
    Terminal,
    gamepad,
    keyboard,
    load_device,
    open_gamepad,
    teleoperate,
)
from trifinger_view.teleoperation.command import STILL, Velocity
from trifinger_view.teleoperation.gamepad import Event, Range, events_of, find_gamepads
from trifinger_view.teleoperation.keyboard import HELD, Keys
from trifinger_view.teleoperation.steering import (
    MAX_JOINT_LEAD,
    MAX_LEAD,
    MAX_SPEED,
    PERIOD,
    SLIDE,
    Steering,
)

RIGHT, LEFT, UP, PAGE_UP = b"\x1b[C", b"\x1b[D", b"\x1b[A", b"\x1b[5~"


class Clock:
    """A time that tests set."""

    def __init__(self) -> None:
        self.time = 100.0

    def __call__(self) -> float:
        return self.time

    def wait(self, duration: float) -> None:
        self.time += duration


# ---- keys ----

pieces = st.one_of(
    st.binary(max_size=4),
    st.sampled_from(
        [
            *(b"\x1b", b"\x1b[", b"\x1bO", b"\x1b[[", b"[", b"5~", b"\xc3\xa9", b"\xe2\x82\xac"),
            *(RIGHT, b"\x1bOC", b"\x1b[F", b"\x1b[1;5A", b"\x1b[[A", b"\x1b\x1b[A"),
        ]
    ),
)


@given(st.lists(pieces, max_size=8), st.data())
def test_keys_are_the_same_in_whatever_pieces_they_arrive(
    parts: list[bytes], data: st.DataObject
) -> None:
    text = b"".join(parts)
    whole = Keys().feed(text)
    keys, found, at = Keys(), [], 0
    while at < len(text):
        size = data.draw(st.integers(1, len(text) - at))
        found += keys.feed(text[at : at + size])
        at += size
    assert found == whole
    assert text.startswith(b"".join(whole))  # nothing is left out, and only the end is kept


# What terminals send for keys that mean nothing here. Parts of them look like keys that do.
UNKNOWN = {
    "End": b"\x1b[F",
    "End of VT220": b"\x1b[4~",
    "End in application mode": b"\x1bOF",
    "Home": b"\x1b[H",
    "Insert": b"\x1b[2~",
    "Delete": b"\x1b[3~",
    "F1": b"\x1bOP",
    "F1 of the console": b"\x1b[[A",
    "F5": b"\x1b[15~",
    "Ctrl-right": b"\x1b[1;5C",
    "Alt-up of rxvt": b"\x1b\x1b[A",
    "Alt-f": b"\x1bf",
    "Alt-h": b"\x1bh",
    "Alt-1": b"\x1b1",
    "a click": b"\x1b[<0;12;3M",
    "the answer of a terminal": b"\x1b[?62;1;6c",
    "a letter of another alphabet": "ф".encode(),
    "a symbol": "€".encode(),
    "Tab": b"\t",
    "Enter": b"\r",
    "a capital": b"F",
}


@pytest.mark.parametrize("name", UNKNOWN)
def test_unknown_keys_do_nothing_in_whatever_pieces_they_arrive(name: str) -> None:
    text = UNKNOWN[name]
    for cuts in range(len(text)):
        parts = [text[:cuts], text[cuts:]]
        board = Keyboard(lambda parts=parts: parts.pop(0) if parts else b"", now=Clock())
        assert [board() for _ in range(3)] == [Command()] * 3


@given(st.from_regex(rb"\A\x1b\[[0-9;<?]*[@-Z\\-~]\Z"))
def test_no_unknown_sequence_is_taken_for_a_key(sequence: bytes) -> None:
    board = Keyboard([sequence].pop, now=Clock())
    command = board()
    if sequence not in (RIGHT, LEFT, UP, b"\x1b[B", PAGE_UP, b"\x1b[6~"):
        assert command == Command()


def test_a_tip_moves_as_long_as_its_key_is_repeated_and_stops_when_it_is_let_go() -> None:
    clock, typed = Clock(), [RIGHT]
    board = Keyboard(lambda: typed.pop() if typed else b"", now=clock)
    for _ in range(30):  # the key is held
        assert board().velocity == (board.speed, 0, 0)
        clock.time += HELD * 0.9
        assert board().velocity == (board.speed, 0, 0)
        typed.append(RIGHT)
    typed.clear()
    clock.time += HELD
    assert board().velocity == STILL


@pytest.mark.parametrize(
    ("key", "velocity"),
    [
        *((b"\x1b[C", (1, 0, 0)), (b"\x1bOD", (-1, 0, 0)), (b"\x1bOA", (0, 1, 0))),
        *((b"\x1b[B", (0, -1, 0)), (b"\x1b[5~", (0, 0, 1)), (b"s", (0, 0, -1))),
    ],
)
def test_keys_move_a_tip_along_the_axes_of_the_world(key: bytes, velocity: Velocity) -> None:
    board = Keyboard([key].pop, now=Clock())
    assert np.array_equal(board().velocity, board.speed * np.array(velocity))


def test_keys_turn_the_joint_that_brackets_choose() -> None:
    typed = [b".", b"]", b"", b",", b"["]
    clock = Clock()
    board = Keyboard(lambda: typed.pop() if typed else b"", num_joints=3, now=clock)
    assert board() == Command(joint=2)  # the one before the first
    assert (board().joint, board().rate) == (2, pytest.approx(-board.speed / 0.1))
    assert board() == Command(joint=0)
    assert board().rate == pytest.approx(board.speed / 0.1)
    clock.time += HELD
    assert board().rate == 0.0


@pytest.mark.parametrize("key", [b"2", b"1", b" ", b"h", b"f", b"q", b"x"])
def test_another_key_ends_the_motion_of_the_one_before(key: bytes) -> None:
    typed = [key, RIGHT]
    board = Keyboard(lambda: typed.pop() if typed else b"", now=Clock())
    assert board().velocity != STILL
    assert board().velocity == STILL
    assert board().velocity == STILL


def test_a_finger_that_the_robot_lacks_cannot_be_chosen() -> None:
    assert Keyboard([b"3"].pop, 3)().frame == 2
    assert Keyboard([b"4"].pop, 3)() == Command()
    assert Keyboard([b"0"].pop, 3)() == Command()
    assert Keyboard([b"2"].pop, 1)() == Command()


@pytest.mark.parametrize("keys", list(itertools.permutations([b"x", b"f", b"h", b" ", b"q"], 3)))
def test_of_several_keys_the_one_that_stops_most_counts(keys: tuple[bytes, ...]) -> None:
    asked = Keyboard([b"".join(keys)].pop)().request
    order = {b"x": "stop", b"q": "end", b" ": "hold"}
    assert asked == next(order[key] for key in order if key in keys)


@pytest.mark.parametrize(("key", "asked"), [(b"x", "stop"), (b"q", "end"), (b" ", "hold")])
def test_escape_before_a_key_that_stops_does_not_hide_it(key: bytes, asked: Request) -> None:
    assert Keyboard([b"\x1b" + key].pop)().request == asked
    assert Keyboard([b"\x1b\x1b" + key].pop)().request == asked


def test_the_speed_is_chosen_from_a_few() -> None:
    fast, slow = Keyboard([b"+" * 20].pop), Keyboard([b"-" * 20].pop)
    assert "100 mm/s" in fast().message
    assert "5 mm/s" in slow().message
    assert (fast.speed, slow.speed) == (max(keyboard.SPEEDS), min(keyboard.SPEEDS))


def test_the_end_of_the_terminal_ends_the_teleoperation() -> None:
    assert Keyboard([None].pop)().request == "end"


# ---- the terminal ----

HOLD_TERMINAL = """
import sys, time
from trifinger.commands.command_line import ended_by_signals, run
from trifinger_view.teleoperation import Terminal
def work():
    with ended_by_signals(), Terminal() as terminal:
        print("ready", flush=True)
        {end}
sys.exit(run(work))
"""


def wait_for(terminal: int, text: str) -> str:
    seen = ""
    while text not in seen:
        seen += os.read(terminal, 4096).decode()
    return seen


def in_terminal(terminal: int, end: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-c", HOLD_TERMINAL.format(end=end)],
        stdin=terminal,
        stdout=terminal,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


@pytest.mark.parametrize(
    "end", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, "raise KeyError", "sys.exit(3)"]
)
def test_fault_69_the_terminal_is_as_it_was_however_a_teleoperation_ends(
    end: str | signal.Signals,
) -> None:
    shown, terminal = pty.openpty()
    before = termios.tcgetattr(terminal)
    # A signal that comes just before a pause without end would be lost in it.
    last = end if isinstance(end, str) else "while True: time.sleep(0.01)"
    process = in_terminal(terminal, "sys.stdin.readline()\n        " + last)
    wait_for(shown, "ready")
    during = termios.tcgetattr(terminal)
    os.write(shown, b"\n")
    if isinstance(end, signal.Signals):
        process.send_signal(end)
    assert process.wait() != 0
    assert during[3] & (termios.ICANON | termios.ECHO) == 0
    assert termios.tcgetattr(terminal) == before
    os.close(shown)
    os.close(terminal)


def test_keys_of_a_terminal_arrive_at_once_and_unseen() -> None:
    shown, terminal = pty.openpty()
    before = termios.tcgetattr(terminal)
    with Terminal(terminal) as keys:
        assert keys.read() == b""
        os.write(shown, b"f\x1a\x1c")  # Ctrl-Z and Ctrl-\ are keys like any other
        read = b""
        while len(read) < 3:
            read += keys.read() or b""
        assert read == b"f\x1a\x1c"
        os.write(shown, b"rm -rf\n")
        select.select([terminal], [], [])
    assert termios.tcgetattr(terminal) == before
    assert keys.read() == b""  # what was typed meanwhile is not for the shell
    os.write(terminal, b"!")
    assert os.read(shown, 16) == b"!"  # and was not echoed
    os.close(shown)
    assert keys.read() is None
    os.close(terminal)


def test_what_is_no_terminal_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "file").open("w") as file, pytest.raises(InvalidArgument, match="--device"):
        Terminal(file.fileno())


# ---- gamepads ----

X, Y, RIGHT_Y, CROSS_Y = 0, 1, 4, 17
A, B, SHOULDER, SELECT, START = 0x130, 0x131, 0x137, 0x13A, 0x13B
REPORT, DROPPED = Event(0, 0, 0), Event(0, 3, 0)


class Recorded:
    """A gamepad whose events are a script."""

    name = "a pad"
    ranges: Mapping[int, Range] = {
        X: Range(-32768, 32767),
        Y: Range(-32768, 32767),
        RIGHT_Y: Range(0, 255),
    }

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.is_gone = False
        self.is_closed = False

    def stick(self, axis: int, share: float) -> None:
        low, high = self.ranges[axis].low, self.ranges[axis].high
        self.events.append(Event(3, axis, round((low + high) / 2 + share * (high - low) / 2)))
        self.events.append(REPORT)

    def press(self, button: int) -> None:
        self.events += [Event(1, button, 1), REPORT, Event(1, button, 0), REPORT]

    def read(self) -> list[Event]:
        if self.is_gone:
            raise OSError(errno.ENODEV, "No such device")
        events, self.events = self.events, []
        return events

    def close(self) -> None:
        self.is_closed = True


@pytest.fixture
def source() -> Recorded:
    return Recorded()


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def pad(source: Recorded, clock: Clock) -> Gamepad:
    return Gamepad(lambda: source, now=clock)


@pytest.mark.parametrize(
    ("axis", "way", "velocity"),
    [
        *((X, 1, (1, 0, 0)), (X, -1, (-1, 0, 0)), (Y, -1, (0, 1, 0)), (Y, 1, (0, -1, 0))),
        *((RIGHT_Y, -1, (0, 0, 1)), (RIGHT_Y, 1, (0, 0, -1))),
    ],
)
def test_sticks_move_a_tip_and_stop_it_when_they_are_let_go(
    source: Recorded, pad: Gamepad, axis: int, way: int, velocity: Velocity
) -> None:
    source.stick(axis, way)
    assert pad().velocity == pytest.approx(pad.speed * np.array(velocity))
    assert pad().velocity == pytest.approx(pad.speed * np.array(velocity))  # it is still pushed
    source.stick(axis, 0.1)  # sticks do not come back to exactly zero
    assert pad().velocity == STILL


@given(st.integers(-40000, 40000), st.integers(-40000, 40000))
def test_the_deflection_grows_from_the_dead_zone_to_the_end(one: int, other: int) -> None:
    span = Range(-32768, 32767)
    shares = [span.share(min(one, other)), span.share(max(one, other))]
    assert -1 <= shares[0] <= shares[1] <= 1
    assert span.share(-32768) == -1
    assert span.share(32767) == 1
    assert Range(0, 0).share(one) == 0  # an axis that this gamepad lacks


@pytest.mark.parametrize(
    ("button", "asked"), [(A, "hold"), (B, "stop"), (START, "home"), (SELECT, "float")]
)
def test_after_a_button_the_sticks_count_when_they_have_been_let_go(
    source: Recorded, pad: Gamepad, button: int, asked: Request
) -> None:
    source.stick(X, 1)
    source.press(button)
    command = pad()
    assert (command.request, command.velocity) == (asked, STILL)
    source.stick(X, 0.9)
    assert pad() == Command(frame=0, joint=0)
    source.stick(X, 0)
    assert pad().velocity == STILL
    source.stick(X, 1)
    assert pad().velocity != STILL


def test_of_several_buttons_the_one_that_stops_most_counts(source: Recorded, pad: Gamepad) -> None:
    for button in (START, B, A, SELECT):
        source.press(button)
    assert pad().request == "stop"


def test_shoulder_buttons_choose_a_finger_and_end_its_motion(
    source: Recorded, pad: Gamepad
) -> None:
    source.stick(X, 1)
    source.press(SHOULDER)
    assert pad() == Command(frame=1, joint=0)
    source.press(SHOULDER)
    source.press(SHOULDER)
    assert pad().frame == 0
    pad.num_frames = 1
    source.press(SHOULDER)
    assert pad().frame == 0


def test_two_buttons_turn_the_joint_that_the_cross_chooses(source: Recorded, pad: Gamepad) -> None:
    source.events += [Event(1, 0x134, 1), REPORT]
    assert (pad().joint, pad().rate) == (0, pytest.approx(pad.speed / 0.1))
    source.events += [Event(3, 0x10, 1), REPORT, Event(3, 0x10, 0), REPORT]
    assert (pad().joint, pad().rate) == (1, 0.0)  # until the button is let go
    source.events += [Event(1, 0x134, 0), REPORT]
    assert pad().rate == 0.0
    source.events += [Event(1, 0x133, 1), REPORT]
    assert pad().rate == pytest.approx(-pad.speed / 0.1)
    source.events += [Event(1, 0x133, 0), REPORT]
    source.press(0x222)
    source.press(0x222)
    assert (pad().joint, pad().rate) == (pad.num_joints - 1, 0.0)


def test_the_cross_chooses_the_speed(source: Recorded, pad: Gamepad) -> None:
    source.events += [Event(3, CROSS_Y, -1), REPORT, Event(3, CROSS_Y, 0), REPORT] * 9
    assert "100 mm/s" in pad().message
    assert pad.speed == max(gamepad.SPEEDS)
    for _ in range(9):
        source.press(0x221)
    pad()
    assert pad.speed == min(gamepad.SPEEDS)


def test_an_unplugged_gamepad_holds_the_robot_and_may_come_back(
    source: Recorded, pad: Gamepad, clock: Clock
) -> None:
    source.stick(X, 1)
    assert pad().velocity != STILL
    source.is_gone = True
    gone = pad()
    assert (gone.velocity, gone.request) == (STILL, "hold")
    assert "a pad is gone" in gone.message
    assert source.is_closed
    assert pad() == Command()
    source.is_gone = False
    clock.time += gamepad.RETRY
    back = pad()
    assert "there again" in back.message
    assert back.velocity == STILL
    assert pad().velocity == STILL  # until the stick says something
    source.stick(X, 1)
    assert pad().velocity != STILL


def test_a_gamepad_that_stays_away_is_looked_for_now_and_then(clock: Clock) -> None:
    source, looks = Recorded(), []

    def find() -> Recorded:
        looks.append(clock.time)
        if len(looks) > 1:
            raise Error("there is no gamepad")
        return source

    pad = Gamepad(find, now=clock)
    source.is_gone = True
    for _ in range(100):
        pad()
        clock.time += gamepad.RETRY / 10
    assert 9 <= len(looks) <= 11


def test_a_gamepad_that_says_nothing_stops_its_tip(
    source: Recorded, pad: Gamepad, clock: Clock
) -> None:
    source.stick(X, 1)
    pad()
    clock.time += gamepad.SILENCE + 0.1
    silent = pad()
    assert silent.velocity == STILL
    assert "silent" in silent.message
    assert pad() == Command(frame=0, joint=0)  # says it once
    source.stick(X, 0)
    pad()
    source.stick(X, 1)
    assert pad().velocity != STILL


def test_after_lost_events_nothing_is_pressed_until_something_is_heard(
    source: Recorded, pad: Gamepad
) -> None:
    source.stick(X, 1)
    assert pad().velocity != STILL
    source.events += [DROPPED, Event(3, X, 32767), Event(1, START, 1), REPORT]
    assert pad() == Command(frame=0, joint=0)
    source.stick(X, 1)
    assert pad().velocity != STILL


@given(
    st.lists(
        st.builds(
            Event,
            st.integers(0, 5),
            st.sampled_from([X, Y, RIGHT_Y, CROSS_Y, 0, 3, A, SHOULDER, START, 0x220, 0x221, 999]),
            st.integers(-(2**31), 2**31 - 1),
        )
    )
)
def test_whatever_a_gamepad_says_its_tip_is_not_too_fast(events: list[Event]) -> None:
    source = Recorded()
    pad = Gamepad(lambda: source, now=Clock())
    for event in events:
        source.events.append(event)
        command = pad()
        assert max(map(abs, command.velocity)) <= max(gamepad.SPEEDS)
        assert command.frame in range(3)


def test_the_bytes_of_linux_are_events() -> None:
    data = struct.pack("@llHHi", 1700000000, 5, 3, X, -32768)
    data += struct.pack("@llHHi", 1700000000, 5, 0, 0, 0)
    assert list(events_of(data)) == [Event(3, X, -32768), REPORT]


def test_events_are_read_from_a_file_until_it_is_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, clock: Clock
) -> None:
    def ioctl(_descriptor: int, request: int, buffer: bytes) -> bytes:
        assert request >> 30 == 2  # the kernel writes
        assert request >> 16 & 0x3FFF == len(buffer)
        assert request >> 8 & 0xFF == ord("E")
        if request & 0xFF == 0x06:
            return b"Pad of the test".ljust(len(buffer), b"\0")
        assert request & 0xFF in (0x40 + X, 0x40 + Y, 0x40 + RIGHT_Y)
        return struct.pack("@6i", 0, -100, 100, 0, 0, 0)

    monkeypatch.setattr(gamepad.fcntl, "ioctl", ioctl)
    path = tmp_path / "event7"
    os.mkfifo(path)
    pad = Gamepad(lambda: open_gamepad(path), now=clock)
    assert pad.name == f"Pad of the test ({path})"
    with path.open("wb", buffering=0) as kernel:
        assert pad() == Command(frame=0, joint=0)
        kernel.write(struct.pack("@llHHi", 1, 2, 3, X, 100) + struct.pack("@llHHi", 1, 2, 0, 0, 0))
        assert pad().velocity == (pad.speed, 0, 0)
    assert "Pad of the test" in pad().message
    assert pad.name == ""


def test_finds_the_gamepads_among_the_inputs_of_a_machine(tmp_path: Path) -> None:
    def add(name: str, keys: str) -> None:
        folder = tmp_path / name / "device/capabilities"
        folder.mkdir(parents=True)
        (folder / "key").write_text(keys)

    add("event10", "7cdb000000000000 0 0 0 0\n")  # a gamepad, as xpad describes it
    add("event9", "7cdb000000000000 0 0 0 0\n")
    add("event3", "402000000 3803078f800d001 feffffdfffefffff fffffffffffffffe\n")  # a keyboard
    add("event4", "0\n")
    (tmp_path / "event5").mkdir()
    assert find_gamepads(tmp_path, Path("/dev/input")) == [
        Path("/dev/input/event9"),
        Path("/dev/input/event10"),
    ]


def test_says_why_there_is_no_gamepad(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(bytes(48))
    with pytest.raises(Error, match="is not a gamepad that can be read"):
        open_gamepad(tmp_path / "file")
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(Error, match="is not a gamepad that can be read"):  # nobody waits for it
        open_gamepad(tmp_path / "fifo")
    with pytest.raises(Error, match="No such file"):
        open_gamepad(tmp_path / "nothing")


# ---- devices of others ----


def test_a_device_of_your_own_is_a_function_of_a_module(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "my_own_device.py").write_text("def device(): return 5\nnumber = 3\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    found: Callable[[], object] = load_device("my_own_device:device")
    assert found() == 5
    with pytest.raises(InvalidArgument, match="has no function 'number'"):
        load_device("my_own_device:number")
    with pytest.raises(InvalidArgument, match="there is no module 'my_missing_device'"):
        load_device("my_missing_device:device")
    for name in ("keybord", ":device", "my_own_device:"):
        with pytest.raises(InvalidArgument, match="must be keyboard, gamepad or MODULE:FUNCTION"):
            load_device(name)


# ---- steering ----


class State:
    def __init__(self, frames: npt.NDArray[np.float64], joints: npt.NDArray[np.float64]) -> None:
        self.reference_frames = frames
        self.reference_joints = joints
        self.refusal = ""


class FakeGuide:
    """Frames and joints that are at their targets at once, unless they are stuck."""

    def __init__(self, num_frames: int = 3, units: tuple[str, ...] = ("rad", "rad", "m")) -> None:
        self.frame_names = tuple(map(str, range(num_frames)))
        self.joint_units = units
        self.tips = np.zeros((num_frames, 3))
        self.joints = np.zeros(len(units))
        self.target = np.zeros(3)
        self.is_stuck = False
        self.requests: list[str] = []
        self.fault: Error | None = None
        self.refuses_torques = False

    def move_frame(self, frame: int, position: npt.ArrayLike) -> None:
        self.requests.append(f"tip {frame}")
        self.target = np.array(position, float)
        if not self.is_stuck:
            self.tips[frame] = self.target

    def move_joint(self, joint: int, position: float) -> None:
        self.requests.append(f"joint {joint}")
        self.target[joint] = position
        if not self.is_stuck:
            self.joints[joint] = position

    def home(self) -> None:
        self.requests.append("home")

    def hold(self) -> None:
        self.requests.append("hold")

    def float_freely(self) -> None:
        if self.refuses_torques:
            raise InvalidArgument("the robot cannot float")
        self.requests.append("float")

    def stop(self) -> None:
        self.requests.append("stop")

    def check(self) -> None:
        if self.fault:
            raise self.fault

    def state(self) -> State:
        return State(self.tips.copy(), self.joints.copy())


def run(guide: FakeGuide, commands: Sequence[object], clock: Clock | None = None) -> None:
    """Lets a device say these commands, and then "end"."""
    clock = clock or Clock()
    left = [*commands, Command(request="end")]

    def device() -> Command:
        command = left.pop(0)
        if isinstance(command, BaseException):
            raise command
        return command  # type: ignore[return-value]  # on purpose, in one test

    teleoperate(guide, device, wait=clock.wait, now=clock)


MOVE = Command(velocity=(0.05, 0.0, -0.02), frame=1)


def test_a_tip_goes_as_far_as_its_velocity_says() -> None:
    guide = FakeGuide()
    run(guide, [Command(), *[MOVE] * 100])
    assert guide.tips[1] == pytest.approx(100 * PERIOD * np.array(MOVE.velocity))
    assert not guide.tips[0].any()


def test_a_robot_that_cannot_float_holds_and_says_so() -> None:
    guide, clock = FakeGuide(), Clock()
    guide.refuses_torques = True
    left = [MOVE, Command(request="float"), MOVE, Command(request="end")]
    said: list[str] = []
    teleoperate(
        guide,
        lambda: left.pop(0),
        watch=lambda command, _frame: said.append(command.message),
        wait=clock.wait,
        now=clock,
    )
    assert guide.requests == ["tip 1", "hold", "tip 1", "hold"]
    assert said == ["", "the robot cannot float", "", ""]


def test_a_tip_that_is_stuck_is_not_led_far_away() -> None:
    guide = FakeGuide()
    guide.is_stuck = True
    run(guide, [MOVE] * 1000)
    assert np.linalg.norm(guide.target) == pytest.approx(MAX_LEAD)


def test_the_robot_holds_once_when_the_motion_ends() -> None:
    guide = FakeGuide()
    run(guide, [MOVE, MOVE, Command(), Command(), Command(), MOVE])
    assert guide.requests == ["tip 1", "tip 1", "hold", "tip 1", "hold"]


def test_a_finger_rests_before_another_one_moves() -> None:
    guide = FakeGuide()
    run(guide, [MOVE, Command(velocity=(0.1, 0, 0), frame=2)])
    assert guide.requests == ["tip 1", "hold", "tip 2", "hold"]


def test_the_finger_remains_chosen() -> None:
    guide = FakeGuide()
    run(guide, [Command(frame=2), Command(velocity=(0.1, 0, 0))])
    assert guide.requests == ["tip 2", "hold"]


@pytest.mark.parametrize("asked", ["home", "hold", "float"])
def test_a_request_is_passed_on_once_and_nothing_follows_it(asked: Request) -> None:
    guide = FakeGuide()
    run(guide, [MOVE, Command(request=asked), Command(), Command()])
    assert guide.requests == ["tip 1", asked, "hold"]


def test_stop_ends_the_session_and_nothing_follows_it() -> None:
    guide = FakeGuide()
    run(guide, [MOVE, Command(request="stop", velocity=(1, 0, 0)), MOVE])
    assert guide.requests == ["tip 1", "stop"]


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        (Command(velocity=(math.nan, 0, 0)), "must be finite"),
        (Command(velocity=(0, math.inf, 0)), "must be finite"),
        (Command(velocity=(0.1, 0.1)), "must be three numbers"),  # type: ignore[arg-type]
        (Command(velocity="fast"), "must be three numbers"),  # type: ignore[arg-type]
        (Command(frame=3), "frame 3, must be from 0 to 2"),
        (Command(frame=-1), "frame -1, must be from 0 to 2"),
        (Command(joint=3), "joint 3, must be from 0 to 2"),
        (Command(rate=math.nan), "must be finite"),
        (Command(rate="fast"), "must be three numbers and one"),  # type: ignore[arg-type]
        (Command(request="hom"), "did you mean 'home'"),  # type: ignore[arg-type]
        ((0.1, 0, 0), "must be a trifinger_view.teleoperation.Command"),
        (None, "must be a trifinger_view.teleoperation.Command"),
    ],
)
def test_nonsense_is_refused_and_the_robot_holds(command: object, sentence: str) -> None:
    guide = FakeGuide()
    with pytest.raises(InvalidArgument, match=sentence):
        run(guide, [MOVE, command])
    assert set(guide.requests[1:]) == {"hold"}


def test_a_joint_turns_as_far_as_its_rate_says_and_a_slide_by_a_tenth() -> None:
    guide = FakeGuide()
    run(
        guide,
        [
            Command(),
            *[Command(rate=0.5, joint=1)] * 100,
            Command(),
            *[Command(rate=-0.5, joint=2)] * 50,
        ],
    )
    assert guide.joints == pytest.approx([0.0, 100 * PERIOD * 0.5, -50 * PERIOD * 0.05])
    assert guide.requests == [*["joint 1"] * 100, "hold", *["joint 2"] * 50, "hold"]


def test_a_joint_that_is_stuck_is_not_led_far_away() -> None:
    for joint, lead in ((0, MAX_JOINT_LEAD), (2, SLIDE * MAX_JOINT_LEAD)):
        guide = FakeGuide()
        guide.is_stuck = True
        run(guide, [Command(rate=9.0, joint=joint)] * 1000)
        assert guide.target[joint] == pytest.approx(lead)


def test_a_joint_rests_before_a_frame_moves() -> None:
    guide = FakeGuide()
    run(guide, [Command(rate=0.5), MOVE, Command(rate=0.5), Command(rate=0.5, joint=1)])
    moves = ["joint 0", "tip 1", "joint 0", "joint 1"]
    assert guide.requests == [request for move in moves for request in (move, "hold")]


def test_a_robot_without_frames_is_moved_by_its_joints_alone() -> None:
    guide = FakeGuide(num_frames=0)
    run(guide, [Command(rate=0.5)])
    assert guide.requests == ["joint 0", "hold"]
    with pytest.raises(InvalidArgument, match="names frames to move"):
        run(guide, [Command(velocity=(0.1, 0, 0))])


@pytest.mark.parametrize("error", [KeyError("mine"), KeyboardInterrupt(), SystemExit(3)])
def test_fault_63_a_device_that_fails_leaves_a_robot_that_holds(error: BaseException) -> None:
    guide = FakeGuide()
    with pytest.raises(type(error)) as raised:
        run(guide, [MOVE, error])
    assert raised.value is error
    assert guide.requests == ["tip 1", "hold"]


def test_a_session_that_ends_ends_the_teleoperation_with_its_reason() -> None:
    guide = FakeGuide()
    guide.fault = RobotStopped("the back-end died")
    with pytest.raises(RobotStopped, match="the back-end died"):
        run(guide, [MOVE] * 10)
    assert "tip 1" not in guide.requests


def test_after_a_pause_of_the_device_a_tip_does_not_leap() -> None:
    guide, clock = FakeGuide(), Clock()
    commands = iter([MOVE, MOVE, MOVE, Command(request="end")])

    def device() -> Command:
        clock.time += 10.0  # such as a network that hangs
        return next(commands)

    teleoperate(guide, device, wait=clock.wait, now=clock)
    assert np.linalg.norm(guide.tips[1]) <= 3 * 2 * PERIOD * MAX_SPEED


finite = st.floats(-1e300, 1e300)


@given(st.lists(st.tuples(st.tuples(finite, finite, finite), st.integers(0, 2)), max_size=30))
def test_no_command_moves_a_target_faster_than_the_largest_speed(
    commands: list[tuple[Velocity, int]],
) -> None:
    guide = FakeGuide()
    steering = Steering(guide)
    for velocity, finger in commands:
        before = guide.tips.copy()
        steering.obey(Command(velocity=velocity, frame=finger), PERIOD)
        steps = np.linalg.norm(guide.tips - before, axis=1)
        assert steps.max() <= MAX_SPEED * PERIOD * (1 + 1e-9)
        assert np.isfinite(guide.target).all()
