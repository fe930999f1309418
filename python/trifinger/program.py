# SPDX-License-Identifier: BSD-3-Clause
"""Starts the program `trifinger`, which is written in C++ and lies beside the C++ module."""

import os
import sys
from pathlib import Path
from typing import NoReturn

from trifinger import _trifinger


def path() -> str:
    """Where the program is: beside the module where it was installed, else found by its name."""
    installed = Path(_trifinger.__file__).with_name("trifinger")
    return str(installed) if installed.exists() else "trifinger"


def main() -> NoReturn:
    """Becomes the program."""
    program = path()
    # Its commands that are written in Python lie beside Python, which need not be on the PATH.
    # Those in C++ lie beside it.
    folders = [
        os.environ.get("PATH", os.defpath),
        str(Path(sys.executable).parent),
        str(Path(program).parent),
    ]
    os.environ["PATH"] = os.pathsep.join(folders)
    os.execvp(program, [program, *sys.argv[1:]])
