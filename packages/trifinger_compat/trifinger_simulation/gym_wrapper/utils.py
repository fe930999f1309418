# SPDX-License-Identifier: BSD-3-Clause
"""Scaling numbers to -1 to 1 and back, distances, and waiting."""

import datetime
import time
from typing import Any

import numpy as np
from trifinger_compat.types import Numbers


def scale(x: Any, space: Any) -> Any:
    """Numbers of a space, so that its bounds become -1 and 1."""
    return 2.0 * (np.asarray(x) - space.low) / (space.high - space.low) - 1.0


def unscale(y: Any, space: Any) -> Any:
    """The inverse of scale()."""
    return space.low + (np.asarray(y) + 1.0) / 2.0 * (space.high - space.low)


def compute_distance(a: Numbers, b: Numbers) -> float:
    """The distance between two points."""
    return float(np.linalg.norm(np.subtract(a, b)))


def sleep_until(until: datetime.datetime, accuracy: float = 0.01) -> None:
    """Sleeps until a time of day, and looks every `accuracy` seconds whether it has come."""
    while until > datetime.datetime.now():
        time.sleep(accuracy)
