# SPDX-License-Identifier: BSD-3-Clause
"""Every command works as it is typed first: without an option.

The commands are those that the programs list in their help, so a new one is tested without an edit
here. Where none is missing, a command does what it says; otherwise a sentence says what is missing.
"""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import PROGRAM, StartProgram

pytestmark = pytest.mark.release  # these tests need the programs

LISTED = re.compile(r"^ {2,4}([a-z][a-z-]*) {2,}\S", re.MULTILINE)
SKILL = re.compile(r"^  (\w+) +.*\(trifinger run (\w+)\)$", re.MULTILINE)
LONG_ENOUGH = 4.0
"""Time after which a command that has not ended does what it says [s]."""


# The programs of the Python package are beside the interpreter.
ENVIRONMENT = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}


def help_of(*words: str) -> str:
    """What a command says about itself."""
    return subprocess.run(
        [PROGRAM, *words, "--help"], env=ENVIRONMENT, capture_output=True, text=True, check=False
    ).stdout


def commands(*above: str) -> Iterator[tuple[str, ...]]:
    """Yields all commands below one that list no others."""
    found = list(dict.fromkeys(LISTED.findall(help_of(*above))))
    below = [verb for verb in found if is_command(*above, verb)]
    if above and not below:
        yield above
    for verb in below:
        yield from commands(*above, verb)


def is_command(*words: str) -> bool:
    """True if the last word is a command, not the name of something that the others take."""
    usage = re.search(r"^usage: (.*)", help_of(*words), re.MULTILINE | re.IGNORECASE)
    return usage is not None and usage[1].split()[: len(words) + 1] == ["trifinger", *words]


def skills() -> list[tuple[str, str]]:
    """Each task of `trifinger manipulate` and a robot for it."""
    return SKILL.findall(help_of("manipulate"))


SKILLS = skills() if Path(PROGRAM).exists() else []


def output_of_bare(words: tuple[str, ...], folder: Path) -> tuple[int, str]:
    """Runs a command in an empty folder, in which no robot runs. What goes on is killed."""
    folder.mkdir()
    with subprocess.Popen(
        [PROGRAM, *words],
        cwd=folder,
        env={**ENVIRONMENT, "HOME": str(folder), "BROWSER": "true"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            return process.wait(LONG_ENOUGH), process.communicate()[0]
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return 0, process.communicate()[0]
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def test_every_bare_command_works_or_says_what_it_needs(tmp_path: Path) -> None:
    found = list(commands())
    assert {("list",), ("log", "info"), ("manipulate",), ("export", "lerobot")} <= set(found)
    wrong = []
    for words in found:
        status, text = output_of_bare(words, tmp_path / "-".join(words))
        is_good = status in (0, 1, 2, 3) and "Traceback" not in text
        if status != 0:
            # A sentence; a wrong use comes with the way to the usage.
            is_good = is_good and re.search(r"\w+ \w+ \w+", text) is not None
            if re.search(r"required|usage", text):
                is_good = is_good and re.search(r"--help|^usage: ", text, re.MULTILINE) is not None
        if not is_good:
            wrong.append(f"trifinger {' '.join(words)}: status {status}\n{text}")
    assert not wrong, "\n\n".join(wrong)


def test_every_task_names_its_robot() -> None:
    listed = help_of("manipulate").partition("Tasks:\n")[2].partition("\n\n")[0]
    assert [task for task, _ in SKILLS] == re.findall(r"^  (\w+) ", listed, re.MULTILINE)


@pytest.mark.parametrize(("task", "robot"), SKILLS, ids=[task for task, _ in SKILLS])
def test_every_bare_skill_does_what_it_says(
    start_program: StartProgram, tmp_path: Path, task: str, robot: str
) -> None:
    running = start_program("run", robot, "--name", "sim", "--non-real-time")
    running.wait_for("waits for a user")
    done = subprocess.run(
        [PROGRAM, "manipulate", task], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "manipulate_output/report.json").read_text())
    assert report["is_done"]
    assert "fault" not in running.end()[1]
