# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger teach`."""

import argparse
import os
import select
import sys
import tempfile
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import trifinger
from trifinger.commands import command_line
from trifinger.commands.command_line import ArgumentParser, add_output, add_robot, say
from trifinger.errors import InvalidArgument
from trifinger.progress import Line

from trifinger_view.teaching import LONGEST, Recording, Teaching

LOOK_EVERY = 0.1  # how soon the thread of the terminal notices that it is no longer needed [s]


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(
        prog="trifinger teach",
        description="Let a robot float, and record what a hand does with it.",
        epilog="Example:\n"
        "  trifinger run trifinger_pro --name robot       in one terminal\n"
        "  trifinger teach robot -o wave.motion           in another; Enter ends the recording\n"
        "  trifinger motion play wave.motion --robot robot",
    )
    add_robot(parser)
    add_output(parser, "file of the motion", required=True)
    parser.add_argument(
        "--seconds", type=float, metavar="S", help="end by itself after this time of recording"
    )
    parser.add_argument("--force", action="store_true", help="replace a file that is there")
    return parser.parse_args(words)


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger teach`."""
    arguments = parse(words)
    return command_line.run(lambda: teach(arguments))


def teach(arguments: argparse.Namespace) -> None:
    """Records a motion and writes it."""
    robot: str = arguments.robot
    seconds: float | None = arguments.seconds
    output: Path = arguments.output
    if seconds is not None and not 0 < seconds <= LONGEST:
        raise InvalidArgument(f"--seconds is {seconds:g}, must be above 0 and at most {LONGEST:g}")
    require_writable(output, may_replace=arguments.force)
    teaching: Teaching | None = None
    with command_line.ended_by_signals():
        try:
            with trifinger.guide(robot) as guide:
                command_line.wait_until_measured(guide, robot)
                teaching = Teaching(guide)
                record(teaching, robot, seconds)
        finally:
            # Whatever happened, what a hand has done is not lost.
            if teaching is not None:
                save(teaching.recording(), output, may_replace=arguments.force)
    say(
        f"The session of '{robot}' has ended, so the robot comes to rest as its configuration "
        "says.\n"
        "To go on:\n"
        f"  trifinger motion info {output}\n"
        f"  trifinger motion play {output} --robot {robot}"
    )


def record(teaching: Teaching, robot: str, seconds: float | None) -> None:
    """Records until somebody presses Enter or Ctrl-C, or until the time is over."""
    ends = "Enter or Ctrl-C ends the recording" + (f", or {seconds:g} s" if seconds else "")
    say(f"The robot '{robot}' floats: a hand can move it. {ends}.", flush=True)
    is_over = threading.Event()
    try:
        with Line() as line, suppress(KeyboardInterrupt):
            teaching.run(
                lambda: wait_for_enter(is_over, has_other_end=seconds is not None),
                duration=seconds,
                watch=lambda duration: line.show(f"  {duration:.1f} s"),
            )
    finally:
        is_over.set()
    say("The robot holds its pose.", flush=True)


def wait_for_enter(is_over: threading.Event, *, has_other_end: bool) -> None:
    """Waits for a line on standard input, or until the recording is over."""
    while not is_over.is_set():
        if not select.select([sys.stdin], [], [], LOOK_EVERY)[0]:
            continue
        text = os.read(sys.stdin.fileno(), 4096)
        if b"\n" in text:
            return
        if not text:  # nobody can press Enter
            if has_other_end:
                is_over.wait()
            return


def require_writable(output: Path, *, may_replace: bool) -> None:
    """Raises an error if a file cannot be written, before anybody has moved a finger for it."""
    if output.exists() and not may_replace:
        raise InvalidArgument(f"{output} exists; --force replaces it")
    if output.exists() and not output.is_file():
        raise InvalidArgument(f"{output} is not a file")
    with tempfile.TemporaryFile(dir=output.parent):
        pass


def save(recording: Recording, output: Path, *, may_replace: bool) -> None:
    """Writes what was recorded, and says so."""
    if len(recording.times) < 2:
        say(f"Nothing was recorded, so {output} is not written.", flush=True)
        return
    recording.motion().save(output, overwrite=may_replace)
    say(f"{output} written: {recording.duration:.1f} s.", flush=True)
