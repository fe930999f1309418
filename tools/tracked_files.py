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


def in_room(path: Path) -> Path:
    """Returns the path without the folder of a package: each is laid out as the root is."""
    return Path(*path.parts[2:]) if path.parts[0] == "packages" else path


def public_header(path: Path) -> str | None:
    """Returns LAYER/x.hpp for a header that users include as trifinger/LAYER/x.hpp."""
    match in_room(path).parts:
        case ("include", "trifinger", *names) if path.suffix == ".hpp":
            return "/".join(names)
    return None


if __name__ == "__main__":
    import sys

    print("\n".join(map(str, tracked_files(*sys.argv[1:]))))
