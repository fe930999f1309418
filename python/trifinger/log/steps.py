# SPDX-License-Identifier: BSD-3-Clause
"""Which steps of a log are read, and how many at once."""

from collections.abc import Iterator, Mapping, Sequence

from trifinger._trifinger import LoggedSession
from trifinger.log.types import Steps
from trifinger.progress import shown

SeriesChoice = Mapping[str, Sequence[str] | None] | Sequence[str] | None
ROWS = 20_000  # rows that are in memory at once


def step_range(
    session: LoggedSession, begin: float | None, end: float | None
) -> tuple[int | None, int | None]:
    """The steps between two times [s], which count from the first step in the log."""
    if begin is None and end is None:
        return None, None
    return session.between(begin or 0.0, 1e9 if end is None else end)


def parts_of(
    session: LoggedSession,
    first: int | None = None,
    last: int | None = None,
    series: SeriesChoice = None,
) -> Iterator[Steps]:
    """Yields the steps in parts, and shows the progress on a terminal."""
    begin, end = session.range("observation")
    count = (end if last is None else last) - (begin if first is None else first)
    parts = session.chunks(ROWS, first, last, series)
    return shown(parts, f"reading '{session.name}'", -(-count // ROWS))
