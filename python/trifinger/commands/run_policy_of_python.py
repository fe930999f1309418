# SPDX-License-Identifier: BSD-3-Clause
"""The part of `trifinger run-policy` for policies that see images, and of tasks in Python."""

import argparse
import contextlib
import json
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trifinger import extras
from trifinger._trifinger import Policy, connect
from trifinger.arrays import Array
from trifinger.commands import command_line
from trifinger.commands.command_line import ArgumentParser, add_output, add_robot, say
from trifinger.errors import Error, InvalidArgument
from trifinger.own_class import name_of_file
from trifinger.whole_file import whole_file

if TYPE_CHECKING:  # it needs the extra `learning`
    from trifinger.environments.task_environment import Observation


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger run-policy`, with the options of the program that calls this one."""
    parser = ArgumentParser(
        prog="trifinger run-policy",
        description="Runs a trained policy that sees images, or of a task in Python, on a robot.",
    )
    parser.add_argument("policy", type=Path)
    add_robot(parser, "--robot")
    for name, number in (("--episodes", 10), ("--seed", 0), ("--first", 0)):
        parser.add_argument(name, type=int, default=number)
    add_output(parser, "also write the episodes to this file, in JSON")
    parser.add_argument("--precision", choices=("double", "single"), default="double")
    parser.add_argument("--scheduling", choices=("require", "try", "off"), default="try")
    parser.add_argument("--task", help="the task that the file names, MODULE:CLASS")
    parser.add_argument("--marks", help="not possible here: RecordEpisodes marks such episodes")
    arguments = parser.parse_args(words)
    return command_line.run(lambda: run(arguments))


def run(arguments: argparse.Namespace) -> None:
    """Runs the episodes, says how each ended, and writes them to a file if asked."""
    extras.require("learning", "gymnasium")

    if arguments.marks:
        raise InvalidArgument(
            "--marks is for tasks in C++ without images; RecordEpisodes of trifinger_data_sets "
            "marks other episodes"
        )
    if arguments.scheduling == "require":
        raise InvalidArgument("--scheduling require: Python keeps no real-time promise")
    policy = Policy(arguments.policy, precision=arguments.precision)
    missing = {"task", "options", "robot"} - set(policy.metadata)
    if missing:
        raise InvalidArgument(f"{arguments.policy} does not say its '{min(missing)}'")
    named = policy.metadata["task"]
    task = name_of_file("task", named, arguments.task, arguments.policy)
    if task != named:
        raise InvalidArgument(f"{arguments.policy} is for the task '{named}', not for '{task}'")
    with command_line.ended_by_signals(), tempfile.TemporaryDirectory() as folder:
        _episodes(arguments, policy, _configuration_of(policy, Path(folder)))


# The configuration of the robot in the training. Files of older versions only have its name.
def _configuration_of(policy: Policy, folder: Path) -> str:
    text = policy.metadata.get("configuration")
    if text is None:
        return policy.metadata["robot"]
    file = folder / "configuration.yml"
    file.write_text(text)
    return str(file)


def _episodes(arguments: argparse.Namespace, policy: Policy, config: str) -> None:
    from trifinger.environments import Environment, Options
    from trifinger.evaluation import act_of, rows_of, vectors_of

    task = policy.metadata["task"]
    environment = Environment(
        task,
        options=Options.from_json(policy.metadata["options"]),
        config=config,
        connect=lambda: connect(arguments.robot),
    )
    rows = rows_of(policy, task, environment.observation_space, environment.action_space)
    act = act_of(policy)

    def acted(observation: "Observation") -> Array:
        return act(vectors_of(observation, rows)).ravel()

    say(f"'{arguments.robot}' shall do '{task}' with {arguments.policy}", flush=True)
    reports: list[dict[str, Any]] = []
    try:
        with contextlib.closing(environment):
            last = arguments.first + arguments.episodes
            for number in range(arguments.first, last):
                _episode(environment, acted, arguments.seed, number, reports)
    finally:
        # What was done counts, even if more cannot be done.
        successes = sum(report["is_success"] for report in reports)
        say(f"{successes} of {len(reports)} episodes ended at their goal.")
        if arguments.output:
            with whole_file(arguments.output) as part:
                part.write_text(json.dumps(reports, indent=2) + "\n")


def _episode(
    environment: Any,
    act: Callable[["Observation"], Array],
    seed: int,
    number: int,
    reports: list[dict[str, Any]],
) -> None:
    observation, info = environment.reset(seed=seed, options={"episode": number})
    first = environment.process.time_index
    total, count, terminated, truncated = 0.0, 0, False, False
    while not (terminated or truncated):
        observation, reward, terminated, truncated, info = environment.step(act(observation))
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
    reports.append(
        {
            "episode": number,
            "actions": count,
            "total_reward": total,
            "distance": distance.tolist(),
            "is_success": bool(info["is_success"]),
            "is_terminated": terminated,
            "repeated_steps": steps - count * environment.options.steps_per_action,
        }
    )
