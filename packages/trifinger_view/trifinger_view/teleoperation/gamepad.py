# SPDX-License-Identifier: BSD-3-Clause
"""A gamepad as a device, read from Linux's input events (docs/decisions/gamepads.md).

The kernel gives the sticks and buttons of all gamepads the same codes. What is here needs no
package, no screen and no window.
"""

import errno
import fcntl
import os
import struct
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from trifinger.errors import Error

from trifinger_view.teleoperation.command import ARM, STILL, Command, Request, Velocity, more_urgent

HELP = """\
  left stick         the frame moves along x and y     start    home
  right stick        up and down                       select   float: a hand can move it
  shoulder buttons   the frame before, the next one    A        hold (on some pads: cross)
  left, right        the joint before, the next one    B        stop: the session ends at once
  X, Y               the joint turns back, on          Ctrl-C   hold, and end
  up, down           faster, slower"""

SPEEDS = (0.01, 0.02, 0.05, 0.1)
"""The speeds that a whole deflection can mean [m/s]."""
DEAD_ZONE = 0.15
"""The share of a deflection that means nothing: sticks do not come back to exactly zero."""
SILENCE = 3.0
"""What moves stops when the gamepad has said nothing for so long, such as without its radio [s]."""
RETRY = 1.0
"""Time from one look for an unplugged gamepad to the next [s]."""

# From linux/input-event-codes.h
_SYN, _KEY, _ABS = 0, 1, 3
_SYN_REPORT, _SYN_DROPPED = 0, 3
_SOUTH, _EAST, _LEFT_SHOULDER, _RIGHT_SHOULDER, _SELECT, _START = (
    *(0x130, 0x131, 0x136, 0x137),
    *(0x13A, 0x13B),
)
_CROSS_UP, _CROSS_DOWN, _CROSS_LEFT, _CROSS_RIGHT = 0x220, 0x221, 0x222, 0x223
_X, _Y, _RIGHT_Y, _CROSS_X, _CROSS_Y = 0x00, 0x01, 0x04, 0x10, 0x11
_TURNS = {0x133: -1.0, 0x134: 1.0}  # called X and Y on most pads
_STICKS = (_X, _Y, _RIGHT_Y)
_REQUESTS: dict[int, Request] = {_SOUTH: "hold", _EAST: "stop", _START: "home", _SELECT: "float"}

_EVENT = struct.Struct("@llHHi")  # struct input_event
_ABSINFO = struct.Struct("@6i")  # struct input_absinfo


@dataclass(frozen=True)
class Event:
    """An input event of Linux."""

    type: int
    code: int
    value: int


@dataclass(frozen=True)
class Range:
    """The values of a stick's axis."""

    low: int
    high: int

    def share(self, value: int) -> float:
        """The deflection, from -1 to 1; 0 within the dead zone."""
        if self.high <= self.low:
            return 0.0
        middle, half = (self.high + self.low) / 2, (self.high - self.low) / 2
        deflection = min(max((value - middle) / half, -1.0), 1.0)
        size = max(abs(deflection) - DEAD_ZONE, 0.0) / (1.0 - DEAD_ZONE)
        return size if deflection > 0 else -size


class Source(Protocol):
    """Where the events of a gamepad come from: a file of Linux, or a recording."""

    @property
    def name(self) -> str:
        """What a person calls it."""

    @property
    def ranges(self) -> Mapping[int, Range]:
        """The values of each axis, by its code."""

    def read(self) -> list[Event]:
        """Returns the events since the last call, without waiting; OSError if it is gone."""

    def close(self) -> None:
        """Gives it back."""


class EventFile:
    """The events of a file such as /dev/input/event3."""

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            self.name = f"{_name_of(self._descriptor)} ({path})"
            self.ranges: Mapping[int, Range] = {
                axis: _range_of(self._descriptor, axis) for axis in _STICKS
            }
        except OSError:
            self.close()
            raise

    def read(self) -> list[Event]:
        """Returns the events since the last call; OSError if the gamepad is gone."""
        events: list[Event] = []
        while True:
            try:
                data = os.read(self._descriptor, 64 * _EVENT.size)
            except BlockingIOError:
                return events
            if not data:
                raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))
            events += events_of(data)

    def close(self) -> None:
        """Closes the file."""
        os.close(self._descriptor)


def events_of(data: bytes) -> Iterator[Event]:
    """The events in bytes that were read from a file of Linux's input events."""
    for _, _, kind, code, value in _EVENT.iter_unpack(data):
        yield Event(kind, code, value)


def _request(number: int, size: int) -> int:
    return 2 << 30 | size << 16 | ord("E") << 8 | number


def _name_of(descriptor: int) -> str:
    name = fcntl.ioctl(descriptor, _request(0x06, 256), bytes(256))
    return name.split(b"\0", 1)[0].decode(errors="replace")


def _range_of(descriptor: int, axis: int) -> Range:
    answer = fcntl.ioctl(descriptor, _request(0x40 + axis, _ABSINFO.size), bytes(_ABSINFO.size))
    _, low, high, *_ = _ABSINFO.unpack(answer)
    return Range(low, high)


def _has_key(bits: str, code: int) -> bool:
    # The words of /sys/.../capabilities/key are hexadecimal, the highest first.
    word_bits = 8 * struct.calcsize("@l")
    words = bits.split()[::-1]
    at, bit = divmod(code, word_bits)
    return at < len(words) and bool(int(words[at], 16) >> bit & 1)


def find_gamepads(
    system: Path = Path("/sys/class/input"), devices: Path = Path("/dev/input")
) -> list[Path]:
    """The files of the gamepads of this machine, in the order of their numbers."""
    found = []
    for entry in system.glob("event*"):
        try:
            keys = (entry / "device/capabilities/key").read_text()
        except OSError:
            continue
        if _has_key(keys, _SOUTH):
            found.append(devices / entry.name)
    return sorted(found, key=lambda path: int(path.name.removeprefix("event")))


def open_gamepad(path: Path | None = None) -> EventFile:
    """Opens a gamepad: the one with this file, or the first of this machine.

    Raises:
        Error: if there is none, or if it may not be read
    """
    paths = [path] if path else find_gamepads()
    if not paths:
        raise Error(
            "there is no gamepad: plug one in; if one is plugged in, 'ls /sys/class/input' shows "
            "whether Linux knows it"
        )
    try:
        return EventFile(paths[0])
    except PermissionError as error:
        raise Error(
            f"{paths[0]} may not be read: a user at the machine's own screen may do so, others "
            "after 'sudo usermod -aG input USER' and a new login"
        ) from error
    except OSError as error:
        raise Error(f"{paths[0]} is not a gamepad that can be read: {error.strerror}") from error


@dataclass
class _Pad:
    """What is pressed now."""

    sticks: dict[int, float] = field(default_factory=dict)
    """Deflections, from -1 to 1."""
    turns: dict[int, float] = field(default_factory=dict)
    """Which buttons turn a joint, and in which direction."""
    must_be_let_go: bool = False
    """Sticks and these buttons mean nothing until all are back in the middle or let go."""
    has_lost_events: bool = False

    def is_active(self) -> bool:
        if not any(self.sticks.values()) and not self.turns:
            self.must_be_let_go = False
            return False
        return not self.must_be_let_go

    def velocity(self, speed: float) -> Velocity:
        if not self.is_active() or not any(self.sticks.values()):
            return STILL
        x, down, sink = (speed * self.sticks.get(axis, 0.0) for axis in _STICKS)
        return (x, -down, -sink)

    def rate(self, speed: float) -> float:
        return speed / ARM * sum(self.turns.values()) if self.is_active() else 0.0


class Gamepad:
    """Commands of a gamepad.

    Without its gamepad it says "hold", and goes on as soon as the gamepad is there again. `find`
    opens the gamepad; `now` is the time [s].

    After a button the sticks count again when they have been let go, so "hold" holds.
    """

    def __init__(
        self,
        find: Callable[[], Source] = open_gamepad,
        num_frames: int = 3,
        num_joints: int = 9,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """Raises what `find` raises."""
        self._find = find
        self.num_frames = num_frames
        """Number of frames to choose from."""
        self.num_joints = num_joints
        """Number of joints to choose from."""
        self._now = now
        self._speed = SPEEDS.index(0.05)
        self._frame = self._joint = 0
        self._pad = _Pad()
        self._source: Source | None = find()
        self._heard = self._tried = now()

    @property
    def speed(self) -> float:
        """The speed that a whole deflection means [m/s]."""
        return SPEEDS[self._speed]

    @property
    def name(self) -> str:
        """What the gamepad is called; empty while there is none."""
        return self._source.name if self._source else ""

    def close(self) -> None:
        """Gives the gamepad back."""
        if self._source:
            self._source.close()
            self._source = None

    def __call__(self) -> Command:
        """The command of what is pressed now."""
        if self._source is None:
            return self._look_again()
        try:
            events = self._source.read()
        except OSError:
            return self._lose()
        message, speed = "", self._speed
        if events:
            self._heard = self._now()
        elif self._now() - self._heard > SILENCE and self._pad.is_active():
            self._pad.must_be_let_go = True
            message = "the gamepad is silent, so the robot holds; let all go to move it again"
        asked: Request = ""
        for event in events:
            asked = more_urgent(asked, self._take(event, self._source.ranges))
        if self._speed != speed:
            message = f"{1000 * self.speed:.0f} mm/s"
        return Command(
            velocity=self._pad.velocity(self.speed),
            frame=self._chosen_frame(),
            rate=self._pad.rate(self.speed),
            joint=self._joint,
            request=asked,
            message=message,
        )

    def _take(self, event: Event, ranges: Mapping[int, Range]) -> Request:
        if event.type == _SYN and event.code == _SYN_DROPPED:
            self._pad = _Pad(has_lost_events=True)  # nobody knows what is pressed
        elif event.type == _SYN and event.code == _SYN_REPORT:
            self._pad.has_lost_events = False
        elif self._pad.has_lost_events:
            pass  # what comes before the next report is of no use
        elif event.type == _KEY and event.code in _TURNS:
            self._pad.turns.pop(event.code, None)
            if event.value:
                self._pad.turns[event.code] = _TURNS[event.code]
        elif event.type == _KEY and event.value == 1:
            return self._press(event.code)
        elif event.type == _ABS and event.code in _STICKS and event.code in ranges:
            self._pad.sticks[event.code] = ranges[event.code].share(event.value)
        elif event.type == _ABS and event.code == _CROSS_Y:
            self._change_speed(-event.value)
        elif event.type == _ABS and event.code == _CROSS_X:
            self._choose_joint(event.value)
        return ""

    def _press(self, code: int) -> Request:
        if code in (_LEFT_SHOULDER, _RIGHT_SHOULDER):
            step = 1 if code == _RIGHT_SHOULDER else -1
            self._frame = (self._frame + step) % max(self.num_frames, 1)
        elif code in (_CROSS_LEFT, _CROSS_RIGHT):
            self._choose_joint(1 if code == _CROSS_RIGHT else -1)
        elif code in (_CROSS_UP, _CROSS_DOWN):
            self._change_speed(1 if code == _CROSS_UP else -1)
            return ""
        elif code not in _REQUESTS:
            return ""
        self._pad.must_be_let_go = True
        return _REQUESTS.get(code, "")

    def _chosen_frame(self) -> int | None:
        return self._frame if self.num_frames else None

    def _choose_joint(self, step: int) -> None:
        self._joint = (self._joint + step) % self.num_joints
        self._pad.must_be_let_go = self._pad.must_be_let_go or bool(self._pad.turns)

    def _change_speed(self, step: int) -> None:
        self._speed = min(max(self._speed + step, 0), len(SPEEDS) - 1)

    def _lose(self) -> Command:
        name = self.name
        self.close()
        self._pad = _Pad()
        self._tried = self._now()
        return Command(
            request="hold",
            message=f"{name} is gone, so the robot holds; plug it in again, or press Ctrl-C to end",
        )

    def _look_again(self) -> Command:
        if self._now() - self._tried < RETRY:
            return Command()
        self._tried = self._now()
        try:
            self._source = self._find()
        except Error:
            return Command()
        self._heard = self._now()
        return Command(
            frame=self._chosen_frame(), joint=self._joint, message=f"{self.name} is there again"
        )
