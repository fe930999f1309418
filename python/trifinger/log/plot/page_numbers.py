# SPDX-License-Identifier: BSD-3-Clause
"""The numbers of the lines of a page, packed."""

import base64
import gzip
import json
from dataclasses import dataclass, field

import numpy as np

from trifinger.arrays import Array
from trifinger.log.plot.curves import Curves, Envelope
from trifinger.log.plot.panels import LEAST_SHARE, MARGIN


@dataclass
class Numbers:
    """The numbers of all lines, one after the other, and the place of each line in them."""

    parts: list[bytes] = field(default_factory=list)
    size: int = 0
    lines: list[tuple[int, int, int, int, int]] = field(default_factory=list)
    places: dict[int, int] = field(default_factory=dict)  # places of the times of all curves
    axes: list[str] = field(default_factory=list)  # axis of each line, as in "yaxis3"
    # Groups of axes that share a range, and how much they show at least.
    shared: list[tuple[list[str], float]] = field(default_factory=list)

    def _add(self, values: Array, kind: str) -> int:
        place = self.size
        content = np.ascontiguousarray(values, kind).tobytes()
        content += bytes(-len(content) % 8)
        self.parts.append(content)
        self.size += len(content)
        return place

    def add(self, trace: int, axis: str, curves: Curves, envelope: Envelope, column: int) -> None:
        """Adds the numbers of a line, which are a column of an envelope."""
        if envelope.low is None or envelope.high is None:
            return
        if id(curves) not in self.places:
            self.places[id(curves)] = self._add(_ascending(curves.times), "<f8")
        low, high = envelope.low[:, column], envelope.high[:, column]
        low_place = high_place = self._add(low, "<f4")
        if not np.array_equal(low, high, equal_nan=True):
            high_place = self._add(high, "<f4")
        times = self.places[id(curves)]
        self.lines.append((trace, times, low_place, high_place, len(low)))
        self.axes.append(axis)

    def to_html(self) -> str:
        """Two HTML elements with the numbers and their index, which the script reads."""
        packed = base64.b64encode(gzip.compress(b"".join(self.parts), 6)).decode()
        index = {
            "lines": self.lines,
            "axes": self.axes,
            "shared": self.shared,
            "margin": MARGIN,
            "share": LEAST_SHARE,
        }
        return (
            f'<script type="application/json" id="index">{json.dumps(index)}</script>\n'
            f'<script type="text/plain" id="numbers">{packed}</script>'
        )


def _ascending(times: Array) -> Array:
    """The times; a stretch without steps gets a time between those of its neighbours."""
    known = np.flatnonzero(np.isfinite(times))
    return np.interp(np.arange(len(times)), known, times[known])
