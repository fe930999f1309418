# SPDX-License-Identifier: BSD-3-Clause
"""The part of a page that steers a robot: buttons, sliders, and handles at tips and objects.

Only the browser that drives is told of sliders and handles, and what others ask for them is
refused. Its connection is asked for a sign of life four times a second.
"""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from trifinger.errors import Error, InvalidArgument

from trifinger_view.page_controller import SETPOINT_PERIOD, PageController, pullable
from trifinger_view.stop import Stop
from trifinger_view.to_browser import message

if TYPE_CHECKING:
    from trifinger.arrays import Array

    from trifinger_view.authentication import Authentication
    from trifinger_view.live import LiveRun
    from trifinger_view.page_server import PageServer

GUIDE_WORDS = "Drag a handle of the robot: it follows. An object of a simulation is pulled."
HAND_WORDS = "Drag a tip or an object by its handle: it is pulled until you let go."
NO_LIMIT = {"rad": 3.14, "m": 1.0}  # end of a slider of a joint without limits
FARTHEST_LIMIT = 1000.0  # [rad], [m]; joints without limits have larger ones


def add_stop(authentication: Authentication, name: str) -> None:
    """Lets the page stop the robot whatever else the page does."""
    stop = Stop(name)
    authentication.offer("/stop", stop.order)
    authentication.offer("/stopped", stop.outcome)


class ControlPanel:
    """The panel of a page, for all browsers. Its thread ends when the controller is closed."""

    def __init__(self, server: PageServer, controller: PageController) -> None:
        self._server, self._controller = server, controller
        self._what = "control" if controller.with_guide else "the hand"
        self._shown: dict[str, Any] = {}
        self._handles: list[dict[str, object]] = []
        self._frames = 0  # of the guide, which have handles
        self._joints: list[dict[str, Any]] = []
        self._seated: object = None  # the driver and the guide that its sliders and handles are of
        self._recovers = False
        self._asked: dict[str, Callable[[int, dict[str, Any]], None]] = {
            "take": lambda browser, _: controller.take(browser),
            "release": lambda browser, _: controller.leave(browser),
            "recover": lambda *_: self._recover(),
            "mode": lambda browser, asked: controller.do(browser, str(asked["mode"])),
            "joint": self._move_joint,
            "drag": self._drag,
            "drop": lambda browser, _: controller.drop(browser),
        }
        server.on_message, server.on_gone = self._do, self._leave
        server.on_heard = controller.heard
        threading.Thread(target=self._tick, daemon=True).start()

    def begin(self, live: LiveRun) -> None:
        """Notes the robot of another session."""
        tips = live.scene.tip_names if live.scene is not None else ()
        self._controller.begin_session(tips)
        self._handles = []
        if live.robot is not None and live.scene is not None:
            with contextlib.suppress(Error):
                if pullable(live.robot):
                    names = live.scene.object_names
                    self._handles = [{"object": name} for name in names]
                    if not self._controller.with_guide:
                        self._handles[:0] = [{"frame": number} for number in range(len(tips))]
        self._seated = None

    def renew(self, live: LiveRun) -> None:
        """Shows who drives and what the robot does, and where sliders and handles are."""
        controller = self._controller
        driver, guide = controller.driver, controller.guide
        info = live.info
        fault = info.fault if info is not None and info.backend_is_alive else None
        self._recovers = controller.with_guide and fault is not None and fault.needs_recovery
        shown: dict[str, Any] = {
            "title": "Control" if controller.with_guide else "Hand",
            "what": self._what,
            "words": controller.line(),
            "others": f"a browser has {self._what}; the others look",
            "isTaken": driver is not None,
            "recovers": self._recovers,
        }
        if shown != self._shown:
            self._shown = shown
            self._server.put("control", message("control", **shown))
        if self._seated != (driver, guide):
            self._seat(driver, guide)
        if driver is not None:
            self._move_targets(live, driver)

    def _seat(self, driver: int | None, guide: Any) -> None:
        """Gives sliders and handles to the driver, and takes them from others."""
        self._seated = (driver, guide)
        self._frames = 0 if guide is None else len(guide.frame_names)
        self._joints = [] if guide is None else [_joint(guide, i) for i in range(guide.num_joints)]
        told: dict[str, Any] = {
            "words": GUIDE_WORDS if self._controller.with_guide else HAND_WORDS,
            "joints": self._joints if self._controller.with_guide else None,
            "handles": [{"frame": number} for number in range(self._frames)] + self._handles,
        }
        for browser in self._server.browsers:
            is_driver = browser == driver
            seat = message("seat", isDriver=is_driver, **(told if is_driver else {}))
            self._server.put("seat", seat, browser)

    def _move_targets(self, live: LiveRun, driver: int) -> None:
        """Tells the driver where its sliders and handles are now."""
        frame, state = live.frame, self._controller.state()
        points: list[Array | None] = [None] * self._frames
        if state is not None:
            points = list(state.frames if state.mode == "float" else state.target_frames)
        elif not self._controller.with_guide and live.scene is not None and frame is not None:
            points = list(live.scene.tips(frame.position)[0])
        known = frame.objects if frame is not None else {}
        for handle in self._handles:
            if "object" in handle:
                pose = known.get(str(handle["object"]))
                points.append(None if pose is None else pose[:3])
        told = message(
            "targets",
            joints=[] if state is None else [float(joint) for joint in state.joints],
            points=[None if point is None else [float(x) for x in point] for point in points],
        )
        self._server.put("targets", told, driver)

    def _do(self, browser: int, asked: dict[str, Any]) -> None:
        """Does what a browser asks for. Whatever that is, what comes next is done."""
        act = self._asked.get(asked["do"])
        try:
            if act is None:
                raise InvalidArgument("there is no such button")
            act(browser, asked)
        except Exception as error:
            # Whoever does not drive has lost control, which was said.
            if asked["do"] in ("take", "recover") or self._controller.driver == browser:
                self._controller.complain(str(error))

    def _leave(self, browser: int) -> None:
        self._controller.leave(
            browser,
            "the browser that drove has gone, so "
            + ("the robot holds its pose" if self._controller.with_guide else "the hand let go"),
        )

    def _recover(self) -> None:
        if self._recovers:  # else it is a second press
            self._controller.recover()
            self._recovers = False

    def _move_joint(self, browser: int, asked: dict[str, Any]) -> None:
        joint, position = asked["joint"], asked["position"]
        if type(joint) is not int or not 0 <= joint < len(self._joints):
            raise InvalidArgument("there is no such joint")
        if type(position) not in (int, float) or not math.isfinite(position):
            raise InvalidArgument("the position of a joint is a number")
        limits = self._joints[joint]
        position = min(max(position, limits["low"]), limits["high"])
        self._controller.move_joint(browser, joint, float(position))

    def _drag(self, browser: int, asked: dict[str, Any]) -> None:
        if "object" in asked:
            self._controller.drag_object(browser, str(asked["object"]), asked["point"])
        elif type(asked["frame"]) is int:
            self._controller.drag_frame(browser, asked["frame"], asked["point"])

    def _tick(self) -> None:
        while not self._controller.closed.wait(SETPOINT_PERIOD):
            try:
                self._controller.tick()
            except Exception as error:  # a driver that is not heard must lose control in any case
                self._controller.complain(str(error))


def _joint(guide: Any, number: int) -> dict[str, Any]:
    """A slider of a joint: its name, its unit, and its ends in this unit."""
    unit = guide.joint_units[number]
    low, high = (
        float(np.clip(limit[number], -NO_LIMIT[unit], NO_LIMIT[unit]))
        if abs(limit[number]) > FARTHEST_LIMIT
        else float(limit[number])
        for limit in (guide.soft_lower, guide.soft_upper)
    )
    return {"name": short_names(guide.joint_names)[number], "unit": unit, "low": low, "high": high}


def short_names(names: Sequence[str]) -> list[str]:
    """The names without the words that all of them have, such as "joint", for a narrow panel."""
    parts = [name.split("_") for name in names]
    shared = set.intersection(*map(set, parts)) if len(parts) > 1 else set()
    short = [" ".join(part for part in name if part not in shared) for name in parts]
    return short if len({*short}) == len(short) and all(short) else list(names)
