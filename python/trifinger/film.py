# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger film`: a session as a film, a strip of its pictures, and a plot of its manipulation.

The scene is drawn from the log alone: joints as measured, objects as they were seen, averaged over
a twentieth of a second because that is noisy.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trifinger import picture
from trifinger._trifinger import Log, LoggedSession
from trifinger.errors import Error, InvalidArgument
from trifinger.picture import Painter, View
from trifinger.plot import COLOURS, entitle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Array = NDArray[Any]

STRIP_IMAGES = 8
SMOOTHING = 5  # poses
PHASES = {
    "grasp": "#F3EBD3",
    "lead": "#E3EEF6",
    "follow": "#DCEFE4",
    "hold": "#ECE6F2",
    "lower": "#DCEFE4",
    "release": "#F3EBD3",
}


class Scene:
    """What a log shows at any step, as pictures."""

    def __init__(
        self, session: LoggedSession, is_plain: bool = False, view: View | None = None
    ) -> None:
        """Plain pictures have neither shadows nor smooth edges, and take a tenth of the time."""
        if "model.xml" not in session.documents:
            raise InvalidArgument(f"'{session.name}' has no model in its log to draw")
        self._painter = Painter(session.documents["model.xml"], is_plain, view)
        self.size = self._painter.size
        self._joints = session.observations["position"]
        self._times, self._objects = object_poses(session)

    def image(self, step: int) -> Array:
        """The scene at a step: height x width x 3."""
        objects = [np.interp(step, self._times, column) for column in self._objects.T]
        return self._painter.draw([*self._joints[step], *objects])

    def close(self) -> None:
        """Gives the memory of the pictures back."""
        self._painter.close()


def object_poses(session: LoggedSession) -> tuple[Array, Array]:
    """Steps at which objects were seen, and a row of positions and quaternions for each."""
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
    """A film at the speed of life."""
    every = max(round(1.0 / (picture.FILM_RATE * session.period)), 1)
    images = (scene.image(step) for step in range(0, session.steps or 0, every))
    picture.save_film(images, path, picture.FILM_RATE)


def save_strip(scene: Scene, session: LoggedSession, steps: Sequence[int], path: Path) -> None:
    """Pictures side by side, in two rows, with the time of each."""
    from matplotlib.figure import Figure

    columns = (len(steps) + 1) // 2
    aspect = scene.size[1] / scene.size[0]
    figure = Figure(figsize=(3.0 * columns, 2 * 3.0 * aspect), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.02, h_pad=0.02, wspace=0.0, hspace=0.0)  # type: ignore[union-attr,call-arg]
    for number, step in enumerate(steps):
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
    """The table that `trifinger manipulate` leaves."""

    def __init__(self, folder: Path) -> None:
        with (folder / "trace.csv").open(newline="") as file:
            rows = list(csv.DictReader(file))
        self.report = json.loads((folder / "report.json").read_text())
        self.phases = [row.pop("phase") for row in rows]
        self.columns = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
        self.times = self.columns["step"] * self.report["period"]

    def group(self, name: str, parts: str) -> Array:
        """Columns such as normal_0 to normal_2, side by side."""
        return np.stack([self.columns[f"{name}_{part}"] for part in parts], axis=1)

    def spans(self) -> Iterator[tuple[str, float, float]]:
        """Each phase with its begin and its end [s]."""
        begin = 0
        for i in range(1, len(self.phases) + 1):
            if i == len(self.phases) or self.phases[i] != self.phases[begin]:
                yield self.phases[begin], self.times[begin], self.times[min(i, len(self.times) - 1)]
                begin = i

    def steps(self, count: int) -> list[int]:
        """Steps to be shown: from the begin of the grasp to the end, most where much happens."""
        moving = np.array([phase not in ("look", "plan", "hold") for phase in self.phases])
        weights = np.cumsum(np.where(moving, 1.0, 0.15))
        wanted = np.linspace(weights[0], weights[-1], count + 1)[1:]
        return [int(self.columns["step"][np.searchsorted(weights, w)]) for w in wanted - 1e-9]


def rotation_errors(desired: Array, found: Array) -> Array:
    """Angles between the rotations of quaternions in rows [degrees]."""
    cosines = np.abs(np.einsum("ij,ij->i", desired, found))
    angles: Array = np.degrees(2.0 * np.arccos(np.clip(cosines, 0.0, 1.0)))
    return angles


def save_report(trace: Trace, path: Path) -> None:
    """A plot of the manipulation: where the object was, how wrong, and what held it."""
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
            axes.set_ylim(top=high + 0.22 * (high - low))  # for what is written there
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


def film(
    log: Log,
    output: Path,
    robot: str = "",
    report: Path | None = None,
    view: View | None = None,
) -> list[Path]:
    """Draws the newest session of `robot` and returns the files it has made in `output`.

    They are film.mp4 and strip.png; report.png as well, if `report` is the folder that
    `trifinger manipulate` has left its report of this session in.
    """
    session = log.session(robot)
    if not session.steps:
        raise InvalidArgument(f"there are no steps of '{session.name}' to draw")
    trace = Trace(report) if report else None
    output.mkdir(parents=True, exist_ok=True)
    made = [output / "film.mp4", output / "strip.png"]
    with contextlib.closing(Scene(session, is_plain=True, view=view)) as scene:
        save_film(scene, session, made[0])
    with contextlib.closing(Scene(session, view=view)) as scene:
        if trace:
            steps = [min(step, session.steps - 1) for step in trace.steps(STRIP_IMAGES)]
        else:
            steps = np.linspace(0, session.steps - 1, STRIP_IMAGES).astype(int).tolist()
        save_strip(scene, session, steps, made[1])
    if trace:
        made.append(output / "report.png")
        save_report(trace, made[-1])
    return made


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger film`."""
    parser = argparse.ArgumentParser(
        prog="trifinger film",
        description="Draw the newest session of a robot: a film and a strip of pictures.",
        epilog="Example:\n  trifinger film logs --report manipulate_output",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("log", help="a file, or a folder: the newest recording in it")
    parser.add_argument("-o", "--output", type=Path, help="folder; default: the report's, or film")
    parser.add_argument("--report", type=Path, help="folder that `trifinger manipulate` has made")
    parser.add_argument("--robot", metavar="NAME", default="", help="needed if there are several")
    picture.add_view_options(parser)
    arguments = parser.parse_args(words)
    output = arguments.output or arguments.report or Path("film")
    try:
        view = picture.view_of(arguments)
        made = film(Log(arguments.log), output, arguments.robot, arguments.report, view)
    except (Error, OSError) as error:
        print(f"trifinger: {error}", file=sys.stderr)
        return 2 if isinstance(error, InvalidArgument) else 1
    except KeyboardInterrupt:
        return 130
    print(*(f"{path} written." for path in made), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
