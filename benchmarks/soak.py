# SPDX-License-Identifier: BSD-3-Clause
"""The parts of `./run soak` that are not tests: kills, memory over time, and endurance."""

import argparse
import json
import os
import select
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from random import Random

import trifinger
from measuring import Measure, folders, run
from python_measures import TIMEOUT, back_end, recorder
from rows import Row

ROOT = Path(__file__).resolve().parents[1]

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
    """Returns the memory that a process has made and uses [MiB].

    Pages of its program do not count: they are private or shared, as others run it or not.
    """
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    values = {words[0]: int(words[1]) for words in map(str.split, lines[1:])}
    return (values["Anonymous:"] + values["Swap:"]) / 1024


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
        name = stack.enter_context(back_end("sim", *TIMEOUT))
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
            # A window may pass while this process waits for a processor; a median needs three.
            while len(samples) < 3 or time.monotonic() < begin + number * window:
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


def folder_size(folder: Path) -> float:
    """Returns the size of the files in a folder [kB]."""
    sizes = []
    for file in folder.iterdir():
        with suppress(FileNotFoundError):  # a file that was just replaced
            sizes.append(file.stat().st_size)
    return sum(sizes) / 1e3


def counts_in(folder: Path) -> Counter[str]:
    """Returns the sums of what `trifinger endurance` has counted."""
    lines = (folder / "health.jsonl").read_text().splitlines()
    counts: Counter[str] = Counter()
    for line in lines[1:-1]:
        interval = json.loads(line)
        counts.update({key: interval[key] for key in ("steps", "collisions", "recoveries")})
        counts["troubles"] += sum(interval["troubles"].values())
        counts.update({f"trouble {name}": n for name, n in interval["troubles"].items()})
    return counts


def endurance(steps: float, processes: int) -> bool:
    """Drives emulated robots at random in simulated time: no operator is needed and nothing grows.

    Each process has a robot and a seed of its own; their steps add up. Every 10^6 steps a fault is
    injected, of each kind in turn.
    """
    with ExitStack() as stack:
        root = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        each = steps / processes
        begin = time.monotonic()
        drives = []
        for seed in range(processes):
            command = [
                *("trifinger-endurance", "--simulate", "trifinger_edu_emulated"),
                *("--seed", str(seed), "--steps", f"{each:.0f}", "--faults-every", "1e6"),
                *("--output", str(root / str(seed))),
            ]
            drive = stack.enter_context(subprocess.Popen(command))
            stack.callback(drive.kill)
            drives.append(drive)
        usages: list[list[Usage]] = [
            [
                Usage(f"{seed}: memory", "MiB", lambda pid=drive.pid: resident(pid), 2.0),
                Usage(f"{seed}: files", "", lambda pid=drive.pid: descriptors(pid), 0.0),
                Usage(f"{seed}: disk", "kB", lambda seed=seed: folder_size(root / str(seed)), 1000),
            ]
            for seed, drive in enumerate(drives)
        ]
        shown = 0
        while any(drive.poll() is None for drive in drives):
            time.sleep(0.5)
            done = 0
            for seed, drive in enumerate(drives):
                if drive.poll() is None and (root / str(seed) / "health.html").exists():
                    done += counts_in(root / str(seed))["steps"]
                    # The history is at its longest after four hours of the robot's time. Until
                    # then it grows as it should.
                    is_warm = counts_in(root / str(seed))["steps"] > min(2e7, each / 4)
                    for usage in usages[seed] if is_warm else []:
                        with suppress(OSError):  # it has just ended
                            usage.windows.append(usage.read())
            share = int(100 * done / steps)
            if share > shown:
                shown = share
                print(f"[{share}/100]", file=sys.stderr)
        seconds = time.monotonic() - begin
        total: Counter[str] = Counter()
        for seed in range(processes):
            total += counts_in(root / str(seed))
        print(f"{total['steps']:.4g} steps in {seconds:.0f} s, {processes} at once:")
        for name, count in sorted(total.items()):
            print(f"{name}: {count}")
        needed = [drive.returncode for drive in drives if drive.returncode != 0]
        print(
            f"drives that needed an operator or failed: {len(needed)} of {processes} {needed or ''}"
        )
        holds = not needed and total["steps"] >= steps
        for usage in (usage for of_one in usages for usage in of_one if usage.windows):
            quarter = max(1, len(usage.windows) // 4)
            growth = max(usage.windows[-quarter:]) - max(usage.windows[:quarter])
            is_flat = growth <= usage.bound
            holds = holds and is_flat
            print(
                f"{usage.name}: first {usage.windows[0]:.4g}, last {usage.windows[-1]:.4g} "
                f"{usage.unit}; grew by {growth:.3g}, allowed {usage.bound:g}: "
                f"{'flat' if is_flat else 'IT GROWS'}"
            )
        return holds


def endurance_in_real_time(minutes: float) -> bool:
    """Drives an emulated robot in real time, while its back-end and the drive itself are killed."""
    robot = "trifinger_edu_emulated"
    name = f"endurance-{os.getpid()}"
    kills = Random(1)  # noqa: S311, no secret
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))

        def start(*words: str) -> subprocess.Popen[bytes]:
            process = subprocess.Popen(words)
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process

        patient = ("--set", "boards.silent_after=1", "--set", "boards.receive_timeout=1")
        start("trifinger", "emulate", robot, "--name", name, *patient)
        run_words = ("trifinger", "run", robot, "--name", name, *patient)
        drive_words = (
            *("trifinger-endurance", name, "--output", str(folder)),
            *("--max-failures", "1000"),
        )
        back_end_process = start(*run_words)
        while not trifinger.list_sessions() or name not in [
            session.name for session in trifinger.list_sessions()
        ]:
            time.sleep(0.1)
        drive = start(*drive_words)
        end = time.monotonic() + 60 * minutes
        killed = 0
        while time.monotonic() < end:
            time.sleep(min(kills.uniform(20, 60), max(0.0, end - time.monotonic())))
            if drive.poll() is not None:
                break
            killed += 1
            if killed % 4 == 0:
                drive.kill()
                drive.wait()
                drive = start(*drive_words)
            else:
                back_end_process.kill()
                back_end_process.wait()
                back_end_process = start(*run_words)
        drive.terminate()
        status = drive.wait()
        counts = counts_in(folder)
        print(f"{minutes:g} minutes, {killed} kills; exit status {status}")
        for key, count in sorted(counts.items()):
            print(f"{key}: {count}")
        moved = counts["steps"] / (60e3 * minutes)
        print(f"share of the time in which it moved: {moved:.2f}")
        return status == 0 and counts["recoveries"] > 0


# What goes wrong in a night, and mends itself when power and buses are back.
FAULTS = (
    "board 2 silent for 1 s",
    "bus 0 off for 1 s",
    "board 4 restarts",
    "emergency stop for 2 s",
    "joint 3 jumps by 0.3 rad for 0.1 s",
    "power off for 2 s",
    "board 1 error receive_timeout",
)


def learning(minutes: float, *, simulated: bool = False) -> bool:
    """Lets an emulated robot learn, with a fault every ten minutes or faster; nobody comes.

    In simulated time the robot goes as fast as the learning lets it.
    """
    robot, count = "trifinger_edu_emulated", max(12, round(minutes / 10))
    period = 60 * minutes / count
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        name = f"learning-{os.getpid()}"

        def start(
            *words: str, stdin: int | None = None, stdout: int | None = None
        ) -> subprocess.Popen[str]:
            process = subprocess.Popen(words, stdin=stdin, stdout=stdout, text=True)
            stack.callback(process.wait)
            stack.callback(process.terminate)
            return process

        if simulated:
            program = str(ROOT / "build/release/benchmarks/boards_in_simulated_time")
            boards = start(program, name, str(round(period)), str(count), stdout=subprocess.PIPE)
        else:
            boards = start("trifinger", "emulate", robot, "--name", name, stdin=subprocess.PIPE)
            start("trifinger", "run", robot, "--name", name)
        while name not in [session.name for session in trifinger.list_sessions()]:
            time.sleep(0.1)
        # The memory of the learner is full after a twelfth of the time.
        size = ("--set", f"buffer_size={max(2000, round(40 * 5 * minutes))}")
        words = ("reach", "--shared", "--robot", name, "--episodes", "10000000", *size)
        learn = start("trifinger", "learn", *words, "-o", str(folder / "f"), stdin=subprocess.PIPE)

        def wait_for_fault(number: int) -> str:
            end = time.monotonic() + period
            while learn.poll() is None:
                if boards.stdout is not None:
                    if select.select([boards.stdout], [], [], 5.0)[0]:
                        return boards.stdout.readline().strip()
                elif time.monotonic() < end:
                    time.sleep(min(5.0, max(0.0, end - time.monotonic())))
                elif boards.stdin is not None:
                    boards.stdin.write(FAULTS[number % len(FAULTS)] + "\n")
                    boards.stdin.flush()
                    return FAULTS[number % len(FAULTS)]
            return ""

        usages: dict[str, Usage] = {}
        for number in range(count):
            fault = wait_for_fault(number)
            if not fault:
                break
            print(f"[{number + 1}/{count}] {fault}", file=sys.stderr)
            for process in [learn.pid, *children_of(learn.pid)]:
                who = "training" if process == learn.pid else kind_of(process)
                if not who:
                    continue
                for what, unit, bound, read in (
                    ("memory", "MiB", 20.0, resident),
                    ("files", "", 2.0, descriptors),
                ):
                    usage = Usage(who, unit, partial(read, process), bound)
                    with suppress(OSError):  # it has just ended
                        windows = [usage.read()]
                        usages.setdefault(f"{who}: {what}", usage).windows.extend(windows)
        # It still learns after the last fault.
        tally = folder / "f/tally.json"
        before = json.loads(tally.read_text())["tally"]["episodes"]
        end = time.monotonic() + 600.0
        learns = False
        while not learns and learn.poll() is None and time.monotonic() < end:
            time.sleep(1.0)
            learns = json.loads(tally.read_text())["tally"]["episodes"] > before
        holds = learns
        learn.terminate()
        learn.wait()
        print((folder / "f/report.md").read_text())
        for what, usage in usages.items():
            second = usage.windows[len(usage.windows) // 12]
            growth = usage.windows[-1] - second
            is_flat = growth <= usage.bound
            holds = holds and is_flat
            print(
                f"{what}: second {second:.4g}, last {usage.windows[-1]:.4g} {usage.unit}; grew by "
                f"{growth:.3g}, allowed {usage.bound:g}: {'flat' if is_flat else 'IT GROWS'}"
            )
        return holds


def children_of(pid: int) -> list[int]:
    """Returns the processes that a process has started."""
    files = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for file in files for child in file.read_text().split()]


def kind_of(pid: int) -> str:
    """Returns what a process of a training does; empty if it does not count."""
    words: list[str] = []
    with suppress(OSError):  # it has just ended
        words = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
    kinds = {"record": "recorder", "run-policy": "actor", "--join": "learner"}
    return next((kind for word, kind in kinds.items() if word in words), "")


def main() -> int:
    """Runs one part and returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "part", choices=["kills", "memory", "endurance", "endurance-real-time", "learning"]
    )
    parser.add_argument(
        "--minutes", type=float, default=30.0, help="of all but kills and endurance; default: 30"
    )
    parser.add_argument("--steps", type=float, default=1e8, help="of endurance; default: 1e8")
    parser.add_argument("--simulated", action="store_true", help="learning in simulated time")
    arguments = parser.parse_args()
    parts = {
        "kills": kills,
        "memory": lambda: memory(arguments.minutes),
        "endurance": lambda: endurance(arguments.steps, os.cpu_count() or 1),
        "learning": lambda: learning(arguments.minutes, simulated=arguments.simulated),
        "endurance-real-time": lambda: endurance_in_real_time(arguments.minutes),
    }
    return 0 if parts[arguments.part]() else 1


if __name__ == "__main__":
    sys.exit(main())
