# SPDX-License-Identifier: BSD-3-Clause
"""A time line that plays: play, pause, speed, jump, step, loop. It knows neither logs nor pages.

    line = TimeLine(0.0, log_duration, fault=log_fault_time)
    line.play()
    while True:
        show(log.frame_at(line.position))

The position follows a clock. Nothing has to be called regularly, so a page that draws slowly leaves
out frames but plays at the right speed.
"""

import math
import threading
import time
from collections.abc import Callable

from trifinger.errors import InvalidArgument

SLOWEST, FASTEST = 0.1, 10.0
"""Limits of the speed, relative to real time."""


class TimeLine:
    """A position between two times [s] that moves while it plays. Any thread may use it."""

    def __init__(
        self,
        begin: float,
        end: float,
        *,
        fault: float | None = None,
        is_looping: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """A time line that stands at its beginning. `clock` gives seconds and never goes back.

        Raises:
            InvalidArgument: if a time is not finite, or the end lies before the beginning
        """
        if not (math.isfinite(begin) and math.isfinite(end) and begin <= end):
            raise InvalidArgument(
                f"a time line from {begin} s to {end} s: it must begin before it ends"
            )
        self.begin = begin
        """First time [s]."""
        self.end = end
        """Last time [s]."""
        self.fault = None if fault is None else min(max(fault, begin), end)
        """Time of the fault [s]; None without a fault."""
        self._clock = clock
        self._lock = threading.RLock()
        self._position = begin  # at the time `_since` of the clock
        self._since = clock()
        self._speed = 1.0
        self._is_playing = False
        self._is_looping = is_looping

    @property
    def position(self) -> float:
        """The time to show now [s], from `begin` to `end`."""
        with self._lock:
            return self._follow()

    @property
    def is_playing(self) -> bool:
        """Whether the position moves. False as soon as the end is reached, unless it loops."""
        with self._lock:
            self._follow()
            return self._is_playing

    @property
    def speed(self) -> float:
        """Seconds of the log in a second."""
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        """Goes on at another speed from where it is.

        Raises:
            InvalidArgument: if it is slower than `SLOWEST` or faster than `FASTEST`
        """
        if not SLOWEST <= speed <= FASTEST:
            raise InvalidArgument(
                f"a speed of {speed}: it must be from {SLOWEST:g} to {FASTEST:g} times real time"
            )
        with self._lock:
            self._follow()
            self._speed = speed

    @property
    def is_looping(self) -> bool:
        """Whether it begins again at the end."""
        return self._is_looping

    @is_looping.setter
    def is_looping(self, is_looping: bool) -> None:
        with self._lock:
            self._follow()
            self._is_looping = is_looping

    def play(self) -> None:
        """Moves on; from the beginning if it stands at the end."""
        with self._lock:
            if self._follow() >= self.end:
                self._position = self.begin
            self._is_playing = self.end > self.begin

    def pause(self) -> None:
        """Stands still where it is."""
        with self._lock:
            self._follow()
            self._is_playing = False

    def toggle(self) -> None:
        """Plays if it stands still, and stands still if it plays."""
        with self._lock:
            if self.is_playing:
                self.pause()
            else:
                self.play()

    def move_to(self, position: float) -> None:
        """Goes to a time [s], or to the nearer end. It goes on from there if it plays.

        Raises:
            InvalidArgument: if the time is not a number
        """
        if math.isnan(position):
            raise InvalidArgument("the time to go to is not a number")
        with self._lock:
            self._follow()
            self._position = min(max(position, self.begin), self.end)

    def step(self, seconds: float) -> None:
        """Stands still at a time that is `seconds` later, or earlier if they are negative."""
        with self._lock:
            self.pause()
            self.move_to(self._position + seconds)

    def jump_to_fault(self) -> bool:
        """Stands still at the fault. Returns False, and changes nothing, without a fault."""
        with self._lock:
            if self.fault is None:
                return False
            self.pause()
            self.move_to(self.fault)
            return True

    def _follow(self) -> float:
        """Moves the position to where it is by now. The caller holds the lock."""
        now = self._clock()
        passed, self._since = max(now - self._since, 0.0), now
        if not self._is_playing:
            return self._position
        position = self._position + passed * self._speed
        if position >= self.end:
            if self._is_looping:
                if not passed:  # whoever moved it to the end sees the end
                    return position
                position = self.begin + (position - self.begin) % (self.end - self.begin)
            else:
                position, self._is_playing = self.end, False
        self._position = position
        return position
