# SPDX-License-Identifier: BSD-3-Clause
"""Says which robots of others run as `trifinger new robot` writes them.

    python benchmarks/survey_robots.py [FOLDER ...] [--only TEXT] [--jobs N] [--json FILE]

Each description with a joint in FOLDER, by default those that tools/fetch_robots.py has fetched,
becomes a configuration. The answers that it asks for are those that it proposes itself: the torque
of a motor that could do, --repair-inertia and --angle radian. The robot then holds its pose for
10 s of simulated time, and moves all joints by 0.1 rad or 1 cm, there and back.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import trifinger

ROOT = Path(__file__).resolve().parents[1]
FETCHED = ROOT / "build" / "robots"
TIMEOUT = 900  # [s], of a robot

HOLD_TIME = 10.0  # [s]
MOVE_TIME = 4.0  # there and back
MAX_DRIFT = 0.05  # of a joint that holds its place [rad], [m]
MIN_SHARE = 0.95  # of the robots that must move
# Folders of scenes and parts that are no robots.
OTHER_THINGS = {"arenas", "objects", "item_assets", "props", "kitchen_assets"}
# Files that only look like robots.
PARTS = re.compile(r"(shared|assets?|defaults?|common|visual|materials|skybox)\.xml$|/scene")


@dataclass
class Result:
    """What became of a description."""

    file: str
    state: str  # "runs", "held", "read" or "refused": how far it came
    joints: int = 0
    sentence: str = ""  # what ended it
    drift: float = 0.0  # of the joint that holds its place worst [rad], [m]
    moved: int = 0  # joints that have come at least half of the way


def parsed(path: Path) -> ElementTree.Element:
    """Reads a description of a package whose version is pinned."""
    return ElementTree.parse(path).getroot()  # noqa: S314


def includes(root: ElementTree.Element) -> list[str]:
    """Returns the files that a model includes."""
    return [element.get("file", "") for element in root.iter("include")]


def has_joint(path: Path, depth: int = 0) -> bool:
    """Says whether a description, with what it includes, has a hinge or a slide."""
    try:
        root = parsed(path)
    except (ElementTree.ParseError, OSError):
        return depth == 0  # The survey shall say what is wrong with it.
    if root.tag == "robot":
        kinds = {joint.get("type") for joint in root.findall("joint")}
        return bool(kinds & {"revolute", "continuous", "prismatic"})
    for body in root.iter("body"):  # not the joints of <default> and <equality>
        for joint in body.findall("joint"):
            if joint.get("type", "hinge") in ("hinge", "slide"):
                return True
    return depth < 5 and any(has_joint(path.parent / file, depth + 1) for file in includes(root))


def descriptions(folder: Path) -> Iterator[Path]:
    """Lists the robots: descriptions with a joint that are no part of another one."""
    found = sorted(folder.rglob("*.urdf"))
    models = sorted(folder.rglob("*.xml"))
    included: set[Path] = set()
    main = []
    for path in models:
        try:
            root = parsed(path)
        except ElementTree.ParseError:
            continue
        included |= {(path.parent / file).resolve() for file in includes(root)}
        if root.tag == "mujoco" and not OTHER_THINGS & set(path.parts):
            main.append(path)
    found += [
        path for path in main if path.resolve() not in included and not PARTS.search(str(path))
    ]
    return (path for path in found if has_joint(path))


def last_sentence(text: str) -> str:
    """Returns what a program says at its end, on one line."""
    return " ".join(text.split())[-600:]


def write_configuration(path: Path, folder: Path, root: Path) -> tuple[Path | None, str]:
    """Writes a configuration as `trifinger new robot` does, with answers to what it asks."""
    # Descriptions name their meshes from some folder above.
    places = [place for place in path.parents if root in (place, *place.parents)]
    meshes: list[str] = []
    answers: list[str] = []
    said = ""
    for _ in range(len(places) + 3):
        words = ["trifinger", "new", "robot", "surveyed", "--from", str(path), "-o", str(folder)]
        done = subprocess.run(
            [*words, *meshes, *answers],
            capture_output=True,
            text=True,
            timeout=TIMEOUT,
            check=False,
        )
        written = folder / "surveyed.yml"
        if "--angle radian" in done.stdout:
            answers += ["--angle", "radian"]
            written.unlink()
            continue
        if done.returncode == 0:
            return written, ""
        said = done.stderr
        if "--repair-inertia" in said and "--repair-inertia" not in answers:
            answers.append("--repair-inertia")
        elif "--meshes" in said and places:
            meshes = ["--meshes", str(places.pop(0))]
        else:
            break
    return None, last_sentence(said)


def fill_in(path: Path) -> None:
    """Gives each motor the torque that the file proposes."""
    lines = []
    for line in path.read_text().splitlines():
        proposed = re.search(r"the file says no torque, (\S+) N", line)
        lines.append(line.replace("FILL_IN", proposed[1]) if proposed else line)
    path.write_text("\n".join(lines) + "\n")


def ways_of(path: Path, start: np.ndarray) -> np.ndarray:
    """Returns by how much each joint of a configuration moves: away from the nearer limit."""
    ways = []
    rows = path.read_text().partition("\nsafety:\n")[2].splitlines()
    for place, row in zip(start, rows, strict=True):
        way = 0.01 if " kg, weight" in row else 0.1
        lower, upper = -np.inf, np.inf
        if stops := re.search(r"its stops: (\S+) to (\S+) (m|rad)\b", row):
            lower, upper = float(stops[1]), float(stops[2])
        for name in ("soft_lower", "soft_upper"):
            if said := re.search(rf"{name}: (-?\.inf|[-.\de+]+)", row):
                value = float(said[1].replace(".inf", "inf"))
                lower, upper = (value, upper) if name == "soft_lower" else (lower, value)
        # A joint with little room moves less.
        way = min(way, 0.4 * (upper - lower))
        ways.append(way if upper - place >= place - lower else -way)
    return np.array(ways)


def follow(robot: trifinger.Frontend, places: np.ndarray) -> np.ndarray:
    """Lets all joints be at these places, one row for each step. Returns where they were."""
    seen = np.empty_like(places)
    for step, place in enumerate(places):
        t = robot.append_desired_action(robot.new_action(position=place))
        seen[step] = robot.get_observation(t).position
    return seen


def drive(path: Path, result: Result) -> None:
    """Holds the robot of a configuration, and moves its joints."""
    robot = trifinger.simulate(str(path))
    start = robot.get_observation(robot.append_desired_action(robot.new_action())).position.copy()
    result.joints = len(start)
    result.state = "read"
    way = ways_of(path, start)
    robot = trifinger.simulate(str(path))
    period = robot.session_info().period
    held = follow(robot, np.tile(start, (int(HOLD_TIME / period), 1)))
    result.drift = float(np.abs(held[-1] - start).max())
    result.state = "held"
    steps = np.arange(int(MOVE_TIME / period)) * period
    wave = 0.5 - 0.5 * np.cos(2 * np.pi * steps / MOVE_TIME)
    seen = follow(robot, start + wave[:, np.newaxis] * way)
    reached = np.abs(seen - held[-1]).max(axis=0) >= 0.5 * np.abs(way)
    result.moved = int(reached.sum())
    result.state = "runs"


def drive_and_print(path: Path) -> None:
    """Drives a robot, and prints what became of it as JSON."""
    result = Result(str(path), "refused")
    try:
        drive(path, result)
    except (trifinger.errors.Error, ValueError) as error:
        result.sentence = " ".join(str(error).split())[:600]
    print(json.dumps(asdict(result)))


def survey(path: Path, root: Path) -> Result:
    """Says what became of a description."""
    name = str(path.relative_to(root))
    with tempfile.TemporaryDirectory() as folder:
        try:
            configuration, problem = write_configuration(path, Path(folder), root)
            if configuration is None:
                return Result(name, "refused", sentence=problem)
            fill_in(configuration)
            command = [sys.executable, __file__, "--drive", str(configuration)]
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=TIMEOUT, check=False
            )
        except subprocess.TimeoutExpired:
            return Result(name, "refused", sentence=f"it takes more than {TIMEOUT} s")
    if done.returncode != 0:
        return Result(name, "refused", sentence=last_sentence(done.stderr))
    return Result(**(json.loads(done.stdout.splitlines()[-1]) | {"file": name}))


def print_table(results: list[Result]) -> None:
    """Prints how many robots have come how far, and why the others have not."""
    for result in sorted(results, key=lambda result: result.state != "runs"):
        moved = f"{result.moved}/{result.joints}"
        row = f"{result.state:8}{moved:>8}{result.drift:10.4f}  {result.file}"
        print(row + (f": {result.sentence}" if result.sentence else ""))
    states = [result.state for result in results]
    runs = states.count("runs")
    print(
        f"{len(results)} descriptions with a joint: {len(states) - states.count('refused')} read, "
        f"{runs + states.count('held')} held, {runs} moved, {states.count('refused')} refused"
    )
    joints = sum(result.joints for result in results if result.state == "runs")
    arrived = sum(result.moved for result in results)
    print(
        f"{arrived} of {joints} joints came where they were sent; "
        f"{sum(r.drift < MAX_DRIFT for r in results if r.state == 'runs')} of {runs} robots held "
        f"their pose within {MAX_DRIFT} rad"
    )


def main() -> int:
    """Surveys all robots; succeeds if enough of them move."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="*", type=Path, default=[FETCHED])
    parser.add_argument("--only", default="", help="descriptions with this text in their path")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--drive", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.drive:
        drive_and_print(options.drive)
        return 0
    pairs = [
        (path, folder)
        for folder in options.folders
        for path in descriptions(folder.resolve())
        if options.only in str(path)
    ]
    with ThreadPoolExecutor(options.jobs) as pool:
        results = list(pool.map(lambda pair: survey(*pair), pairs))
    print_table(results)
    if options.json:
        options.json.write_text(json.dumps([asdict(result) for result in results], indent=1))
    runs = sum(result.state == "runs" for result in results)
    return 0 if results and runs >= MIN_SHARE * len(results) else 1


if __name__ == "__main__":
    sys.exit(main())
