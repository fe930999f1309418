# SPDX-License-Identifier: BSD-3-Clause
"""Which steps of a log are read, and how many at once."""

from __future__ import annotations

from trifinger._trifinger import LoggedSession

ROWS = 20_000  # rows that are in memory at once


def step_range(
    session: LoggedSession, begin: float | None, end: float | None
) -> tuple[int | None, int | None]:
    """The steps between two times [s], which count from the first step in the log."""
    if begin is None and end is None:
        return None, None
    return session.between(begin or 0.0, float("1e9") if end is None else end)
