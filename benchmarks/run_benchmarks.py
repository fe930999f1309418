# SPDX-License-Identifier: BSD-3-Clause
"""`./run bench`: measures all figures, each beside its reference in the same run."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trifinger
from trifinger import _trifinger, program

# Of the same build as the module.
PROGRAM = Path(_trifinger.__file__).parents[2] / "benchmarks" / "trifinger_benchmarks"

Row = dict[str, Any]


def python_loop(robot: Any, steps: int) -> float:
    """Steps per second of the basic control loop with a policy that does nothing."""
    action = robot.new_action()
    t = robot.append_desired_action(action)
    begin = time.perf_counter()
    for _ in range(steps):
        robot.get_observation(t)
        t = robot.append_desired_action(action)
    return steps / (time.perf_counter() - begin)


def row(measure: str, samples: list[float], reach: float, reference: Row | None = None) -> Row:
    """One line of the table, of the same form as those of the C++ side."""
    value = statistics.median(samples)
    return {
        "measure": measure,
        "value": value,
        "low": min(samples),
        "high": max(samples),
        "unit": "steps/s",
        "reference": f"the same from C++ ({reference['value']:.4g} steps/s)" if reference else None,
        "ratio": value / reference["value"] if reference else None,
        "reach": f">= {reach:.0f} steps/s",
        "holds": value >= reach,
        "remark": "",
    }


def inline_samples(rounds: int) -> list[float]:
    """Back-end and user in one thread."""
    with trifinger.fake() as robot:
        return [python_loop(robot, 200_000) for _ in range(rounds)]


@contextlib.contextmanager
def back_end(robot: str, *options: str) -> Iterator[str]:
    """A back-end in a process of its own; gives its name."""
    name = f"benchmark-{os.getpid()}"
    with subprocess.Popen(
        [program.path(), "run", robot, "--name", name, *options],
        stdout=subprocess.DEVNULL,
    ) as process:
        try:
            while name not in (session.name for session in trifinger.list_sessions()):
                process.poll()
                if process.returncode is not None:
                    raise SystemExit(f"`trifinger run {robot}` ended with an error")
                time.sleep(0.01)
            yield name
        finally:
            process.terminate()
            process.wait()


@contextlib.contextmanager
def recorder(name: str, folder: str, *options: str) -> Iterator[int]:
    """A recorder in a process of its own that has begun its file; gives its process id."""
    before = set(Path(folder).glob("*.mcap"))
    with subprocess.Popen(
        [program.path(), "record", name, "--to", folder, *options], stdout=subprocess.DEVNULL
    ) as process:
        try:
            while set(Path(folder).glob("*.mcap")) == before:
                process.poll()
                if process.returncode is not None:
                    raise SystemExit("`trifinger record` ended with an error")
                time.sleep(0.01)
            yield process.pid
        finally:
            process.terminate()
            process.wait()


def across_processes_samples(rounds: int) -> list[float]:
    """The back-end is a process of its own, on the same CPU, which it inherits."""
    affinity = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(affinity)})
    try:
        with back_end("fake", "--non-real-time") as name, trifinger.connect(name) as robot:
            return [python_loop(robot, 30_000) for _ in range(rounds)]
    finally:
        os.sched_setaffinity(0, affinity)


def cpu_time(pid: int) -> float:
    """The time that a process has spent on processors so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def recorder_rows(windows: int, duration: float) -> list[Row]:
    """A simulated robot with its object at 1 kHz, recorded by a process of its own."""
    load: list[float] = []
    recorded: list[float] = []
    alone: list[float] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        # Nobody acts while a recorder starts or ends.
        back_end(
            "sim",
            *("--set", "backend.late_action.max_repeats=1000000"),
            *("--set", "backend.max_skipped_ticks=1000000"),
        ) as name,
        trifinger.connect(name) as robot,
    ):
        action = robot.new_action(position=robot.latest_observation().position)
        actions = np.repeat(np.asarray(action), 50)
        t = robot.append_desired_action(action)

        def window() -> float:
            """The 99th percentile of the lateness of a window [us]."""
            nonlocal t
            first = t
            while t < first + 1000 * duration:
                t = robot.append_desired_actions(actions)
                robot.wait_until_time_index(t - 20)
            statuses = robot.get_statuses(first + 1, t - 20)
            return float(np.quantile(statuses["lateness"], 0.99)) * 1e-3

        for _ in range(windows):
            with recorder(name, folder) as pid:
                cpu_before, before = cpu_time(pid), time.perf_counter()
                recorded.append(window())
                load.append(100 * (cpu_time(pid) - cpu_before) / (time.perf_counter() - before))
            alone.append(window())
    ratio = statistics.median(a / b for a, b in zip(recorded, alone, strict=True))
    return [
        {
            "measure": "recorder's CPU at 1 kHz, robot and object",
            "value": statistics.mean(load),
            "low": min(load),
            "high": max(load),
            "unit": "%",
            "reference": None,
            "ratio": None,
            "reach": "<= 3 % of one core",
            "holds": statistics.mean(load) <= 3.0,
            "remark": "",
        },
        {
            "measure": "1 kHz: lateness while recorded, p99 of windows",
            "value": statistics.median(recorded),
            "low": min(recorded),
            "high": max(recorded),
            "unit": "us",
            "reference": f"the same not recorded ({statistics.median(alone):.4g} us)",
            "ratio": ratio,
            "reach": "<= 1.2x",
            "holds": ratio <= 1.2,
            "remark": f"windows of {duration:g} s in turn; not recorded: {min(alone):.4g} to "
            f"{max(alone):.4g} us",
        },
    ]


def reading_row(rounds: int, reference: Row) -> Row:
    """A minute of a recorded robot into NumPy."""
    steps = 60_000
    with tempfile.TemporaryDirectory() as folder:
        simulation = trifinger.Simulation()
        with simulation.record(folder), simulation.connect() as robot:
            random = np.random.default_rng(1)
            action = robot.new_action(position=robot.latest_observation().position)
            for torque in random.uniform(-0.2, 0.2, (steps, 9)):
                action.torque = torque
                robot.wait_until_time_index(robot.append_desired_action(action))
            robot.finish()
        samples = []
        for _ in range(rounds + 1):
            begin = time.perf_counter()
            rows = trifinger.Log(folder).session().read()
            samples.append(time.perf_counter() - begin)
            if len(rows.observations) != steps:
                raise SystemExit("steps are missing in the log")
    del samples[0]
    value = statistics.median(samples)
    return {
        "measure": "log: 60 s at 1 kHz into NumPy",
        "value": value,
        "low": min(samples),
        "high": max(samples),
        "unit": "s",
        "reference": f"the same from C++ ({reference['value']:.4g} s)",
        "ratio": value / reference["value"],
        "reach": "<= 0.15 s",
        "holds": value <= 0.15,
        "remark": "",
    }


def environment_row(rounds: int, reference: Row) -> Row:
    """Actions of the single environment."""
    from trifinger.environments import Environment

    environment = Environment("reach")
    random = np.random.default_rng(1)
    actions = np.clip(np.cumsum(0.2 * random.normal(size=(100, 9)), axis=0), -1, 1)
    samples = []
    for episode in range(rounds):
        environment.reset(seed=0, options={"episode": episode})
        begin = time.perf_counter()
        for action in actions.astype(np.float32):
            environment.step(action)
        samples.append(len(actions) / (time.perf_counter() - begin))
    ratio = reference["value"] / statistics.median(samples)
    return {
        "measure": "environment, reach at 50 Hz, Python",
        "value": statistics.median(samples),
        "low": min(samples),
        "high": max(samples),
        "unit": "actions/s",
        "reference": f"the same from C++ ({reference['value']:.4g} actions/s); "
        "the ratio is that of the times",
        "ratio": ratio,
        "reach": "<= 1.3x",
        "holds": ratio <= 1.3,
        "remark": "",
    }


def find(rows: list[Row], measure: str) -> Row:
    """The row of that name."""
    return next(row for row in rows if row["measure"] == measure)


def python_rows(rows: list[Row], rounds: int) -> list[Row]:
    """What the Python side measures, beside the `rows` of the C++ side."""

    measures: list[tuple[str, Callable[[int], list[float]], float, str]] = [
        (
            "inline loop of the fake robot, Python",
            inline_samples,
            700_000,
            "inline loop of the fake robot, C++",
        ),
        (
            "loop of the fake robot across processes, one CPU, Python",
            across_processes_samples,
            120_000,
            "loop of the fake robot across processes, one CPU",
        ),
    ]
    return [
        row(name, samples(rounds), reach, find(rows, reference))
        for name, samples, reach, reference in measures
    ]


def print_table(rows: list[Row]) -> None:
    """Prints the rows for people; what was measured beside a figure stands below it."""
    width = max(len(row["measure"]) for row in rows)
    print(
        f"{'measure':<{width}}  {'median':>10} {'(low .. high)':>24} {'unit':<8} {'ratio':>6}  "
        f"{'reach':<32} holds"
    )
    for row in rows:
        spread = f"({row['low']:.4g} .. {row['high']:.4g})"
        ratio = f"{row['ratio']:.2f}x" if row["ratio"] is not None else ""
        holds = "yes" if row["holds"] else "NO"
        print(
            f"{row['measure']:<{width}}  {row['value']:>10.4g} {spread:>24} {row['unit']:<8} "
            f"{ratio:>6}  {row['reach']:<32} {holds}"
        )
        for note in filter(
            None, (row["reference"] and f"beside {row['reference']}", row["remark"])
        ):
            print(f"{'':<{width}}  {note}")


def main() -> int:
    """Measures, prints, and writes what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows to FILE")
    parser.add_argument(
        "--quick", action="store_true", help="a look in seconds: fewer rounds, not to be quoted"
    )
    arguments = parser.parse_args()

    command = [str(PROGRAM), *(["--quick"] if arguments.quick else [])]
    rows: list[Row] = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    rounds = 1 if arguments.quick else 15
    rows += python_rows(rows, rounds)
    rows.append(environment_row(rounds, find(rows, "environment, reach at 50 Hz, C++")))
    rows.append(reading_row(rounds, find(rows, "log: 60 s at 1 kHz into arrays, C++")))
    rows += recorder_rows(1, 0.5) if arguments.quick else recorder_rows(30, 2.0)
    print_table(rows)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
