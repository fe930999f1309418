# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger export lerobot` and `trifinger export minari`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from trifinger import extras
from trifinger._trifinger import Log
from trifinger.commands.command_line import ArgumentParser, add_output, run, say
from trifinger.commands.film import recordings
from trifinger.errors import InvalidArgument

from trifinger_data_sets import LEROBOT, MINARI
from trifinger_data_sets.episodes import Episode, find_episodes, find_marks
from trifinger_data_sets.rows import Choice


def report(sentence: str) -> None:
    """Reports what is special about the logs."""
    say(f"trifinger export: {sentence}", file=sys.stderr, flush=True)


def logs_of(paths: Sequence[Path]) -> list[Log]:
    """All recordings in files and folders, the oldest of a folder first; each one once."""
    found: list[Log] = []
    for path in paths:
        for log in reversed(list(recordings(path))):
            if log.files not in [one.files for one in found]:
                found.append(log)
    return found


def episodes_of(arguments: argparse.Namespace) -> list[Episode]:
    """The episodes that the options choose."""
    logs = logs_of(arguments.log)
    marks: list[Path] | None = None
    if arguments.episodes == "marks" or arguments.marks:
        marks = arguments.marks or find_marks(logs)
        if not marks:
            raise InvalidArgument(
                "no file of marks (*.episodes.jsonl) is beside the logs; --marks FILE names one, "
                "and without --episodes marks each session is an episode"
            )
    return find_episodes(
        logs,
        robot=arguments.robot,
        task=arguments.task,
        marks=marks,
        begin=arguments.from_,
        end=arguments.to,
        say=report,
    )


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds what both formats have in common."""
    parser.add_argument("log", type=Path, nargs="+", help="files, or folders of recordings")
    parser.add_argument("--robot", default="", metavar="NAME", help="needed if logs have several")
    parser.add_argument(
        "--episodes",
        choices=("sessions", "marks"),
        default="sessions",
        help="what an episode is: a session (default), or a mark in the files *.episodes.jsonl "
        "beside the logs",
    )
    parser.add_argument(
        "--marks", type=Path, action="append", default=[], metavar="FILE", help="a file of marks"
    )
    parser.add_argument(
        "--task", default="", metavar="SENTENCE", help="what was done, where no mark says so"
    )
    for name, what in (("from", "begin"), ("to", "end")):
        parser.add_argument(
            f"--{name}",
            dest="from_" if name == "from" else name,
            type=float,
            metavar="SECONDS",
            help=f"{what} of each session, since its first step",
        )
    parser.add_argument(
        "--rate", type=int, metavar="HZ", help="rows per second; default: that of cameras, or 30"
    )
    parser.add_argument(
        "--cameras",
        nargs="*",
        metavar="NAME",
        help="only these cameras; with no name none; default: all",
    )
    parser.add_argument(
        "--action",
        nargs="+",
        metavar="FIELD",
        help="fields of the desired action; default: those that were used",
    )
    parser.add_argument(
        "--companions",
        nargs="*",
        metavar="NAME",
        help="sensors with a rate of their own, such as object; default: all, without the scene of "
        "a simulation",
    )
    parser.add_argument("--force", action="store_true", help="replace what is there")


def choice_of(arguments: argparse.Namespace) -> Choice:
    """What the options choose of the logs."""
    return Choice(
        rate=arguments.rate,
        cameras=arguments.cameras,
        action=arguments.action,
        companions=arguments.companions,
        high_rate=arguments.high_rate,
    )


def export_lerobot(arguments: argparse.Namespace) -> None:
    """Writes a LeRobotDataset."""
    extras.require(*LEROBOT)
    from trifinger_data_sets import lerobot

    result = lerobot.write(
        episodes_of(arguments),
        arguments.output,
        choice=choice_of(arguments),
        images=arguments.images,
        encoder=arguments.encoder,
        force=arguments.force,
        say=report,
    )
    say(f"{arguments.output} written: {result}.")


def export_minari(arguments: argparse.Namespace) -> None:
    """Writes a data set of Minari."""
    extras.require(*MINARI)
    from trifinger_data_sets import minari

    result = minari.write(
        episodes_of(arguments),
        arguments.output,
        choice=choice_of(arguments),
        observation=arguments.observation,
        high_rate=arguments.high_rate,
        about=minari.About(
            author=arguments.author,
            author_email=arguments.author_email,
            algorithm_name=arguments.algorithm,
            code_permalink=arguments.code,
            description=arguments.description,
        ),
        force=arguments.force,
        say=report,
    )
    say(f"{result.path} written: {result}.")


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(
        prog="trifinger export",
        description="Write logs as a data set for learning (docs/data_sets.md).",
        epilog="Example:\n"
        '  trifinger export lerobot logs -o push --task "Push the cube to the middle"\n'
        "  trifinger export minari logs --episodes marks -o trifinger/reach-v0",
    )
    formats = parser.add_subparsers(dest="format", required=True, metavar="FORMAT")
    lerobot = formats.add_parser(
        "lerobot",
        help="LeRobotDataset v3.0",
        description="Write a LeRobotDataset, version 3.0: rows at a fixed rate, images as films.",
    )
    add_lerobot_options(lerobot)
    minari = formats.add_parser(
        "minari",
        help="a data set of Minari",
        description="Write a data set of Minari, in HDF5 and without loss, where Minari finds it: "
        "in $MINARI_DATASETS_PATH, or ~/.minari/datasets.",
    )
    add_minari_options(minari)
    return parser.parse_args(words)


def add_lerobot_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `trifinger export lerobot`."""
    add_options(parser)
    add_output(parser, "folder of the data set", "FOLDER", required=True)
    parser.add_argument(
        "--images",
        choices=("video", "image"),
        default="video",
        help="films (default), or a PNG of each image, which loses nothing",
    )
    parser.add_argument("--encoder", metavar="NAME", help="of films; default: libsvtav1 if there")
    parser.add_argument(
        "--no-high-rate",
        dest="high_rate",
        action="store_false",
        help="leave out the steps between the rows",
    )
    parser.set_defaults(work=export_lerobot)


def add_minari_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `trifinger export minari`."""
    add_options(parser)
    parser.add_argument(
        "-o", "--output", required=True, metavar="ID", help="its name, such as trifinger/reach-v0"
    )
    parser.add_argument(
        "--observation",
        choices=("environment", "flat", "dictionary"),
        help="what the environment saw that has made the episodes (default if there is one), or "
        "what the robot measured: a vector, or a dictionary, which also has images",
    )
    parser.add_argument(
        "--high-rate", action="store_true", help="also keep the steps between the rows, in infos"
    )
    for name, what in (
        ("author", "who has made it"),
        ("author-email", "whom to ask"),
        ("algorithm", "what has chosen the actions"),
        ("code", "a link to the program that has made it"),
        ("description", "what it is for"),
    ):
        parser.add_argument(f"--{name}", metavar="TEXT", help=what)
    parser.set_defaults(work=export_minari)


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger export`."""
    arguments = parse(words)
    return run(lambda: arguments.work(arguments))
