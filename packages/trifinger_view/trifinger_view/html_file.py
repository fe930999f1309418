# SPDX-License-Identifier: BSD-3-Clause
"""A log as one page that needs neither a server nor a network: `trifinger view LOG -o run.html`.

The page has the robot in 3D, a time line, images, plots and the state in words, and can be sent to
others. The poses of all bodies are computed here; the page only draws them, with WebGL and a
thousand lines of its own. Its browser is told to load nothing from elsewhere.
"""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from trifinger import extras
from trifinger.arrays import Array
from trifinger.errors import CameraLost, InvalidArgument, NotInLog
from trifinger.log.plot.curves import Curves, Envelope
from trifinger.log.plot.panels import Panel, names_of_groups, time_unit, title_of
from trifinger.progress import shown
from trifinger.whole_file import whole_file

from trifinger_view.logged import MARKS, WARNINGS, LoggedRun
from trifinger_view.to_browser import MOMENTS, Numbers, Place, document, jpeg, placed, session_of

MAX_BYTES = 100_000_000
"""Limit for the size of a page [bytes]."""
RATE = 30.0
"""Frames per second, unless the page would be too large."""
LOWEST_RATE = 1.0
IMAGE_RATE = 5.0
IMAGE_WIDTH = 360  # [pixels]
BINS = 1200  # stretches of time in a plot
_ORDER = {name: place for place, name in enumerate(("torque", "position", "tip_force", "velocity"))}
_GRAIN = 2.0**-17  # poses are rounded to this, in metres and parts of a quaternion
_TEXT = 4 / 3  # characters of base64 for a byte


@dataclass(frozen=True)
class Written:
    """What a page holds."""

    path: Path
    size: int
    """[bytes]"""
    frames: int
    rate: float
    """Frames per second."""
    image_rate: float
    """Images of each camera per second; 0 without images."""

    def __str__(self) -> str:
        images = f", {self.image_rate:.3g} images/s of each camera" if self.image_rate else ""
        return (
            f"{self.path} written: {self.size / 1e6:.1f} MB, {self.frames} frames, "
            f"{self.rate:.3g} per second{images}."
        )


def write_html(
    run: LoggedRun,
    path: Path,
    *,
    begin: float | None = None,
    end: float | None = None,
    rate: float | None = None,
    most_bytes: int = MAX_BYTES,
) -> Written:
    """Writes the part of a log from `begin` to `end` [s] as a page.

    Without a `rate` [frames/s] the page has 30 frames per second, or as many as the limit of its
    size allows. The file appears at once, whole; no file remains after an error.

    Raises:
        InvalidArgument: if the page would be larger than `most_bytes`, or if the log has nothing
            between these times
        OSError: if the file cannot be written
    """
    start, stop = max(begin or 0.0, 0.0), min(run.end if end is None else end, run.end)
    plan = _plan(run, max(stop - start, 0.0), rate, most_bytes)
    page = _Page(run, start, stop, plan)
    with whole_file(path) as part, part.open("wb") as file:
        page.write(file)
        size = file.tell()
        if size > most_bytes:
            raise InvalidArgument(
                f"the page would have {size / 1e6:.0f} MB, and {most_bytes / 1e6:.0f} MB are "
                "allowed: choose a shorter part with --from and --to, or a lower --rate"
            )
    return Written(path, size, len(page.course), plan.rate, plan.image_rate)


@dataclass(frozen=True)
class _Plan:
    """How much a page holds of each second."""

    rate: float
    image_rate: float


def _plan(run: LoggedRun, duration: float, rate: float | None, most_bytes: int) -> _Plan:
    """The rates with which the page stays below the limit; raises InvalidArgument if none do."""
    # Poses lose about half of their size when they are packed; images do not.
    bodies = 0 if run.scene is None else 2 * len(run.scene.bodies)
    frame = (28 * bodies + 24 * 3 + 24) * 0.55 * _TEXT
    cameras = 0 if run.cameras is None else len(run.cameras.names)
    image = 20_000 * cameras * _TEXT
    room = most_bytes * 0.95 - 2e6  # the meshes, the plots and the page itself
    image_rate = 0.0
    if cameras:
        image_rate = min(IMAGE_RATE, 0.7 * room / (image * max(duration, 1.0)))
    room -= image_rate * image * duration
    highest = room / (frame * max(duration, 1e-9))
    if rate is not None and rate > max(highest, 0):
        raise InvalidArgument(
            f"{rate:g} frames per second of {duration:.0f} s would make a page of more than "
            f"{most_bytes / 1e6:.0f} MB: choose a --rate of at most {max(highest, 0):.3g}, or a "
            "shorter part with --from and --to"
        )
    if highest < LOWEST_RATE:
        raise InvalidArgument(
            f"{duration:.0f} s do not fit into a page of {most_bytes / 1e6:.0f} MB: choose a "
            "shorter part with --from and --to"
        )
    return _Plan(min(RATE, highest) if rate is None else rate, image_rate)


class _Page:
    """Collects what a page holds, and writes it."""

    def __init__(self, run: LoggedRun, begin: float, end: float, plan: _Plan) -> None:
        self._run, self._begin, self._end, self._plan = run, begin, end, plan
        self.course = run.course(plan.rate, begin, end)
        self._numbers = Numbers()

    def write(self, file: BinaryIO) -> None:
        run = self._run
        # The first frame is the newest step at `begin`, which may lie a little before it.
        begin = float(self.course.times[0])
        end = max(float(self.course.times[-1]), begin)
        contents = run.contents(BINS, self._begin, self._end)
        headline, facts = title_of(contents.curves)
        has_end = end + 1e-6 >= run.end and run.ends_in_log
        fault = run.fault
        if fault is not None and not begin <= fault.time <= end + 1e-6:
            fault = None
        plots, groups = self._plots(contents.rows, contents.curves, begin)
        index = {
            "begin": begin,
            "end": end,
            "fault": fault and {"time": min(fault.time, end), "text": fault.text},
            "ends": {"text": run.end_text()} if has_end else None,
            "marks": MARKS,
            "warnings": WARNINGS,
            "frames": self._frames(),
            **self._scene(),
            "title": headline,
            "facts": facts,
            "images": self._images(),
            "plots": plots,
            "groups": groups,
        }
        packed = gzip.compress(self._numbers.joined(), 6, mtime=0)
        data = {
            # "<" would let a text of the log end the element that holds it.
            "index": json.dumps(index, separators=(",", ":")).replace("<", "\\u003c"),
            "numbers": base64.b64encode(packed).decode(),
        }
        scripts = ("scene.js", "page.js", "file.js")
        file.write(document(scripts, data=data, TITLE=headline, FACTS=facts).text.encode())

    def _frames(self) -> dict[str, Any]:
        course = self.course
        return {
            "times": self._numbers.add(course.times, "<f8"),
            "steps": self._numbers.add(course.time_index, "<f8"),
            "marks": self._numbers.add(course.marks, "u1"),
            "span": 1.0 / self._plan.rate,
        }

    def _scene(self) -> dict[str, Any]:
        """The bodies, their poses in all frames, and the forces of the tips."""
        scene, course, count = self._run.scene, self.course, len(self.course)
        if scene is None or course.positions is None:
            nothing = self._numbers.add(np.zeros(count), "u1")
            return {"bodies": [], "forces": [], "ghost": nothing}
        poses = np.empty((count, len(scene.bodies), 7), np.float32)
        ghosts = np.empty_like(poses)
        is_ghostly = np.zeros(count, bool)
        forces: list[Array] = []
        for frame in shown(range(count), "poses of the bodies", count):
            joints = course.positions[frame]
            asked = joints if course.desired is None else course.desired[frame]
            desired = np.where(np.isfinite(asked), asked, joints)
            force = None if course.tip_forces is None else course.tip_forces[frame]
            here = placed(scene, joints, desired, course.objects_at(frame), force)
            poses[frame] = here.poses
            ghosts[frame] = here.poses if here.ghosts is None else here.ghosts
            is_ghostly[frame] = here.ghosts is not None
            forces.append(here.forces)
        told = session_of(scene, self._numbers, [*self._moments()], self._run.ink)
        for number, body in enumerate(scene.bodies):
            own = told["bodies"][number]
            last = None if body.is_moving else 1
            own["poses"] = self._poses(poses[:last, number])
            if own["isMoving"] and is_ghostly.any():
                own["ghosts"] = self._poses(ghosts[:, number])
        return {
            **told,
            "forces": [self._columns(np.array(one)) for one in zip(*forces, strict=True)],
            "hasForces": bool(forces and len(forces[0])),
            "ghost": self._numbers.add(is_ghostly, "u1"),
            "hasGhost": bool(is_ghostly.any()),
        }

    def _moments(self) -> Iterator[tuple[Array, Mapping[str, Array]]]:
        """Some poses of the robot and its objects, from the first frame to the last."""
        positions, course = self.course.positions, self.course
        if positions is not None:
            for frame in np.linspace(0, len(course) - 1, MOMENTS).astype(int):
                yield positions[frame], course.objects_at(frame)

    def _poses(self, poses: Array) -> Place:
        return self._columns(np.round(poses / _GRAIN) * _GRAIN)

    def _columns(self, rows: Array) -> Place:
        """Adds an array column by column: so neighbours are alike, and it becomes smaller."""
        return self._numbers.add(rows.T, "<f4")

    def _images(self) -> list[dict[str, Any]]:
        """The images of each camera, small, with the time at which they had arrived."""
        cameras = self._run.cameras
        if cameras is None or not self._plan.image_rate:
            return []
        extras.require("trifinger-view", "PIL")
        found: dict[str, dict[str, Any]] = {
            name: {"name": name, "times": [], "places": []} for name in cameras.names
        }
        course, newest, due = self.course, -1, -np.inf
        for frame in shown(range(len(course)), "images", len(course)):
            if course.times[frame] < due:
                continue
            try:
                images = cameras.get_latest_at(int(course.time_index[frame]))
            except NotInLog:
                continue
            if images is None or images.index == newest:
                continue
            newest, due = images.index, course.times[frame] + 0.99 / self._plan.image_rate
            for name in cameras.names:
                try:
                    file = jpeg(images[name], IMAGE_WIDTH)
                except (CameraLost, NotInLog):
                    continue
                found[name]["times"].append(float(course.times[frame]))
                found[name]["places"].append(self._numbers.add_file(file))
        return [camera for camera in found.values() if camera["times"]]

    def _plots(
        self, rows: Sequence[tuple[Curves, Panel]], curves: Curves, begin: float
    ) -> tuple[list[dict[str, Any]], list[str]]:
        """The plots, and names of groups of lines, such as fingers, that a reader can choose."""
        times = self._numbers.add(_ascending(curves.times) + begin, "<f8")
        plots = []
        names: list[str] = []
        for own, panel in rows:
            if own is not curves:  # of a companion: the scene shows it
                continue
            here = panel.groups
            if len(here) > 1 and not names:
                names = [text.removeprefix(", ") for text in names_of_groups(curves, panel)]
            lines = []
            for kind, envelope in panel.drawn():
                for column in range(envelope.columns):
                    if not envelope.has_numbers(slice(column, column + 1)):
                        continue
                    group, number = _place(column, here, len(names))
                    line = {**self._line(envelope, column), "group": group, "number": number}
                    lines.append({**line, "isDesired": kind == "desired"})
            title = f"{panel.name} [{panel.unit}]" if panel.unit else panel.name
            plots.append({"title": title, "times": times, "lines": lines})
        plots.sort(key=lambda plot: _ORDER.get(str(plot["title"]).split(" [")[0], len(_ORDER)))
        if curves.late is not None:
            factor, unit = time_unit(curves.late.max())
            scaled = Envelope(curves.lateness.bins)
            if curves.lateness.low is not None and curves.lateness.high is not None:
                scaled.low, scaled.high = (
                    curves.lateness.low * factor,
                    curves.lateness.high * factor,
                )
                line = {**self._line(scaled, 0), "group": None, "number": 0, "isDesired": False}
                plots.insert(1, {"title": f"lateness [{unit}]", "times": times, "lines": [line]})
        return plots, names

    def _line(self, envelope: Envelope, column: int) -> dict[str, Any]:
        if envelope.low is None or envelope.high is None:
            raise ValueError("there are no numbers to draw")
        low = place = self._numbers.add(envelope.low[:, column], "<f4")
        if not np.array_equal(envelope.low[:, column], envelope.high[:, column], equal_nan=True):
            place = self._numbers.add(envelope.high[:, column], "<f4")
        return {"low": low, "high": place}


def _place(column: int, groups: Sequence[range], count: int) -> tuple[int | None, int]:
    """To which of `count` groups, such as fingers, a column belongs, and its number there."""
    if len(groups) == count:
        for group, columns in enumerate(groups):
            if column in columns:
                return group, column - columns.start
    if len(groups) == 1 and len(groups[0]) == count:  # one number for each group
        return column, 0
    return None, column


def _ascending(times: Array) -> Array:
    """The times; a stretch without steps gets a time between those of its neighbours."""
    known = np.flatnonzero(np.isfinite(times))
    return np.interp(np.arange(len(times)), known, times[known])
