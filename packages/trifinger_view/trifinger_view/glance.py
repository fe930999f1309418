# SPDX-License-Identifier: BSD-3-Clause
"""What a page of many robots is told of one: its state, since when, its rate, its last fault."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

from trifinger_view.page_server import GLANCE_PERIOD
from trifinger_view.to_browser import message
from trifinger_view.words import Line, facts_of

if TYPE_CHECKING:
    from trifinger_view.live import LiveRun


class Glance:
    """The state of a robot, once in a GLANCE_PERIOD. It remembers the last fault that it saw."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._told = -float("inf")
        self._state: tuple[int | None, str] | None = None
        self._since = 0.0
        self._saw_begin = False
        self._fault, self._fault_seen = "", 0.0
        self._counted: tuple[int | None, int, float] = (None, 0, 0.0)

    def is_due(self) -> bool:
        """Whether it is time for the next message."""
        return self._clock() - self._told >= GLANCE_PERIOD

    def message(self, live: LiveRun, lines: Sequence[Line]) -> bytes:
        """The message about a robot, whose state is said by `lines`."""
        now = self._told = self._clock()
        state = (live.session_id, lines[0].text)
        if state != self._state:
            self._saw_begin = self._state is not None
            self._state, self._since = state, now
        bad = [line.text for line in lines if line.level == "bad"]
        if bad:
            self._fault, self._fault_seen = bad[-1], now
        step = live.frame.time_index if live.frame is not None else -1
        session, before, counted = self._counted
        self._counted = (live.session_id, step, now)
        is_running = live.info is not None and live.info.phase == "running" and not bad
        is_known = is_running and session == live.session_id and now > counted
        return message(
            "glance",
            title=live.info.name if live.info is not None else live.wanted or "no robot",
            facts=facts_of(live.info) if live.info is not None else "",
            lines=[asdict(line) for line in lines],
            age=now - self._since,
            isAgeKnown=self._saw_begin,
            rate=(step - before) / (now - counted) if is_known else None,
            lastFault="" if bad else self._fault,
            faultAge=now - self._fault_seen,
        )
