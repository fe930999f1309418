# SPDX-License-Identifier: BSD-3-Clause
"""What all robots have in common."""

import enum
from typing import Any

_MAX_MESSAGE = 63  # characters


class RobotBackendTerminationReason(enum.IntEnum):
    """Why a back-end has ended."""

    NOT_TERMINATED = 0
    SHUTDOWN_REQUESTED = 1
    MAXIMUM_NUMBER_OF_ACTIONS_REACHED = 2
    DRIVER_ERROR = -1
    FIRST_ACTION_TIMEOUT = -2
    NEXT_ACTION_TIMEOUT = -3


class ErrorStatus(enum.IntEnum):
    """Who has failed."""

    NO_ERROR = 0
    DRIVER_ERROR = 1
    BACKEND_ERROR = 2


_ErrorStatus = ErrorStatus


class Status:
    """The status of a step."""

    ErrorStatus = _ErrorStatus
    NO_ERROR = _ErrorStatus.NO_ERROR
    DRIVER_ERROR = _ErrorStatus.DRIVER_ERROR
    BACKEND_ERROR = _ErrorStatus.BACKEND_ERROR

    def __init__(self) -> None:
        self.action_repetitions = 0  # how often the action was applied again
        self.error_status = _ErrorStatus.NO_ERROR
        self._message = ""

    def set_error(self, error_type: _ErrorStatus, message: str) -> None:
        """Notes an error; later ones are ignored. The message has up to 63 characters."""
        if self.error_status is not _ErrorStatus.NO_ERROR:
            return
        self.error_status = _ErrorStatus(error_type)
        is_long = len(message) > _MAX_MESSAGE
        self._message = message[: _MAX_MESSAGE - 1] + "~" if is_long else message

    def get_error_message(self) -> str:
        """The message of the error; empty if there is none."""
        return self._message

    def has_error(self) -> bool:
        """True if there was an error."""
        return self.error_status is not _ErrorStatus.NO_ERROR

    def __getstate__(self) -> tuple[Any, ...]:
        return self.action_repetitions, int(self.error_status), self._message

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        self.action_repetitions, error_status, self._message = state
        self.error_status = _ErrorStatus(error_status)

    def __repr__(self) -> str:
        return f"Status(action_repetitions={self.action_repetitions}, {self.error_status.name})"


# Pickles name the module of the original.
for _each in (RobotBackendTerminationReason, ErrorStatus, Status):
    _each.__module__ = "robot_interfaces.py_generic"
