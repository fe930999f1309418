# SPDX-License-Identifier: BSD-3-Clause
"""The stop of a page: it ends the back-end of a robot as `trifinger stop` does.

It needs neither the controller nor the scene of the page, and nothing of another browser. The files
that it opens are reserved from the beginning, so it works when this process can open no others.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
from collections.abc import Iterator
from http import HTTPStatus

from trifinger import _trifinger
from trifinger.errors import Error, SessionNotFound

RESERVED_FILES = 16  # more than an observer of a robot and its process need

Answer = tuple[int, str]
"""The status of an answer to a browser, and a sentence."""


class Stop:
    """The stop of one robot. One thread uses it; nothing here waits."""

    def __init__(self, name: str) -> None:
        """`name` is that of the robot, which need not run yet."""
        self._name = name
        self._backend = 0  # the number of the process that was told to end
        self._process = -1  # its descriptor
        self._reserved: list[int] = []
        self._reserve()

    def order(self) -> Answer:
        """Tells the back-end to bring the robot to rest and to end.

        It is told once, since `trifinger run` ends at a second signal without doing that.
        The status is 202 when it was told, 200 when there is nothing left to end, and 4xx or 5xx
        with the reason when it cannot be told.
        """
        with self._reserved_files():
            return self._order()

    def _order(self) -> Answer:
        remedy = f"run in a terminal: trifinger stop {self._name}"
        try:
            backend = _trifinger.observe(self._name).session_info().backend_pid
            if backend == self._backend and self.outcome()[0] == HTTPStatus.ACCEPTED:
                return self.outcome()
            process = os.pidfd_open(backend)
        except SessionNotFound:
            if self._process >= 0:
                return self.outcome()
            return HTTPStatus.NOT_FOUND, f"No robot '{self._name}' runs: there is nothing to stop."
        except ProcessLookupError:
            return HTTPStatus.OK, "The back-end is already gone."
        except (Error, OSError) as error:
            return HTTPStatus.INTERNAL_SERVER_ERROR, f"NOT stopped: {error}; {remedy}."
        try:
            # The descriptor is of the back-end only if that was still alive when it was opened.
            if not _trifinger.observe(self._name).session_info().backend_is_alive:
                os.close(process)
                return HTTPStatus.OK, "The back-end is already gone."
            signal.pidfd_send_signal(process, signal.SIGTERM)
        except (Error, OSError) as error:
            os.close(process)
            return HTTPStatus.INTERNAL_SERVER_ERROR, f"NOT stopped: {error}; {remedy}."
        self._forget()
        self._backend, self._process = backend, process
        return HTTPStatus.ACCEPTED, f"Stopping: process {backend} brings the robot to rest."

    def outcome(self) -> Answer:
        """Says whether the back-end that was told has ended: status 200, or 202 until then."""
        if self._process < 0:
            return HTTPStatus.NOT_FOUND, "Nothing was told to stop."
        if select.select([self._process], [], [], 0)[0]:
            return HTTPStatus.OK, "Stopped: the robot has come to rest, and its back-end has ended."
        return (
            HTTPStatus.ACCEPTED,
            "The back-end still brings the robot to rest, or it hangs. If this lasts, "
            f"run in a terminal: trifinger stop {self._name}",
        )

    @contextlib.contextmanager
    def _reserved_files(self) -> Iterator[None]:
        """Lets files be opened in place of those that are reserved."""
        self._give_reserved()
        try:
            yield
        finally:
            self._reserve()

    def _reserve(self) -> None:
        with contextlib.suppress(OSError):  # what could not be reserved again is tried next time
            while len(self._reserved) < RESERVED_FILES:
                self._reserved.append(os.open(os.devnull, os.O_RDONLY))

    def _give_reserved(self) -> None:
        while self._reserved:
            os.close(self._reserved.pop())

    def close(self) -> None:
        """Ends the stop: it forgets the back-end that was told, and its files."""
        self._give_reserved()
        self._forget()

    def _forget(self) -> None:
        process, self._process = self._process, -1
        if process >= 0:
            with contextlib.suppress(OSError):
                os.close(process)
