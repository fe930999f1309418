# SPDX-License-Identifier: BSD-3-Clause
"""Measures in processes of their own, in folders of their own, of which nothing is left."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rows import Row

FOLDER = "trifinger-benchmarks-"  # and the number of the process
END_TIME = 10.0  # for a measure to end by itself [s]


class MeasureError(Exception):
    """A measure has ended with an error."""


@dataclass(frozen=True)
class Measure:
    """What a process of its own measures."""

    name: str
    table: str  # of benchmarks/README.md
    is_python: bool = False
    reference: str = ""  # the measure whose row it is compared with; empty for none of them

    def command(self) -> list[str]:
        """How it is started."""
        if self.is_python:
            program = [sys.executable, str(Path(__file__).with_name("python_measures.py"))]
        else:
            program = [str(cpp_program())]
        return [*program, self.name]


def cpp_program() -> Path:
    """The program with the measures in C++, of the build that Python imports `trifinger` from."""
    package = find_spec("trifinger")
    if package is None or package.origin is None:
        sys.exit("the package trifinger is not there: `./run bench` builds it")
    return Path(package.origin).parents[2] / "benchmarks" / "trifinger_benchmarks"


def run(
    measure: Measure,
    *,
    quick: bool,
    rows: Sequence[Row],
    on_row: Callable[[Row], None],
    on_progress: Callable[[int, int], None],
) -> None:
    """Runs a measure in a process of its own, and hands over each row when it is there.

    The process is as fresh as this one: it inherits this one's processors, priority and limits, and
    what it changes of them ends with it, as does whatever it has started. `rows` are what was
    measured before, for measures that compare themselves with another one.
    Raises MeasureError if it ends with an error.
    """
    with tempfile.TemporaryFile("w+") as known:
        json.dump([row.json() for row in rows], known)
        known.seek(0)
        process = subprocess.Popen(
            [*measure.command(), *(["--quick"] if quick else [])],
            stdin=known,
            stdout=subprocess.PIPE,
            text=True,
            process_group=0,
        )
    try:
        state: dict[str, Any] = {}
        for line in process.stdout or ():
            match json.loads(line):
                case {"process": found}:
                    state = found
                case {"done": done, "total": total}:
                    on_progress(done, total)
                case {"row": row}:
                    on_row(Row(**{**row, "process": state}))
        process.wait()
    finally:
        _end(process)
    if process.returncode != 0:
        raise MeasureError(f"measure '{measure.name}' ended with status {process.returncode}")


def _end(process: subprocess.Popen[str]) -> None:
    """Ends a measure and all that it has started, which is in its process group."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGTERM)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(END_TIME)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@contextlib.contextmanager
def folders() -> Iterator[None]:
    """Sessions, logs and temporary files of all that is started here have folders of their own.

    They end with the block, also on Ctrl-C and SIGTERM; those of a run that was killed go when the
    next one begins.
    """
    before = {
        number: signal.signal(number, signal.default_int_handler)
        for number in (signal.SIGTERM, signal.SIGHUP)
    }
    variables = ("TRIFINGER_SESSION_DIR", "TRIFINGER_LOG_DIR", "TMPDIR")
    environment = {name: os.environ.get(name) for name in variables}
    sessions = Path(os.environ.get("TRIFINGER_SESSION_DIR") or "/dev/shm")  # noqa: S108
    files = Path(tempfile.gettempdir())
    own = [root / f"{FOLDER}{os.getpid()}" for root in (sessions, files)]
    try:
        for root in (sessions, files):
            _remove_remains(root)
        for folder in own:
            folder.mkdir(mode=0o700)
        os.environ.update(zip(variables, map(str, (own[0], own[1], own[1])), strict=True))
        yield
    finally:
        for folder in own:
            shutil.rmtree(folder, ignore_errors=True)
        for name, value in environment.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
        for number, handler in before.items():
            signal.signal(number, handler)


def _remove_remains(root: Path) -> None:
    """Removes the folders of runs that were killed."""
    for folder in root.glob(f"{FOLDER}*"):
        number = folder.name.removeprefix(FOLDER)
        if number.isdecimal() and not Path("/proc", number).exists():
            shutil.rmtree(folder, ignore_errors=True)
