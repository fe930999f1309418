# SPDX-License-Identifier: BSD-3-Clause
"""Lists the files that the checks read: those that git tracks."""

import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def tracked_files(*suffixes: str) -> list[Path]:
    """Returns the tracked files, relative to the root; if given, only those with `suffixes`."""
    listing = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    paths = [Path(name) for name in listing.split("\0") if name]
    return [
        path
        for path in paths
        if (not suffixes or path.suffix in suffixes) and (ROOT / path).is_file()
    ]


if __name__ == "__main__":
    import sys

    print("\n".join(map(str, tracked_files(*sys.argv[1:]))))
