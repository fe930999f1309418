# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger sweep`."""

import argparse
import ast
import itertools
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args, get_type_hints

from trifinger import extras
from trifinger.commands import command_line
from trifinger.commands.command_line import ArgumentParser, add_output, ended_by_signals, say
from trifinger.commands.train import ALGORITHMS, algorithm_of, require_learned, were_said
from trifinger.environment_options import OptionFields
from trifinger.errors import Error, InvalidArgument
from trifinger.sweep.executors import EXECUTORS

if TYPE_CHECKING:
    from trifinger.sweep.trials import Row, Sweep
    from trifinger.training import Plan

CONDITIONS = get_args(get_type_hints(OptionFields)["condition"])
# Options that only trainings have, only evaluations, and both.
OF_TRAININGS = ("algorithm", "untried", "shared", "set", "robot_config", "wandb")
OF_EVALUATIONS = ("conditions",)
OF_BOTH = ("seeds", "episodes", "output")
OWN_AXES = ("task", "algorithm", "seed")  # of the table, also if they have one value


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger sweep`."""
    arguments = parse(words)
    return command_line.run(lambda: sweep(arguments))


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(
        prog="trifinger sweep",
        description="Train, or evaluate policies, with several seeds and settings, and write a "
        "table. A LIST has commas. --resume goes on after Ctrl-C or a kill.",
        epilog="Examples:\n"
        "  trifinger sweep reach --seeds 1-4 --set learning_rate=1e-3,1e-4 -o rates\n"
        '  trifinger sweep --policies rates/trials/*/*.policy --conditions "as built,worn"\n'
        "  trifinger sweep --resume rates --executor slurm",
    )
    add = parser.add_argument
    add("tasks", nargs="*", default=[], help="what is trained, as for `trifinger train`")
    add("--policies", type=Path, nargs="+", metavar="FILE", help="evaluate these instead")
    add("--resume", type=Path, metavar="FOLDER", help="continue its sweep instead")
    add("--seeds", metavar="LIST", help="such as 1-4,7; default: 1, of evaluations 1000000")
    add("--episodes", type=int, help="of each training, or evaluated ones; default of these: 50")
    add("--algorithm", metavar="LIST", help="how it learns; default: as for `trifinger train`")
    add("--untried", action="store_true", help="as for `trifinger train`")
    add("--shared", action="store_true", help="one policy shared by the fingers")
    add("--set", action="append", default=[], metavar="KEY=LIST", help="as for `trifinger train`")
    add("--robot-config", metavar="NAME|FILE", help="as for `trifinger train`")
    add("--wandb", metavar="PROJECT", help="show learning curves with Weights & Biases, too")
    text = f"of evaluated robots: {', '.join(CONDITIONS)}; default: that of the training"
    add("--conditions", metavar="LIST", help=text)
    add_output(parser, "folder of the sweep; default: sweep", "FOLDER")
    text = "where trials run: in processes of this machine, by Ray, or as an array job of Slurm"
    add("--executor", choices=EXECUTORS, default="processes", help=f"{text}; default: processes")
    add("--jobs", type=int, help="trials at once; default: one for each processor")
    text = "a task of your own, which --policies or --resume may run; repeatable"
    add("--task", action="append", default=[], metavar="MODULE:CLASS", help=text)
    add("--index", type=int, metavar="NUMBER", help="run this trial of --resume only, in here")
    arguments = parser.parse_args(words)
    if sum(map(bool, (arguments.tasks, arguments.policies, arguments.resume))) != 1:
        parser.error("either tasks, --policies or --resume is needed")
    excluded: tuple[str, ...] = OF_TRAININGS
    if arguments.tasks:
        excluded = (*OF_EVALUATIONS, "task", "index")
    elif arguments.resume:
        excluded = (*OF_TRAININGS, *OF_EVALUATIONS, *OF_BOTH)
    for name in excluded:
        if were_said(parser, arguments, name):
            kind = "tasks" if arguments.tasks else "--resume" if arguments.resume else "--policies"
            parser.error(f"--{name.replace('_', '-')} does not go with {kind}")
    return arguments


def sweep(arguments: argparse.Namespace) -> None:
    """Runs a trial, or all that have no result yet, and then writes the tables."""
    extras.require("learning")
    from trifinger.sweep.trials import TABLES, Sweep

    if arguments.jobs is not None and arguments.jobs < 1:
        raise InvalidArgument(f"--jobs is {arguments.jobs}, must be at least 1")
    if arguments.resume:
        this = Sweep.of_folder(arguments.resume, arguments.task)
    else:
        this = begin(arguments)
    if arguments.index is not None:
        return this.run_trial(arguments.index, lambda line: say(line, flush=True))
    try:
        with ended_by_signals():
            failed = this.run(
                arguments.executor, arguments.jobs, lambda line: say(line, file=sys.stderr)
            )
    except KeyboardInterrupt:
        say(f"--resume {this.folder} goes on.", file=sys.stderr)
        raise
    say((this.folder / TABLES[1]).read_text().rstrip())
    if failed:
        raise Error(
            f"{len(failed)} of {len(this.trials)} trials have failed, such as trial {failed[0]}: "
            f"{this.why(failed[0])}. {this.folder_of(failed[0])} has what it has printed; --resume "
            "tries again"
        )
    return None


def begin(arguments: argparse.Namespace) -> "Sweep":
    """The sweep that the options describe, in a new folder; raises InvalidArgument."""
    from trifinger.evaluation import SEED
    from trifinger.sweep.trials import EPISODES, Sweep

    folder = arguments.output or Path("sweep")
    if arguments.tasks:
        return Sweep.of_trainings(folder, list(plans_of(arguments)), arguments.wandb)
    conditions = arguments.conditions.split(",") if arguments.conditions else [None]
    for condition in arguments.conditions.split(",") if arguments.conditions else ():
        if condition not in CONDITIONS:
            raise InvalidArgument.of_name("condition", condition, CONDITIONS)
    seeds = numbers_of(arguments.seeds or str(SEED))
    episodes = EPISODES if arguments.episodes is None else arguments.episodes
    return Sweep.of_evaluations(
        folder, arguments.policies, arguments.task, conditions, seeds, episodes
    )


def plans_of(arguments: argparse.Namespace) -> Iterator[tuple["Row", "Plan"]]:
    """Yields the rows of the table and their plans: all combinations; seeds change fastest."""
    from trifinger.training import Plan

    said = arguments.algorithm.split(",") if arguments.algorithm else [None]
    for one in said:
        if one not in (None, *ALGORITHMS):
            raise InvalidArgument.of_name("algorithm", one, ALGORITHMS)
    axes: dict[str, list[Any]] = {"task": arguments.tasks, "algorithm": said}
    for word in arguments.set:
        name, values = values_of(word)
        if name in (*axes, "seed"):
            raise InvalidArgument(f"'{name}' is said twice, or has an option of its own")
        axes[name] = values
    axes["seed"] = numbers_of(arguments.seeds or "1")
    fields = {"episodes": arguments.episodes, "robot_config": arguments.robot_config}
    fields = {name: value for name, value in fields.items() if value is not None}
    for combination in itertools.product(*axes.values()):
        chosen = dict(zip(axes, combination, strict=True))
        settings = {name: chosen[name] for name in axes if name not in OWN_AXES}
        chosen["algorithm"] = algorithm_of(chosen["task"], chosen["algorithm"])
        words = (chosen["task"], chosen["algorithm"])
        fields |= {"is_shared": arguments.shared, "seed": chosen["seed"]}
        shown = [name for name in axes if name in OWN_AXES or len(axes[name]) > 1]
        plan = Plan.of(*words, settings=settings, **fields)
        if not arguments.untried:
            require_learned(plan)
        yield {name: chosen[name] for name in shown}, plan


def values_of(word: str) -> tuple[str, list[Any]]:
    """Key and values of KEY=LIST; commas in brackets separate nothing."""
    from trifinger.training import parse_setting

    name, equals, text = word.partition("=")
    if not equals:
        raise InvalidArgument(f"'{word}' is no KEY=LIST")
    try:
        return name, ast.literal_eval(f"[{text}]")
    except (SyntaxError, ValueError):  # words, such as "as built,worn"
        return name, [parse_setting(f"{name}={one}")[1] for one in text.split(",")]


def numbers_of(text: str) -> list[int]:
    """The numbers of a list such as 1-4,7."""
    found: list[int] = []
    for part in text.split(","):
        if not (match := re.fullmatch(r"(\d+)(?:-(\d+))?", part)):
            raise InvalidArgument(f"'{part}' is no number and no range such as 1-4")
        found += range(int(match[1]), int(match[2] or match[1]) + 1)
    if not found or len(found) != len(set(found)):
        raise InvalidArgument(f"'{text}' has no number, or one of them twice")
    return found


if __name__ == "__main__":
    sys.exit(main())
