# SPDX-License-Identifier: BSD-3-Clause
import os
import subprocess
import sys
from pathlib import Path

import pytest
import trifinger

# The package is build/PRESET/python/trifinger, the C++ examples are in build/PRESET/examples.
PROGRAMS = Path(trifinger.__file__).parents[2] / "examples"
EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("name", sorted(path.stem for path in EXAMPLES.glob("*.py")))
def test_shows_what_it_says(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", f"{PROGRAMS}:{os.environ['PATH']}")
    example = subprocess.run(
        [sys.executable, "-W", "error", EXAMPLES / f"{name}.py"], capture_output=True, text=True
    )
    assert example.returncode == 0, example.stdout + example.stderr
    assert example.stdout
    assert example.stderr == ""


def test_comes_in_both_languages() -> None:
    in_cpp = {path.stem for path in EXAMPLES.glob("*.cpp")}
    assert {path.stem for path in EXAMPLES.glob("*.py")} == in_cpp
