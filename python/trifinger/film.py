# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger film`: a session as a film, a strip of its pictures, and a plot of its manipulation.

The scene is drawn only from the log: joints as measured, objects as seen. Measured poses of objects
are noisy, so each is the mean of several.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trifinger import command, extras, picture
from trifinger._trifinger import Log, LoggedSession
from trifinger.errors import Error, InvalidArgument
from trifinger.picture import Painter, View
from trifinger.plot import COLOURS, entitle
from trifinger.progress import shown

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Array = NDArray[Any]

STRIP_IMAGES = 8
SMOOTHING = 5  # poses of an object in a mean
PHASES = {
    "grasp": "#F3EBD3",
    "lead": "#E3EEF6",
    "follow": "#DCEFE4",
    "hold": "#ECE6F2",
    "lower": "#DCEFE4",
    "release": "#F3EBD3",
}


class Scene:
    """Draws the scene of a log at any step."""

    def __init__(
        self, session: LoggedSession, is_plain: bool = False, view: View | None = None
    ) -> None:
        """Plain pictures lack shadows and smooth edges; drawing them takes a tenth of the time."""
        if "model.xml" not in session.documents:
            raise InvalidArgument(f"'{session.name}' has no model in its log to draw")
        self._painter = Painter(session.documents["model.xml"], is_plain, view)
        self.size = self._painter.size
        self._time_index = session.time_index
        self._joints = session.observations["position"]
        self._times, self._objects = object_poses(session)

    def image(self, step: int) -> Array:
        """The scene at a step: height x width x 3."""
        objects = [np.interp(step, self._times, column) for column in self._objects.T]
        row = min(int(np.searchsorted(self._time_index, step)), len(self._joints) - 1)
        return self._painter.draw([*self._joints[row], *objects])

    def close(self) -> None:
        """Releases the memory for drawing."""
        self._painter.close()


def object_poses(session: LoggedSession) -> tuple[Array, Array]:
    """The steps at which objects were seen, and a row of positions and quaternions per step."""
    elements = session.companion("object").observations
    names = [name for name in elements.dtype.names or () if name != "stamp"]
    columns = [
        np.asarray(elements[name][part]) for name in names for part in ("position", "orientation")
    ]
    poses = np.concatenate(columns, axis=1)
    for first in range(3, poses.shape[1], 7):
        # A quaternion and its negative are the same rotation, but have no mean.
        part = poses[:, first : first + 4]
        turns = np.sign(np.einsum("ij,ij->i", part[1:], part[:-1]))
        part[1:] *= np.cumprod(np.where(turns == 0, 1, turns))[:, None]
    padded = np.pad(poses, ((SMOOTHING // 2, SMOOTHING // 2), (0, 0)), mode="edge")
    kernel = np.ones(SMOOTHING) / SMOOTHING
    smooth = np.stack([np.convolve(column, kernel, "valid") for column in padded.T], axis=1)
    return np.asarray(elements["stamp"]["capture_index"]), smooth


def save_film(scene: Scene, session: LoggedSession, path: Path) -> None:
    """Writes a film at real speed."""
    every = max(round(1.0 / (picture.FILM_RATE * session.period)), 1)
    steps = range(int(session.time_index[0]), int(session.time_index[-1]) + 1, every)
    images = (scene.image(step) for step in shown(steps, path.name, len(steps)))
    picture.save_film(images, path, picture.FILM_RATE)


def save_strip(scene: Scene, session: LoggedSession, steps: Sequence[int], path: Path) -> None:
    """Saves pictures of some steps in two rows, each with its time."""
    from matplotlib.figure import Figure

    columns = (len(steps) + 1) // 2
    aspect = scene.size[1] / scene.size[0]
    figure = Figure(figsize=(3.0 * columns, 2 * 3.0 * aspect), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.02, h_pad=0.02, wspace=0.0, hspace=0.0)  # type: ignore[union-attr,call-arg]
    for number, step in enumerate(shown(steps, path.name, len(steps))):
        axes = figure.add_subplot(2, columns, number + 1)
        axes.imshow(scene.image(step))
        axes.axis("off")
        label: dict[str, Any] = {"facecolor": "black", "alpha": 0.55, "edgecolor": "none", "pad": 3}
        axes.text(
            0.03,
            0.95,
            f"{step * session.period:.1f} s",
            transform=axes.transAxes,
            va="top",
            color="white",
            fontsize=10,
            bbox=label,
        )
    figure.savefig(path, dpi=110)


class Trace:
    """The table and the report that `trifinger manipulate` writes."""

    def __init__(self, folder: Path) -> None:
        """Reads them from `folder`; raises Error if they are not there."""
        self.folder = folder
        try:
            with (folder / "trace.csv").open(newline="") as file:
                rows = list(csv.DictReader(file))
            self.report = json.loads((folder / "report.json").read_text())
            self.phases = [row.pop("phase") for row in rows]
            self.columns = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
            self.times = self.columns["step"] * self.report["period"]
        except FileNotFoundError as error:
            raise Error(
                f"{error.filename} is missing: `trifinger manipulate` leaves it in its --output"
            ) from error
        except (ValueError, TypeError, LookupError) as error:
            raise Error(f"{folder} has no report of `trifinger manipulate`: {error!r}") from error

    def group(self, name: str, parts: str) -> Array:
        """Columns such as normal_0 to normal_2, as the columns of one array."""
        return np.stack([self.columns[f"{name}_{part}"] for part in parts], axis=1)

    def spans(self) -> Iterator[tuple[str, float, float]]:
        """Yields each phase with the times at which it begins and ends [s]."""
        begin = 0
        for i in range(1, len(self.phases) + 1):
            if i == len(self.phases) or self.phases[i] != self.phases[begin]:
                yield self.phases[begin], self.times[begin], self.times[min(i, len(self.times) - 1)]
                begin = i

    def steps(self, count: int) -> list[int]:
        """Steps to show; most of them are from phases in which the fingers move."""
        moving = np.array([phase not in ("look", "plan", "hold") for phase in self.phases])
        weights = np.cumsum(np.where(moving, 1.0, 0.15))
        wanted = np.linspace(weights[0], weights[-1], count + 1)[1:]
        return [int(self.columns["step"][np.searchsorted(weights, w)]) for w in wanted - 1e-9]


def rotation_errors(desired: Array, found: Array) -> Array:
    """Angles between the rotations of two arrays of quaternions in rows [degrees]."""
    cosines = np.abs(np.einsum("ij,ij->i", desired, found))
    angles: Array = np.degrees(2.0 * np.arccos(np.clip(cosines, 0.0, 1.0)))
    return angles


def save_report(trace: Trace, path: Path) -> None:
    """Saves a plot of the manipulation: pose of the object, its error, and forces of the tips."""
    from matplotlib.figure import Figure

    desired, estimated = trace.group("desired", "xyz"), trace.group("estimated", "xyz")
    led = np.isin(trace.phases, ("lead", "follow", "hold", "lower"))
    error = np.where(led, 1e3 * np.linalg.norm(estimated - desired, axis=1), np.nan)
    quaternions = ("qw", "qx", "qy", "qz")
    angle = rotation_errors(
        np.stack([trace.columns[f"desired_{part}"] for part in quaternions], axis=1),
        np.stack([trace.columns[f"estimated_{part}"] for part in quaternions], axis=1),
    )
    figure = Figure(figsize=(12.0, 11.0), layout="constrained")
    parts: list[Axes] = list(figure.subplots(5, 1, sharex=True))
    known = ~np.isin(trace.phases, ("look", "plan"))
    for i, name in enumerate("xyz"):
        line: dict[str, Any] = {"color": COLOURS[i]}
        wanted = np.where(known, 1e2 * desired[:, i], np.nan)
        parts[0].plot(trace.times, wanted, linewidth=3.6, alpha=0.3, **line)
        found = np.where(known, 1e2 * estimated[:, i], np.nan)
        parts[0].plot(trace.times, found, linewidth=1.0, label=name, **line)
    entitle(parts[0], "position of the object: desired (broad), estimated", "cm")
    parts[1].plot(trace.times, error, color=COLOURS[0], linewidth=1.0, label="position [mm]")
    parts[1].plot(
        trace.times,
        np.where(led, angle, np.nan),
        color=COLOURS[1],
        linewidth=1.0,
        label="angle [°]",
    )
    parts[1].set_ylim(bottom=0)
    entitle(parts[1], "error, as estimated")
    for row, field, title in (
        (2, "normal", "what the tips press with"),
        (3, "tangential", "what they rub"),
    ):
        for i, finger in enumerate(("0", "120", "240")):
            values = np.where(known, trace.columns[f"{field}_{i}"], np.nan)
            parts[row].plot(
                trace.times, values, color=COLOURS[i], linewidth=0.8, label=f"finger {finger}"
            )
        parts[row].set_ylim(bottom=0)
        entitle(parts[row], title, "N")
    share = 100 * trace.columns["torque_share"]
    parts[4].plot(trace.times, share, color=COLOURS[0], linewidth=0.8)
    parts[4].axhline(100, color=COLOURS[1], linewidth=1.0, linestyle="--")
    parts[4].set_ylim(0, max(110.0, 1.05 * float(share.max())))
    entitle(parts[4], "largest torque asked for, of what the motors give", "%")
    parts[4].set_xlabel("time since the first step [s]")
    for axes in parts:
        for phase, begin, end in trace.spans():
            if phase in PHASES:
                axes.axvspan(begin, end, color=PHASES[phase], linewidth=0, zorder=0)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="#FFFFFF", linewidth=0.6)
        axes.set_axisbelow(True)
        if axes.get_legend_handles_labels()[0]:
            low, high = axes.get_ylim()
            axes.set_ylim(top=high + 0.22 * (high - low))  # room for phases and legend
            where: Any = "center left" if axes is parts[0] else "upper right"
            axes.legend(loc=where, ncols=3, fontsize=8, edgecolor="none")
    low, high = parts[0].get_ylim()
    top = high - 0.04 * (high - low)
    for phase, begin, end in trace.spans():
        if phase in PHASES and end - begin > 0.4:
            place: dict[str, Any] = {"ha": "center", "va": "top", "fontsize": 8, "color": "#555555"}
            parts[0].text((begin + end) / 2, top, phase, **place)
    parts[0].set_xlim(trace.times[0], trace.times[-1])
    report = trace.report
    outcome = "" if report["is_done"] else f": {report['failure']}"
    figure.suptitle(
        f"{report['task']}{outcome}: {1e3 * report['position_rms']:.2f} mm, "
        f"{np.degrees(report['orientation_rms']):.2f}° rms against the poses seen",
        x=0.01,
        ha="left",
        fontsize=13,
        fontweight="bold",
    )
    figure.savefig(path, dpi=110)


# ---- which session ----


def recordings(path: Path) -> Iterator[Log]:
    """Yields the recording in a file, or all recordings in a folder, the newest first."""
    newest = Log(path)
    yield newest
    others: dict[str, list[Path]] = {}
    for file in sorted(path.glob("*.mcap")) if path.is_dir() else ():
        try:
            recording = Log(file).origin.get("recording", str(file))
        except Error:  # not a log
            continue
        if file not in newest.files:
            others.setdefault(recording, []).append(file)
    logs = [Log(parts) for parts in others.values()]
    # Log(folder) chooses the newest recording by the same order: by time, then by name.
    yield from sorted(
        logs, key=lambda log: (log.origin.get("created", ""), log.files[0]), reverse=True
    )


def find_session(
    path: Path, robot: str = "", wanted: int | None = None, trace: Trace | None = None
) -> LoggedSession:
    """Finds the session to draw in a log or a folder of logs.

    `wanted` is the session's number in the newest recording, or its id. Without it, the session is
    that of the report in `trace`; without a report, the newest session of `robot`. Raises
    InvalidArgument with a list of the sessions if there is no such session, or if the report
    belongs to another one.
    """
    reported: int | None = trace.report.get("session_id") if trace else None
    if trace and reported is None and wanted is None:
        raise InvalidArgument(
            f"the report in {trace.folder} was made by an earlier version and does not name its "
            "session; choose one by --session"
        )
    if wanted is None and reported is None:
        return Log(path).session(robot)
    known: list[str] = []
    for age, log in enumerate(recordings(path)):
        for number, session in enumerate(log.sessions, 1):
            is_meant = session.session_id == (reported if wanted is None else wanted)
            if (is_meant or (age, number) == (0, wanted)) and robot in ("", session.name):
                if trace and reported not in (None, session.session_id):
                    raise InvalidArgument(
                        f"the report in {trace.folder} is of session {reported}, not of "
                        f"{describe(number, session)}; without --session its own is drawn"
                    )
                return session
            known.append(f"  {log.files[0].name}: {describe(number, session)}")
    what = f"session {wanted}" if wanted is not None else f"the session {reported} of the report"
    whose = f" of '{robot}'" if robot else ""
    raise InvalidArgument(f"{path} does not have {what}{whose}. There are\n" + "\n".join(known))


def describe(number: int, session: LoggedSession) -> str:
    """A description such as "session 2 of 'sim' (12.34 s, id 1234)"."""
    steps = len(session.time_index)
    duration = f"{steps * session.period:.2f} s"
    return f"session {number} of '{session.name}' ({duration}, id {session.session_id})"


# ---- the command ----


def film(
    session: LoggedSession,
    output: Path,
    trace: Trace | None = None,
    view: View | None = None,
) -> Iterator[Path]:
    """Draws a session into the folder `output` and yields the path of each file.

    The files are film.mp4 and strip.png. With the `trace` of a manipulation in this session there
    is report.png as well.
    """
    if not len(session.time_index):
        raise InvalidArgument(f"there are no steps of '{session.name}' to draw")
    output.mkdir(parents=True, exist_ok=True)
    path = output / "film.mp4"
    with contextlib.closing(Scene(session, is_plain=True, view=view)) as scene:
        save_film(scene, session, path)
    yield path
    first, last = int(session.time_index[0]), int(session.time_index[-1])
    if trace:
        steps = [min(step, last) for step in trace.steps(STRIP_IMAGES)]
    else:
        steps = np.linspace(first, last, STRIP_IMAGES).astype(int).tolist()
    path = output / "strip.png"
    with contextlib.closing(Scene(session, view=view)) as scene:
        save_strip(scene, session, steps, path)
    yield path
    if trace:
        path = output / "report.png"
        save_report(trace, path)
        yield path


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger film`."""
    parser = argparse.ArgumentParser(
        prog="trifinger film",
        description="Draw a session: a film and a strip of pictures; with a report, a plot of it.",
        epilog="Examples:\n"
        "  trifinger film logs                               the newest session\n"
        "  trifinger film logs --report manipulate_output    the session of the report",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("log", type=Path, help="a file, or a folder of recordings")
    parser.add_argument("-o", "--output", type=Path, help="folder; default: the report's, or film")
    parser.add_argument("--report", type=Path, help="folder that `trifinger manipulate` wrote")
    parser.add_argument("--robot", metavar="NAME", default="", help="needed if a log has several")
    parser.add_argument(
        "--session",
        type=int,
        metavar="N|ID",
        help="number or id, as `trifinger log info` shows them; default: the report's, or the "
        "newest",
    )
    picture.add_view_options(parser)
    arguments = parser.parse_args(words)

    def work() -> None:
        extras.require("film")
        view = picture.view_of(arguments)
        trace = Trace(arguments.report) if arguments.report else None
        session = find_session(arguments.log, arguments.robot, arguments.session, trace)
        output = arguments.output or arguments.report or Path("film")
        for path in film(session, output, trace, view):
            print(f"{path} written.", flush=True)

    return command.run(work)


if __name__ == "__main__":
    raise SystemExit(main())
