# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate identify`: how well robots and objects with drawn figures are identified.

Each robot is a TriFinger on emulated motor boards, in simulated time, that is not as its
configuration says. `trifinger identify` moves and identifies it like any robot; then it moves
again, otherwise, and the simulation that was fitted is compared with that. Objects are slid over,
lifted and slid by robots that are known as well as identification tells them. A row of each is kept
in docs/results/identify.jsonl at once, so an evaluation that was cut off goes on.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from trifinger._trifinger import FreeRun, list_sessions
from trifinger.commands.command_line import say
from trifinger.commands.identify import parse, record as move, recorder
from trifinger.identification import Figure, Identification, identify, read_motion
from trifinger.identification.fit import DELAY, errors_of
from trifinger.identification.handling import identify_handling

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "docs" / "results"
ROWS = RESULTS / "identify.jsonl"
PAGE = RESULTS / "identify.md"
BOARDS = ROOT / "build" / "release" / "evaluation" / "boards_of_another"
FIRST = 201  # seed of the first robot: no other has been looked at while the method was made
SECONDS = 300.0
JUDGED = 60.0  # of motion that is not fitted [s]
JOINTS = 9
BOARDS_DELAY = 0.001  # desired currents act from the next tick of a board on [s]
ROTOR, DAMPING, FRICTION = 3.645e-4, 0.005, 0.01  # about which figures are drawn
TRIFINGER = ROOT / "build" / "release" / "apps" / "trifinger"
MASS, MASS_SHARE = 0.094, 0.3  # [kg]
FRICTIONS = {"tip_object": (0.6, 1.1), "object_table": (0.3, 0.6), "tip_table": (0.5, 1.0)}
LATE = 2e-3  # at most, so that the cube can be lifted [s]
# How far figures are off that were identified: standard deviations, as shares.
KNOWN = {"friction": 0.1, "damping": 0.13, "rotor_inertia": 0.13, "torque_scale": 0.05}
POSES = {
    "object_period": 0.01,
    "object_delay": 0.02,
    "object_position_noise": 0.0005,
    "object_orientation_noise": 0.005,
}
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
OBJECTS = """
## Objects

A cube is lifted and slid, and tips slide over it and over the table. Its mass differs by up to
30 %, friction of tip and cube is 0.6 to 1.1, of cube and table 0.3 to 0.6, of tip and table 0.5 to
1.0. Robots are drawn as above, but at most {late:.0f} ms late each way, and known as well as they
are identified: errors are drawn of the size of the intervals above. Poses come every 10 ms, 20 ms
late, with noise of 0.5 mm and 5 mrad.

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
def robot(name: str, *command: str | Path) -> Iterator[None]:
    """A robot that a command runs meanwhile."""
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        try:
            while name not in [one.name for one in list_sessions() if one.backend_is_alive]:
                if process.poll() is not None:
                    raise SystemExit(f"{command[0]} has ended")
                time.sleep(0.05)
            yield
        finally:
            process.terminate()


def record(name: str, folder: Path, *options: object) -> Path:
    """Lets `trifinger identify` move a robot, and returns the folder of the log."""
    return Path(move(name, parse([name, "-o", str(folder), *map(str, options)])))


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
        with robot(name, BOARDS, described, true, name):
            fitted = record(name, folder / "fitted", "--seconds", seconds, "--seed", seed)
            other = record(name, folder / "judged", "--seconds", judged, "--seed", seed + 1_000_000)
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


def run_object(seed: int) -> dict[str, Any]:
    """Draws, handles and identifies a cube."""
    random = np.random.default_rng(seed)
    figures = draw(seed)
    for delay in ("torque_delay", "measurement_delay"):
        figures[delay] = min(figures[delay], LATE)
    true = {name: float(random.uniform(*bounds)) for name, bounds in FRICTIONS.items()}
    mass = MASS * float(random.uniform(1 - MASS_SHARE, 1 + MASS_SHARE))
    known = dict(figures)
    for name, share in KNOWN.items():
        known[name] = (figures[name] * random.normal(1, share, JOINTS)).tolist()
    name = f"identify-{os.getpid()}"
    about = BASE.format(extends="pushing", name=name).replace("objects: []\n", "")
    about += f"simulation: {json.dumps(POSES | {'seed': seed})}\n"
    contact = {"tip_friction": 1.0, "tip_torsional_friction": 0.005, "floor_friction": 0.5}
    cube = {"name": "cube", "type": "cube", "size": [0.065], "mass": mass}
    with tempfile.TemporaryDirectory() as path:
        folder = Path(path)
        believed, real = folder / "believed.yml", folder / "real.yml"
        believed.write_text(f"{about}identified: {json.dumps(known)}\n", encoding="utf-8")
        more = {"identified": figures, "contact": contact | {"friction": true}, "objects": [cube]}
        real.write_text(
            about + "".join(f"{key}: {json.dumps(value)}\n" for key, value in more.items()),
            encoding="utf-8",
        )
        logs = []
        for task in ("strokes", "lift", "slide"):
            with robot(name, TRIFINGER, "run", real, "--non-real-time"):
                if task == "strokes":
                    options = ("--object", "cube", "--robot-config", believed)
                    logs.append(record(name, folder / task, *options))
                    continue
                (folder / task).mkdir()
                with recorder(name, folder / task):
                    words = ["manipulate", task, "--robot", name, "-o", folder / f"{task}_report"]
                    subprocess.run([TRIFINGER, *words], check=False, capture_output=True)
                logs.append(folder / task)
        found = identify_handling(logs, str(believed), "cube")
    truth = true | {"cube": mass}
    return {
        "what": "object",
        "seed": seed,
        "seconds": SECONDS,
        "figures": [
            row_of(one, truth[one.joint])
            for one in found
            if one.name in ("object_mass", "friction")
        ],
    }


def row_of(figure: Figure, true: float) -> dict[str, Any]:
    """A figure with its interval and what it truly is."""
    return {
        "name": figure.name,
        "joint": figure.joint,
        "value": figure.value,
        "low": figure.low,
        "high": figure.high,
        "true": true,
        "told": figure.is_told,
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
        yield row_of(figure, true)


def write(rows: list[dict[str, Any]]) -> None:
    """Writes the page."""
    robots = [row for row in rows if "what" not in row]
    text = HEAD.format(seconds=SECONDS) + table(robots)
    text += "\n| robot | free run before [mrad] | after | ratio | told within intervals | time | "
    text += "of processors |\n"
    text += "|---|---|---|---|---|---|---|\n"
    for row in robots:
        before, after = (np.sqrt(np.mean(np.square(row[key]))) for key in ("before", "after"))
        told = [one for one in row["figures"] if one["told"]]
        text += (
            f"| {row['seed']} | {1e3 * before:.0f} | {1e3 * after:.1f} | {after / before:.3f} | "
            f"{len(inside(told))} of {len(told)} | {row['took']:.0f} s | "
            f"{row.get('processor', math.nan):.0f} s |\n"
        )
    text += OBJECTS.format(late=1e3 * LATE) + table([row for row in rows if "what" in row])
    PAGE.write_text(text, encoding="utf-8")


def inside(figures: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Those whose interval has the true value."""
    return [one for one in figures if one["low"] <= one["true"] <= one["high"]]


def table(rows: list[dict[str, Any]]) -> str:
    """A line for each kind of figure."""
    text = (
        "| figure | told | of these within their interval | within 10 % | half of the interval |\n"
    )
    text += "|---|---|---|---|---|\n"
    figures = [one for row in rows for one in row["figures"]]

    def kind(one: dict[str, Any]) -> str:
        return str(
            one["joint"] if one["name"] == "friction" and "_" in one["joint"][:7] else one["name"]
        )

    for name in [*dict.fromkeys(map(kind, figures)), "all"]:
        of_kind = [one for one in figures if name in (kind(one), "all")]
        told = [one for one in of_kind if one["told"]]
        near = [one for one in told if abs(one["value"] / one["true"] - 1) <= 0.1]
        widths = [(one["high"] - one["low"]) / 2 / max(abs(one["true"]), 1e-9) for one in told]
        half = f"{100 * np.median(widths):.1f} % of the value" if told and name != "all" else ""
        share = f"{len(inside(told))} ({100 * len(inside(told)) / max(len(told), 1):.0f} %)"
        text += f"| {name} | {len(told)} of {len(of_kind)} | {share} | {len(near)} | {half} |\n"
    return text


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
    done = {(row.get("what", ""), row["seed"], row["seconds"]) for row in rows}
    for seed in range(FIRST, FIRST + arguments.robots):
        for what in ("", "object"):
            if (what, seed, arguments.seconds) in done:
                continue
            row = run_object(seed) if what else run(seed, arguments.seconds, arguments.judged)
            rows.append(row)
            with ROWS.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
            say(f"{what or 'robot'} {seed}")
            write(rows)
    if rows:
        write(rows)


if __name__ == "__main__":
    main()
