# SPDX-License-Identifier: BSD-3-Clause
"""Starts the program `trifinger`, which is written in C++ and lies beside the C++ module."""

import os
import sys
from pathlib import Path
from typing import NoReturn

from trifinger import _trifinger


def main() -> NoReturn:
    """Becomes the program."""
    program = str(Path(_trifinger.__file__).with_name("trifinger"))
    os.execv(program, [program, *sys.argv[1:]])
