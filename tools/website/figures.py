# SPDX-License-Identifier: BSD-3-Clause
"""The page of figures: what `./run bench` has measured, results of experiments, and other systems.

Plots are drawn from benchmarks/figures.json, which `./run bench --write` writes, from
benchmarks/others.json, the published or measured figures of other systems, and from the tables of
docs/results.
"""

import json
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rows import Row, markdown
from tracked_files import ROOT

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MEASURED = ROOT / "benchmarks/figures.json"
OTHERS = ROOT / "benchmarks/others.json"
RESULTS = ROOT / "docs/results"

GREY, GOOD, BAD = "#7f7f7f", "#3d8fd1", "#d1603d"  # to be read on white and on black
FACTOR = re.compile(r"([<>])= ([\d.]+)x")
COUNT = re.compile(r"(\d+) of (\d+)")


PAGE = """# Figures

{machine} `./run bench --write` has measured our times and rates, `./run evaluate` the
experiments. Machines are shared and noisy, so a figure is best read as a ratio to a reference of
the same run.

## Beside a reference

A dot is a measure divided by its reference: the same work with nothing around it, in the same run.
A triangle is the limit that we set ourselves; the dot shall be on the side to which it points.
[The list of measures](/benchmarks.md) says what the references are, and why a row is out of reach.

![Measures as multiples of their references](/figures/ratios.svg)

## Beside other systems

![How many times better than other systems](/figures/others.svg)

{comparison}

The figures of the original stack come from another machine with two processors, so only large
differences mean something. We built it with optimisation; its default build has none.

## Experiments

Trials in simulation, with start, mass, friction, delay and noise drawn anew for each seed.
The page of each result has all trials.

{experiments}

## All measures

{table}
"""


@dataclass(frozen=True)
class Other:
    """A figure of another system, and the name of our measure of the same thing."""

    what: str
    system: str
    value: float
    unit: str
    measure: str
    source: str

    def times_better(self, ours: Row) -> float:
        """How many times better our figure is; rates are better if they are large."""
        ratio = float(ours.value / self.value)
        return ratio if self.unit.endswith("/s") else 1 / ratio

    def figure(self) -> str:
        """Returns the figure as our tables have it."""
        return Row.of(self.what, [self.value], self.unit, reach="", holds=True).figure()


@dataclass(frozen=True)
class Success:
    """How often an experiment succeeded."""

    what: str
    done: int
    tried: int


def measured() -> tuple[str, list[Row]]:
    """Returns when and where figures were measured, and the rows."""
    content = json.loads(MEASURED.read_text())
    return content["machine"], [Row(**row) for row in content["rows"]]


def others() -> list[Other]:
    """Returns the figures of other systems."""
    return [Other(**entry) for entry in json.loads(OTHERS.read_text())]


def successes(text: str) -> Iterator[Success]:
    """Returns the rows of the first table of a page of results that say how many succeeded."""
    columns: list[str] = []
    for line in text.splitlines():
        if not line.startswith("|"):
            if columns:
                return
            continue
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if not columns:
            columns = cells
            continue
        column = next((name for name in ("as built", "succeed", "solved") if name in columns), None)
        count = COUNT.match(cells[columns.index(column)]) if column else None
        if count:
            yield Success(cells[0].replace("`", ""), int(count[1]), int(count[2]))


def experiments() -> dict[str, list[Success]]:
    """Returns how often experiments succeeded, by the names of their pages of results."""
    found = {path.stem: [*successes(path.read_text())] for path in sorted(RESULTS.glob("*.md"))}
    return {page: rows for page, rows in found.items() if rows}


def draw(path: Path, height: float, paint: Callable[["Axes"], None]) -> None:
    """Writes a plot that fits light and dark pages; the same plot has the same bytes."""
    import matplotlib as mpl

    style: Any = {
        "svg.hashsalt": path.stem,
        "svg.fonttype": "none",
        "font.family": "sans-serif",
        "font.size": 10,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "legend.frameon": False,
        "legend.labelcolor": GREY,
        **dict.fromkeys(("axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color"), GREY),
    }
    from matplotlib.figure import Figure

    with mpl.rc_context(style):
        figure = Figure(figsize=(9, height), layout="constrained")
        paint(figure.subplots())
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, transparent=True, metadata={"Date": None})


def label(axes: "Axes", names: Sequence[str]) -> None:
    """Names the rows of a plot, from top to bottom."""
    axes.set_yticks(range(len(names)), [shortened(name) for name in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)


def write_beside(axes: "Axes", end: float, place: int, text: str) -> None:
    """Writes a figure to the right of its bar."""
    axes.annotate(text, (end, place), (5, 0), textcoords="offset points", va="center", color=GREY)


def shortened(name: str, length: int = 62) -> str:
    """Returns a name that leaves room for its plot."""
    return name if len(name) <= length else name[: length - 1].rstrip(" ,") + "…"


def draw_ratios(rows: Iterable[Row], path: Path) -> None:
    """Draws each measure as a multiple of its reference, and what is asked for."""
    shown = [(row, row.ratio) for row in rows if row.ratio is not None and FACTOR.search(row.reach)]

    def paint(axes: "Axes") -> None:
        for place, (row, ratio) in enumerate(shown):
            ((side, bound),) = FACTOR.findall(row.reach)
            colour = GOOD if row.holds else BAD
            axes.plot([1, ratio], [place, place], color=colour, linewidth=2, alpha=0.5)
            axes.plot(float(bound), place, side, color=GREY, fillstyle="none")
            axes.plot(ratio, place, "o", color=colour)
        axes.axvline(1, color=GREY, linewidth=0.8)
        axes.set_xscale("log")
        ticks = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50)
        low, high = axes.get_xlim()
        axes.set_xticks(ticks, [f"{tick:g}x" for tick in ticks])
        axes.set_xticks([], minor=True)
        axes.set_xlim(low, high)
        label(axes, [row.measure for row, _ in shown])

    draw(path, 0.6 + 0.28 * len(shown), paint)


def draw_others(pairs: Sequence[tuple[Other, Row]], path: Path) -> None:
    """Draws how many times better we are than another system."""

    def paint(axes: "Axes") -> None:
        for place, (other, ours) in enumerate(pairs):
            times = other.times_better(ours)
            axes.plot([1, times], [place, place], color=GOOD if times >= 1 else BAD, linewidth=7)
            write_beside(axes, max(times, 1), place, f"{times:.3g}x")
        axes.axvline(1, color=GREY, linewidth=0.8)
        axes.set_xscale("log")
        axes.set_xticks([1, 10, 100], ["as good", "10 times better", "100 times better"])
        axes.set_xticks([], minor=True)
        label(axes, [other.what for other, _ in pairs])
        axes.margins(x=0.12)

    draw(path, 0.6 + 0.32 * len(pairs), paint)


def draw_successes(shown: Sequence[Success], path: Path) -> None:
    """Draws the share of trials that succeeded."""

    def paint(axes: "Axes") -> None:
        for place, success in enumerate(shown):
            share = success.done / success.tried
            axes.barh(place, share, color=GOOD, height=0.6)
            write_beside(axes, share, place, f"{success.done} of {success.tried}")
        axes.set_xlim(0, 1.12)
        axes.set_xticks([0, 0.5, 1], ["0", "half", "all"])
        label(axes, [success.what for success in shown])

    draw(path, 0.5 + 0.28 * len(shown), paint)


def page(folder: Path) -> str:
    """Draws the plots into `folder`, and returns the page that shows them."""
    machine, rows = measured()
    by_name = {row.measure: row for row in rows}
    pairs = [(other, by_name[other.measure]) for other in others()]
    tried = experiments()
    draw_ratios(rows, folder / "ratios.svg")
    draw_others(pairs, folder / "others.svg")
    for name, rows_of_page in tried.items():
        draw_successes(rows_of_page, folder / f"{name}.svg")
    comparison = [
        "| | other system | its figure | here | times better | where from |",
        "|---|---|---|---|---|---|",
        *(
            f"| {other.what} | {other.system} | {other.figure()} | {ours.figure()} "
            f"| {other.times_better(ours):.3g} | {other.source} |"
            for other, ours in pairs
        ),
    ]
    plots = [
        f"**[{name}](/results/{name}.md)**\n\n![{name}: how often it succeeds](/figures/{name}.svg)"
        for name in tried
    ]
    return PAGE.format(
        machine=machine,
        comparison="\n".join(comparison),
        experiments="\n\n".join(plots),
        table=markdown(rows),
    )
