# SPDX-License-Identifier: BSD-3-Clause
"""`./run bench`: measures all figures, each beside its reference in the same run."""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

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


def across_processes_samples(rounds: int) -> list[float]:
    """The back-end is a process of its own, on the same CPU, which it inherits."""
    name = f"benchmark-{os.getpid()}"
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    with subprocess.Popen(
        [program.path(), "run", "fake", "--name", name, "--non-real-time"],
        stdout=subprocess.DEVNULL,
    ) as process:
        try:
            while name not in (session.name for session in trifinger.list_sessions()):
                process.poll()
                if process.returncode is not None:
                    raise SystemExit("`trifinger run fake` ended with an error")
                time.sleep(0.01)
            with trifinger.connect(name) as robot:
                return [python_loop(robot, 30_000) for _ in range(rounds)]
        finally:
            process.terminate()
            process.wait()


def python_rows(rows: list[Row], rounds: int) -> list[Row]:
    """What the Python side measures, beside the `rows` of the C++ side."""

    def find(measure: str) -> Row:
        return next(row for row in rows if row["measure"] == measure)

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
        row(name, samples(rounds), reach, find(reference))
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
    rows += python_rows(rows, 3 if arguments.quick else 15)
    print_table(rows)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
