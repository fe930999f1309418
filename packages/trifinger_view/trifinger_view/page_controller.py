# SPDX-License-Identifier: BSD-3-Clause
"""Who steers a robot from a page, and what they may ask of it.

Of all browsers one is the driver. Only it moves the robot, by a Guide, and pulls at tips and
objects of a simulation, by a Hand. If nothing is heard of the driver for TIMEOUT, the robot holds
its pose, the hand lets go, and another browser can take over. Nothing here knows what a page is.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from trifinger import _trifinger
from trifinger.errors import Error, InvalidArgument, SessionNotFound, TimedOut

if TYPE_CHECKING:
    from trifinger._trifinger import Guide, GuideState, Hand
    from trifinger.arrays import Array

TIMEOUT = 1.0  # without a sign of life of the driver [s]
SETPOINT_PERIOD = 1 / 60  # between two setpoints of a drag [s]
PULL_LENGTH = 0.5  # after which the hand lets go if this process stands still [s]
CONNECT_TIMEOUT = 1.0  # [s]
RECOVERY_TIMEOUT = 30.0  # some robots are homing before their next session [s]
FARTHEST = 10.0  # point to which something can be dragged, from the origin [m]
MODES = ("home", "hold", "float")
MODE_WORDS = {
    "hold": "holds",
    "move_joints": "moves its joints",
    "move_frame": "moves to a point",
    "float": "floats",
    "home": "moves home",
}


class PageController:
    """The driver of a robot. Any thread may call any function.

    Calls of a browser that is not the driver raise InvalidArgument, and so do points and numbers
    that make no sense; what is asked then changes nothing.
    """

    def __init__(
        self,
        name: str,
        *,
        with_guide: bool = True,
        frames: Sequence[str] = (),
        timeout: float | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Nobody drives yet. Without a guide, the driver pulls by the hand alone.

        `frames` are those of `Guide`.
        """
        self.name = name
        self.with_guide = with_guide
        self._frames = tuple(frames)
        self._timeout = TIMEOUT if timeout is None else timeout
        self._clock = clock
        self.closed = threading.Event()
        """Set when the control has ended for good."""
        self._lock = threading.RLock()
        self._taking = threading.Lock()
        self._driver: int | None = None
        self._heard = 0.0
        self._words = ""
        self._guide: Guide | None = None
        self._hand: Hand | None = None
        self._tips: dict[str, str] = {}  # names of frames at tips, with what the hand calls these
        self._setpoints: dict[int, Array] = {}  # newest points of frames that are not yet sent
        self._sent = -np.inf
        self._pull: tuple[str, Array] | None = None

    # ---- who drives ----

    @property
    def driver(self) -> int | None:
        """The browser that drives; None if nobody does."""
        return self._driver

    @property
    def words(self) -> str:
        """Why something that was asked for is not done, or why nobody drives any more."""
        return self._words

    @property
    def guide(self) -> Guide | None:
        """What moves the robot; None before the first session and after the end of each."""
        return self._guide

    def connect(self, timeout: float = CONNECT_TIMEOUT) -> None:
        """Takes control of the robot, unless it has it. It may wait as long as `timeout` [s].

        Raises:
            ControlHeld: if another process controls the robot
            Error: if there is no robot, or it cannot be guided
        """
        if not self.with_guide:
            return
        with self._taking:
            guide = self._guide
            if guide is not None and guide.is_running():
                return
            guide = _trifinger.guide(self.name, frames=self._frames, timeout=timeout)
            with self._lock:
                self._setpoints.clear()
                self._guide = guide

    def take(self, browser: int) -> None:
        """Makes a browser the driver. The robot holds its pose at first.

        Raises:
            InvalidArgument: if another browser drives
            Error: as `connect`
        """
        self._require_free(browser)
        self.connect()
        with self._lock:
            self._require_free(browser)
            self._driver, self._heard = browser, self._clock()
            self._words = ""

    def leave(self, browser: int, why: str = "") -> None:
        """Ends the control of a browser, if it drives: the robot holds its pose."""
        with self._lock:
            if self._driver != browser:
                return
            self._driver = None
            self._words = why
            self._let_go()
            self._setpoints.clear()
            if self._guide is not None:
                try:
                    self._guide.hold()
                except Error:
                    self._end_guide()

    def heard(self, browser: int) -> None:
        """Notes a sign of life of a browser. It never waits, so that it holds up no connection."""
        if self._driver == browser:
            self._heard = self._clock()

    def complain(self, words: str) -> None:
        """Notes why something that was asked for is not done."""
        self._words = words

    def recover(self, timeout: float = RECOVERY_TIMEOUT) -> None:
        """Clears the fault that has stopped the robot, for an operator who has looked at it.

        Nobody drives then. It may wait as long as `timeout` [s].

        Raises:
            InvalidArgument: if the page controls nothing, or a browser drives
            Error: if there is no robot, or its next session does not begin
        """
        if not self.with_guide or self._driver is not None:
            raise InvalidArgument("there is no fault to recover from")
        self._words = "the robot recovers; it may move"
        _trifinger.recover(self.name, timeout)
        self._words = ""

    def begin_session(self, tips: Sequence[str] = ()) -> None:
        """Notes that another session has begun: why the one before has ended is no longer new.

        `tips` are the names of the robot's tips, in the order in which a hand counts them.
        """
        self._tips = {name: f"tip_{number}" for number, name in enumerate(tips)}
        if self._driver is None and self._guide is None:
            self._words = ""

    # ---- what the driver asks for ----

    def do(self, browser: int, mode: str) -> None:
        """Begins to hold, to move home or to float, by the name in MODES."""
        if mode not in MODES:
            raise InvalidArgument("there is no such button")
        with self._lock:
            guide = self._require(browser)
            {"home": guide.home, "hold": guide.hold, "float": guide.float_freely}[mode]()
            self._let_go()
            self._setpoints.clear()
            self._words = ""

    def move_joint(self, browser: int, joint: int, position: float) -> None:
        """Moves one joint to a position [rad], [m]; the others keep their targets."""
        with self._lock:
            guide = self._require(browser)
            if not 0 <= joint < guide.num_joints or not np.isfinite(position):
                raise InvalidArgument("there is no such joint, or its position is not a number")
            if self._setpoints:
                self._send_setpoints(at_once=True)  # they came first
            guide.move_joint(joint, position)
            self._words = ""

    def drag_frame(self, browser: int, frame: int, point: object) -> None:
        """Moves a frame to a point in the world frame [m].

        While the robot floats, the hand pulls instead at the tip that the frame is. If there is no
        guide, the frames are the tips.
        """
        where = _point(point)
        with self._lock:
            self._require_driver(browser)
            if not self.with_guide:
                self._begin_pull(f"tip_{frame}", where)
                return
            guide = self._require(browser)
            if not 0 <= frame < len(guide.frame_names):
                raise InvalidArgument("there is no such frame")
            if guide.state(timeout=0).mode == "float":
                name = guide.frame_names[frame]
                self._begin_pull(self._tips.get(name, name), where)  # it refuses what is no tip
                return
            self._setpoints[frame] = where
            self._send_setpoints()

    def drag_object(self, browser: int, name: str, point: object) -> None:
        """Pulls at an object of a simulation, towards a point in the world frame [m]."""
        where = _point(point)
        with self._lock:
            self._require_driver(browser)
            self._begin_pull(name, where)

    def drop(self, browser: int) -> None:
        """Lets go of what is dragged. A frame goes on to the last point that was asked for."""
        with self._lock:
            self._require_driver(browser)
            if self._setpoints:
                self._send_setpoints(at_once=True)
            self._let_go()

    # ---- by itself ----

    def tick(self) -> None:
        """Sends what waits, and ends the control of a driver that is not heard; call it at 60
        Hz.
        """
        with self._lock:
            driver = self._driver
            if driver is not None and self._clock() - self._heard > self._timeout:
                self.leave(
                    driver,
                    f"nothing was heard of the browser that drove for {self._timeout:g} s, so "
                    + ("the robot holds its pose" if self.with_guide else "the hand let go"),
                )
            guide = self._guide
            if guide is not None and not guide.is_running():
                self._end_guide()
            try:
                if self._setpoints:
                    self._send_setpoints()
                if self._pull is not None and self._hand is not None:
                    self._hand.pull(*self._pull, seconds=PULL_LENGTH)
            except Error as error:
                self._let_go()
                self._setpoints.clear()
                self._words = str(error)

    def state(self) -> GuideState | None:
        """Where the robot is and where it goes; None if this is not known."""
        guide = self._guide
        if guide is None:
            return None
        try:
            return guide.state(timeout=0)
        except Error:
            return None

    def line(self) -> str:
        """What the robot does, or why it does not do what was asked for, in a sentence."""
        words = self._words
        if words or not self.with_guide:
            return words
        state = self.state()
        if self._guide is None:
            return "nobody controls the robot from here; 'Take control' does"
        if state is None:
            return "the robot is not ready: it may be homing"
        words = f"the robot {MODE_WORDS.get(state.mode, state.mode)}"
        return f"{words}; {state.refusal}" if state.refusal else words

    def close(self) -> None:
        """Ends the control: the session ends in order, and the hand lets go."""
        self.closed.set()
        with self._lock:
            self._driver = None
            self._setpoints.clear()
            self._close_hand()
            guide, self._guide = self._guide, None
        if guide is not None:
            guide.finish()

    # ---- all of these with the lock ----

    def _require_free(self, browser: int) -> None:
        if self._driver not in (None, browser):
            raise InvalidArgument("another browser has control; it must release it first")

    def _require_driver(self, browser: int) -> None:
        if self._driver != browser:
            raise InvalidArgument("this browser does not have control")
        self._heard = self._clock()

    def _require(self, browser: int) -> Guide:
        self._require_driver(browser)
        if self._guide is None:
            raise InvalidArgument("nobody controls the robot from here")
        return self._guide

    def _send_setpoints(self, at_once: bool = False) -> None:
        now = self._clock()
        if self._guide is None or (not at_once and now - self._sent < SETPOINT_PERIOD):
            return
        self._sent = now
        setpoints, self._setpoints = self._setpoints, {}
        for frame, point in setpoints.items():
            self._guide.move_frame(frame, point)
        self._words = ""

    def _begin_pull(self, body: str, point: Array) -> None:
        if self._hand is None:
            try:
                self._hand = _trifinger.hand(self.name)
            except InvalidArgument as error:
                raise InvalidArgument(
                    "only a simulated robot can be pulled by the mouse; move this one by hand, or "
                    "press Hold"
                ) from error
        self._hand.pull(body, point, seconds=PULL_LENGTH)
        self._pull, self._words = (body, point), ""

    def _let_go(self) -> None:
        self._pull = None
        if self._hand is not None:
            self._hand.let_go()
        if self._driver is None:
            self._close_hand()

    def _close_hand(self) -> None:
        hand, self._hand, self._pull = self._hand, None, None
        if hand is not None:
            hand.close()

    def _end_guide(self) -> None:
        """Notes why the guide has ended. Nobody drives then."""
        guide, self._guide = self._guide, None
        self._driver = None
        self._setpoints.clear()
        self._close_hand()
        if guide is None:
            return
        try:
            guide.check()
            self._words = "the session has ended; 'Take control' controls the next one"
        except Error as error:
            self._words = str(error)


def pullable(robot: _trifinger.Frontend) -> bool:
    """Whether a robot is a simulation at which a hand can pull."""
    try:
        robot.companion("hand")
    except (SessionNotFound, TimedOut):
        return False
    return True


def _point(point: object) -> Array:
    """A point that something can be dragged to; raises InvalidArgument for anything else."""
    try:
        where = np.array(point, float)
    except (TypeError, ValueError) as error:
        raise InvalidArgument("a point has three numbers") from error
    if where.shape != (3,) or not np.isfinite(where).all() or np.abs(where).max() > FARTHEST:
        raise InvalidArgument(f"a point has three numbers, at most {FARTHEST:g} m from the origin")
    return where
