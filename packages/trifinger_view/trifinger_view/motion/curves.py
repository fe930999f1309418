# SPDX-License-Identifier: BSD-3-Clause
"""Curves through samples: slopes, values in between, and a filter without delay."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def slopes(times: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivative of each column of `values` by time, exact for parabolas; shape of `values`."""
    if len(times) == 2:
        return np.repeat(np.diff(values, axis=0) / np.diff(times)[0], 2, axis=0)
    result: NDArray[np.float64] = np.asarray(np.gradient(values, times, axis=0, edge_order=2))
    return result


def hermite(
    times: NDArray[np.float64], values: NDArray[np.float64], at: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The cubic Hermite spline through the samples, at any times; constant outside of them.

    `values` has a row for each of `times`; the result has a row for each time in `at`.
    """
    at = np.clip(np.atleast_1d(at), times[0], times[-1])
    left = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    step = (times[left + 1] - times[left])[:, None]
    s = (at - times[left])[:, None] / step
    slope = slopes(times, values)
    result: NDArray[np.float64] = (
        (1 + 2 * s) * (1 - s) ** 2 * values[left]
        + s * (1 - s) ** 2 * step * slope[left]
        + s**2 * (3 - 2 * s) * values[left + 1]
        + s**2 * (s - 1) * step * slope[left + 1]
    )
    return result


def low_pass(values: NDArray[np.float64], period: float, cutoff: float) -> NDArray[np.float64]:
    """Columns of `values`, one row every `period` [s], without what vibrates faster than `cutoff`.

    The filter is a Gaussian with the gain exp(-ln(2)/2 (f/cutoff)^2) at the frequency f. Beyond
    its ends the signal is continued by turning it around the end point. So the end points stay, and
    a straight line stays as it is.
    """
    count = len(values)
    sigma = math.sqrt(math.log(2)) / (2 * math.pi * cutoff) / period  # in samples
    reach = math.ceil(8 * sigma)
    # A period longer than twice the samples repeats the turned signal; its drift is taken out.
    drift = np.linspace(values[0], values[-1], count)
    rest = values - drift
    whole = np.concatenate([rest, -rest[-2:0:-1]])  # odd about both ends, and periodic
    if reach == 0 or len(whole) < 2:
        return values.copy()
    frequency = np.fft.rfftfreq(len(whole))  # in cycles for each sample
    gain = np.exp(-2 * (math.pi * sigma * frequency) ** 2)
    smooth = np.fft.irfft(np.fft.rfft(whole, axis=0) * gain[:, None], len(whole), axis=0)
    result: NDArray[np.float64] = smooth[:count] + drift
    result[0], result[-1] = values[0], values[-1]
    return result
