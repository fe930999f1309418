# SPDX-License-Identifier: BSD-3-Clause
"""Shows the progress of a command in one line on a terminal, which is drawn again and again."""

import sys
import time
from collections.abc import Iterable, Iterator
from typing import Self, TypeVar

T = TypeVar("T")
EVERY = 0.1  # shortest time between two drawings [s]


class Progress:
    """A line on standard error if that is a terminal; the end of the block removes it."""

    def __init__(self, what: str) -> None:
        """`what` names the work: with "film.mp4" the line is "film.mp4   45 %  12 s"."""
        self._what = what
        self._is_shown = sys.stderr.isatty()
        self._began = time.monotonic()
        self._drawn = self._began - EVERY

    def __enter__(self) -> Self:
        self.update(0.0)
        return self

    def __exit__(self, *_: object) -> None:
        self.clear()

    def clear(self) -> None:
        """Removes the line until the next update, so that something else can be printed."""
        if self._is_shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)

    def update(self, share: float) -> None:
        """Shows the share of the work that is done, from 0 to 1."""
        now = time.monotonic()
        if not self._is_shown or now < self._drawn + EVERY:
            return
        self._drawn = now
        line = f"  {self._what}  {100 * share:3.0f} %  {now - self._began:.0f} s "
        print(f"\r\033[K{line}", end="", file=sys.stderr, flush=True)


def shown(items: Iterable[T], what: str, total: int) -> Iterator[T]:
    """Yields the items and shows which share of `total` has been taken."""
    with Progress(what) as progress:
        for number, item in enumerate(items):
            progress.update(number / max(total, 1))
            yield item
