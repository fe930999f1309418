# SPDX-License-Identifier: BSD-3-Clause
"""Executors: each runs commands to their ends, on this machine or on others.

    with contextlib.closing(EXECUTORS["processes"](commands, 4)) as ended:  # 4 at once
        for number in ended: ...

An executor does not say whether a command has succeeded: what it leaves in its files says that.
When the generator is closed, or Ctrl-C ends it, the commands that still run are ended.
"""

import os
import secrets
import select
import shlex
import shutil
import signal
import subprocess
from collections import deque
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from trifinger._trifinger import num_processors
from trifinger.errors import Error


@dataclass(frozen=True)
class Command:
    """A command that needs one processor, in the current folder."""

    words: tuple[str, ...]
    log: Path
    """What it prints is added to this file, in a folder that exists."""


Executor = Callable[[Sequence[Command], int | None], Generator[int, None, None]]
"""Takes commands and how many run at once, if that is limited; yields each number at its end."""


def in_processes(commands: Sequence[Command], jobs: int | None) -> Generator[int, None, None]:
    """Runs commands as processes of this machine; by default one for each processor."""
    waiting = deque(enumerate(commands))
    running: dict[int, tuple[int, subprocess.Popen[bytes]]] = {}  # by descriptors of processes
    try:
        while waiting or running:
            while waiting and len(running) < (jobs or num_processors()):
                number, command = waiting.popleft()
                process = _start(command.words, command.log, None)
                running[os.pidfd_open(process.pid)] = number, process
            for descriptor in select.select(list(running), [], [])[0]:
                number, process = running.pop(descriptor)
                os.close(descriptor)
                process.wait()
                yield number
    finally:
        for _, process in running.values():
            os.killpg(process.pid, signal.SIGTERM)  # with what it has started
        for descriptor, (_, process) in running.items():
            process.wait()
            os.close(descriptor)


def in_ray(commands: Sequence[Command], jobs: int | None) -> Generator[int, None, None]:
    """Runs commands by Ray: on the cluster of RAY_ADDRESS or, without it, on this machine."""
    try:
        ray: Any = import_module("ray")
    except ImportError as error:
        raise Error(f"ray is missing: pip install ray ({error})") from error
    here = Path.cwd()

    def run(words: tuple[str, ...], log: Path) -> None:
        _start(words, log, here).wait()

    remote = ray.remote(num_cpus=1, max_retries=0)(run)
    waiting = deque(enumerate(commands))
    running: dict[Any, int] = {}
    ray.init(log_to_driver=False)
    try:
        while waiting or running:
            while waiting and len(running) < (jobs or len(commands)):
                number, command = waiting.popleft()
                running[remote.remote(command.words, command.log)] = number
            (ended, *_), _ = ray.wait(list(running))
            yield running.pop(ended)
    finally:
        for reference in running:
            ray.cancel(reference, force=True)
        ray.shutdown()


def in_slurm(commands: Sequence[Command], jobs: int | None) -> Generator[int, None, None]:
    """Runs commands as an array job of Slurm; the variables of `sbatch` choose its partition.

    Nothing is yielded before all have ended.
    """
    if not shutil.which("sbatch"):
        raise Error("sbatch is missing: this machine submits no jobs to Slurm")
    lines = [
        f"{number}) exec {shlex.join(command.words)} >>{shlex.quote(str(command.log))} 2>&1 ;;"
        for number, command in enumerate(commands)
    ]
    script = "\n".join(["#!/bin/bash", 'case "$SLURM_ARRAY_TASK_ID" in', *lines, "esac", ""])
    name = f"trifinger-sweep-{secrets.token_hex(4)}"
    # What Slurm itself has to say, as of a job that takes too long.
    output = Path(os.path.commonpath([command.log.parent for command in commands]), "slurm_%a.txt")
    array = f"--array=0-{len(commands) - 1}" + (f"%{jobs}" if jobs else "")
    settings = [array, f"--job-name={name}", f"--output={output}", "--open-mode=append"]
    try:
        done = subprocess.run(
            ["sbatch", "--wait", "--cpus-per-task=1", *settings],
            input=script,
            capture_output=True,
            text=True,
            check=False,
        )
    except BaseException:
        subprocess.run(["scancel", f"--name={name}"], check=False)
        raise
    if done.returncode != 0 and not done.stdout.strip():  # it prints the number of a job
        raise Error(f"Slurm has not taken the jobs: {done.stderr.strip()}")
    yield from range(len(commands))


EXECUTORS: dict[str, Executor] = {"processes": in_processes, "ray": in_ray, "slurm": in_slurm}


def _start(words: tuple[str, ...], log: Path, folder: Path | None) -> subprocess.Popen[bytes]:
    with log.open("ab") as output:
        return subprocess.Popen(
            # Nobody else would end it if this process was killed.
            ["setpriv", "--pdeathsig", "TERM", *words],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,  # Ctrl-C is for this process, which ends the others
        )
