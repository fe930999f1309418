# SPDX-License-Identifier: BSD-3-Clause
"""The binary log of a robot, as objects."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from trifinger.errors import Error
from trifinger.log.original import ACTION_FIELDS, OBSERVATION_FIELDS, read_robot_log, times_of

from trifinger_compat.generic import ErrorStatus, Status


@dataclass
class LogEntry:
    """A step of a log."""

    timeindex: int
    timestamp: float  # since 1970 [s]
    status: Status
    observation: Any
    desired_action: Any
    applied_action: Any


class BaseBinaryLogReader:
    """Reads the binary log of a robot; `data` is a list of its steps."""

    action_class: ClassVar[Any]
    observation_class: ClassVar[Any]

    def __init__(self, filename: str | Path | None = None) -> None:
        """Raises RuntimeError if there is no such log."""
        self.data: list[LogEntry] = []
        if filename is not None:
            self.read_file(filename)

    def read_file(self, filename: str | Path) -> None:
        """Reads a file in place of what was read before; raises RuntimeError."""
        rows = read_robot_log(filename, self.action_class.JOINTS, self.observation_class.TIPS)
        try:
            self.data = [
                self._entry(row, float(time))
                for row, time in zip(rows, times_of(rows), strict=True)
            ]
        except ValueError as error:  # an error status that does not exist, or no text
            raise Error(f"the log {filename} is damaged: {error}") from error

    def _entry(self, row: Any, time: float) -> LogEntry:
        status = Status()
        status.action_repetitions = int(row["action_repetitions"])
        if row["error_status"]:
            status.set_error(ErrorStatus(int(row["error_status"])), row["message"].decode())
        observation = self.observation_class()
        for name in OBSERVATION_FIELDS[: 4 if self.observation_class.TIPS else 3]:
            setattr(observation, name, row[f"observation_{name}"])
        return LogEntry(
            timeindex=int(row["time_index"]),
            timestamp=time,
            status=status,
            observation=observation,
            desired_action=self._action(row, "desired_action"),
            applied_action=self._action(row, "applied_action"),
        )

    def _action(self, row: Any, series: str) -> Any:
        return self.action_class(*(row[f"{series}_{name}"] for name in ACTION_FIELDS))


def set_row(row: NDArray[np.void], status: Status, observation: Any) -> None:
    """Writes status and observation of a step into a row."""
    row["action_repetitions"] = status.action_repetitions
    row["error_status"] = int(status.error_status)
    row["message"] = status.get_error_message().encode()[:63]
    for name in OBSERVATION_FIELDS:
        if f"observation_{name}" in (row.dtype.names or ()):
            row[f"observation_{name}"] = getattr(observation, name)
