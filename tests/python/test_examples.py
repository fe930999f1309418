# SPDX-License-Identifier: BSD-3-Clause
import os
import subprocess
import sys
from pathlib import Path

import pytest

import trifinger

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_shows_what_it_says(example: Path, tmp_path: Path) -> None:
    # build/PRESET/python/trifinger is where the package is, the C++ programs are in build/PRESET/examples.
    programs = Path(trifinger.__file__).parents[2] / "examples"
    environment = os.environ | {
        "PATH": f"{programs}:{os.environ['PATH']}",
        "TRIFINGER_SESSION_DIR": str(tmp_path),
    }
    result = subprocess.run(
        [sys.executable, "-W", "error", example],
        env=environment,
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stdout
    assert result.stderr == ""


def test_comes_in_both_languages() -> None:
    in_cpp = {path.stem for path in EXAMPLES[0].parent.glob("*.cpp")}
    assert {path.stem for path in EXAMPLES} == in_cpp
