# SPDX-License-Identifier: BSD-3-Clause
"""Statistics of columns that need not fit into memory.

Numbers are kept in temporary files, a file for each feature, and read again a few columns at a
time. So quantiles are exact, of an episode as of all episodes. Images are counted by the
brightness of their pixels, which has 256 values.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from trifinger.arrays import Array

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
MEMORY = 32 << 20  # size of the numbers that are read at once [bytes]

Statistics = dict[str, Any]
"""min, max, mean, std, the quantiles and count, as lists like a row of the feature."""


class Columns:
    """The rows of a feature, in a file."""

    def __init__(self, path: Path, shape: Sequence[int], dtype: str) -> None:
        self._path = path
        self._shape = tuple(shape)
        self._size = int(np.prod(self._shape, dtype=np.int64))
        self._dtype = np.dtype(dtype)
        self._file = path.open("w+b")
        self.rows = 0

    def add(self, values: Array) -> None:
        """Adds rows at the end."""
        self._file.write(np.ascontiguousarray(values, self._dtype).tobytes())
        self.rows += len(values)

    def statistics(self, first: int = 0, end: int | None = None) -> Statistics:
        """The statistics of the rows from `first` to before `end`, at least one."""
        self._file.flush()
        end = self.rows if end is None else end
        count = end - first
        found: dict[str, list[Array]] = {}
        for values in self._parts(first, count):
            numbers = values.astype(np.float64)
            del values
            parts = {
                "min": numbers.min(axis=0),
                "max": numbers.max(axis=0),
                "mean": numbers.mean(axis=0),
                "std": numbers.std(axis=0),
            }
            # The last one may sort the numbers in place.
            shares = list(QUANTILES.values())
            quantiles = np.quantile(numbers, shares, axis=0, overwrite_input=True)
            parts |= dict(zip(QUANTILES, quantiles, strict=True))
            for name, part in parts.items():
                found.setdefault(name, []).append(part)
        result: Statistics = {
            name: np.concatenate(parts).reshape(self._shape).tolist()
            for name, parts in found.items()
        }
        return result | {"count": [count]}

    def _parts(self, first: int, count: int) -> Iterator[Array]:
        width = min(self._size, max(1, MEMORY // (8 * max(count, 1))))
        # The file is not mapped: its pages would count as memory of this process.
        row_bytes = self._size * self._dtype.itemsize
        at_once = max(1, MEMORY // (4 * row_bytes))
        for column in range(0, self._size, width):
            part = np.empty((count, min(width, self._size - column)), self._dtype)
            for row in range(0, count, at_once):
                size = min(at_once, count - row) * row_bytes
                read = os.pread(self._file.fileno(), size, (first + row) * row_bytes)
                numbers = np.frombuffer(read, self._dtype).reshape(-1, self._size)
                part[row : row + len(numbers)] = numbers[:, column : column + width]
            yield part

    def close(self) -> None:
        """Removes the file."""
        self._file.close()
        self._path.unlink(missing_ok=True)


@dataclass
class Brightness:
    """How often each brightness was in the channels of images."""

    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros((3, 256), np.int64))
    images: int = 0

    def add(self, image: NDArray[np.uint8]) -> None:
        """Counts the pixels of an image, height x width x 3."""
        for channel in range(3):
            self.counts[channel] += np.bincount(image[:, :, channel].ravel(), minlength=256)
        self.images += 1

    def merge(self, other: Brightness) -> None:
        """Adds what another one has counted."""
        self.counts += other.counts
        self.images += other.images

    def statistics(self) -> Statistics:
        """The statistics of brightness from 0 to 1, each of shape (3, 1, 1)."""
        values = np.arange(256) / 255.0
        total = self.counts.sum(axis=1)
        mean = self.counts @ values / total
        variance = (self.counts * (values - mean[:, None]) ** 2).sum(axis=1) / total
        found = {
            "min": np.array([values[np.flatnonzero(one)[0]] for one in self.counts]),
            "max": np.array([values[np.flatnonzero(one)[-1]] for one in self.counts]),
            "mean": mean,
            "std": np.sqrt(variance),
        }
        for name, share in QUANTILES.items():
            found[name] = np.array([_quantile(one, share) for one in self.counts])
        result: Statistics = {
            name: numbers.reshape(3, 1, 1).tolist() for name, numbers in found.items()
        }
        return result | {"count": [self.images]}


def _quantile(counts: NDArray[np.int64], share: float) -> float:
    # As numpy.quantile does: between the two sorted values around the place.
    place = share * (int(counts.sum()) - 1)
    below = np.cumsum(counts)
    low, high = (
        int(np.searchsorted(below, rank, side="right"))
        for rank in (int(np.floor(place)), int(np.ceil(place)))
    )
    return (low + float(place - np.floor(place)) * (high - low)) / 255.0


def sampled(count: int) -> NDArray[np.int64]:
    """Which of `count` images are looked at: count^0.75 of them, 100 at least, 10 000 at most."""
    number = min(count, max(100, min(10_000, round(count**0.75))))
    return np.unique(np.linspace(0, count - 1, number).round().astype(np.int64))


def thinned(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Every n-th pixel of a large image, so that its longer side has 150 to 300 of them."""
    step = max(1, max(image.shape[:2]) // 150) if max(image.shape[:2]) > 300 else 1
    return image[::step, ::step]
