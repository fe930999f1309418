# SPDX-License-Identifier: BSD-3-Clause
import re
from pathlib import Path
from textwrap import dedent

import pytest

ROOT = Path(__file__).parents[2]
SUFFIXES = {"cpp": ".cpp", "python": ".py"}
BLOCK = re.compile(r"^```(cpp|python)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
README = (ROOT / "README.md").read_text()
BLOCKS = BLOCK.findall(README)


def contains(program: str, block: str) -> bool:
    """Says whether the lines of `block` stand in `program`, one after the other, at any depth."""
    wanted = block.splitlines()
    lines = program.splitlines()
    return any(
        dedent("\n".join(lines[first : first + len(wanted)])).splitlines() == wanted
        for first in range(len(lines) - len(wanted) + 1)
    )


def test_begins_with_the_control_loop_in_both_languages() -> None:
    beginning = README[: README.index("\n## ")]
    (cpp, cpp_loop), (python, python_loop) = BLOCK.findall(beginning)
    assert (cpp, python) == ("cpp", "python")
    assert 'connect<trifinger::TriFinger>("sim")' in cpp_loop
    assert "for (;;)" in cpp_loop
    assert 'connect("sim")' in python_loop
    assert "while True:" in python_loop


@pytest.mark.parametrize(("language", "block"), BLOCKS)
def test_shows_only_lines_of_examples_that_run(language: str, block: str) -> None:
    examples = (ROOT / "examples").glob(f"*{SUFFIXES[language]}")
    assert any(contains(path.read_text(), block) for path in examples), block


def test_finds_lines_at_another_depth_only_as_a_whole() -> None:
    program = "def f():\n    a = 1\n\n    b = 2\n"
    assert contains(program, "a = 1\n\nb = 2\n")
    assert not contains(program, "a = 1\nb = 2\n")
    assert not contains(program, "a = 1\n\nb = 3\n")
