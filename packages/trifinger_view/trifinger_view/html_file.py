# SPDX-License-Identifier: BSD-3-Clause
"""A log as one page that needs neither a server nor a network: `trifinger view LOG -o run.html`.

The page has the robot in 3D, a time line, images, plots and the state in words, and can be sent to
others. The poses of all bodies are computed here; the page only draws them, with WebGL and a few
hundred lines of its own. Its browser is told to load nothing from elsewhere.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
from collections.abc import Mapping, Sequence
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

from trifinger_view.logged import MARKS, LoggedRun
from trifinger_view.page import (
    AZIMUTH,
    ELEVATION,
    FIELD_OF_VIEW,
    GHOST_ANGLE,
    METRES_PER_NEWTON,
    MIN_FORCE,
    smaller,
)
from trifinger_view.scene import Mesh, Scene

MAX_BYTES = 100_000_000
"""Limit for the size of a page [bytes]."""
RATE = 30.0
"""Frames per second, unless the page would be too large."""
LOWEST_RATE = 1.0
IMAGE_RATE = 5.0
IMAGE_WIDTH = 360  # [pixels]
BINS = 1200  # stretches of time in a plot
FOLDER = Path(__file__).parent
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


class _Numbers:
    """Arrays and files one after the other. Each has a place: its offset [bytes] and its size."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, values: Array, kind: str) -> tuple[int, int]:
        """Adds an array of the numbers `kind`; its size is how many there are."""
        array = np.ascontiguousarray(values, kind)
        return self._append(array.tobytes()), array.size

    def add_file(self, content: bytes) -> tuple[int, int]:
        """Adds the bytes of a file."""
        return self._append(content), len(content)

    def packed(self) -> str:
        """All of it, as text."""
        return base64.b64encode(gzip.compress(b"".join(self._parts), 6, mtime=0)).decode()

    def _append(self, content: bytes) -> int:
        place = self._size
        padded = content + bytes(-len(content) % 8)  # browsers want aligned numbers
        self._parts.append(padded)
        self._size += len(padded)
        return place


class _Page:
    """Collects what a page holds, and writes it."""

    def __init__(self, run: LoggedRun, begin: float, end: float, plan: _Plan) -> None:
        self._run, self._begin, self._end, self._plan = run, begin, end, plan
        self.course = run.course(plan.rate, begin, end)
        self._numbers = _Numbers()

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
            "frames": self._frames(),
            **self._scene(),
            "images": self._images(),
            "plots": plots,
            "groups": groups,
        }
        head = (FOLDER / "html_file_head.html").read_text(encoding="utf-8")
        for name, value in {"TITLE": headline, "FACTS": facts}.items():
            head = head.replace(name, html.escape(value))
        script = "\n".join(
            (FOLDER / name).read_text(encoding="utf-8")
            for name in ("html_file_scene.js", "html_file.js")
        )
        style = (FOLDER / "html_file.css").read_text(encoding="utf-8")
        # "<" would let a text of the log end the element that holds it.
        text = json.dumps(index, separators=(",", ":")).replace("<", "\\u003c")
        for part in (
            head.replace("/* STYLE */", style),
            f'<script type="application/json" id="index">{text}</script>\n',
            f'<script type="text/plain" id="numbers">{self._numbers.packed()}</script>\n',
            f'<script>"use strict";\n{script}</script>\n</body>\n</html>\n',
        ):
            file.write(part.encode())

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
        nothing: dict[str, Any] = {"bodies": [], "meshes": [], "forces": []}
        if scene is None or course.positions is None:
            return nothing
        meshes: list[dict[str, Any]] = []
        parts = [[self._part(mesh, meshes) for mesh in body.meshes] for body in scene.bodies]
        poses = np.empty((count, len(scene.bodies), 7), np.float32)
        ghosts = np.empty_like(poses)
        tips = np.zeros((count, len(scene.tip_names), 6), np.float32)
        asked = course.positions if course.desired is None else course.desired
        wanted = np.where(np.isfinite(asked), asked, course.positions)
        is_ghostly: Array = np.max(np.abs(wanted - course.positions), axis=1) > GHOST_ANGLE
        measured = course.tip_forces
        has_forces = measured is not None and measured.shape[1:] == tips.shape[1:2]
        for frame in shown(range(count), "poses of the bodies", count):
            joints = course.positions[frame]
            objects = course.objects_at(frame)
            poses[frame] = _rows(scene, joints, objects)
            if has_forces and measured is not None:
                places, along = scene.tips(joints)
                force = np.where(measured[frame] > MIN_FORCE, measured[frame], 0.0)
                tips[frame] = np.concatenate([places, along * force[:, None]], axis=1)
            if is_ghostly[frame]:
                ghosts[frame] = _rows(scene, wanted[frame], objects)
            else:
                ghosts[frame] = poses[frame]
        bodies = [
            self._body(body.name, own, body.is_moving, poses[:, number])
            for number, (body, own) in enumerate(zip(scene.bodies, parts, strict=True))
        ]
        for number, (body, own) in enumerate(zip(scene.bodies, parts, strict=True)):
            solid = [part for part in own if not part["isSurround"]]
            if np.any(is_ghostly) and body.is_moving and not body.object and solid:
                ghost = self._body(f"{body.name} desired", solid, True, ghosts[:, number])
                bodies.append({**ghost, "isGhost": True})
        forces = [
            {"name": name, "numbers": self._columns(tips[:, number])}
            for number, name in enumerate(scene.tip_names if has_forces else ())
        ]
        return {
            "bodies": bodies,
            "meshes": meshes,
            "forces": forces,
            "ghost": self._numbers.add(is_ghostly, "u1"),
            "metresPerNewton": METRES_PER_NEWTON,
            "camera": _camera(*scene.sphere(course.positions[0], course.objects_at(0))),
        }

    def _part(self, mesh: Mesh, meshes: list[dict[str, Any]]) -> dict[str, Any]:
        """A part of a body; its mesh is added to those of the page."""
        normals = np.zeros((len(mesh.normals), 4), np.int8)
        normals[:, :3] = np.round(127 * mesh.normals)
        meshes.append(
            {
                "positions": self._numbers.add(mesh.vertices, "<f4"),
                "normals": self._numbers.add(normals, "i1"),
                "colours": self._numbers.add(mesh.colours, "u1"),
                "triangles": self._numbers.add(mesh.faces, "<u4"),
            }
        )
        return {
            "mesh": len(meshes) - 1,
            "isTransparent": mesh.is_transparent,
            "isSurround": mesh.is_surround,
        }

    def _body(
        self, name: str, parts: list[dict[str, Any]], is_moving: bool, poses: Array
    ) -> dict[str, Any]:
        body = {"name": name, "parts": parts, "pose": [float(number) for number in poses[0]]}
        if is_moving:
            body["poses"] = self._columns(np.round(poses / _GRAIN) * _GRAIN)
        return body

    def _columns(self, rows: Array) -> tuple[int, int]:
        """Adds an array column by column: so neighbours are alike, and it becomes smaller."""
        return self._numbers.add(rows.T, "<f4")

    def _images(self) -> list[dict[str, Any]]:
        """The images of each camera, small, with the time at which they had arrived."""
        cameras = self._run.cameras
        if cameras is None or not self._plan.image_rate:
            return []
        extras.require("trifinger-view", "imageio")
        import imageio.v3 as imageio

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
                    pixels = smaller(images[name], IMAGE_WIDTH)
                except (CameraLost, NotInLog):
                    continue
                file = imageio.imwrite("<bytes>", pixels, extension=".jpeg", quality=75)
                found[name]["times"].append(float(course.times[frame]))
                found[name]["places"].append(self._numbers.add_file(file))
        return [camera for camera in found.values() if camera["times"]]

    def _plots(
        self, rows: Sequence[tuple[Curves, Panel]], curves: Curves, begin: float
    ) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
        """The plots, and the groups of lines, such as fingers, of which a reader can choose."""
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
                    lines.append({**line, "label": str(number), "isDesired": kind == "desired"})
            plots.append({"name": panel.name, "unit": panel.unit, "times": times, "lines": lines})
        plots.sort(key=lambda plot: _ORDER.get(str(plot["name"]), len(_ORDER)))
        if curves.late is not None:
            factor, unit = time_unit(curves.late.max())
            scaled = Envelope(curves.lateness.bins)
            if curves.lateness.low is not None and curves.lateness.high is not None:
                scaled.low, scaled.high = (
                    curves.lateness.low * factor,
                    curves.lateness.high * factor,
                )
                line = {**self._line(scaled, 0), "group": None, "number": 0, "label": ""}
                line["isDesired"] = False
                late = {"name": "lateness", "unit": unit, "times": times, "lines": [line]}
                plots.insert(1, late)
        everything = {"name": "all", "members": list(range(len(names)))}
        single = [{"name": name, "members": [number]} for number, name in enumerate(names)]
        return plots, [everything, *single] if names else []

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


def _camera(middle: Array, radius: float) -> dict[str, Any]:
    """Where the camera begins, so that a sphere fills the picture."""
    return {
        "target": [float(number) for number in middle],
        "distance": radius / np.sin(FIELD_OF_VIEW / 2),
        "azimuth": float(AZIMUTH + np.pi),
        "elevation": float(ELEVATION),
        "fieldOfView": FIELD_OF_VIEW,
    }


def _rows(scene: Scene, joints: Array, objects: Mapping[str, Array]) -> Array:
    return np.concatenate(scene.poses(joints, objects), axis=1)


def _ascending(times: Array) -> Array:
    """The times; a stretch without steps gets a time between those of its neighbours."""
    known = np.flatnonzero(np.isfinite(times))
    return np.interp(np.arange(len(times)), known, times[known])
