# SPDX-License-Identifier: BSD-3-Clause
"""`python -m trifinger_simulation.tasks.move_cube`: goals, evaluation of policies, replays."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from trifinger.commands.command_line import ArgumentParser
from trifinger.whole_file import whole_file
from trifinger_compat.commands import print_result
from trifinger_compat.evaluation import read_pickle, replay, run_policy, write_pickle

from trifinger_simulation.tasks import move_cube

LEVELS = (1, 2, 3, 4)
SAMPLES = 10


class TestSample(NamedTuple):
    """One run of a policy."""

    difficulty: int
    iteration: int
    init_pose_json: str
    goal_pose_json: str
    logfile: str


def samples(folder: Path) -> list[TestSample]:
    """New goals for all levels."""
    return [
        TestSample(
            level,
            i,
            move_cube.sample_goal(-1).to_json(),
            move_cube.sample_goal(level).to_json(),
            str(folder / f"action_log_l{level}_i{i}.p"),
        )
        for level in LEVELS
        for i in range(SAMPLES)
    ]


def evaluate_policy(folder: Path) -> None:
    """Runs ./evaluate_policy.py for each sample."""
    tests = samples(folder)
    write_pickle(folder / "test_data.p", tests)
    for test in tests:
        words = ["python3", "./evaluate_policy.py", str(test.difficulty)]
        words += [test.init_pose_json, test.goal_pose_json, test.logfile]
        run_policy(words, Path(test.logfile))


def replay_one(log: str, level: int, initial_pose: str, goal: str) -> float:
    """The reward of a log."""
    goal_pose = move_cube.Pose.from_json(goal)
    return replay(
        log,
        lambda _, pose: move_cube.evaluate_state(goal_pose, pose, level),
        length=move_cube.episode_length,
        decimals=6,
        initial_pose=move_cube.Pose.from_json(initial_pose),
    )


def replay_all(folder: Path) -> str:
    """Replays all logs of a folder; writes reward.txt there and returns its text."""
    rewards: dict[int, list[float]] = {level: [] for level in LEVELS}
    for test in read_pickle(folder / "test_data.p"):
        reward = replay_one(test.logfile, test.difficulty, test.init_pose_json, test.goal_pose_json)
        rewards[test.difficulty].append(reward)
    lines = []
    total = 0.0
    for level, values in rewards.items():
        lines.append(f"Level {level}: {np.mean(values):.3f} ({np.std(values):.3f})")
        total += level * float(np.mean(values))
    text = "\n".join([*lines, f"Total: {total:.3f}", ""])
    with whole_file(folder / "reward.txt") as part:
        part.write_text(text)
    return text


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(prog="python -m trifinger_simulation.tasks.move_cube")
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("sample_goal").add_argument("--difficulty", type=int, default=4)
    commands.add_parser("goal_from_config").add_argument("file")
    for name in ("evaluate_policy", "replay_all", "evaluate_and_check"):
        commands.add_parser(name).add_argument("directory", type=Path)
    one = commands.add_parser("replay_one")
    one.add_argument("-l", "--logfile", required=True)
    one.add_argument("-d", "--difficulty", type=int, required=True)
    one.add_argument("-i", "--initial-pose", required=True, metavar="JSON")
    one.add_argument("-g", "--goal-pose", required=True, metavar="JSON")
    return parser.parse_args(words)


def run(arguments: Any) -> str:
    """Does what the command says and returns its result."""
    match arguments.command:
        case "sample_goal":
            return move_cube.sample_goal(arguments.difficulty).to_json()
        case "goal_from_config":
            return move_cube.json_goal_from_config(arguments.file)
        case "replay_one":
            words = (arguments.difficulty, arguments.initial_pose, arguments.goal_pose)
            return str(replay_one(arguments.logfile, *words))
        case "replay_all":
            return replay_all(arguments.directory)
    arguments.directory.mkdir(parents=True, exist_ok=True)
    evaluate_policy(arguments.directory)
    return replay_all(arguments.directory) if arguments.command == "evaluate_and_check" else ""


def main(words: Sequence[str] | None = None) -> int:
    """Runs a command; its result is on stdout, an error on stderr."""
    return print_result(lambda: run(parse(words)))


if __name__ == "__main__":
    sys.exit(main())
