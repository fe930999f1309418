# SPDX-License-Identifier: BSD-3-Clause
"""Environments of robots from files: any set of frames, one or many at once, and D'Claw's tasks."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import trifinger
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.env_checker import check_env as check_env_of_sb3
from trifinger import _trifinger, environments
from trifinger.environments import Environment, Options, VectorEnvironment
from trifinger.tasks import Start, Task

pytestmark = pytest.mark.bindings

gymnasium.register_envs(environments)

ROOT = Path(__file__).parents[2]
ROBOTS = ROOT / "tests" / "robots"  # robots that nobody here made; tools/fetch_robots.py
DCLAW = [name for name in environments.TASKS if name.startswith("dclaw_")]
TIPS = ("FFtip", "MFtip", "THtip")
SHADOW_TIPS = tuple(f"robot0:S_{finger}tip" for finger in ("ff", "mf", "rf", "lf", "th"))
FRAMES = {
    "dclaw": TIPS,
    "panda": ("right_hand",),
    "ur5e": ("right_hand",),
    "shadow": SHADOW_TIPS,
    "jaco": ("thumb_distal", "index_distal", "pinky_distal"),
}
PACKAGES = {"shadow": "gymnasium_robotics", "dclaw": ""}

# Everything that can be random of a robot from a file.
VARIED: dict[str, Any] = {
    "position_noise": 1e-3,
    "velocity_noise": 1e-2,
    "object_mass": (0.8, 1.2),
    "friction": (0.7, 1.2),
    "motor_gain": (0.9, 1.1),
    "torque_delay": (0, 3),
    "contact_time": (1.0, 2.0),
    "rotor_inertia": (0.9, 1.1),
    "joint_damping": (0.8, 1.5),
    "joint_friction": (0.0, 0.01),
}


def config_of(robot: str) -> str:
    """The configuration of a robot; skips the test if somebody has to fetch it first."""
    if robot == "dclaw":
        return robot
    package = ROOT / "build" / "robots" / PACKAGES.get(robot, "robosuite")
    if not (ROBOTS / f"{robot}.yml").exists() or not package.exists():
        pytest.skip("the robot is missing: python tools/fetch_robots.py --all")
    return str(ROBOTS / f"{robot}.yml")


@pytest.mark.parametrize("robot", FRAMES)
@pytest.mark.parametrize("observation", ["flat", "dictionary", "goal"])
def test_the_official_checkers_pass(robot: str, observation: str, capsys: Any) -> None:
    options: dict[str, Any] = {
        "config": config_of(robot),
        "frames": FRAMES[robot],
        "observation": observation,
        "duration": 0.2,
    }
    environment = gymnasium.make("TriFinger/Reach-v0", **options).unwrapped
    check_env(environment, skip_render_check=True)
    check_env_of_sb3(environment, skip_render_check=True)
    capsys.readouterr()  # Stable-Baselines3 says that it has found a goal.
    environment.close()


def test_a_robot_without_what_an_environment_needs_is_refused(arm: str) -> None:
    options = Options(frames=("hand",)).to_json()
    core = _trifinger.Episodes("reach", options, arm, {})
    core.begin(0, 0)
    action = np.zeros(2, np.float32)
    with pytest.raises(trifinger.InvalidArgument, match="no field 'torque' of 2 numbers"):
        core.step(trifinger.Simulation().connect(), action, None, None)
    with pytest.raises(trifinger.InvalidArgument, match="nobody has said where the ball is"):
        core.step(trifinger.Simulation(arm).connect(), action, None, None)


@pytest.mark.parametrize("task", DCLAW)
def test_the_official_checkers_pass_for_the_tasks_of_dclaw(task: str) -> None:
    words = "".join(word.capitalize() for word in task.split("_"))
    environment = gymnasium.make(f"TriFinger/{words}-v0").unwrapped
    check_env(environment, skip_render_check=True)
    check_env_of_sb3(environment, skip_render_check=True)
    environment.close()


def compare(task: str, options: Options, config: str | None, steps: int) -> list[int]:
    """Compares a vector environment with single ones, bit for bit; returns the faults."""
    count, faults = 3, []
    vector = VectorEnvironment(task, count, options=options, config=config, num_threads=2)
    singles = [Environment(task, options=options, config=config) for _ in range(count)]
    seen, info = vector.reset(seed=5)
    ones = [single.reset(seed=5 + i) for i, single in enumerate(singles)]
    for i, (observation, alone) in enumerate(ones):
        assert data_equivalence(row_of(seen, i), observation, exact=True)
        assert (info["desired_goal"][i] == alone["desired_goal"]).all()
    rng = np.random.default_rng(0)
    has_ended = [False] * count
    for _ in range(steps):
        actions = rng.uniform(-1, 1, vector.action_space.shape).astype(np.float32)
        seen, reward, terminated, truncated, info = vector.step(actions)
        for i, single in enumerate(singles):
            if has_ended[i]:
                observation, alone = single.reset()
                expected = (0.0, False, False)
            else:
                observation, *expected, alone = single.step(actions[i])  # type: ignore[assignment]
                faults.append(alone["fault"])
            has_ended[i] = bool(expected[1] or expected[2])
            assert data_equivalence(row_of(seen, i), observation, exact=True)
            assert (reward[i], terminated[i], truncated[i]) == tuple(expected)
            for name in ("achieved_goal", "desired_goal", "distance", "is_success", "fault"):
                assert np.array_equal(info[name][i], alone[name]), name
    for single in singles:
        single.close()
    return faults


def row_of(observation: Any, index: int) -> Any:
    if isinstance(observation, dict):
        return {name: value[index] for name, value in observation.items()}
    return observation[index]


@pytest.mark.parametrize("robot", FRAMES)
def test_one_and_many_give_the_same_bit_for_bit(robot: str) -> None:
    options = Options.of("reach", frames=FRAMES[robot], duration=0.3, **VARIED)
    faults = compare("reach", options, config_of(robot), 40)
    assert not any(faults)


@pytest.mark.parametrize(
    "options",
    [
        {"mapping": "state_augmentation", "steps_per_action": 7},
        {"action": "torque", "observation": "goal"},
        {"action": "position_change", "observation": "dictionary"},
    ],
)
def test_one_and_many_give_the_same_with_all_options(arm: str, options: dict[str, Any]) -> None:
    chosen = Options.of("reach", frames=("hand", "flap"), duration=0.3, **options, **VARIED)
    compare("reach", chosen, arm, 60)


@pytest.mark.parametrize("task", DCLAW)
def test_one_and_many_give_the_same_for_the_tasks_of_dclaw(task: str) -> None:
    steps = Options.of(task).steps_per_action
    faults = compare(task, Options.of(task, duration=steps * 0.0025 * 12), None, 30)
    assert not any(faults)


def test_goals_are_where_the_frames_can_be(arm: str) -> None:
    environment = Environment("reach", options=Options.of("reach", frames=("hand",)), config=arm)
    goals = []
    for episode in range(100):
        _, info = environment.reset(seed=1, options={"episode": episode})
        goal = info["desired_goal"]
        goals.append(goal)
        # Two links of 20 cm in the plane of x and z. What touches nothing is not folded.
        reach = np.hypot(goal[0], goal[2] - 1)
        assert abs(goal[1]) < 1e-12
        assert 0.02 < reach <= 0.4 + 1e-9
        np.testing.assert_allclose(info["achieved_goal"], hand_at([0.3, 0.0]), atol=1e-9)
    assert np.ptp(goals, axis=0)[[0, 2]].min() > 0.5
    low, high = environment._core.goal[2:]
    assert (np.min(goals, axis=0) >= low).all()
    assert (np.max(goals, axis=0) <= high).all()


def hand_at(position: Any) -> np.ndarray[Any, Any]:
    """The place of the arm's hand; elbow and shoulder are positive towards -x."""
    elbow, shoulder = position
    first, second = shoulder, shoulder + elbow
    x = -0.2 * (np.sin(first) + np.sin(second))
    z = 1 - 0.2 * (np.cos(first) + np.cos(second))
    return np.array([x, 0.0, z])


def test_a_goal_is_reached_by_asking_for_its_pose(arm: str) -> None:
    environment = Environment(
        "reach",
        options=Options.of("reach", frames=("hand",), duration=3.0),
        config_overrides={"safety.elbow.max_kp": 200, "safety.every_joint.default_kp": 200},
        config=arm,
    )
    low, high = np.array([-2.2, -1.8]), np.array([2.2, 1.8])
    _, info = environment.reset(seed=3)
    grid = np.stack(
        np.meshgrid(*(np.linspace(a, b, 60) for a, b in zip(low, high, strict=True))), -1
    )
    places = np.array([hand_at(q) for q in grid.reshape(-1, 2)])
    nearest = np.linalg.norm(places - info["desired_goal"], axis=1).argmin()
    action = (2 * (grid.reshape(-1, 2)[nearest] - low) / (high - low) - 1).astype(np.float32)
    truncated = False
    while not truncated:
        _, _, _, truncated, info = environment.step(action)
        assert info["fault"] == 0, info["fault_text"]
    assert info["distance"].shape == (1,)
    assert info["distance"][0] < 0.05


class Lift(Task):
    """Sees what only a robot from a file has."""

    name = "lift_flap"
    num_fingers = 0
    is_for_files = True
    object_name = "ball"
    goal_low = (-1.0,)
    goal_high = (1.0,)

    def draw_start(self, random: Any) -> Start:
        height = random.uniform(0.5, 0.9)
        return Start(object_position=np.column_stack([0 * height + 0.3, 0 * height + 0.4, height]))

    def achieve(self, view: Any) -> Any:
        self.view = view
        return view.joint_position[:, 2:3]


def test_a_task_in_python_sees_joints_frames_and_objects(arm: str) -> None:
    task = Lift()
    options = Options(frames=("hand",), observation="dictionary")
    environment = Environment(task, options=options, config=arm)
    observation, info = environment.reset(seed=1)
    assert 0.5 <= task.view.object_position[0, 2] < 0.9
    np.testing.assert_allclose(observation["object_position"][:2], [0.3, 0.4], atol=1e-6)
    np.testing.assert_allclose(observation["frame_position"], hand_at([0.3, 0.0]), atol=1e-6)
    assert task.view.tips.shape == (1, 1, 3)
    # The motors are in the order of the actuators, the joints in that of the model.
    np.testing.assert_allclose(task.view.position[0], [0.3, 0.0], atol=1e-9)
    np.testing.assert_allclose(task.view.joint_position[0], [0.0, 0.3, 0.0], atol=1e-9)
    assert info["object_age"] == 0
    for _ in range(3):
        _, _, _, _, info = environment.step(np.zeros(2, np.float32))
    assert task.view.object_position[0, 2] < 0.9 - 0.01  # It falls.


@pytest.mark.slow
def test_gymnasium_makes_many_robots_and_stable_baselines_learns_on_them(arm: str) -> None:
    pytest.importorskip("stable_baselines3")
    from stable_baselines3 import PPO
    from trifinger.stable_baselines import Rows

    robots = gymnasium.make_vec(
        "TriFinger/Reach-v0",
        num_envs=4,
        config=arm,
        frames=["hand"],
        duration=0.4,
        autoreset_mode=AutoresetMode.SAME_STEP,
    )
    PPO("MlpPolicy", Rows(robots), n_steps=16, batch_size=16, n_epochs=1).learn(64)  # type: ignore[arg-type]
    robots.close()


@pytest.mark.parametrize("task", ["reach", "dclaw_turn_fixed", "dclaw_pose_fixed"])
def test_a_picture_is_drawn(task: str, arm: str) -> None:
    is_reach = task == "reach"
    options = Options.of(task, frames=("hand",) if is_reach else ())
    config = arm if is_reach else None
    environment = Environment(task, options=options, config=config, render_mode="rgb_array")
    environment.reset(seed=1)
    assert environment.render().shape == (540, 720, 3)
    environment.close()


def test_a_saved_state_continues_with_its_variation(arm: str) -> None:
    options = Options.of("reach", frames=("hand",), **VARIED)
    environment = Environment("reach", options=options, config=arm)
    environment.reset(seed=1)
    simulation = environment.simulation
    assert simulation is not None
    environment.step(np.ones(2, np.float32))
    state = simulation.save()
    other = trifinger.Simulation(*environment.scene)
    other.restore(state)
    environment.close()
    ends = []
    for one in (simulation, other):
        one.restore(state)
        robot = one.connect()
        for _ in range(50):
            t = robot.append_desired_action(robot.new_action(position=[0.5, -0.5]))
        ends.append(robot.get_observation(t).tobytes())
        robot.close()
    assert ends[0] == ends[1]


def test_what_does_not_fit_is_said(arm: str) -> None:
    def message(task: str, **arguments: Any) -> str:
        with pytest.raises(trifinger.InvalidArgument) as error:
            gymnasium.make(task, config=arm, **arguments)
        return str(error.value)

    assert "frames=[" in message("TriFinger/Reach-v0")
    assert "its sites are hand" in message("TriFinger/Reach-v0", frames=["fist"])
    assert "is for a TriFinger" in message("TriFinger/Push-v0")
    assert "no joint 'FFJ10'" in message("TriFinger/DclawTurnFixed-v0")
    options = dataclasses.replace(Options.of("reach"), frames=("hand",))
    with pytest.raises(trifinger.InvalidArgument, match="frames are for robots from files"):
        Environment("reach", options=options)
    with pytest.raises(trifinger.InvalidArgument, match="a robot from a file, such as dclaw"):
        VectorEnvironment("dclaw_turn_fixed", 2, config="trifinger_edu")


def test_scores_of_dclaw_are_in_info() -> None:
    single = Environment("dclaw_turn_fixed")
    vector = VectorEnvironment("dclaw_turn_fixed", 2, autoreset_mode=AutoresetMode.SAME_STEP)
    names = ("points", "joints_near_limit", "fast_joints", "high_currents")
    _, info = single.reset(seed=1)
    assert info["points"] == pytest.approx(0.0, abs=1e-9)
    _, many = vector.reset(seed=1)
    for name in names:
        assert many[name].shape == (2,)
        assert many[name][0] == info[name]
    for _ in range(single.episode_actions):
        _, _, _, truncated, many = vector.step(np.zeros((2, 9), np.float32))
    assert truncated.all()
    assert many["final_info"]["points"].shape == (2,)


def test_the_valve_of_dclaw_begins_where_the_task_says() -> None:
    environment = Environment("dclaw_turn_random")
    simulation = environment.simulation
    assert simulation is not None
    begins = []
    for episode in range(20):
        observation, info = environment.reset(seed=1, options={"episode": episode})
        valve = simulation.configuration()[9]
        begins.append(valve)
        seen = environment.entries(np.asarray(observation))
        np.testing.assert_allclose(seen["valve"], [np.cos(valve), np.sin(valve)], atol=1e-6)
        error = np.remainder(info["desired_goal"][0] - valve + np.pi, 2 * np.pi) - np.pi
        assert seen["error"][0] == pytest.approx(error, abs=1e-5)
        assert info["points"] == pytest.approx(1 - abs(error) / np.pi)
    assert np.abs(begins).max() <= np.pi / 3
    assert np.ptp(begins) > 1
