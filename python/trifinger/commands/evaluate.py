# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger evaluate`."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import get_args, get_type_hints

from trifinger import extras
from trifinger._trifinger import Policy
from trifinger.commands import command_line
from trifinger.commands.command_line import ArgumentParser, add_json, say
from trifinger.environment_options import OptionFields
from trifinger.errors import InvalidArgument
from trifinger.own_class import name_of_file
from trifinger.progress import Progress


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger evaluate`."""
    parser = ArgumentParser(
        prog="trifinger evaluate",
        description="Let a policy act in simulations, and say how near it comes to its goals.",
        epilog="Examples:\n"
        "  trifinger evaluate reach/reach.policy\n"
        '  trifinger evaluate reach/reach.policy --condition "as built"',
    )
    parser.add_argument("policy", type=Path, help="a file that `trifinger train` wrote")
    parser.add_argument(
        "--task",
        help="what it shall do; default: what the file names, unless it is a MODULE:CLASS",
    )
    parser.add_argument("--episodes", type=int, default=50, help="how many; default: 50")
    parser.add_argument(
        "--seed", type=int, default=1_000_000, help="of the first episode; each later one adds 1"
    )
    parser.add_argument(
        "--condition",
        choices=get_args(get_type_hints(OptionFields)["condition"]),
        help="of the simulated robots; default: that of the training",
    )
    add_json(parser)
    arguments = parser.parse_args(words)

    def run() -> None:
        extras.require("learning", "gymnasium")
        from trifinger import evaluation

        policy = Policy(arguments.policy)
        named = policy.metadata.get("task", "")
        task = name_of_file("task", named, arguments.task, arguments.policy)
        if not task:
            raise InvalidArgument(f"{arguments.policy} does not say its task: --task is needed")
        if arguments.episodes < 1:
            raise InvalidArgument(f"--episodes is {arguments.episodes}, must be at least 1")
        say(f"{task}: {policy.metadata.get('options', 'its own options')}", file=sys.stderr)
        with Progress("episodes") as progress:
            result = evaluation.evaluate(
                policy,
                task,
                arguments.episodes,
                arguments.seed,
                progress.update,
                arguments.condition,
            )
        say(result.summary().to_json() if arguments.json else result.summary())

    return command_line.run(run)
