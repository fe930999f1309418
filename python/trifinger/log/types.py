# SPDX-License-Identifier: BSD-3-Clause
"""Types of what a log holds besides sessions: gaps, events, damage and rows of steps."""

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
    """Steps that are missing in a log, from `first` to `last`, both included."""

    first: int
    last: int
    reason: str


@dataclass(frozen=True)
class Event:
    """A message for people that was recorded."""

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

    Series that were not asked for are None. For a companion, row i is its element number
    `time_index[i]`.
    """

    time_index: NDArray[np.int64]
    times: NDArray[np.datetime64]
    """When each row was measured, by the wall clock (UTC)."""
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
