# SPDX-License-Identifier: BSD-3-Clause
"""The numbers of a session that are drawn.

Fields, shapes and units come from the log. If there are more steps than a picture can show, the
smallest and the largest number of each stretch of steps are kept, so that no peak is lost. The log
may be larger than memory.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from trifinger._trifinger import LatenessHistogram, LoggedSession, Status, TimingRecord, lateness_of
from trifinger.arrays import Array
from trifinger.element_text import fields_of
from trifinger.log.steps import parts_of
from trifinger.log.types import Steps

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
        if self.low is None or self.high is None:
            raise ValueError("there are no numbers to draw")
        low, high = self.low[:, column], self.high[:, column]
        if np.array_equal(low, high, equal_nan=True):
            return times, low
        return np.repeat(times, 2), np.column_stack([low, high]).ravel()


@dataclass
class Curves:
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

    @property
    def late(self) -> LatenessHistogram | None:
        """How late the steps were; None if the log does not say, or if no step was late."""
        lateness = None if self.timing is None else self.timing.lateness()
        return None if lateness is None or lateness.max() == 0 else lateness


def add_fields(curves: Curves, steps: Steps, rows: Array, starts: Array) -> None:
    """Adds the numbers of some steps; those of bin `rows[i]` begin at `starts[i]`."""
    for series, elements in (
        ("observation", steps.observations),
        ("desired_action", steps.desired_actions),
        ("applied_action", steps.applied_actions),
    ):
        if elements is not None:
            for name, values in fields_of(elements):
                if values.dtype.kind == "f":  # neither counters nor stamps nor bits
                    envelope = curves.fields.setdefault((series, name), Envelope(curves.bins))
                    envelope.add(rows, starts, values)


def mark_steps(curves: Curves, statuses: Array, seconds: Array) -> None:
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
        curves.counts[kind] = curves.counts.get(kind, 0) + count
        marks = curves.marks.setdefault(kind, [])
        found = seconds[is_so]
        marks.extend(found[:: max(1, len(found) // 200)].tolist())


def read(
    session: LoggedSession, first: int | None = None, last: int | None = None, bins: int = BINS
) -> Curves:
    """Reads what is drawn: goes through all steps once, and through their statuses twice."""
    begin, end = session.range("observation" if session.is_companion else "applied_action")
    begin = begin if first is None else max(begin, first)
    timing = session.timing(begin, last)
    end = end if last is None else min(end, last)
    curves = Curves(session, max(1, min(bins, end - begin)), begin, end, timing=timing)
    curves.times = np.full(curves.bins, np.nan)
    curves.lateness = Envelope(curves.bins)
    before = begin
    before_seconds = 0.0
    for steps in parts_of(session, begin, end):
        times = steps.times.astype(np.int64)
        if not curves.steps:
            curves.begin = int(times[0])
        curves.steps += len(steps)
        curves.end = int(times[-1])
        seconds = (times - curves.begin) * 1e-9
        rows, starts = np.unique(
            (steps.time_index - begin) * curves.bins // (end - begin), return_index=True
        )
        curves.times[rows] = np.fmin(curves.times[rows], seconds[starts])
        # Where indices jump, steps are missing: each jump is drawn as a gap.
        for jump in np.flatnonzero(np.diff(steps.time_index, prepend=before - 1) > 1):
            start = seconds[jump - 1] if jump else before_seconds
            curves.gaps.append((float(start), float(seconds[jump])))
        before, before_seconds = int(steps.time_index[-1]) + 1, float(seconds[-1])
        add_fields(curves, steps, rows, starts)
        statuses = steps.statuses
        if statuses is not None and {"flags", "skipped_ticks"} <= set(statuses.dtype.names or ()):
            mark_steps(curves, statuses, seconds)
        if statuses is not None and curves.timing is not None:
            curves.lateness.add(rows, starts, lateness_of(statuses, session.period))
    return curves


def companions_of(
    session: LoggedSession, curves: Curves, bins: int = BINS
) -> Iterator[tuple[str, Curves]]:
    """Yields name and data of each companion that has numbers, in the time of `curves`."""
    for companion in session.companions:
        if companion.range("observation")[1] == 0:
            continue
        found = read(companion, bins=bins)
        shift = (found.begin - curves.begin) * 1e-9
        found.times = found.times + shift
        found.gaps = [(start + shift, end + shift) for start, end in found.gaps]
        if found.fields:
            yield companion.name.partition(".")[2], found
