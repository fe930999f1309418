# SPDX-License-Identifier: BSD-3-Clause
"""A session of a log by time: what to show at any moment, and the course of a part of it.

    run = LoggedRun("logs")
    frame = run.frame_at(12.5)             # what a page shows 12.5 s after the first step
    course = run.course(rate=30.0)         # frames of all of it, 30 per second, as arrays

Opening a log and reading one frame takes milliseconds however long the log is, because the reader
finds the chunk of a time by bisection. Nothing is kept, so the memory does not grow with the log.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from trifinger._trifinger import Log, LoggedSession, Status, lateness_of
from trifinger.arrays import Array
from trifinger.element_text import positions_field
from trifinger.errors import CameraLost, InvalidArgument, NotInLog
from trifinger.log.images import LoggedCameras
from trifinger.log.objects import object_poses
from trifinger.log.plot.panels import Contents, contents_of
from trifinger.log.steps import parts_of
from trifinger.log.types import Steps

from trifinger_view.frame import Frame, frame_of
from trifinger_view.scene import Mesh, Scene, scene_of

OBJECTS = "object"
CAMERAS = "cameras"
MARKS = (
    "action repeated",
    "action rejected",
    "action used its own observation",
    "periods left out",
)
"""What a step can be marked with. Bit i of a frame's marks is MARKS[i]."""
WARNINGS = 0b1011
"""The bits of what goes wrong; the other one only informs."""
_FLAGS = (Status.ACTION_REPEATED, Status.ACTION_REJECTED, Status.ACAUSAL)
_SLACK = 1e-6  # [s], so that the time of a step, as a number, is not before the step


@dataclass(frozen=True)
class Fault:
    """The fault that ended a session."""

    time: float
    """[s], since the first step in the log."""
    time_index: int
    text: str
    """A sentence."""


@dataclass(frozen=True)
class Course:
    """Frames of a part of a log: row i of each array is frame i."""

    time_index: Array
    """int64[n]"""
    times: Array
    """float64[n], since the first step in the log [s]."""
    positions: Array | None
    """float64[n, joints] [rad]; None for a robot without joint positions."""
    desired: Array | None
    """Positions that were asked for, float64[n, joints] [rad]; NaN where none were."""
    tip_forces: Array | None
    """float64[n, tips] [N]"""
    objects: dict[str, Array]
    """Position [m] and quaternion w, x, y, z by object, float64[n, 7]; NaN before it was seen."""
    marks: Array
    """uint8[n]: bits of `MARKS` of the steps since the frame before."""

    def __len__(self) -> int:
        return len(self.time_index)

    def objects_at(self, frame: int) -> dict[str, Array]:
        """Poses of the objects that had been seen by then, float64[7] each."""
        poses = {name: rows[frame] for name, rows in self.objects.items()}
        return {name: pose for name, pose in poses.items() if np.isfinite(pose).all()}


class LoggedRun:
    """A session of a robot in a log. Times count from the first step in the log [s]."""

    def __init__(
        self, path: str | os.PathLike[str] | Log, robot: str = "", session: int | None = None
    ) -> None:
        """Opens a session of `robot` in a file or in the newest recording of a folder.

        `session` is its number in the log, from 1, or its id; without it, the newest one is taken.

        Raises:
            InvalidArgument: if there is no such session, or if none of its steps can be read
            Error: if it is not a log
        """
        self.log = path if isinstance(path, Log) else Log(path)
        self.session = self.log.session(robot) if session is None else self._find(robot, session)
        first, end = self.session.range("applied_action")
        if first >= end:
            raise InvalidArgument(f"there are no steps of '{self.session.name}' to show")
        # Steps that are damaged are in the range, too.
        parts = self.session.chunks(1024, first, end, {"status": ("time",)})
        start = next((part for part in parts if len(part)), None)
        if start is None:
            file = self.log.files[0]
            raise InvalidArgument(
                f"no step of '{self.session.name}' can be read, {file} is damaged: "
                f"'trifinger log check {file}' says where"
            )
        self.first: int = int(start.time_index[0])
        """First step in the log."""
        self.last: int = self.session.range("observation")[1] - 1
        """Last observation in the log, mostly the one after the last step."""
        self._start = int(start.times.astype(np.int64)[0])
        self._last_step = self._existing(end - 1)
        if self._last_step < end - 1:
            self.last = self._last_step
        self._last_step_time = self._time_of_step(self._last_step)
        self.end: float = self._end()
        """Time of the last observation [s]."""
        self.fault = self._find_fault()
        """The fault that ended the session; None if it ended as its users wanted."""
        self.ends_in_log = self.last > self._last_step or self.session.fault is not None
        """Whether the log has the end of the session."""
        names = [one.name.partition(".")[2] for one in self.session.companions]
        self._objects = self.session.companion(OBJECTS) if OBJECTS in names else None
        self.scene: Scene | None = scene_of(self.session.documents)
        """Robot and objects; None if the robot has no model. One thread may use it."""
        self.ink: tuple[Array, Mesh] | None = None
        """What pens have written, as `Scene.ink` has it; None without a pen."""
        if self.scene is not None and self._objects is not None and self.scene.has_pen:
            self.ink = self.scene.ink(*object_poses(self.session))
        self.cameras = LoggedCameras(self.session) if CAMERAS in names else None
        """What its cameras saw; None if it has no cameras."""

    def step_at(self, time: float) -> int:
        """The newest step in the log at a time [s]; the first or the last one beyond its ends."""
        if time + _SLACK >= self.end:
            return self.last
        after = self.session.between(0.0, max(time, 0.0) + _SLACK)[1]
        return self._existing(max(after - 1, self.first))

    def time_of(self, step: int) -> float:
        """The time of a step in the log [s]."""
        return self.end if step > self._last_step else self._time_of_step(self._existing(step))

    def frame_at(self, time: float, with_images: bool = True) -> Frame:
        """The newest step at a time [s], as a page shows it; a step that is in the log.

        `Frame.time` is the time of this step. Images are the newest ones that had arrived.
        """
        step = self.step_at(time)
        session = self.session
        observation, desired, status = self._elements(step)
        objects = None if self._objects is None else _newest(self._objects, step)
        is_end = step == self.last and self.ends_in_log
        lateness = 0.0
        if session.is_real_time and status is not None:
            lateness = float(lateness_of(status, session.period)[0])
        frame = frame_of(
            step,
            session.period,
            observation,
            desired,
            objects,
            images=self._images_at(step) if with_images else {},
            lateness=lateness,
            status=self.end_text() if is_end else _words(status),
            fault=session.fault if is_end else None,
            fault_text=session.fault_text if is_end else "",
        )
        return replace(frame, time=self.time_of(step))

    def course(self, rate: float, begin: float | None = None, end: float | None = None) -> Course:
        """Frames from `begin` to `end` [s], about `rate` per second, in order.

        The first and the last observation and that of the fault are among them. A frame is always a
        step of the log. Reads this part of the log once.

        Raises:
            InvalidArgument: if the log has nothing between these times
        """
        start = max(begin or 0.0, 0.0)
        stop = self.end if end is None else min(end, self.end)
        if not start <= stop:
            raise InvalidArgument(
                f"there is nothing from {start:g} s to {stop:g} s: the log has {self.end:.3f} s"
            )
        return _CourseReader(self, rate, start, stop).read()

    def contents(self, bins: int, begin: float | None = None, end: float | None = None) -> Contents:
        """Smallest and largest numbers of all series in `bins` stretches of time, for plots."""
        first = None if begin is None else self.step_at(begin)
        last = None if end is None else self.step_at(end) + 1
        return contents_of(self.log, self.session, first, last, bins)

    def end_text(self) -> str:
        """How the session ended, as a sentence."""
        return self.session.fault_text or "went on when the recording ended"

    def _find(self, robot: str, wanted: int) -> LoggedSession:
        known = []
        for number, session in enumerate(self.log.sessions, 1):
            if wanted in (number, session.session_id) and robot in ("", session.name):
                return session
            known.append(
                f"{number} of '{session.name}' ({session.steps or 'unknown'} steps, "
                f"id {session.session_id})"
            )
        whose = f" of '{robot}'" if robot else ""
        raise InvalidArgument(
            f"{self.log.files[0]} has no session {wanted}{whose}; it has {', '.join(known)}"
        )

    def _elements(self, step: int) -> tuple[Any, Any, Any]:
        """Observation, desired action and statuses of a step; None for what the log lacks."""
        if step <= self._last_step:
            series = ("observation", "desired_action", "status")
            rows: Any = self._rows(step, step + 1, series)
            return rows.observations[0], rows.desired_actions[0], rows.statuses
        observation = self.session.get_observation(step)
        return observation, None, self.session.get_statuses(step, step + 1)

    def _images_at(self, step: int) -> dict[str, NDArray[np.uint8]]:
        if self.cameras is None:
            return {}
        found = {}
        with suppress(NotInLog):
            images = self.cameras.get_latest_at(step)
            if images is None:
                return {}
            for name in images.names:
                with suppress(CameraLost, NotInLog):
                    found[name] = images[name]
        return found

    def _rows(self, first: int, last: int, series: Any) -> Steps:
        return self.session.read(first, last, series)

    def _time_of_step(self, step: int) -> float:
        rows = self._rows(step, step + 1, {"status": ("time",)})
        return float(rows.times.astype(np.int64)[0] - self._start) * 1e-9

    def _existing(self, step: int) -> int:
        """The newest step in the log that is not after `step`."""
        if len(self._rows(step, step + 1, {"status": ("time",)})):
            return step
        low, high = self.first, step  # `low` is in the log
        while high - low > 1:
            middle = (low + high) // 2
            part = next(iter(self.session.chunks(1, middle, high, {"status": ("time",)})), None)
            if part is not None and len(part):
                low = int(part.time_index[0])
            else:
                high = middle
        return low

    def _end(self) -> float:
        if self.last == self._last_step:
            return self._last_step_time
        passed = self.session.period
        if self.session.is_real_time:
            times = [int(self.session.get_status(t)["time"]) for t in (self._last_step, self.last)]
            passed = (times[1] - times[0]) * 1e-9
        return self._last_step_time + passed

    def _find_fault(self) -> Fault | None:
        fault = self.session.fault
        if fault is None or not fault.needs_recovery:
            return None
        if fault.time_index > self._last_step or fault.time_index < self.first:
            time = self.end
        else:
            time = self.time_of(fault.time_index)
        return Fault(time, fault.time_index, self.session.fault_text)


class _CourseReader:
    """Reads the frames of a part of a log in one pass."""

    def __init__(self, run: LoggedRun, rate: float, begin: float, end: float) -> None:
        if not (math.isfinite(rate) and rate > 0):
            raise InvalidArgument(f"a rate of {rate} frames per second: it must be above 0")
        self._run, self._begin, self._end = run, begin, end
        session = run.session
        wanted = np.arange(begin, end, 1.0 / rate)
        if run.fault is not None and begin <= run.fault.time <= end:
            wanted = np.append(wanted, run.fault.time)
        # The times of frames, since 1970 [ns].
        times = np.unique(np.append(wanted, end))
        self._has_last = run.last > run._last_step and end + _SLACK >= run.end
        if self._has_last:
            times = times[times + _SLACK < run.end]
        self._carried = np.uint8(0)  # marks of steps after the last frame
        self._wanted = run._start + np.round((times + _SLACK) * 1e9).astype(np.int64)
        self._observation = _names(session.observation_dtype)
        # Targets of some joints are no pose of the model.
        self._joints = positions_field(self._observation)
        has_poses = self._joints == "position"
        self._targets = {"position"} & _names(session.action_dtype) if has_poses else set()
        self._status = _names(session.status_dtype)

    def read(self) -> Course:
        parts = list(self._parts())
        if self._has_last:
            parts.append(self._last_frame())
        if not parts:
            raise InvalidArgument(f"the log has no steps from {self._begin:g} s to {self._end:g} s")
        joined = {name: _joined([part[name] for part in parts]) for name in parts[0]}
        steps = joined["time_index"]
        return Course(
            time_index=steps,
            times=joined["times"],
            positions=joined["positions"],
            desired=joined["desired"],
            tip_forces=joined["tip_forces"],
            objects=self._objects(steps),
            marks=joined["marks"],
        )

    def _parts(self) -> Iterator[dict[str, Array | None]]:
        """The frames of each part of the log that is in memory at once."""
        run = self._run
        first = run.step_at(self._begin)
        last = min(run.step_at(self._end), run._last_step) + 1
        series = {
            "observation": sorted({self._joints, "tip_force"} & self._observation),
            "desired_action": sorted(self._targets),
            "status": sorted({"time", "flags", "skipped_ticks"} & self._status),
        }
        chosen_series = {name: fields for name, fields in series.items() if fields}
        read = parts_of(run.session, min(first, last - 1), last, chosen_series)
        for steps, next_steps in _with_next(read):
            times = steps.times.astype(np.int64)
            rows = np.searchsorted(times, self._wanted, side="right") - 1
            is_here = rows >= 0
            if next_steps is not None:
                is_here &= self._wanted < next_steps.times.astype(np.int64)[0]
            chosen = np.unique(rows[is_here])
            marks = _marks_of(steps)
            if not len(chosen):
                self._carried |= np.bitwise_or.reduce(marks)
                continue
            starts = np.concatenate([[0], chosen[:-1] + 1])
            summed = np.bitwise_or.reduceat(marks, starts)
            # reduceat sums the last stretch to the end of the part.
            summed[-1] = np.bitwise_or.reduce(marks[starts[-1] : chosen[-1] + 1])
            summed[0] |= self._carried
            self._carried = np.bitwise_or.reduce(marks[chosen[-1] + 1 :], initial=np.uint8(0))
            yield {
                "time_index": steps.time_index[chosen],
                "times": (times[chosen] - run._start) * 1e-9,
                "positions": _column(steps.observations, self._joints, chosen),
                "desired": _column(steps.desired_actions, "position", chosen),
                "tip_forces": _column(steps.observations, "tip_force", chosen),
                "marks": summed,
            }

    def _last_frame(self) -> dict[str, Array | None]:
        """The observation after the last step, which has no actions."""
        run = self._run
        seen = run.session.get_observations(run.last, run.last + 1)
        joints = _column(seen, self._joints, slice(None))
        has_target = bool(self._targets) and joints is not None
        return {
            "time_index": np.array([run.last]),
            "times": np.array([run.end]),
            "positions": joints,
            "desired": np.full_like(joints, np.nan) if has_target and joints is not None else None,
            "tip_forces": _column(seen, "tip_force", slice(None)),
            "marks": np.array([self._carried], np.uint8),
        }

    def _objects(self, steps: Array) -> dict[str, Array]:
        """The newest pose of each object that had arrived by each of some steps."""
        companion = self._run._objects
        if companion is None or companion.range("observation")[1] == 0:
            return {}
        dtype = companion.observation_dtype
        names = [
            name
            for name in dtype.names or ()
            if {"position", "orientation"} <= set(dtype[name].names or ())
        ]
        poses = {name: np.full((len(steps), 7), np.nan) for name in names}
        newest = companion.get_latest_at(int(steps[0]))
        if newest is not None:
            for name in names:
                poses[name][:] = _pose(newest[name])
        for part in companion.chunks(20_000):
            seen = part.observations
            if seen is None or not len(seen):
                continue
            rows = np.searchsorted(seen["stamp"]["arrival_index"], steps, side="right") - 1
            is_here = rows >= 0
            for name in names:
                poses[name][is_here] = _pose(seen[name][rows[is_here]])
        return poses


def _newest(companion: LoggedSession, step: int) -> Any:
    """The newest element at a step; None if there is none, or if the log lacks it."""
    try:
        return companion.get_latest_at(step)
    except NotInLog:
        return None


def _words(status: Any) -> str:
    """What happened in a step, in words."""
    bits = 0 if status is None else int(_bits(status)[0])
    words = [mark for bit, mark in enumerate(MARKS) if bits >> bit & 1]
    return ", ".join(words) or "running"


def _with_next(parts: Iterable[Steps]) -> Iterator[tuple[Steps, Steps | None]]:
    """Yields each part that is not empty with the one after it."""
    before: Steps | None = None
    for part in parts:
        if not len(part):
            continue
        if before is not None:
            yield before, part
        before = part
    if before is not None:
        yield before, None


def _pose(element: Any) -> Array:
    return np.concatenate([element["position"], element["orientation"]], axis=-1)


def _names(dtype: np.dtype[Any]) -> set[str]:
    return set(dtype.names or ())


def _column(elements: Any, name: str, rows: Any) -> Array | None:
    """Some rows of a field with one dimension; None if there is no such field."""
    if elements is None or name not in (elements.dtype.names or ()):
        return None
    values: Array = elements[name][rows]
    return values.reshape(len(values), -1)


def _joined(parts: list[Any]) -> Any:
    return None if parts[0] is None else np.concatenate(parts)


def _marks_of(steps: Steps) -> Array:
    """Bits of MARKS of each step."""
    return np.zeros(len(steps), np.uint8) if steps.statuses is None else _bits(steps.statuses)


def _bits(statuses: Any) -> Array:
    names = statuses.dtype.names or ()
    marks = np.zeros(len(statuses), np.uint8)
    if "flags" in names:
        for bit, flag in enumerate(_FLAGS):
            marks |= ((statuses["flags"] & flag.value) != 0).astype(np.uint8) << bit
    if "skipped_ticks" in names:
        marks |= (statuses["skipped_ticks"] > 0).astype(np.uint8) << len(_FLAGS)
    return marks
