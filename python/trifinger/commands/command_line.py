# SPDX-License-Identifier: BSD-3-Clause
"""What the command lines of all commands share."""

import argparse
import contextlib
import json
import signal
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn, TextIO

import trifinger_launcher

from trifinger._trifinger import Guide, list_sessions, running_robot
from trifinger.errors import Error, InvalidArgument, TimedOut
from trifinger.picture import CAMERAS, View
from trifinger.text import printable, printable_lines

LONGEST = 10_000  # characters that are printed at once
WIDTH = 100  # of help [characters]
COLUMN = 30  # where descriptions begin [characters]


_program = "trifinger"  # and the command, once its words are parsed


class _Formatter(argparse.HelpFormatter):
    """Help in the form of the commands in C++, which apps/shared/command_line.cpp prints."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=COLUMN, width=WIDTH)
        self._action_max_length = COLUMN

    def _format_usage(
        self, _usage: str | None, actions: Iterable[argparse.Action], *_others: object
    ) -> str:
        words = []
        for action in actions:
            if not action.option_strings:
                name = self._metavar_formatter(action, action.dest.upper())(1)[0]
                name += "..." if action.nargs in ("+", "*") else ""
                words.append(f"[{name}]" if action.nargs in ("?", "*") else name)
        return " ".join(["Usage:", self._prog, "[OPTIONS]", *words]) + "\n\n"

    def _fill_text(self, text: str, width: int, *_indent: str) -> str:
        lines = (textwrap.wrap(line, width) or [""] for line in text.splitlines())
        return "\n".join(line for part in lines for line in part)

    def start_section(self, heading: str | None) -> None:
        super().start_section(sentence(heading or ""))

    def _format_action(self, action: argparse.Action) -> str:
        if isinstance(action, argparse._SubParsersAction):
            return "".join(map(self._format_action, action._get_subactions()))
        return super()._format_action(action)

    def _format_action_invocation(self, action: argparse.Action) -> str:
        value = self._metavar_formatter(action, action.dest.upper())(1)[0]
        if not action.option_strings:
            return value
        names = ", ".join(action.option_strings)
        return names if action.nargs == 0 else f"{names} {value}"

    def _metavar_formatter(
        self, action: argparse.Action, default_metavar: str
    ) -> Callable[[int], tuple[str, ...]]:
        choices = "|".join(map(str, action.choices or ()))
        shown = str(action.metavar or choices or default_metavar)
        return lambda count: (shown,) * count

    def _get_help_string(self, action: argparse.Action) -> str:
        needed = "; required" if action.required and action.option_strings else ""
        return sentence(action.help or "") + needed


class ArgumentParser(argparse.ArgumentParser):
    """The parser of all commands: it says help and errors as the commands in C++ do.

    No terminal obeys the words that it refuses.
    """

    def __init__(self, *, examples: str = "", **settings: Any) -> None:
        common: dict[str, Any] = {"formatter_class": _Formatter, "allow_abbrev": False}
        super().__init__(add_help=False, **common | settings)
        if own := [line for line in examples.splitlines() if line.startswith(f"  {self.prog} ")]:
            self.epilog = "\n".join(["Example:", *own])
        self._positionals.title = "Arguments"
        self._optionals.title = "Options"
        self.robots: dict[argparse.Action, bool] = {}  # and whether the command waits for it
        self.add_argument("-h", "--help", action="help", help="print this help")

    def add_subparsers(self, **settings: Any) -> Any:
        """Adds commands below this one."""
        parser = partial(ArgumentParser, examples=self.epilog or "")  # those of the command
        common: dict[str, Any] = {"title": "Commands", "prog": self.prog, "parser_class": parser}
        return super().add_subparsers(**common | settings)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parses the words, and finds the robots that they leave out."""
        global _program
        _program = self.prog
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"The following argument was not expected: {' '.join(unknown)}")
        for robot, waits in self.robots.items():
            name = getattr(found, robot.dest)
            try:
                setattr(found, robot.dest, name if waits and name else running_robot(name))
            except (Error, OSError) as error:
                raise SystemExit(report(error)) from None
        return found, unknown

    def error(self, message: str) -> NoReturn:
        """Prints what is wrong with the words, and ends the command."""
        self.exit(2, printable(f"{self.prog}: {message}; '{self.prog} --help' tells more") + "\n")


def add_robot(parser: ArgumentParser, *names: str, waits: bool = False) -> None:
    """Adds NAME or, with `names`, an option: the running robot that a command is for.

    If it is left out, it is the only robot that runs. One that does not run is refused at once,
    unless the command waits for it.
    """
    settings: dict[str, Any] = {} if names else {"nargs": "?"}
    action = parser.add_argument(
        *names or ("robot",),
        default="",
        metavar="NAME",
        help="name of the running robot; default: the only one that runs",
        **settings,
    )
    parser.robots[action] = waits


def names_of_robots() -> list[str]:
    """The robots that run on this machine."""
    return [one.name for one in list_sessions() if one.backend_is_alive and not one.is_companion]


def add_output(
    parser: argparse._ActionsContainer, text: str, what: str = "FILE", **settings: Any
) -> None:
    """Adds -o and --output, a file or a folder that is written."""
    parser.add_argument("-o", "--output", type=Path, metavar=what, help=text, **settings)


def add_json(parser: argparse.ArgumentParser) -> None:
    """Adds --json, of a command that reports; `say_json` prints the report."""
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object, for programs; SI units"
    )


def say_json(report: Mapping[str, Any]) -> None:
    """Prints a report for programs."""
    sys.stdout.write(json.dumps(report, indent=2) + "\n")


def sentence(text: str) -> str:
    """The text with a capital letter, unless it begins with a name in quotes or the like."""
    return text[:1].upper() + text[1:]


def status_of(error: Error) -> int:
    """The exit status that an error gives: 2 for what the user has typed."""
    return 2 if isinstance(error, InvalidArgument) else 1


def run(work: Callable[[], int | None]) -> int:
    """Does the work of a command and returns its exit status; prints an error as one sentence."""
    try:
        with trifinger_launcher.interruptible():
            try:
                return work() or 0
            finally:
                sys.stdout.flush()  # after this block Ctrl-C would lose it
    except (Error, OSError) as error:
        return report(error)
    except KeyboardInterrupt:
        return 130


def report(error: Error | OSError) -> int:
    """Prints an error as one sentence, and returns the exit status of a command that it ends."""
    sentence = str(error)
    if isinstance(error, OSError) and error.strerror:
        sentence = f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    say(f"{_program}: {sentence}", file=sys.stderr)
    return status_of(error) if isinstance(error, Error) else 1


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
        help=f"one of {', '.join(CAMERAS)}, a camera of the model such as camera60, or two angles "
        f"in degrees; default: {view.camera}",
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
