# SPDX-License-Identifier: BSD-3-Clause
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import trifinger
from trifinger import program


@pytest.mark.release
def test_the_demo_moves_the_cube_and_leaves_a_log_and_pictures(tmp_path: Path) -> None:
    result = subprocess.run(
        [sys.executable, "-m", "trifinger.demo", "--output", str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    first_lines, _, _ = result.stdout.partition("\n\n")
    table = dict(re.findall(r"^ +(\w.*?) {2,}(\S.*)$", first_lines, re.MULTILINE))
    assert int(table["steps"]) > 7000
    assert float(table["cube moved by"].removesuffix(" cm")) > 3.0
    for name in ("scene.png", "plot.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    (log,) = tmp_path.glob("*.mcap")
    assert str(log) in result.stdout
    assert trifinger.Log(log).session("demo").steps == int(table["steps"])
    # Both say the same.
    info = subprocess.run(
        [program.path(), "log", "info", log, "--json"], capture_output=True, text=True, check=True
    )
    worst = json.loads(info.stdout)["sessions"][0]["loop"]["lateness_max"]
    assert float(table["lateness, worst"].removesuffix(" ms")) == pytest.approx(
        1e3 * worst, abs=1e-3
    )
