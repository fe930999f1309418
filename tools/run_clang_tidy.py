# SPDX-License-Identifier: BSD-3-Clause
"""Runs clang-tidy over a compile database; leaves out files unchanged since they passed.

    run_clang_tidy.py BUILD_FOLDER [JOBS]

Files of tests are read as they are compiled, several joined by CMake: their headers are read once.

What is remembered is a hash of everything that can change the outcome: clang-tidy's version and
configuration, the compile command, and the file with all headers of this repository it includes.
"""

import hashlib
import json
import re
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

from tracked_files import ROOT, tracked_files

CLANG_TIDY = str(Path(sys.executable).parent / "clang-tidy")
# Warnings of g++ that clang does not know are no finding. The analyser takes most of the time of a
# file; it follows a third of the paths that it would by itself, as many as in its shallow mode.
ARGUMENTS = "-Wno-unknown-warning-option -Xclang -analyzer-config -Xclang max-nodes=75000"
OPTIONS = ["--quiet", *(f"--extra-arg={argument}" for argument in ARGUMENTS.split())]
INCLUDE = re.compile(rb'^\s*#\s*include\s*"([^"]+)"', re.MULTILINE)
JOINED = re.compile(r"/Unity/unity_\d+_cxx\.cxx$")


@cache
def direct_includes(file: Path) -> tuple[Path, ...]:
    """Returns the files of this repository that `file` includes."""
    folders = (file.parent, ROOT / "include", ROOT / "tests")
    names = [name.decode() for name in INCLUDE.findall(file.read_bytes())]
    candidates = ((folder / name).resolve() for name in names for folder in folders)
    return tuple(path for path in candidates if path.is_file())


def with_includes(file: Path) -> list[Path]:
    """Returns the file and all files of this repository that it includes, however indirectly."""
    seen = {file}
    queue = [file]
    while queue:
        new = set(direct_includes(queue.pop())) - seen
        seen |= new
        queue += new
    return sorted(seen)


def fingerprint(entry: dict[str, str], common: bytes) -> str:
    """Returns a hash of all that decides what clang-tidy says about one entry of the database."""
    digest = hashlib.sha256(common)
    digest.update(entry["command"].encode())
    for file in with_includes(Path(entry["file"])):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def tidy(build: Path, file: str) -> str:
    """Returns what clang-tidy finds in the file; empty if there is nothing."""
    result = subprocess.run(
        [CLANG_TIDY, *OPTIONS, "-p", str(build), file], capture_output=True, text=True
    )
    return "" if result.returncode == 0 else result.stdout + result.stderr


def main(build: Path, jobs: int) -> int:
    """Checks all files of the database and returns the exit status."""
    ours = {str(ROOT / path) for path in tracked_files(".cpp")}
    database = json.loads((build / "compile_commands.json").read_text())
    entries = {
        entry["file"]: entry
        for entry in database
        if entry["file"] in ours or JOINED.search(entry["file"])
    }
    configs = [path for path in tracked_files() if path.name == ".clang-tidy"]
    config = b"".join((ROOT / path).read_bytes() for path in configs)
    version = subprocess.run([CLANG_TIDY, "--version"], check=True, capture_output=True).stdout
    listing = subprocess.run(
        [CLANG_TIDY, "--list-checks", f"--config-file={ROOT / '.clang-tidy'}"],
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    common = version + config + shlex.join(OPTIONS).encode()

    passed = build / "clang_tidy_passed"
    passed.mkdir(exist_ok=True)
    marks = {file: passed / fingerprint(entry, common) for file, entry in entries.items()}
    changed = sorted(file for file, mark in marks.items() if not mark.exists())

    failures = 0
    with ThreadPoolExecutor(jobs) as pool:
        all_findings = pool.map(lambda file: tidy(build, file), changed)
        for file, findings in zip(changed, all_findings, strict=True):
            if findings:
                failures += 1
                print(findings)
            else:
                marks[file].touch()
    for mark in set(passed.iterdir()) - set(marks.values()):
        mark.unlink()

    # The number of checks is printed so that a misspelt glob in .clang-tidy is seen.
    checks = sum(line.startswith("    ") for line in listing.splitlines())
    print(f"{checks} checks, {len(entries)} files, {len(changed)} of them new or changed")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]).resolve(), int(sys.argv[2]) if len(sys.argv) > 2 else 1))
