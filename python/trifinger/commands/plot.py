# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger log plot`."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from trifinger._trifinger import Log
from trifinger.commands.command_line import ArgumentParser, add_log_options, add_output, run, say
from trifinger.log.plot import plot


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(
        prog="trifinger log plot",
        description="Draw what happened in the newest session of a robot.",
        epilog="Example:\n  trifinger log plot run.mcap -o run.html",
    )
    add_log_options(parser)
    add_output(parser, ".png, .svg, .pdf or .html; default: LOG with .png")
    parser.add_argument(
        "--robot",
        metavar="NAME",
        default="",
        help="robot or companion; needed if a log has several robots",
    )
    return parser.parse_args(words)


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger log plot`."""
    arguments = parse(words)
    path = arguments.output or Path(f"{Path(arguments.log).resolve().stem}.png")

    def work() -> None:
        plot(Log(arguments.log), path, arguments.robot, arguments.from_, arguments.to)
        say(f"{path} written.")

    return run(work)
