# SPDX-License-Identifier: BSD-3-Clause
"""Steers a guided robot by the commands of a device."""

import math
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Protocol

import numpy as np
import numpy.typing as npt
from trifinger.errors import Error, InvalidArgument

from trifinger_view.teleoperation.command import STILL, Command, Device, Velocity

PERIOD = 0.02
"""Time from one command to the next [s]."""
MAX_LEAD = 0.02
"""How far the target of a frame may be ahead of where the frame should be now [m]."""
MAX_SPEED = 0.15
"""Faster commands are slowed down to this: the guide moves frames no faster [m/s]."""
MAX_JOINT_LEAD = 0.1
"""How far the target of a joint may be ahead of where the joint should be now [rad]."""
MAX_RATE = 1.0
"""Faster commands are slowed down to this: the guide moves joints no faster [rad/s]."""
NO_FRAMES = "no end of this robot has a name: --frame, or frames=, names frames to move"
SLIDE = 0.1
"""So many metres of a slide count as 1 rad."""


Place = npt.NDArray[np.float64]


class SteeredState(Protocol):
    """What is needed of the state of a guided robot."""

    @property
    def reference_frames(self) -> npt.NDArray[np.float64]:
        """Where the frames should be now [m]; a row for each."""

    @property
    def reference_joints(self) -> npt.NDArray[np.float64]:
        """Where the joints should be now [rad], [m]."""

    @property
    def refusal(self) -> str:
        """Why the last setpoints cannot be reached; empty if they can."""


class Steered(Protocol):
    """What is needed of a guide; `trifinger.Guide` has it."""

    @property
    def frame_names(self) -> tuple[str, ...]:
        """The frames that can be moved."""

    @property
    def joint_units(self) -> tuple[str, ...]:
        """The unit of each joint: "rad" or "m"."""

    def move_frame(self, frame: int, position: npt.ArrayLike) -> None:
        """Moves a frame to a point [m]."""

    def move_joint(self, joint: int, position: float) -> None:
        """Moves one joint to a position [rad], [m]; the others keep their targets."""

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

    While a command has a velocity or a rate, the target of its frame or joint goes ahead with it,
    at most MAX_LEAD or MAX_JOINT_LEAD in front. The first command without them holds the robot.
    """

    def __init__(self, guide: Steered) -> None:
        self._guide = guide
        self._frames, self._units = guide.frame_names, guide.joint_units
        self._place: Place | None = None  # where the frame shall be
        self._position: float | None = None  # where the joint shall be
        self._frame = self._joint = 0
        self._moves_joint = False
        self.refusal = ""
        """Why the robot holds instead of doing the last request; empty if it does it."""

    @property
    def frame(self) -> int:
        """The frame that velocities move, from 0."""
        return self._frame

    def obey(self, command: Command, elapsed: float) -> bool:
        """Does what `command` says; `elapsed` is the time since the last one [s].

        Returns False if the teleoperation has ended. A robot that cannot do a request holds: see
        `refusal`.

        Raises:
            InvalidArgument: if the command has no meaning for this robot; the robot holds
        """
        try:
            velocity, rate = self._motion_of(command)
        except InvalidArgument:
            self._guide.hold()
            raise
        if command.request == "stop":
            self._guide.stop()
            return False
        frame = self._frame if command.frame is None else command.frame
        joint = self._joint if command.joint is None else command.joint
        # What rests does not change from one to the other.
        moves_joint = velocity == STILL and (rate != 0.0 or self._moves_joint)
        if (frame, joint, moves_joint) != (self._frame, self._joint, self._moves_joint):
            self._rest()
        self._frame, self._joint, self._moves_joint = frame, joint, moves_joint
        self.refusal = ""
        if command.request:
            self._place = self._position = None
            try:
                {
                    "home": self._guide.home,
                    "hold": self._guide.hold,
                    "end": self._guide.hold,
                    "float": self._guide.float_freely,
                }[command.request]()
            except InvalidArgument as error:
                self._guide.hold()
                self.refusal = str(error)
        elif velocity != STILL:
            self._move(np.array(velocity), elapsed)
        elif rate != 0.0:
            self._turn(rate, elapsed)
        else:
            self._rest()
        return command.request != "end"

    def _rest(self) -> None:
        if self._place is not None or self._position is not None:
            self._place = self._position = None
            self._guide.hold()

    def _move(self, velocity: Place, elapsed: float) -> None:
        place = self._guide.state().reference_frames[self._frame]
        target = (place if self._place is None else self._place) + velocity * elapsed
        ahead = target - place
        distance = float(np.linalg.norm(ahead))
        if distance > MAX_LEAD:
            target = place + ahead * (MAX_LEAD / distance)
        self._place = target
        self._guide.move_frame(self._frame, target)

    def _turn(self, rate: float, elapsed: float) -> None:
        radian = SLIDE if self._units[self._joint] == "m" else 1.0
        position = float(self._guide.state().reference_joints[self._joint])
        target = (position if self._position is None else self._position) + rate * elapsed * radian
        lead = MAX_JOINT_LEAD * radian
        self._position = min(max(target, position - lead), position + lead)
        self._guide.move_joint(self._joint, self._position)

    def _motion_of(self, command: object) -> tuple[Velocity, float]:
        if not isinstance(command, Command):
            raise InvalidArgument(
                f"the device returned {command!r}, must be a trifinger_view.teleoperation.Command"
            )
        if command.request not in ("", "home", "hold", "float", "stop", "end"):
            raise InvalidArgument.of_name(
                "request", command.request, ("home", "hold", "float", "stop", "end")
            )
        for what, chosen, count in (
            ("frame", command.frame, len(self._frames)),
            ("joint", command.joint, len(self._units)),
        ):
            if chosen is not None and chosen not in range(count):
                raise InvalidArgument(
                    f"the device chose {what} {chosen}, must be from 0 to {count - 1}"
                    if count
                    else NO_FRAMES
                )
        try:
            x, y, z = (float(value) for value in command.velocity)
            rate = float(command.rate)
        except (TypeError, ValueError) as error:
            raise InvalidArgument(
                f"the device wants velocity {command.velocity!r} and rate {command.rate!r}, "
                "must be three numbers and one"
            ) from error
        speed = math.hypot(x, y, z)
        if not (math.isfinite(speed) and math.isfinite(rate)):
            raise InvalidArgument(
                f"the device wants velocity {command.velocity} and rate {rate}, must be finite"
            )
        if speed > 0 and not self._frames:
            raise InvalidArgument(NO_FRAMES)
        slower = min(1.0, MAX_SPEED / speed) if speed > 0 else 0.0
        return (slower * x, slower * y, slower * z), min(max(rate, -MAX_RATE), MAX_RATE)


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
    after that. `watch` gets each command and the frame that it moves. `wait` and `now` are
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
            # After a time in which nothing was heard of the device, nothing must leap.
            elapsed = min(now() - last, 2 * period)
            last = now()
            goes_on = steering.obey(command, elapsed)
            if watch:
                said = replace(command, message=steering.refusal) if steering.refusal else command
                watch(said, steering.frame)
            if not goes_on:
                return
            wait(max(0.0, last + period - now()))
    except BaseException:
        with suppress(Error):  # the one that ended it says more
            guide.hold()
        raise
