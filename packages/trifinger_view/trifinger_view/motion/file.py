# SPDX-License-Identifier: BSD-3-Clause
"""The file of a motion: comment lines with a header in JSON, then a table of numbers.

What lies at a path may be anything: nothing here waits for a FIFO or believes a size.
"""

from __future__ import annotations

import json
import os
import stat
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from trifinger.errors import Error, InvalidArgument
from trifinger.whole_file import whole_file

if TYPE_CHECKING:
    from numpy.typing import NDArray

FIRST_LINE = "# trifinger motion 1"
MAX_FILE = 1 << 29  # bytes
MAX_HEADER = 1 << 20  # bytes
MAX_JOINTS = 256
MAX_TIPS = 64
MAX_ROWS = 2_000_000  # half an hour at 1 kHz
MAX_NUMBERS = 40_000_000


class MotionFileError(Error, ValueError):
    """The file does not have the format that docs/motions.md describes."""


class Contents(NamedTuple):
    """What is in the file of a motion."""

    robot: str
    joints: tuple[str, ...]
    created: str
    history: tuple[str, ...]
    configuration: str
    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    tips: NDArray[np.float64] | None


def write(path: str | os.PathLike[str], contents: Contents, overwrite: bool) -> None:
    """Writes the file in one step; raises InvalidArgument if there is one and not `overwrite`."""
    target = Path(path)
    if not overwrite and os.path.lexists(target):
        raise _exists(target)
    rows = len(contents.times)
    tips = 0 if contents.tips is None else contents.tips.shape[1]
    header = {
        "robot": contents.robot,
        "created": contents.created,
        "joints": list(contents.joints),
        "tips": tips,
        "rows": rows,
        "history": list(contents.history),
        "configuration": contents.configuration.splitlines(),
    }
    text = [FIRST_LINE]
    text += [f"# {line}" for line in json.dumps(header, indent=1).splitlines()]
    table = [contents.times[:, None], contents.positions]
    if contents.tips is not None:
        table.append(contents.tips.reshape(rows, -1))
    text.append(",".join(columns(contents.joints, tips)))
    # repr() gives the fewest digits from which the same number is read again.
    text += [",".join(map(repr, row)) for row in np.hstack(table).tolist()]
    try:
        with whole_file(target, replace=overwrite) as part:
            part.write_text("\n".join(text) + "\n", encoding="utf-8")
    except FileExistsError:
        raise _exists(target) from None


def columns(joints: Sequence[str], tips: int) -> list[str]:
    """The names of the columns of the table."""
    return ["time", *joints, *(f"tip_{i}.{axis}" for i in range(tips) for axis in "xyz")]


def read(path: str | os.PathLike[str]) -> Contents:
    """Reads the file; raises MotionFileError with what is wrong, OSError if it cannot be opened."""
    name = os.fspath(path)
    try:
        text = _bytes_of(name).decode("utf-8")
    except UnicodeDecodeError as error:
        raise MotionFileError(f"{name} is no motion: {error}") from None
    try:
        return _parse(text)
    except MotionFileError as error:
        raise MotionFileError(f"{name} {error}") from None


def _exists(path: Path) -> InvalidArgument:
    return InvalidArgument(f"{path} exists; --force, or overwrite=True, replaces it")


def _bytes_of(name: str) -> bytes:
    # O_NONBLOCK: opening a FIFO does not wait for a writer.
    descriptor = os.open(name, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY)
    with open(descriptor, "rb") as file:  # noqa: PTH123
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise MotionFileError(f"{name} is no regular file, so it is no motion")
        if status.st_size > MAX_FILE:
            raise MotionFileError(
                f"{name} has {status.st_size} bytes; a motion has at most {MAX_FILE}"
            )
        content = file.read(MAX_FILE + 1)
    if len(content) > MAX_FILE:
        raise MotionFileError(f"{name} grows while it is read; a motion has at most {MAX_FILE}")
    return content


def _parse(text: str) -> Contents:
    if text.partition("\n")[0] != FIRST_LINE:
        raise MotionFileError(f"is no motion of this version: it does not begin '{FIRST_LINE}'")
    position = len(FIRST_LINE) + 1
    lines = []
    while text.startswith("#", position):
        end = text.find("\n", position)
        if end < 0 or end > MAX_HEADER:
            raise MotionFileError(f"has no header that ends within {MAX_HEADER} bytes")
        lines.append(text[position + 1 : end])
        position = end + 1
    header = _header("\n".join(lines))
    names, _, table = text[position:].partition("\n")
    expected = columns(header.joints, header.tips)
    if names != ",".join(expected):
        raise MotionFileError(
            f"has the columns {names[:200]!r}, expected are {','.join(expected)[:200]!r}"
        )
    if not table.endswith("\n") or table.count("\n") != header.rows:
        raise MotionFileError(
            f"has {table.count(chr(10))} whole rows, its header says {header.rows}; "
            "it is incomplete or was changed by hand"
        )
    numbers = _numbers(table, header.rows, len(expected))
    joints = len(header.joints)
    tips = numbers[:, 1 + joints :].reshape(header.rows, header.tips, 3) if header.tips else None
    times = numbers[:, 0]
    if not (times[0] == 0 and np.all(np.diff(times) > 0)):
        bad = 0 if times[0] != 0 else int(np.argmin(np.diff(times) > 0)) + 1
        raise MotionFileError(
            f"has the time {times[bad]} s in row {bad + 1}; times begin with 0 and grow"
        )
    return Contents(
        header.robot,
        header.joints,
        header.created,
        header.history,
        header.configuration,
        times.copy(),
        numbers[:, 1 : 1 + joints].copy(),
        tips if tips is None else tips.copy(),
    )


class _Header(NamedTuple):
    robot: str
    created: str
    joints: tuple[str, ...]
    tips: int
    rows: int
    history: tuple[str, ...]
    configuration: str


def _header(text: str) -> _Header:
    try:
        values = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise MotionFileError(f"has a header that is no JSON: {str(error)[:200]}") from None
    if not isinstance(values, dict) or set(values) != set(_Header._fields):
        raise MotionFileError(f"has a header without exactly the keys {', '.join(_Header._fields)}")
    for key in ("robot", "created"):
        if not isinstance(values[key], str):
            raise MotionFileError(f"has a header in which {key} is no text")
    for key in ("joints", "history", "configuration"):
        if not (isinstance(values[key], list) and all(isinstance(one, str) for one in values[key])):
            raise MotionFileError(f"has a header in which {key} is no list of texts")
    for key, least, most in (("tips", 0, MAX_TIPS), ("rows", 2, MAX_ROWS)):
        if type(values[key]) is not int or not least <= values[key] <= most:
            raise MotionFileError(f"has a header in which {key} is not from {least} to {most}")
    try:
        check_names(values["robot"], values["joints"])
    except InvalidArgument as error:
        raise MotionFileError(f"has a wrong header: {error}") from None
    if values["rows"] * (1 + len(values["joints"]) + 3 * values["tips"]) > MAX_NUMBERS:
        raise MotionFileError(f"has more than {MAX_NUMBERS} numbers")
    return _Header(
        values["robot"],
        values["created"],
        tuple(values["joints"]),
        values["tips"],
        values["rows"],
        tuple(values["history"]),
        "".join(line + "\n" for line in values["configuration"]),
    )


def check_names(robot: str, joints: Sequence[str]) -> None:
    """Raises InvalidArgument for names that would not fit into the columns of a file."""
    if not 1 <= len(joints) <= MAX_JOINTS:
        raise InvalidArgument(f"a motion has 1 to {MAX_JOINTS} joints, not {len(joints)}")
    if len(set(joints)) != len(joints):
        raise InvalidArgument("two joints of the motion have the same name")
    for name in (robot, *joints):
        if not (0 < len(name) <= 200 and name.isprintable() and name == name.strip()) or any(
            sign in name for sign in ',"#'
        ):
            raise InvalidArgument(
                f"{name[:200]!r} is no name; names are printable, without comma, quote and '#'"
            )


def _numbers(table: str, rows: int, width: int) -> NDArray[np.float64]:
    lines = table.splitlines()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            numbers = np.loadtxt(lines, np.float64, comments=None, delimiter=",", ndmin=2)
    except (ValueError, OverflowError, UserWarning) as error:
        text = str(error).splitlines()[0][:200]
        raise MotionFileError(f"has a table that is not all numbers: {text}") from None
    if numbers.shape != (rows, width):
        raise MotionFileError(f"has a table of {numbers.shape} numbers, expected {(rows, width)}")
    if not np.isfinite(numbers).all():
        row = int(np.argmin(np.isfinite(numbers).all(axis=1)))
        raise MotionFileError(f"has a number in row {row + 1} that is not finite")
    return numbers
