# SPDX-License-Identifier: BSD-3-Clause
"""Starts the commands that are written in Python, so that Ctrl-C ends them at any moment.

The package `trifinger` takes a second to import, and Ctrl-C would be an exception in whatever line
that has reached. This package is imported first, so the script of a command in pyproject.toml is
`trifinger_launcher:MODULE.FUNCTION` instead of `MODULE:FUNCTION`.
"""

import contextlib
import os
import signal
from collections.abc import Iterator
from importlib import import_module
from types import FrameType

INTERRUPTED = 130
"""The exit status of a command that Ctrl-C has ended."""


def _end(_number: int, _frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)  # nothing has begun yet, or everything is done


class _Function:
    """A function by its path in modules that are imported when it is called."""

    def __init__(self, path: str) -> None:
        self._path = path

    def __getattr__(self, name: str) -> "_Function":
        return _Function(f"{self._path}.{name}")

    def __call__(self) -> int:
        module, _, name = self._path.rpartition(".")
        return int(getattr(import_module(module), name)())


def __getattr__(package: str) -> _Function:
    """The functions in a package."""
    if package.startswith("_"):
        raise AttributeError(package)
    # Whoever starts a command with SIGINT ignored, as shells do in the background, wants that.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)
    _unblock()
    return _Function(package)


def _unblock() -> None:
    """Lets SIGINT come, which `trifinger` blocks while Python itself starts."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Lets Ctrl-C raise KeyboardInterrupt in this block, which ends its work in order."""
    _unblock()
    is_started = signal.getsignal(signal.SIGINT) is _end
    if is_started:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        if is_started:
            signal.signal(signal.SIGINT, _end)
