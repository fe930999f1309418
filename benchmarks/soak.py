# SPDX-License-Identifier: BSD-3-Clause
"""The parts of `./run soak` that are not tests: kills of any process, and memory over time."""

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import trifinger
from measuring import Measure, folders, run
from python_measures import PATIENCE, back_end, recorder
from rows import Row

# A controller at 1 kHz. It runs until it is killed, whatever happens to its robot.
CONTROLLER = """
import sys, trifinger
with trifinger.connect(sys.argv[1]) as robot:
    action = robot.new_action(position=robot.latest_observation().position)
    t = robot.append_desired_action(action)
    while True:
        robot.get_observation(t)
        t = robot.append_desired_action(action)
"""


@dataclass
class Usage:
    """Samples of something that must not grow: the largest value of each window."""

    name: str
    unit: str
    read: Callable[[], float]
    bound: float  # growth from the first window to the largest of the others
    windows: list[float] = field(default_factory=list)

    @property
    def growth(self) -> float:
        """Returns how much larger it was in the last window than in the first."""
        return self.windows[-1] - self.windows[0]


def resident(pid: int) -> float:
    """Returns the memory that a process has to itself and uses [MiB]."""
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    values = {words[0]: int(words[1]) for words in map(str.split, lines[1:])}
    return (values["Private_Clean:"] + values["Private_Dirty:"]) / 1024


def descriptors(pid: int) -> float:
    """Returns the number of files that a process has open."""
    return len(list(Path(f"/proc/{pid}/fd").iterdir()))


def shared_memory(name: str) -> float:
    """Returns the size of the files of a session [MiB]."""
    files = Path("/dev/shm").glob(f"*trifinger.{name}.*")  # noqa: S108, where sessions are
    return sum(file.stat().st_blocks * 512 for file in files) / 2**20


def memory(minutes: float) -> bool:
    """Checks that nothing grows: a simulated robot at 1 kHz with recorder and controller."""
    window = minutes / 30 * 60
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        name = stack.enter_context(back_end("sim", *PATIENCE))
        controller = stack.enter_context(subprocess.Popen([sys.executable, "-c", CONTROLLER, name]))
        stack.callback(controller.terminate)
        # Each window has a file of its own, so that all windows see the same.
        files = f"--rotate-time={max(1, round(window))}s"
        recording = stack.enter_context(recorder(name, folder, files, "--max-total=200MB"))
        robot = trifinger.observe(name)
        backend = robot.session_info().backend_pid
        processes = {"back-end": backend, "recorder": recording, "controller": controller.pid}
        usages = [
            usage
            for who, pid in processes.items()
            for usage in (
                Usage(f"{who}: memory", "MiB", lambda pid=pid: resident(pid), 2.0),
                Usage(f"{who}: files", "", lambda pid=pid: descriptors(pid), 0.0),
            )
        ]
        usages.append(Usage("shared memory", "MiB", lambda: shared_memory(name), 0.0))
        robot.get_observation(1000)
        first = robot.current_time_index()
        begin = time.monotonic()
        # The first window is for warming up.
        for number in range(1, 31):
            samples: list[list[float]] = []
            while time.monotonic() < begin + number * window:
                samples.append([usage.read() for usage in usages])
                time.sleep(min(0.2, window / 5))
            print(f"[{number}/30]", file=sys.stderr)
            if number > 1:
                for usage, values in zip(usages, zip(*samples, strict=True), strict=True):
                    # A file that is being replaced by the next one does not count as growth.
                    usage.windows.append(statistics.median(values))
        steps = robot.current_time_index() - first
        print(f"{minutes:g} minutes, {steps} steps at 1 kHz; windows of {window:g} s:")
        holds = True
        for usage in usages:
            is_flat = usage.growth <= usage.bound
            holds = holds and is_flat
            print(
                f"{usage.name}: first {usage.windows[0]:.4g}, last {usage.windows[-1]:.4g}, "
                f"largest {max(usage.windows):.4g} {usage.unit}; grew by {usage.growth:.3g}, "
                f"allowed {usage.bound:g}: {'flat' if is_flat else 'IT GROWS'}"
            )
        return holds


def kills() -> bool:
    """Kills processes at any instant, and measures how soon the others notice."""
    rows: list[Row] = []
    with folders():
        for name in ("dead_user", "dead_user_with_repeats", "dead_backend", "kills"):
            run(
                Measure(name, "deaths"),
                quick=False,
                rows=rows,
                on_row=rows.append,
                on_progress=lambda share: print(f"{100 * share:.0f} %", flush=True),
            )
    for row in rows:
        print(row.text())
    return all(row.holds for row in rows)


def main() -> int:
    """Runs one part and returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("part", choices=["kills", "memory"])
    parser.add_argument("--minutes", type=float, default=30.0, help="of memory; default: 30")
    arguments = parser.parse_args()
    holds = kills() if arguments.part == "kills" else memory(arguments.minutes)
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
