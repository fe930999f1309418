# SPDX-License-Identifier: BSD-3-Clause
"""Goals as patterns of text: `X` is a die, `.` is free, and `#` is beside the table."""

from collections.abc import Iterable
from pathlib import Path
from typing import IO

from trifinger.whole_file import whole_file

from trifinger_simulation.tasks import rearrange_dice as _task
from trifinger_simulation.tasks.rearrange_dice import (
    N_CELLS_PER_ROW as N_CELLS_PER_ROW,
    NUM_DICE as NUM_DICE,
)

CHAR_OUTSIDE, CHAR_EMPTY, CHAR_FILLED = "#", ".", "X"


def create_empty_pattern() -> str:
    """The pattern without dice: a row for each cell in x, a column for each in y."""
    cells = range(_task.N_CELLS_PER_ROW)
    rows = (
        "".join(CHAR_EMPTY if _task._is_cell_valid((x, y)) else CHAR_OUTSIDE for y in cells)
        for x in cells
    )
    return "\n".join(rows)


def create_pattern_template_file(filename: str | Path) -> None:
    """Writes the pattern without dice to a file, with a note on what may come after it."""
    note = "\nWhat comes after the empty line is not read.\n"
    with whole_file(filename) as part:
        part.write_text(f"{create_empty_pattern()}\n{note}")


def parse_pattern(goal_pattern: str | Iterable[str]) -> list[tuple[float, float, float]]:
    """The goal of a pattern, which ends at an empty line; raises RuntimeError where it is wrong."""
    goal = []
    lines = goal_pattern.splitlines() if isinstance(goal_pattern, str) else goal_pattern
    rows = []
    for line in lines:
        if not line.strip():
            break
        rows.append(line.strip())
    count = _task.N_CELLS_PER_ROW
    if len(rows) != count or any(len(row) != count for row in rows):
        raise RuntimeError(f"a pattern must have {count} rows of {count} characters")
    for x, row in enumerate(rows):
        for y, character in enumerate(row):
            expected = CHAR_EMPTY + CHAR_FILLED if _task._is_cell_valid((x, y)) else CHAR_OUTSIDE
            if character not in expected:
                raise RuntimeError(
                    f"row {x}, column {y} of the pattern is '{character}', must be one of "
                    f"'{expected}'"
                )
            if character == CHAR_FILLED:
                goal.append(_task._get_cell_center_position((x, y)))
    return goal


def parse_pattern_file(f: IO[str] | str | Path) -> list[tuple[float, float, float]]:
    """The goal of an open file with a pattern, or of the file with this name."""
    return parse_pattern(Path(f).read_text() if isinstance(f, str | Path) else f.read())
