# SPDX-License-Identifier: BSD-3-Clause
"""Sessions of logs as tables for other programs, and `trifinger log export`.

A table has a row per step and a column per number, such as "observation.position[0]". Numbers are
written in full, so that reading them gives the same numbers. CSV needs only NumPy, Parquet needs
PyArrow.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import importlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trifinger import command, extras, program
from trifinger._trifinger import Log, LoggedSession
from trifinger.errors import InvalidArgument
from trifinger.log_types import Steps
from trifinger.progress import shown

if TYPE_CHECKING:
    import pandas
    from numpy.typing import NDArray

SeriesChoice = Mapping[str, Sequence[str] | None] | Sequence[str] | None
ROWS = 20_000  # rows that are in memory at once

SERIES = {
    "observation": "observations",
    "applied_action": "applied_actions",
    "desired_action": "desired_actions",
    "status": "statuses",
}


def _needed(module: str) -> Any:
    extras.require("export", module.partition(".")[0])
    return importlib.import_module(module)


def numbers_of(elements: NDArray[Any], prefix: str) -> Iterator[tuple[str, str, NDArray[Any]]]:
    """Yields field, name and values of each number of elements, such as "a.b" and "a.b[0]"."""
    dtype = elements.dtype
    if dtype.names is None:
        for index in np.ndindex(elements.shape[1:]):
            suffix = "".join(f"[{i}]" for i in index)
            yield prefix, prefix + suffix, elements[(slice(None), *index)]
        return
    for name in dtype.names:
        yield from numbers_of(elements[name], f"{prefix}.{name}" if prefix else name)


def columns_of(session: LoggedSession, steps: Steps) -> Iterator[tuple[str, str, NDArray[Any]]]:
    """Yields name, unit and values of each column of the table."""
    yield "element" if session.is_companion else "time_index", "", steps.time_index
    yield "time", "", steps.times
    units = session.units
    for series, attribute in SERIES.items():
        elements = getattr(steps, attribute)
        if elements is None:
            continue
        # The elements of a companion are its observations; it has no other series.
        prefix = "" if session.is_companion else series
        for field, name, values in numbers_of(elements, prefix):
            unit = units[series].get(field.removeprefix(f"{series}."), "")
            yield name, unit, values


def to_pandas(
    session: LoggedSession,
    first: int | None = None,
    last: int | None = None,
    series: SeriesChoice = None,
) -> pandas.DataFrame:
    """The session as a pandas DataFrame."""
    steps = session.read(first, last, series)
    return _needed("pandas").DataFrame(
        {name: values for name, _, values in columns_of(session, steps)}
    )


def parts_of(
    session: LoggedSession, first: int | None, last: int | None, series: SeriesChoice
) -> Iterator[Steps]:
    """Yields the steps in parts; if there are none, one part that has the columns but no rows."""
    is_empty = True
    for steps in session.chunks(ROWS, first, last, series):
        is_empty = False
        yield steps
    if is_empty:
        yield session.read(0, 0, series)


def _texts(values: NDArray[Any]) -> list[Any]:
    """Values for a text file, with as few digits as needed to read back the same numbers."""
    if values.dtype.kind == "M":
        return np.datetime_as_string(values, unit="ns").tolist()  # type: ignore[no-any-return]
    # `tolist` would make doubles of single-precision numbers, which need more digits.
    if values.dtype == np.float32:
        return values.astype("U").tolist()  # type: ignore[no-any-return]
    return values.tolist()  # type: ignore[no-any-return]


def to_csv(
    session: LoggedSession,
    path: str | os.PathLike[str],
    first: int | None = None,
    last: int | None = None,
    series: SeriesChoice = None,
) -> None:
    """Writes the session as comma-separated values; a missing number is "nan"."""
    write_csv(session, path, parts_of(session, first, last, series))


def write_csv(session: LoggedSession, path: str | os.PathLike[str], parts: Iterable[Steps]) -> None:
    """Writes parts of a session into a file of comma-separated values."""
    with open(path, "w", newline="", encoding="utf-8") as file:  # noqa: PTH123
        writer = csv.writer(file, lineterminator="\n")
        for i, steps in enumerate(parts):
            columns = list(columns_of(session, steps))
            if i == 0:
                writer.writerow([name for name, _, _ in columns])
            writer.writerows(zip(*[_texts(values) for _, _, values in columns], strict=True))


def to_parquet(
    session: LoggedSession,
    path: str | os.PathLike[str],
    first: int | None = None,
    last: int | None = None,
    series: SeriesChoice = None,
) -> None:
    """Writes the session as a Parquet file; units are in the metadata of the fields."""
    write_parquet(session, path, parts_of(session, first, last, series))


def write_parquet(
    session: LoggedSession, path: str | os.PathLike[str], parts: Iterable[Steps]
) -> None:
    """Writes parts of a session into a Parquet file."""
    make_writer = _needed("pyarrow.parquet").ParquetWriter
    arrow = _needed("pyarrow")
    with contextlib.ExitStack() as stack:
        writer = None
        for steps in parts:
            columns = list(columns_of(session, steps))
            arrays = [arrow.array(np.ascontiguousarray(values)) for _, _, values in columns]
            fields = [
                arrow.field(name, array.type, metadata={"unit": unit} if unit else None)
                for (name, unit, _), array in zip(columns, arrays, strict=True)
            ]
            table = arrow.table(arrays, schema=arrow.schema(fields))
            if writer is None:
                writer = stack.enter_context(make_writer(os.fspath(path), table.schema))
            writer.write_table(table)


# ---- the command ----

WRITERS = {"csv": write_csv, "parquet": write_parquet}


def sessions_of(log: Log, name: str | None) -> list[LoggedSession]:
    """All sessions and companions, or only those called `name`."""
    all_sessions = [one for session in log.sessions for one in [session, *session.companions]]
    if name is None:
        return all_sessions
    log.session(name)  # raises with the names there are
    return [session for session in all_sessions if session.name == name]


def names_of(sessions: Sequence[LoggedSession]) -> list[str]:
    """Names for the files of sessions: "sim", and "sim.2" for the second session of that name."""
    names: list[str] = []
    for i, session in enumerate(sessions):
        number = 1 + sum(before.name == session.name for before in sessions[:i])
        names.append(session.name if number == 1 else f"{session.name}.{number}")
    return names


def step_range(
    session: LoggedSession, begin: float | None, end: float | None
) -> tuple[int | None, int | None]:
    """The steps between two times [s], which count from the first step in the log."""
    if begin is None and end is None:
        return None, None
    return session.between(begin or 0.0, float("1e9") if end is None else end)


def export(arguments: argparse.Namespace) -> int:
    """Writes a file for each session and companion; returns the exit status."""
    if arguments.format == "mcap":
        words = [program.path(), "log", "cut", arguments.log]
        words += ["-o", str(arguments.output or f"{Path(arguments.log).stem}.copy.mcap")]
        for option in ("robot", "from_", "to"):
            if (value := getattr(arguments, option)) is not None:
                words += [f"--{option.rstrip('_')}", str(value)]
        return subprocess.run(words, check=False).returncode

    log = Log(arguments.log)
    output = arguments.output or Path()
    kind = output.suffix.removeprefix(".")
    if kind in WRITERS:
        if arguments.format not in (None, kind):
            raise InvalidArgument(f"--format is {arguments.format}, but {output} ends in .{kind}")
        _export_session(log.session(arguments.robot or ""), output, WRITERS[kind], arguments)
        return 0
    output.mkdir(parents=True, exist_ok=True)
    stem = Path(arguments.log).resolve().stem
    sessions = sessions_of(log, arguments.robot)
    kind = arguments.format or "csv"
    for session, name in zip(sessions, names_of(sessions), strict=True):
        _export_session(session, output / f"{stem}.{name}.{kind}", WRITERS[kind], arguments)
    return 0


def _export_session(
    session: LoggedSession, path: Path, write: Callable[..., None], arguments: argparse.Namespace
) -> None:
    series = None if session.is_companion else arguments.series
    first, last = step_range(session, arguments.from_, arguments.to)
    # A file that is not complete never gets the final name.
    part = path.with_name(f".{path.name}.part")
    begin, end = session.range("observation")
    begin, end = (begin if first is None else first), (end if last is None else last)
    parts = parts_of(session, first, last, series)
    try:
        write(session, part, shown(parts, path.name, -(-(end - begin) // ROWS)))
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
    print(f"{path} written.", flush=True)


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = argparse.ArgumentParser(
        prog="trifinger log export",
        description="Write the sessions and companions of a log as tables: a row per step.",
        epilog="Examples:\n  trifinger log export run.mcap -o run.csv\n"
        "  trifinger log export run.mcap --format parquet -o tables",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("log", help="a file, or a folder: the newest recording in it")
    parser.add_argument(
        "--format",
        choices=[*WRITERS, "mcap"],
        help="default: the ending of the output, or csv; parquet needs pyarrow; mcap is a copy",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        help="a file (.csv, .parquet) for the newest session, or a folder for all sessions",
    )
    parser.add_argument("--robot", metavar="NAME", help="only the robot or companion of this name")
    parser.add_argument(
        "--series", nargs="+", choices=list(SERIES), help="only these series; default: all"
    )
    parser.add_argument(
        "--from", dest="from_", type=float, metavar="SECONDS", help="begin, since the first step"
    )
    parser.add_argument("--to", type=float, metavar="SECONDS", help="end, since the first step")
    return parser.parse_args(words)


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger log export`."""
    arguments = parse(words)
    return command.run(lambda: export(arguments))


if __name__ == "__main__":
    sys.exit(main())
