# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger demo`: a simulated TriFinger lifts a cube by 20 cm, holds it and puts it down.

A back-end at 1 kHz that records itself, and `trifinger manipulate lift`, the controller, each in a
process of its own. A folder keeps the log, a picture of the scene, plots, and the report.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import trifinger
from trifinger import plot, program
from trifinger.film import Scene, Trace, save_report
from trifinger.picture import View, add_view_options, view_of

NAME = "demo"
HOLD_TIME = 3.0  # [s]
VIEW = View("115,-20", 960, 720)  # two faces of the cube


@contextlib.contextmanager
def back_end(folder: Path, mode: str) -> Iterator[None]:
    """A simulated robot in a process of its own, for as long as the block lasts.

    It records itself into `folder`. Ctrl-C is not for it: who uses it lets go of it first.
    """
    command = [program.path(), "run", "sim", mode, "--name", NAME, "--record", str(folder)]
    command += ["--set", "fingers.height=0.3"]  # as built they meet the cube at 19 cm
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        process_group=0,
    ) as process:
        try:
            while NAME not in (session.name for session in trifinger.list_sessions()):
                if process.poll() is not None:
                    output = process.stdout.read() if process.stdout else ""
                    raise trifinger.Error(
                        f"`{' '.join(command)}` ended at once and said:\n{output}"
                    )
                time.sleep(0.01)
            yield
        finally:
            process.terminate()
            process.wait()


def lift(folder: Path) -> int:
    """Runs the controller and returns its exit status; Ctrl-C lets it put the cube down first."""
    command = [program.path(), "manipulate", "lift", "--robot", NAME, "--output", str(folder)]
    command += ["--set", f"lift.hold_time={HOLD_TIME}"]
    with subprocess.Popen(command) as process:
        try:
            return process.wait()
        except KeyboardInterrupt:
            process.wait()
            raise


def table(session: trifinger.LoggedSession, folder: Path) -> str:
    """What there is to say about the run in a few lines."""
    statuses = session.statuses
    report = json.loads((folder / "report.json").read_text())
    duration = (statuses["time"][-1] - statuses["time"][0]) * 1e-9
    repeats = int(np.count_nonzero(statuses["flags"] & trifinger.Status.ACTION_REPEATED))
    timing = session.timing()  # none outside real-time mode
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
    """A picture of the scene while the cube is held; if it never was, of the end."""
    import matplotlib.image

    steps = trace.columns["step"].astype(int)
    held = [step for step, phase in zip(steps, trace.phases, strict=True) if phase == "hold"]
    step = held[len(held) // 2] if held else len(session.observations) - 1
    with contextlib.closing(Scene(session, view=view)) as scene:
        matplotlib.image.imsave(path, scene.image(int(step)))


def newest_log(folder: Path) -> Path:
    """Names of logs have the date in them: the last is the newest. The folder, if there is none."""
    return max(folder.glob(f"{NAME}_*.mcap"), default=folder)


def main() -> int:
    """Runs the demo."""
    parser = argparse.ArgumentParser(prog="trifinger demo", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("demo_output"),
        help="folder of the log, the report and the pictures",
    )
    parser.add_argument(
        "--non-real-time",
        dest="mode",
        action="store_const",
        const="--non-real-time",
        default="--real-time",
        help="as fast as the machine can; the robot waits for its controller",
    )
    add_view_options(parser, VIEW)
    arguments = parser.parse_args()
    folder: Path = arguments.output
    folder.mkdir(parents=True, exist_ok=True)
    for left in ("report.json", "trace.csv"):  # by a demo before this one
        (folder / left).unlink(missing_ok=True)

    try:
        view = view_of(arguments)
        with back_end(folder, arguments.mode):
            print(f"The robot '{NAME}' runs in a process of its own; another one moves it.")
            sys.stdout.flush()
            status = lift(folder)
    except trifinger.Error as error:
        print(f"trifinger demo: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"Log:      {newest_log(folder)}")
        return 130
    path = newest_log(folder)
    if not (folder / "report.json").exists():  # the controller has said why
        print(f"Log:      {path}")
        return status
    log = trifinger.Log(path)
    session = log.session(NAME)
    trace = Trace(folder)
    print(f"\n{table(session, folder)}\n", flush=True)  # before the lines of another process
    subprocess.run([program.path(), "log", "info", path], check=True)

    pictures = [folder / name for name in ("scene.png", "report.png", "plot.png")]
    save_scene(session, trace, pictures[0], view)
    save_report(trace, pictures[1])
    plot.plot(log, pictures[2])
    print(f"\nLog:      {path}\nPictures: {', '.join(map(str, pictures))}")
    print(f"A film:   trifinger film {path} --report {folder}")
    return status


if __name__ == "__main__":
    sys.exit(main())
