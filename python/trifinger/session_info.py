# SPDX-License-Identifier: BSD-3-Clause
"""Facts about a session, and why it ended."""

import os
from dataclasses import dataclass
from pathlib import Path


def session_folder() -> Path:
    """The folder with the files of sessions: $TRIFINGER_SESSION_DIR, default /dev/shm."""
    return Path(os.environ.get("TRIFINGER_SESSION_DIR") or "/dev/shm")  # noqa: S108 (as in C++)


@dataclass(frozen=True)
class Fault:
    """Why a session ended."""

    code: str
    """The kind of end, such as "finished", "detached", "action_late" or "driver"."""
    detail: int = 0
    """The driver's own code, or a count that belongs to `code`."""
    time_index: int = -1
    """Step at which the session ended, -1 before step 0."""
    needs_recovery: bool = False
    """True if the next session begins only after recover()."""


@dataclass(frozen=True, kw_only=True)
class SessionInfo:
    """Facts about a session that can be read without attaching to it."""

    name: str
    type: str
    """Type of the robot, such as "trifinger", or type of the companion."""
    is_companion: bool
    session_id: int
    is_real_time: bool
    realtime_warnings: tuple[str, ...]
    """What keeps the loop from being a real-time thread, with remedies; empty without real time."""
    period: float
    """Time from one step to the next [s]."""
    created: float
    """When the session was made, in seconds since 1970, like time.time()."""
    host: str
    backend_pid: int
    controller_pid: int | None
    """None if nobody controls the robot."""
    backend_is_alive: bool
    since_heartbeat: float
    """Time since the last sign of life of the loop [s]."""
    phase: str
    """"preparing", "holding", "running" or "ended"."""
    steps: int
    """Number of complete steps so far."""
    waiting_actions: int
    """Number of actions that wait for their step; 0 if this user may not look at them."""
    fault: Fault | None
    """None before the end."""
    fault_text: str
    """A sentence; empty before the end."""
