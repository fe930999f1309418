# SPDX-License-Identifier: BSD-3-Clause
"""What a device of teleoperation says, many times a second."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

Request = Literal["", "home", "hold", "float", "stop", "end"]
Velocity = tuple[float, float, float]
STILL: Velocity = (0.0, 0.0, 0.0)
ARM = 0.1
"""Distance at which a joint moves a point with the chosen speed of a device [m]."""


@dataclass(frozen=True, kw_only=True)
class Command:
    """What the person at a device wants now.

    A command says nothing about the next one: a device that wants something to go on says so each
    time. If it wants both a frame and a joint to move, the frame moves.
    """

    velocity: Velocity = STILL
    """Of the frame, in the world frame [m/s]. What moved stops when this and `rate` are zero."""
    frame: int | None = None
    """The frame to move from now on, from 0: the tip of a finger, or one of `Guide.frame_names`;
    None: the one that was chosen before."""
    rate: float = 0.0
    """Of the joint [rad/s]; of a joint that slides 0.1 m count as 1 rad."""
    joint: int | None = None
    """The joint to move from now on, from 0; None: the one that was chosen before."""
    request: Request = ""
    """Something else than to move a frame or a joint.

    "home", "hold" and "float" are those of `Guide`. "stop" ends the session at once. "end" holds
    the robot and ends the teleoperation.
    """
    message: str = ""
    """A sentence for the person, such as that the device is unplugged."""


Device = Callable[[], Command]
"""Is called many times a second, and returns without waiting."""


_URGENT: tuple[Request, ...] = ("hold", "end", "stop")


def more_urgent(earlier: Request, later: Request) -> Request:
    """The request that counts of two that came together: what stops the robot more, or the
    later.
    """
    if later and (earlier not in _URGENT or later in _URGENT[_URGENT.index(earlier) :]):
        return later
    return earlier
