# SPDX-License-Identifier: BSD-3-Clause
"""The program `trifinger`, which is written in C++ and lies in this package."""

from pathlib import Path


def path() -> str:
    """Where the program is."""
    return str(Path(__file__).with_name("trifinger"))
