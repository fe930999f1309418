# SPDX-License-Identifier: BSD-3-Clause
"""Episodes that begin in the midst of a movement."""

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import BUILD, StartProgram
from lift_states import collect_states
from trifinger.commands import train
from trifinger.environments import ResetStates, VectorEnvironment
from trifinger.errors import Error, InvalidArgument
from trifinger.training import Plan, Training

EVALUATION = Path(__file__).parents[2] / "evaluation"


@pytest.fixture(scope="module")
def held() -> ResetStates:
    """States in which a controller carries a cube."""
    states = collect_states(seed=3, episodes=2)
    in_air = states.object[:, 2] > 0.045
    assert in_air.sum() >= 20
    rows = vars(states).items()
    return ResetStates(**{name: numbers[in_air][:20] for name, numbers in rows})


@pytest.mark.parametrize("action", ["position_change", "torque"])
@pytest.mark.parametrize("physics_step", [0.001, 0.005])
def test_a_cube_that_is_held_stays_held(
    held: ResetStates, action: str, physics_step: float
) -> None:
    for torque, dropped_share in ((held.torque, 0.0), (-held.torque, 1.0)):
        environment = VectorEnvironment(
            "lift", 20, duration=1.0, physics_step=physics_step, action=action
        )
        environment.set_reset_states(dataclasses.replace(held, torque=torque), 1.0)
        observations, _ = environment.reset(seed=1)
        begin = environment.entries(observations)["object_position"].copy()
        np.testing.assert_allclose(begin, held_places(held, begin), atol=1e-6)
        numbers = np.zeros((20, 9), np.float32)
        if action == "torque":  # the same torques go on, those of the state that it begins in
            numbers[:] = torque[rows_of(held, begin)] / 0.36
        for _ in range(20):
            observations, *_ = environment.step(numbers)
        end = environment.entries(observations)["object_position"]
        dropped = (begin - end)[:, 2] > 0.005
        assert abs(dropped.mean() - dropped_share) <= 0.1


@pytest.mark.slow
def test_a_log_of_a_skill_has_them(start_program: StartProgram, tmp_path: Path) -> None:
    logs = tmp_path / "logs"
    words = ("--non-real-time", "--set", "fingers.height=0.3", "--record", str(logs))
    robot = start_program("run", "sim", "--name", "lifting", *words)
    robot.wait_for("waits for a user")
    skill = [str(BUILD / "apps/trifinger-manipulate"), "lift", "--robot", "lifting"]
    settings = ("lift.height=0.06", "lift.hold_time=3", "lift.lead_turns=[0]")
    words = (word for setting in settings for word in ("--set", setting))
    subprocess.run([*skill, *words], check=True, capture_output=True, cwd=tmp_path)
    robot.end()
    states = ResetStates.load(logs)
    in_air = states.object[:, 2] > 0.06
    assert in_air.sum() >= 20
    held = ResetStates(*(numbers[in_air] for numbers in vars(states).values()))
    environment = VectorEnvironment("lift", 20, physics_step=0.005)
    environment.set_reset_states(held, 1.0)
    observations, _ = environment.reset(seed=1)
    begin = environment.entries(observations)["object_position"].copy()
    for _ in range(50):
        observations, *_ = environment.step(np.zeros((20, 9), np.float32))
    end = environment.entries(observations)["object_position"]
    assert (begin[:, 2] > 0.055).all()
    assert ((begin - end)[:, 2] < 0.005).mean() >= 0.9
    with pytest.raises(InvalidArgument, match="does not say where an object 'ball' was"):
        ResetStates.from_log(logs, "ball")


def rows_of(states: ResetStates, places: np.ndarray) -> np.ndarray:
    """Which state has its object nearest to each of these places."""
    offsets = places[:, None] - states.object[None, :, :3]
    return np.linalg.norm(offsets, axis=2).argmin(axis=1)


def held_places(states: ResetStates, places: np.ndarray) -> np.ndarray:
    """The place of the nearest object of the states, for each of these places."""
    return states.object[rows_of(states, places), :3]


def test_a_file_has_them_as_they_were(held: ResetStates, tmp_path: Path) -> None:
    held.save(tmp_path / "held.npz")
    again = ResetStates.load(tmp_path / "held.npz")
    for name, numbers in vars(held).items():
        np.testing.assert_array_equal(numbers, getattr(again, name))
    whole = (tmp_path / "held.npz").read_bytes()
    (tmp_path / "text.npz").write_text("no archive")
    (tmp_path / "cut.npz").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "empty.npz").write_text("")
    (tmp_path / "changed.npz").write_bytes(whole[:200] + b"no number" + whole[209:])
    np.savez(tmp_path / "other.npz", position=np.zeros((1, 9)))
    np.savez(tmp_path / "flat.npz", position=np.zeros(9), torque=np.zeros(9), object=np.zeros(7))
    for name in ("none", "text", "cut", "empty", "changed", "other", "flat"):
        with pytest.raises(FileNotFoundError if name == "none" else Error):
            ResetStates.load(tmp_path / f"{name}.npz")


def test_says_where_no_robot_can_begin(held: ResetStates) -> None:
    environment = VectorEnvironment("lift", 2)
    for wrong, reason in (
        (dataclasses.replace(held, object=held.object[:, :0]), "has no pose of an object"),
        (dataclasses.replace(held, object=held.object[:, :3]), "3 columns, must have 7 or 0"),
        (dataclasses.replace(held, torque=held.torque[:3]), "must have the same number"),
        (dataclasses.replace(held, position=held.position[:, :4]), "must have 9"),
    ):
        with pytest.raises(InvalidArgument, match=reason):
            environment.set_reset_states(wrong, 0.5)
    with pytest.raises(InvalidArgument, match="has other joints or bodies"):
        VectorEnvironment("dclaw_turn_fixed", 2).set_reset_states(held, 0.5)


def test_a_training_begins_in_them_and_its_evaluations_do_not(
    held: ResetStates, tmp_path: Path
) -> None:
    held.save(tmp_path / "held.npz")
    settings = {"reset_states": str(tmp_path / "held.npz"), "reset_share": 1.0, "num_envs": 8}
    settings |= {"rollout": 8, "batch_size": 64, "duration": 0.4}
    plan = Plan.of("lift", "ppo", settings=settings, episodes=16)
    assert Plan.from_json(plan.to_json()) == plan
    training = Training(plan, tmp_path / "run")
    seen = training._rows.entries(training._rows.begin(5, np.zeros(8)))
    assert (seen["object_position"][:, 2] > 0.045).all()
    training.run()
    (tmp_path / "held.npz").unlink()
    again = Training.resume(tmp_path / "run")
    seen = again._rows.entries(again._rows.begin(5, np.zeros(8)))
    assert (seen["object_position"][:, 2] > 0.045).all()
    begins = training._evaluator.environment.reset(seed=1)[0]
    assert (training._rows.entries(begins)["object_position"][:, 2] < 0.04).all()
    for wrong, reason in (({"num_envs": 1}, "for many robots"), ({"reset_share": 2.0}, "0 to 1")):
        with pytest.raises(InvalidArgument, match=reason):
            Plan.of("lift", "ppo", settings={"reset_states": "held.npz"} | wrong)


@pytest.mark.slow
def test_states_of_a_controller_are_written_and_a_training_begins_in_them(tmp_path: Path) -> None:
    file = tmp_path / "lift_states.npz"
    program = [sys.executable, str(EVALUATION / "lift_states.py"), str(file), "--episodes", "1"]
    assert "states" in subprocess.run(program, check=True, capture_output=True, text=True).stdout
    settings = {"reset_states": str(file)}
    for task, position_change in (("lift", 0.03), ("push", 0.06)):
        plan = Plan.of(task, "ppo", settings=settings)
        assert plan.options.position_change == position_change
    words = ["lift", "--algorithm", "ppo", "--set", f"reset_states={file}", "--episodes", "2"]
    words += ["--set", "num_envs=2", "--set", "duration=0.4", "--set", "rollout=20"]
    assert train.main([*words, "-o", str(tmp_path / "run")]) == 0
    assert (tmp_path / "run/object.png").is_file()
