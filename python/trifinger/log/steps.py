# SPDX-License-Identifier: BSD-3-Clause
"""Which steps of a log are read, and how many at once."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from trifinger._trifinger import LoggedSession
from trifinger.arrays import Array
from trifinger.errors import InvalidArgument
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


def steps_between(session: LoggedSession, begin: float | None, end: float | None) -> Array:
    """The steps in the log between two times [s], which count from the first one.

    Raises InvalidArgument if there are none.
    """
    times = (session.times - session.times[:1]).astype(np.int64) * 1e-9
    if not len(times):
        raise InvalidArgument(f"there are no steps of '{session.name}' to draw")
    begin, end = begin or 0.0, times[-1] if end is None else end
    if begin > times[-1] or end < 0.0:
        raise InvalidArgument(
            f"the log has {times[-1]:.3f} s of '{session.name}': --from and --to must be in them"
        )
    if not begin <= end:
        raise InvalidArgument(f"--from {begin:g} must be before --to {end:g}")
    steps: Array = session.time_index[(times >= begin) & (times <= end)]
    if not len(steps):
        raise InvalidArgument(f"the log has no step from {begin:g} s to {end:g} s: draw more of it")
    return steps


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
