# SPDX-License-Identifier: BSD-3-Clause
"""`python -m trifinger_simulation.tasks move_cube`, as programs of 2020 call it."""

import sys
from collections.abc import Sequence

from trifinger.commands.command_line import ArgumentParser

from trifinger_simulation.tasks import move_cube


def main(words: Sequence[str] | None = None) -> int:
    """Samples a goal, or checks a file with one; returns the exit status."""
    parser = ArgumentParser(prog="python -m trifinger_simulation.tasks")
    tasks = parser.add_subparsers(dest="task", required=True)
    commands = tasks.add_parser("move_cube").add_subparsers(dest="command", required=True)
    commands.add_parser("sample_goal").add_argument("difficulty", type=int)
    commands.add_parser("validate_goal_file").add_argument("file")
    arguments = parser.parse_args(words)
    try:
        if arguments.command == "sample_goal":
            print(move_cube.sample_goal(arguments.difficulty).to_json())
        else:
            move_cube.validate_goal_file(arguments.file)
    except (AssertionError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
