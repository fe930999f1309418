# SPDX-License-Identifier: BSD-3-Clause
"""A plot as a picture, drawn by Matplotlib."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from trifinger._trifinger import LatenessHistogram, Log, LoggedSession, duration_text
from trifinger.log.plot import panels
from trifinger.log.plot.curves import Curves
from trifinger.log.plot.panels import BAD, COLOURS, MARKS, Contents, Panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import GridSpec

LETTERS = 160  # of a line of text across the picture
STYLE: Any = {
    "font.size": 8.5,
    "axes.formatter.useoffset": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#888888",
    "axes.labelcolor": "#333333",
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "svg.fonttype": "path",
    "svg.hashsalt": "trifinger",
}


def decorate(axes: Axes, curves: Curves) -> None:
    """Draws what all panels over time share: grid, gaps and the fault."""
    axes.grid(color="#E6E6E6", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.margins(x=0.01)
    for start, end in curves.gaps:
        axes.axvspan(start, end, color=MARKS["gap"], alpha=0.25, linewidth=0)
    fault = curves.session.fault
    if fault is not None and fault.needs_recovery and fault.time_index <= curves.last:
        axes.axvline(curves.duration, color=BAD, linewidth=1.4)


def draw_panel(axes: Axes, curves: Curves, panel: Panel, numbers: range) -> None:
    """Draws desired numbers as broad, pale lines, and applied or measured ones on top."""
    styles: dict[str, dict[str, Any]] = {
        "desired": {"linewidth": 3.6, "alpha": 0.3, "solid_capstyle": "butt"}
    }
    for kind, envelope in panel.drawn():
        style = styles.get(kind, {"linewidth": 1.0})
        if not envelope.has_numbers(slice(numbers.start, numbers.stop)):
            continue
        for i, number in enumerate(numbers):
            x, y = envelope.line(curves.times, number)
            axes.plot(x, y, color=COLOURS[i % len(COLOURS)], **style)
    decorate(axes, curves)


def entitle(axes: Axes, title: str, unit: str = "") -> None:
    """Sets the title above a panel and the unit of its numbers."""
    axes.set_title(title, loc="left", fontsize=9, fontweight="bold", color="#333333")
    if unit:
        axes.set_ylabel(f"[{unit}]")


def draw_row(parts: Sequence[Axes], curves: Curves, panel: Panel) -> None:
    """Draws all numbers of a field; many numbers are in several panels side by side."""
    groups = panel.groups
    names = panels.names_of_groups(curves, panel)
    for i, (axes, numbers, name) in enumerate(zip(parts, groups, names, strict=True)):
        draw_panel(axes, curves, panel, numbers)
        axes.set_ylim(*panel.limits())
        entitle(axes, panel.name + name, panel.unit if i == 0 else "")
        if i:
            axes.tick_params(labelleft=False)


def draw_lateness(
    trace: Axes, histogram: Axes, curves: Curves, lateness: LatenessHistogram
) -> None:
    """Draws the lateness of the steps over time and as a histogram."""
    x, y = curves.lateness.line(curves.times, 0)
    factor, unit = panels.time_unit(lateness.max())
    quantiles = panels.quantiles_of(lateness)
    trace.plot(x, y * factor, color=COLOURS[0], linewidth=0.8)
    trace.axhline(quantiles[1][0] * factor, color=COLOURS[1], linewidth=1.0, linestyle="--")
    trace.set_ylim(bottom=0)
    entitle(trace, "lateness", unit)
    decorate(trace, curves)

    counts, edges = panels.histogram_of(lateness)
    histogram.stairs(counts, edges * factor, fill=True, color=COLOURS[5])
    histogram.set_xscale("log")
    histogram.set_yscale("log")
    histogram.set_xlabel(f"lateness [{unit}]")
    entitle(histogram, "steps")
    for value, colour, label in quantiles:
        line: dict[str, Any] = {"color": colour, "linewidth": 1.1, "linestyle": "--"}
        histogram.axvline(value * factor, label=f"{label} {duration_text(value)}", **line)
    # Above the curves, beside the title.
    place: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.98), "borderpad": 0.0}
    histogram.legend(
        fontsize=7, ncols=3, handlelength=1.0, columnspacing=0.8, frameon=False, **place
    )
    histogram.grid(color="#E6E6E6", linewidth=0.6)
    histogram.set_axisbelow(True)


def draw_problems(axes: Axes, contents: Contents) -> None:
    """Draws a line for each kind of problem, with a stroke where it happened."""
    curves, kinds = contents.curves, contents.kinds[::-1]
    for row, kind in enumerate(kinds):
        if kind == "gap":
            bars = [(start, max(stop - start, 1e-9)) for start, stop in curves.gaps]
            axes.broken_barh(bars, (row - 0.35, 0.7), color=MARKS["gap"])
        else:
            times = contents.problems[kind]
            stroke: dict[str, Any] = {"markersize": 9, "markeredgewidth": 1.4, "color": MARKS[kind]}
            axes.plot(times, [row] * len(times), "|", **stroke)
    axes.set_yticks(range(len(kinds)), kinds)
    axes.set_ylim(-0.6, len(kinds) - 0.4)
    decorate(axes, curves)
    entitle(axes, "what went wrong")


def draw_head(axes: Axes, contents: Contents) -> None:
    """Draws name and facts on the left, and the legend on the right."""
    from matplotlib.lines import Line2D

    axes.axis("off")
    curves = contents.curves
    own = [panel for source, panel in contents.rows if source is curves]
    headline, facts = panels.title_of(curves)
    # Long texts do not change the widths of the panels.
    place: dict[str, Any] = {"transform": axes.transAxes, "va": "top", "in_layout": False}
    axes.text(0.0, 0.97, headline, fontsize=15, fontweight="bold", **place)
    fault = curves.session.fault
    is_bad = fault is not None and fault.needs_recovery
    lines = [(facts, "#555555"), (contents.left_out, "#555555")]
    lines += [(textwrap.shorten(curves.session.fault_text, 2 * LETTERS), BAD)] if is_bad else []
    lines = [(part, colour) for text, colour in lines for part in textwrap.wrap(text, LETTERS)]
    for row, (text, colour) in enumerate(lines):
        axes.text(0.0, 0.6 - 0.18 * row, text, fontsize=9, color=colour, **place)
    handles = []
    if any(panel.desired is not None and panel.desired.has_numbers() for panel in own):
        handles += [
            Line2D([], [], color="#777777", linewidth=3.6, alpha=0.4, label="desired"),
            Line2D([], [], color="#444444", linewidth=1.0, label="measured (torque: applied)"),
        ]
    most = max((len(panel.groups[0]) for panel in own), default=1)
    if most > 1:
        handles += [
            Line2D([], [], color=COLOURS[i % len(COLOURS)], label=str(i)) for i in range(most)
        ]
    if handles:
        axes.legend(
            handles=handles,
            loc="center right",
            bbox_to_anchor=(1.0, 0.9),
            ncols=len(handles),
            fontsize=8.5,
            frameon=False,
            handlelength=1.6,
            columnspacing=1.2,
            borderpad=0.0,
        )


def draw_rows(figure: Figure, grid: GridSpec, contents: Contents) -> list[Axes]:
    """Draws all rows below the head, and returns the panels over time."""
    curves = contents.curves
    over_time: list[Axes] = []
    row = 1
    for source, panel in contents.rows:
        width = 12 // len(panel.groups)
        parts: list[Axes] = []
        for begin in range(0, 12, width):
            place = grid[row, begin : begin + width]
            parts.append(figure.add_subplot(place, sharey=parts[0] if parts else None))
        draw_row(parts, source, panel)
        over_time += parts
        row += 1
    if curves.late is not None:
        over_time.append(figure.add_subplot(grid[row, :8]))
        draw_lateness(over_time[-1], figure.add_subplot(grid[row, 8:]), curves, curves.late)
        row += 1
    if contents.kinds:
        over_time.append(figure.add_subplot(grid[row, :]))
        draw_problems(over_time[-1], contents)
    return over_time


def draw(log: Log, session: LoggedSession, first: int | None, last: int | None) -> Figure:
    """Draws the whole picture."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    contents = panels.contents_of(log, session, first, last)
    curves, kinds = contents.curves, len(contents.kinds)
    heights = [1.15] + [1.6] * (len(contents.rows) + (curves.late is not None))
    heights += [0.35 + 0.22 * kinds] * (kinds > 0)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(12.0, sum(heights) + 0.3 * len(heights)), layout="constrained")
        grid = figure.add_gridspec(len(heights), 12, height_ratios=heights)
        draw_head(figure.add_subplot(grid[0, :]), contents)
        over_time = draw_rows(figure, grid, contents)
        margin = 0.01 * max(curves.duration, 1e-6)
        for axes in over_time:
            axes.set_xlim(-margin, curves.duration + margin)
        figure.align_ylabels()
        over_time[-1].set_xlabel("time since the first step [s]")
    return figure
