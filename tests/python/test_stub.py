# SPDX-License-Identifier: BSD-3-Clause
from pathlib import Path

import pytest
import trifinger
from nanobind import stubgen

ROOT = Path(__file__).parents[2]
STUB = "python/trifinger/_trifinger.pyi"
PATTERNS = "bindings/stub_patterns.txt"


def test_the_committed_stub_is_that_of_the_module(tmp_path: Path) -> None:
    assert trifinger.__version__
    made = tmp_path / "_trifinger.pyi"
    arguments = ["--quiet", "--exclude-values", "-m", "trifinger._trifinger"]
    stubgen.main([*arguments, "-p", str(ROOT / PATTERNS), "-o", str(made)])
    if made.read_text() != (ROOT / STUB).read_text():
        pytest.fail(
            "the module has changed; write its stub again:\n"
            f"python -m nanobind.stubgen {' '.join(arguments)} -p {PATTERNS} -o {STUB}"
        )
