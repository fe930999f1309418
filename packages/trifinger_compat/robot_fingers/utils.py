# SPDX-License-Identifier: BSD-3-Clause
"""Small helps for programs that run long."""

import time
from collections.abc import Iterator

import numpy as np
from trifinger_compat.types import Array, Numbers


class TimePrinter:
    """Prints the time now and then."""

    def __init__(self, interval_s: float = 3600.0) -> None:
        self.interval_s = interval_s
        self._next = time.time() + interval_s

    def update(self) -> None:
        """Prints the time if the interval has passed."""
        now = time.time()
        if now >= self._next:
            self._next = now + self.interval_s
            print(time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(now)), flush=True)


def min_jerk_trajectory(start: Numbers, end: Numbers, num_steps: int) -> Iterator[Array]:
    """The way from `start` to before `end` with the least jerk, in `num_steps` steps.

    Raises ValueError if there is no step.
    """
    if num_steps < 1:
        raise ValueError(f"num_steps is {num_steps}, must be at least 1")
    begin, final = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    shares = (i / num_steps for i in range(num_steps))
    return (begin + (final - begin) * (10 * s**3 - 15 * s**4 + 6 * s**5) for s in shares)
