# SPDX-License-Identifier: BSD-3-Clause
"""Every command on every page is typed by a test, or is one that its program takes.

Pages are run as a whole: test_pages.py. What a page shows for robots, logs or hours that a
test does not have is done by another test, which the block names, or needs what no test has. Each
of these commands is started in an empty folder, in which no robot runs, and is ended soon: it may
miss a robot or a file, but it must not be told how it is used.
"""

import contextlib
import os
import re
import shlex
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pages
import pytest
from conftest import PROGRAM
from pages import NEEDS, ROOT, Block
from verbs.main import HELP, check_arguments

OUTSIDE = re.compile(
    r"^ {4,}(?:\$ )?(?:trifinger|\./run|pip3?|python3?|cmake|ctest|sudo|source|ssh) .+",
    re.MULTILINE,
)
WRONG_USE = re.compile(
    r"; 'trifinger .*--help' tells more|^usage: |there is no command", re.MULTILINE
)
ELSEWHERE = ("trifinger compat-check",)  # comes with a distribution of its own, which has its tests
LONG_ENOUGH = 4.0
"""Time after which a program has read its arguments, or must have [s]."""


def blocks() -> Iterator[tuple[Path, Block]]:
    """Yields the blocks of all pages."""
    for path in pages.documents():
        for block in pages.blocks(path.read_text()):
            yield path.relative_to(ROOT), block


def commands() -> Iterator[tuple[str, str]]:
    """Yields where a command stands that its page does not carry out, and the command."""
    seen = set()
    for path, block in blocks():
        if block.language == "bash" and not block.is_typed:
            for command in pages.commands(block.code):
                text = re.sub(r"\s+# .*", "", command).strip()
                if text not in seen:
                    seen.add(text)
                    yield f"{path}:{block.line}", text


def of(program: str) -> pytest.MarkDecorator:
    """The commands of a program, each a test."""
    found = [(place, text) for place, text in commands() if text.startswith(program)]
    return pytest.mark.parametrize(("place", "command"), found, ids=[place for place, _ in found])


def test_every_command_stands_in_a_block() -> None:
    for path in pages.documents():
        outside = OUTSIDE.search(pages.BLOCK.sub("", path.read_text()))
        assert outside is None, f"{path}: put this into a block of bash: {outside[0]}"


def test_every_command_has_its_test() -> None:
    for path, block in blocks():
        place = f"{path}:{block.line}: {block.use}"
        assert block.language not in ("sh", "console", "shell"), f"{place}: write bash"
        if block.language != "bash" or block.is_typed:
            continue
        if block.test is None:
            assert block.use.partition("needs ")[2] in NEEDS, place
            continue
        file, name = block.test
        assert file.exists(), place
        if file.suffix == ".py":
            assert name, f"{place}: which test?"
            assert re.search(rf"^def {name}\b", file.read_text(), re.MULTILINE), place


@pytest.mark.slow
@of("trifinger ")
def test_is_taken(place: str, command: str, tmp_path: Path) -> None:
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
