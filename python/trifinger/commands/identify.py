# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger identify`."""

from __future__ import annotations

import argparse
import contextlib
import json
import signal
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from trifinger._trifinger import Frontend, ModelKinematics, connect, read_joint_facts
from trifinger.arrays import Array
from trifinger.commands import command_line
from trifinger.commands.command_line import (
    ArgumentParser,
    add_json,
    add_output,
    ended_by_signals,
    names_of_robots,
    say,
    say_json,
)
from trifinger.commands.program import path as program
from trifinger.errors import Error, InvalidArgument
from trifinger.whole_file import whole_file

CHUNK = 1000  # actions that are sent at once
BEHIND = 3000  # steps from the last action that is sent to those that are looked at
MOST_LAG = 0.5  # of a joint, before the robot is stopped [rad]
HISTORY = "history.jsonl"
LOGS = "logs"


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger identify`."""
    arguments = parse(words)
    return command_line.run(lambda: identify(arguments))


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(
        prog="trifinger identify",
        description="Find out what a robot is like: friction, rotor inertia, torques, play, "
        "delays and masses, each with its interval. Writes a configuration of a simulation that "
        "fits, and a page. With NAME, the robot moves for some minutes; logs are used as they are.",
        epilog="Example:\n"
        "  trifinger identify sim -o fitted          moves the robot 'sim' for five minutes\n"
        "  trifinger identify logs -o fitted         from logs that are there\n"
        "  trifinger identify --check today -o fitted   is it still what it was?",
    )
    parser.add_argument(
        "what", nargs="+", metavar="NAME|LOG", help="a robot that runs, or logs of one robot"
    )
    add_output(parser, "folder of what is written; default: identified", "FOLDER")
    parser.add_argument("--robot", default="", help="name of the robot in logs of several")
    parser.add_argument(
        "--object",
        default="",
        metavar="OBJECT",
        help="identify this object and its contacts, with a robot that was identified before: its "
        "mass from lifts, friction from what slides, softness of tips from presses. NAME presses "
        "its tips on the table, and slides them over table and object",
    )
    parser.add_argument(
        "--robot-config",
        metavar="NAME|FILE",
        help="configuration that is extended; default: the one in the log",
    )
    parser.add_argument(
        "--known",
        choices=("link_mass", "torque_scale"),
        default="",
        help="what is as described; without a known one only ratios are told exactly",
    )
    parser.add_argument(
        "--centers",
        action="store_true",
        help="find the links' centres of mass, too; this takes half as long again, and masses "
        "are less sure",
    )
    parser.add_argument(
        "--seconds", type=float, default=300.0, help="how long the robot moves; default: 300"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the motion; default: 0")
    parser.add_argument(
        "--check",
        action="store_true",
        help="compare with what is in FOLDER; exit status 1 if something has changed",
    )
    add_json(parser)
    arguments = parser.parse_args(words)
    arguments.output = arguments.output or Path("identified")
    return arguments


def identify(arguments: argparse.Namespace) -> int:
    """Records if need be, identifies, and writes or compares."""
    from trifinger.identification import check, identify, read_motion, save
    from trifinger.identification.check import figures_of
    from trifinger.identification.fit import CENTERS
    from trifinger.identification.page import FIGURES
    from trifinger.identification.stiffness import advice

    before = None
    if arguments.check:
        saved = arguments.output / FIGURES
        if not saved.is_file():
            raise InvalidArgument(f"{saved} is not there: -o FOLDER is one that identify has made")
        before = figures_of(json.loads(saved.read_text(encoding="utf-8")))
    logs = arguments.what
    if arguments.object and not arguments.robot_config:
        raise InvalidArgument("--object needs the robot that was identified: --robot-config")
    if arguments.object and arguments.centers:
        raise InvalidArgument("--centers is of the robot itself: identify it without --object")
    if len(logs) == 1 and not Path(logs[0]).exists():
        if logs[0] not in names_of_robots():
            raise InvalidArgument(f"'{logs[0]}' is neither a log nor a robot that runs")
        logs = [record(logs[0], arguments)]
    if arguments.object:
        return _identify_object(logs, arguments)
    motion = read_motion(logs, arguments.robot, arguments.robot_config)
    tell = (lambda _text: None) if arguments.json else say
    has_centers = any(one.name in CENTERS for one in before or ())
    with_centers = arguments.centers or has_centers
    result = identify(motion, arguments.known, tell, with_centers=with_centers)
    if before is not None:
        changes = [str(change) for change in check(before, result.figures)]
        _note(arguments.output / HISTORY, logs, changes)
        if arguments.json:
            say_json({"changed": changes})
        else:
            say(*changes or ["The robot still is what was identified."], sep="\n")
        return 1 if changes else 0
    base = arguments.robot_config or ""
    base = str(Path(base).resolve()) if Path(base).is_file() else base
    training = save(result, arguments.output, base)
    told = len(result.told)
    if arguments.json:
        say_json(
            {
                "figures": told,
                "not_told": len(result.figures) - told,
                "free_run_ratio": result.ratio,
                "train": training,
                "folder": str(arguments.output),
            }
        )
        return 0
    say(
        f"{told} of {len(result.figures)} figures are told. The error of a free run of 1 s is "
        f"{result.ratio:.3f} of what it was.",
        f"{arguments.output} has fitted.yml, vary.json and identified.html.",
        *([advice(training)] if training else []),
        sep="\n",
    )
    return 0


def _identify_object(logs: Sequence[str], arguments: argparse.Namespace) -> int:
    from trifinger.identification.handling import as_rows, identify_handling, save_handling

    figures = identify_handling(logs, arguments.robot_config, arguments.object, arguments.robot)
    path = save_handling(figures, arguments.output, arguments.robot_config)
    if arguments.json:
        say_json({"figures": as_rows(figures), "configuration": str(path)})
        return 0
    for one in figures:
        said = f"{one.value:.4g} ({one.low:.4g} to {one.high:.4g})"
        say(f"{one.name} of {one.joint}: {said if one.is_told else 'not told: ' + one.shown_by}")
    say(f"{path} has them.")
    return 0


def record(robot: str, arguments: argparse.Namespace) -> str:
    """Moves a robot, and returns the folder of the log."""
    from trifinger.identification.excitation import Excitation, Gains

    folder: Path = arguments.output / LOGS / time.strftime("%Y%m%d-%H%M%S")
    folder.mkdir(parents=True)
    with ended_by_signals(), recorder(robot, folder), connect(robot) as frontend:
        info, documents = frontend.session_info(), frontend.documents()
        _, joints, limits = read_joint_facts(
            documents["configuration.yml"], info.type, opens_file=True
        )
        start = np.array(frontend.latest_observation().position)
        gains = None
        if arguments.object:
            rows = _strokes(frontend, limits, start, arguments)
        else:
            model, seed = documents["model.xml"], arguments.seed
            excitation = Excitation(model, joints, limits, info.period, seed)
            rows = {"position": excitation.plan(start, arguments.seconds)}
            gains = Gains(limits)
        count = len(rows["position"])
        say(f"The robot '{robot}' moves for {count * info.period:.0f} s; Ctrl-C ends it.")
        actions = np.repeat(np.array([frontend.new_action()]), CHUNK)
        for first in range(0, count, CHUNK):
            part = actions[: count - first]
            for field, values in rows.items():
                part[field] = values[first : first + CHUNK]
            if gains:
                part["position_kp"] = gains.kp
            last = frontend.append_desired_actions(part)
            seen = max(last - BEHIND, 0)
            if gains:
                gains.look(frontend.get_applied_actions(seen, seen + CHUNK)["torque"])
            lag = np.abs(frontend.get_observation(seen).position - rows["position"][seen])
            if np.max(lag) > MOST_LAG and gains:
                frontend.finish()
                joint = joints[int(np.argmax(lag))]
                raise Error(
                    f"joint '{joint}' of '{robot}' is {np.max(lag):.2f} rad from where it "
                    "should be: something holds it"
                )
        frontend.get_observation(last)
        frontend.finish()
    return str(folder)


def _strokes(
    frontend: Frontend, limits: Mapping[str, Array], start: Array, arguments: argparse.Namespace
) -> dict[str, Array]:
    """Presses and slides the tips on the table, and slides them over the object where it lies."""
    import mujoco

    from trifinger.identification.excitation import strokes

    kinematics = ModelKinematics(arguments.robot_config)
    model = mujoco.MjModel.from_xml_string(frontend.documents()["model.xml"])
    tip = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, kinematics.frames[0])
    if tip < 0 or model.geom_type[tip] != mujoco.mjtGeom.mjGEOM_SPHERE:
        raise InvalidArgument("only tips that are spheres slide: let the robot handle the object")
    seen = frontend.companion("object").latest_observation()
    place = np.array(getattr(seen, arguments.object).position)
    top = place * np.array([1, 1, 2])  # it lies on the table, at z = 0
    radius = float(model.geom_size[tip, 0])
    period = frontend.session_info().period
    return strokes(kinematics, limits, period, start, radius, top)


@contextlib.contextmanager
def recorder(robot: str, folder: Path) -> Iterator[None]:
    """Records a robot in a process of its own."""
    words = [program(), "record", robot, "-o", str(folder)]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL) as process:
        try:
            while not any(folder.iterdir()):
                if process.poll() is not None:
                    raise Error(f"the recorder of '{robot}' has ended")
                time.sleep(0.02)
            yield
        finally:
            process.send_signal(signal.SIGINT)
            process.wait()


def _note(path: Path, logs: Sequence[str], changes: list[str]) -> None:
    """Adds a line to what earlier checks have found."""
    line = {"time": time.strftime("%Y-%m-%dT%H:%M:%S"), "logs": list(logs), "changed": changes}
    old = path.read_text(encoding="utf-8") if path.exists() else ""
    with whole_file(path) as part:
        part.write_text(old + json.dumps(line) + "\n", encoding="utf-8")
