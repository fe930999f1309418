# SPDX-License-Identifier: BSD-3-Clause
"""What is found in a log besides sessions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from trifinger._trifinger import Action, AppliedAction, Observation, StatusElement


@dataclass(frozen=True)
class Gap:
    """Steps that are not in the log, both ends included."""

    first: int
    last: int
    reason: str


@dataclass(frozen=True)
class Event:
    """Something that was told to people."""

    time: float
    """Seconds since 1970."""
    level: str
    """"info", "warning" or "error"."""
    source: str
    text: str


@dataclass(frozen=True)
class Damage:
    """Bytes of a file that could not be used."""

    file: Path
    offset: int
    size: int
    reason: str
    """A sentence."""


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Rows of several series: row i of each belongs to step `time_index[i]`.

    Series that were not asked for are None. Of a companion, the rows are elements, which
    `time_index` counts.
    """

    time_index: NDArray[np.int64]
    times: NDArray[np.datetime64]
    """When they were measured, by the clock on the wall (UTC)."""
    desired_actions: NDArray[Action] | None = None
    applied_actions: NDArray[AppliedAction] | None = None
    observations: NDArray[Observation] | None = None
    statuses: NDArray[StatusElement] | None = None

    def __len__(self) -> int:
        return len(self.time_index)

    def __repr__(self) -> str:
        series = {
            "desired_actions": self.desired_actions,
            "applied_actions": self.applied_actions,
            "observations": self.observations,
            "statuses": self.statuses,
        }
        there = [name for name, elements in series.items() if elements is not None]
        steps = f"{self.time_index[0]} to {self.time_index[-1]}" if len(self) else "none"
        return f"<Steps {steps}: {', '.join(there) or 'no series'}>"
