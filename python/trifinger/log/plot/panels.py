# SPDX-License-Identifier: BSD-3-Clause
"""What a plot shows, on a page as in a picture: panels, names, marks and colours."""

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from trifinger._trifinger import LatenessHistogram, Log, LoggedSession
from trifinger.arrays import Array
from trifinger.errors import InvalidArgument
from trifinger.log.plot.curves import BINS, Curves, Envelope, companions_of, read

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
# How much an axis shows at least, so that a number which hardly changes looks so.
LEAST = {"rad": 0.02, "rad/s": 0.02, "m": 2e-3, "m/s": 2e-3, "Nm": 0.01, "N": 0.1, "": 0.05}
LEAST_SHARE = 1e-3  # and of numbers with other units: a share of the largest
MARGIN = 0.06  # above and below the numbers, as a share of what they span


@dataclass(frozen=True)
class Panel:
    """One row of a plot: a field as it was measured, desired and applied."""

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

    def numbers(self) -> Array:
        """The finite ones that are drawn; there is at least one."""
        ends = [end for _, one in self.drawn() for end in (one.low, one.high) if end is not None]
        return np.concatenate([end[np.isfinite(end)] for end in ends])

    def still(self) -> float | None:
        """The one number that all of the panel's are at every time; None if there are several."""
        numbers = self.numbers()
        return float(numbers[0]) if np.all(numbers == numbers[0]) else None

    def limits(self) -> tuple[float, float]:
        """The ends of its axis."""
        numbers = self.numbers()
        return padded(float(numbers.min()), float(numbers.max()), self.least)

    @property
    def least(self) -> float:
        """How much its axis shows at least."""
        return LEAST.get(self.unit, 0.0)

    @property
    def groups(self) -> list[range]:
        """Numbers that are drawn together: fingers of three joints, legs, or all."""
        columns = max(one.columns for one in (self.measured, self.desired, self.applied) if one)
        for size in (3, 4, 2):
            if columns > 4 and columns % size == 0 and columns // size <= 4:
                return [range(i, i + size) for i in range(0, columns, size)]
        return [range(columns)]


def padded(low: float, high: float, least: float) -> tuple[float, float]:
    """The ends of an axis with numbers from `low` to `high` that shows `least` or more."""
    least = max(least, LEAST_SHARE * max(abs(low), abs(high))) or 1.0
    missing = max(least - (high - low), 0.0) / 2 + MARGIN * (high - low)
    return low - missing, high + missing


@dataclass(frozen=True)
class Contents:
    """All that a plot shows."""

    curves: Curves
    rows: list[tuple[Curves, Panel]]  # companions come last, with curves of their own
    problems: dict[str, list[float]]  # times of each kind [s]
    still: dict[str, float]  # panels that are left out, and the number that they would show

    @property
    def left_out(self) -> str:
        """A sentence about what is not drawn because it never happened; or nothing."""
        parts = [f"{name} (always {number:g})" for name, number in self.still.items()]
        if self.curves.timing is not None and self.curves.late is None:
            parts.append("lateness (no step was late)")
        if not self.kinds:
            parts.append("problems (there were none)")
        return f"Left out: {', '.join(parts)}." if parts else ""

    @property
    def kinds(self) -> list[str]:
        """The kinds of problem that have a line, gaps last."""
        return [*self.problems, *(["gap"] if self.curves.gaps else [])]


def contents_of(
    log: Log, session: LoggedSession, first: int | None, last: int | None, bins: int = BINS
) -> Contents:
    """Reads what a plot of a session shows; raises InvalidArgument if there are no steps."""
    curves = read(session, first, last, bins)
    if not curves.steps:
        raise InvalidArgument(f"there are no steps of '{session.name}' to draw")
    rows = [(curves, panel) for panel in panels_of(curves)]
    if not session.is_companion:
        for name, found in companions_of(session, curves, bins):
            rows += [
                (found, Panel(f"{name}: {panel.name}", panel.unit, panel.measured))
                for panel in panels_of(found)[:3]
            ]
    still = {panel.name: number for _, panel in rows if (number := panel.still()) is not None}
    if len(still) == len(rows):
        still = {}  # what nothing happened to is drawn, rather than nothing
    rows = [row for row in rows if row[1].name not in still]
    return Contents(curves, rows, problems_of(log, curves), still)


def panels_of(curves: Curves) -> list[Panel]:
    """A panel per field; fields of observations and actions with one name share a panel."""
    units = curves.session.units
    panels = []
    names = list(dict.fromkeys(name for _, name in curves.fields))
    for name in names:
        shown = {
            series: curves.fields.get((series, name))
            for series in ("observation", "desired_action", "applied_action")
        }
        unit = next((units[series][name] for series, one in shown.items() if one is not None), "")
        panel = Panel(name, unit, *shown.values())
        if panel.measured is None and name.endswith(("_kp", "_kd")):
            continue  # gains, which are constant or set by the robot
        if any(envelope.has_numbers() for _, envelope in panel.drawn()):
            panels.append(panel)
    return panels


def names_of_groups(curves: Curves, panel: Panel) -> list[str]:
    """Names of a panel's parts, to append to its own, as in ", finger 0"; "" for a single part."""
    groups = panel.groups
    if len(groups) == 1:
        return [""]
    names = GROUPS.get(curves.session.type, ())
    if len(names) != len(groups):
        return [f", {numbers.start} to {numbers.stop - 1}" for numbers in groups]
    return [f", {name}" for name in names]


def title_of(curves: Curves) -> tuple[str, str]:
    """The headline, and a line with facts about the session."""
    session = curves.session
    begun = datetime.fromtimestamp(curves.begin * 1e-9, UTC)
    facts = [f"{begun:%Y-%m-%d %H:%M:%S} UTC", f"{curves.steps} steps"]
    if curves.duration > 0:
        facts.append(f"{curves.duration:.4g} s")
        rate = (curves.last - curves.first - 1) / curves.duration
        facts.append(f"{rate:.4g} Hz")
    if curves.timing is not None:
        facts.append(f"lateness {curves.timing.lateness()}")
    facts.extend(f"{count} {kind}" for kind, count in curves.counts.items())
    if session.gaps:
        missing = sum(gap.last - gap.first + 1 for gap in session.gaps)
        facts.append(f"{missing} steps missing")
    if session.fault is not None:
        facts.append(session.fault.code.replace("_", " "))
    return f"{session.name}  ·  {session.type}", "   ·   ".join(facts)


def time_unit(seconds: float) -> tuple[float, str]:
    """A factor and a unit in which a time of this size [s] has few digits."""
    for factor, unit in ((1e9, "ns"), (1e6, "µs"), (1e3, "ms")):
        if seconds * factor < 1000:
            return factor, unit
    return 1.0, "s"


def quantiles_of(lateness: LatenessHistogram) -> list[tuple[float, str, str]]:
    """Value, colour and name of each quantile that is marked."""
    return [
        (lateness.quantile(0.5), COLOURS[2], "p50"),
        (lateness.quantile(0.99), COLOURS[1], "p99"),
        (lateness.max(), BAD, "max"),
    ]


def histogram_of(lateness: LatenessHistogram) -> tuple[Array, Array]:
    """Steps per bin, from the first to the last bin that is not empty, and the bins' edges."""
    counts = np.array(lateness.counts())
    edges = np.array([*lateness.edges(), np.inf])
    shown = np.flatnonzero(counts)
    low, high = shown[0], shown[-1] + 1
    edges = np.minimum(edges[low : high + 1], max(lateness.max(), edges[low + 1]))
    # Times below the first edge cannot be drawn on a logarithmic axis.
    return counts[low:high], np.maximum(edges, 0.5 * lateness.edges()[1])


def problems_of(log: Log, curves: Curves) -> dict[str, list[float]]:
    """Times of problems, by their kind; warnings and errors in the log are included."""
    marks = dict(curves.marks)
    begin, end = curves.begin * 1e-9, curves.end * 1e-9
    events = [
        event.time - begin
        for event in log.events
        if event.level != "info" and begin <= event.time <= end
    ]
    if events:
        marks["event"] = events
    return marks
