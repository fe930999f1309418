# SPDX-License-Identifier: BSD-3-Clause
"""Sessions of logs as tables for other programs.

A table has a row per step and a column per number, such as "observation.position[0]". Numbers are
written in full, so that reading them gives the same numbers. CSV needs only NumPy, Parquet needs
PyArrow.
"""

from __future__ import annotations

import contextlib
import csv
import importlib
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from trifinger import extras
from trifinger._trifinger import LoggedSession
from trifinger.element_text import fields_of
from trifinger.log.steps import SeriesChoice, parts_of
from trifinger.log.types import Steps

if TYPE_CHECKING:
    import pandas
    from numpy.typing import NDArray


SERIES = {
    "observation": "observations",
    "applied_action": "applied_actions",
    "desired_action": "desired_actions",
    "status": "statuses",
}


def _needed(module: str) -> Any:
    extras.require("export", module.partition(".")[0])
    return importlib.import_module(module)


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
        prefix = "" if session.is_companion else f"{series}."
        for field, values in fields_of(elements):
            unit = units[series].get(field, "")
            for index in np.ndindex(values.shape[1:]):
                suffix = "".join(f"[{i}]" for i in index)
                yield prefix + field + suffix, unit, values[(slice(None), *index)]


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


def _parts(
    session: LoggedSession, first: int | None, last: int | None, series: SeriesChoice
) -> Iterator[Steps]:
    # If there are no steps, one part has the columns but no rows.
    is_empty = True
    for steps in parts_of(session, first, last, series):
        is_empty = False
        yield steps
    if is_empty:
        yield session.read(0, 0, series)


def _texts(values: NDArray[Any]) -> list[Any]:
    """Values for a text file, with as few digits as needed to read back the same numbers."""
    if values.dtype.kind == "M":
        values = np.datetime_as_string(values, unit="ns")
    elif values.dtype == np.float32:
        # `tolist` would make doubles of single-precision numbers, which need more digits.
        values = values.astype("U")
    texts: list[Any] = values.tolist()
    return texts


def to_csv(
    session: LoggedSession,
    path: str | os.PathLike[str],
    first: int | None = None,
    last: int | None = None,
    series: SeriesChoice = None,
) -> None:
    """Writes the session as comma-separated values; a missing number is "nan"."""
    with open(path, "w", newline="", encoding="utf-8") as file:  # noqa: PTH123
        writer = csv.writer(file, lineterminator="\n")
        for i, steps in enumerate(_parts(session, first, last, series)):
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
    make_writer = _needed("pyarrow.parquet").ParquetWriter
    arrow = _needed("pyarrow")
    with contextlib.ExitStack() as stack:
        writer = None
        for steps in _parts(session, first, last, series):
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
