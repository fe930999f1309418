# SPDX-License-Identifier: BSD-3-Clause
"""Compiles into build/PRESET; CMakePresets.json says what the presets are."""

import json
import os
import re
from functools import cache
from pathlib import Path

from .setup import PINS
from .steps import ROOT, Steps

PRESETS = ROOT / "CMakePresets.json"
# clang and clang-tidy are faster in large pages.
LARGE_PAGES = {"GLIBC_TUNABLES": "glibc.malloc.hugetlb=1"}


def presets() -> list[str]:
    """Returns the names of the presets that can be built."""
    return [preset["name"] for preset in json.loads(PRESETS.read_text())["buildPresets"]]


@cache
def jobs() -> int:
    """Returns how many compilers run at once: one per processor and 2 GiB of memory."""
    memory = re.search(r"MemAvailable: *(\d+) kB", Path("/proc/meminfo").read_text())
    room = int(memory[1]) // 2**21 if memory else 1
    return max(1, min(len(os.sched_getaffinity(0)), room))


def configure(preset: str, *options: str) -> None:
    """Makes build/PRESET new if it is not there, and sets options of CMake."""
    Steps(preset).run("configure", ["cmake", "--preset", preset, *options])


def build(preset: str, *targets: str) -> None:
    """Compiles targets, or all. DIRECTORY/all means all targets of a directory.

    Raises:
        StepFailed: if something does not compile
    """
    ninja = ROOT / "build" / preset / "build.ninja"
    # Ninja itself notices when a CMakeLists.txt changes.
    if not ninja.exists() or ninja.stat().st_mtime < max(
        path.stat().st_mtime for path in (PRESETS, PINS)
    ):
        configure(preset)
    command = ["cmake", "--build", "--preset", preset, "--parallel", str(jobs())]
    if targets:
        command += ["--target", *targets]
    Steps(preset).run("build", command, **LARGE_PAGES)


def uses(preset: str) -> dict[str, str]:
    """Returns the variables with which programs use the package and the programs of a build."""
    folder = ROOT / "build" / preset
    return {
        "PYTHONPATH": str(folder / "python"),
        "PATH": f"{folder / 'apps'}:{os.environ['PATH']}",
    }
