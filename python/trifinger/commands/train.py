# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger train`.

Optional packages are imported only when the command runs, so a missing one is a one-line error.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trifinger import extras
from trifinger._trifinger import task_names
from trifinger.commands import command_line
from trifinger.commands.command_line import (
    ArgumentParser,
    add_output,
    add_view_options,
    say,
    view_of,
)
from trifinger.errors import Error, InvalidArgument

if TYPE_CHECKING:
    from tqdm import tqdm

    from trifinger.training import Plan

ALGORITHMS = ("ddpg", "td3", "sac", "ppo")
# Those that are known to learn a task, the best one first: docs/results/training.md.
LEARNED: Mapping[str, tuple[str, ...]] = {
    "reach": ("ddpg", "td3", "sac"),
    "finger_reach": ("ddpg", "td3", "sac"),
    "push": ("ppo",),
    "lift": ("ppo",),
    "dclaw_turn_fixed": ("ppo",),
}
FROM_STATES = ("lift",)  # learned with `reset_states`
SETTINGS = ("shared", "episodes", "seed", "output", "set")  # of a training that is begun
BEGUN = (*SETTINGS, "algorithm", "untried", "robot_config")


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger train`."""
    arguments = parse(words)
    return command_line.run(lambda: train(arguments))


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(
        prog="trifinger train",
        description="Train a policy in simulation. --resume goes on after Ctrl-C or a kill.",
        epilog="Tasks:\n"
        + "".join(f"  {task:<27} {', '.join(LEARNED.get(task, '-'))}\n" for task in task_names())
        + "Example:\n  trifinger train reach --shared\n  trifinger train --resume reach",
    )
    parser.add_argument(
        "task",
        nargs="?",
        help="one of those below, or MODULE:CLASS of your own: my_tasks:Middle",
    )
    text = "how it learns; default: what is known to learn the task, or ddpg"
    parser.add_argument("--algorithm", choices=ALGORITHMS, help=text)
    text = "train even if nobody knows whether this algorithm learns this task"
    parser.add_argument("--untried", action="store_true", help=text)
    add_settings(parser, "default: 700; by PPO: push 60000, lift 15000, D'Claw 20000")
    parser.add_argument(
        "--robot-config",
        metavar="NAME|FILE",
        help="configuration of the simulated robot; default: of the one that the task is for",
    )
    parser.add_argument(
        "--task",
        dest="said",
        metavar="MODULE:CLASS",
        help="the task of the training that --resume continues, if it is one of your own",
    )
    add_view_options(parser)
    arguments = parser.parse_args(words)
    if (arguments.task is None) == (arguments.resume is None):
        parser.error("either a task or --resume is needed")
    if arguments.said and not arguments.resume:
        parser.error("--task belongs to --resume")
    if arguments.resume and were_said(parser, arguments, *BEGUN):
        parser.error("--resume goes on as the training was begun: it takes no other options")
    return arguments


def add_settings(parser: ArgumentParser, episodes: str) -> None:
    """Adds SETTINGS and --resume, as every training has them; `episodes` is the default, in words.

    `plan_of` reads them.
    """
    parser.add_argument("--shared", action="store_true", help="one policy shared by the fingers")
    parser.add_argument("--episodes", type=int, help=episodes)
    parser.add_argument("--seed", type=int, help="of what chance draws; default: 1")
    add_output(parser, "folder of the training; default: the task's name", "FOLDER")
    parser.add_argument("--resume", type=Path, metavar="FOLDER", help="continue its training")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="a field of trifinger.training.Recipe or trifinger.environments.Options",
    )


def were_said(parser: ArgumentParser, arguments: argparse.Namespace, *names: str) -> bool:
    """Whether any of these arguments is not as it is by default."""
    return any(getattr(arguments, name) != parser.get_default(name) for name in names)


def plan_of(
    arguments: argparse.Namespace, robot_config: str | None, settings: Mapping[str, Any]
) -> Plan:
    """The plan of a new training; what --set says comes before `settings`."""
    from trifinger.training import Plan, parse_setting

    fields = {"episodes": arguments.episodes, "seed": arguments.seed, "robot_config": robot_config}
    return Plan.of(
        arguments.task,
        arguments.algorithm or "ddpg",
        is_shared=arguments.shared,
        settings=dict(settings) | dict(map(parse_setting, arguments.set)),
        **{name: value for name, value in fields.items() if value is not None},
    )


def algorithm_of(task: str, said: str | None) -> str:
    """The algorithm that was said, or that is known to learn the task, or the usual one."""
    usual = "ppo" if task in task_names() else "ddpg"
    return said or next(iter(LEARNED.get(task, ())), usual)


def require_learned(plan: Plan) -> None:
    """Raises InvalidArgument if nobody knows whether a task of the environments is learned so."""
    task, algorithm = plan.task, plan.recipe.algorithm
    known = LEARNED.get(task, ())
    if task not in task_names():
        return
    if algorithm not in known:
        by = f"'{task}' is learned by {' or '.join(known)}" if known else f"nothing learns '{task}'"
        raise InvalidArgument(
            f"{by}, as far as is known; --untried trains by {algorithm} nevertheless"
        )
    if task in FROM_STATES and not plan.recipe.reset_states:
        raise InvalidArgument(
            f"'{task}' is not learned from scratch, as far as is known: --set reset_states=FILE "
            "names states to begin in, or a log; --untried trains nevertheless"
        )


def begin(arguments: argparse.Namespace) -> tuple[Plan, Path]:
    """The plan of a training and its folder; raises InvalidArgument."""
    from trifinger.training import Plan, name_of

    if arguments.resume:
        return Plan.of_folder(arguments.resume, arguments.said), arguments.resume
    arguments.algorithm = algorithm_of(arguments.task, arguments.algorithm)
    plan = plan_of(arguments, arguments.robot_config, {})
    if not arguments.untried:
        require_learned(plan)
    folder = arguments.output or Path(name_of(arguments.task))
    if folder.exists() and any(folder.iterdir()):
        raise InvalidArgument(
            f"{folder} is not empty; --resume {folder} goes on with a training in it"
        )
    return plan, folder


def train(arguments: argparse.Namespace) -> None:
    """Trains to the end, and draws what there is to see of the policy."""
    extras.require("learning")
    from tqdm import tqdm

    from trifinger.training import Training

    view = view_of(arguments)
    plan, folder = begin(arguments)
    # On a terminal, a bar shows the progress below all other lines.
    bar = tqdm(total=plan.episodes, unit=" episodes", disable=None, dynamic_ncols=True)
    report = partial(tqdm.write, file=sys.stderr)
    begun = Training(plan, folder, report, partial(show, bar), Training.save_curve)
    with bar, closing(begun) as training:
        try:
            summary = training.run()
        except KeyboardInterrupt:
            more = f" --task {plan.task}" if ":" in plan.task else ""
            report(f"--resume {folder}{more} goes on.")
            raise
        show(bar, plan.episodes)
        try:
            training.save_figures(view)
        except (Error, ImportError) as error:
            report(f"no figures or film: {error}")
    say(summary)
    say(f"{training.policy_path} written.")


def show(bar: tqdm[Any], episodes: int) -> None:
    """Shows how many episodes have ended. The rate is only of episodes of this process."""
    if bar.n == 0:
        bar.initial = episodes
    bar.update(episodes - bar.n)
