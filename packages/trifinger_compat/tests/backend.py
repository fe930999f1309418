# SPDX-License-Identifier: BSD-3-Clause
"""A simulated platform in another process, for programs that want a robot."""

import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import trifinger
from trifinger.commands import program

PACKAGES = Path(__file__).parents[3] / "packages" / "trifinger_compat"


def environment(**values: str) -> dict[str, str]:
    """The environment of programs that use the packages of the original."""
    path = os.pathsep.join([str(PACKAGES), *filter(None, sys.path)])
    return {**os.environ, "PYTHONPATH": path, **values}


def new_name() -> str:
    """A name for a session that no other test has."""
    return f"compat-{uuid.uuid4().hex[:12]}"


def started(
    program: str,
    *words: str | Path,
    stderr: int | None = None,
    variables: Mapping[str, str] | None = None,
) -> "subprocess.Popen[str]":
    """A program of robot_fingers.programs that runs, and its output."""
    return subprocess.Popen(
        [sys.executable, "-m", "robot_fingers.programs", program, *map(str, words)],
        env=environment(**(variables or {})),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
    )


@contextmanager
def running(*words: str | Path, ends: bool = False) -> Iterator[str]:
    """The name of a platform that waits for each action; it must end by itself if it `ends`."""
    name = new_name()
    process = started("pybullet_backend", "--name", name, *words)
    try:
        assert process.stdout is not None
        assert process.stdout.readline().strip() == "The robot is ready."
        yield name
        if not ends:
            process.terminate()
        status = process.wait()
        # It may end by itself when its user has gone, and be told to end at that moment.
        assert status == 0 or (not ends and status == -signal.SIGTERM), status
    finally:
        process.kill()
        process.communicate()
    assert name not in [info.name for info in trifinger.list_sessions()]


@contextmanager
def other_robot(robot: str) -> Iterator[str]:
    """The name of a robot of this project that runs in another process."""
    name = new_name()
    process = subprocess.Popen(
        [program.path(), "run", robot, "--name", name, "--non-real-time"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )
    try:
        while not any(info.name == name for info in trifinger.list_sessions()):
            assert process.poll() is None, process.returncode
            time.sleep(0.01)
        yield name
        process.terminate()
        process.wait()
    finally:
        process.kill()
        process.wait()
