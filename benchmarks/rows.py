# SPDX-License-Identifier: BSD-3-Clause
"""Rows of the tables that `./run bench` makes, as text and in Markdown."""

import math
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Self


@dataclass(frozen=True)
class Row:
    """One row of the table; harness.hpp has the same in C++."""

    measure: str
    value: float  # median
    low: float  # smallest and largest value of the rounds
    high: float
    unit: str
    reach: str  # in words, as in "<= 80 ns"; empty for none
    holds: bool
    reference: str | None = None  # what was measured for comparison
    reference_value: float | None = None  # in the same unit
    ratio: float | None = None  # the measure divided by its reference
    remark: str = ""
    # What the process may use of the machine, as reported at its beginning.
    process: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, measure: str, samples: Sequence[float], unit: str, **others: Any) -> Self:
        """Makes a row with the median and the range of the samples."""
        return cls(measure, statistics.median(samples), min(samples), max(samples), unit, **others)

    def json(self) -> dict[str, Any]:
        """Returns the row as it is written to a file."""
        return asdict(self)

    def figure(self) -> str:
        """Returns the median with its range, as in "19.9 µs (16.3 to 40.3)"."""
        scale, unit = _scale(self.value, self.unit)
        text = f"{_number(self.value / scale)} {unit}".rstrip()
        if self.low == self.high:
            return text
        low, high = (_number(value / scale) for value in (self.low, self.high))
        return f"{text} ({low} to {high})"

    def beside(self) -> str:
        """Returns the reference with its value."""
        if self.reference is None:
            return ""
        if self.reference_value is None:
            return self.reference
        scale, unit = _scale(self.reference_value, self.unit)
        value = f"{_number(self.reference_value / scale)} {unit}".rstrip()
        return f"{self.reference}: {value}"

    def text(self) -> str:
        """Returns a few lines of text for a terminal."""
        lines = [f"{self.measure}: {self.figure()}"]
        if self.reference is not None:
            ratio = f"{_number(self.ratio)}x of " if self.ratio is not None else "beside "
            lines.append(f"  {ratio}{self.beside()}")
        if self.reach:
            lines.append(f"  reach {self.reach}: {'yes' if self.holds else 'NO'}")
        if self.remark:
            lines.append(f"  {self.remark}")
        return "\n".join(lines)


def markdown(rows: Iterable[Row]) -> str:
    """Returns a table of the rows, and a list of remarks on them."""
    rows = list(rows)
    lines = [
        "| measure | median (low to high) | reference beside it | ratio | reach | holds |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        ratio = _number(row.ratio) if row.ratio is not None else ""
        holds = ("yes" if row.holds else "**no**") if row.reach else ""
        cells = (row.measure, row.figure(), row.beside(), ratio, row.reach, holds)
        lines.append("|" + "|".join(f" {cell} " if cell else " " for cell in cells) + "|")
    remarks = [f"- {row.measure}: {row.remark}." for row in rows if row.remark]
    return "\n".join([*lines, *(["", *remarks] if remarks else [])])


def _scale(value: float, unit: str) -> tuple[float, str]:
    """Returns a divisor and the unit of a figure that is divided by it."""
    if unit.endswith("s/s"):  # steps, actions
        for scale, prefix in ((1e6, "M "), (1e3, "k ")):
            if abs(value) >= scale:
                return scale, prefix + unit
    return 1.0, "µs" if unit == "us" else unit


def _number(value: float) -> str:
    """Formats a number with three digits, or with all digits before the point."""
    if not math.isfinite(value) or value == 0.0:
        return f"{value:g}"
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}"
