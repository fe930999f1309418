# SPDX-License-Identifier: BSD-3-Clause
"""ChArUco boards: chessboards with a marker in every white square.

The frame of a board is OpenCV's: the origin is a corner of the pattern, x goes along its rows of
squares, y down its columns, and z into the board, away from who looks at it.
"""

import dataclasses
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray
from trifinger.errors import InvalidArgument

Matrix = NDArray[np.float64]

MARGIN = 0.006  # white around the pattern that a print must have [m]


def dictionary_names() -> list[str]:
    """The dictionaries of markers that OpenCV knows, such as "4x4_50" and "apriltag_16h5"."""
    return sorted({name[5:].lower() for name in dir(cv2.aruco) if name.startswith("DICT_")})


def dictionary_of(name: str) -> cv2.aruco.Dictionary:
    """The markers of a dictionary; raises InvalidArgument if OpenCV knows none of this name."""
    number = getattr(cv2.aruco, f"DICT_{name.upper()}", None)
    if number is None:
        raise InvalidArgument(
            f"there is no dictionary '{name}'; there are {', '.join(dictionary_names())}"
        )
    return cv2.aruco.getPredefinedDictionary(number)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Board:
    """What is printed on a board, and how thick it is."""

    columns: int = 8
    """Number of squares along x."""
    rows: int = 5
    """Number of squares along y."""
    square: float = 0.035
    """Side of a square [m]."""
    marker: float = 0.027
    """Side of the black frame of a marker [m]."""
    dictionary: str = "4x4_50"
    first_id: int = 0
    """Number in the dictionary of the first marker; the others follow."""
    legacy: bool = False
    """Whether OpenCV before 4.6 drew the board, which begins boards of even rows with white."""
    thickness: float = 0.0
    """Height of the pattern above the table when the board lies on it [m]."""

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 3 or max(self.columns, self.rows) > 50:
            raise InvalidArgument(
                f"a board of {self.columns} x {self.rows} squares cannot be used; each side must "
                "have 3 to 50"
            )
        if not 0 < self.marker < self.square < 1:
            raise InvalidArgument(
                f"markers of {self.marker} m in squares of {self.square} m make no board; markers "
                "must be smaller than squares, and squares below 1 m"
            )
        if not 0 <= self.thickness < 0.2:
            raise InvalidArgument(f"thickness is {self.thickness} m, must be 0 to 0.2 m")
        last = self.first_id + self.markers - 1
        known = len(dictionary_of(self.dictionary).bytesList)
        if self.first_id < 0 or last >= known:
            raise InvalidArgument(
                f"{self.dictionary} has {known} markers, 0 to {known - 1}; a board of "
                f"{self.columns} x {self.rows} squares needs those from {self.first_id} to {last}"
            )

    @property
    def markers(self) -> int:
        """Number of markers."""
        return self.columns * self.rows // 2

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the pattern [m]."""
        return self.columns * self.square, self.rows * self.square

    @property
    def middle(self) -> Matrix:
        """The middle of the pattern, in the frame of the board."""
        return np.array([*self.size, 0.0]) / 2

    @cached_property
    def corners(self) -> Matrix:
        """The inner corners of the chessboard, by number, in the frame of the board [m]."""
        rows, columns = np.mgrid[1 : self.rows, 1 : self.columns]
        x, y = columns.ravel() * self.square, rows.ravel() * self.square
        return np.stack([x, y, np.zeros(len(x))], axis=1)

    def to_opencv(self) -> cv2.aruco.CharucoBoard:
        """OpenCV's object for this board."""
        board = cv2.aruco.CharucoBoard(
            (self.columns, self.rows),
            self.square,
            self.marker,
            dictionary_of(self.dictionary),
            np.arange(self.first_id, self.first_id + self.markers, dtype=np.int32),
        )
        board.setLegacyPattern(self.legacy)
        return board

    def __str__(self) -> str:
        later = f", ids from {self.first_id} on" if self.first_id else ""
        older = ", legacy pattern" if self.legacy else ""
        return (
            f"{self.columns} x {self.rows} squares of {self.square * 1e3:g} mm with markers of "
            f"{self.marker * 1e3:g} mm from {self.dictionary}{later}{older}"
        )


PRESETS = {
    "a4": Board(),
    "original": Board(
        columns=5,
        rows=10,
        square=0.04,
        marker=0.03,
        dictionary="apriltag_16h5",
        legacy=True,
        thickness=0.0045,
    ),
}
"""Boards by name: one for a sheet of A4, and that of the original stack."""
