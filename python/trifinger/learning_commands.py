# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger train` and `trifinger evaluate`.

Optional packages are imported only when a command runs, so a missing one is a one-line error.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trifinger import command, extras
from trifinger._trifinger import Policy, task_names
from trifinger.errors import Error, InvalidArgument
from trifinger.picture import add_view_options, view_of
from trifinger.progress import Progress

if TYPE_CHECKING:
    from tqdm import tqdm

ALGORITHMS = ("ddpg", "td3", "sac", "ppo")


def train(words: Sequence[str] | None = None) -> int:
    """`trifinger train`."""
    parser = argparse.ArgumentParser(
        prog="trifinger train",
        description="Train a policy in simulation. --resume goes on after Ctrl-C or a kill.",
        epilog="Examples:\n  trifinger train reach --shared\n  trifinger train --resume reach",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("task", nargs="?", help=", ".join(task_names()))
    parser.add_argument("--algorithm", choices=ALGORITHMS, help="default: ddpg")
    parser.add_argument("--shared", action="store_true", help="one policy shared by the fingers")
    parser.add_argument("--episodes", type=int, help="default: 700; for push by PPO 30000")
    parser.add_argument("--seed", type=int, help="default: 1")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="default: the task's name")
    parser.add_argument("--resume", type=Path, metavar="FOLDER", help="continue its training")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="a field of trifinger.training.Recipe or trifinger.environments.Options",
    )
    add_view_options(parser)
    arguments = parser.parse_args(words)
    if (arguments.task is None) == (arguments.resume is None):
        parser.error("either a task or --resume is needed")
    others = (arguments.algorithm, arguments.episodes, arguments.seed, arguments.out)
    if arguments.resume and (
        arguments.shared or arguments.set or any(one is not None for one in others)
    ):
        parser.error("--resume goes on as the training was begun: it takes no other options")

    def run() -> None:
        extras.require("learning")
        from tqdm import tqdm

        from trifinger.training import Plan, Training, parse_setting

        view = view_of(arguments)
        if arguments.resume:
            folder, plan = arguments.resume, Plan.of_folder(arguments.resume)
        else:
            plan = Plan.of(
                arguments.task,
                arguments.algorithm or "ddpg",
                is_shared=arguments.shared,
                settings=dict(map(parse_setting, arguments.set)),
                **{
                    name: getattr(arguments, name)
                    for name in ("episodes", "seed")
                    if getattr(arguments, name) is not None
                },
            )
            folder = arguments.out or Path(arguments.task)
            if folder.exists() and any(folder.iterdir()):
                raise InvalidArgument(
                    f"{folder} is not empty; --resume {folder} goes on with a training in it"
                )
        # On a terminal, a bar shows the progress below all other lines.
        bar = tqdm(total=plan.episodes, unit=" episodes", disable=None, dynamic_ncols=True)
        say = partial(tqdm.write, file=sys.stderr)
        begun = Training(plan, folder, say, partial(show, bar), Training.save_curve)
        with bar, closing(begun) as training:
            try:
                summary = training.run()
            except KeyboardInterrupt:
                say(f"--resume {folder} goes on.")
                raise
            show(bar, plan.episodes)
            try:
                training.save_figures(view)
            except (Error, ImportError) as error:
                say(f"no figures or film: {error}")
        print(summary)
        print(f"{training.policy_path} written.")

    return command.run(run)


def evaluate(words: Sequence[str] | None = None) -> int:
    """`trifinger evaluate`."""
    parser = argparse.ArgumentParser(
        prog="trifinger evaluate",
        description="Let a policy act in simulations, and say how near it comes to its goals.",
    )
    parser.add_argument("policy", type=Path, help="a file that `trifinger train` wrote")
    parser.add_argument("--task", help="default: the task that the file names")
    parser.add_argument("--episodes", type=int, default=50)
    parser.add_argument(
        "--seed", type=int, default=1_000_000, help="of the first episode; each later one adds 1"
    )
    parser.add_argument(
        "--json", action="store_true", help="print JSON: distances in m, success from 0 to 1"
    )
    arguments = parser.parse_args(words)

    def run() -> None:
        extras.require("learning", "gymnasium")
        from trifinger import evaluation

        policy = Policy(arguments.policy)
        task = arguments.task or policy.metadata.get("task")
        if not task:
            raise InvalidArgument(f"{arguments.policy} does not say its task: --task is needed")
        if arguments.episodes < 1:
            raise InvalidArgument(f"--episodes is {arguments.episodes}, must be at least 1")
        print(f"{task}: {policy.metadata.get('options', 'its own options')}", file=sys.stderr)
        with Progress("episodes") as progress:
            result = evaluation.evaluate(
                policy, task, arguments.episodes, arguments.seed, progress.update
            )
        print(result.summary().to_json() if arguments.json else result.summary())

    return command.run(run)


def show(bar: tqdm[Any], episodes: int) -> None:
    """Shows how many episodes have ended. The rate is only of episodes of this process."""
    if bar.n == 0:
        bar.initial = episodes
    bar.update(episodes - bar.n)
