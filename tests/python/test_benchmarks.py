# SPDX-License-Identifier: BSD-3-Clause
import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
KEYS = {"measure", "value", "unit", "reference", "ratio", "reach", "holds"}


@pytest.mark.release
def test_the_benchmarks_write_the_rows_that_they_promise(tmp_path: Path) -> None:
    table = tmp_path / "figures.json"
    subprocess.run(
        [
            sys.executable,
            str(ROOT / "benchmarks" / "run_benchmarks.py"),
            "--quick",
            "--json",
            str(table),
        ],
        stdout=subprocess.DEVNULL,
        timeout=110,
        check=True,
    )
    rows = json.loads(table.read_text())
    # The figures themselves are for a quiet machine: here only that there are some.
    assert len(rows) >= 9
    for row in rows:
        assert row.keys() >= KEYS
        assert row["value"] >= 0.0
        assert isinstance(row["holds"], bool)
