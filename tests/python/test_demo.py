# SPDX-License-Identifier: BSD-3-Clause
import json
import os
import re
import select
import subprocess
import sys
from pathlib import Path

import pytest
import trifinger
from conftest import StartChild
from trifinger.commands import program
from trifinger.commands.demo import free_name

pytestmark = pytest.mark.slow

DEMO = "import sys; from trifinger.commands.demo import main; sys.exit(main())"


@pytest.mark.parametrize(
    "mode",
    [[], ["--non-real-time"], ["--emulated"]],
    ids=["real-time", "non-real-time", "emulated"],
)
def test_the_demo_lifts_the_cube_and_leaves_a_log_and_pictures(
    mode: list[str], tmp_path: Path
) -> None:
    for stale in ("report.json", "trace.csv"):
        (tmp_path / stale).write_text("of another demo")
    result = subprocess.run(
        [sys.executable, "-c", DEMO, *mode, "--output", str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=270,
        check=False,
    )
    # In real time, a machine that is busy with other tests may drop the cube or end the session.
    is_real_time = mode != ["--non-real-time"]
    if is_real_time and not (tmp_path / "report.json").exists():
        assert result.returncode == 1, result.stdout + result.stderr
        return
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["is_done"] or is_real_time
    assert result.returncode == (0 if report["is_done"] else 1), result.stdout + result.stderr
    _, lines, _ = result.stdout.split("\n\n", 2)
    table = dict(re.findall(r"^ +(\w.*?) {2,}(\S.*)$", lines, re.MULTILINE))
    lifted = float(table["cube lifted by"].removesuffix(" cm"))
    assert lifted == pytest.approx(20.0, abs=0.3) or not report["is_done"]
    for name in ("scene.png", "report.png", "plot.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    (log,) = tmp_path.glob("*.mcap")
    assert str(log) in result.stdout
    assert trifinger.Log(log).session("demo").steps == int(table["steps"])
    # The demo and `trifinger log info` say the same.
    info = subprocess.run(
        [program.path(), "log", "info", log, "--json"], capture_output=True, text=True, check=True
    )
    session = json.loads(info.stdout)["sessions"][0]
    assert ("lateness, worst" in table) == session["is_real_time"]
    if not session["is_real_time"]:
        return
    worst = session["loop"]["lateness_max"]
    assert float(table["lateness, worst"].removesuffix(" ms")) == pytest.approx(
        1e3 * worst, abs=1e-3
    )


@pytest.mark.parametrize("mode", [[], ["--emulated"]], ids=["simulated", "emulated"])
def test_no_robot_outlives_a_demo_that_was_killed(mode: list[str], tmp_path: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", DEMO, *mode, "--output", str(tmp_path)],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as demo:
        try:
            assert demo.stdout is not None
            assert any("runs in a process of its own" in line for line in demo.stdout)
            children = Path(f"/proc/{demo.pid}/task/{demo.pid}/children").read_text().split()
            ends = [os.pidfd_open(int(child)) for child in children]
        finally:
            demo.kill()
        demo.communicate()  # until all have ended that write to it
    assert ends
    for end in ends:
        select.select([end], [], [])
        os.close(end)


@pytest.mark.skipif(os.geteuid() != 0, reason="only the administrator can give a file away")
def test_fault_80_the_demo_finds_a_name_that_nobody_has(
    session_folder: Path, start_fake: StartChild
) -> None:
    assert free_name() == "demo"
    (session_folder / "trifinger.demo.lock").touch()
    assert free_name() == "demo", "what a killed demo of this user has left is no obstacle"
    os.chown(session_folder / "trifinger.demo.lock", 12345, 12345)
    assert free_name() == "demo2"
    robot = start_fake("demo2")
    assert free_name() == "demo3"
    robot.kill()
    assert free_name() == "demo2"


def test_the_robot_of_another_user_may_end_while_a_name_is_looked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Path, "glob", lambda folder, _: iter([folder / "gone"]))
    assert free_name() == "demo"
