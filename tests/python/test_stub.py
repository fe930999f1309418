# SPDX-License-Identifier: BSD-3-Clause
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
