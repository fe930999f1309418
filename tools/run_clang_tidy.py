# SPDX-License-Identifier: BSD-3-Clause
"""Runs clang-tidy over a compile database; skips files that passed and have not changed since.

    run_clang_tidy.py BUILD_FOLDER JOBS [tests|analyser]

It checks all files except tests, or with `tests` those. With `analyser`, clang's static analyser
checks all files except tests, which takes as long as all the checks of .clang-tidy.

Files that the release build compiles together are checked together: their headers are read once.
What such a unit includes counts as a header, so misc-unused-using-decls finds nothing there.
A unit that passed is remembered by a hash of everything that can change the outcome: clang-tidy's
version and configuration, the compile command, the file, and all headers of this repository that it
includes.
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
# These are no findings: clang does not know some warnings of g++, and libstdc++ 12 itself uses what
# it calls deprecated.
ARGUMENTS = ["-Wno-unknown-warning-option", "-Wno-deprecated-declarations"]
OPTIONS = ["--quiet", *(f"--extra-arg={argument}" for argument in ARGUMENTS)]
# Two checks are off, because shared layouts need padding and pointer differences.
ANALYSER = (
    "-*,clang-analyzer-*,misc-static-initialization-cycle,"
    "-clang-analyzer-optin.performance.Padding,-clang-analyzer-security.PointerSub"
)
INCLUDE = re.compile(rb'^\s*#\s*include\s*"([^"]+)"', re.MULTILINE)
INCLUDE_FOLDER = re.compile(r" -I *(\S+)")


@cache
def direct_includes(file: Path, folders: tuple[Path, ...] = ()) -> tuple[Path, ...]:
    """Returns the files of this repository that `file` includes from its folder or `folders`."""
    names = [name.decode() for name in INCLUDE.findall(file.read_bytes())]
    candidates = ((place / name).resolve() for name in names for place in (file.parent, *folders))
    return tuple(dict.fromkeys(path for path in candidates if path.is_file()))


def with_includes(entry: dict[str, str]) -> list[Path]:
    """Returns the file of an entry and all of ours that it includes, also indirectly."""
    folders = tuple(Path(name) for name in INCLUDE_FOLDER.findall(entry["command"]))
    file = Path(entry["file"])
    seen = {file}
    queue = [file]
    while queue:
        new = set(direct_includes(queue.pop(), folders)) - seen
        seen |= new
        queue += new
    return sorted(seen)


def sources_of(entry: dict[str, str]) -> list[str]:
    """Returns the file of an entry, or the files that are compiled together in it."""
    file = Path(entry["file"])
    return [str(path) for path in (file, *direct_includes(file)) if path.suffix == ".cpp"]


def size(entry: dict[str, str]) -> int:
    """Returns the size of all of ours that is read for an entry [bytes]."""
    return sum(path.stat().st_size for path in with_includes(entry))


def fingerprint(entry: dict[str, str], common: bytes) -> str:
    """Returns a hash of everything that can change the findings in one entry of the database."""
    digest = hashlib.sha256(common)
    digest.update(entry["command"].encode())
    for file in with_includes(entry):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def tidy(build: Path, options: list[str], file: str) -> str:
    """Returns the findings of clang-tidy in the file; empty if there are none."""
    result = subprocess.run(
        [CLANG_TIDY, *options, "-p", str(build), file], capture_output=True, text=True
    )
    return "" if result.returncode == 0 else result.stdout + result.stderr


def main(build: Path, jobs: int, mode: str) -> int:
    """Checks the files of the database that belong to the mode and returns the exit status."""
    options = [*OPTIONS, f"--checks={ANALYSER}"] if mode == "analyser" else OPTIONS
    # The analyser needs four fifths of its time for tests, and most of its findings there are
    # false.
    ours = {
        str(ROOT / path)
        for path in tracked_files(".cpp")
        if ("tests" in path.parts) == (mode == "tests")
    }
    database = json.loads((build / "compile_commands.json").read_text())
    entries = {entry["file"]: entry for entry in database if ours & set(sources_of(entry))}
    configs = [path for path in tracked_files() if path.name == ".clang-tidy"]
    config = b"".join((ROOT / path).read_bytes() for path in configs)
    version = subprocess.run([CLANG_TIDY, "--version"], check=True, capture_output=True).stdout
    listing = subprocess.run(
        [CLANG_TIDY, "--list-checks", f"--config-file={ROOT / '.clang-tidy'}", *options],
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    common = version + config + shlex.join(options).encode()

    passed = build / f"{mode}_passed"
    passed.mkdir(exist_ok=True)
    marks = {file: passed / fingerprint(entry, common) for file, entry in entries.items()}
    changed = [file for file, mark in marks.items() if not mark.exists()]
    # Large files come first, so that no long one runs alone at the end.
    changed.sort(key=lambda file: (-size(entries[file]), file))

    failures = 0
    with ThreadPoolExecutor(jobs) as pool:
        all_findings = pool.map(lambda file: tidy(build, options, file), changed)
        for file, findings in zip(changed, all_findings, strict=True):
            if findings:
                failures += 1
                print(findings)
            else:
                marks[file].touch()
    for mark in set(passed.iterdir()) - set(marks.values()):
        mark.unlink()

    # The printed number of checks reveals a misspelt glob in .clang-tidy.
    checks = sum(line.startswith("    ") for line in listing.splitlines())
    print(f"{checks} checks, {len(entries)} units, {len(changed)} of them new or changed")
    return 1 if failures else 0


if __name__ == "__main__":
    _, folder, number, *mode = sys.argv
    sys.exit(main(Path(folder).resolve(), int(number), mode[0] if mode else "product"))
