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
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from trifinger._trifinger import (
    FreeRun,
    Policy,
    configuration_text,
    list_sessions,
    read_joint_facts,
)
from trifinger.arrays import Array
from trifinger.commands.command_line import say
from trifinger.commands.identify import parse, record as move, recorder
from trifinger.environments import Options
from trifinger.errors import InvalidArgument
from trifinger.evaluation import Evaluator, act_of
from trifinger.identification import Figure, Identification, Motion, identify, read_motion, save
from trifinger.identification.fit import CENTERS, DELAY, errors_of
from trifinger.identification.handling import identify_handling
from trifinger.identification.page import CONFIGURATION, FIGURES
from trifinger.identification.stiffness import words_of

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "docs" / "results"
ROWS = RESULTS / "identify.jsonl"
PAGE = RESULTS / "identify.md"
BOARDS = ROOT / "build" / "release" / "evaluation" / "boards_of_another"
FIRST = 201  # seed of the first robot: no other has been looked at while the method was made
FIRST_OBJECT = 2000  # is added for objects, for the same reason
SECONDS = 300.0
JUDGED = 60.0  # of motion that is not fitted [s]
JOINTS = 9
ROTOR, DAMPING, FRICTION = 3.645e-4, 0.005, 0.01  # about which figures are drawn
BOARDS_DELAY = 0.001  # desired currents act from the next tick of a board on [s]
RUN_TRIAL = ROOT / "build" / "release" / "evaluation" / "run_trial"
TRIFINGER = ROOT / "build" / "release" / "apps" / "trifinger"
CENTER = 8e-3  # of mass, to each side [m]
CENTERED = range(FIRST + 1, FIRST + 4)  # robots with other centres; the first one was looked at
MASS, MASS_SHARE = 0.094, 0.3  # [kg]
FRICTIONS = {"tip_object": (0.6, 1.1), "object_table": (0.3, 0.6), "tip_table": (0.5, 1.0)}
TIPS = {"tip_time_constant": (4e-3, 20e-3), "tip_damping_ratio": (0.5, 2.0)}  # [s]
ATTEMPTS = 3  # to lift or slide it
LATE = 2e-3  # at most, so that the cube can be lifted [s]
DESCRIBED = {"friction": FRICTION, "damping": DAMPING, "rotor_inertia": ROTOR}
# Figures at their edge, of a robot that skills and a policy move before and after identification.
EDGE = {"friction": 0.018, "damping": 0.009, "backlash": 0.005, "rotor_inertia": ROTOR}
EDGE_LATE = 4e-3  # [s]
SKILLS = ("lift", "flip", "place")
TRIALS = 40
FIRST_TRIAL = 63000
TRAININGS = (1, 2, 3)  # seeds of policies
FILES = ("panda", "shadow")  # robots of others, in tests/robots
FILE_SECONDS = 120.0
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
of another motion, which was not fitted. Its error is the rms of all joints. Time is that of
fitting, on two processors that up to four other programs used, too; beside it is what it needed of
them.

Motion does not tell the scale of all torques and masses of a finger together, so where this is
further from what is described than assumed, all figures of a finger miss at once.

"""
CENTERS_HEAD = """
## Centres of mass

These robots are drawn as above, and the centre of mass of each link is off, too: by up to
{center:.0f} mm in each direction. They are identified with `--centers`.

"""
OBJECTS = """
## Objects

A cube is lifted and slid, and tips press on the table and slide over it and over the cube. Its
mass differs by up to 30 %, friction of tip and cube is 0.6 to 1.1, of cube and table 0.3 to 0.6,
of tip and table 0.5 to 1.0. Tips have a time constant of 4 to 20 ms and a damping ratio of 0.5 to
2. Robots are those above, as they were identified, but at most {late:.0f} ms late each way. Poses
come every 10 ms, 20 ms late, with noise of 0.5 mm and 5 mrad. A lift or slide that fails is done
again, {attempts} times at most, and one that succeeds is used, unless torques are at their limit
for a quarter of the time.

"""
FILES_HEAD = """
## A robot from a file: {name}

{joints} joints, identified from {seconds:.0f} s of motion. Figures are drawn as above, about those
of the file or, if they are larger, about 3 % of the largest torque (dry friction), 1 % of it at the
largest speed (damping) and 1e-3 s^2 times it (rotor inertia); nothing is late.

"""
EDGE_HEAD = """
## Used

A robot whose friction and delay are at their edge: {friction} Nm of dry friction, {damping}
Nms/rad of damping, play of {backlash} rad, torque scales that differ by up to 15 %, {late:.0f} ms
late each way. Skills know its torque scales and zeros afterwards, {trials} trials each with seeds
that nothing was tuned for; success is as in the tables of skills and control. Policies are trained
with {trainings} seeds: before for the robot as described, and after as
[the how-to](../howto/new_robot_to_policy.md) says. Their distance is the median of 50 goals: the
median of the seeds, and their range.

| | before | after |
|---|---|---|
"""
REACH_TAIL = """
After identification, policies are trained for the robot that was fitted{settings}.
Trained with the same settings for the robot as described, {count} seeds come within
{distance}.
"""


def draw(seed: int, *, with_centers: bool = False) -> dict[str, Any]:
    """The section `identified` of a robot."""
    random = np.random.default_rng(seed)

    def around(middle: float, share: float) -> list[float]:
        values: list[float] = (middle * random.uniform(1 - share, 1 + share, JOINTS)).tolist()
        return values

    figures: dict[str, Any] = {
        "friction": around(FRICTION, 0.8),
        "damping": around(DAMPING, 0.8),
        "rotor_inertia": around(ROTOR, 0.5),
        "torque_scale": around(1.0, 0.15),
        "link_mass": around(1.0, 0.15),
        "backlash": random.uniform(0.0, 0.01, JOINTS).tolist(),
        "torque_delay": int(random.integers(0, 5)) * 1e-3,
        "measurement_delay": int(random.integers(0, 5)) * 1e-3,
    }
    if with_centers:
        figures |= {name: random.uniform(-CENTER, CENTER, JOINTS).tolist() for name in CENTERS}
    return figures


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


def run(seed: int, seconds: float, judged: float, *, with_centers: bool = False) -> dict[str, Any]:
    """Draws, moves and identifies one robot."""
    with tempfile.TemporaryDirectory() as path:
        folder = Path(path)
        described, true = folder / "described.yml", folder / "true.yml"
        name = f"identify-{os.getpid()}"
        base = BASE.format(extends="trifinger_edu_emulated", name=name)
        described.write_text(base, encoding="utf-8")
        figures = draw(seed, with_centers=with_centers)
        true.write_text(base + f"identified: {json.dumps(figures)}\n", encoding="utf-8")
        with robot(name, BOARDS, described, true, name):
            fitted = record(name, folder / "fitted", "--seconds", seconds, "--seed", seed)
            other = record(name, folder / "judged", "--seconds", judged, "--seed", seed + 1_000_000)
        row = judge(read_motion([fitted]), read_motion([other]), figures, with_centers=with_centers)
    what = {"what": "centers"} if with_centers else {}
    return what | {"seed": seed, "seconds": seconds} | row


def run_file(name: str, seed: int, seconds: float, judged: float) -> dict[str, Any]:
    """Draws, moves and identifies a robot from a file."""
    random = np.random.default_rng(seed)
    base = ROOT / "tests" / "robots" / f"{name}.yml"
    free = FreeRun(str(base))
    text = configuration_text(str(base))
    _, joints, limits = read_joint_facts(text, name, opens_file=True)
    count, torque = len(joints), limits["max_torque"]
    speed = np.minimum(limits["max_velocity"], 5.0)
    described = {key: np.array(value) for key, value in free.described.items()}

    def around(middle: Array, share: float) -> list[float]:
        values: list[float] = (middle * random.uniform(1 - share, 1 + share, count)).tolist()
        return values

    one = np.ones(count)
    figures: dict[str, Any] = {
        "friction": around(np.maximum(described["friction"], 0.03 * torque), 0.8),
        "damping": around(np.maximum(described["damping"], 0.01 * torque / speed), 0.8),
        "rotor_inertia": around(np.maximum(described["rotor_inertia"], 1e-3 * torque), 0.5),
        "torque_scale": around(one, 0.15),
        "link_mass": around(one, 0.15),
        "backlash": random.uniform(0.0, 0.01, count).tolist(),
    }
    session = f"identify-{os.getpid()}"
    with tempfile.TemporaryDirectory() as path:
        folder = Path(path)
        true = folder / "true.yml"
        true.write_text(
            f"extends: {base}\nname: {session}\nidentified: {json.dumps(figures)}\n",
            encoding="utf-8",
        )
        logs: list[Path] = []
        for what, length in (("fitted", seconds), ("judged", judged)):
            with robot(session, TRIFINGER, "run", true, "--non-real-time"):
                options = ("--seconds", length, "--seed", seed + len(logs))
                logs.append(record(session, folder / what, *options))
        fitted, other = (read_motion([log], robot_config=str(base)) for log in logs)
        return judge(fitted, other, figures) | {"what": name, "seed": seed, "seconds": seconds}


def judge(
    fitted: Motion, other: Motion, figures: dict[str, Any], *, with_centers: bool = False
) -> dict[str, Any]:
    """Identifies a robot from one motion, and compares with another one and with what is true."""
    begin, used = time.monotonic(), time.process_time()
    result = identify(fitted, with_centers=with_centers)
    took, used = time.monotonic() - begin, time.process_time() - used
    free = FreeRun.of_text(other.configuration)
    delay = result.torque_delay + result.measurement_delay
    before = errors_of(free, other, free.described, 0.0, 0)
    after = errors_of(free, other, result.values, delay, 0)
    return {
        "took": took,
        "processor": used,
        "before": before.free_run.tolist(),
        "after": after.free_run.tolist(),
        "one_step_before": before.one_step.tolist(),
        "one_step_after": after.one_step.tolist(),
        "figures": list(compare(result, figures)),
    }


def run_object(robot_row: dict[str, Any]) -> dict[str, Any]:
    """Draws, handles and identifies a cube, with a robot that was identified."""
    seed = robot_row["seed"]
    random = np.random.default_rng(FIRST_OBJECT + seed)
    figures = draw(seed)
    for delay in ("torque_delay", "measurement_delay"):
        figures[delay] = min(figures[delay], LATE)
    true = {name: float(random.uniform(*bounds)) for name, bounds in FRICTIONS.items()}
    mass = MASS * float(random.uniform(1 - MASS_SHARE, 1 + MASS_SHARE))
    known = figures | identified(robot_row)
    name = f"identify-{os.getpid()}"
    about = BASE.format(extends="pushing", name=name).replace("objects: []\n", "")
    about += f"simulation: {json.dumps(POSES | {'seed': seed})}\n"
    tips = {name: float(random.uniform(*bounds)) for name, bounds in TIPS.items()}
    contact: dict[str, Any] = {"tip_friction": 1.0, "tip_torsional_friction": 0.005}
    contact |= {"floor_friction": 0.5}
    cube = {"name": "cube", "type": "cube", "size": [0.065], "mass": mass}
    with tempfile.TemporaryDirectory() as path:
        folder = Path(path)
        believed, real = folder / "believed.yml", folder / "real.yml"
        believed.write_text(f"{about}identified: {json.dumps(known)}\n", encoding="utf-8")
        contact |= tips | {"friction": true}
        more = {"identified": figures, "contact": contact, "objects": [cube]}
        real.write_text(
            about + "".join(f"{key}: {json.dumps(value)}\n" for key, value in more.items()),
            encoding="utf-8",
        )
        logs = []
        with robot(name, TRIFINGER, "run", real, "--non-real-time"):
            options = ("--object", "cube", "--robot-config", believed)
            logs.append(record(name, folder / "strokes", *options))
        for task in ("lift", "slide"):
            logs.extend(manipulate(task, name, folder, believed, real))
        found = identify_handling(list(useful(logs, believed)), str(believed), "cube")
    truth = true | tips | {"object_mass": mass}
    return {
        "what": "object",
        "seed": seed,
        "seconds": SECONDS,
        "figures": [
            row_of(one, truth[kind_of(one.name, one.joint)])
            for one in found
            if kind_of(one.name, one.joint) in truth
        ],
    }


def identified(robot_row: dict[str, Any]) -> dict[str, list[float]]:
    """What was told of the joints of a robot, and as it is described what was not."""
    found: dict[str, list[float]] = {}
    for figure in robot_row["figures"]:
        name = figure["name"]
        if name in ("torque_scale", "link_mass", *DESCRIBED):
            value = figure["value"] if figure["told"] else DESCRIBED.get(name, 1.0)
            found.setdefault(name, []).append(value)
    return found


def manipulate(task: str, name: str, folder: Path, known: Path, real: Path) -> list[Path]:
    """Lets the robot `real` do a task until it succeeds. Returns the log of that, if it does."""
    for attempt in range(ATTEMPTS):
        log = folder / f"{task}{attempt}"
        log.mkdir()
        with robot(name, TRIFINGER, "run", real, "--non-real-time"), recorder(name, log):
            words = ["manipulate", task, "--robot", name, "--identified", str(known)]
            words += ["-o", f"{log}_report"]
            done = subprocess.run([TRIFINGER, *words], check=False, capture_output=True)
        if done.returncode == 0:
            return [log]
    return []


def useful(logs: list[Path], configuration: Path) -> Iterator[Path]:
    """Those logs that are not refused."""
    for log in logs:
        with contextlib.suppress(InvalidArgument):
            read_motion([log], robot_config=str(configuration))
            yield log


def identify_edge(seed: int, folder: Path) -> tuple[Path, Path]:
    """Identifies a robot at the edge: its true configuration, and the folder of what was found."""
    random = np.random.default_rng(seed)
    figures: dict[str, Any] = {name: [value] * JOINTS for name, value in EDGE.items()}
    figures["torque_scale"] = random.uniform(0.85, 1.15, JOINTS).tolist()
    figures |= {"torque_delay": EDGE_LATE, "measurement_delay": EDGE_LATE}
    name = f"identify-{os.getpid()}"
    described, true, real = (folder / f"{one}.yml" for one in ("described", "true", "real"))
    base = BASE.format(extends="trifinger_edu_emulated", name=name)
    section = f"identified: {json.dumps(figures)}\n"
    described.write_text(base, encoding="utf-8")
    true.write_text(base + section, encoding="utf-8")
    real.write_text(f"extends: trifinger_edu\nobjects: []\n{section}", encoding="utf-8")
    with robot(name, BOARDS, described, true, name):
        log = record(name, folder, "--seconds", SECONDS, "--seed", seed)
    save(identify(read_motion([log])), folder / "fitted")
    return real, folder / "fitted"


def run_edge(seed: int) -> dict[str, Any]:
    """How well skills do on a robot at the edge, before and after identification."""
    with tempfile.TemporaryDirectory() as path:
        real, fitted = identify_edge(seed, Path(path))
        known = (("before", ()), ("after", ("--known", fitted / CONFIGURATION)))
        successes: dict[str, dict[str, int]] = {}
        for skill in SKILLS:
            words: list[str | Path] = [RUN_TRIAL, skill, "--robot", real, "--seeds"]
            words += [str(FIRST_TRIAL + i) for i in range(TRIALS)]
            trials = {
                when: subprocess.Popen([*words, *more], stdout=subprocess.PIPE, text=True)
                for when, more in known
            }
            successes[skill] = {
                when: sum(
                    json.loads(line)["succeeds"] for line in trial.communicate()[0].splitlines()
                )
                for when, trial in trials.items()
            }
    return {"what": "edge", "seed": seed, "seconds": SECONDS, "successes": successes}


def run_reach(seed: int) -> dict[str, Any]:
    """How near policies come on a robot at the edge, as docs/howto/new_robot_to_policy.md says."""
    with tempfile.TemporaryDirectory() as path, ThreadPoolExecutor(2) as pool:
        folder = Path(path)
        real, fitted = identify_edge(seed, folder)
        told = json.loads((fitted / FIGURES).read_text(encoding="utf-8"))["train"]
        kinds: dict[str, tuple[str, list[str]]] = {
            "before": ("trifinger_edu", []),
            "settings": ("trifinger_edu", words_of(told)),
            "after": (str(fitted / CONFIGURATION), words_of(told)),
        }

        def distance(of: tuple[str, int]) -> float:
            when, training = of
            return reach(*kinds[when], training, real, folder / f"{when}{training}")

        trained = [(when, training) for when in kinds for training in TRAININGS]
        distances: dict[str, list[float]] = {when: [] for when in kinds}
        for (when, _), found in zip(trained, pool.map(distance, trained), strict=True):
            distances[when].append(found)
        return {
            "what": "reach",
            "seed": seed,
            "seconds": SECONDS,
            "train": told,
            "distances": distances,
        }


def reach(config: str, settings: list[str], seed: int, real: Path, output: Path) -> float:
    """Trains a shared policy for one robot; its median distance on another one [m]."""
    words = ["reach", "--shared", "--robot-config", config, "--seed", str(seed), "-o", str(output)]
    words += settings
    train = "import sys; from trifinger.commands.train import main; sys.exit(main())"
    subprocess.run(
        [sys.executable, "-c", train, *words],
        check=True,
        stdout=subprocess.DEVNULL,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    policy = Policy(output / "reach.policy")
    options = Options.from_json(policy.metadata["options"])
    evaluator = Evaluator("reach", options, config=str(real))
    return float(np.median(evaluator(act_of(policy), evaluator.rows_of(policy)).distances))


def kind_of(name: str, joint: str) -> str:
    """What a line of a table is of."""
    return joint if joint in FRICTIONS else name


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
            late = ("torque_delay", "measurement_delay")
            true = sum(figures[name] for name in late) + BOARDS_DELAY if late[0] in figures else 0.0
        elif figure.name in figures:
            true = figures[figure.name][result.motion.joints.index(figure.joint)]
        else:
            continue  # homing decides
        yield row_of(figure, true)


def write(rows: list[dict[str, Any]]) -> None:
    """Writes the page."""
    robots = [row for row in rows if "what" not in row]
    text = HEAD.format(seconds=SECONDS) + table(robots) + runs(robots)
    centered = [row for row in rows if row.get("what") == "centers"]
    if centered:
        text += CENTERS_HEAD.format(center=1e3 * CENTER) + table(centered) + runs(centered)
    objects = [row for row in rows if row.get("what") == "object"]
    text += OBJECTS.format(late=1e3 * LATE, attempts=ATTEMPTS) + table(objects)
    for name in FILES:
        others = [row for row in rows if row.get("what") == name]
        if others:
            head = FILES_HEAD.format(
                name=name, joints=len(others[0]["after"]), seconds=FILE_SECONDS
            )
            text += head + table(others) + runs(others)
    for row in (row for row in rows if row.get("what") == "edge"):
        text += EDGE_HEAD.format(
            late=1e3 * EDGE_LATE, trials=TRIALS, trainings=len(TRAININGS), **EDGE
        )
        for skill, counts in row["successes"].items():
            text += (
                f"| {skill} | {counts['before']} of {TRIALS} | {counts['after']} of {TRIALS} |\n"
            )
    for row in (row for row in rows if row.get("what") == "reach"):
        found = {when: spread(values) for when, values in row["distances"].items()}
        text += f"| distance of a shared reach policy | {found['before']} | {found['after']} |\n"
        words = " ".join(words_of(row["train"]))
        settings = f",\nas `identify` advises: `{words}`" if words else ""
        count = len(row["distances"]["settings"])
        text += REACH_TAIL.format(settings=settings, count=count, distance=found["settings"])
    PAGE.write_text(text, encoding="utf-8")


def spread(distances: list[float]) -> str:
    """The median of distances [m], and their range."""
    low, high = (f"{1e3 * one:.1f}" for one in (min(distances), max(distances)))
    return f"{1e3 * np.median(distances):.1f} mm ({low} to {high})"


def runs(robots: list[dict[str, Any]]) -> str:
    """A line for each robot."""
    text = "\n| robot | free run before [mrad] | after | ratio | told within intervals | time | "
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
    return text


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

    kinds = [kind_of(one["name"], one["joint"]) for one in figures]
    for name in [*dict.fromkeys(kinds), "all"]:
        of_kind = [one for one, kind in zip(figures, kinds, strict=True) if name in (kind, "all")]
        told = [one for one in of_kind if one["told"]]
        near = [one for one in told if abs(one["value"] - one["true"]) <= 0.1 * abs(one["true"])]
        half = "" if name == "all" else half_of([one for one in told if one["true"]])
        share = f"{len(inside(told))} ({100 * len(inside(told)) / max(len(told), 1):.0f} %)"
        within = "" if name in CENTERS else len(near)
        text += f"| {name} | {len(told)} of {len(of_kind)} | {share} | {within} | {half} |\n"
    return text


def half_of(told: list[dict[str, Any]]) -> str:
    """The median of halves of intervals; centres are around zero."""
    if not told:
        return ""
    halves = [(one["high"] - one["low"]) / 2 for one in told]
    if told[0]["name"] in CENTERS:
        return f"{1e3 * np.median(halves):.1f} mm"
    shares = [half / one["true"] for half, one in zip(halves, told, strict=True)]
    return f"{100 * np.median(shares):.1f} % of the value"


def main() -> None:
    """Runs what is missing, and writes the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=SECONDS)
    parser.add_argument("--judged", type=float, default=JUDGED)
    arguments = parser.parse_args()
    rows: list[dict[str, Any]] = []
    if ROWS.exists():
        rows = [json.loads(line) for line in ROWS.read_text(encoding="utf-8").splitlines()]
    done = {(row.get("what", ""), row["seed"], row["seconds"]) for row in rows}
    for seed in range(FIRST, FIRST + arguments.robots):
        centered = ("centers",) if seed in CENTERED else ()
        once = (*FILES, "edge", "reach") if seed == FIRST else ()
        for what in ("", *centered, "object", *once):
            seconds = arguments.seconds
            if what in (*FILES, "edge", "reach"):
                seconds = FILE_SECONDS if what in FILES else SECONDS
            if (what, seed, seconds) in done:
                continue
            if what in FILES:
                row = run_file(what, seed, seconds, arguments.judged)
            elif what == "object":
                robots = {row["seed"]: row for row in rows if "what" not in row}
                row = run_object(robots[seed])
            elif what == "edge":
                row = run_edge(seed)
            elif what == "reach":
                row = run_reach(seed)
            else:
                is_centered = what == "centers"
                row = run(seed, seconds, arguments.judged, with_centers=is_centered)
            rows.append(row)
            with ROWS.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
            say(f"{what or 'robot'} {seed}")
            write(rows)
    if rows:
        write(rows)


if __name__ == "__main__":
    main()
