# SPDX-License-Identifier: BSD-3-Clause
"""The page of a log: a frame of it, and a time line to play, pause, scrub and jump to the fault."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from trifinger.errors import Error
from trifinger.log.plot.panels import GROUPS

from trifinger_view.curves import SECONDS, Window, series_of
from trifinger_view.frame import Frame
from trifinger_view.logged import MARKS, WARNINGS, LoggedRun
from trifinger_view.page import Page
from trifinger_view.playing import TimeLine
from trifinger_view.to_browser import MOMENTS, message
from trifinger_view.words import Line

if TYPE_CHECKING:
    from trifinger.arrays import Array

AHEAD = 0.2  # part of the curves that is later than what the page shows
SLOW_PERIOD = 0.2  # between renewals of curves, words and images [s]


class LogPage:
    """Shows a log in a page. One thread calls `renew`; browsers use the time line at any time."""

    def __init__(
        self, page: Page, run: LoggedRun, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Adds a time line to the page, which stands at the first step."""
        self.line = TimeLine(
            0.0, run.end, fault=run.fault.time if run.fault is not None else None, clock=clock
        )
        """The time line. Pages of all browsers share it."""
        self._page, self._run, self._clock = page, run, clock
        self._renewed = -math.inf
        self._shown: float | None = None
        self._curves_shown: float | None = None
        self._told: dict[str, Any] = {}
        self._groups = GROUPS.get(run.session.type, ())
        page.begin(
            run.scene,
            run.session.name,
            run.log.files[0].name,
            moments=self._moments(),
            ink=run.ink,
            line={"end": run.end, "fault": self.line.fault, **self._state()},
        )
        page.server.on_message = lambda _, asked: self.do(asked)

    def renew(self, is_watched: bool = True) -> None:
        """Shows where the time line is by now. Does nothing if nobody watches."""
        if not is_watched:
            return
        position, now = self.line.position, self._clock()
        is_time = now - self._renewed >= SLOW_PERIOD
        if position != self._shown or (is_time and self._curves_shown != position):
            frame = self._run.frame_at(position, with_images=is_time)
            self._page.show(frame)
            self._shown = position
            if is_time:
                self._renewed, self._curves_shown = now, position
                self._page.show_images(frame.images)
                self._page.show_state(self._lines(frame))
                self._page.show_curves(self.curves_at(position), self._groups)
        told = self._state()
        if told != self._told:
            self._told = told
            self._page.server.put("line", message("line", **told))

    def do(self, asked: dict[str, Any]) -> None:
        """Does what a browser asks for; what makes no sense changes nothing."""
        line = self.line
        acts: dict[str, Callable[[], Any]] = {
            "toggle": line.toggle,
            "fault": line.jump_to_fault,
            "loop": lambda: setattr(line, "is_looping", bool(asked["isLooping"])),
            "move": lambda: line.move_to(float(asked["time"])),
            "skip": lambda: line.step(float(asked["seconds"])),
            "step": lambda: self._step(int(asked["steps"])),
            "speed": lambda: setattr(line, "speed", float(asked["speed"])),
        }
        with contextlib.suppress(Error, KeyError, OverflowError, TypeError, ValueError):
            acts[asked["do"]]()

    def curves_at(self, position: float) -> Window:
        """Curves of the seconds around a time of the log [s]."""
        run = self._run
        first = run.step_at(position - (1 - AHEAD) * SECONDS)
        last = run.step_at(position + AHEAD * SECONDS) + 1
        series = ("observation", "desired_action", "status")
        steps = run.session.read(first, last, series)
        window = Window()
        if len(steps):
            times = steps.times.astype(np.int64)
            window.add(
                run.time_of(int(steps.time_index[0])) + (times - times[0]) * 1e-9,
                series_of(
                    steps.observations,
                    steps.desired_actions,
                    steps.statuses,
                    run.session.period,
                    run.session.is_real_time,
                ),
            )
        return window

    def _state(self) -> dict[str, Any]:
        line = self.line
        return {
            "position": line.position,
            "isPlaying": line.is_playing,
            "isLooping": line.is_looping,
            "speed": line.speed,
        }

    def _moments(self) -> Iterator[tuple[Array | None, Mapping[str, Array]]]:
        """Some poses of the robot and its objects, from the first step to the last."""
        for time_of in np.linspace(0.0, self._run.end, MOMENTS):
            frame = self._run.frame_at(float(time_of), with_images=False)
            yield frame.position, frame.objects

    def _step(self, steps: int) -> None:
        run = self._run
        self.line.pause()
        step = run.step_at(self.line.position) + steps
        self.line.move_to(run.time_of(min(max(step, run.first), run.last)))

    def _lines(self, frame: Frame) -> list[Line]:
        run = self._run
        is_bad = frame.fault is not None and frame.fault.needs_recovery
        marks = enumerate(MARKS)
        is_wrong = any(WARNINGS >> bit & 1 and mark in frame.status for bit, mark in marks)
        lines = [
            Line("state", frame.status, "bad" if is_bad else "warning" if is_wrong else ""),
            Line("step", f"{frame.time_index}"),
            Line("time", f"{frame.time:.3f} of {run.end:.3f} s"),
        ]
        if run.fault is not None and not is_bad:
            lines.append(Line("fault", f"{run.fault.text} (at {run.fault.time:.3f} s)", "bad"))
        if run.scene is None:
            lines.append(Line("model", "the robot has no model to show"))
        return lines
