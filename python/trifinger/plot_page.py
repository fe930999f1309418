# SPDX-License-Identifier: BSD-3-Clause
"""The page of `trifinger log plot -o run.html`: one file, in which one can zoom.

The page needs no server and no network: it contains Plotly and the numbers. For each line it holds
the smallest and the largest number of up to 100 000 stretches of time. Zooming draws the visible
part again from these numbers, as the smallest and the largest number of as many stretches as a
screen shows. So no peak is ever lost, and a log of hours does not make a larger page.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from trifinger import extras
from trifinger._trifinger import Log, LoggedSession
from trifinger.errors import InvalidArgument
from trifinger.plot import (
    BAD,
    COLOURS,
    MARKS,
    Envelope,
    Panel,
    Picture,
    companions_of,
    groups_of,
    histogram_of,
    names_of_groups,
    panels_of,
    read,
    time_unit,
    title_of,
    troubles_of,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[Any]

MOST_NUMBERS = 8_000_000  # limit for all lines of a page
MOST_STRETCHES = 100_000  # limit for a line
ROW = 190  # height of a row [pixel]
GAP = 62  # between rows [pixel]

# Fills the lines with as many numbers as a screen shows, at the start and after each zoom.
SCRIPT = """
const page = document.getElementById("{plot_id}");
const STRETCHES = 900;  // of a line on the screen

async function unpack(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

// The place of the first of some ascending times that is not before `time`.
function place(times, time) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < time) low = middle + 1; else high = middle;
  }
  return low;
}

// From the smallest to the largest number of each stretch between two times; null at gaps.
function seen(line, begin, end) {
  const first = Math.max(place(line.times, begin) - 1, 0);
  const last = Math.min(place(line.times, end) + 1, line.times.length);
  const size = Math.max(1, Math.ceil((last - first) / STRETCHES));
  const x = [], y = [];
  for (let i = first; i < last; i += size) {
    let low = Infinity, high = -Infinity;
    for (let j = i; j < Math.min(i + size, last); ++j) {
      if (line.low[j] < low) low = line.low[j];
      if (line.high[j] > high) high = line.high[j];
    }
    if (low > high) { x.push(line.times[i]); y.push(null); continue; }
    x.push(line.times[i]); y.push(low);
    if (high > low) { x.push(line.times[i]); y.push(high); }
  }
  return [x, y];
}

async function main() {
  const index = JSON.parse(document.getElementById("index").textContent);
  const bytes = await unpack(document.getElementById("numbers").textContent.trim());
  const lines = index.lines.map(([trace, times, low, high, count]) => ({
    trace: trace,
    times: new Float64Array(bytes, times, count),
    low: new Float32Array(bytes, low, count),
    high: new Float32Array(bytes, high, count),
  }));
  const chosen = new Set();  // axes whose range is the reader's
  const show = (begin, end) => {
    const found = lines.map((line) => seen(line, begin, end));
    const change = {x: found.map((line) => line[0]), y: found.map((line) => line[1])};
    // Plotly does not fit axes that share their range to numbers that come later.
    const ranges = {};
    for (const axes of index.shared.filter((axes) => !axes.some((axis) => chosen.has(axis)))) {
      const numbers = found.filter((_, i) => axes.includes(index.axes[i]))
        .flatMap((line) => line[1]).filter((number) => number !== null);
      const low = numbers.reduce((a, b) => Math.min(a, b), Infinity);
      const high = numbers.reduce((a, b) => Math.max(a, b), -Infinity);
      const margin = high > low ? 0.06 * (high - low) : Math.max(Math.abs(high), 1e-3);
      if (high < low) continue;
      for (const axis of axes) ranges[axis + ".range"] = [low - margin, high + margin];
    }
    return Plotly.update(page, change, ranges, lines.map((line) => line.trace));
  };
  await show(-Infinity, Infinity);
  page.setAttribute("data-is-drawn", "true");
  page.on("plotly_relayout", (change) => {
    const keys = Object.keys(change);
    for (const key of keys) {
      const [axis, what] = key.split(".");
      if (axis.startsWith("yaxis") && what === "autorange") chosen.delete(axis);
      if (axis.startsWith("yaxis") && what === "range[0]") chosen.add(axis);
    }
    if (!keys.some((key) => /^[xy]axis/.test(key))) return;
    const axis = page._fullLayout.xaxis;
    if (axis.autorange || keys.some((key) => /^xaxis.*autorange$/.test(key))) {
      show(-Infinity, Infinity);
    } else {
      show(axis.range[0], axis.range[1]);
    }
  });
}

main().catch((error) => {
  document.getElementById("trouble").textContent =
    "The numbers of this page could not be unpacked: " + error + ". A newer browser can.";
});
"""

STYLE = """
body { font-family: system-ui, sans-serif; color: #222; margin: 1.5em auto; max-width: 1500px; padding: 0 1em; }
h1 { font-size: 1.4em; margin: 0 0 0.2em; }
p { margin: 0.2em 0; color: #555; font-size: 0.9em; }
p.bad { color: #C0202A; }
table { border-collapse: collapse; font-size: 0.9em; margin: 1em 0; }
th { text-align: left; vertical-align: top; color: #666; font-weight: normal; }
th, td { padding: 0.15em 1.2em 0.15em 0; }
pre { background: #f6f6f6; padding: 0.8em; overflow: auto; max-height: 40em; font-size: 0.85em; }
"""  # noqa: E501


@dataclass
class Numbers:
    """The numbers of all lines, one after the other, and the place of each line in them."""

    parts: list[bytes] = field(default_factory=list)
    size: int = 0
    lines: list[tuple[int, int, int, int, int]] = field(default_factory=list)
    places: dict[int, int] = field(default_factory=dict)  # places of the times of each picture
    axes: list[str] = field(default_factory=list)  # axis of each line, as in "yaxis3"
    shared: list[list[str]] = field(default_factory=list)  # groups of axes that share a range

    def _add(self, values: Array, kind: str) -> int:
        place = self.size
        content = np.ascontiguousarray(values, kind).tobytes()
        content += bytes(-len(content) % 8)
        self.parts.append(content)
        self.size += len(content)
        return place

    def add(self, trace: int, axis: str, picture: Picture, envelope: Envelope, column: int) -> None:
        """Adds the numbers of a line, which are a column of an envelope."""
        if envelope.low is None or envelope.high is None:
            return
        if id(picture) not in self.places:
            self.places[id(picture)] = self._add(_ascending(picture.times), "<f8")
        low, high = envelope.low[:, column], envelope.high[:, column]
        low_place = high_place = self._add(low, "<f4")
        if not np.array_equal(low, high, equal_nan=True):
            high_place = self._add(high, "<f4")
        times = self.places[id(picture)]
        self.lines.append((trace, times, low_place, high_place, len(low)))
        self.axes.append(axis)

    def to_html(self) -> str:
        """Two HTML elements with the numbers and their index, which the script reads."""
        packed = base64.b64encode(gzip.compress(b"".join(self.parts), 6)).decode()
        index = {"lines": self.lines, "axes": self.axes, "shared": self.shared}
        return (
            f'<script type="application/json" id="index">{json.dumps(index)}</script>\n'
            f'<script type="text/plain" id="numbers">{packed}</script>'
        )


def _ascending(times: Array) -> Array:
    """The times; a stretch without steps gets a time between those of its neighbours."""
    known = np.flatnonzero(np.isfinite(times))
    return np.interp(np.arange(len(times)), known, times[known])


def stretches_of(session: LoggedSession) -> int:
    """How many stretches of each line a page holds at most."""
    numbers = 0
    for dtype in (session.observation_dtype, session.action_dtype, session.applied_action_dtype):
        numbers += dtype.itemsize // 8
    return min(MOST_STRETCHES, max(2000, MOST_NUMBERS // (2 * max(numbers, 1))))


def _needed() -> tuple[Any, Any]:
    extras.require("plot", "plotly")
    import plotly.graph_objects as go
    from plotly.subplots import make_subplots

    return go, make_subplots


class _Figure:
    """A figure of Plotly and the numbers of its lines."""

    def __init__(self, rows: Sequence[tuple[Picture, Panel]], picture: Picture, kinds: int) -> None:
        self.go, make_subplots = _needed()
        self.numbers = Numbers()
        self._shown: set[str] = set()
        has_lateness = picture.has_lateness
        widths = [len(groups_of(panel.columns)) for _, panel in rows]
        specs: list[list[dict[str, int] | None]] = []
        titles: list[str] = []
        for (source, panel), width in zip(rows, widths, strict=True):
            span = 12 // width
            specs.append([{"colspan": span} if i % span == 0 else None for i in range(12)])
            titles += _titles(source, panel)
        heights = [ROW] * len(rows)
        if has_lateness:
            specs.append([{"colspan": 8}, *[None] * 7, {"colspan": 4}, *[None] * 3])
            assert picture.timing is not None  # noqa: S101
            titles += ["lateness", f"steps by lateness: {picture.timing.lateness()}"]
            heights.append(ROW)
        if kinds:
            specs.append([{"colspan": 12}, *[None] * 11])
            titles.append("what went wrong")
            heights.append(40 + 22 * kinds)
        height = sum(heights) + GAP * len(heights) + 40
        self.figure = make_subplots(
            rows=len(specs),
            cols=12,
            specs=specs,
            subplot_titles=titles,
            row_heights=heights,
            vertical_spacing=GAP / height if len(specs) > 1 else 0,
            horizontal_spacing=0.012,
        )
        self.height = height

    def add_line(
        self, place: tuple[int, int], source: tuple[Picture, Envelope, int], **style: Any
    ) -> None:
        group = style["legendgroup"]
        style["showlegend"] = bool(group) and group not in self._shown
        self._shown.add(group)
        self.figure.add_trace(
            self.go.Scatter(x=[], y=[], mode="lines", **style), row=place[0], col=place[1]
        )
        axis = self.figure.get_subplot(*place).yaxis.plotly_name
        self.numbers.add(len(self.figure.data) - 1, axis, *source)


def _titles(source: Picture, panel: Panel) -> list[str]:
    unit = f" [{panel.unit}]" if panel.unit else ""
    return [f"{panel.name}{name}{unit}" for name in names_of_groups(source, panel)]


def _add_panel(figure: _Figure, row: int, picture: Picture, panel: Panel) -> None:
    groups = groups_of(panel.columns)
    for i, group in enumerate(groups):
        place = (row, 1 + i * (12 // len(groups)))
        for kind, envelope in panel.drawn():
            if not envelope.has_numbers(slice(group.start, group.stop)):
                continue
            for j, number in enumerate(group):
                colour = COLOURS[j % len(COLOURS)]
                hover = f"%{{y:.5g}} {panel.unit}<extra>{kind} {number}</extra>"
                if kind == "desired":
                    style: dict[str, Any] = {
                        "name": "desired",
                        "legendgroup": "desired",
                        "line": {"color": colour, "width": 4},
                        "opacity": 0.3,
                    }
                else:
                    name = str(j) if len(groups[0]) > 1 else "measured"
                    style = {
                        "name": name,
                        "legendgroup": name,
                        "line": {"color": colour, "width": 1.2},
                    }
                figure.add_line(place, (picture, envelope, number), hovertemplate=hover, **style)
        if i:
            first = figure.figure.get_subplot(row, 1).yaxis.plotly_name.removeprefix("yaxis")
            style = {"matches": f"y{first}", "showticklabels": False}
            figure.figure.update_yaxes(**style, row=row, col=place[1])
    if len(groups) > 1:
        columns = range(1, 13, 12 // len(groups))
        figure.numbers.shared.append(
            [figure.figure.get_subplot(row, column).yaxis.plotly_name for column in columns]
        )


def _add_lateness(figure: _Figure, row: int, picture: Picture) -> None:
    assert picture.timing is not None  # noqa: S101
    lateness = picture.timing.lateness()
    hover = "%{y:.3s}s<extra>lateness</extra>"
    figure.add_line(
        (row, 1),
        (picture, picture.lateness, 0),
        name="lateness",
        legendgroup="",
        line={"color": COLOURS[0], "width": 1},
        hovertemplate=hover,
    )
    figure.figure.update_yaxes(rangemode="tozero", tickformat="~s", ticksuffix="s", row=row, col=1)
    counts, edges = histogram_of(lateness)
    factor, unit = time_unit(lateness.max())
    figure.figure.add_trace(
        figure.go.Scatter(
            x=np.repeat(edges, 2)[1:-1] * factor,
            y=np.repeat(np.maximum(counts, 0.5), 2),
            mode="lines",
            line={"color": COLOURS[5], "width": 1},
            fill="tozeroy",
            showlegend=False,
            hovertemplate=f"%{{x:.3g}} {unit}: %{{y:.0f}} steps<extra></extra>",
        ),
        row=row,
        col=9,
    )
    figure.figure.update_xaxes(
        type="log", title_text=f"lateness [{unit}]", title_standoff=4, row=row, col=9
    )
    figure.figure.update_yaxes(type="log", row=row, col=9)
    for value, colour in (
        (lateness.quantile(0.5), COLOURS[2]),
        (lateness.quantile(0.99), COLOURS[1]),
        (lateness.max(), BAD),
    ):
        if value > 0:
            line = {"color": colour, "width": 1.2, "dash": "dash"}
            figure.figure.add_vline(value * factor, line=line, row=row, col=9)


def _add_marks(figure: _Figure, row: int, picture: Picture, marks: dict[str, list[float]]) -> None:
    kinds = [*marks, *(["gap"] if picture.gaps else [])]
    for kind in reversed(kinds):
        times = marks.get(kind, [])
        shape: dict[str, Any] = {"mode": "markers"}
        if kind == "gap":
            times = [time for start, end in picture.gaps for time in (start, end, None)]  # type: ignore[misc]
            shape = {"mode": "lines", "line": {"color": MARKS["gap"], "width": 10}}
        else:
            shape["marker"] = {
                "symbol": "line-ns",
                "size": 12,
                "line": {"color": MARKS[kind], "width": 1.6},
            }
        figure.figure.add_trace(
            figure.go.Scatter(
                x=times,
                y=[kind] * len(times),
                showlegend=False,
                hovertemplate=f"%{{x:.6g}} s<extra>{kind}</extra>",
                **shape,
            ),
            row=row,
            col=1,
        )
    figure.figure.update_yaxes(type="category", fixedrange=True, row=row, col=1)


def _decorate(figure: _Figure, picture: Picture, places: Sequence[tuple[int, int]]) -> None:
    """Gives all panels one axis of time, the gaps and the fault."""
    margin = 0.01 * max(picture.duration, 1e-6)
    for row, column in places:
        figure.figure.update_xaxes(
            matches="x" if (row, column) != (1, 1) else None,
            range=[-margin, picture.duration + margin],
            row=row,
            col=column,
        )
        for start, end in picture.gaps:
            figure.figure.add_vrect(
                start, end, fillcolor=MARKS["gap"], opacity=0.25, line_width=0, row=row, col=column
            )
        fault = picture.session.fault
        if fault is not None and fault.needs_recovery and fault.time_index <= picture.last:
            figure.figure.add_vline(
                picture.duration, line={"color": BAD, "width": 1.6}, row=row, col=column
            )
    for column in {column for row, column in places if row == places[-1][0]}:
        figure.figure.update_xaxes(
            title_text="time since the first step [s]", row=places[-1][0], col=column
        )
    figure.figure.update_xaxes(gridcolor="#E6E6E6", zeroline=False, linecolor="#888", ticks="")
    figure.figure.update_yaxes(gridcolor="#E6E6E6", zeroline=False, linecolor="#888", ticks="")
    figure.figure.update_annotations(font_size=12)
    figure.figure.update_layout(
        height=figure.height,
        template="none",
        margin={"l": 60, "r": 20, "t": 60, "b": 45},
        hovermode="closest",
        legend={"orientation": "h", "y": 1.0, "yref": "container", "yanchor": "top"},
        font={"size": 11, "family": "system-ui, sans-serif"},
        dragmode="zoom",
    )


def facts_of(session: LoggedSession, picture: Picture) -> str:
    """The headline and the texts above the figure, as HTML."""
    headline, facts = title_of(picture)
    per_stretch = -(-(picture.last - picture.first) // picture.bins)
    if picture.bins < picture.last - picture.first:
        held = (
            f"For each line the page holds the smallest and the largest number of {picture.bins} "
            f"stretches of up to {per_stretch} steps, and draws those of as many as a screen shows."
        )
    else:
        held = (
            "The page holds every step; where there are more than a screen shows, the smallest and "
            "the largest number of each stretch are drawn."
        )
    fault = session.fault
    bad = ""
    if fault is not None and fault.needs_recovery:
        bad = f'<p class="bad">{html.escape(session.fault_text)}</p>'
    return (
        f"<h1>{html.escape(headline)}</h1>\n<p>{html.escape(facts)}</p>\n{bad}\n"
        f"<p>Drag to zoom, double-click to see all; a click on a name in the legend hides its "
        f'lines. {held}</p>\n<p class="bad" id="trouble"></p>'
    )


def tables_of(log: Log, session: LoggedSession) -> str:
    """Tables of what the log holds besides numbers: origin, gaps, damage, events, documents."""
    rows = [
        ("files", ", ".join(path.name for path in log.files)),
        ("recorded by", f"trifinger {log.origin.get('trifinger_version', 'unknown')}"),
        ("host", session.host),
        ("end", session.fault_text or "went on when the recording ended"),
        *(("gap", f"steps {gap.first} to {gap.last}: {gap.reason}") for gap in session.gaps),
        *(("damage", damage.reason) for damage in log.damage),
        *((event.level, f"{event.source}: {event.text}") for event in log.events),
    ]
    table = "\n".join(
        f"<tr><th>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>"
        for name, value in rows
    )
    documents = "\n".join(
        f"<details><summary>{html.escape(name)}</summary><pre>{html.escape(value)}</pre></details>"
        for name, value in session.documents.items()
    )
    return f"<table>\n{table}\n</table>\n{documents}"


def page(log: Log, session: LoggedSession, first: int | None, last: int | None) -> str:
    """The whole page, as HTML."""
    _needed()
    bins = stretches_of(session)
    picture = read(session, first, last, bins)
    if not picture.steps:
        raise InvalidArgument(f"there are no steps of '{session.name}' to draw")
    rows = [(picture, panel) for panel in panels_of(picture)]
    if not session.is_companion:
        for name, found in companions_of(session, picture, bins):
            rows += [
                (found, Panel(f"{name}: {panel.name}", panel.unit, panel.measured))
                for panel in panels_of(found)[:3]
            ]
    marks = troubles_of(log, picture)
    kinds = len(marks) + bool(picture.gaps)
    figure = _Figure(rows, picture, kinds)
    places = []
    for row, (source, panel) in enumerate(rows, 1):
        _add_panel(figure, row, source, panel)
        width = 12 // len(groups_of(panel.columns))
        places += [(row, 1 + i * width) for i in range(len(groups_of(panel.columns)))]
    row = len(rows) + 1
    if picture.has_lateness:
        _add_lateness(figure, row, picture)
        places.append((row, 1))
        row += 1
    if kinds:
        _add_marks(figure, row, picture, marks)
        places.append((row, 1))
    _decorate(figure, picture, places)
    plot = figure.figure.to_html(
        config={"displaylogo": False, "responsive": True, "plotlyServerURL": ""},
        include_plotlyjs=True,
        full_html=False,
        div_id="plot",
        post_script=SCRIPT,
    )
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{html.escape(session.name)}: {html.escape(log.files[0].name)}</title>
<style>{STYLE}</style>
</head>
<body>
{facts_of(session, picture)}
{figure.numbers.to_html()}
{plot}
{tables_of(log, session)}
</body>
</html>
"""
