# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger film`."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from trifinger import extras
from trifinger._trifinger import Log, LoggedSession
from trifinger.commands.command_line import (
    ArgumentParser,
    add_output,
    add_part_options,
    add_view_options,
    run,
    say,
    view_of,
)
from trifinger.errors import Error, InvalidArgument
from trifinger.log.camera_film import camera_film
from trifinger.log.film import film
from trifinger.log.manipulation import Trace


def recordings(path: Path) -> Iterator[Log]:
    """Yields the recording in a file, or all recordings in a folder, the newest first."""
    newest = Log(path)
    yield newest
    others: dict[str, list[Path]] = {}
    for file in sorted(path.glob("*.mcap")) if path.is_dir() else ():
        try:
            recording = Log(file).origin.get("recording", str(file))
        except Error:  # not a log
            continue
        if file not in newest.files:
            others.setdefault(recording, []).append(file)
    logs = [Log(parts) for parts in others.values()]
    # Log(folder) chooses the newest recording by the same order.
    yield from sorted(
        logs,
        key=lambda log: (log.origin["began"], log.origin.get("created", ""), log.files[0]),
        reverse=True,
    )


def find_session(
    path: Path, robot: str = "", wanted: int | None = None, trace: Trace | None = None
) -> LoggedSession:
    """Finds the session to draw in a log or a folder of logs.

    `wanted` is the session's number in the newest recording, or its id. Without it, the session is
    that of the report in `trace`; without a report, the newest session of `robot`. Raises
    InvalidArgument with a list of the sessions if there is no such session, or if the report
    belongs to another one.
    """
    reported: int | None = trace.report.get("session_id") if trace else None
    if trace and reported is None and wanted is None:
        raise InvalidArgument(
            f"the report in {trace.folder} was made by an earlier version and does not name its "
            "session; choose one by --session"
        )
    if wanted is None and reported is None:
        return Log(path).session(robot)
    known: list[str] = []
    for age, log in enumerate(recordings(path)):
        for number, session in enumerate(log.sessions, 1):
            is_meant = session.session_id == (reported if wanted is None else wanted)
            if (is_meant or (age, number) == (0, wanted)) and robot in ("", session.name):
                if trace and reported not in (None, session.session_id):
                    raise InvalidArgument(
                        f"the report in {trace.folder} is of session {reported}, not of "
                        f"{describe(number, session)}; without --session its own is drawn"
                    )
                return session
            known.append(f"  {log.files[0].name}: {describe(number, session)}")
    what = f"session {wanted}" if wanted is not None else f"the session {reported} of the report"
    whose = f" of '{robot}'" if robot else ""
    raise InvalidArgument(f"{path} does not have {what}{whose}. There are\n" + "\n".join(known))


def describe(number: int, session: LoggedSession) -> str:
    """A description such as "session 2 of 'sim' (12.34 s, id 1234)"."""
    steps = len(session.time_index)
    duration = f"{steps * session.period:.2f} s"
    return f"session {number} of '{session.name}' ({duration}, id {session.session_id})"


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger film`."""
    parser = ArgumentParser(
        prog="trifinger film",
        description="Draw a session: a film and a strip of pictures; with a report, a plot of it.",
        epilog="Example:\n"
        "  trifinger film logs                               the newest session\n"
        "  trifinger film logs --report manipulate_output    the session of the report\n"
        "  trifinger film logs --cameras                     what its cameras saw",
    )
    parser.add_argument("log", type=Path, help="a file, or a folder of recordings")
    add_part_options(parser)
    add_output(parser, "folder; default: the report's, or film", "FOLDER")
    parser.add_argument("--report", type=Path, help="folder that `trifinger manipulate` wrote")
    parser.add_argument("--robot", metavar="NAME", default="", help="needed if a log has several")
    parser.add_argument(
        "--session",
        type=int,
        metavar="N|ID",
        help="number or id, as `trifinger log info` shows them; default: the report's, or the "
        "newest",
    )
    parser.add_argument(
        "--cameras",
        action="store_true",
        help="only cameras.mp4: what the robot's cameras saw, above a plot with the same time",
    )
    add_view_options(parser)
    arguments = parser.parse_args(words)

    def work() -> None:
        extras.require("film")
        view, part = view_of(arguments), (arguments.from_, arguments.to)
        trace = Trace(arguments.report) if arguments.report else None
        session = find_session(arguments.log, arguments.robot, arguments.session, trace)
        output = arguments.output or arguments.report or Path("film")
        if arguments.cameras:
            say(f"{camera_film(session, output, *part)} written.", flush=True)
            return
        for path in film(session, output, trace, view, *part):
            say(f"{path} written.", flush=True)

    return run(work)
