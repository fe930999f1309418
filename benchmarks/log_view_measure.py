# SPDX-License-Identifier: BSD-3-Clause
"""How long `trifinger view LOG` needs until it can show a moment of an hour, and its memory."""

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable

import numpy as np
import trifinger
from rows import Row

HOUR = 3_600_000  # steps

# Each prints when it is done, and its largest memory [KB].
FIRST_PICTURE = """
import resource, sys
from trifinger.view.logged import LoggedRun
run = LoggedRun(sys.argv[1])
frame = run.frame_at(float(sys.argv[2]) * run.end)
run.scene.poses(frame.position, frame.objects)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, flush=True)
"""
READ_ALL = """
import resource, sys, trifinger
rows = trifinger.Log(sys.argv[1]).session().read()
assert len(rows.observations)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, flush=True)
"""


def record(folder: str, steps: int) -> None:
    """Records a simulated robot that moves to another pose twice a second."""
    home = np.array([0.0, 0.9, -1.7] * 3)
    random = np.random.default_rng(1)
    simulation = trifinger.Simulation()
    with simulation.record(folder), simulation.connect() as robot:
        for start in range(0, steps, 500):
            actions = np.repeat(robot.new_action(), min(500, steps - start))
            actions["position"] = home + random.uniform(-0.25, 0.25, 9)
            robot.append_desired_actions(actions)
            robot.wait_until_time_index(start + len(actions) - 1)
        robot.finish()


def timed(program: str, *words: str) -> tuple[float, float]:
    """Seconds until a program has printed its line, and its largest memory [MB]."""
    begin = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", program, *words], check=True, capture_output=True, text=True
    )
    return time.perf_counter() - begin, int(done.stdout) / 1024


def measure(rounds: Iterable[int], is_quick: bool) -> list[Row]:
    """Opens a log of an hour at random times, and reads it whole, in turn."""
    places = np.random.default_rng(2)
    first, whole = [], []
    with tempfile.TemporaryDirectory() as folder:
        record(folder, HOUR // 60 if is_quick else HOUR)
        for _ in rounds:
            first.append(timed(FIRST_PICTURE, folder, str(places.uniform())))
            whole.append(timed(READ_ALL, folder))
    seconds = [one for one, _ in first]
    memory, memory_whole = max(size for _, size in first), max(size for _, size in whole)
    reference = statistics.median(one for one, _ in whole)
    ratio = statistics.median(seconds) / reference
    what = "a minute" if is_quick else "an hour"
    return [
        Row.of(
            f"view: first picture of a log of {what}, new process",
            seconds,
            "s",
            reference="reading it into NumPy, new process",
            reference_value=reference,
            ratio=ratio,
            reach="<= 3 s",
            holds=statistics.median(seconds) <= 3.0,
            remark=f"at most {memory:.0f} MB of memory; {memory_whole:.0f} MB for reading it whole",
        )
    ]
