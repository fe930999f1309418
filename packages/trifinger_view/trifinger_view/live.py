# SPDX-License-Identifier: BSD-3-Clause
"""Looks at a running robot as one of its observers. Nothing here waits for it or is felt by it."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from trifinger import _trifinger
from trifinger._trifinger import Frontend, Reason
from trifinger.cameras import Cameras
from trifinger.errors import CameraLost, Error, HistoryLost, InvalidArgument, SessionNotFound
from trifinger.session_info import SessionInfo

from trifinger_view.curves import Window, series_of
from trifinger_view.frame import Frame, frame_of
from trifinger_view.scene import Scene, scene_of
from trifinger_view.words import Line, lines_of, missing

if TYPE_CHECKING:
    from numpy.typing import NDArray

INFO_PERIOD = 0.2  # between two looks at what takes longer, such as whether the back-end lives [s]
MAX_STEPS = 2000  # that are read for plots at once


class LiveRun:
    """The sessions of a running robot, one after another. One thread uses it.

    `look()` follows the robot: when a session has ended and the next one is there, it goes on with
    that one. The attributes are those of the last look.
    """

    def __init__(self, name: str = "", clock: Callable[[], float] = time.monotonic) -> None:
        """Looks at the robot `name`, or at the first that runs; it need not run yet."""
        self.wanted = name
        """The name of the robot; empty for any."""
        self.info: SessionInfo | None = None
        """Facts about the session; None while there is none."""
        self.scene: Scene | None = None
        """Robot and objects; None if the robot has no model."""
        self.scene_error = ""
        """Why a model is not shown, in a sentence."""
        self.frame: Frame | None = None
        """The newest step; None while there is none."""
        self.lines: list[Line] = missing(name)
        """The state of the session in words."""
        self.window = Window()
        """The last seconds, for plots."""
        self.session_id: int | None = None
        """Which session it is; another number means that everything else may differ."""
        self._clock = clock
        self._robot: Frontend | None = None
        self._objects: Frontend | None = None
        self._cameras: Cameras | None = None
        self._looked = -np.inf
        self._before = ""  # how the session before ended
        self._next_step = 0

    @property
    def robot(self) -> Frontend | None:
        """The observer of the session; None while there is none."""
        return self._robot

    def look(self, with_images: bool = True) -> None:
        """Takes the newest step. Images and words are renewed some times per second only."""
        is_time = self._clock() - self._looked >= INFO_PERIOD
        if is_time:
            self._looked = self._clock()
            self._follow()
        robot = self._robot
        if robot is None or self.info is None:
            return
        try:
            frame = self._frame_of(robot, self.info, is_time and with_images)
            self._read_window(robot, self.info)
        except Error:
            return  # the next look finds a newer step, or that the robot is gone
        self.frame = frame
        if is_time:
            self.lines = lines_of(self.info, frame, robot.timing(), self._reasons(robot))
            if self._before:
                self.lines.append(Line("before", self._before))
            if self.scene_error:
                self.lines.append(Line("model", self.scene_error, "warning"))

    def _follow(self) -> None:
        """Finds the session to look at."""
        try:
            if self._robot is not None:
                self.info = info = self._robot.session_info()
                if info.backend_is_alive and info.fault is None:
                    return
            found = self._find()
            if found is not None:
                info = found.session_info()
                if info.session_id != self.session_id:
                    self._begin(found, info)
        except Error:
            if self._robot is None:
                self.lines = missing(self.wanted)

    def _find(self) -> Frontend | None:
        name = self.wanted or (self.info.name if self.info is not None else "")
        if not name:
            robots = [one for one in _trifinger.list_sessions() if not one.is_companion]
            alive = [one.name for one in robots if one.backend_is_alive]
            if not alive:
                self.lines = missing("")
                return None
            name = alive[0]
        return _trifinger.observe(name)

    def _begin(self, robot: Frontend, info: SessionInfo) -> None:
        documents = robot.documents()
        self._before = self.info.fault_text if self.info is not None else ""
        self.info = info
        self.scene, self.scene_error = None, ""
        try:
            self.scene = scene_of(documents)
        except InvalidArgument as error:
            self.scene_error = str(error)
        self._robot, self.session_id, self.frame = robot, info.session_id, None
        self._objects = _companion(robot, "object")
        self._cameras = None
        with contextlib.suppress(Error):
            self._cameras = Cameras(robot)
        self.window = Window()
        self._next_step = robot.range("status")[1]

    def _frame_of(self, robot: Frontend, info: SessionInfo, with_images: bool) -> Frame:
        end = robot.range("observation")[1]
        observation = (
            robot.get_observation(end - 1, timeout=0)
            if end
            else robot.latest_observation(timeout=0)
        )
        # The first action may be there before the first observation.
        actions = min(robot.range("desired_action")[1], end)
        desired = robot.get_desired_action(actions - 1, timeout=0) if actions else None
        objects = None
        if self._objects is not None:
            with contextlib.suppress(Error):
                objects = self._objects.latest_observation(timeout=0)
        images = dict(self._images()) if with_images else {}
        if not with_images and self.frame is not None:
            images = dict(self.frame.images)
        frame = frame_of(
            end - 1,
            info.period,
            observation,
            desired,
            objects,
            images=images,
            status=info.phase,
            fault=info.fault,
            fault_text=info.fault_text,
        )
        if self.scene is not None and (
            frame.position is None or len(frame.position) != len(self.scene.joint_names)
        ):
            self.scene, self.scene_error = None, "the model has other joints than the robot"
        return frame

    def _images(self) -> Iterator[tuple[str, NDArray[np.uint8]]]:
        """The images that are good, by camera."""
        with contextlib.suppress(Error):
            images = self._cameras.latest() if self._cameras is not None else None
            for name in images or ():
                with contextlib.suppress(CameraLost, HistoryLost):
                    yield name, images[name]  # type: ignore[index]  # it has names

    def _read_window(self, robot: Frontend, info: SessionInfo) -> None:
        """Adds the steps since the last look to the window."""
        begin, end = robot.range("status")
        # The last status has no action, and other series may be a step behind.
        end = min(end, robot.range("observation")[1], robot.range("applied_action")[1])
        first = max(self._next_step, begin, end - MAX_STEPS)
        if first >= end:
            return
        self._next_step = end
        series = series_of(
            robot.get_observations(first, end, timeout=0),
            robot.get_desired_actions(first, end, timeout=0),
            robot.get_statuses(first, end, timeout=0),
            info.period,
            info.is_real_time,
        )
        self.window.add(np.arange(first, end) * info.period, series)

    def _reasons(self, robot: Frontend) -> dict[str, list[int]]:
        """Why joints did not get what was asked for in the newest step: joints by reason."""
        end = robot.range("applied_action")[1]
        if not end or "reasons" not in (robot.applied_action_dtype.names or ()):
            return {}
        bits = np.ravel(robot.get_applied_action(end - 1, timeout=0)["reasons"])
        found = {}
        for reason in Reason:
            if reason == Reason.DAMPED:  # whenever a joint moves
                continue
            joints = np.flatnonzero(bits & reason.value).tolist()
            if joints:
                found[str(reason.name).lower().replace("_", " ")] = joints
        return found


def _companion(robot: Frontend, name: str) -> Frontend | None:
    try:
        return robot.companion(name)
    except SessionNotFound:
        return None
