# SPDX-License-Identifier: BSD-3-Clause
"""What `trifinger metrics`, scraped every second, costs a simulated robot at 1 kHz.

Windows with and without scrapes take turns on one robot that moves; the exporter runs all the time.
`python benchmarks/metrics_measure.py --pairs 30` takes five minutes and prints the figures of
docs/metrics.md.
"""

import argparse
import contextlib
import os
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator

import numpy as np
import trifinger
from trifinger.session_info import session_folder

ROBOT = "metrics-measure"
WINDOW = 5.0  # [s]
SCRAPES_EVERY = 1.0  # [s]
PATIENT = ("--set", "backend.late_action.max_repeats=1000000")
SERVE = "import sys; from trifinger_metrics.commands.metrics import main; sys.exit(main())"
MOVE = """
import sys, numpy as np, trifinger
robot = trifinger.connect(sys.argv[1])
home = robot.latest_observation().position
t = 0
while True:
    actions = np.repeat(np.asarray(robot.new_action()), 50)
    actions["position"] = home + 0.2 * np.sin((t + np.arange(50))[:, None] / 200)
    t = robot.append_desired_actions(actions)
    robot.wait_until_time_index(t - 40)
"""


@contextlib.contextmanager
def running(*command: str, until: str = "") -> Iterator[str]:
    """Runs a command; yields the line with which it says that it is ready."""
    output = subprocess.PIPE if until else None
    with subprocess.Popen(command, stdout=output, text=True) as process:
        try:
            lines = iter(process.stdout) if process.stdout else iter(())
            yield next((line for line in lines if until in line), "")
        finally:
            process.terminate()


@contextlib.contextmanager
def scraped(url: str, durations: list[float]) -> Iterator[None]:
    """Scrapes every second; adds how long each scrape took [s]."""
    over = threading.Event()

    def scrape() -> None:
        while True:
            begin = time.perf_counter()
            with urllib.request.urlopen(url) as answer:  # noqa: S310 (our own server)
                answer.read()
            durations.append(time.perf_counter() - begin)
            if over.wait(SCRAPES_EVERY - durations[-1]):
                return

    thread = threading.Thread(target=scrape)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def window(robot: trifinger.Frontend) -> np.ndarray:
    """How late each step of the next seconds is [us]."""
    first = robot.range("status")[1]
    time.sleep(WINDOW)
    statuses = robot.get_statuses(first, robot.range("status")[1])
    return trifinger.lateness_of(statuses, robot.session_info().period) * 1e6


def measure(pairs: int) -> None:
    """Prints p99 and the longest lateness of both kinds of windows, and their ratios."""
    found: dict[bool, list[np.ndarray]] = {False: [], True: []}
    durations: list[float] = []
    with contextlib.ExitStack() as stack:
        begin = stack.enter_context
        begin(running("trifinger", "run", "sim", "--name", ROBOT, *PATIENT, until="waits for"))
        begin(running(sys.executable, "-c", MOVE, ROBOT))
        serving = begin(running(sys.executable, "-c", SERVE, "--port", "0", until="Serves"))
        robot = trifinger.observe(ROBOT)
        robot.wait_until_time_index(2000)
        for pair in range(pairs):
            for is_scraped in (True, False) if pair % 2 else (False, True):
                scrapes = scraped(serving.split()[1], durations)
                with scrapes if is_scraped else contextlib.nullcontext():
                    found[is_scraped].append(window(robot))
    alone, beside = found[False], found[True]
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    usual, most = np.median(durations) * 1e3, max(durations) * 1e3
    print(f"a scrape takes {usual:.0f} ms, at most {most:.0f} ms")
    for name, of in (
        ("median", lambda one: np.quantile(one, 0.5)),
        ("p99", lambda one: np.quantile(one, 0.99)),
        ("longest", np.max),
    ):
        ratios = [of(a) / of(b) for a, b in zip(beside, alone, strict=True)]
        both = [np.median([of(one) for one in each]) for each in (alone, beside)]
        low, middle, high = np.quantile(ratios, (0.25, 0.5, 0.75))
        print(
            f"{name} of windows: {both[0]:.1f} us alone, {both[1]:.1f} us scraped; "
            f"ratio {middle:.2f}x (quartiles {low:.2f} to {high:.2f})"
        )
    for name, each in (("alone", alone), ("scraped", beside)):
        steps = np.concatenate(each)
        tail = [f"{np.quantile(steps, share):.0f}" for share in (0.99, 0.999, 0.9999)]
        longest = sorted((f"{one.max():.0f}" for one in each), key=float)
        print(f"{name}, {len(steps)} steps: p99, p99.9, p99.99 {' '.join(tail)} us")
        print(f"{name}, longest of each window: {' '.join(longest)} us")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=30, help="of windows; default: 30")
    folder = tempfile.TemporaryDirectory
    with folder() as logs, folder(dir=session_folder()) as sessions:
        os.environ |= {"TRIFINGER_LOG_DIR": logs, "TRIFINGER_SESSION_DIR": sessions}
        measure(parser.parse_args().pairs)
