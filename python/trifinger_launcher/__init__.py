# SPDX-License-Identifier: BSD-3-Clause
"""Starts the commands that are written in Python, so that Ctrl-C ends them at any moment.

The package `trifinger` takes a second to import, and Ctrl-C would be an exception in whatever line
that has reached. This package is imported first. `from trifinger_launcher import view` gives the
function that does `trifinger view`.
"""

import contextlib
import os
import signal
from collections.abc import Callable, Iterator
from importlib import import_module
from types import FrameType

INTERRUPTED = 130
"""The exit status of a command that Ctrl-C has ended."""


def _end(_number: int, _frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)  # nothing has begun yet, or everything is done


def __getattr__(command: str) -> Callable[[], int]:
    """The function of a command, by the name of its module in `trifinger.commands`."""
    if command.startswith("_"):
        raise AttributeError(command)
    # Whoever starts a command with SIGINT ignored, as shells do in the background, wants that.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)
    _unblock()

    def main() -> int:
        return int(import_module(f"trifinger.commands.{command}").main())

    return main


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
