# SPDX-License-Identifier: BSD-3-Clause
"""The part of a page that steers a robot: buttons, sliders, and handles at tips and objects.

Only the browser that drives has sliders and handles: they exist in its connection alone, so that
messages of others cannot mean them. Its connection is asked for a sign of life four times a
second. What it asks for is done in order by a thread of its own, so that nothing holds up the
thread of the connections, which also serves the stop.
"""

from __future__ import annotations

import asyncio
import contextlib
import html
import queue
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from trifinger.errors import Error

from trifinger_view.page_controller import (
    MODES,
    SETPOINT_PERIOD,
    PageController,
    pullable,
)
from trifinger_view.stop import Stop

if TYPE_CHECKING:
    from trifinger._trifinger import Guide

    from trifinger_view.authentication import Authentication
    from trifinger_view.live import LiveRun
    from trifinger_view.page import Page

ASK_PERIOD = 0.25  # between two questions for a sign of life [s]
TOUCHED = 1.0  # for so long after a touch a slider does not follow the robot [s]
SLIDER_PERIOD = 0.1  # between two steps of a slider that follows [s]
HANDLE_SIZE = 0.05  # [m]
MAX_WAITING = 1000  # things that a browser has asked for; more are not done
WARNING_COLOUR = (179, 107, 0)
GUIDE_WORDS = "Drag a handle of the robot: it follows. An object of a simulation is pulled."
HAND_WORDS = "Drag a tip or an object by its handle: it is pulled until you let go."
NO_LIMIT = {"rad": 3.14, "m": 1.0}  # end of a slider of a joint without limits
FARTHEST_LIMIT = 1000.0  # [rad], [m]; joints without limits have larger ones
STEP = {"rad": 0.005, "m": 0.0005}  # of a slider


def add_stop(authentication: Authentication, name: str) -> None:
    """Adds a button to the page that stops the robot whatever else the page does."""
    stop = Stop(name)
    authentication.offer("/stop", stop.order)
    authentication.offer("/stopped", stop.outcome)
    part = (Path(__file__).parent / "stop_button.html").read_text(encoding="utf-8")
    authentication.add_to_page(part.replace("@ROBOT@", _text(name)))


class ControlPanel:
    """The panel of a page, for all browsers. Its thread ends when the controller is closed."""

    def __init__(self, page: Page, controller: PageController) -> None:
        self._server, self._controller = page.server, controller
        self._lock = threading.Lock()  # of the seat
        self._recovering = threading.Lock()
        self._seat: _Seat | None = None
        self._robot: _Robot | None = None
        self._shown: tuple[str, bool] | None = None
        gui = self._server.gui
        with gui.add_folder("Control" if controller.with_guide else "Hand", order=0.5):
            self._words = gui.add_html("")
            self._take = gui.add_button(
                "Take control" if controller.with_guide else "Take the hand"
            )
            self._recover = gui.add_button(
                "Recover",
                hint="Clears the fault that has stopped the robot. Look at the robot first.",
                color=WARNING_COLOUR,
                visible=False,
            )
        self._take.on_click(self._on_take)
        self._recover.on_click(self._on_recover)
        self._server.on_client_disconnect(self._on_gone)
        self._work: queue.SimpleQueue[tuple[int, Callable[[], None]]] = queue.SimpleQueue()
        for act in (self._tick, self._do_work):
            threading.Thread(target=act, daemon=True).start()

    def begin(self, live: LiveRun) -> None:
        """Notes the robot of another session."""
        self._robot = _Robot(live) if live.robot is not None else None
        self._controller.begin_session(live.scene.tip_names if live.scene is not None else ())
        with self._lock:
            if self._seat is not None:
                self._seat.begin(self._robot)

    def renew(self, live: LiveRun) -> None:
        """Shows who drives and what the robot does, and moves sliders and handles with it."""
        driver = self._controller.driver
        self._show_recovery(live)
        with self._lock:
            if self._seat is not None and self._seat.browser != driver:
                self._seat.remove()
                self._seat = None
            if self._seat is not None:
                self._seat.renew(live)
        what = "control" if self._controller.with_guide else "the hand"
        who = "" if driver is None else f"a browser has {what}; the others look"
        lines = [line for line in (self._controller.line(), who) if line]
        shown = (
            "".join(map(_note, lines)),
            driver is not None,
        )
        if shown != self._shown:
            self._shown = shown
            self._words.content, self._take.disabled = shown

    def _show_recovery(self, live: LiveRun) -> None:
        """Offers to recover exactly while a fault has stopped a robot that could go on."""
        info = live.info
        fault = info.fault if info is not None and info.backend_is_alive else None
        is_needed = self._controller.with_guide and fault is not None and fault.needs_recovery
        if self._recover.visible != is_needed:
            self._recover.visible, self._take.visible = is_needed, not is_needed

    def _on_recover(self, _: Any) -> None:
        with self._recovering:
            if not self._recover.visible:
                return  # a second press
            try:
                self._controller.recover()
            except Error as error:
                self._controller.complain(str(error))

    def _on_take(self, event: Any) -> None:
        client = event.client
        if client is None:
            return
        try:
            self._controller.take(client.client_id)
        except Error as error:
            self._controller.complain(str(error))
            return
        with self._lock:
            if self._seat is not None:
                if self._seat.browser == client.client_id:
                    return  # a second press
                self._seat.remove()
            self._seat = _Seat(client, self._controller, self._robot, self._ask_for)
        asyncio.run_coroutine_threadsafe(self._ask(client.client_id), self._server._event_loop)

    def _on_gone(self, client: Any) -> None:
        self._controller.leave(
            client.client_id,
            "the browser that drove has gone, so "
            + ("the robot holds its pose" if self._controller.with_guide else "the hand let go"),
        )

    async def _ask(self, browser: int) -> None:
        """Asks the connection of the driver for signs of life while it drives."""
        while self._controller.driver == browser:
            connection = self._server._websock_server._live_connections.get(browser)
            if connection is None:
                return
            try:
                await (await connection.ping())
            except Exception:  # however the connection ends, nobody is heard
                return
            self._controller.heard(browser)
            await asyncio.sleep(ASK_PERIOD)

    def _ask_for(self, browser: int, act: Callable[[], None]) -> None:
        if self._work.qsize() < MAX_WAITING:
            self._work.put((browser, act))

    def _do_work(self) -> None:
        while not self._controller.closed.is_set():
            try:
                browser, act = self._work.get(timeout=ASK_PERIOD)
            except queue.Empty:
                continue
            try:
                act()
            except Exception as error:  # whatever was asked for, what comes next is done
                if self._controller.driver == browser:  # else it has lost control, which was said
                    self._controller.complain(str(error))

    def _tick(self) -> None:
        while not self._controller.closed.wait(SETPOINT_PERIOD):
            try:
                self._controller.tick()
            except Exception as error:  # a driver that is not heard must lose control in any case
                self._controller.complain(str(error))


class _Robot:
    """What handles must know of a robot."""

    def __init__(self, live: LiveRun) -> None:
        self.objects: tuple[str, ...] = ()
        self.can_be_pulled = False
        self.tips = 0  # at which a hand can pull
        robot = live.robot
        if robot is None:
            return
        with contextlib.suppress(Error):
            self.can_be_pulled = pullable(robot)
        if self.can_be_pulled and live.scene is not None:
            self.objects = live.scene.object_names
            self.tips = len(live.scene.tip_names)


class _Seat:
    """Sliders and handles of the browser that drives."""

    def __init__(
        self,
        client: Any,
        controller: PageController,
        robot: _Robot | None,
        ask_for: Callable[[int, Callable[[], None]], None],
    ) -> None:
        self.browser: int = client.client_id
        self._client, self._controller, self._ask_for = client, controller, ask_for
        self._parts: list[Any] = []
        self._sliders: list[Any] = []
        self._touched: list[float] = []
        self._followed = 0.0
        self._frames: list[_Handle] = []
        self._objects: dict[str, _Handle] = {}
        what = "control" if controller.with_guide else "the hand"
        with client.gui.add_folder(f"You have {what}", order=0.6) as folder:
            client.gui.add_html(_note(GUIDE_WORDS if controller.with_guide else HAND_WORDS))
            release = client.gui.add_button(f"Release {what}")
        self._folder = folder
        release.on_click(self._ordered(lambda *_: controller.leave(self.browser)))
        self.begin(robot)

    def begin(self, robot: _Robot | None) -> None:
        """Makes everything for a robot, in place of what was there."""
        self._clear()
        if robot is None:
            return
        gui = self._client.gui
        count = robot.tips
        if self._controller.with_guide:
            with self._folder:
                modes = gui.add_button_group("Robot", [mode.capitalize() for mode in MODES])
                modes.on_click(
                    self._ordered(
                        lambda _, mode: self._controller.do(self.browser, str(mode).lower())
                    )
                )
                joints = gui.add_folder("Joints", expand_by_default=False)
            self._parts += [modes, joints]
            guide = self._controller.guide
            if guide is not None:
                with joints:
                    for number, name in enumerate(short_names(guide.joint_names)):
                        self._add_slider(number, name, guide)
            count = len(guide.frame_names) if guide is not None else 0
        self._frames = [self._handle_of_frame(number) for number in range(count)]
        self._objects = {
            name: self._handle_of_object(number, name) for number, name in enumerate(robot.objects)
        }

    def renew(self, live: LiveRun) -> None:
        """Moves sliders and handles that nobody holds to where the robot is."""
        frame, state = live.frame, self._controller.state()
        now = time.monotonic()
        if state is not None and now - self._followed > SLIDER_PERIOD:
            self._followed = now
            for number, slider in enumerate(self._sliders):
                if now - self._touched[number] > TOUCHED:
                    slider.value = float(np.clip(state.joints[number], slider.min, slider.max))
        if state is not None:
            tips = state.frames if state.mode == "float" else state.target_frames
        elif frame is not None and live.scene is not None and frame.position is not None:
            tips, _ = live.scene.tips(frame.position)
        else:
            tips = np.empty((0, 3))
        for handle, place in zip(self._frames, tips, strict=False):
            handle.follow(place)
        for name, handle in self._objects.items():
            if frame is not None and name in frame.objects:
                handle.follow(frame.objects[name][:3])

    def remove(self) -> None:
        """Takes everything away from the browser."""
        self._clear()
        self._folder.remove()

    def _clear(self) -> None:
        for part in (*self._parts, *self._frames, *self._objects.values()):
            part.remove()
        self._parts, self._sliders, self._touched = [], [], []
        self._frames, self._objects = [], {}

    def _add_slider(self, number: int, name: str, guide: Guide) -> None:
        unit = guide.joint_units[number]
        low, high = (
            float(np.clip(limit[number], -NO_LIMIT[unit], NO_LIMIT[unit]))
            if abs(limit[number]) > FARTHEST_LIMIT
            else float(limit[number])
            for limit in (guide.soft_lower, guide.soft_upper)
        )
        state = self._controller.state()
        start = state.joints[number] if state is not None else (low + high) / 2
        slider = self._client.gui.add_slider(
            f"{name} [{unit}]", low, high, STEP[unit], float(np.clip(start, low, high))
        )
        self._sliders.append(slider)
        self._touched.append(-np.inf)

        def move(_: str, position: Any) -> None:
            self._touched[number] = time.monotonic()
            self._controller.move_joint(self.browser, number, float(position))

        slider.on_update(self._ordered(move))

    def _handle_of_frame(self, number: int) -> _Handle:
        return self._handle(
            f"/handles/frame_{number}",
            lambda point: self._controller.drag_frame(self.browser, number, point),
        )

    def _handle_of_object(self, number: int, name: str) -> _Handle:
        return self._handle(
            f"/handles/object_{number}",
            lambda point: self._controller.drag_object(self.browser, name, point),
        )

    def _handle(self, name: str, drag: Callable[[object], None]) -> _Handle:
        gizmo = self._client.scene.add_transform_controls(
            name, scale=HANDLE_SIZE, disable_rotations=True, depth_test=False, visible=False
        )
        handle = _Handle(gizmo)

        def act(phase: str, point: Any) -> None:
            handle.is_held = phase != "end"
            if phase == "update":
                drag(point)
            elif phase == "end":
                handle.forget()
                self._controller.drop(self.browser)

        gizmo.on_update(self._ordered(act))
        return handle

    def _ordered(self, act: Callable[[str, Any], None]) -> Callable[[Any], Any]:
        """Does something in the order of the browser's messages, with the phase of a drag and the
        value or position of that moment."""

        async def call(event: Any) -> None:
            if event.client_id is None:  # this process has changed it, to follow the robot
                return
            phase: str = getattr(event, "phase", "")
            value: Any = getattr(event.target, "value", None)
            if phase:
                value = tuple(event.target.position)
            self._ask_for(self.browser, lambda: act(phase, value))

        return call


class _Handle:
    """A gizmo that follows something while nobody holds it."""

    def __init__(self, gizmo: Any) -> None:
        self._gizmo = gizmo
        self._place = np.full(3, np.nan)
        self.is_held = False

    def follow(self, place: Any) -> None:
        if self.is_held or np.array_equal(place, self._place):
            return
        self._place = np.array(place, float)
        self._gizmo.position = self._place
        if not self._gizmo.visible:
            self._gizmo.visible = True

    def forget(self) -> None:
        """Notes that the browser has moved it."""
        self._place = np.full(3, np.nan)

    def remove(self) -> None:
        self._gizmo.remove()


def short_names(names: Sequence[str]) -> list[str]:
    """The names without the words that all of them have, such as "joint", for a narrow panel."""
    parts = [name.split("_") for name in names]
    shared = set.intersection(*map(set, parts)) if len(parts) > 1 else set()
    short = [" ".join(part for part in name if part not in shared) for name in parts]
    return short if len({*short}) == len(short) and all(short) else list(names)


def _note(line: str) -> str:
    """A sentence as part of a panel."""
    return (
        '<div class="trifinger-control" style="margin:0.3em 0.8em;font-size:0.85em">'
        f"{html.escape(line)}</div>"
    )


def _text(name: str) -> str:
    """The name of a robot as part of a script."""
    return "".join(one for one in name if one.isalnum() or one in "-_.")
