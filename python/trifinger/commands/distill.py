# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger distill`."""

import argparse
import dataclasses
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from trifinger import extras
from trifinger._trifinger import Policy
from trifinger.commands import command_line
from trifinger.commands.command_line import ArgumentParser, add_output, say
from trifinger.progress import Progress


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger distill`."""
    parser = ArgumentParser(
        prog="trifinger distill",
        description="Teach a policy that sees less, such as images, what another one does that "
        "knows all (DAgger).",
        epilog="Examples:\n"
        "  trifinger distill push/push.policy --set observation=images --set camera_size=64\n"
        '  trifinger distill push/push.policy --set "condition=as built" -o built.onnx\n'
        "  trifinger evaluate student.onnx",
    )
    parser.add_argument("teacher", type=Path, help="a file of a policy, as `trifinger train` wrote")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="a field of trifinger.environments.Options that differs from those of the teacher, or "
        "of trifinger.training.distillation.Lessons",
    )
    add_output(parser, "the file that is written; default: student.onnx", "FILE")
    arguments = parser.parse_args(words)
    return command_line.run(partial(_teach, arguments))


def _teach(arguments: argparse.Namespace) -> None:
    extras.require("learning")
    from trifinger.training import parse_setting
    from trifinger.training.distillation import Lessons, distill, options_of_student

    settings = dict(map(parse_setting, arguments.set))
    own = {field.name for field in dataclasses.fields(Lessons)}
    lessons = Lessons(**{name: settings.pop(name) for name in own & settings.keys()})
    teacher = Policy(arguments.teacher)
    options = options_of_student(teacher, **settings)
    output = arguments.output or Path("student.onnx")

    with Progress("rounds") as progress:

        def told(number: int, deviation: float) -> None:
            progress.update(number / lessons.rounds)
            # The teacher acts in the first round.
            if number > 1:
                say(
                    f"round {number} of {lessons.rounds}: actions deviate by {deviation:.3f}",
                    file=sys.stderr,
                )

        distill(teacher, output, options=options, lessons=lessons, watch=told)
    say(f"{output} is a policy: `trifinger evaluate {output}` says how well it does.")
