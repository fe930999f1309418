# SPDX-License-Identifier: BSD-3-Clause
"""Shows the progress of a command in one line on a terminal, which is drawn again and again."""

import shutil
import sys
import time
from collections.abc import Iterable, Iterator
from typing import Self, TypeVar

from trifinger.text import printable

T = TypeVar("T")
EVERY = 0.1  # shortest time between two drawings [s]


class Line:
    """A line on standard error if that is a terminal; the end of the block removes it."""

    def __init__(self) -> None:
        self._is_shown = sys.stderr.isatty()
        self._drawn = -EVERY

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.clear()

    def clear(self) -> None:
        """Removes the line until it is shown again, so that something else can be printed."""
        if self._is_shown:
            sys.stderr.write("\r\033[K")
            sys.stderr.flush()
            self._drawn = -EVERY

    def show(self, text: str) -> None:
        """Shows the text instead of the one before, if that was shown for EVERY."""
        now = time.monotonic()
        if not self._is_shown or now < self._drawn + EVERY:
            return
        self._drawn = now
        columns = shutil.get_terminal_size().columns
        sys.stderr.write(f"\r\033[K{printable(text)[: columns - 1]}")
        sys.stderr.flush()


class Progress:
    """A line on standard error if that is a terminal; the end of the block removes it."""

    def __init__(self, what: str) -> None:
        """`what` names the work: with "film.mp4" the line is "film.mp4   45 %  12 s"."""
        self._what = what
        self._line = Line()
        self._began = time.monotonic()

    def __enter__(self) -> Self:
        self.update(0.0)
        return self

    def __exit__(self, *_: object) -> None:
        self.clear()

    def clear(self) -> None:
        """Removes the line until the next update, so that something else can be printed."""
        self._line.clear()

    def update(self, share: float) -> None:
        """Shows the share of the work that is done, from 0 to 1."""
        elapsed = time.monotonic() - self._began
        self._line.show(f"  {self._what}  {100 * share:3.0f} %  {elapsed:.0f} s ")


def shown(items: Iterable[T], what: str, total: int) -> Iterator[T]:
    """Yields the items and shows which share of `total` has been taken."""
    with Progress(what) as progress:
        for number, item in enumerate(items):
            progress.update(number / max(total, 1))
            yield item
