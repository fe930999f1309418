# SPDX-License-Identifier: BSD-3-Clause
"""The tables of a LeRobotDataset: the rows of its data, and a row for each episode."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from trifinger_data_sets import lerobot_layout as layout
from trifinger_data_sets.lerobot_layout import Place

if TYPE_CHECKING:
    from pathlib import Path

    from trifinger.arrays import Array

    from trifinger_data_sets.rows import Feature


def _arrow_type(feature: Feature) -> Any:
    import pyarrow as pa

    kind = {"float32": pa.float32(), "int64": pa.int64(), "bool": pa.bool_()}[feature.dtype]
    if feature.shape == (1,):
        return kind
    if len(feature.shape) == 1:
        return pa.list_(kind, feature.shape[0])
    for _ in feature.shape:
        kind = pa.list_(kind)
    return kind


def schema_of(features: Sequence[Feature], images: Sequence[str]) -> Any:
    """The columns of data files, with the description that the package `datasets` reads."""
    import pyarrow as pa

    columns = [pa.field(one.name, _arrow_type(one)) for one in features]
    picture = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
    columns += [pa.field(name, picture) for name in images]
    described: dict[str, Any] = {}
    for one in features:
        value = {"dtype": one.dtype, "_type": "Value"}
        if one.shape == (1,):
            described[one.name] = value
        elif len(one.shape) == 1:
            described[one.name] = {
                "feature": value,
                "length": one.shape[0],
                "_type": "Sequence",
            }
        else:
            described[one.name] = {
                "shape": list(one.shape),
                "dtype": one.dtype,
                "_type": f"Array{len(one.shape)}D",
            }
    described |= {name: {"_type": "Image"} for name in images}
    note = json.dumps({"info": {"features": described}})
    return pa.schema(columns, metadata={"huggingface": note})


def _arrow_array(values: Array, feature: Feature) -> Any:
    import pyarrow as pa

    flat = pa.array(np.ascontiguousarray(values, np.dtype(feature.dtype)).ravel())
    if feature.shape == (1,):
        return flat
    if len(feature.shape) == 1:
        return pa.FixedSizeListArray.from_arrays(flat, feature.shape[0])
    for size in reversed(feature.shape):
        offsets = np.arange(0, len(flat) + 1, size, dtype=np.int32)
        flat = pa.ListArray.from_arrays(pa.array(offsets), flat)
    return flat


class EpisodeTable:
    """The files with a row for each episode.

    A file is written at once: its writer would keep something of each row group until its end, and
    the descriptions have a thousand columns.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._waiting: list[dict[str, Any]] = []
        self._tables: list[Any] = []
        self.place = Place()
        self.count = 0

    def add(self, row: dict[str, Any]) -> None:
        """Adds an episode."""
        self._waiting.append(row)
        self.count += 1
        if len(self._waiting) >= layout.WAITING:
            self._pack()
        if sum(table.nbytes for table in self._tables) >= layout.EPISODES_SIZE * layout.MEGABYTE:
            self.close()

    def close(self) -> None:
        """Writes a file of the episodes that were added since the last one."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        self._pack()
        if self._tables:
            table = pa.concat_tables(self._tables)
            pq.write_table(
                table, self.place.path(self._folder, layout.EPISODES_PATH), compression="snappy"
            )
            self.place = Place(self.place.number + 1)
            self._tables = []

    def _pack(self) -> None:
        import pyarrow as pa

        if self._waiting:
            schema = self._tables[0].schema if self._tables else None
            self._tables.append(pa.Table.from_pylist(self._waiting, schema))
            self._waiting = []


class DataTable:
    """The data files; an episode is in one of them.

    Rows wait until they are a row group: short groups would be slow to read, and the writer keeps
    something of each until the end of the file.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._writer: Any = None
        self._waiting: list[Any] = []
        self._waiting_bytes = 0
        self._next = 0
        self.place = Place()

    def begin_episode(self) -> None:
        """Begins a new file if the last one is large enough."""
        if self._writer is not None and self._size() >= layout.DATA_SIZE * layout.MEGABYTE:
            self.close()

    def add(
        self,
        values: dict[str, Array],
        features: Sequence[Feature],
        files: dict[str, list[bytes]],
        schema: Any,
    ) -> None:
        """Adds rows; `files` are images, a file for each row."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        if self._writer is None:
            self.place = Place(self._next)
            self._next += 1
            self._path = self.place.path(self._folder, layout.DATA_PATH)
            self._writer = pq.ParquetWriter(self._path, schema, compression="snappy")
        arrays = [_arrow_array(values[one.name], one) for one in features]
        arrays += [
            pa.array(
                [{"bytes": file, "path": None} for file in files[name]], schema.field(name).type
            )
            for name in schema.names[len(features) :]
        ]
        table = pa.Table.from_arrays(arrays, schema=schema)
        self._waiting.append(table)
        self._waiting_bytes += table.nbytes
        if self._waiting_bytes >= layout.GROUP_SIZE * layout.MEGABYTE:
            self._write()

    def close(self) -> None:
        """Ends the file."""
        if self._writer is not None:
            self._write()
            self._writer.close()
            self._writer = None

    def _write(self) -> None:
        import pyarrow as pa

        if self._waiting:
            self._writer.write_table(pa.concat_tables(self._waiting))
            self._waiting, self._waiting_bytes = [], 0

    def _size(self) -> int:
        return self._path.stat().st_size + self._waiting_bytes
