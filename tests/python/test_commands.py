# SPDX-License-Identifier: BSD-3-Clause
"""Every command on every page is one that its program takes, with its options and its words.

Tutorials and how-to pages are carried out as a whole: test_pages.py. The commands of other pages
need robots, logs or hours. Each is started in an empty folder, in which no robot runs, and is ended
soon: it may miss a robot or a file, but it must not be told how it is used.
"""

import contextlib
import os
import re
import shlex
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import PROGRAM
from tracked_files import tracked_files
from verbs.main import HELP, check_arguments

pytestmark = pytest.mark.release

ROOT = Path(__file__).parents[2]
COMMAND = re.compile(r"^(?:    |\$ )(?:\$ )?((?:trifinger|\./run) .+)$")
# In some blocks two commands stand side by side, and what a command does may follow it.
SECOND_COLUMN = re.compile(r" {3,}(?=\S)|\s+# ")
# Alternatives and what may be left out, as in a summary.
SUMMARY = re.compile(r"[\[\]|]|\.\.\.")
WRONG_USE = re.compile(
    r"; 'trifinger .*--help' tells more|^usage: |there is no command", re.MULTILINE
)
ELSEWHERE = ("trifinger compat-check",)  # comes with a distribution of its own, which has its tests
LONG_ENOUGH = 4.0
"""Time after which a program has read its arguments, or must have [s]."""


def commands() -> Iterator[tuple[str, str]]:
    """Yields where a command stands, and the command, once for each."""
    seen = set()
    for path in tracked_files(".md"):
        if path.name == "CHANGELOG.md" or path.parts[0] not in ("docs", "README.md"):
            continue
        for number, line in enumerate((ROOT / path).read_text().splitlines(), start=1):
            if found := COMMAND.match(line):
                for part in SECOND_COLUMN.split(found[1]):
                    if part.startswith(("trifinger ", "./run ")) and part not in seen:
                        seen.add(part)
                        yield f"{path}:{number}", part.rstrip(" \\")


def of(program: str) -> pytest.MarkDecorator:
    """The commands of a program, each a test."""
    found = [(place, text) for place, text in commands() if text.startswith(program)]
    return pytest.mark.parametrize(("place", "command"), found, ids=[place for place, _ in found])


@of("trifinger ")
def test_is_taken(place: str, command: str, tmp_path: Path) -> None:
    if SUMMARY.search(command):
        pytest.skip("a summary of options")
    if command.startswith(ELSEWHERE):
        pytest.skip("comes with another distribution")
    words = shlex.split(command)
    with subprocess.Popen(
        [PROGRAM, *words[1:]],
        cwd=tmp_path,
        env={**os.environ, "HOME": str(tmp_path), "BROWSER": "true"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            output, _ = process.communicate(timeout=LONG_ENOUGH)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)
            output = ended(process)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert not WRONG_USE.search(output), f"{place}: {command}\n{output}"


def ended(process: subprocess.Popen[str]) -> str:
    """What a program has printed that was asked to end; one that is busy is killed."""
    try:
        return process.communicate(timeout=10)[0]
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return process.communicate()[0]


@of("./run ")
def test_is_a_verb(place: str, command: str) -> None:
    verb, *arguments = shlex.split(command)[1:]
    if verb == "--help":
        return
    assert re.search(rf"^  {verb} ", HELP, re.MULTILINE), place
    check_arguments(verb, arguments)
