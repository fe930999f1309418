# SPDX-License-Identifier: BSD-3-Clause
"""What can be known about a session, and why it ended."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """Why a session ended."""

    code: str
    """As in "finished", "detached", "action_late", "driver"."""
    detail: int = 0
    """The driver's own code, or a count that belongs to `code`."""
    time_index: int = -1
    """Step at which the session ended, -1 before step 0."""
    needs_recovery: bool = False
    """True if the next session begins only after recover()."""


@dataclass(frozen=True, kw_only=True)
class SessionInfo:
    """What anybody may know about a session without taking part in it."""

    name: str
    type: str
    """Of the robot, as in "trifinger"; of a companion, its own."""
    is_companion: bool
    session_id: int
    is_real_time: bool
    realtime_lacks: tuple[str, ...]
    """In real-time mode what the loop lacks to be a real-time thread, with the remedy."""
    period: float
    """[s]"""
    created: float
    """Seconds since 1970, as time.time()."""
    host: str
    backend_pid: int
    controller_pid: int | None
    """None: nobody controls."""
    backend_is_alive: bool
    since_heartbeat: float
    """How long ago the loop gave its last sign of life [s]."""
    phase: str
    """"preparing", "holding", "running" or "ended"."""
    steps: int
    """Whole steps so far."""
    fault: Fault | None
    """None before the end."""
    fault_text: str
    """A sentence; empty before the end."""
