# SPDX-License-Identifier: BSD-3-Clause
"""`python -m trifinger_simulation.tasks.rearrange_dice`: goals and patterns."""

import argparse
import sys
from collections.abc import Sequence
from typing import Any

from trifinger.commands.command_line import ArgumentParser
from trifinger_compat.commands import print_result

from trifinger_simulation.tasks import rearrange_dice
from trifinger_simulation.tasks.rearrange_dice import utils


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(prog="python -m trifinger_simulation.tasks.rearrange_dice")
    commands = parser.add_subparsers(dest="command", required=True)
    sample = commands.add_parser("sample_goal")
    sample.add_argument("--show", action="store_true", help="show the goal from above")
    sample.add_argument("--show-masks", action="store_true", help="show what cameras would see")
    commands.add_parser("goal_from_config").add_argument("file")
    commands.add_parser("create_pattern_template").add_argument("file", nargs="?")
    commands.add_parser("parse_goal_pattern").add_argument("file")
    return parser.parse_args(words)


def show_masks(goal: rearrange_dice.Goal) -> None:
    """Shows what the three cameras would see, in a window of Matplotlib."""
    import matplotlib.pyplot as plt

    import trifinger_simulation
    from trifinger_simulation.camera import load_camera_parameters

    folder = trifinger_simulation.get_data_dir() / "camera_params"
    cameras = load_camera_parameters(folder, "camera{id}_cropped_and_downsampled.yml")
    masks = rearrange_dice.generate_goal_mask(cameras, goal)
    _, axes = plt.subplots(1, len(masks))
    for axis, mask in zip(axes, masks, strict=True):
        axis.imshow(mask)
    plt.show()


def run(arguments: Any) -> str:
    """Does what the command says and returns its result."""
    match arguments.command:
        case "sample_goal":
            goal = rearrange_dice.sample_goal()
            if arguments.show:
                rearrange_dice.visualize_2d(goal)
            if arguments.show_masks:
                show_masks(goal)
            return rearrange_dice.goal_to_json(goal)
        case "goal_from_config":
            return rearrange_dice.json_goal_from_config(arguments.file)
        case "parse_goal_pattern":
            return rearrange_dice.goal_to_json(utils.parse_pattern_file(arguments.file))
    if arguments.file is None:
        return utils.create_empty_pattern()
    utils.create_pattern_template_file(arguments.file)
    return f"{arguments.file} written."


def main(words: Sequence[str] | None = None) -> int:
    """Runs a command; its result is on stdout, an error on stderr."""
    return print_result(lambda: run(parse(words)))


if __name__ == "__main__":
    sys.exit(main())
