# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger benchmark`."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, get_args, get_type_hints

from trifinger import extras
from trifinger._trifinger import task_names
from trifinger.commands import command_line
from trifinger.commands.command_line import ArgumentParser, add_json, add_output, say, say_json
from trifinger.environment_options import OptionFields
from trifinger.errors import InvalidArgument
from trifinger.progress import Progress
from trifinger.whole_file import whole_file

if TYPE_CHECKING:
    from trifinger.benchmark import Actor

TASKS = [task for task in task_names() if task not in ("finger_reach", "throw")]  # benchmarks


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger benchmark`."""
    parser = ArgumentParser(
        prog="trifinger benchmark",
        description="Judge policies and controllers over fixed seeds, in a table that others can "
        "repeat. Without a task or policy, list the tasks.",
        epilog="Tasks:\n  " + "\n  ".join(TASKS) + "\n"
        "Examples:\n"
        "  trifinger benchmark --policy reach/reach.policy\n"
        "  trifinger benchmark push lift --controller my_controllers:Pusher -o table",
    )
    parser.add_argument(
        "tasks", nargs="*", metavar="TASK", help="of those below; default: those of the policies"
    )
    parser.add_argument(
        "--policy",
        action="append",
        default=[],
        type=Path,
        metavar="FILE",
        help="a file that `trifinger train` wrote; may be said again",
    )
    parser.add_argument(
        "--controller",
        action="append",
        default=[],
        metavar="MODULE:CLASS",
        help="a controller of your own, or zero, or random, in each task; may be said again; "
        "default without a policy: zero and random",
    )
    parser.add_argument(
        "--condition",
        choices=get_args(get_type_hints(OptionFields)["condition"]),
        default="as documented",
        help="of the simulated robots; default: as documented",
    )
    parser.add_argument(
        "--robot-config",
        metavar="NAME|FILE",
        help="configuration of the simulated robots; default: of the one that the task is for",
    )
    parser.add_argument(
        "--episodes", type=int, help="less than the benchmark's, for a look: the table says so"
    )
    add_output(parser, "folder for the table as .md, .csv and .json", "FOLDER")
    add_json(parser)
    arguments = parser.parse_args(words)
    return command_line.run(lambda: run(arguments))


def run(arguments: argparse.Namespace) -> None:
    """Lists the benchmarks, or judges what was named in them."""
    extras.require("learning", "gymnasium")
    from trifinger import benchmark

    policies = [benchmark.policy(file) for file in arguments.policy]
    tasks = list(dict.fromkeys(arguments.tasks or [str(one.task) for one in policies]))
    for task in tasks:
        benchmark.require(task)
    if not tasks:
        if arguments.controller or arguments.output or arguments.json:
            raise InvalidArgument(f"a task is needed: {', '.join(TASKS)}, or the --policy of one")
        show()
        return
    if arguments.episodes is not None and arguments.episodes < 1:
        raise InvalidArgument(f"--episodes is {arguments.episodes}, must be at least 1")
    for one in policies:
        if one.task not in tasks:
            raise InvalidArgument(
                f"{one.name} is for the task '{one.task}', which is not among {', '.join(tasks)}"
            )
    names = arguments.controller or ([] if policies else benchmark.REFERENCES)
    controllers = [benchmark.controller(name) for name in dict.fromkeys(names)]
    work: list[tuple[str, Actor]] = [
        (task, one)
        for task in tasks
        for one in (*policies, *controllers)
        if one.task in (None, task)
    ]
    for task in tasks:
        if task not in [named for named, _ in work]:
            raise InvalidArgument(f"nothing acts in '{task}': a --policy or --controller is needed")
    rows = []
    for task, one in work:
        with Progress(f"{task}, {one.name}") as progress:
            rows.append(
                benchmark.judge(
                    task,
                    one,
                    episodes=arguments.episodes,
                    condition=arguments.condition,
                    robot=arguments.robot_config,
                    watch=progress.update,
                )
            )
    report = benchmark.to_dictionary(rows)
    if arguments.output:
        arguments.output.mkdir(parents=True, exist_ok=True)
        for ending, text in (
            ("md", f"{benchmark.table(rows)}\n"),
            ("csv", benchmark.to_csv(rows)),
            ("json", json.dumps(report, indent=2) + "\n"),
        ):
            with whole_file(arguments.output / f"benchmark.{ending}") as part:
                part.write_text(text, encoding="utf-8")
    if arguments.json:
        say_json(report)
    else:
        for line in benchmark.table(rows).splitlines():
            say(line)


def show() -> None:
    """Lists the benchmarks."""
    from trifinger.benchmark import BENCHMARKS
    from trifinger.environments import Options

    for task, one in BENCHMARKS.items():
        say(f"{task:<28}{one.episodes} episodes of {Options.of(task).duration:g} s")
    say("`trifinger benchmark push` judges a controller that does nothing, and one by chance.")
