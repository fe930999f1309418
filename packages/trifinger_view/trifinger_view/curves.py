# SPDX-License-Identifier: BSD-3-Clause
"""The last seconds of a session as curves: few points, in which no peak is lost."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from trifinger._trifinger import Status, lateness_of

from trifinger_view.frame import values_of

if TYPE_CHECKING:
    from trifinger.arrays import Array

SECONDS = 10.0  # that a plot shows
POINTS_PER_SECOND = 30
MAX_COLUMNS = 12  # of a field of a robot's own
MAX_FIELDS = 6

TORQUE = "torque [Nm]"
TRACKING = "desired - measured position [rad]"
TIP_FORCE = "tip force [N]"
LATENESS = "lateness [ms]"
EVENTS = "steps late, repeated or rejected"
_COUNTED = (EVENTS,)  # sums in a point; all others show the number that is farthest from zero
_EVENT_FLAGS = (
    Status.SCHEDULER_LATE
    | Status.DRIVER_LATE
    | Status.ACTION_REPEATED
    | Status.ACTION_REJECTED
    | Status.ACAUSAL
)


def series_of(
    observations: Any, desired: Any, statuses: Any, period: float, is_real_time: bool
) -> dict[str, Array]:
    """Curves of consecutive steps by title, float[steps, lines].

    `observations`, `desired` and `statuses` are rows of the same steps, or None. Robots with joints
    have torques, tracking errors and tip forces; others have the fields of their own.
    """
    series: dict[str, Array] = {}
    names = observations.dtype.names or ()
    if "position" in names and "torque" in names:
        series[TORQUE] = _rows(observations["torque"])
        position = _rows(observations["position"])
        if desired is not None and "position" in (desired.dtype.names or ()):
            series[TRACKING] = np.nan_to_num(_rows(desired["position"]) - position)
        if "tip_force" in names:
            series[TIP_FORCE] = _rows(observations["tip_force"])
    else:
        fields = list(values_of(observations[0]))[:MAX_FIELDS]
        for name in fields:
            column = observations
            for part in name.split("."):
                column = column[part]
            series[name] = np.nan_to_num(_rows(column)[:, :MAX_COLUMNS])
    if statuses is not None and is_real_time:
        series[LATENESS] = 1e3 * _rows(lateness_of(statuses, period))
        series[EVENTS] = _rows((statuses["flags"] & _EVENT_FLAGS.value) != 0)
    return series


class Window:
    """Curves of the last seconds, thinned out."""

    def __init__(self, seconds: float = SECONDS, rate: float = POINTS_PER_SECOND) -> None:
        """`rate` is the number of points per second."""
        self._seconds, self._rate = seconds, rate
        self._points: Array = np.array([], np.int64)  # numbers of the stretches of time
        self._series: dict[str, Array] = {}

    @property
    def times(self) -> Array:
        """Times of the points since step 0 [s], float64[points]."""
        return self._points / self._rate

    @property
    def series(self) -> dict[str, Array]:
        """Curves by title, float64[points, lines]."""
        return self._series

    def add(self, times: Array, series: dict[str, Array]) -> None:
        """Adds steps that follow those before; `times` are since step 0 [s].

        A point is a stretch of time. It has the number that is farthest from zero, or the count.
        """
        if not len(times):
            return
        points = np.floor(np.asarray(times) * self._rate + 1e-6).astype(np.int64)
        if len(self._points) and points[0] < self._points[-1]:
            self._points, self._series = self._points[:0], {}
        if set(series) != set(self._series):
            self._points, self._series = np.array([], np.int64), {}
        found, starts = np.unique(points, return_index=True)
        is_begun = bool(len(self._points)) and found[0] == self._points[-1]
        joined = np.concatenate([self._points, found[int(is_begun) :]])
        is_kept = joined > joined[-1] - self._seconds * self._rate
        for title, rows in series.items():
            is_counted = title in _COUNTED
            thin = _summed(rows, starts) if is_counted else _farthest(rows, starts)
            before = self._series.get(title, np.empty((0, rows.shape[1])))
            if is_begun:
                both = np.stack([before[-1], thin[0]])
                thin[0] = both.sum(axis=0) if is_counted else _farthest(both, np.array([0]))[0]
                before = before[:-1]
            self._series[title] = np.concatenate([before, thin])[is_kept]
        self._points = joined[is_kept]


def _rows(values: Any) -> Array:
    array = np.asarray(values, float)
    return array.reshape(len(array), -1)


def _summed(rows: Array, starts: Array) -> Array:
    return np.asarray(np.add.reduceat(rows, starts, axis=0))


def _farthest(rows: Array, starts: Array) -> Array:
    """The number of each column that is farthest from zero, in each stretch."""
    high = np.maximum.reduceat(rows, starts, axis=0)
    low = np.minimum.reduceat(rows, starts, axis=0)
    return np.where(high >= -low, high, low)
