# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger log plot`: draws a session of any robot in one picture.

Fields, shapes and units come from the log. If there are more steps than a picture can show, the
smallest and the largest number of each stretch of steps are drawn, so that no peak is lost. The log
may be larger than memory. `plot_page` draws the same on a page in which one can zoom.
"""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trifinger import command, extras
from trifinger._trifinger import (
    LatenessHistogram,
    Log,
    LoggedSession,
    Status,
    TimingRecord,
    duration_text,
    lateness_of,
)
from trifinger.errors import InvalidArgument
from trifinger.export import ROWS, step_range
from trifinger.progress import shown

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    Array = NDArray[Any]

# Okabe and Ito's colours, which people with any colour vision can tell apart.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#777777", "#000000")
MARKS = {
    "repeated": "#E69F00",
    "rejected": "#D55E00",
    "acausal": "#CC79A7",
    "skipped": "#7B3F9E",
    "gap": "#999999",
    "event": "#0072B2",
}
BAD = "#C0202A"
# Names of the parts of long fields, by the type of the robot.
GROUPS = {"trifinger": ("finger 0", "finger 120", "finger 240")}
BINS = 1600  # bins of time in a panel


class Envelope:
    """The smallest and the largest numbers of a field in each bin of time."""

    def __init__(self, bins: int) -> None:
        self.bins = bins
        self.low: Array | None = None
        self.high: Array | None = None

    def add(self, bins: Array, starts: Array, values: Array) -> None:
        """Adds the rows of `values`; the rows of the bin `bins[i]` begin at row `starts[i]`."""
        rows = np.asarray(values, dtype=np.float64).reshape(len(values), -1)
        if self.low is None or self.high is None:
            self.low = np.full((self.bins, rows.shape[1]), np.nan)
            self.high = self.low.copy()
        self.low[bins] = np.fmin(self.low[bins], np.fmin.reduceat(rows, starts))
        self.high[bins] = np.fmax(self.high[bins], np.fmax.reduceat(rows, starts))

    @property
    def columns(self) -> int:
        """How many numbers are in a row."""
        return 0 if self.low is None else self.low.shape[1]

    def has_numbers(self, columns: slice = slice(None)) -> bool:
        """Whether any number is finite."""
        return self.low is not None and bool(np.any(np.isfinite(self.low[:, columns])))

    def line(self, times: Array, column: int) -> tuple[Array, Array]:
        """The line to draw, from smallest to largest in each bin; NaN interrupts it at gaps."""
        assert self.low is not None  # noqa: S101
        assert self.high is not None  # noqa: S101
        low, high = self.low[:, column], self.high[:, column]
        if np.array_equal(low, high, equal_nan=True):
            return times, low
        return np.repeat(times, 2), np.column_stack([low, high]).ravel()


@dataclass
class Picture:
    """The data of a session that are drawn."""

    session: LoggedSession
    bins: int
    first: int
    last: int
    steps: int = 0
    times: Array = field(default_factory=lambda: np.empty(0))  # times of the bins [s]
    begin: int = 0  # time of the first step, since 1970 [ns]
    end: int = 0  # time of the last step, since 1970 [ns]
    # The keys are series and field, as in ("observation", "position").
    fields: dict[tuple[str, str], Envelope] = field(default_factory=dict)
    lateness: Envelope = field(default_factory=lambda: Envelope(0))
    timing: TimingRecord | None = None  # None outside real-time mode
    marks: dict[str, list[float]] = field(default_factory=dict)  # times [s]
    counts: dict[str, int] = field(default_factory=dict)
    gaps: list[tuple[float, float]] = field(default_factory=list)

    @property
    def duration(self) -> float:
        """Time from the first to the last step [s]."""
        return (self.end - self.begin) * 1e-9

    def seconds(self, nanoseconds: int) -> float:
        """Converts a time since 1970 [ns] to a time since the first step [s]."""
        return (nanoseconds - self.begin) * 1e-9

    @property
    def has_lateness(self) -> bool:
        """Whether the log says how late the steps were."""
        return self.timing is not None and self.timing.lateness().max() > 0


def is_number(series: str, dtype: np.dtype[Any]) -> bool:
    """Whether a field gets a panel: real numbers do; counters, stamps and bits do not."""
    return series != "status" and dtype.kind == "f"


def fields_of(dtype: np.dtype[Any], prefix: str = "") -> Iterator[tuple[str, np.dtype[Any]]]:
    """Yields name and type of each field of an element; nested names are like "left.angle"."""
    for name in dtype.names or ():
        inner = dtype[name]
        if inner.names is None:
            yield prefix + name, inner.base
        else:
            yield from fields_of(inner, f"{prefix}{name}.")


def mark_steps(picture: Picture, statuses: Array, seconds: Array) -> None:
    """Notes steps in which something went wrong: counts all, marks no more than can be seen."""
    flags = statuses["flags"]
    kinds = {
        "repeated": flags & Status.ACTION_REPEATED.value != 0,
        "rejected": flags & Status.ACTION_REJECTED.value != 0,
        "acausal": flags & Status.ACAUSAL.value != 0,
        "skipped": statuses["skipped_ticks"] > 0,
    }
    for kind, is_so in kinds.items():
        count = int(np.count_nonzero(is_so))
        if not count:
            continue
        if kind == "skipped":
            count = int(statuses["skipped_ticks"].sum())
        picture.counts[kind] = picture.counts.get(kind, 0) + count
        marks = picture.marks.setdefault(kind, [])
        found = seconds[is_so]
        marks.extend(found[:: max(1, len(found) // 200)].tolist())


def read(
    session: LoggedSession, first: int | None = None, last: int | None = None, bins: int = BINS
) -> Picture:
    """Reads what is drawn: goes through all steps once, and through their statuses twice."""
    begin, end = session.range("observation" if session.is_companion else "applied_action")
    begin = begin if first is None else max(begin, first)
    timing = session.timing(begin, last)
    end = end if last is None else min(end, last)
    picture = Picture(session, max(1, min(bins, end - begin)), begin, end, timing=timing)
    picture.times = np.full(picture.bins, np.nan)
    picture.lateness = Envelope(picture.bins)
    before = begin
    before_seconds = 0.0
    parts = session.chunks(ROWS, begin, end)
    for steps in shown(parts, f"reading '{session.name}'", -(-(end - begin) // ROWS)):
        times = steps.times.astype(np.int64)
        if not picture.steps:
            picture.begin = int(times[0])
        picture.steps += len(steps)
        picture.end = int(times[-1])
        seconds = (times - picture.begin) * 1e-9
        rows, starts = np.unique(
            (steps.time_index - begin) * picture.bins // (end - begin), return_index=True
        )
        picture.times[rows] = np.fmin(picture.times[rows], seconds[starts])
        # Where indices jump, steps are missing: each jump is drawn as a gap.
        jumps = np.flatnonzero(np.diff(steps.time_index, prepend=before - 1) > 1)
        for jump in jumps:
            start = seconds[jump - 1] if jump else before_seconds
            picture.gaps.append((float(start), float(seconds[jump])))
        before, before_seconds = int(steps.time_index[-1]) + 1, float(seconds[-1])
        for series, elements in (
            ("observation", steps.observations),
            ("desired_action", steps.desired_actions),
            ("applied_action", steps.applied_actions),
        ):
            if elements is None:
                continue
            for name, kind in fields_of(elements.dtype):
                if is_number(series, kind):
                    values = elements
                    for part in name.split("."):
                        values = values[part]
                    envelope = picture.fields.setdefault((series, name), Envelope(picture.bins))
                    envelope.add(rows, starts, values)
        statuses = steps.statuses
        if statuses is not None and {"flags", "skipped_ticks"} <= set(statuses.dtype.names or ()):
            mark_steps(picture, statuses, seconds)
        if statuses is not None and picture.timing is not None:
            picture.lateness.add(rows, starts, lateness_of(statuses, session.period))
    return picture


# ---- drawing ----


@dataclass(frozen=True)
class Panel:
    """One row of the picture: a field as it was measured, desired and applied."""

    name: str
    unit: str
    measured: Envelope | None
    desired: Envelope | None = None
    applied: Envelope | None = None

    def drawn(self) -> list[tuple[str, Envelope]]:
        """The lines to draw, in this order: "desired", then "measured" or "applied"."""
        # A measured torque is the one applied a step before, so only one of them is drawn.
        is_applied = self.measured is None or (self.applied is not None and self.unit == "Nm")
        kinds = (
            ("desired", self.desired),
            ("applied", self.applied) if is_applied else ("measured", self.measured),
        )
        return [(kind, envelope) for kind, envelope in kinds if envelope is not None]

    @property
    def columns(self) -> int:
        """How many numbers the panel shows."""
        return max(one.columns for one in (self.measured, self.desired, self.applied) if one)


def panels_of(picture: Picture) -> list[Panel]:
    """A panel per field; fields of observations and actions with one name share a panel."""
    units = picture.session.units
    panels = []
    names = list(dict.fromkeys(name for _, name in picture.fields))
    for name in names:
        shown = {
            series: picture.fields.get((series, name))
            for series in ("observation", "desired_action", "applied_action")
        }
        if not any(one is not None and one.has_numbers() for one in shown.values()):
            continue
        unit = next((units[series][name] for series, one in shown.items() if one is not None), "")
        measured, desired, applied = shown.values()
        if measured is None and name.endswith(("_kp", "_kd")):
            continue  # gains, which are constant or set by the robot
        panels.append(Panel(name, unit, measured, desired, applied))
    return panels


def names_of_groups(picture: Picture, panel: Panel) -> list[str]:
    """Names of a panel's parts, to append to its own, as in ", finger 0"; "" for a single part."""
    groups = groups_of(panel.columns)
    if len(groups) == 1:
        return [""]
    names = GROUPS.get(picture.session.type, ())
    if len(names) != len(groups):
        return [f", {numbers.start} to {numbers.stop - 1}" for numbers in groups]
    return [f", {name}" for name in names]


def groups_of(columns: int) -> list[range]:
    """Groups of numbers that are drawn together: fingers of three joints, legs, or all."""
    for size in (3, 4, 2):
        if columns > 4 and columns % size == 0 and columns // size <= 4:
            return [range(i, i + size) for i in range(0, columns, size)]
    return [range(columns)]


def title_of(picture: Picture) -> tuple[str, str]:
    """The headline, and a line with facts about the session."""
    session = picture.session
    begun = datetime.fromtimestamp(picture.begin * 1e-9, UTC)
    facts = [f"{begun:%Y-%m-%d %H:%M:%S} UTC", f"{picture.steps} steps"]
    if picture.duration > 0:
        facts.append(f"{picture.duration:.4g} s")
        rate = (picture.last - picture.first - 1) / picture.duration
        facts.append(f"{rate:.4g} Hz")
    if picture.timing is not None:
        facts.append(f"lateness {picture.timing.lateness()}")
    facts.extend(f"{count} {kind}" for kind, count in picture.counts.items())
    if session.gaps:
        missing = sum(gap.last - gap.first + 1 for gap in session.gaps)
        facts.append(f"{missing} steps missing")
    if session.fault is not None:
        facts.append(session.fault.code.replace("_", " "))
    return f"{session.name}  ·  {session.type}", "   ·   ".join(facts)


def decorate(axes: Axes, picture: Picture) -> None:
    """Draws what all panels over time share: grid, gaps and the fault."""
    axes.grid(color="#E6E6E6", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.margins(x=0.01)
    for start, end in picture.gaps:
        axes.axvspan(start, end, color=MARKS["gap"], alpha=0.25, linewidth=0)
    fault = picture.session.fault
    if fault is not None and fault.needs_recovery and fault.time_index <= picture.last:
        axes.axvline(picture.duration, color=BAD, linewidth=1.4)


def draw_panel(axes: Axes, picture: Picture, panel: Panel, numbers: range) -> None:
    """Draws desired numbers as broad, pale lines, and applied or measured ones on top."""
    styles: dict[str, dict[str, Any]] = {
        "desired": {"linewidth": 3.6, "alpha": 0.3, "solid_capstyle": "butt"}
    }
    for kind, envelope in panel.drawn():
        style = styles.get(kind, {"linewidth": 1.0})
        if not envelope.has_numbers(slice(numbers.start, numbers.stop)):
            continue
        for i, number in enumerate(numbers):
            x, y = envelope.line(picture.times, number)
            axes.plot(x, y, color=COLOURS[i % len(COLOURS)], **style)
    decorate(axes, picture)


def entitle(axes: Axes, title: str, unit: str = "") -> None:
    """Sets the title above a panel and the unit of its numbers."""
    axes.set_title(title, loc="left", fontsize=9, fontweight="bold", color="#333333")
    if unit:
        axes.set_ylabel(f"[{unit}]")


def draw_row(parts: Sequence[Axes], picture: Picture, panel: Panel) -> None:
    """Draws all numbers of a field; many numbers are in several panels side by side."""
    groups = groups_of(panel.columns)
    names = names_of_groups(picture, panel)
    for i, (axes, numbers, name) in enumerate(zip(parts, groups, names, strict=True)):
        draw_panel(axes, picture, panel, numbers)
        entitle(axes, panel.name + name, panel.unit if i == 0 else "")
        if i:
            axes.tick_params(labelleft=False)


def time_unit(seconds: float) -> tuple[float, str]:
    """A factor and a unit in which a time of this size [s] has few digits."""
    for factor, unit in ((1e9, "ns"), (1e6, "µs"), (1e3, "ms")):
        if seconds * factor < 1000:
            return factor, unit
    return 1.0, "s"


def histogram_of(lateness: LatenessHistogram) -> tuple[Array, Array]:
    """Steps per bin, from the first to the last bin that is not empty, and the bins' edges."""
    counts = np.array(lateness.counts())
    edges = np.array([*lateness.edges(), np.inf])
    shown = np.flatnonzero(counts)
    low, high = shown[0], shown[-1] + 1
    edges = np.minimum(edges[low : high + 1], max(lateness.max(), edges[low + 1]))
    # Times below the first edge cannot be drawn on a logarithmic axis.
    return counts[low:high], np.maximum(edges, 0.5 * lateness.edges()[1])


def draw_lateness(trace: Axes, histogram: Axes, picture: Picture) -> None:
    """Draws the lateness of the steps over time and as a histogram."""
    assert picture.timing is not None  # noqa: S101
    lateness = picture.timing.lateness()
    x, y = picture.lateness.line(picture.times, 0)
    factor, unit = time_unit(lateness.max())
    quantiles = (
        (lateness.quantile(0.5), COLOURS[2], "p50"),
        (lateness.quantile(0.99), COLOURS[1], "p99"),
        (lateness.max(), BAD, "max"),
    )
    trace.plot(x, y * factor, color=COLOURS[0], linewidth=0.8)
    trace.axhline(quantiles[1][0] * factor, color=COLOURS[1], linewidth=1.0, linestyle="--")
    trace.set_ylim(bottom=0)
    entitle(trace, "lateness", unit)
    decorate(trace, picture)

    counts, edges = histogram_of(lateness)
    histogram.stairs(counts, edges * factor, fill=True, color=COLOURS[5])
    histogram.set_xscale("log")
    histogram.set_yscale("log")
    histogram.set_xlabel(f"lateness [{unit}]")
    entitle(histogram, "lateness, how many steps")
    for value, colour, label in quantiles:
        line: dict[str, Any] = {"color": colour, "linewidth": 1.1, "linestyle": "--"}
        histogram.axvline(value * factor, label=f"{label} {duration_text(value)}", **line)
    histogram.legend(fontsize=8, loc="upper right", handlelength=1.3, edgecolor="none")
    histogram.grid(color="#E6E6E6", linewidth=0.6)
    histogram.set_axisbelow(True)


def draw_marks(axes: Axes, picture: Picture, marks: dict[str, list[float]]) -> None:
    """Draws a line for each kind of trouble, with a stroke where it happened."""
    kinds = [*marks, *(["gap"] if picture.gaps else [])]
    for row, kind in enumerate(reversed(kinds)):
        if kind == "gap":
            bars = [(start, max(stop - start, 1e-9)) for start, stop in picture.gaps]
            axes.broken_barh(bars, (row - 0.35, 0.7), color=MARKS["gap"])
        else:
            times = marks[kind]
            stroke: dict[str, Any] = {"markersize": 9, "markeredgewidth": 1.4, "color": MARKS[kind]}
            axes.plot(times, [row] * len(times), "|", **stroke)
    axes.set_yticks(range(len(kinds)), list(reversed(kinds)))
    axes.set_ylim(-0.6, max(len(kinds), 1) - 0.4)
    decorate(axes, picture)
    entitle(axes, "what went wrong")


def draw_head(axes: Axes, picture: Picture, panels: Sequence[Panel]) -> None:
    """Draws name and facts on the left, and the legend on the right."""
    from matplotlib.lines import Line2D

    axes.axis("off")
    headline, facts = title_of(picture)
    place: dict[str, Any] = {"transform": axes.transAxes, "va": "center"}
    axes.text(0.0, 0.75, headline, fontsize=15, fontweight="bold", **place)
    axes.text(0.0, 0.38, facts, fontsize=9, color="#555555", **place)
    fault = picture.session.fault
    if fault is not None and fault.needs_recovery:
        text = textwrap.shorten(picture.session.fault_text, 190)
        axes.text(0.0, 0.08, text, fontsize=9, color=BAD, **place)
    handles = []
    if any(panel.desired is not None and panel.desired.has_numbers() for panel in panels):
        handles += [
            Line2D([], [], color="#777777", linewidth=3.6, alpha=0.4, label="desired"),
            Line2D([], [], color="#444444", linewidth=1.0, label="measured (torque: applied)"),
        ]
    most = max((len(groups_of(panel.columns)[0]) for panel in panels), default=1)
    if most > 1:
        handles += [
            Line2D([], [], color=COLOURS[i % len(COLOURS)], label=str(i)) for i in range(most)
        ]
    if handles:
        axes.legend(
            handles=handles,
            loc="center right",
            bbox_to_anchor=(1.0, 0.75),
            ncols=len(handles),
            fontsize=8.5,
            frameon=False,
            handlelength=1.6,
            columnspacing=1.2,
            borderpad=0.0,
        )


def companions_of(
    session: LoggedSession, picture: Picture, bins: int = BINS
) -> Iterator[tuple[str, Picture]]:
    """Yields name and data of each companion that has numbers, in the time of `picture`."""
    for companion in session.companions:
        if companion.range("observation")[1] == 0:
            continue
        found = read(companion, bins=bins)
        shift = (found.begin - picture.begin) * 1e-9
        found.times = found.times + shift
        found.gaps = [(start + shift, end + shift) for start, end in found.gaps]
        if found.fields:
            yield companion.name.partition(".")[2], found


def troubles_of(log: Log, picture: Picture) -> dict[str, list[float]]:
    """Times of troubles, by their kind; warnings and errors in the log are included."""
    marks = dict(picture.marks)
    begin, end = picture.begin * 1e-9, picture.end * 1e-9
    events = [
        event.time - begin
        for event in log.events
        if event.level != "info" and begin <= event.time <= end
    ]
    if events:
        marks["event"] = events
    return marks


def draw(log: Log, session: LoggedSession, first: int | None, last: int | None) -> Figure:
    """Draws the whole picture."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    picture = read(session, first, last)
    if not picture.steps:
        raise InvalidArgument(f"there are no steps of '{session.name}' to draw")
    rows = [(picture, panel) for panel in panels_of(picture)]
    panels = [panel for _, panel in rows]
    if not session.is_companion:
        for name, found in companions_of(session, picture):
            rows += [
                (found, Panel(f"{name}: {panel.name}", panel.unit, panel.measured))
                for panel in panels_of(found)[:3]
            ]
    marks = troubles_of(log, picture)
    kinds = len(marks) + bool(picture.gaps)
    heights = [0.75] + [1.6] * len(rows)
    heights += [1.6] * picture.has_lateness + [0.35 + 0.22 * kinds] * (kinds > 0)

    style: Any = {
        "font.size": 8.5,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.edgecolor": "#888888",
        "axes.labelcolor": "#333333",
        "xtick.color": "#555555",
        "ytick.color": "#555555",
        "svg.fonttype": "path",
        "svg.hashsalt": "trifinger",
    }
    with mpl.rc_context(style):
        figure = Figure(figsize=(12.0, sum(heights) + 0.3 * len(heights)), layout="constrained")
        grid = figure.add_gridspec(len(heights), 12, height_ratios=heights)
        draw_head(figure.add_subplot(grid[0, :]), picture, panels)
        over_time: list[Axes] = []
        row = 1
        for source, panel in rows:
            width = 12 // len(groups_of(panel.columns))
            parts: list[Axes] = []
            for i in range(len(groups_of(panel.columns))):
                place = grid[row, i * width : (i + 1) * width]
                parts.append(figure.add_subplot(place, sharey=parts[0] if parts else None))
            draw_row(parts, source, panel)
            over_time += parts
            row += 1
        if picture.has_lateness:
            trace = figure.add_subplot(grid[row, :8])
            draw_lateness(trace, figure.add_subplot(grid[row, 8:]), picture)
            over_time.append(trace)
            row += 1
        if kinds:
            axes = figure.add_subplot(grid[row, :])
            draw_marks(axes, picture, marks)
            over_time.append(axes)
        margin = 0.01 * max(picture.duration, 1e-6)
        for axes in over_time:
            axes.set_xlim(-margin, picture.duration + margin)
        figure.align_ylabels()
        over_time[-1].set_xlabel("time since the first step [s]")
    return figure


def plot(
    log: Log,
    path: Path,
    robot: str = "",
    begin: float | None = None,
    end: float | None = None,
) -> None:
    """Draws the newest session of `robot` into a file: .png, .svg, .pdf, or a page as .html."""
    if path.suffix not in (".png", ".svg", ".pdf", ".html"):
        raise InvalidArgument(f"{path} must end in .png, .svg, .pdf or .html")
    session = log.session(robot)
    steps = step_range(session, begin, end)
    if path.suffix == ".html":
        from trifinger.plot_page import page

        path.write_text(page(log, session, *steps), encoding="utf-8")
        return
    extras.require("plot", "matplotlib")
    draw(log, session, *steps).savefig(path, dpi=120)


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = argparse.ArgumentParser(
        prog="trifinger log plot",
        description="Draw what happened in the newest session of a robot.",
        epilog="Example:\n  trifinger log plot run.mcap -o run.html",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("log", help="a file, or a folder: the newest recording in it")
    parser.add_argument(
        "-o", "--output", type=Path, help=".png, .svg, .pdf or .html; default: LOG with .png"
    )
    parser.add_argument(
        "--robot",
        metavar="NAME",
        default="",
        help="robot or companion; needed if a log has several robots",
    )
    parser.add_argument(
        "--from", dest="from_", type=float, metavar="SECONDS", help="begin, since the first step"
    )
    parser.add_argument("--to", type=float, metavar="SECONDS", help="end, since the first step")
    return parser.parse_args(words)


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger log plot`."""
    arguments = parse(words)
    path = arguments.output or Path(f"{Path(arguments.log).resolve().stem}.png")

    def work() -> None:
        plot(Log(arguments.log), path, arguments.robot, arguments.from_, arguments.to)
        print(f"{path} written.")

    return command.run(work)


if __name__ == "__main__":
    raise SystemExit(main())
