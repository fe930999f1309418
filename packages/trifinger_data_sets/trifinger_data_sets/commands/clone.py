# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger clone`.

Optional packages are imported only when the command runs, so a missing one is a one-line error.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from trifinger import extras
from trifinger.commands import command_line
from trifinger.commands.command_line import ArgumentParser, add_output, say
from trifinger.errors import InvalidArgument
from trifinger.progress import Progress


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger clone`."""
    arguments = parse(words)
    return command_line.run(lambda: clone(arguments))


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(
        prog="trifinger clone",
        description="Train a policy to act as in a data set (docs/data_sets.md).",
        epilog="Example:\n"
        "  trifinger clone trifinger/reach-v0 -o reach.policy     a data set of Minari\n"
        "  trifinger clone push -o push.policy                    the folder of a LeRobotDataset\n"
        "  trifinger evaluate reach.policy                        how well it does",
    )
    parser.add_argument("data_set", metavar="DATASET", help="what `trifinger export` has written")
    add_output(parser, "file of the policy", required=True)
    parser.add_argument("--epochs", type=int, default=100, help="rounds of learning; default: 100")
    parser.add_argument(
        "--layers",
        type=int,
        nargs="+",
        default=[256, 256],
        metavar="N",
        help="sizes of layers; default: 256 256",
    )
    parser.add_argument("--seed", type=int, default=1, help="of what chance draws; default: 1")
    parser.add_argument("--force", action="store_true", help="replace a file that is there")
    return parser.parse_args(words)


def clone(arguments: argparse.Namespace) -> None:
    """Learns, and says how well the policy predicts actions that it has not learned from."""
    extras.require("learning", "torch")
    from trifinger_data_sets import cloning

    if arguments.output.exists() and not arguments.force:
        raise InvalidArgument(f"{arguments.output} is there already; --force replaces it")
    recipe = cloning.Recipe(
        layers=tuple(arguments.layers), epochs=arguments.epochs, seed=arguments.seed
    )
    examples = cloning.read(arguments.data_set)
    with Progress(arguments.output.name) as progress:
        result = cloning.clone(
            examples,
            arguments.output,
            recipe,
            lambda epoch, _: progress.update(epoch / recipe.epochs),
        )
    say(f"{arguments.output} written: {result}.")
    if examples.note:
        say(f"it is a policy for your own program, not for trifinger run-policy: {examples.note}.")
