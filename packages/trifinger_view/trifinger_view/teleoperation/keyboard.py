# SPDX-License-Identifier: BSD-3-Clause
"""The keyboard of a terminal as a device.

A terminal tells when a key is pressed and repeats it while it is held; it does not tell when the
key is let go. So a frame or a joint moves for HELD after each of these signs of life, and stops
without them.
"""

import os
import re
import select
import sys
import termios
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from trifinger.errors import InvalidArgument

from trifinger_view.teleoperation.command import ARM, STILL, Command, Request, Velocity, more_urgent

HELD = 0.15
"""How long something moves after a sign of life of its key [s]. Keys repeat every 0.03 to 0.1 s."""
SPEEDS = (0.005, 0.01, 0.02, 0.05, 0.1)
"""The speeds of a frame that keys choose from [m/s]. Joints turn with this speed / ARM."""

HELP = """\
  left, right        the frame moves along x        h        home
  down, up           along y                        f        float: a hand can move the robot
  page down, page up along z; also s and w          space    hold
  1, 2, 3, ...       choose a frame (a tip)         x        stop: the session ends at once
  [ and ]            the joint before, the next one q        hold, and end
  , and .            the joint turns back, on       - and +  slower, faster"""

_DIRECTIONS: dict[bytes, Velocity] = {
    b"\x1b[C": (1, 0, 0),
    b"\x1b[D": (-1, 0, 0),
    b"\x1b[A": (0, 1, 0),
    b"\x1b[B": (0, -1, 0),
    b"\x1b[5~": (0, 0, 1),
    b"\x1b[6~": (0, 0, -1),
    b"w": (0, 0, 1),
    b"s": (0, 0, -1),
}
# Terminals in "application mode" send their arrows in another way.
_DIRECTIONS |= {b"\x1bO" + key[2:]: way for key, way in _DIRECTIONS.items() if len(key) == 3}

_TURNS: dict[bytes, float] = {b",": -1.0, b".": 1.0}

_REQUESTS: dict[bytes, Request] = {
    b"h": "home",
    b"f": "float",
    b" ": "hold",
    b"x": "stop",
    b"q": "end",
    b"\x03": "end",  # Ctrl-C, where a terminal makes no signal of it
    b"\x04": "end",  # Ctrl-D
}
# After Escape alone, the next key looks like one with Alt. What makes the robot rest still counts.
_REQUESTS |= {
    b"\x1b" + key: request for key, request in _REQUESTS.items() if request not in ("home", "float")
}

# One key, whole. What follows a match never changes it, so keys may arrive in any pieces.
_KEY = re.compile(
    rb"""\x1b?\x1b\[\[[A-E]                       # F1 to F5 of Linux's console
    | \x1b?\x1b\[(?!\[)[0-?]*[@-~]                # most keys with a name
    | \x1b?\x1bO[0-9;]*[@-~]                      # arrows and F1 to F4 of some terminals
    | \x1b?\x1b\[[0-?]*(?=[^0-?@-~])              # damaged: what comes next begins anew
    | \x1b?\x1b\[\[(?=[^A-E])
    | \x1b?\x1bO[0-9;]*(?=[^0-9;@-~])
    | \x1b(?=\x1b[^\[O])                          # Escape alone, before another Escape
    | \x1b[^\x1b\[O\x80-\xff]                     # a key with Alt
    | \x1b(?=[\x80-\xff])
    | [\xc2-\xdf][\x80-\xbf] | [\xe0-\xef][\x80-\xbf]{2} | [\xf0-\xf4][\x80-\xbf]{3}  # UTF-8
    | [\xc2-\xdf](?=[^\x80-\xbf]) | [\xe0-\xef][\x80-\xbf]?(?=[^\x80-\xbf])           # damaged
    | [\xf0-\xf4][\x80-\xbf]{0,2}(?=[^\x80-\xbf])
    | [^\x1b\xc2-\xf4]""",
    re.VERBOSE | re.DOTALL,
)
_LONGEST = 64  # bytes of one key; no terminal sends as many


class Keys:
    """Takes the bytes of a terminal apart into keys, in whatever pieces they arrive."""

    def __init__(self) -> None:
        self._unfinished = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Returns the keys that `data` completes; keeps the beginning of the next one."""
        text, at, keys = self._unfinished + data, 0, []
        while match := _KEY.match(text, at):
            keys.append(match[0])
            at = match.end()
        self._unfinished = text[at:] if len(text) - at <= _LONGEST else b""
        return keys


@dataclass(frozen=True)
class _Motion:
    direction: Velocity = STILL
    turn: float = 0.0
    until: float = 0.0


class Keyboard:
    """Commands of the keys that `read` has read.

    `read` returns without waiting: b"" if nobody has pressed a key, None at the end of the input.
    `now` is the time [s].
    """

    def __init__(
        self,
        read: Callable[[], bytes | None],
        num_frames: int = 3,
        num_joints: int = 9,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._read = read
        self.num_frames = num_frames
        """Number of frames to choose from."""
        self.num_joints = num_joints
        """Number of joints to choose from."""
        self._now = now
        self._keys = Keys()
        self._motion = _Motion()
        self._joint = 0
        self._speed = SPEEDS.index(0.05)

    @property
    def speed(self) -> float:
        """The chosen speed of a frame [m/s]."""
        return SPEEDS[self._speed]

    def __call__(self) -> Command:
        """The command of the keys that were pressed since the last call."""
        data = self._read()
        if data is None:
            return Command(request="end", message="the terminal is gone")
        frame: int | None = None
        joint: int | None = None
        request: Request = ""
        message = ""
        for key in self._keys.feed(data):
            if key in _DIRECTIONS:
                self._motion = _Motion(direction=_DIRECTIONS[key], until=self._now() + HELD)
            elif key in _TURNS:
                joint = self._joint
                self._motion = _Motion(turn=_TURNS[key], until=self._now() + HELD)
            elif key in _REQUESTS:
                self._motion = _Motion()
                request = more_urgent(request, _REQUESTS[key])
            elif key.isdigit() and 1 <= int(key) <= self.num_frames:
                self._motion = _Motion()
                frame = int(key) - 1
            elif key in (b"[", b"]"):
                self._motion = _Motion()
                self._joint = (self._joint + (1 if key == b"]" else -1)) % self.num_joints
                joint = self._joint
            elif key in b"+=-_" and len(key) == 1:
                step = 1 if key in b"+=" else -1
                self._speed = min(max(self._speed + step, 0), len(SPEEDS) - 1)
                message = f"{1000 * self.speed:.0f} mm/s"
        if self._now() >= self._motion.until:
            self._motion = _Motion()
        x, y, z = (self.speed * way for way in self._motion.direction)
        return Command(
            velocity=(x, y, z),
            frame=frame,
            rate=self.speed / ARM * self._motion.turn,
            joint=joint,
            request=request,
            message=message,
        )


class Terminal:
    """A terminal whose keys arrive at once and unseen, while the block lasts.

    However the block ends, the terminal is as it was before.

    Raises:
        InvalidArgument: if the input is not a terminal
    """

    def __init__(self, descriptor: int | None = None) -> None:
        """`descriptor` is the file descriptor of the terminal; by default standard input."""
        self._descriptor = sys.stdin.fileno() if descriptor is None else descriptor
        if not os.isatty(self._descriptor):
            raise InvalidArgument(
                "standard input is not a terminal, so there are no keys to read; --device gamepad "
                "or MODULE:FUNCTION needs none"
            )
        self._before = termios.tcgetattr(self._descriptor)

    def __enter__(self) -> Self:
        now = termios.tcgetattr(self._descriptor)
        now[3] &= ~(termios.ICANON | termios.ECHO)
        # Ctrl-Z would make the controller of a robot stand still, and Ctrl-\ would kill it with the
        # terminal as it is now. Both are keys like any other; Ctrl-C remains.
        disabled = os.fpathconf(self._descriptor, "PC_VDISABLE")
        for key in (termios.VSUSP, termios.VQUIT):
            now[6][key] = bytes([disabled])
        termios.tcsetattr(self._descriptor, termios.TCSADRAIN, now)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        # With what was typed meanwhile discarded, so that a shell does not take it for commands.
        termios.tcsetattr(self._descriptor, termios.TCSAFLUSH, self._before)

    def read(self) -> bytes | None:
        """Returns what was typed since the last call, without waiting; None after its end."""
        if not select.select([self._descriptor], [], [], 0)[0]:
            return b""
        try:
            return os.read(self._descriptor, 4096) or None
        except OSError:  # the other side has closed the terminal
            return None
