# SPDX-License-Identifier: BSD-3-Clause
"""Finds the program `trifinger`, which is written in C++ and is part of this package."""

from pathlib import Path


def path() -> str:
    """The path of the program."""
    return str(Path(__file__).parents[1] / "trifinger")
