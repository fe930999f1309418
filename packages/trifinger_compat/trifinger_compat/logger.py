# SPDX-License-Identifier: BSD-3-Clause
"""Keeping the series of a robot, and writing them to files of the original."""

import enum
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from trifinger.errors import Error, HistoryLost
from trifinger.log.original import (
    ACTION_FIELDS,
    OBSERVATION_FIELDS,
    error_status_of,
    row_type,
    set_times,
    tip_forces_of,
    write_robot_csv,
    write_robot_log,
)

from trifinger_compat.clock import SINCE_1970
from trifinger_compat.keeper import Keeper
from trifinger_compat.robot_data import BaseData

BLOCK = 500  # steps that are read at once
_SERIES = ("status", "observation", "desired_action", "applied_action")


class Format(enum.Enum):
    """Formats of log files."""

    BINARY = 0
    CSV = 1
    CSV_GZIP = 2


_Format = Format


class BaseLogger(Keeper):
    """Keeps the steps of a robot from start() on, up to a number of them, in memory.

    `trifinger record` writes to a file while the robot runs, and can keep any number of steps.
    """

    Format = _Format

    def __init__(self, robot_data: BaseData, buffer_limit: int = 0) -> None:
        """`buffer_limit` is the number of steps that are kept at most; 0: any number."""
        super().__init__()
        self._data = robot_data
        self._limit = buffer_limit
        self._rows: list[NDArray[np.void]] = []
        self._lost = 0  # steps that were overwritten before they were read
        self._filename: str | Path | None = None
        data = robot_data
        self._row_type = row_type(data.action_class.JOINTS, data.observation_class.TIPS)

    def start(self, filename: str | Path | None = None) -> None:
        """Begins to keep steps. Programs of 2020 give the file for stop() here."""
        if self._thread is None:
            self._filename = filename
            self._begin()

    def stop(self) -> None:
        """Keeps the steps until now, and no more."""
        self._end()
        if self._filename is not None:
            self.stop_and_save(self._filename, Format.CSV)

    def reset(self) -> None:
        """Forgets all steps and keeps no more."""
        self._filename = None
        self.stop()
        self._rows, self._lost, self._error = [], 0, None

    def stop_and_save(self, filename: str | Path, log_format: _Format = _Format.BINARY) -> None:
        """Stops, and writes what was kept; raises RuntimeError if steps could not be kept.

        Steps that were overwritten before they could be kept are counted on stderr.
        """
        self._filename = None
        self.stop()
        if self._error is not None:
            raise Error(
                f"the logger of '{self._data.name}' ended after {self._count()} steps: "
                f"{self._error}"
            ) from self._error
        _save(filename, self._all_rows(), log_format)
        if self._lost:
            print(
                f"{filename} lacks {self._lost} steps of '{self._data.name}': they were "
                "overwritten before they could be kept; `trifinger record` is faster",
                file=sys.stderr,
            )

    def save_current_robot_data(
        self, filename: str | Path, start_index: int = 0, end_index: int = -1
    ) -> None:
        """Writes steps that can still be read, as text; the last index is not included."""
        _save(filename, self._current(start_index, end_index), Format.CSV)

    def save_current_robot_data_binary(
        self, filename: str | Path, start_index: int = 0, end_index: int = -1
    ) -> None:
        """Writes steps that can still be read; the last index is not included."""
        _save(filename, self._current(start_index, end_index), Format.BINARY)

    def _range(self) -> tuple[int, int]:
        """The first step that all series have, and the one after the last."""
        ranges = [self._data.robot.range(name) for name in _SERIES]
        return max(first for first, _ in ranges), min(end for _, end in ranges)

    def _current(self, start: int, end: int) -> NDArray[np.void]:
        margin = 0
        while True:
            first, newest = self._range()
            last = newest if end < 0 else min(end, newest)
            try:
                return self._read(max(first + margin, start), last)
            except HistoryLost:
                # The robot goes on meanwhile and overwrites the oldest steps.
                margin = max(1, 2 * margin)

    def _count(self) -> int:
        return sum(map(len, self._rows))

    def _all_rows(self) -> NDArray[np.void]:
        if not self._rows:
            return np.zeros(0, dtype=self._row_type)
        return np.concatenate(self._rows)

    def _keep(self) -> None:
        next_step = self._range()[1]
        kept = self._count()
        while True:
            # What is there when the end is asked for is kept.
            is_ending = self._is_ending.wait(0.05)
            end = self._range()[1]
            while next_step < end and (not self._limit or kept < self._limit):
                last = min(end, next_step + BLOCK)
                if self._limit:
                    last = min(last, next_step + self._limit - kept)
                try:
                    rows = self._read(next_step, last)
                except HistoryLost as error:
                    self._lost += error.oldest - next_step
                    next_step = error.oldest
                    continue
                self._rows.append(rows)
                kept += len(rows)
                next_step = last
            if is_ending:
                return

    def _read(self, first: int, last: int) -> NDArray[np.void]:
        rows = np.zeros(max(0, last - first), dtype=self._row_type)
        if not len(rows):
            return rows
        robot = self._data.robot
        statuses = robot.get_statuses(first, last)
        observations = robot.get_observations(first, last)
        rows["time_index"] = np.arange(first, last)
        set_times(rows, statuses["time"] * 1e-9 + SINCE_1970)
        rows["action_repetitions"] = statuses["action_repeats"]
        rows["error_status"] = error_status_of(statuses["fault_code"])
        for name in OBSERVATION_FIELDS:
            if f"observation_{name}" in (self._row_type.names or ()):
                values: Any = observations[name]
                is_force = name == "tip_force"
                rows[f"observation_{name}"] = tip_forces_of(values) if is_force else values
        desired = robot.get_desired_actions(first, last)
        applied = robot.get_applied_actions(first, last)
        for name in ACTION_FIELDS:
            rows[f"desired_action_{name}"] = desired[name]
            rows[f"applied_action_{name}"] = applied[name]
        return rows


def _save(filename: str | Path, rows: NDArray[np.void], log_format: Format) -> None:
    if not len(rows):
        raise Error(f"there are no steps to write to {filename}")
    if log_format is Format.BINARY:
        write_robot_log(filename, rows)
    else:
        write_robot_csv(filename, rows, is_compressed=log_format is Format.CSV_GZIP)
