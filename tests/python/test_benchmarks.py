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
    # The figures themselves are for a quiet machine: here only that there are some. But no machine
    # is so busy that a process may hang for ever, or a step be lost.
    assert len(rows) >= 9
    for row in rows:
        assert row.keys() >= KEYS
        assert row["value"] >= 0.0
        assert isinstance(row["holds"], bool)
        assert row["value"] == 0.0 or not row["measure"].startswith("random kills")


@pytest.mark.release
def test_a_soak_says_of_everything_whether_it_grew() -> None:
    output = subprocess.run(
        [sys.executable, str(ROOT / "benchmarks" / "soak.py"), "memory", "--minutes", "0.15"],
        stdout=subprocess.PIPE,
        timeout=110,
        text=True,
        check=False,
    ).stdout
    print(output)
    for who in ("back-end", "recorder", "controller"):
        assert f"{who}: memory: first " in output
        assert f"{who}: files: first " in output
    assert "shared memory: first " in output
    assert "allowed 2: flat" in output
