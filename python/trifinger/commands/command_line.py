# SPDX-License-Identifier: BSD-3-Clause
"""What the command lines of all commands share."""

import argparse
import contextlib
import signal
import sys
from collections.abc import Callable, Iterator
from types import FrameType
from typing import NoReturn, TextIO

import trifinger_launcher

from trifinger._trifinger import Guide
from trifinger.errors import Error, InvalidArgument, TimedOut
from trifinger.picture import CAMERAS, View
from trifinger.text import printable, printable_lines

LONGEST = 10_000  # characters that are printed at once


class ArgumentParser(argparse.ArgumentParser):
    """The parser of all commands. No terminal obeys the words that it refuses."""

    def error(self, message: str) -> NoReturn:
        """Prints what is wrong with the words, and ends the command."""
        super().error(printable(message))


def run(work: Callable[[], int | None]) -> int:
    """Does the work of a command and returns its exit status; prints an error as one sentence."""
    try:
        with trifinger_launcher.interruptible():
            try:
                return work() or 0
            finally:
                sys.stdout.flush()  # after this block Ctrl-C would lose it
    except Error as error:
        say(f"trifinger: {error}", file=sys.stderr)
        return 2 if isinstance(error, InvalidArgument) else 1
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        say(f"trifinger: {where}{error.strerror or error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


def say(*texts: object, file: TextIO | None = None, sep: str = " ", flush: bool = False) -> None:
    """Prints a line, or several. Whatever others wrote in it, no terminal obeys it."""
    text = printable_lines(sep.join(map(str, texts)), LONGEST)
    print(text, file=file or sys.stdout, flush=flush)


@contextlib.contextmanager
def ended_by_signals() -> Iterator[None]:
    """Lets SIGTERM and SIGHUP do what Ctrl-C does, so that a robot comes to rest in order."""

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    numbers = (signal.SIGTERM, signal.SIGHUP)
    before = [signal.signal(number, interrupt) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


def wait_until_measured(guide: Guide, robot: str) -> None:
    """Waits until a guide knows where its robot is, and says so if that takes long."""
    try:
        guide.state(timeout=1.0)
    except TimedOut:
        say(
            f"The robot '{robot}' is not ready: it may be homing. Ctrl-C ends the waiting.",
            flush=True,
        )
        guide.state()


def add_log_options(parser: argparse.ArgumentParser) -> None:
    """Adds the log and the part of it that a command reads: LOG, --from and --to."""
    parser.add_argument("log", help="a file, or a folder: the newest recording in it")
    add_part_options(parser)


def add_part_options(parser: argparse.ArgumentParser) -> None:
    """Adds --from and --to, between which a log is read."""
    parser.add_argument(
        "--from", dest="from_", type=float, metavar="SECONDS", help="begin, since the first step"
    )
    parser.add_argument("--to", type=float, metavar="SECONDS", help="end, since the first step")


def add_view_options(parser: argparse.ArgumentParser, default: View | None = None) -> None:
    """Adds --camera, --width and --height to a command; `view_of` reads them."""
    view = default or View()
    parser.add_argument(
        "--camera",
        default=view.camera,
        metavar="NAME|AZIMUTH,ELEVATION",
        help=f"{', '.join(CAMERAS)}, a camera of the model such as camera60, or two angles in "
        f"degrees; default: {view.camera}",
    )
    for name in ("width", "height"):
        parser.add_argument(
            f"--{name}",
            type=int,
            default=getattr(view, name),
            metavar="PIXELS",
            help=f"{name} of pictures; default: {getattr(view, name)}",
        )


def view_of(arguments: argparse.Namespace) -> View:
    """The view that the options of `add_view_options` chose; raises InvalidArgument."""
    return View(arguments.camera, arguments.width, arguments.height)
