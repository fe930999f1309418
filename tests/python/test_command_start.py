# SPDX-License-Identifier: BSD-3-Clause
"""Ctrl-C ends a command that is written in Python at any moment of its start."""

import os
import random
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import PROGRAM
from link_into_venv import ROOT, scripts, write_scripts

COMMANDS = [name for name, target in scripts().items() if target.startswith("trifinger_launcher:")]
# Python imports this module while it starts. It sends the signal at once, or at an import.
CUSTOMIZE = """
import os, signal, sys

class Interrupt:
    count = {count}
    begins = not "{since}"

    def find_spec(self, name, *_):
        self.begins = self.begins or name == "{since}"
        Interrupt.count -= self.begins
        if Interrupt.count == 0 and self.begins:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupt())
if not Interrupt.count:
    os.kill(os.getpid(), signal.SIGINT)
"""
Start = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Start:
    """Runs a program, which gets SIGINT at an import; 0: while Python itself starts.

    `since` is the name of the import that is the first to be counted.
    """
    programs = tmp_path / "bin"
    programs.mkdir()
    write_scripts(programs)
    monkeypatch.setenv("PATH", f"{programs}:{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}")

    def run(at_import: int, *words: str, since: str = "") -> subprocess.CompletedProcess[str]:
        text = CUSTOMIZE.format(count=at_import, since=since)
        (tmp_path / "sitecustomize.py").write_text(text)
        return subprocess.run(words, capture_output=True, text=True, check=False)

    return run


def assert_interrupted(done: subprocess.CompletedProcess[str]) -> None:
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


# The parts of other commands are started by these.
@pytest.mark.parametrize("name", sorted(set(COMMANDS) - {"trifinger-run-policy-of-python"}))
def test_ctrl_c_ends_a_command_while_it_starts(start: Start, name: str) -> None:
    words = (
        name.removeprefix("trifinger-").replace("log-", "log ").replace("calibrate-", "calibrate ")
    )
    chance = random.Random(name)  # noqa: S311 (not for secrets)
    for at_import in (0, chance.randrange(1, 150)):
        assert_interrupted(start(at_import, PROGRAM, *words.split(), "--help"))


def test_ctrl_c_ends_a_command_that_is_started_without_the_program(start: Start) -> None:
    for at_import in (1, 100):
        assert_interrupted(start(at_import, "trifinger-view", "--help", since="trifinger"))


AT_THE_END = """
import os, signal
from trifinger_launcher import trifinger
from trifinger.commands.command_line import run, say
run(lambda: say("done"))
os.kill(os.getpid(), signal.SIGINT)
"""


def test_ctrl_c_at_the_end_of_a_command_loses_nothing_of_its_output(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)
    done = subprocess.run(
        [sys.executable, "-c", AT_THE_END], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "done\n", "")


def test_ctrl_c_ends_the_launcher_of_the_program(start: Start) -> None:
    launcher = str(ROOT / "python/scripts/trifinger")
    assert_interrupted(start(1, sys.executable, launcher, "list"))


def test_a_command_that_was_started_with_the_signal_ignored_goes_on(start: Start) -> None:
    shell = f"trap '' INT; exec {PROGRAM} view --help"
    done = start(20, "sh", "-c", shell)
    assert (done.returncode, done.stderr) == (0, "")
