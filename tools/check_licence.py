# SPDX-License-Identifier: BSD-3-Clause
"""Checks that every source file names its licence in its first lines."""

import sys
from itertools import islice

from tracked_files import ROOT, tracked_files

LICENCE = "SPDX-License-Identifier: BSD-3-Clause"
SUFFIXES = (".hpp", ".cpp", ".cmake", ".txt", ".py", ".pyi", ".sh", ".toml", ".yaml", ".yml")
NAMES = ("run", ".clang-tidy")
DATA = ("tests/earlier_formats/", "tests/stability/")  # kept as programs have written them


def main() -> int:
    """Checks all tracked source files and returns the exit status."""
    missing = []
    for path in tracked_files():
        is_source = path.suffix in SUFFIXES or path.name in NAMES
        if not is_source or str(path).startswith(DATA):
            continue
        with (ROOT / path).open() as file:
            # A script's first line names its interpreter.
            if not any(LICENCE in line for line in islice(file, 2)):
                missing.append(f"{path}:1: the line '{LICENCE}' is missing.")
    print("\n".join(missing))
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
