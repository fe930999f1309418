# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger learn`.

Optional packages are imported only when the command runs, so a missing one is a one-line error.
"""

from __future__ import annotations

import argparse
import os
import shlex
from collections.abc import Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from trifinger import extras
from trifinger._trifinger import observe, running_robot, task_names
from trifinger.commands import command_line
from trifinger.commands.command_line import ArgumentParser, say
from trifinger.commands.program import path as program
from trifinger.commands.train import SETTINGS, add_settings, plan_of, were_said
from trifinger.errors import InvalidArgument
from trifinger.whole_file import replace_file

if TYPE_CHECKING:
    from trifinger.training import Plan

AT_THE_ROBOT = ("listen", "care", "takeover", "judge")  # options that no folder knows


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger learn`."""
    arguments = parse(words)
    return command_line.run(lambda: learn(arguments))


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(
        prog="trifinger learn",
        description="Train a policy on a robot that runs, with nobody beside it. The robot moves "
        "at once, and recovers by itself after faults.",
        epilog="Tasks:\n  " + "\n  ".join(task_names()) + "\n"
        "Example:\n"
        "  trifinger run trifinger_edu --name sim     in one terminal\n"
        "  trifinger learn reach --robot sim          in another\n"
        "  trifinger learn --resume reach             after Ctrl-C or a kill\n"
        "  trifinger learn --join robot:4711 --token reach/token   on another machine",
    )
    parser.add_argument("task", nargs="?", help="one of those below")
    parser.add_argument(
        "--robot",
        default="",
        metavar="NAME",
        help="name of the running robot; default: the only one that runs",
    )
    parser.add_argument(
        "--algorithm",
        metavar="NAME",
        help="how it learns: ddpg, td3, sac, rlpd, or MODULE:CLASS of your own; default: ddpg",
    )
    add_settings(parser, "default: 700")
    parser.add_argument(
        "--from",
        dest="logs",
        action="append",
        default=[],
        type=Path,
        metavar="LOGS",
        help="begin with the experience in this log, or in all logs of this folder",
    )
    parser.add_argument(
        "--listen",
        metavar="HOST:PORT",
        help="wait there for a learner on another machine; default: learn on this one",
    )
    parser.add_argument(
        "--care",
        metavar="COMMAND",
        help="what makes the robot ready after a fault and brings its object back; '' for nothing; "
        "default: trifinger job restore NAME, but nothing within a job",
    )
    parser.add_argument(
        "--takeover",
        action="store_true",
        help="let a person take over at any time, by NAME-takeover: trifinger teleop NAME-takeover",
    )
    parser.add_argument(
        "--judge",
        metavar="keys|FOLDER",
        help="what says that an episode has succeeded, in place of the task: keys of this "
        "terminal, or images, as taught by the training in FOLDER that was judged by keys",
    )
    parser.add_argument("--join", metavar="HOST:PORT", help="learn for a training that waits there")
    parser.add_argument("--token", type=Path, metavar="FILE", help="a copy of its FOLDER/token")
    arguments = parser.parse_args(words)
    if sum(one is not None for one in (arguments.task, arguments.resume, arguments.join)) != 1:
        parser.error("either a task, --resume or --join is needed")
    if (arguments.join is None) != (arguments.token is None):
        parser.error("--join and --token belong together")
    if arguments.join and were_said(parser, arguments, "robot", "logs", *AT_THE_ROBOT):
        parser.error("--join takes --token and --algorithm alone; the rest is said at the robot")
    if not arguments.task and were_said(parser, arguments, *SETTINGS):
        parser.error("--resume and --join go on as the training was begun: they take no settings")
    return arguments


def learn(arguments: argparse.Namespace) -> None:
    """Learns to the end, and writes a report."""
    extras.require("learning")
    from trifinger.training.judge import judge_of
    from trifinger.training.on_robot import RobotTraining, join

    if arguments.join:
        join(arguments.join, arguments.token, arguments.algorithm)
        return
    with command_line.ended_by_signals():
        robot = running_robot(arguments.robot)
        plan, folder = begin(arguments, robot)
        report = partial(say, flush=True)
        judge = judge_of(arguments.judge, report) if arguments.judge else None
        training = RobotTraining(
            plan,
            folder,
            robot,
            report,
            logs=arguments.logs,
            listen=arguments.listen,
            care=care_of(arguments.care, robot),
            care_of_object=("--self-test", "hold") if arguments.care is None else (),
            options=("--takeover",) if arguments.takeover else (),
            is_judged=judge is not None,
        )
        try:
            with judge(training) if judge else nullcontext():
                training.run()
        except KeyboardInterrupt:
            report(f"{command_of(arguments, folder, robot)} goes on.")
            raise
        finally:
            report(f"{training.report()} written.")
        say(f"{training.policy_path} written.")


def command_of(arguments: argparse.Namespace, folder: Path, robot: str) -> str:
    """The command that goes on with a training."""
    words = ["trifinger", "learn", "--resume", str(folder), "--robot", robot]
    for name in ("algorithm", *AT_THE_ROBOT):
        match getattr(arguments, name):
            case str(value):
                words += [f"--{name}", value]
            case True:
                words.append(f"--{name}")
    return shlex.join(words)


def care_of(command: str | None, robot: str) -> list[str] | None:
    """The words of the command that makes the robot ready; None within a job."""
    if command is not None:
        return shlex.split(command)
    is_in_job = "TRIFINGER_JOB_FOLDER" in os.environ  # which takes care by itself
    return None if is_in_job else [program(), "job", "restore", robot]


def begin(arguments: argparse.Namespace, robot: str) -> tuple[Plan, Path]:
    """The plan of a training on this robot and its folder; raises InvalidArgument."""
    from trifinger.training import PLAN, Plan, name_of

    if arguments.resume:
        return Plan.of_folder(arguments.resume, algorithm=arguments.algorithm), arguments.resume
    folder = arguments.output or Path(name_of(arguments.task))
    if (folder / PLAN).exists():
        raise InvalidArgument(f"{folder} has a training; --resume {folder} goes on with it")
    if ":" in arguments.task:
        raise InvalidArgument(
            f"'{arguments.task}' is a task in Python, which no robot learns alone"
        )
    # Relabelled goals have rewards that only the task could give.
    settings = {"relabelled": 0.0} if arguments.judge else {}
    configuration = folder.resolve() / "robot.yml"
    plan = plan_of(arguments, str(configuration), settings)
    folder.mkdir(parents=True, exist_ok=True)
    replace_file(configuration, observe(robot).documents()["configuration.yml"].encode())
    return plan, folder


if __name__ == "__main__":  # how a training starts its learner
    raise SystemExit(main())
