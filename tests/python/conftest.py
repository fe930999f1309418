# SPDX-License-Identifier: BSD-3-Clause
"""Every test has a session folder of its own. Hangs are ended by pytest's faulthandler_timeout."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import trifinger
from trifinger import _trifinger

# The folder of the build that the module under test comes from.
BUILD = Path(_trifinger.__file__).parents[2]

FAKE_BACKEND = """
import sys, trifinger
with trifinger.run_fake(sys.argv[1], **eval(sys.argv[2])):
    print("ready", flush=True)
    sys.stdin.read()
"""


class Child:
    """A process that has printed "ready"; it ends when its input does."""

    def __init__(self, *command: str) -> None:
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        line = self.read_line()
        if line != "ready":
            _, errors = self.process.communicate()
            raise AssertionError(f"{command[:3]} did not begin: {line}\n{errors}")

    @property
    def pid(self) -> int:
        return self.process.pid

    def read_line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().rstrip("\n")

    def write_line(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write("\n")
        self.process.stdin.flush()

    def kill(self) -> None:
        """Ends it as `kill -9` does, and waits for that."""
        self.process.kill()
        self.process.communicate()

    def finish(self) -> tuple[int, str]:
        """Ends its input, waits for the end and returns its exit status and what it said."""
        output, errors = self.process.communicate()
        return self.process.returncode, output + errors


StartChild = Callable[..., Child]


@pytest.fixture(autouse=True)
def session_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "sessions"
    folder.mkdir()
    monkeypatch.setenv("TRIFINGER_SESSION_DIR", str(folder))
    return folder


@pytest.fixture
def start_child() -> Iterator[StartChild]:
    """Starts processes that do not outlive the test."""
    children: list[Child] = []

    def start(*command: str) -> Child:
        children.append(Child(*command))
        return children[-1]

    yield start
    for child in children:
        if child.process.poll() is None:
            child.kill()


@pytest.fixture
def start_python(start_child: StartChild) -> StartChild:
    """Runs a Python program, given as text, in a process of its own."""

    def start(program: str, *arguments: str) -> Child:
        return start_child(sys.executable, "-c", program, *arguments)

    return start


@pytest.fixture
def start_fake(start_python: StartChild) -> StartChild:
    """Runs the back-end of a fake robot in a process of its own, with the options of run_fake()."""

    def start(name: str, **options: object) -> Child:
        return start_python(FAKE_BACKEND, name, repr(options))

    return start


@pytest.fixture
def start_foreign(start_child: StartChild) -> StartChild:
    """Runs a back-end with a robot that Python has never heard of."""

    def start(robot: str, name: str) -> Child:
        return start_child(str(BUILD / "tests/python/foreign_backend"), robot, name)

    return start


@pytest.fixture
def robot() -> Iterator[trifinger.Frontend]:
    """A fake robot inside the test."""
    robot = trifinger.fake()
    yield robot
    robot.close()
