# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger demo`: a simulated TriFinger lifts a cube by 20 cm, holds it and puts it down.

The back-end runs at 1 kHz and records itself. The controller is `trifinger manipulate lift`. Each
runs in its own process. With `--emulated` the robot has motor boards, which `trifinger emulate`
emulates in a third one. A folder keeps the log, a picture of the scene, plots, and the report.
"""

import argparse
import contextlib
import itertools
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import trifinger
from trifinger import extras
from trifinger.commands import command_line, program
from trifinger.commands.command_line import (
    ArgumentParser,
    add_output,
    add_view_options,
    say,
    view_of,
)
from trifinger.log.film import Scene
from trifinger.log.manipulation import Trace, save_report
from trifinger.log.plot import plot
from trifinger.picture import View
from trifinger.session_info import session_folder
from trifinger.whole_file import whole_file

EMULATED = "trifinger_edu_emulated"
# With fingers at the default height, a cube lifted by 19 cm would hit them.
SETTINGS = ["--set", "fingers.height=0.3"]
HOLD_TIME = 3.0  # [s]
VIEW = View("115,-20", 960, 720)  # two faces of the cube


def is_running(name: str) -> bool:
    """True if the robot `name` has a back-end that lives."""
    sessions = trifinger.list_sessions()
    return any(session.name == name and session.backend_is_alive for session in sessions)


def free_name() -> str:
    """A name that no robot has: `demo`, or with a number if others show the demo, too."""
    folder = session_folder()
    for number in itertools.count(1):
        name = "demo" if number == 1 else f"demo{number}"
        files = folder.glob(f"trifinger*.{name}.*")
        if not is_running(name) and not any(is_of_another(file) for file in files):
            return name
    raise AssertionError


def is_of_another(path: Path) -> bool:
    """True if a file belongs to another user; it may have gone, as that user's robot ends."""
    with contextlib.suppress(FileNotFoundError):
        return path.lstat().st_uid != os.geteuid()
    return False


@contextlib.contextmanager
def running(*words: str) -> Iterator[subprocess.Popen[str]]:
    """Runs `trifinger WORDS` in its own process, for as long as the block and this process last.

    Ctrl-C does not reach it, so that the controller can put the cube down first.
    """
    with subprocess.Popen(
        [program.path(), *words, "--with-process", str(os.getpid())],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        process_group=0,
    ) as process:
        try:
            yield process
        finally:
            process.terminate()
            process.wait()


@contextlib.contextmanager
def back_end(folder: Path, mode: str, robot: str, name: str) -> Iterator[None]:
    """Runs the robot `name`, and what it needs, for as long as the block lasts.

    The robot records itself into `folder`.
    """
    named = [robot, "--name", name, *SETTINGS]
    with contextlib.ExitStack() as programs:
        if robot == EMULATED:
            programs.enter_context(running("emulate", *named))
        process = programs.enter_context(running("run", *named, mode, "--record", str(folder)))
        while not is_running(name):
            if process.poll() is not None:
                output = process.stdout.read() if process.stdout else ""
                raise trifinger.Error(f"`trifinger run {robot}` ended at once and said:\n{output}")
            time.sleep(0.01)
        if robot == EMULATED:
            say("The robot finds the zeros of its joints at their end stops.", flush=True)
        trifinger.observe(name).latest_observation()  # once it holds its pose
        yield


def lift(folder: Path, name: str) -> int:
    """Runs the controller and returns its exit status; Ctrl-C lets it put the cube down first."""
    words = [program.path(), "manipulate", "lift", "--robot", name, "--output", str(folder)]
    words += ["--set", f"lift.hold_time={HOLD_TIME}"]
    with subprocess.Popen(words) as process:
        try:
            return process.wait()
        except KeyboardInterrupt:
            process.wait()
            raise


def table(session: trifinger.LoggedSession, folder: Path) -> str:
    """The figures of the run, one per line."""
    statuses = session.statuses
    report = json.loads((folder / "report.json").read_text())
    duration = (statuses["time"][-1] - statuses["time"][0]) * 1e-9
    repeats = int(np.count_nonzero(statuses["flags"] & trifinger.Status.ACTION_REPEATED))
    timing = session.timing()  # None outside real-time mode
    lateness = (
        [
            ("lateness, median", f"{1e3 * timing.lateness().quantile(0.5):.3f} ms"),
            ("lateness, worst", f"{1e3 * timing.lateness().max():.3f} ms"),
        ]
        if timing is not None
        else []
    )
    rows = [
        ("steps", f"{len(statuses)}"),
        ("rate", f"{(len(statuses) - 1) / duration:.2f} Hz"),
        *lateness,
        ("repeated actions", f"{repeats}"),
        ("cube lifted by", f"{1e2 * report['height']:.1f} cm"),
        ("its error, rms", f"{1e3 * report['position_rms']:.2f} mm"),
    ]
    return "\n".join(f"  {name:<18}{value:>14}" for name, value in rows)


def save_scene(session: trifinger.LoggedSession, trace: Trace, path: Path, view: View) -> None:
    """Saves a picture of the scene while the cube is held, or of the end if it was never held."""
    import matplotlib.image

    steps = trace.columns["step"].astype(int)
    held = [step for step, phase in zip(steps, trace.phases, strict=True) if phase == "hold"]
    step = held[len(held) // 2] if held else len(session.observations) - 1
    with contextlib.closing(Scene(session, view=view)) as scene:
        picture = scene.image(int(step))
    with whole_file(path) as part:
        matplotlib.image.imsave(part, picture)


def newest_log(folder: Path, name: str) -> Path:
    """The newest log in `folder`: names contain the date. Returns `folder` if there is none."""
    return max(folder.glob(f"{name}_*.mcap"), default=folder)


def draw(log: trifinger.Log, folder: Path, name: str, view: View) -> Iterator[Path]:
    """Draws the run and yields the path of each picture. Raises Error if it cannot be drawn."""
    extras.require("demo", "matplotlib")
    session, trace = log.session(name), Trace(folder)
    save_report(trace, folder / "report.png")
    yield folder / "report.png"
    plot(log, folder / "plot.png")
    yield folder / "plot.png"
    save_scene(session, trace, folder / "scene.png", view)
    yield folder / "scene.png"


def print_what_next(path: Path, folder: Path) -> None:
    """Prints commands to try next; they work in the shell that started the demo."""
    lines = []
    if sys.prefix != sys.base_prefix and os.environ.get("VIRTUAL_ENV") != sys.prefix:
        lines.append((f"source {sys.prefix}/bin/activate", "lets this terminal find `trifinger`"))
    lines.append((f"trifinger film {path} --report {folder}", "a film of it"))
    lines.append(("trifinger --help", "what else there is"))
    width = max(len(words) for words, _ in lines)
    say("\nTo go on:")
    say(*(f"  {words:<{width}}  # {what}" for words, what in lines), sep="\n")


def run(arguments: argparse.Namespace) -> int:
    """Runs the demo and returns the exit status of the controller."""
    view = view_of(arguments)
    folder: Path = arguments.output
    folder.mkdir(parents=True, exist_ok=True)
    name = free_name()
    for left in ("report.json", "trace.csv"):  # from an earlier demo
        (folder / left).unlink(missing_ok=True)
    try:
        with back_end(folder, arguments.mode, arguments.robot, name):
            say(f"The robot '{name}' runs in a process of its own; another one moves it.")
            say(f"To see it meanwhile: trifinger view {name}   # in another terminal")
            sys.stdout.flush()
            status = lift(folder, name)
    except KeyboardInterrupt:
        say(f"Log:      {newest_log(folder, name)}")
        raise
    path = newest_log(folder, name)
    if not (folder / "report.json").exists():  # the controller has printed why
        say(f"Log:      {path}")
        return status
    log = trifinger.Log(path)
    # Flushed, because the next lines come from another process.
    say(f"\n{table(log.session(name), folder)}\n", flush=True)
    subprocess.run([program.path(), "log", "info", path], check=True)

    say(f"\nLog:      {path}", flush=True)
    try:
        for picture in draw(log, folder, name, view):
            say(f"Picture:  {picture}", flush=True)
    except trifinger.Error as error:
        say(f"Not drawn: {error}", flush=True)
    print_what_next(path, folder)
    return status


def main() -> int:
    """`trifinger demo`."""
    parser = ArgumentParser(
        prog="trifinger demo",
        description="Lift a cube with a simulated robot, and draw what has happened.",
        epilog="Example:\n  trifinger demo --output demo_output",
    )
    add_output(
        parser,
        "folder of the log, the report and the pictures; default: demo_output",
        "FOLDER",
        default=Path("demo_output"),
    )
    parser.add_argument(
        "--non-real-time",
        dest="mode",
        action="store_const",
        const="--non-real-time",
        default="--real-time",
        help="as fast as the machine can; the robot waits for its controller",
    )
    parser.add_argument(
        "--emulated",
        dest="robot",
        action="store_const",
        const=EMULATED,
        default="sim",
        help="a robot on emulated motor boards, which runs in real time only",
    )
    add_view_options(parser, VIEW)
    arguments = parser.parse_args()
    if arguments.robot == EMULATED and arguments.mode == "--non-real-time":
        parser.error("--emulated runs in real time only, so --non-real-time cannot be given")
    return command_line.run(lambda: run(arguments))
