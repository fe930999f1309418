# SPDX-License-Identifier: BSD-3-Clause
"""The figure of a page, drawn by Plotly, without the numbers of its lines."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from trifinger._trifinger import LatenessHistogram
from trifinger.log.plot import panels
from trifinger.log.plot.curves import Curves, Envelope
from trifinger.log.plot.page_numbers import Numbers
from trifinger.log.plot.panels import BAD, COLOURS, MARKS, Contents, Panel

ROW = 190  # height of a row [pixel]
GAP = 62  # between rows [pixel]


class PlotlyFigure:
    """The figure of Plotly of a page, and the numbers of its lines."""

    def __init__(self, contents: Contents) -> None:
        import plotly.graph_objects as go
        from plotly.subplots import make_subplots

        self.go = go
        self.numbers = Numbers()
        self._shown: set[str] = set()
        curves, kinds = contents.curves, len(contents.kinds)
        rows = []  # widths and titles of the panels in each row, and its height
        for source, panel in contents.rows:
            widths = [12 // len(panel.groups)] * len(panel.groups)
            rows.append((widths, _titles(source, panel), ROW))
        if curves.late is not None:
            rows.append(([8, 4], ["lateness", f"steps by lateness: {curves.late}"], ROW))
        if kinds:
            rows.append(([12], ["what went wrong"], 40 + 22 * kinds))
        heights = [height for _, _, height in rows]
        self.height = sum(heights) + GAP * len(heights) + 40
        self.figure = make_subplots(
            rows=len(rows),
            cols=12,
            specs=[
                [cell for width in widths for cell in ({"colspan": width}, *[None] * (width - 1))]
                for widths, _, _ in rows
            ],
            subplot_titles=[title for _, titles, _ in rows for title in titles],
            row_heights=heights,
            vertical_spacing=GAP / self.height if len(rows) > 1 else 0,
            horizontal_spacing=0.012,
        )
        self._draw(contents)

    def to_html(self, script: str) -> str:
        """The figure as HTML, with a script that runs when it is there."""
        return str(
            self.figure.to_html(
                config={"displaylogo": False, "responsive": True, "plotlyServerURL": ""},
                include_plotlyjs=True,
                full_html=False,
                div_id="plot",
                post_script=script,
            )
        )

    def _draw(self, contents: Contents) -> None:
        curves = contents.curves
        over_time = []  # row and column of each panel over time
        row = 1
        for source, panel in contents.rows:
            self._add_panel(row, source, panel)
            over_time += [(row, 1 + i) for i in range(0, 12, 12 // len(panel.groups))]
            row += 1
        if curves.late is not None:
            self._add_lateness(row, curves, curves.late)
            over_time.append((row, 1))
            row += 1
        if contents.kinds:
            self._add_problems(row, contents)
            over_time.append((row, 1))
        self._decorate(curves, over_time)

    def _add_line(
        self, place: tuple[int, int], source: tuple[Curves, Envelope, int], **style: Any
    ) -> None:
        group = style["legendgroup"]
        style["showlegend"] = bool(group) and group not in self._shown
        self._shown.add(group)
        self.figure.add_trace(
            self.go.Scatter(x=[], y=[], mode="lines", **style), row=place[0], col=place[1]
        )
        axis = self.figure.get_subplot(*place).yaxis.plotly_name
        self.numbers.add(len(self.figure.data) - 1, axis, *source)

    def _add_panel(self, row: int, curves: Curves, panel: Panel) -> None:
        groups = panel.groups
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
                    self._add_line(place, (curves, envelope, number), hovertemplate=hover, **style)
            if i:
                first = self.figure.get_subplot(row, 1).yaxis.plotly_name.removeprefix("yaxis")
                style = {"matches": f"y{first}", "showticklabels": False}
                self.figure.update_yaxes(**style, row=row, col=place[1])
        columns = range(1, 13, 12 // len(groups))
        axes = [self.figure.get_subplot(row, column).yaxis.plotly_name for column in columns]
        self.numbers.shared.append((axes, panel.least))

    def _add_lateness(self, row: int, curves: Curves, lateness: LatenessHistogram) -> None:
        hover = "%{y:.3s}s<extra>lateness</extra>"
        self._add_line(
            (row, 1),
            (curves, curves.lateness, 0),
            name="lateness",
            legendgroup="",
            line={"color": COLOURS[0], "width": 1},
            hovertemplate=hover,
        )
        self.figure.update_yaxes(
            rangemode="tozero", tickformat="~s", ticksuffix="s", row=row, col=1
        )
        counts, edges = panels.histogram_of(lateness)
        factor, unit = panels.time_unit(lateness.max())
        self.figure.add_trace(
            self.go.Scatter(
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
        self.figure.update_xaxes(
            type="log", title_text=f"lateness [{unit}]", title_standoff=4, row=row, col=9
        )
        self.figure.update_yaxes(type="log", row=row, col=9)
        for value, colour, _ in panels.quantiles_of(lateness):
            if value > 0:
                line = {"color": colour, "width": 1.2, "dash": "dash"}
                self.figure.add_vline(value * factor, line=line, row=row, col=9)

    def _add_problems(self, row: int, contents: Contents) -> None:
        curves = contents.curves
        for kind in reversed(contents.kinds):
            times = contents.problems.get(kind, [])
            shape: dict[str, Any] = {"mode": "markers"}
            if kind == "gap":
                # None interrupts the line between two gaps.
                times = [time for start, end in curves.gaps for time in (start, end, None)]  # type: ignore[misc]
                shape = {"mode": "lines", "line": {"color": MARKS["gap"], "width": 10}}
            else:
                shape["marker"] = {
                    "symbol": "line-ns",
                    "size": 12,
                    "line": {"color": MARKS[kind], "width": 1.6},
                }
            self.figure.add_trace(
                self.go.Scatter(
                    x=times,
                    y=[kind] * len(times),
                    showlegend=False,
                    hovertemplate=f"%{{x:.6g}} s<extra>{kind}</extra>",
                    **shape,
                ),
                row=row,
                col=1,
            )
        self.figure.update_yaxes(type="category", fixedrange=True, row=row, col=1)

    def _decorate(self, curves: Curves, places: Sequence[tuple[int, int]]) -> None:
        """Gives all panels one axis of time, the gaps and the fault."""
        margin = 0.01 * max(curves.duration, 1e-6)
        for row, column in places:
            self.figure.update_xaxes(
                matches="x" if (row, column) != (1, 1) else None,
                range=[-margin, curves.duration + margin],
                row=row,
                col=column,
            )
            for start, end in curves.gaps:
                self.figure.add_vrect(
                    start,
                    end,
                    fillcolor=MARKS["gap"],
                    opacity=0.25,
                    line_width=0,
                    row=row,
                    col=column,
                )
            fault = curves.session.fault
            if fault is not None and fault.needs_recovery and fault.time_index <= curves.last:
                self.figure.add_vline(
                    curves.duration, line={"color": BAD, "width": 1.6}, row=row, col=column
                )
        for column in {column for row, column in places if row == places[-1][0]}:
            self.figure.update_xaxes(
                title_text="time since the first step [s]", row=places[-1][0], col=column
            )
        self.figure.update_xaxes(gridcolor="#E6E6E6", zeroline=False, linecolor="#888", ticks="")
        self.figure.update_yaxes(gridcolor="#E6E6E6", zeroline=False, linecolor="#888", ticks="")
        self.figure.update_annotations(font_size=12)
        self.figure.update_layout(
            height=self.height,
            template="none",
            margin={"l": 60, "r": 20, "t": 60, "b": 45},
            hovermode="closest",
            legend={"orientation": "h", "y": 1.0, "yref": "container", "yanchor": "top"},
            font={"size": 11, "family": "system-ui, sans-serif"},
            dragmode="zoom",
        )


def _titles(source: Curves, panel: Panel) -> list[str]:
    unit = f" [{panel.unit}]" if panel.unit else ""
    return [f"{panel.name}{name}{unit}" for name in panels.names_of_groups(source, panel)]
