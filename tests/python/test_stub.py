# SPDX-License-Identifier: BSD-3-Clause
import re
import runpy
from pathlib import Path

import pytest
import trifinger

ROOT = Path(__file__).parents[2]
WRITER = ROOT / "tools" / "write_stub.py"


def test_the_committed_stub_is_that_of_the_module(tmp_path: Path) -> None:
    assert trifinger.__version__
    writer = runpy.run_path(str(WRITER))
    made = tmp_path / "_trifinger.pyi"
    writer["write"](made)
    if made.read_text() != writer["STUB"].read_text():
        pytest.fail("the module has changed; write its stub again: python tools/write_stub.py")


def test_the_options_of_environments_are_those_of_the_module() -> None:
    writer = runpy.run_path(str(WRITER))
    if writer["options"]() != writer["OPTIONS"].read_text():
        pytest.fail("the options have changed; write them again: python tools/write_stub.py")


def test_only_fields_of_robots_that_nobody_knows_are_any() -> None:
    writer = runpy.run_path(str(WRITER))
    code = [
        line
        for line in writer["STUB"].read_text().splitlines()
        if re.search(r"[^\w .]\s*Any\b|\.Any\b|\bAny:", line)
    ]
    assert [line.strip() for line in code] == [
        "from typing import Annotated, Any, Literal, overload",
        "def __getattr__(self, name: str) -> Any: ...",
    ]
