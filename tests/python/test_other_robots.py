# SPDX-License-Identifier: BSD-3-Clause
"""Robots that nobody here made: run, recorded, plotted, filmed, seen, replayed.

tools/fetch_robots.py fetches them, tests/robots has their configurations. D'Claw and the arm of an
example go the same way, also without a network.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import PROGRAM, StartProgram, assert_steady, output_of, patient
from trifinger.commands import export, film, plot
from trifinger.log.film import Scene
from trifinger_view.commands import view
from trifinger_view.live import LiveRun
from trifinger_view.scene import scene_of

ROOT = Path(__file__).parents[2]
FETCHED = ROOT / "build/robots"
STEPS = 300


@dataclass(frozen=True)
class Other:
    """A robot of others, and what its file has."""

    package: str
    motors: int
    joints: int
    period: float  # [s]


OTHERS = {
    "arm": Other("", 2, 2, 0.001),
    "dclaw": Other("", 9, 10, 0.0025),
    "jaco": Other("robosuite", 3, 6, 0.002),
    "panda": Other("robosuite", 7, 7, 0.002),
    "shadow": Other("gymnasium_robotics", 20, 24, 0.002),
    "ur5e": Other("robosuite", 6, 6, 0.002),
}


@dataclass
class Run:
    """What a robot did, in a process of its own."""

    name: str
    other: Other
    configuration: Path
    log: Path
    status: str
    lines: str


def configuration_of(name: str) -> Path:
    other = OTHERS[name]
    if not other.package:
        return ROOT / ("examples" if name == "arm" else "config") / f"{name}.yml"
    if not (FETCHED / other.package).exists():
        pytest.skip(f"{name} is missing: python tools/fetch_robots.py --all")
    return ROOT / f"tests/robots/{name}.yml"


@pytest.fixture(params=OTHERS)
def run(request: pytest.FixtureRequest, start_program: StartProgram, tmp_path: Path) -> Run:
    """Each robot waves with all its joints, and is recorded."""
    name = request.param
    configuration = configuration_of(name)
    folder = tmp_path / "recorded"
    words = ["run", str(configuration), "--non-real-time", "--record", str(folder)]
    robot = start_program(*words)
    robot.wait_for("waits for a user")
    with trifinger.connect(name) as user:
        begin = user.latest_observation().position
        live = LiveRun(name)
        for step in range(STEPS):
            wave = 0.1 * np.sin(2 * np.pi * step / STEPS)
            user.append_desired_action(user.new_action(position=begin + wave))
        user.wait_until_time_index(STEPS - 1)
        status = output_of(PROGRAM, "status", name, "--once")
        live.look(with_images=False)
        scene = live.scene
        assert scene is not None
        assert len(scene.joint_names) == OTHERS[name].joints
        lines = " ".join(line.text for line in live.lines)
        user.finish()
    assert robot.end()[0] == 0
    (log,) = folder.glob("*.mcap")
    return Run(name, OTHERS[name], configuration, log, status, lines)


@pytest.mark.slow
def test_a_robot_of_others_is_like_one_of_ours(run: Run, tmp_path: Path) -> None:
    assert f"steps of {run.other.period * 1e3:g} ms" in run.status
    assert "runs" in run.lines

    assert "whole" in output_of(PROGRAM, "log", "check", run.log)
    session = trifinger.Log(run.log).session(run.name)
    assert session.steps == STEPS
    assert session.period == pytest.approx(run.other.period)
    position = session.observations["position"]
    assert position.shape == (STEPS, run.other.motors)
    assert np.isfinite(position).all()
    assert (np.ptp(position, axis=0) > 0.02).all()  # every joint has moved

    # The scene of its log is that of the robot: nothing is far from anything else, or missing.
    scene = scene_of(session.documents)
    assert scene is not None
    moving = [body for body in scene.bodies if body.is_moving]
    assert len(moving) >= min(run.other.joints, 6)
    low, high = scene.bounds()
    assert (high - low < 3).all()

    words = ["--robot", run.name]
    assert plot.main([str(run.log), "-o", str(tmp_path / "run.png")]) == 0
    assert plot.main([str(run.log), "-o", str(tmp_path / "plot.html")]) == 0
    assert export.main([str(run.log), "-o", str(tmp_path / "csv")]) == 0
    assert view.main([str(run.log), "-o", str(tmp_path / "page.html"), *words]) == 0
    assert film.main([str(run.log), "-o", str(tmp_path / "film"), *words]) == 0
    for file in ("run.png", "plot.html", "page.html", "film/film.mp4", "film/strip.png"):
        assert (tmp_path / file).stat().st_size > 5000, file
    drawn = Scene(session)
    first, last = drawn.image(0), drawn.image(STEPS // 4)
    drawn.close()
    # The robot fills a part of the picture, and moves in it.
    assert np.std(first) > 5
    assert (np.abs(first.astype(int) - last).max(axis=2) > 30).mean() > 2e-4


def test_a_robot_of_others_repeats_its_log(run: Run, start_program: StartProgram) -> None:
    robot = start_program("run", str(run.configuration), "--non-real-time")
    robot.wait_for("waits for a user")
    words = ["log", "replay", run.log, "--on", run.name, "--session", "1"]
    assert re.search(
        "at most 0 (rad|rad or m) from the recorded positions", output_of(PROGRAM, *words)
    )
    robot.end()
    # The log plays, too, as if it were the robot.
    player = start_program("run", str(run.log), "--name", "again", "--non-real-time")
    player.wait_for("waits for a user")
    with trifinger.connect("again") as user:
        t = user.append_desired_action(user.new_action())
        recorded = trifinger.Log(run.log).session(run.name).observations
        for field in recorded.dtype.names or ():
            np.testing.assert_array_equal(user.get_observation(t)[field], recorded[t][field])


@pytest.mark.parametrize("name", OTHERS)
def test_a_robot_of_others_keeps_its_rate(
    name: str, start_program: StartProgram, tmp_path: Path
) -> None:
    configuration = patient(configuration_of(name), OTHERS[name].period, tmp_path)
    robot = start_program("run", str(configuration), "--record", str(tmp_path / "log"))
    robot.wait_for("waits for a user")
    with trifinger.connect(name) as user:
        for _ in range(STEPS):
            user.get_observation(user.append_desired_action(user.new_action()))
        user.finish()
    assert robot.end()[0] == 0
    session = trifinger.Log(tmp_path / "log").session(name)
    assert session.steps is not None
    assert session.steps >= STEPS
    assert session.period == pytest.approx(OTHERS[name].period)
    assert_steady(session)
