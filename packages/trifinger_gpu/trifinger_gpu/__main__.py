# SPDX-License-Identifier: BSD-3-Clause
"""Trains a policy by PPO in simulations that MuJoCo Warp moves: python -m trifinger_gpu."""

import argparse
import functools
import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from trifinger.commands import command_line
from trifinger.commands.command_line import ArgumentParser, say
from trifinger.extras import require

from trifinger_gpu.environment import WarpEnvironment


def main(words: Sequence[str] | None = None) -> int:
    """`python -m trifinger_gpu`."""
    parser = ArgumentParser(
        prog="python -m trifinger_gpu",
        description="Train a policy by PPO; its folder is as `trifinger train` makes it. Begun "
        "again with the same words, the training goes on.",
    )
    parser.add_argument("task", help="as for `trifinger train`")
    parser.add_argument("--device", required=True, help="of physics and networks: cuda:0 or cpu")
    parser.add_argument("--episodes", type=int, help="of all robots; default: as `trifinger train`")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    arguments = parser.parse_args(words)
    return command_line.run(lambda: train(arguments))


def train(arguments: argparse.Namespace) -> None:
    """Trains to the end."""
    require("learning")
    from trifinger.training import Plan, Training, parse_setting

    settings = {"device": "cpu" if arguments.device == "cpu" else "cuda"}
    settings |= dict(map(parse_setting, arguments.set))
    more = {} if arguments.episodes is None else {"episodes": arguments.episodes}
    plan = Plan.of(arguments.task, "ppo", settings=settings, **more)
    make = functools.partial(WarpEnvironment, device=arguments.device)
    training = Training(plan, arguments.output, say, make_simulations=make)
    with closing(training):
        training.run()


if __name__ == "__main__":
    sys.exit(main())
