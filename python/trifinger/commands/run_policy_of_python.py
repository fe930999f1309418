# SPDX-License-Identifier: BSD-3-Clause
"""The part of `trifinger run-policy` for policies of tasks in Python."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from trifinger import extras
from trifinger._trifinger import Policy, connect
from trifinger.commands import command_line
from trifinger.commands.command_line import ArgumentParser, say
from trifinger.errors import Error, InvalidArgument


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger run-policy`, with the options of the program that calls this one."""
    parser = ArgumentParser(
        prog="trifinger run-policy",
        description="Runs a trained policy of a task in Python on a robot.",
    )
    parser.add_argument("policy", type=Path)
    parser.add_argument("--robot", default="sim")
    for name, number in (("--episodes", 10), ("--seed", 0), ("--first", 0)):
        parser.add_argument(name, type=int, default=number)
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--precision", choices=("double", "single"), default="double")
    parser.add_argument("--scheduling", help="not used: Python keeps no real-time promise")
    for name in ("--marks", "--task"):
        parser.add_argument(name, help="not possible here: RecordEpisodes marks such episodes")
    arguments = parser.parse_args(words)
    return command_line.run(lambda: run(arguments))


def run(arguments: argparse.Namespace) -> None:
    """Runs the episodes, says how each ended, and writes them to a file if asked."""
    extras.require("learning", "gymnasium")
    from trifinger.environments import Environment, Options

    if arguments.marks or arguments.task:
        raise InvalidArgument(
            "--marks is for tasks in C++; RecordEpisodes of trifinger.data_sets marks episodes of "
            "tasks in Python"
        )
    policy = Policy(arguments.policy, precision=arguments.precision)
    missing = {"task", "options", "robot"} - set(policy.metadata)
    if missing:
        raise InvalidArgument(f"{arguments.policy} does not say its '{min(missing)}'")
    task = policy.metadata["task"]
    environment = Environment(
        task,
        options=Options.from_json(policy.metadata["options"]),
        config=policy.metadata["robot"],
        connect=lambda: connect(arguments.robot),
    )
    if environment.observation_space.shape != (policy.num_inputs,):
        raise InvalidArgument(
            f"the policy takes {policy.num_inputs} numbers, the task '{task}' shows "
            f"{environment.observation_space}"
        )
    say(f"'{arguments.robot}' shall do '{task}' with {arguments.policy}", flush=True)
    try:
        last = arguments.first + arguments.episodes
        reports = [
            _episode(environment, policy, arguments.seed, number)
            for number in range(arguments.first, last)
        ]
    finally:
        environment.close()
    successes = sum(report["is_success"] for report in reports)
    say(f"{successes} of {len(reports)} episodes ended at their goal.")
    if arguments.json:
        arguments.json.write_text(json.dumps(reports, indent=2) + "\n")


def _episode(environment: Any, policy: Policy, seed: int, number: int) -> dict[str, Any]:
    observation, info = environment.reset(seed=seed, options={"episode": number})
    first = environment.process.time_index
    total, count, terminated, truncated = 0.0, 0, False, False
    while not (terminated or truncated):
        observation, reward, terminated, truncated, info = environment.step(policy(observation))
        total, count = total + reward, count + 1
    steps = environment.process.time_index - first
    distance = np.atleast_1d(info["distance"])
    say(
        f"  episode {number:>4}: {count:>4} actions, reward {total:>9.3f}, "
        f"{1e3 * distance.max():>7.2f} mm from the goal{', success' * bool(info['is_success'])}",
        flush=True,
    )
    if info["fault"]:
        raise Error(f"the robot has stopped: {info['fault_text']}")
    return {
        "episode": number,
        "actions": count,
        "total_reward": total,
        "distance": distance.tolist(),
        "is_success": bool(info["is_success"]),
        "is_terminated": terminated,
        "repeated_steps": steps - count * environment.options.steps_per_action,
    }
