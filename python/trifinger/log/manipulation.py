# SPDX-License-Identifier: BSD-3-Clause
"""What `trifinger manipulate` has written about a manipulation, and a plot of it."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trifinger.arrays import Array
from trifinger.errors import Error
from trifinger.log.plot.matplotlib_figure import entitle
from trifinger.log.plot.panels import COLOURS
from trifinger.whole_file import whole_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Phases in which the object is not handled. They have no colour.
IDLE = ("look", "plan", "done", "failed")
PHASES = {
    "grasp": "#F3EBD3",
    "lead": "#E3EEF6",
    "follow": "#DCEFE4",
    "hold": "#ECE6F2",
    "lower": "#DCEFE4",
    "release": "#F3EBD3",
}
# Colours of all other phases, in the order in which they first come.
PALETTE = ("#E3EEF6", "#DCEFE4", "#ECE6F2", "#F8E3DC", "#E0F0F0", "#F0ECDD", "#E9E9E9", "#F6E2EE")


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

    def group(self, name: str, parts: Iterable[str]) -> Array:
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
    """Saves a plot of a manipulation: pose of the object, forces, torque, and what a pen drew."""
    from matplotlib.figure import Figure

    known = ~np.isin(trace.phases, ("look", "plan"))
    draws: list[Callable[[Axes], None]] = [
        lambda axes: draw_position(axes, trace, known),
        lambda axes: draw_error(axes, trace),
    ]
    for field, title in (
        ("normal", "normal force of the tips"),
        ("tangential", "tangential force of the tips"),
    ):
        if f"{field}_0" in trace.columns:
            draws.append(partial(draw_forces, trace=trace, known=known, field=field, title=title))
    draws.append(lambda axes: draw_torque(axes, trace))

    shows_line = "nib_reach" in trace.report
    height = 2.2 * len(draws)
    figure = Figure(figsize=(12.0, height + (5.0 if shows_line else 0.0)), layout="constrained")
    over_time: Any = figure
    below: Any = None
    if shows_line:
        halves: Any = figure.subfigures(2, 1, height_ratios=(height, 5.0))
        over_time, below = halves
    parts: list[Axes] = list(over_time.subplots(len(draws), 1, sharex=True))
    for axes, draw in zip(parts, draws, strict=True):
        draw(axes)
    draw_phases(parts, trace)
    parts[0].set_xlim(trace.times[0], trace.times[-1])
    parts[-1].set_xlabel("time since the first step [s]")
    if below is not None:
        draw_line(below.subplots(), trace)
    figure.suptitle(title_of(trace.report), x=0.01, ha="left", fontsize=13, fontweight="bold")
    with whole_file(path) as part:
        figure.savefig(part, dpi=110)


def title_of(report: dict[str, Any]) -> str:
    """What was done, how it ended, and how exactly."""
    outcome = "" if report["is_done"] else f": {report['failure']}"
    text = f"{report['task']}{outcome}"
    if "position_rms" in report:
        text += f": {1e3 * report['position_rms']:.2f} mm"
        if "orientation_rms" in report:
            text += f", {np.degrees(report['orientation_rms']):.2f}°"
        text += " rms against the poses seen"
    return text


def draw_position(axes: Axes, trace: Trace, known: Array) -> None:
    """Draws where the object should be and where it is thought to be."""
    desired, estimated = trace.group("desired", "xyz"), trace.group("estimated", "xyz")
    for i, name in enumerate("xyz"):
        line: dict[str, Any] = {"color": COLOURS[i]}
        wanted = np.where(known, 1e2 * desired[:, i], np.nan)
        axes.plot(trace.times, wanted, linewidth=3.6, alpha=0.3, **line)
        found = np.where(known, 1e2 * estimated[:, i], np.nan)
        axes.plot(trace.times, found, linewidth=1.0, label=name, **line)
    entitle(axes, "position of the object: desired (broad), estimated", "cm")


def draw_error(axes: Axes, trace: Trace) -> None:
    """Draws the errors of position and angle while the object is led."""
    led = ~np.isin(trace.phases, (*IDLE, "grasp", "release"))
    error = trace.group("estimated", "xyz") - trace.group("desired", "xyz")
    quaternions = ("qw", "qx", "qy", "qz")
    angle = rotation_errors(
        trace.group("desired", quaternions), trace.group("estimated", quaternions)
    )
    for values, label, colour in (
        (1e3 * np.linalg.norm(error, axis=1), "position [mm]", COLOURS[0]),
        (angle, "angle [°]", COLOURS[1]),
    ):
        shown = np.where(led, values, np.nan)
        axes.plot(trace.times, shown, color=colour, linewidth=1.0, label=label)
    axes.set_ylim(bottom=0)
    entitle(axes, "error, as estimated")


def draw_forces(axes: Axes, trace: Trace, known: Array, field: str, title: str) -> None:
    """Draws a force of each finger."""
    for i, finger in enumerate(("0", "120", "240")):
        values = np.where(known, trace.columns[f"{field}_{i}"], np.nan)
        axes.plot(trace.times, values, color=COLOURS[i], linewidth=0.8, label=f"finger {finger}")
    axes.set_ylim(bottom=0)
    entitle(axes, title, "N")


def draw_torque(axes: Axes, trace: Trace) -> None:
    """Draws how much of the motors' torque is used."""
    share = 100 * trace.columns["torque_share"]
    axes.plot(trace.times, share, color=COLOURS[0], linewidth=0.8)
    axes.axhline(100, color=COLOURS[1], linewidth=1.0, linestyle="--")
    axes.set_ylim(0, max(110.0, 1.05 * float(share.max())))
    entitle(axes, "largest torque asked for, of what the motors give", "%")


def draw_line(axes: Axes, trace: Trace) -> None:
    """Draws what a pen should have drawn, and what it drew."""
    on_paper = np.array([phase == "draw" for phase in trace.phases])
    quaternions = ("qw", "qx", "qy", "qz")
    styles: dict[str, dict[str, Any]] = {
        "desired": {"linewidth": 4.5, "alpha": 0.3, "color": COLOURS[0]},
        "estimated": {"linewidth": 1.2, "color": COLOURS[7]},
    }
    for kind, style in styles.items():
        w, x, y, z = trace.group(kind, quaternions).T
        along = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z)], axis=1)
        nib = trace.group(kind, "xy") + trace.report["nib_reach"] * along
        nib = np.where(on_paper[:, None], 1e2 * nib, np.nan)
        axes.plot(nib[:, 0], nib[:, 1], label=kind, solid_capstyle="round", **style)
    axes.set_aspect("equal", "datalim")
    axes.grid(color="#E6E6E6", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel("x [cm]")
    axes.legend(loc="upper right", ncols=2, fontsize=8, edgecolor="none")
    entitle(axes, "line on the paper: desired (broad), estimated; y", "cm")


def colours_of(phases: Iterable[str]) -> dict[str, str]:
    """A colour for each phase: its own, or the next of the palette."""
    colours: dict[str, str] = {}
    others = cycle(PALETTE)
    for phase in phases:
        if phase not in colours:
            colours[phase] = PHASES[phase] if phase in PHASES else next(others)
    return colours


def draw_phases(parts: Sequence[Axes], trace: Trace) -> None:
    """Draws the phases below all lines, with their names in the first panel, and the legends."""
    spans = [span for span in trace.spans() if span[0] not in IDLE]
    colours = colours_of([phase for phase, _, _ in spans])
    for axes in parts:
        for phase, begin, end in spans:
            axes.axvspan(begin, end, color=colours[phase], linewidth=0, zorder=0)
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
    for phase, begin, end in spans:
        if end - begin > 0.4:
            place: dict[str, Any] = {"ha": "center", "va": "top", "fontsize": 8, "color": "#555555"}
            parts[0].text((begin + end) / 2, top, phase, **place)
