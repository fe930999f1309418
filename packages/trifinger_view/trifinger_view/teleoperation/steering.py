# SPDX-License-Identifier: BSD-3-Clause
"""Steers a guided robot by the commands of a device."""

import math
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

import numpy as np
import numpy.typing as npt
from trifinger.errors import Error, InvalidArgument

from trifinger_view.teleoperation.command import STILL, Command, Device, Velocity

PERIOD = 0.02
"""Time from one command to the next [s]."""
MAX_LEAD = 0.02
"""How far the target of a tip may be ahead of where the tip should be now [m]."""
MAX_SPEED = 0.15
"""Faster commands are slowed down to this: the guide moves tips no faster [m/s]."""


class SteeredState(Protocol):
    """What is needed of the state of a guided robot."""

    @property
    def reference_tips(self) -> npt.NDArray[np.float64]:
        """Where the tips should be now [m]; a row for each finger."""

    @property
    def refusal(self) -> str:
        """Why the last setpoints cannot be reached; empty if they can."""


class Steered(Protocol):
    """What is needed of a guide; `trifinger.Guide` has it."""

    @property
    def num_fingers(self) -> int:
        """Number of fingers."""

    def move_tip(self, finger: int, position: npt.ArrayLike) -> None:
        """Moves a tip to a point [m]."""

    def home(self) -> None:
        """Moves to the initial pose."""

    def hold(self) -> None:
        """Brakes and keeps the pose."""

    def float_freely(self) -> None:
        """Lets a hand move the robot."""

    def stop(self) -> None:
        """Ends the session at once."""

    def check(self) -> None:
        """Raises what ended the guide."""

    def state(self) -> SteeredState:
        """Where the robot is."""


class Steering:
    """Turns commands into requests to a guided robot.

    While a command has a velocity, the target of the tip goes ahead with it, at most MAX_LEAD in
    front of the tip. The first command without a velocity holds the robot.
    """

    def __init__(self, guide: Steered, num_fingers: int | None = None) -> None:
        self._guide = guide
        self._num_fingers = guide.num_fingers if num_fingers is None else num_fingers
        self._target: npt.NDArray[np.float64] | None = None
        self._finger = 0

    @property
    def finger(self) -> int:
        """The finger that velocities move, from 0."""
        return self._finger

    def obey(self, command: Command, elapsed: float) -> bool:
        """Does what `command` says; `elapsed` is the time since the last one [s].

        Returns False if the teleoperation has ended.

        Raises:
            InvalidArgument: if the command has no meaning for this robot; the robot holds
        """
        try:
            velocity = self._velocity_of(command)
        except InvalidArgument:
            self._guide.hold()
            raise
        if command.request == "stop":
            self._guide.stop()
            return False
        if command.finger is not None and command.finger != self._finger:
            self._rest()
            self._finger = command.finger
        if command.request:
            self._target = None
            {
                "home": self._guide.home,
                "hold": self._guide.hold,
                "end": self._guide.hold,
                "float": self._guide.float_freely,
            }[command.request]()
        elif velocity != STILL:
            self._move(np.array(velocity), elapsed)
        else:
            self._rest()
        return command.request != "end"

    def _rest(self) -> None:
        if self._target is not None:
            self._target = None
            self._guide.hold()

    def _move(self, velocity: npt.NDArray[np.float64], elapsed: float) -> None:
        tip = self._guide.state().reference_tips[self._finger]
        target = (tip if self._target is None else self._target) + velocity * elapsed
        ahead = target - tip
        distance = float(np.linalg.norm(ahead))
        if distance > MAX_LEAD:
            target = tip + ahead * (MAX_LEAD / distance)
        self._target = target
        self._guide.move_tip(self._finger, target)

    def _velocity_of(self, command: object) -> Velocity:
        if not isinstance(command, Command):
            raise InvalidArgument(
                f"the device returned {command!r}, must be a trifinger_view.teleoperation.Command"
            )
        if command.request not in ("", "home", "hold", "float", "stop", "end"):
            raise InvalidArgument.of_name(
                "request", command.request, ("home", "hold", "float", "stop", "end")
            )
        if command.finger is not None and command.finger not in range(self._num_fingers):
            raise InvalidArgument(
                f"the device chose finger {command.finger}, must be from 0 to "
                f"{self._num_fingers - 1}"
            )
        try:
            x, y, z = (float(value) for value in command.velocity)
        except (TypeError, ValueError) as error:
            raise InvalidArgument(
                f"the device wants velocity {command.velocity!r}, must be three numbers"
            ) from error
        speed = math.hypot(x, y, z)
        if not math.isfinite(speed):
            raise InvalidArgument(f"the device wants velocity {command.velocity}, must be finite")
        slower = min(1.0, MAX_SPEED / speed) if speed > 0 else 0.0
        return (slower * x, slower * y, slower * z)


def teleoperate(
    guide: Steered,
    device: Device,
    *,
    watch: Callable[[Command, int], None] | None = None,
    period: float = PERIOD,
    wait: Callable[[float], None] = time.sleep,
    now: Callable[[], float] = time.monotonic,
) -> None:
    """Moves a robot as a device says, until its command is "end" or "stop".

    However it ends, the robot holds, or its session has ended; an error of the device is raised
    after that. `watch` gets each command and the finger that it moves. `wait` and `now` are
    the clock of the loop [s].

    Raises:
        InvalidArgument: if a command has no meaning for this robot
        RobotStopped: if the session ends for another reason
    """
    steering = Steering(guide)
    last = now()
    try:
        while True:
            guide.check()
            command = device()
            # After a time in which nothing was heard of the device, a tip must not leap.
            elapsed = min(now() - last, 2 * period)
            last = now()
            goes_on = steering.obey(command, elapsed)
            if watch:
                watch(command, steering.finger)
            if not goes_on:
                return
            wait(max(0.0, last + period - now()))
    except BaseException:
        with suppress(Error):  # the one that ended it says more
            guide.hold()
        raise
