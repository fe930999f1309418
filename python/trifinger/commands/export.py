# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger log export`."""

import argparse
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

from trifinger._trifinger import Log, LoggedSession
from trifinger.commands import program
from trifinger.commands.command_line import ArgumentParser, add_log_options, add_output, run, say
from trifinger.errors import InvalidArgument
from trifinger.log import original
from trifinger.log.images import save_images
from trifinger.log.steps import step_range
from trifinger.log.tables import SERIES, to_csv, to_parquet
from trifinger.whole_file import whole_file

WRITERS = {"csv": to_csv, "parquet": to_parquet}


def sessions_of(log: Log, name: str | None) -> list[LoggedSession]:
    """All sessions and companions, or only those called `name`."""
    all_sessions = [one for session in log.sessions for one in [session, *session.companions]]
    if name is None:
        return all_sessions
    log.session(name)  # raises with the names there are
    return [session for session in all_sessions if session.name == name]


def names_of(sessions: Sequence[LoggedSession]) -> list[str]:
    """Names for the files of sessions: "sim", and "sim.2" for the second session of that name."""
    names: list[str] = []
    for i, session in enumerate(sessions):
        number = 1 + sum(before.name == session.name for before in sessions[:i])
        names.append(session.name if number == 1 else f"{session.name}.{number}")
    return names


def export(arguments: argparse.Namespace) -> int:
    """Writes a file for each session and companion; returns the exit status."""
    if arguments.format == "mcap":
        words = [program.path(), "log", "cut", arguments.log]
        words += ["-o", str(arguments.output or f"{Path(arguments.log).stem}.copy.mcap")]
        for option in ("robot", "from_", "to"):
            if (value := getattr(arguments, option)) is not None:
                words += [f"--{option.rstrip('_')}", str(value)]
        return subprocess.run(words, check=False).returncode

    log = Log(arguments.log)
    if arguments.images is not None:
        session = log.session(arguments.robot or "")
        first, last = step_range(session, arguments.from_, arguments.to)
        count = save_images(session, arguments.images, first, last)
        say(f"{arguments.images} has {count} images and images.csv.")
        return 0
    if arguments.format == "original":
        session = log.session(arguments.robot or "")
        first, last = step_range(session, arguments.from_, arguments.to)
        for path in original.export(session, arguments.output or Path(), first, last):
            say(f"{path} written.")
        return 0
    output = arguments.output or Path()
    kind = output.suffix.removeprefix(".")
    if kind in WRITERS:
        if arguments.format not in (None, kind):
            raise InvalidArgument(f"--format is {arguments.format}, but {output} ends in .{kind}")
        _export_session(log.session(arguments.robot or ""), output, WRITERS[kind], arguments)
        return 0
    output.mkdir(parents=True, exist_ok=True)
    stem = Path(arguments.log).resolve().stem
    sessions = sessions_of(log, arguments.robot)
    kind = arguments.format or "csv"
    for session, name in zip(sessions, names_of(sessions), strict=True):
        _export_session(session, output / f"{stem}.{name}.{kind}", WRITERS[kind], arguments)
    return 0


def _export_session(
    session: LoggedSession, path: Path, write: Callable[..., None], arguments: argparse.Namespace
) -> None:
    series = None if session.is_companion else arguments.series
    first, last = step_range(session, arguments.from_, arguments.to)
    with whole_file(path) as part:
        write(session, part, first, last, series)
    say(f"{path} written.", flush=True)


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(
        prog="trifinger log export",
        description="Write the sessions and companions of a log as tables: a row per step.",
        epilog="Example:\n  trifinger log export run.mcap -o run.csv\n"
        "  trifinger log export run.mcap --format parquet -o tables\n"
        "  trifinger log export run.mcap --images images",
    )
    add_log_options(parser)
    parser.add_argument(
        "--format",
        choices=[*WRITERS, "mcap", "original"],
        help="default: the ending of the output, or csv; parquet needs pyarrow; mcap is a copy; "
        "original is robot_data.dat and camera_data.dat of the original stack",
    )
    add_output(
        parser,
        "a file (.csv, .parquet) for the newest session, or a folder for all sessions",
        "PATH",
    )
    parser.add_argument(
        "--images",
        type=Path,
        metavar="FOLDER",
        help="instead of tables: write each image of the newest session as a file into it, and a "
        "table of them; the folder can be a source of images",
    )
    parser.add_argument("--robot", metavar="NAME", help="only the robot or companion of this name")
    parser.add_argument(
        "--series", nargs="+", choices=list(SERIES), help="only these series; default: all"
    )
    return parser.parse_args(words)


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger log export`."""
    arguments = parse(words)
    return run(lambda: export(arguments))
