# SPDX-License-Identifier: BSD-3-Clause
"""Measures in separate processes and folders, and removes the folders afterwards."""

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

FOLDER = "trifinger-benchmarks-"  # the number of the process follows
END_TIME = 10.0  # time that a measure may take to end by itself [s]


class MeasureError(Exception):
    """A measure ended with an error."""


@dataclass(frozen=True)
class Measure:
    """A measure, which runs in a process of its own."""

    name: str
    table: str  # table in benchmarks/README.md
    is_python: bool = False
    reference: str = ""  # the measure whose row it is compared with; empty for none

    def command(self) -> list[str]:
        """The command that starts it."""
        if self.is_python:
            program = [sys.executable, str(Path(__file__).with_name("python_measures.py"))]
        else:
            program = [str(cpp_program())]
        return [*program, self.name]


def cpp_program() -> Path:
    """The program with the measures in C++, from the build that Python imports `trifinger` from."""
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
    on_progress: Callable[[float], None],
) -> None:
    """Runs a measure in a process of its own. Yields each row as soon as it is measured.

    The process inherits this one's processors, priority and limits. Changes that it makes to them,
    and everything that it starts, end with it. `rows` are the rows measured before: some measures
    compare themselves with another one.
    Raises MeasureError if the process ends with an error.
    """
    process: subprocess.Popen[str] | None = None
    try:
        with tempfile.TemporaryFile("w+") as known, _delayed_interrupts() as allow_interrupts:
            json.dump([row.json() for row in rows], known)
            known.seek(0)
            process = subprocess.Popen(
                [*measure.command(), *(["--quick"] if quick else [])],
                stdin=known,
                stdout=subprocess.PIPE,
                text=True,
                process_group=0,
                preexec_fn=allow_interrupts,
            )
        state: dict[str, Any] = {}
        for line in process.stdout or ():
            match json.loads(line):
                case {"process": found}:
                    state = found
                case {"done": done, "total": total}:
                    on_progress(done / total)
                case {"row": row}:
                    on_row(Row(**{**row, "process": state}))
        process.wait()
    finally:
        if process is not None:
            _end(process)
    if process.returncode != 0:
        raise MeasureError(f"measure '{measure.name}' ended with status {process.returncode}")


@contextlib.contextmanager
def _delayed_interrupts() -> Iterator[Callable[[], object]]:
    """Delays signals that end the run: an interrupted start leaves a process that nobody ends.

    Provides a function that allows them again, for the process that is started.
    """
    ends = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ends)

    def allow() -> object:
        return signal.pthread_sigmask(signal.SIG_SETMASK, before)

    try:
        yield allow
    finally:
        allow()


def _end(process: subprocess.Popen[str]) -> None:
    """Ends a measure and everything that it has started: its process group."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGTERM)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(END_TIME)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@contextlib.contextmanager
def folders() -> Iterator[None]:
    """Provides separate folders for sessions, logs and temporary files of everything started here.

    The folders are removed at the end of the block, also on Ctrl-C and SIGTERM. If a run was
    killed, the next one removes its folders.
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
