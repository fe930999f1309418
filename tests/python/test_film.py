# SPDX-License-Identifier: BSD-3-Clause
"""Which session `trifinger film` draws, and what it says where it cannot."""

import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import trifinger
from conftest import PROGRAM, StartProgram
from trifinger.commands import film
from trifinger.commands.film import find_session
from trifinger.foreign_models import model_of
from trifinger.log.film import Scene
from trifinger.log.manipulation import Trace
from trifinger.log.objects import TOUCH, object_poses, written
from trifinger.picture import Painter, View


def record_session(steps: int) -> None:
    """A session of 'sim' of that many steps."""
    with trifinger.connect("sim") as robot:
        for _ in range(steps):
            robot.append_desired_action(robot.new_action())
        robot.wait_until_time_index(steps - 1)
        robot.finish()


def record(start_program: StartProgram, folder: Path, *lengths: int) -> list[int]:
    """A recording of sessions of these lengths; returns their ids."""
    robot = start_program("run", "sim", "--non-real-time", "--record", str(folder))
    for steps in lengths:
        robot.wait_for("waits for a user")
        record_session(steps)
        robot.wait_for(f"finished at step {steps}")
    robot.end()
    newest = trifinger.Log(folder)
    return [session.session_id for session in newest.sessions if session.steps]


def record_alone(folder: Path) -> None:
    """A recording of a simulation in this process."""
    with trifinger.simulate(record=str(folder)) as robot:
        robot.append_desired_actions(np.repeat(robot.new_action(), 40))
        robot.wait_until_time_index(39)


@pytest.fixture
def logs(start_program: StartProgram, tmp_path: Path) -> tuple[Path, list[int]]:
    """A folder with a recording of one session, and a newer one of two; the ids of the three."""
    folder = tmp_path / "recordings"
    first = record(start_program, folder, 10)
    return folder, first + record(start_program, folder, 20, 30)


def trace_of(folder: Path, **report: object) -> Trace:
    """Writes an invented trace of a manipulation, with this report."""
    folder.mkdir()
    (folder / "trace.csv").write_text("step,phase\n0,look\n10,plan\n")
    (folder / "report.json").write_text(json.dumps({"period": 1e-3, **report}))
    return Trace(folder)


def test_the_session_that_a_report_is_of_is_drawn(
    logs: tuple[Path, list[int]], tmp_path: Path
) -> None:
    folder, ids = logs
    for number, session_id in enumerate(ids):
        trace = trace_of(tmp_path / f"report_{number}", session_id=session_id)
        session = find_session(folder, trace=trace)
        assert (session.session_id, session.steps) == (session_id, 10 * (number + 1))


def test_a_session_is_chosen_by_its_number_or_its_id(logs: tuple[Path, list[int]]) -> None:
    folder, ids = logs
    assert find_session(folder).session_id == ids[2]
    assert find_session(folder, wanted=1).session_id == ids[1]
    assert find_session(folder, wanted=2).session_id == ids[2]
    for session_id in ids:
        assert find_session(folder, robot="sim", wanted=session_id).session_id == session_id
    with pytest.raises(trifinger.InvalidArgument, match="does not have session 9") as no:
        find_session(folder, wanted=9)
    for session_id, steps in zip(ids, (10, 20, 30), strict=True):
        assert f"of 'sim' ({steps * 1e-3:.2f} s, id {session_id})" in str(no.value)


def test_a_report_of_another_session_is_refused(
    logs: tuple[Path, list[int]], tmp_path: Path
) -> None:
    folder, ids = logs
    trace = trace_of(tmp_path / "report", session_id=ids[1])
    with pytest.raises(trifinger.InvalidArgument, match=f"is of session {ids[1]}, not of"):
        find_session(folder, wanted=2, trace=trace)
    trace = trace_of(tmp_path / "elsewhere", session_id=5)
    with pytest.raises(trifinger.InvalidArgument, match="does not have the session 5 of the rep"):
        find_session(folder, trace=trace)
    trace = trace_of(tmp_path / "old")
    with pytest.raises(trifinger.InvalidArgument, match="choose one by --session"):
        find_session(folder, trace=trace)
    assert find_session(folder, wanted=1, trace=trace).session_id == ids[1]


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({}, "trace.csv is missing: `trifinger manipulate` leaves it"),
        ({"trace.csv": "step,phase\n1,look\n"}, "report.json is missing"),
        ({"trace.csv": "a,b\n1,2\n", "report.json": "{}"}, "has no report of `trifinger man"),
        ({"trace.csv": "", "report.json": "[]"}, "has no report of `trifinger manipulate`"),
        ({"trace.csv": "step,phase\n1,look\n", "report.json": "{"}, "has no report"),
    ],
)
def test_what_is_no_report_is_named(
    files: dict[str, str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    assert film.main([str(tmp_path), "--report", str(tmp_path)]) == 1
    assert said in capsys.readouterr().err


def test_says_before_it_draws_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    assert film.main([str(tmp_path)]) == 1
    assert capsys.readouterr().err == "trifinger film: av is missing: ./run setup\n"


def test_says_what_drawing_lacks(tmp_path: Path) -> None:
    record_alone(tmp_path)
    # In a process of its own: which library draws is settled when MuJoCo is imported.
    program = (
        "import os, sys; os.environ['MUJOCO_GL'] = 'egl'; from trifinger.commands import film\n"
        "sys.modules['mujoco.egl'] = None; sys.exit(film.main(sys.argv[1:]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path), "-o", str(tmp_path / "film")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    remedy = "apt-get install libegl1 libgl1-mesa-dri libopengl0"
    assert done.stderr.startswith(
        f"trifinger film: MuJoCo cannot draw with MUJOCO_GL=egl: {remedy} ("
    )
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--from", "0.03", "--to", "0.01"), "--from 0.03 must be before --to 0.01"),
        (("--from", "nan"), "--from nan must be before --to 0.039"),
        (("--from", "7"), "the log has 0.039 s of 'sim': --from and --to must be in"),
        (("--from", "7", "--to", "8"), "the log has 0.039 s of 'sim': --from and --to must be in"),
        (("--from", "-2", "--to", "-1"), "the log has 0.039 s of 'sim'"),
    ],
)
def test_a_part_that_there_is_not(
    words: tuple[str, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record_alone(tmp_path)
    output = tmp_path / "film"
    assert film.main([str(tmp_path), "-o", str(output), *words]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"trifinger film: {said}")
    assert error.count("\n") == 1
    assert not output.exists()


def test_a_part_of_a_film(tmp_path: Path) -> None:
    record_alone(tmp_path)
    session = trifinger.Log(tmp_path).session()
    view = View(width=64, height=48)
    for begin, end, first, last in (
        (None, None, 0, 39),
        (0.01, None, 10, 39),
        (None, 0.02, 0, 20),
        (0.01, 0.02, 10, 20),
        (0.0, 9.0, 0, 39),
    ):
        scene = Scene(session, view, begin, end)
        scene.close()
        assert scene.steps[0] == first
        assert last - 33 < scene.steps[-1] <= last  # 30 pictures a second


@pytest.mark.slow
@pytest.mark.parametrize("stroke", ["near", "far"])
def test_a_thrown_ball_is_seen_to_land(
    stroke: str, start_program: StartProgram, tmp_path: Path
) -> None:
    name = "throw_far" if stroke == "far" else "throw"
    robot = start_program("run", name, "--non-real-time", "--record", str(tmp_path / "log"))
    robot.wait_for("waits for a user")
    words = [PROGRAM, "manipulate", "throw", "--output", str(tmp_path / "report")]
    words += ["--set", "stroke=far"] if stroke == "far" else []
    subprocess.run(words, check=True, capture_output=True)
    robot.end()
    scene = Scene(trifinger.Log(tmp_path / "log").session(), View(width=320, height=240))
    pictures = [scene.image(int(step)).astype(int) for step in scene.steps]
    scene.close()
    model, data = scene._painter.model, scene._painter._data
    ball = int(np.flatnonzero(model.jnt_type == 0)[0])
    assert data.xpos[model.jnt_bodyid[ball], 2] < 0.05  # it lies on the ground at the end
    # In every picture, something is as orange as the ball.
    for picture in pictures:
        assert np.any((picture[..., 0] > 150) & (picture[..., 0] - picture[..., 2] > 90))


@pytest.mark.slow
def test_film_of_the_newest_session(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record_alone(tmp_path)
    output = tmp_path / "film"
    assert film.main([str(tmp_path), "-o", str(output)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"{output / name} written." for name in ("film.mp4", "strip.png")
    ]


def test_a_nib_writes_where_it_touches_the_table() -> None:
    words = [PROGRAM, "model", "export", "--format", "mjcf", "--object", "stick", "cube"]
    model = model_of(subprocess.run(words, capture_output=True, text=True, check=True).stdout)
    steps = np.arange(0, 600, 10)
    length = model.geom("stick").size[:2].sum()
    pose = np.zeros((60, 7))
    pose[:, 0] = np.minimum(0.001 * np.arange(60), 0.049)  # it rests at the end
    # x looks down, by a quaternion of either sign.
    pose[:, 3:] = np.array([1, 0, 1, 0]) * np.where(steps % 20 == 0, 1, -2)[:, None]
    pose[:, 2] = length + np.where((steps >= 200) & (steps < 300), 2, 0.5) * TOUCH
    ends, lines = written(model, steps, {"stick": pose, "cube": pose})
    assert ends.tolist() == [*range(10, 200, 10), *range(310, 500, 10)]
    np.testing.assert_allclose(np.diff(lines[:, :, 0], axis=1), 0.001, atol=1e-9)
    np.testing.assert_allclose(lines[:, :, 1], 0, atol=1e-9)
    pose[:, 2] -= 1.0  # below the table
    assert not len(written(model, steps, {"stick": pose})[0])
    assert not len(written(model, steps[:0], {"stick": pose[:0]})[0])


def test_ink_is_seen() -> None:
    words = [PROGRAM, "model", "export", "--format", "mjcf", "--object", "stick"]
    mjcf = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    painter = Painter(mjcf, View("90,-60", 960, 720))
    start = painter.placement.qpos()
    blank = painter.draw(start).astype(int)
    line = [[[-0.1, -0.12, 0], [0.1, -0.12, 0]]]
    drawn = painter.draw(start, ink=line).astype(int)
    painter.close()
    rows, columns = np.nonzero(np.abs(drawn - blank).max(axis=2) > 20)
    assert len(rows) > 20
    assert np.ptp(columns) > 10 * np.ptp(rows)  # a level line


def test_objects_that_were_never_seen_have_no_poses() -> None:
    pose = np.dtype([("position", float, 3), ("orientation", float, 4)])
    nothing = np.empty(0, [("stamp", [("capture_index", np.int64)]), ("pen", pose)])
    companion = SimpleNamespace(observations=nothing)
    times, poses = object_poses(cast("Any", SimpleNamespace(companion=lambda _: companion)))
    assert (len(times), poses) == (0, {})
