# SPDX-License-Identifier: BSD-3-Clause
"""The tasks of the Real Robot Challenge: how programs are judged, and a controller of ours."""

import json
from pathlib import Path

import challenge
import challenge_policy
import challenge_reference
import numpy as np
import pytest
from challenge_policy import ToPose, face_up, moved_to, pose_of
from challenge_task import KINDS, Task, words_of
from solvers import rotated, rotation, turned
from trifinger.control import Pose
from trifinger_simulation.tasks import move_cube

CUBE = [kind for kind in KINDS if kind.startswith("cube, ")]


def task_of(kind: str, seed: int, log: str = "") -> Task:
    return Task([*words_of(kind, seed), log])


@pytest.mark.parametrize("kind", KINDS)
def test_starts_and_goals_are_those_of_the_challenge(kind: str) -> None:
    assert words_of(kind, 7) == words_of(kind, 7) != words_of(kind, 8)
    task = task_of(kind, 7)
    assert len(task.positions) == (10 if "trajectory" in kind else 1)
    assert task.positions[0][0] == 0
    assert task.cost_of(pose_of(task.goal)) == pytest.approx(0, abs=1e-6)
    start = task.cost_of(pose_of(task.initial_pose))
    assert start > 0
    assert task.idle_cost == pytest.approx(start) or task.trajectory


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["cube, level 3", "cube on a trajectory", "cuboid, level 4"])
def test_a_log_is_judged_like_the_run_that_wrote_it(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(move_cube, "EPISODE_LENGTH", 1500)
    log = str(tmp_path / "log.p")
    cost = challenge_reference.solve(task_of(kind, 3, log))
    assert task_of(kind, 3, log).cost_of_log() == pytest.approx(cost, rel=1e-9)
    assert 0 < cost < 1


def last_cost(task: Task, monkeypatch: pytest.MonkeyPatch, seconds: float) -> float:
    """The cost of the last step of an episode in which our controller solves the task."""
    monkeypatch.setattr(move_cube, "EPISODE_LENGTH", round(1000 * seconds))
    last = []

    def run(act, run=task.run):
        def noted(robot, cameras):
            last[:] = [task.cost_of(pose_of(cameras.filtered_object_pose))]
            return act(robot, cameras)

        return run(noted)

    monkeypatch.setattr(task, "run", run)
    challenge_policy.solve(task)
    return last[0]


@pytest.mark.slow
@pytest.mark.parametrize("kind", CUBE[:3])
def test_a_cube_is_at_its_goal_after_a_few_seconds(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    task = task_of(kind, 2)
    # A cube on the table is a millimetre above its goal: surfaces of meshes touch from there.
    assert last_cost(task, monkeypatch, 8.0) < (0.006 if task.level == 1 else 0.001)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "seed"), [("cuboid, level 1", 2010), ("cuboid, level 2", 2008), ("cuboid, level 4", 1)]
)
def test_a_cuboid_that_stands_or_lies_out_of_reach_is_at_its_goal_after_a_while(
    kind: str, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert last_cost(task_of(kind, seed), monkeypatch, 25.0) < 0.001


def test_a_long_axis_is_laid_down_by_the_shortest_turn() -> None:
    size = [0.02, 0.08, 0.02]
    assert challenge_policy.long_axis(size) == 1
    assert challenge_policy.long_axis([0.065] * 3) is None
    for vector in ((0.3, 0.2, 0.1), (1.2, -0.4, 2.0), (np.pi / 2, 0.0, 0.0)):
        pose = rotated(Pose(), vector)
        along = rotation(pose)[:, 1]
        turn = challenge_policy.to_lying(pose, 1)
        laid = rotation(rotated(pose, turn))[:, 1]
        assert laid[2] == pytest.approx(0, abs=1e-6)
        assert np.linalg.norm(turn) == pytest.approx(np.arcsin(abs(along[2])), abs=1e-6)


@pytest.mark.slow
def test_an_object_is_led_over_its_edge_towards_the_face_that_must_be_up() -> None:
    task = task_of("cube, level 4", 1)
    planner = challenge_policy.Planner(task)
    rest = turned(Pose((0.02, 0.03, 0.0325)), 0.4)
    for quarters, axis in ((1, (1.0, 0.0, 0.0)), (-1, (0.0, 1.0, 0.0)), (2, (1.0, 0.0, 0.0))):
        end = moved_to(rotated(rest, quarters * np.pi / 2 * np.array(axis)), (0.0, 0.0, 0.08))
        leg = ToPose(planner, end, task.cost_of).next_leg(rest, 0.0)
        assert leg is not None
        assert leg.is_released
        tilted = leg.stops[-1].pose
        # Let go beyond its edge, it falls by what is left of a quarter.
        axes = challenge_policy.control.rotation_error(
            tilted.orientation, leg.stops[0].pose.orientation
        )
        fallen = rotated(leg.stops[0].pose, np.pi / 2 * axes / np.linalg.norm(axes))
        assert np.pi / 4 < np.linalg.norm(axes) < np.pi / 2
        assert face_up(fallen) != face_up(rest)
        if abs(quarters) == 1:
            assert face_up(fallen) == face_up(end)


def test_results_are_kept_and_a_program_that_fails_costs_what_doing_nothing_costs(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    program = tmp_path / "fails.py"
    program.write_text("raise SystemExit(3)")
    words = [
        "--goals",
        "2",
        "--only",
        "cube, level 2",
        "--processes",
        "1",
        "--output",
        str(tmp_path),
    ]
    challenge.main([str(program), *words])
    folder = tmp_path / challenge.version_of(program)
    kept = [challenge.kept(folder, "cube, level 2", 1000 + i) for i in range(2)]
    assert [json.loads(path.read_text())["cost"] for path in kept] == [None] * 2
    idle = np.mean([task_of("cube, level 2", 1000 + i).idle_cost for i in range(2)])
    assert f"| cube, level 2 | 2 | {idle:.4f} |" in capfd.readouterr().out
    for path in kept:
        path.write_text(json.dumps({"cost": 0.25}))
    challenge.main([str(program), *words])
    assert "| cube, level 2 | 2 | 0.2500 | 0.2500 | 0.2500 | 0 |" in capfd.readouterr().out
    # Another version of the program has results of its own.
    program.write_text("import sys\nopen(sys.argv[-1], 'w').write('no log')")
    challenge.main([str(program), *words])
    assert f"| cube, level 2 | 2 | {idle:.4f} |" in capfd.readouterr().out


def test_a_program_that_hangs_is_ended_and_counts_as_failed(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    program = tmp_path / "hangs.py"
    program.write_text("import signal\nsignal.pause()")
    words = ["--goals", "1", "--processes", "1", "--timeout", "1", "--only"]
    challenge.main([str(program), "--output", str(tmp_path), *words, "cube, level 2"])
    idle = task_of("cube, level 2", 1000).idle_cost
    output = capfd.readouterr()
    assert f"| cube, level 2 | 1 | {idle:.4f} | {idle:.4f} | {idle:.4f} | 1 |" in output.out
    assert "longer than 1 s" in output.err
    with pytest.raises(SystemExit):
        challenge.main([str(program), "--timeout", "nan"])
