# SPDX-License-Identifier: BSD-3-Clause
"""The page of a log: a frame of it, and a time line to play, pause, scrub and jump to the fault."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from trifinger_view.curves import SECONDS, Window, series_of
from trifinger_view.frame import Frame
from trifinger_view.logged import LoggedRun
from trifinger_view.page import Page
from trifinger_view.playing import TimeLine
from trifinger_view.words import Line

SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "5", "10")
SECONDS_OF = {"-1 s": -1.0, "+1 s": 1.0}
STEPS_OF = {"-1 step": -1, "+1 step": 1}
AHEAD = 0.2  # part of the curves that is later than what the page shows
QUIET = 0.5  # for so long after a hand moved the slider, the page does not [s]
SLOW_PERIOD = 0.2  # between renewals of curves, words and images [s]


class LogPage:
    """Shows a log in a page. One thread calls `renew`; browsers use the panel at any time."""

    def __init__(
        self, page: Page, run: LoggedRun, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Adds a time line to the page, which stands at the first step."""
        self.line = TimeLine(
            0.0, run.end, fault=run.fault.time if run.fault is not None else None, clock=clock
        )
        """The time line. Pages of all browsers share it."""
        self._page, self._run, self._clock = page, run, clock
        self._touched = -math.inf
        self._renewed = -math.inf
        self._shown: float | None = None
        self._curves_shown: float | None = None
        page.begin(run.scene)
        with page.server.gui.add_folder("Time line", order=0.5):
            self._add_panel(page.server.gui, run)

    def renew(self, is_watched: bool = True) -> None:
        """Shows where the time line is by now. Does nothing if nobody watches."""
        if not is_watched:
            return
        position, now = self.line.position, self._clock()
        is_time = now - self._renewed >= SLOW_PERIOD
        is_new = position != self._shown or self._page.scene.is_outdated
        if is_new or (is_time and self._curves_shown != position):
            frame = self._run.frame_at(position, with_images=is_time)
            self._page.show(frame)
            self._shown = position
            if is_time:
                self._renewed, self._curves_shown = now, position
                self._page.show_images(frame.images)
                self._page.show_state(self._lines(frame))
                self._page.show_curves(self.curves_at(position))
        self._show_panel(position, now)

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

    def _add_panel(self, gui: Any, run: LoggedRun) -> None:
        self._slider = gui.add_slider(
            "time [s]", min=0.0, max=max(run.end, 0.001), step=0.001, initial_value=0.0
        )
        self._play = gui.add_button("Play")
        steps = gui.add_button_group("step", ("-1 s", "-1 step", "+1 step", "+1 s"))
        speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
        loop = gui.add_checkbox("loop", False)
        fault = gui.add_button("Jump to the fault", disabled=run.fault is None)

        self._slider.on_update(lambda event: self._move(event.client is not None))
        self._play.on_click(lambda _: self.line.toggle())
        fault.on_click(lambda _: self.line.jump_to_fault())
        steps.on_click(lambda _: self._step(steps.value))
        speed.on_update(lambda _: self._set_speed(speed.value))
        loop.on_update(lambda _: setattr(self.line, "is_looping", bool(loop.value)))

    def _move(self, is_by_hand: bool) -> None:
        position = self._slider.value
        if is_by_hand and math.isfinite(position):
            self._touched = self._clock()
            self.line.move_to(position)

    def _step(self, what: str) -> None:
        run = self._run
        if what in SECONDS_OF:
            self.line.step(SECONDS_OF[what])
        elif what in STEPS_OF:
            self.line.pause()
            step = run.step_at(self.line.position) + STEPS_OF[what]
            self.line.move_to(run.time_of(min(max(step, run.first), run.last)))

    def _set_speed(self, speed: str) -> None:
        if speed in SPEEDS:  # a browser can send anything
            self.line.speed = float(speed)

    def _show_panel(self, position: float, now: float) -> None:
        label = "Pause" if self.line.is_playing else "Play"
        if self._play.label != label:
            self._play.label = label
        if now - self._touched >= QUIET and abs(self._slider.value - position) > 0.0005:
            self._slider.value = round(position, 3)

    def _lines(self, frame: Frame) -> list[Line]:
        run = self._run
        is_bad = frame.fault is not None and frame.fault.needs_recovery
        lines = [
            Line("state", frame.status, "bad" if is_bad else ""),
            Line("step", f"{frame.time_index}"),
            Line("time", f"{frame.time:.3f} of {run.end:.3f} s"),
            Line("robot", run.session.name),
        ]
        if run.fault is not None and not is_bad:
            lines.append(Line("fault", f"{run.fault.text} (at {run.fault.time:.3f} s)"))
        if run.scene is None:
            lines.append(Line("model", "the robot has no model to show"))
        return lines
