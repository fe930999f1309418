# SPDX-License-Identifier: BSD-3-Clause
"""`python -m trifinger_simulation.tasks.move_cube_on_trajectory`: goals, evaluation, replays."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from trifinger.commands.command_line import ArgumentParser
from trifinger.whole_file import whole_file
from trifinger_compat.commands import print_result
from trifinger_compat.evaluation import read_pickle, replay, run_policy, write_pickle

from trifinger_simulation.tasks import move_cube_on_trajectory as task

SAMPLES = 10


def log_of(folder: Path, i: int) -> Path:
    """The log of a run."""
    return folder / f"action_log_{i:02d}.p"


def evaluate_policy(folder: Path, script: str) -> None:
    """Runs a policy for each of ten trajectories."""
    goals = [task.trajectory_to_json(task.sample_goal()) for _ in range(SAMPLES)]
    write_pickle(folder / "test_data.p", goals)
    for i, goal in enumerate(goals):
        log = log_of(folder, i)
        run_policy(["python3", script, goal, str(log)], log)


def replay_one(log: str | Path, goal: str) -> float:
    """The reward of a log."""
    trajectory = json.loads(goal)
    return replay(
        log,
        lambda t, pose: task.evaluate_state(trajectory, t, pose.position),
        length=task.EPISODE_LENGTH,
        decimals=None,
        initial_pose=task.move_cube.Pose(task.INITIAL_CUBE_POSITION),
    )


def replay_all(folder: Path) -> str:
    """Replays all logs of a folder; writes reward.json there and returns its text."""
    goals = read_pickle(folder / "test_data.p")
    rewards = [replay_one(log_of(folder, i), goal) for i, goal in enumerate(goals)]
    summary = {
        "mean": float(np.mean(rewards)),
        "median": float(np.median(rewards)),
        "std": float(np.std(rewards)),
    }
    text = json.dumps(summary)
    with whole_file(folder / "reward.json") as part:
        part.write_text(text)
    return text


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(prog="python -m trifinger_simulation.tasks.move_cube_on_trajectory")
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("sample_goal")
    commands.add_parser("goal_from_config").add_argument("file")
    commands.add_parser("replay_all").add_argument("directory", type=Path)
    for name in ("evaluate_policy", "evaluate_and_check"):
        command = commands.add_parser(name)
        command.add_argument("directory", type=Path)
        command.add_argument("--exec", default="./evaluate_policy.py", metavar="SCRIPT")
    one = commands.add_parser("replay_one")
    one.add_argument("-l", "--logfile", required=True)
    one.add_argument("-t", "--trajectory", required=True, metavar="JSON")
    return parser.parse_args(words)


def run(arguments: Any) -> str:
    """Does what the command says and returns its result."""
    match arguments.command:
        case "sample_goal":
            return task.trajectory_to_json(task.sample_goal())
        case "goal_from_config":
            return task.json_goal_from_config(arguments.file)
        case "replay_one":
            return str(replay_one(arguments.logfile, arguments.trajectory))
        case "replay_all":
            return replay_all(arguments.directory)
    arguments.directory.mkdir(parents=True, exist_ok=True)
    evaluate_policy(arguments.directory, arguments.exec)
    return replay_all(arguments.directory) if arguments.command == "evaluate_and_check" else ""


def main(words: Sequence[str] | None = None) -> int:
    """Runs a command; its result is on stdout, an error on stderr."""
    return print_result(lambda: run(parse(words)))


if __name__ == "__main__":
    sys.exit(main())
