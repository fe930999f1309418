# SPDX-License-Identifier: BSD-3-Clause
"""Options that several commands have."""

import argparse


def add_frames(parser: argparse.ArgumentParser) -> None:
    """Adds --frame, the frames that a guide moves."""
    parser.add_argument(
        "--frame",
        action="append",
        default=[],
        metavar="FRAME",
        help="site, body or geom of the robot's model to move, may be repeated; default: the tips "
        "of a TriFinger, or the ends of a robot from a file",
    )
