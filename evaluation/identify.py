# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate identify`: how well robots with drawn figures are identified.

Each robot is a TriFinger on emulated motor boards, in simulated time, that is not as its
configuration says. `trifinger identify` moves and identifies it like any robot; then it moves
again, otherwise, and the simulation that was fitted is compared with that. A row of each robot is
kept in docs/results/identify.jsonl at once, so an evaluation that was cut off goes on.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from trifinger._trifinger import FreeRun, list_sessions
from trifinger.identification import Identification, identify, read_motion
from trifinger.identification.fit import DELAY, errors_of

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "docs" / "results"
ROWS = RESULTS / "identify.jsonl"
PAGE = RESULTS / "identify.md"
BOARDS = ROOT / "build" / "release" / "evaluation" / "boards_of_another"
FIRST = 101  # seed of the first robot: no other has been looked at while the method was made
SECONDS = 300.0
JUDGED = 60.0  # of motion that is not fitted [s]
JOINTS = 9
BOARDS_DELAY = 0.001  # desired currents act from the next tick of a board on [s]
ROTOR, DAMPING, FRICTION = 3.645e-4, 0.005, 0.01  # about which figures are drawn
BASE = """\
extends: {extends}
name: {name}
objects: []
"""
HEAD = """\
<!-- SPDX-License-Identifier: BSD-3-Clause -->
# Identification of robots with drawn figures

Written by `./run evaluate identify` from [identify.jsonl](identify.jsonl). Each robot is a
TriFinger Edu on emulated motor boards, with their quantisation, that is not as its configuration
says: friction and damping of joints differ by up to 80 %, rotor inertia by 50 %, torque scale and
masses by 15 %, play is 0 to 10 mrad, torques and measurements are each 0 to 4 ms late. `trifinger
identify` moves it for {seconds:.0f} s. Intervals are of 95 %. A free run is of 1 s by the torques
of another motion, which was not fitted. Its error is the rms of all joints.

"""


def draw(seed: int) -> dict[str, Any]:
    """The section `identified` of a robot."""
    random = np.random.default_rng(seed)

    def around(middle: float, share: float) -> list[float]:
        values: list[float] = (middle * random.uniform(1 - share, 1 + share, JOINTS)).tolist()
        return values

    return {
        "friction": around(FRICTION, 0.8),
        "damping": around(DAMPING, 0.8),
        "rotor_inertia": around(ROTOR, 0.5),
        "torque_scale": around(1.0, 0.15),
        "link_mass": around(1.0, 0.15),
        "backlash": random.uniform(0.0, 0.01, JOINTS).tolist(),
        "torque_delay": int(random.integers(0, 5)) * 1e-3,
        "measurement_delay": int(random.integers(0, 5)) * 1e-3,
    }


@contextlib.contextmanager
def robot(described: Path, true: Path, name: str) -> Iterator[None]:
    """A robot on boards that runs meanwhile."""
    with subprocess.Popen([BOARDS, described, true, name]) as process:
        try:
            while name not in [one.name for one in list_sessions() if one.backend_is_alive]:
                if process.poll() is not None:
                    raise SystemExit(f"{BOARDS.name} has ended")
                time.sleep(0.05)
            yield
        finally:
            process.terminate()


def record(name: str, folder: Path, seconds: float, seed: int) -> Path:
    """Lets `trifinger identify` move a robot, and returns the folder of the log."""
    from trifinger.commands.identify import parse, record as move

    words = [name, "-o", str(folder), "--seconds", str(seconds), "--seed", str(seed)]
    return Path(move(name, parse(words)))


def run(seed: int, seconds: float, judged: float) -> dict[str, Any]:
    """Draws, moves and identifies one robot."""
    with tempfile.TemporaryDirectory() as path:
        folder = Path(path)
        described, true = folder / "described.yml", folder / "true.yml"
        name = f"identify-{os.getpid()}"
        base = BASE.format(extends="trifinger_edu_emulated", name=name)
        described.write_text(base, encoding="utf-8")
        figures = draw(seed)
        true.write_text(base + f"identified: {json.dumps(figures)}\n", encoding="utf-8")
        with robot(described, true, name):
            fitted = record(name, folder / "fitted", seconds, seed)
            other = record(name, folder / "judged", judged, seed + 1_000_000)
        begin, used = time.monotonic(), time.process_time()
        result = identify(read_motion([fitted]))
        took, used = time.monotonic() - begin, time.process_time() - used
        motion = read_motion([other])
        free = FreeRun.of_text(motion.configuration)
        delay = result.torque_delay + result.measurement_delay
        before = errors_of(free, motion, free.described, 0.0, 0)
        after = errors_of(free, motion, result.values, delay, 0)
    return {
        "seed": seed,
        "seconds": seconds,
        "took": took,
        "processor": used,
        "before": before.free_run.tolist(),
        "after": after.free_run.tolist(),
        "one_step_before": before.one_step.tolist(),
        "one_step_after": after.one_step.tolist(),
        "figures": list(compare(result, figures)),
    }


def compare(result: Identification, figures: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Each figure with its interval and what it truly is."""
    for figure in result.figures:
        if figure.name == DELAY:
            true = figures["torque_delay"] + figures["measurement_delay"] + BOARDS_DELAY
        elif figure.name in figures:
            true = figures[figure.name][result.motion.joints.index(figure.joint)]
        else:
            continue  # homing decides
        yield {
            "name": figure.name,
            "joint": figure.joint,
            "value": figure.value,
            "low": figure.low,
            "high": figure.high,
            "true": true,
            "told": figure.is_told,
        }


def write(rows: list[dict[str, Any]]) -> None:
    """Writes the page."""
    names = list(dict.fromkeys(one["name"] for row in rows for one in row["figures"]))
    text = HEAD.format(seconds=rows[0]["seconds"])
    text += "| figure | told | of these within their interval | median half width |\n"
    text += "|---|---|---|---|\n"
    for name in [*names, "all"]:
        all_of_them = [
            one for row in rows for one in row["figures"] if name in (one["name"], "all")
        ]
        told = [one for one in all_of_them if one["told"]]
        inside = [one for one in told if one["low"] <= one["true"] <= one["high"]]
        widths = [(one["high"] - one["low"]) / 2 / max(abs(one["true"]), 1e-9) for one in told]
        half = f"{100 * np.median(widths):.1f} % of the value" if told and name != "all" else ""
        share = f"{len(inside)} ({100 * len(inside) / max(len(told), 1):.0f} %)"
        text += f"| {name} | {len(told)} of {len(all_of_them)} | {share} | {half} |\n"
    text += "\n| robot | free run before [mrad] | after | ratio | told within intervals | time | "
    text += "of processors |\n"
    text += "|---|---|---|---|---|---|---|\n"
    for row in rows:
        before, after = (np.sqrt(np.mean(np.square(row[key]))) for key in ("before", "after"))
        told = [one for one in row["figures"] if one["told"]]
        inside = [one for one in told if one["low"] <= one["true"] <= one["high"]]
        text += (
            f"| {row['seed']} | {1e3 * before:.0f} | {1e3 * after:.1f} | {after / before:.3f} | "
            f"{len(inside)} of {len(told)} | {row['took']:.0f} s | "
            f"{row.get('processor', math.nan):.0f} s |\n"
        )
    PAGE.write_text(text, encoding="utf-8")


def main() -> None:
    """Runs what is missing, and writes the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=SECONDS)
    parser.add_argument("--judged", type=float, default=JUDGED)
    arguments = parser.parse_args()
    rows = []
    if ROWS.exists():
        rows = [json.loads(line) for line in ROWS.read_text(encoding="utf-8").splitlines()]
    done = {(row["seed"], row["seconds"]) for row in rows}
    for seed in range(FIRST, FIRST + arguments.robots):
        if (seed, arguments.seconds) in done:
            continue
        row = run(seed, arguments.seconds, arguments.judged)
        rows.append(row)
        with ROWS.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        print(f"robot {seed}: {row['took']:.0f} s")
        sys.stdout.flush()
        write(rows)
    if rows:
        write(rows)


if __name__ == "__main__":
    main()
