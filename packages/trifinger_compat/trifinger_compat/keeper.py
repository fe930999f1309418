# SPDX-License-Identifier: BSD-3-Clause
"""What loggers have in common: a thread that keeps a series."""

import threading
from abc import ABC, abstractmethod


class Keeper(ABC):
    """Keeps what comes, in a thread of its own, from its begin to its end."""

    def __init__(self) -> None:
        self._error: Exception | None = None  # that has ended the thread
        self._is_ending = threading.Event()
        self._thread: threading.Thread | None = None

    def _begin(self) -> None:
        if self._thread is None:
            self._is_ending.clear()
            self._error = None
            self._thread = threading.Thread(target=self._run, daemon=True)
            self._thread.start()

    def _end(self) -> None:
        if self._thread is not None:
            self._is_ending.set()
            self._thread.join()
            self._thread = None

    def _run(self) -> None:
        try:
            self._keep()
        except Exception as error:  # who ends it raises it
            self._error = error

    @abstractmethod
    def _keep(self) -> None:
        """Keeps until `_is_ending`."""
