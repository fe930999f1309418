# SPDX-License-Identifier: BSD-3-Clause
"""Environments satisfy Gymnasium, and one simulation gives the same numbers as many."""

import copy
import dataclasses
import os
import pickle
import re
import signal
import subprocess
import sys
import threading
from functools import partial
from pathlib import Path
from typing import Any

import av
import gymnasium
import numpy as np
import pytest
import stable_baselines3
import trifinger
from conftest import PATIENT, StartProgram, diverging_state
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from stable_baselines3.common.env_checker import check_env as check_env_of_sb3
from trifinger import environments
from trifinger.environments import Environment, Options, VectorEnvironment
from trifinger.picture import View

pytestmark = pytest.mark.bindings

# Tasks of TriFingers; test_file_environments.py has the others.
TASKS = [name for name in environments.TASKS if not name.startswith("dclaw_")]

# Everything that can be random, in one go.
VARIED = {
    "position_noise": 1e-3,
    "velocity_noise": 1e-2,
    "object_delay": 0.013,
    "object_position_noise": 1e-3,
    "object_orientation_noise": 1e-2,
    "object_mass": (0.8, 1.2),
    "friction": (0.7, 1.2),
    "motor_gain": (0.9, 1.1),
    "torque_delay": (0, 4),
    "pair_friction": {"tip_object": (0.8, 1.2), "object_table": (0.5, 1.5)},
    "contact_time": (1.0, 3.0),
    "rotor_inertia": (0.5, 1.5),
    "joint_damping": (0.5, 5.0),
    "joint_friction": (0.0, 0.01),
    "stop_margin": (0.5, 1.5),
    "condition": "worn",
    "homing_error": (0.001, 0.004),
    "measurement_delay": (0, 3),
    "tip_radius": (0.9, 1.1),
    "object_speed": (0.0, 0.1),
}


def single(task, **options):
    return Environment(task, options=Options.of(task, **options))


def wandering(shape, seed=0):
    rng = np.random.default_rng(seed)
    action = np.zeros(shape, np.float32)
    while True:
        action = np.clip(action + 0.3 * rng.normal(size=shape), -1, 1).astype(np.float32)
        yield action


def assert_equal(vector, index, one):
    if isinstance(one, dict):
        for name, part in one.items():
            np.testing.assert_array_equal(vector[name][index], part, err_msg=name)
    else:
        np.testing.assert_array_equal(vector[index], one)


def test_environments_are_introduced_in_the_ways_of_gymnasium():
    program = """
import gymnasium
{first}
environment = gymnasium.make("{name}", duration=0.1)
environment.reset(seed=1)
environment.step(environment.action_space.sample())
environment.close()
"""
    for first, name in [
        ("import trifinger.environments\ngymnasium.register_envs(trifinger.environments)", ""),
        ("", "trifinger.environments:"),
    ]:
        text = program.format(first=first, name=f"{name}TriFinger/Push-v0")
        subprocess.run([sys.executable, "-W", "error", "-c", text], check=True)
        text = text.replace("gymnasium.make(", "gymnasium.make_vec(").replace(
            ", dur", ", num_envs=2, dur"
        )
        subprocess.run([sys.executable, "-W", "error", "-c", text], check=True)


def test_gymnasium_records_a_film(tmp_path):
    environment = gymnasium.make("TriFinger/Reach-v0", duration=0.2, render_mode="rgb_array")
    recorder = gymnasium.wrappers.RecordVideo(
        environment, str(tmp_path / "film"), name_prefix="reach"
    )
    recorder.reset(seed=1)
    steps, has_ended = 0, False
    while not has_ended:
        *_, terminated, truncated, _ = recorder.step(recorder.action_space.sample())
        has_ended = terminated or truncated
        steps += 1
    recorder.close()
    with av.open(tmp_path / "film" / "reach-episode-0.mp4") as film:
        stream = film.streams.video[0]
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(stream)]
        assert stream.average_rate == 50
    # A picture of the start and one after each action; the film's length is rounded to a picture.
    assert len(frames) in (steps, steps + 1)
    assert np.ptp(frames[0]) > 100


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("observation", ["flat", "dictionary", "goal"])
@pytest.mark.filterwarnings("error")
def test_official_checkers_find_nothing(task, observation, capsys):
    # Pictures have a test of their own: the checker wants a window, too.
    check_env(single(task, observation=observation, duration=0.2).unwrapped, skip_render_check=True)
    check_env_of_sb3(single(task, observation=observation, duration=0.2), skip_render_check=True)
    capsys.readouterr()  # Stable-Baselines3 says that it has found a goal.


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"mapping": "state_augmentation", "steps_per_action": 7},
        {"action": "torque", "observation": "goal", **VARIED},
        {"action": "position_change", "observation": "dictionary", "position_kp": 3.0, **VARIED},
    ],
    ids=["default", "augmented", "torque", "change"],
)
def test_a_simulation_among_many_is_the_single_one_bit_for_bit(task, options):
    options = {"duration": 0.3, **options}
    vector = VectorEnvironment(task, 2, options=Options.of(task, **options), num_threads=2)
    ones = [single(task, **options) for _ in range(2)]
    seen, _ = vector.reset(seed=5)
    for index, one in enumerate(ones):
        assert_equal(seen, index, one.reset(seed=5 + index)[0])
    has_ended = [False, False]
    ends = 0
    actions = wandering(vector.action_space.shape)
    while ends < 5:
        action = next(actions)
        seen, rewards, terminated, truncated, info = vector.step(action)
        for index, one in enumerate(ones):
            if has_ended[index]:
                assert_equal(seen, index, one.reset()[0])
                assert rewards[index] == 0.0
                has_ended[index] = False
                continue
            state, reward, *end, one_info = one.step(action[index])
            assert_equal(seen, index, state)
            assert (reward, *end) == (rewards[index], terminated[index], truncated[index])
            for name in ("distance", "achieved_goal", "desired_goal", "is_success"):
                np.testing.assert_array_equal(info[name][index], one_info[name])
            has_ended[index] = any(end)
            ends += has_ended[index]


def test_a_gain_that_is_asked_for_takes_the_place_of_the_gain_of_the_robot() -> None:
    asked = Environment("reach", position_kp=3.0)
    own = Environment("reach", config_overrides={"safety.default_kp": 3})
    usual = Environment("reach")
    for one in (asked, own, usual):
        one.reset(seed=1)
    action = np.full(9, 0.3, np.float32)
    seen = [one.step(action)[0] for one in (asked, own, usual)]
    np.testing.assert_array_equal(seen[0], seen[1])
    assert not np.array_equal(seen[0], seen[2])


# A low bound of plausible velocities [rad/s], so that full torque to and fro causes a fault.
def believing(rate):
    return {"safety.plausibility.max_position_rate": rate}


def to_and_fro(shape):
    for step in range(400):
        yield np.full(shape, 1.0 if step % 2 else -1.0, np.float32)


@pytest.mark.parametrize("mapping", ["approximation", "state_augmentation"])
@pytest.mark.parametrize("rate", [0.05, 2.0])
def test_a_fault_of_the_robot_ends_the_same_episodes_of_both(mapping, rate):
    options = Options.of("reach", action="torque", mapping=mapping, duration=0.2)
    one = Environment("reach", options=options, config_overrides=believing(rate))
    vector = VectorEnvironment("reach", 1, options=options, config_overrides=believing(rate))
    state, one_info = one.reset(seed=1)
    seen, info = vector.reset(seed=1)
    has_ended = False
    faults = 0
    for action in to_and_fro(9):
        assert_equal(seen, 0, state)
        for name in ("distance", "achieved_goal", "desired_goal", "is_success", "fault"):
            np.testing.assert_array_equal(info[name][0], one_info[name])
        seen, rewards, terminated, truncated, info = vector.step(action[None])
        if has_ended:
            state, one_info = one.reset()
            has_ended = False
            continue
        state, reward, *end, one_info = one.step(action)
        assert (reward, *end) == (rewards[0], terminated[0], truncated[0])
        has_ended = any(end)
        assert ("fault_text" in one_info) == (one_info["fault"] != 0)
        # A fault truncates and does not terminate, so learners still estimate what would follow.
        assert one_info["fault"] == 0 or end == [False, True]
        faults += one_info["fault"] != 0
        if faults == 3:
            break
    assert faults == 3


def test_fault_61_a_simulation_that_diverges_is_cut_off_and_can_be_reset():
    environment = single("push")
    environment.reset(seed=1)
    environment.simulation.restore(diverging_state(environment.simulation))
    _, _, terminated, truncated, info = environment.step(np.zeros(9, np.float32))
    assert (terminated, truncated) == (False, True)
    assert "diverge" in info["fault_text"]
    seen, _ = environment.reset(seed=1)
    np.testing.assert_array_equal(seen, single("push").reset(seed=1)[0])


def test_a_simulation_that_has_ended_with_a_fault_begins_anew_in_the_same_step():
    options = Options.of("reach", action="torque")
    arguments = {"options": options, "config_overrides": believing(2.0)}
    mode = AutoresetMode.SAME_STEP
    ours = VectorEnvironment("reach", 2, autoreset_mode=mode, **arguments)
    theirs = SyncVectorEnv([lambda: Environment("reach", **arguments)] * 2, autoreset_mode=mode)
    for environment in (ours, theirs):
        environment.reset(seed=3)
    faults = 0
    for action in to_and_fro((2, 9)):
        mine, yours = ours.step(action), theirs.step(action)
        for a, b in zip(mine[:4], yours[:4], strict=True):
            np.testing.assert_array_equal(a, b)
        for name in ("distance", "achieved_goal", "is_success", "fault"):
            np.testing.assert_array_equal(mine[4][name], yours[4][name])
        if "final_info" in mine[4]:
            np.testing.assert_array_equal(
                mine[4]["final_info"]["fault"], yours[4]["final_info"]["fault"]
            )
            faults += (mine[4]["final_info"]["fault"] != 0).sum()
        if faults >= 3:
            break
    assert faults >= 3


@pytest.mark.parametrize("options", [{}, {"observation": "goal"}, {"observation": "dictionary"}])
@pytest.mark.parametrize("mode", AutoresetMode)
def test_resets_itself_as_the_vector_environment_of_gymnasium_does(mode, options):
    options = {"duration": 0.1, "position_noise": 1e-3, **options}
    ours = VectorEnvironment("push", 3, options=Options.of("push", **options), autoreset_mode=mode)
    theirs = SyncVectorEnv([lambda: single("push", **options)] * 3, autoreset_mode=mode)
    for index, one in enumerate(theirs.envs):
        one.action_space.seed(index)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert ours.single_observation_space == theirs.single_observation_space
    assert ours.metadata["autoreset_mode"] == theirs.metadata["autoreset_mode"]
    pair = [environment.reset(seed=7) for environment in (ours, theirs)]
    for index in range(3):
        assert_equal(pair[0][0], index, select(pair[1][0], index))
    for action, _ in zip(wandering(ours.action_space.shape), range(14), strict=False):
        mine, yours = ours.step(action), theirs.step(action)
        for index in range(3):
            assert_equal(mine[0], index, select(yours[0], index))
        for a, b in zip(mine[1:4], yours[1:4], strict=True):
            np.testing.assert_array_equal(a, b)
            assert a.dtype == b.dtype
        for name in ("distance", "achieved_goal", "desired_goal", "is_success", "fault"):
            np.testing.assert_array_equal(mine[4][name], yours[4][name])
        assert ("final_obs" in mine[4]) == ("final_obs" in yours[4])
        if "final_obs" in mine[4]:
            for a, b in zip(mine[4]["final_obs"], yours[4]["final_obs"], strict=True):
                assert data_equivalence(a, b, exact=True)
            for name in ("distance", "achieved_goal", "desired_goal", "is_success"):
                np.testing.assert_array_equal(
                    mine[4]["final_info"][name], yours[4]["final_info"][name]
                )
        if mode == AutoresetMode.DISABLED and (mine[2] | mine[3]).any():
            mask = mine[2] | mine[3]
            a, b = (
                environment.reset(options={"reset_mask": mask.copy()})
                for environment in (ours, theirs)
            )
            for index in range(3):
                assert_equal(a[0], index, select(b[0], index))


def select(observation, index):
    if isinstance(observation, dict):
        return {name: part[index] for name, part in observation.items()}
    return observation[index]


@pytest.mark.parametrize("task", TASKS)
def test_the_reward_is_that_of_the_goals_alone_or_in_batches(task):
    environment = single(task, observation="goal", duration=1.0)
    environment.reset(seed=2)
    achieved, desired, rewards = [], [], []
    for action, _ in zip(wandering((environment.action_space.shape[0],)), range(20), strict=False):
        seen, reward, *_ = environment.step(action)
        assert environment.compute_reward(seen["achieved_goal"], seen["desired_goal"]) == reward
        achieved.append(seen["achieved_goal"])
        desired.append(seen["desired_goal"])
        rewards.append(reward)
    np.testing.assert_array_equal(
        environment.compute_reward(np.array(achieved), np.array(desired)), rewards
    )


def test_the_reward_of_reaching_is_the_mean_distance_by_other_kinematics():
    environment = single("reach", observation="dictionary")
    environment.reset(seed=4)
    kinematics = trifinger.Kinematics("trifinger_edu")
    for action, _ in zip(wandering((9,)), range(10), strict=False):
        seen, reward, *_ = environment.step(action)
        tips = kinematics.tip_positions(seen["joint_position"])
        distances = np.linalg.norm(tips - seen["goal"].reshape(3, 3), axis=1)
        assert reward == pytest.approx(-distances.mean(), abs=1e-6)


def test_the_reward_of_moving_the_cube_is_the_cost_of_the_challenge():
    environment = single("push", observation="goal")
    lift_pose = single("lift_pose", observation="goal")
    # The example of the challenge's rules: 0.1 m aside and 0.05 m above.
    assert environment.compute_reward([0.1, 0, 0.05], [0, 0, 0]) == pytest.approx(
        -0.378205, abs=1e-6
    )
    quarter = [np.sqrt(0.5), 0, 0, np.sqrt(0.5)]
    assert lift_pose.compute_reward([0, 0, 0, 1, 0, 0, 0], [0, 0, 0, *quarter]) == pytest.approx(
        -0.25
    )


@pytest.mark.parametrize("task", TASKS)
def test_entries_of_flat_observations_are_those_of_the_dictionary(task):
    options = {"mapping": "state_augmentation", "duration": 0.2}
    flat, named = single(task, **options), single(task, observation="dictionary", **options)
    many = VectorEnvironment(task, 1, options=flat.options)
    seen, shown = flat.reset(seed=3)[0], named.reset(seed=3)[0]
    for action, _ in zip(wandering(flat.action_space.shape), range(5), strict=False):
        entries, rows = flat.entries(seen), many.entries(seen[None])
        assert entries.keys() == rows.keys() == shown.keys()
        for name, entry in entries.items():
            np.testing.assert_allclose(entry, shown[name], atol=2e-6)
            np.testing.assert_array_equal(rows[name], entry[None])
        seen, shown = flat.step(action)[0], named.step(action)[0]
    with pytest.raises(trifinger.InvalidArgument, match="dictionary"):
        named.entries(seen)


@pytest.mark.parametrize("task", ["reach", "push"])
@pytest.mark.parametrize("action", ["position", "position_change", "relative_position", "torque"])
def test_the_first_augmented_state_has_the_action_that_holds(task, action):
    options = {"mapping": "state_augmentation", "observation": "dictionary"}
    environment = single(task, action=action, **options)
    seen, _ = environment.reset(seed=2)
    if action != "position":
        assert not seen["action"].any()
        return
    held = seen["joint_position"]
    for _ in range(50):
        seen, *_ = environment.step(seen["action"])
    np.testing.assert_allclose(seen["joint_position"], held, atol=0.03)


@pytest.mark.parametrize("observation", ["flat", "dictionary", "goal"])
def test_observations_are_copies_unless_they_need_not_be(observation):
    options = Options.of("push", observation=observation)

    def is_shared(copy):
        vector = VectorEnvironment("push", 2, options=options, copy=copy)
        first = vector.reset(seed=1)[0]
        second = vector.step(np.zeros((2, 9), np.float32))[0]
        if observation == "flat":
            return np.shares_memory(first, second)
        shared = {np.shares_memory(first[name], second[name]) for name in first}
        assert len(shared) == 1
        return shared.pop()

    assert is_shared(copy=False)
    assert not is_shared(copy=True)


def test_fingers_cannot_be_told_apart_in_observations_finger_by_finger():
    environment = single("reach", per_finger=True)
    flat, _ = environment.reset(seed=3)
    world = single("reach", observation="dictionary")
    named, _ = world.reset(seed=3)
    blocks = flat.reshape(3, 9)
    goals = named["goal"].reshape(3, 3)
    # In the frame of its finger, a goal has the same height and distance from the centre.
    low, high = np.array([-0.3, -0.3, 0.0]), np.array([0.3, 0.3, 0.5])
    seen = low + (blocks[:, 6:] + 1) / 2 * (high - low)
    np.testing.assert_allclose(seen[:, 2], goals[:, 2], atol=1e-6)
    np.testing.assert_allclose(
        np.linalg.norm(seen[:, :2], axis=1), np.linalg.norm(goals[:, :2], axis=1), atol=1e-6
    )
    # All goals lie in front of finger 0, which is at 90 degrees from x.
    assert (np.abs(np.arctan2(seen[:, 1], seen[:, 0]) - np.pi / 2) < np.pi / 3 + 1e-6).all()
    np.testing.assert_allclose(seen[0], goals[0], atol=1e-6)


def test_seeds_decide_episodes_in_any_order():
    environment = single("push", **VARIED)
    first = [environment.reset(seed=9)[0], environment.reset()[0], environment.reset()[0]]
    np.testing.assert_array_equal(environment.reset(options={"episode": 1})[0], first[1])
    np.testing.assert_array_equal(environment.reset(seed=9)[0], first[0])
    assert not np.array_equal(first[0], first[1])
    assert not np.array_equal(environment.reset(seed=10)[0], first[0])


def test_without_a_seed_one_is_drawn_and_can_be_told():
    first = []
    for _ in range(2):
        environment = single("reach")
        first.append(environment.reset()[0])
        seed = environment.np_random_seed % 2**32
        np.testing.assert_array_equal(environment.reset(seed=seed)[0], first[-1])
    assert not np.array_equal(*first)
    vector = VectorEnvironment("reach", 2)
    seen, _ = vector.reset()
    seed = vector.np_random_seed % 2**32
    np.testing.assert_array_equal(vector.reset(seed=seed)[0], seen)
    assert not np.array_equal(seen[0], seen[1])


def test_many_begin_with_any_episodes_of_their_seeds():
    vector = VectorEnvironment("reach", 2)
    seen, _ = vector.reset(seed=4, options={"episode": [3, 1]})
    for index, episode in enumerate((3, 1)):
        one = single("reach")
        assert_equal(seen, index, one.reset(seed=4 + index, options={"episode": episode})[0])
    with pytest.raises(trifinger.InvalidArgument, match="seed"):
        vector.reset(options={"episode": 2})


def test_a_connected_robot_must_be_what_the_configuration_says():
    for config, said in (("trifinger_pro", "trifinger-pro"), ("trifinger_edu", "period")):
        overrides = {"backend.period": 0.002} if said == "period" else {}
        robot = trifinger.Simulation(config, overrides)
        environment = Environment("reach", connect=robot.connect)
        with pytest.raises(trifinger.InvalidArgument, match=said):
            environment.reset(seed=0)


def test_a_robot_without_the_object_is_not_moved():
    robot = trifinger.Simulation("trifinger_edu", {"objects": []})
    sessions = []

    def connect():
        sessions.append(robot.connect())
        return sessions[-1]

    environment = Environment("push", connect=connect)
    with pytest.raises(trifinger.Error):
        environment.reset(seed=0)
    assert environment.process.time_index <= 1
    with pytest.raises(trifinger.Error):
        sessions[0].session_info()  # its handle was closed


def test_time_truncates_and_a_lost_object_terminates():
    environment = single("reach", duration=0.1)
    environment.reset(seed=0)
    ends = [environment.step(np.zeros(9, np.float32))[2:4] for _ in range(5)]
    assert ends == [(False, False)] * 4 + [(False, True)]

    environment = Environment("push", config_overrides={"boundary": False})
    environment.reset(seed=0)
    environment.step(np.zeros(9, np.float32))
    environment.simulation.place_object("cube", [0.5, 0.0, 0.0325])
    assert environment.step(np.zeros(9, np.float32))[2:4] == (True, False)


def test_a_ball_that_flies_and_lands_ends_a_throw():
    environment = single("throw")
    _, info = environment.reset(seed=0)
    goal = info["desired_goal"]
    environment.simulation.place_object("ball", [*goal, 0.15])
    for _ in range(30):
        _, reward, terminated, _, info = environment.step(np.zeros(9, np.float32))
        if terminated:
            break
    assert terminated
    assert info["is_success"]
    assert reward > -0.1


def test_goals_on_a_trajectory_change_when_the_challenge_says():
    environment = single("move_cube_on_trajectory", steps_per_action=1000, duration=60.0)
    seen, info = environment.reset(seed=0)
    shown, judged = [seen[-3:]], [info["desired_goal"]]
    for _ in range(60):
        seen, *_, info = environment.step(np.zeros(9, np.float32))
        shown.append(seen[-3:])
        judged.append(info["desired_goal"])

    def changes(goals):
        return [t for t in range(1, 61) if not np.array_equal(goals[t], goals[t - 1])]

    # The reward of an action is for the goal that the policy saw before it.
    assert changes(shown) == [30, 40, 50]
    assert changes(judged) == [31, 41, 51]


def test_starts_and_goals_are_where_the_robot_can_be():
    kinematics = trifinger.Kinematics("trifinger_edu")
    environment = single("reach")
    for episode in range(200):
        _, info = environment.reset(seed=0, options={"episode": episode})
        assert (info["distance"] > 0).all()
        for finger, goal in enumerate(info["desired_goal"].reshape(3, 3)):
            assert kinematics.inverse_kinematics(finger, goal)[1] == "yes"
            assert goal[2] >= 0.02
    push = single("push")
    for episode in range(100):
        _, info = push.reset(seed=0, options={"episode": episode})
        assert np.linalg.norm(info["desired_goal"][:2]) <= 0.138708
        assert info["achieved_goal"][2] == pytest.approx(0.0325, abs=1e-4)


def test_options_reach_the_environment_by_name_and_are_printed():
    environment = gymnasium.make("TriFinger/Reach-v0", steps_per_action=10).unwrapped
    assert environment.options == Options.of("reach", steps_per_action=10)
    assert "steps_per_action=10" in repr(environment)
    assert environment.metadata["render_fps"] == 100
    vector = gymnasium.make_vec(
        "TriFinger/Push-v0", num_envs=2, vectorization_mode="vector_entry_point"
    )
    assert isinstance(vector.unwrapped, VectorEnvironment)
    vector = gymnasium.make_vec(
        "TriFinger/Reach-v0",
        num_envs=1,
        vectorization_mode="vector_entry_point",
        options=Options.of("reach", duration=1.0),
        steps_per_action=10,
    )
    assert vector.unwrapped.options == Options.of("reach", duration=1.0, steps_per_action=10)
    for field in dataclasses.fields(Options):
        assert field.name in repr(vector.unwrapped)


@pytest.mark.without_sanitizer
def test_a_picture_has_the_view_that_was_asked_for():
    pictures = {}
    for camera in ("front", "camera60"):
        environment = gymnasium.make(
            "TriFinger/Reach-v0", render_mode="rgb_array", view=View(camera, 161, 121)
        )
        environment.reset(seed=0)
        pictures[camera] = environment.render()
        environment.close()
        assert pictures[camera].shape == (121, 161, 3)
    assert (pictures["front"] != pictures["camera60"]).mean() > 0.5


@pytest.mark.without_sanitizer
def test_a_picture_shows_robot_and_goals():
    environment = Environment("reach", render_mode="rgb_array")
    environment.reset(seed=0)
    image = environment.render()
    assert image.shape == (540, 720, 3)
    red, green, blue = (image[..., i].astype(int) for i in range(3))
    assert ((red > 150) & (green > 110) & (blue < 90)).sum() > 50  # the yellow goals
    environment.close()


@pytest.mark.without_sanitizer
def test_pictures_of_many_are_those_of_single_ones():
    drawn = {"render_mode": "rgb_array", "view": View("camera60", 160, 120)}
    vector = gymnasium.make_vec("TriFinger/Push-v0", 2, **drawn)
    singles = [gymnasium.make("TriFinger/Push-v0", **drawn) for _ in range(2)]
    vector.reset(seed=3)
    actions = np.random.default_rng(0).uniform(-1, 1, vector.action_space.shape)
    vector.step(actions.astype(np.float32))
    pictures = vector.render()
    for i, single in enumerate(singles):
        single.reset(seed=3 + i)
        single.step(actions[i].astype(np.float32))
        # A single one may be a step of 1 ms ahead.
        differences = [np.abs(one.astype(int) - single.render()).mean() for one in pictures]
        assert differences[i] < 1
        assert differences[1 - i] > 2 * differences[i]
        single.close()
    vector.close()


def pickled(environment):
    return pickle.loads(pickle.dumps(environment))  # noqa: S301 (what was pickled here)


@pytest.mark.parametrize("again", [copy.deepcopy, pickled])
@pytest.mark.parametrize("make", [gymnasium.make, partial(gymnasium.make_vec, num_envs=2)])
def test_a_copy_is_a_new_environment_with_the_same_arguments(make, again):
    first = make("TriFinger/Push-v0", observation="goal", duration=0.2, friction=(0.7, 1.2))
    first.reset(seed=5)
    actions = 0.1 * np.ones(first.action_space.shape, np.float32)
    first.step(actions)
    second = again(first)
    assert second.unwrapped.spec.id == "TriFinger/Push-v0"
    assert second.unwrapped.options == first.unwrapped.options
    assert second.observation_space == first.observation_space
    with pytest.raises(gymnasium.error.ResetNeeded):
        second.unwrapped.step(actions)
    expected, _ = first.reset(seed=5)
    seen, _ = second.reset(seed=5)
    assert data_equivalence(seen, expected, exact=True)
    for mine, others in zip(second.step(actions), first.step(actions), strict=True):
        assert data_equivalence(mine, others, exact=True)
    first.close()
    second.close()


class TestMistakes:
    def test_a_wrong_shape(self):
        environment = single("reach")
        environment.reset()
        with pytest.raises(trifinger.InvalidArgument, match=r"shape \(3,\), must have \(9,\)"):
            environment.step(np.zeros(3, np.float32))
        vector = VectorEnvironment("reach", 2)
        vector.reset()
        with pytest.raises(trifinger.InvalidArgument, match=r"shape \(9,\), must have \(2, 9\)"):
            vector.step(np.zeros(9, np.float32))

    def test_a_number_that_is_none(self):
        environment = single("reach")
        environment.reset()
        action = np.zeros(9, np.float32)
        action[4] = np.nan
        with pytest.raises(trifinger.InvalidArgument, match="finite"):
            environment.step(action)
        environment.step(np.zeros(9, np.float32))
        vector = VectorEnvironment("reach", 2)
        vector.reset()
        with pytest.raises(
            trifinger.InvalidArgument, match="number 4 of the action of simulation 1"
        ):
            vector.step(np.stack([np.zeros(9, np.float32), action]))

    def test_a_step_after_the_end(self):
        environment = single("reach", duration=0.02)
        with pytest.raises(gymnasium.error.ResetNeeded):
            environment.step(np.zeros(9, np.float32))
        environment.reset()
        environment.step(np.zeros(9, np.float32))
        with pytest.raises(gymnasium.error.ResetNeeded):
            environment.step(np.zeros(9, np.float32))
        with pytest.raises(gymnasium.error.ResetNeeded):
            VectorEnvironment("reach", 1).step(np.zeros((1, 9), np.float32))

    def test_a_step_after_the_end_of_some(self):
        options = Options.of("reach", duration=0.04)
        vector = VectorEnvironment(
            "reach", 3, options=options, autoreset_mode=AutoresetMode.DISABLED
        )
        vector.reset(seed=1)
        actions = np.zeros((3, 9), np.float32)
        vector.step(actions)
        vector.reset(options={"reset_mask": np.array([False, True, False])})
        assert vector.step(actions)[3].tolist() == [True, False, True]
        with pytest.raises(gymnasium.error.ResetNeeded, match=r"simulations \[0, 2\] have ended"):
            vector.step(actions)
        vector.reset(options={"reset_mask": np.array([True, False, True])})
        assert vector.step(actions)[3].tolist() == [False, True, False]

    @pytest.mark.parametrize("make", [gymnasium.make, gymnasium.make_vec])
    def test_an_option_that_gymnasium_is_given(self, make):
        with pytest.raises(trifinger.InvalidArgument, match="there is no option 'rate'"):
            make("TriFinger/Reach-v0", rate=50)

    @pytest.mark.parametrize("make", [Environment, VectorEnvironment, gymnasium.make])
    @pytest.mark.parametrize(
        ("name", "value", "allowed"),
        [
            ("observation", "nonsense", "'flat', 'dictionary', 'goal' or 'images'"),
            ("observation", object(), "'flat', 'dictionary', 'goal' or 'images'"),
            ("duration", "2", r"like 2\.0"),
            ("duration", float("nan"), r"like 2\.0"),
            ("steps_per_action", 20.5, "like 20"),
            ("per_finger", 1, "like False"),
            ("object_mass", (1.0,), r"like \(1\.0, 1\.0\)"),
            ("torque_delay", (0, 1.5), r"like \(0, 0\)"),
            ("frames", "hand", r"a tuple\[str, \.\.\.\]"),
            ("pair_friction", {"cube": 1.0}, r"a .*Mapping\[str, tuple\[float, float\]\]"),
            ("options", {"duration": 1.0}, "Options"),
            ("config", 3, "the name of a configuration"),
            ("config_overrides", ["backend.period=1"], "keys and values"),
        ],
    )
    def test_a_value_of_a_wrong_kind(self, make, name, value, allowed):
        where = ("TriFinger/Reach-v0",) if make is gymnasium.make else ("reach",)
        where += (2,) if make is VectorEnvironment else ()
        with pytest.raises(trifinger.InvalidArgument, match=f"^{name} is .*, must be {allowed}"):
            make(*where, **{name: value})

    @pytest.mark.parametrize(
        ("name", "value", "allowed"),
        [
            ("num_envs", "x", r"a whole number, 0 to 2\^31 - 1"),
            ("num_envs", 2.5, "a whole number"),
            ("num_envs", True, "a whole number"),
            ("num_envs", 10**12, "a whole number"),
            ("num_threads", None, "a whole number"),
            ("num_threads", -1, "a whole number"),
            ("autoreset_mode", "x", r"an AutoresetMode, such as AutoresetMode\.SAME_STEP"),
            ("copy", "no", "True or False"),
            ("task", 3, "the name of a task"),
            ("config_overrides", 0, "keys and values"),
        ],
    )
    def test_an_argument_of_many_that_is_of_a_wrong_kind(self, name, value, allowed):
        arguments = {"task": "push", "num_envs": 2, name: value}
        with pytest.raises(trifinger.InvalidArgument, match=f"^{name} is .*, must be {allowed}"):
            VectorEnvironment(**arguments)

    def test_a_view_and_an_override_of_a_wrong_kind(self):
        with pytest.raises(trifinger.InvalidArgument, match=r"^view is 'front', must be a View"):
            Environment("push", view="front")
        overrides = {"backend.period": object()}
        for make in (Environment, lambda task, **more: VectorEnvironment(task, 2, **more)):
            with pytest.raises(
                trifinger.InvalidArgument, match=r"backend\.period is <object .*, must be a number"
            ):
                make("push", config_overrides=overrides)

    @pytest.mark.parametrize(
        ("name", "value", "arguments"),
        [
            ("seed", 1.5, {"seed": 1.5}),
            ("seed", "x", {"seed": "x"}),
            ("seed", 2**64, {"seed": 2**64}),
            ("options", 3, {"options": 3}),
            ('options["episode"]', "x", {"seed": 1, "options": {"episode": "x"}}),
            ('options["episode"]', -1, {"seed": 1, "options": {"episode": -1}}),
        ],
    )
    def test_an_argument_of_a_reset_that_is_of_a_wrong_kind(self, name, value, arguments):
        message = f"^{re.escape(name)} is {re.escape(repr(value))}, must be "
        for environment in (Environment("reach"), VectorEnvironment("reach", 2)):
            with pytest.raises(trifinger.InvalidArgument, match=message):
                environment.reset(**arguments)
            environment.reset(seed=np.int64(3), options={"episode": np.int64(1)})

    def test_seeds_and_marks_of_a_wrong_kind(self):
        vector = VectorEnvironment("reach", 2)
        with pytest.raises(
            trifinger.InvalidArgument, match=r"^seed is 'x', must be a whole number"
        ):
            vector.reset(seed=[1, "x"])
        with pytest.raises(trifinger.InvalidArgument, match="there are 3 episodes for 2 sim"):
            vector.reset(seed=1, options={"episode": [1, 2, 3]})
        vector.reset(seed=[1, None], options={"episode": np.arange(2)})
        vector.reset(options={"reset_mask": [True, False]})
        with pytest.raises(trifinger.InvalidArgument, match=r'^options\["reset_mask"\] is .*True'):
            vector.reset(options={"reset_mask": np.ones(2)})

    def test_a_window_without_a_screen(self, monkeypatch):
        for name in ("DISPLAY", "WAYLAND_DISPLAY"):
            monkeypatch.delenv(name, raising=False)
        environment = Environment("reach", render_mode="human")
        with pytest.raises(trifinger.InvalidArgument, match="no screen"):
            environment.reset()
        environment.close()

    def test_two_environments_on_one_robot(self):
        simulation = trifinger.Simulation("trifinger_edu")
        first, second = (Environment("reach", connect=simulation.connect) for _ in range(2))
        first.reset()
        with pytest.raises(trifinger.ControlHeld, match="controlled"):
            second.reset()
        first.close()
        second.reset()

    def test_options_that_there_are_not(self):
        with pytest.raises(trifinger.InvalidArgument, match="'rate'"):
            Options.of("reach", rate=50)
        with pytest.raises(trifinger.InvalidArgument, match="there is no task 'juggle'"):
            Options.of("juggle")
        with pytest.raises(trifinger.InvalidArgument, match="per_finger is for tasks"):
            single("push", per_finger=True)
        with pytest.raises(trifinger.InvalidArgument, match="steps_per_action is 1"):
            single("reach", steps_per_action=1)
        with pytest.raises(trifinger.InvalidArgument, match="friction is 2 to 1"):
            single("reach", friction=(2.0, 1.0))

    def test_options_may_be_arguments(self):
        for one in (
            Environment("reach", duration=1.0),
            VectorEnvironment("reach", 2, duration=1.0),
        ):
            assert one.options == Options.of("reach", duration=1.0)
            one.close()
        for make in (Environment, lambda task, **more: VectorEnvironment(task, 2, **more)):
            with pytest.raises(trifinger.InvalidArgument, match="there is no option 'durration'"):
                make("reach", durration=1.0)
            with pytest.raises(trifinger.InvalidArgument, match=r"observation.*flat"):
                make("push", observation="pictures")

    def test_a_robot_that_does_not_suit(self):
        with pytest.raises(trifinger.InvalidArgument, match="needs an object called 'cube'"):
            Environment("push", config_overrides={"objects": []})
        with pytest.raises(trifinger.InvalidArgument, match="3 fingers, this one has 1"):
            Environment("reach", config_overrides={"robot.arrangement": "finger"})


def test_a_connected_robot_is_moved_to_the_start_and_runs_the_same_task():
    simulation = trifinger.Simulation("trifinger_edu")
    environment = Environment("reach", connect=simulation.connect)
    _, info = environment.reset(seed=6)
    start = single("reach").reset(seed=6)[1]["achieved_goal"]
    assert np.abs(info["achieved_goal"] - start).max() < 0.03
    for _ in range(100):
        _, _, terminated, truncated, _ = environment.step(np.zeros(9, np.float32))
    assert truncated
    assert not terminated
    environment.reset()
    environment.close()


@pytest.mark.slow
@pytest.mark.without_sanitizer
def test_a_robot_in_real_time_runs_the_same_task(start_program: StartProgram):
    robot = start_program("run", "trifinger_edu", "--name", "learner", *PATIENT)
    robot.wait_for("waits for a user")
    environment = Environment(
        "reach",
        options=Options.of("reach", mapping="state_augmentation", duration=0.4),
        connect=lambda: trifinger.connect("learner"),
    )
    goals = single("reach").reset(seed=6)[1]["desired_goal"]
    for _ in range(2):
        _, info = environment.reset(seed=6)
        np.testing.assert_array_equal(info["desired_goal"], goals)
        begin = environment.process.time_index
        for count in range(1, 21):
            _, _, terminated, truncated, info = environment.step(np.zeros(9, np.float32))
            assert (terminated, truncated) == (False, count == 20)
        # Actions that came too late were repeated, none was dropped.
        assert environment.process.time_index >= begin + 400
        assert info["fault"] == 0
    environment.close()


class Thinker:
    """A program that thinks, beside a robot in real time that bears 1000 late actions in a row."""

    def __init__(self, start_program: StartProgram, **arguments: Any) -> None:
        words = ["--name", "learner", *PATIENT, "--set", "backend.late_action.max_repeats=1000"]
        start_program("run", "trifinger_edu", *words).wait_for("waits for a user")
        self.environment = Environment(
            "reach", duration=0.4, connect=lambda: trifinger.connect("learner"), **arguments
        )

    def think(self) -> None:
        """Returns after 2500 steps, unless the robot stops."""
        robot = self.environment.process.robot
        robot.wait_until_time_index(robot.current_time_index() + 2500)

    def act(self) -> tuple[bool, dict[str, Any]]:
        """Acts with all torques at a third; returns whether the episode has ended, and info."""
        *_, terminated, truncated, info = self.environment.step(np.full(9, 0.3, np.float32))
        return terminated or truncated, info


@pytest.mark.without_sanitizer  # it needs the program
@pytest.mark.parametrize("mapping", ["approximation", "state_augmentation"])
@pytest.mark.parametrize("on_late", ["hold", "repeat", "end"])
def test_a_program_that_thinks_does_not_stop_its_robot(start_program, mapping, on_late):
    thinker = Thinker(start_program, mapping=mapping, on_late=on_late)
    environment = thinker.environment
    environment.reset(seed=1)
    robot = environment.process.robot
    thinker.think()  # before the first action the robot is held, and nothing is late
    assert np.abs(robot.latest_observation().velocity).max() < 0.05
    has_ended, info = thinker.act()
    assert (has_ended, info["late_steps"], info["fault"]) == (False, 0, 0)
    last = environment.process.robot.get_desired_action(environment.process.time_index)
    thinker.think()
    now = robot.current_time_index()
    late = robot.get_desired_action(now - 1)
    if on_late == "repeat":
        np.testing.assert_array_equal(late.torque, last.torque)
    else:
        assert not late.torque.any()
        assert np.isfinite(late.position).all()
    has_ended, info = thinker.act()
    assert has_ended == (on_late == "end")
    assert info["late_steps"] >= 2400
    assert info["fault"] == 0
    environment.reset()
    assert thinker.act()[1]["fault"] == 0
    environment.close()


@pytest.mark.without_sanitizer  # it needs the program
@pytest.mark.parametrize("recovers", [False, True])
def test_a_robot_that_has_stopped_goes_on_if_that_is_allowed(start_program, recovers):
    thinker = Thinker(start_program, recovers=recovers)
    thinker.environment.reset(seed=1)
    thinker.act()
    thinker.environment.process.robot.set_on_late("nothing")
    with pytest.raises(trifinger.RobotStopped, match="was not there in time"):
        thinker.think()
    has_ended, info = thinker.act()
    assert has_ended
    assert "was not there in time" in info["fault_text"]
    if recovers:
        thinker.environment.reset()
        assert thinker.act()[1]["fault"] == 0
    else:
        with pytest.raises(trifinger.RobotStopped):
            thinker.environment.reset()
    thinker.environment.close()


@pytest.mark.without_sanitizer  # it needs the program
def test_a_fault_that_comes_while_the_program_thinks_is_told(start_program):
    thinker = Thinker(start_program, on_late="end", recovers=True)
    thinker.environment.reset(seed=1)
    thinker.act()
    thinker.think()
    thinker.environment.process.robot.set_on_late("nothing")
    with pytest.raises(trifinger.RobotStopped):
        thinker.think()
    has_ended, info = thinker.act()
    assert has_ended
    assert "was not there in time" in info["fault_text"]
    thinker.environment.close()


def test_what_a_connected_robot_does_late_is_a_choice():
    with pytest.raises(trifinger.InvalidArgument, match="on_late is 'wait'"):
        Environment("reach", connect=lambda: trifinger.connect("sim"), on_late="wait")
    with pytest.raises(trifinger.InvalidArgument, match="left out without connect"):
        Environment("reach", on_late="end")
    with pytest.raises(trifinger.InvalidArgument, match="left out without connect"):
        Environment("reach", recovers=True)


def sleeps(thread: threading.Thread) -> bool:
    """Whether a thread waits in the kernel. It is not for Python's lock: a read gives that away."""
    stat = Path(f"/proc/self/task/{thread.native_id}/stat").read_text()
    return stat.rpartition(")")[2].split()[0] == "S"


@pytest.mark.slow
@pytest.mark.without_sanitizer  # it needs the program
def test_closing_it_ends_the_step_of_another_thread(start_program: StartProgram):
    robot = start_program("run", "trifinger_edu", "--name", "learner", *PATIENT)
    robot.wait_for("waits for a user")
    environment = Environment("reach", connect=lambda: trifinger.connect("learner"))
    said = []

    def step():
        try:
            environment.step(np.zeros(9, np.float32))
        except trifinger.Error as error:
            said.append(str(error))

    for seed in range(3):
        environment.reset(seed=seed)
        # The step of a stopped robot does not end by itself.
        robot.process.send_signal(signal.SIGSTOP)
        os.waitpid(robot.process.pid, os.WUNTRACED)
        thread = threading.Thread(target=step)
        thread.start()
        while not sleeps(thread):
            os.sched_yield()
        environment.close()
        thread.join()
        robot.process.send_signal(signal.SIGCONT)
    assert said == ["this handle was closed while a thread waited with it"] * 3


@pytest.mark.slow
@pytest.mark.without_sanitizer  # Stable-Baselines3 takes too long under sanitizers
def test_hindsight_experience_replay_takes_the_variant_with_goals(tmp_path, monkeypatch):
    monkeypatch.setenv("SB3_LOGDIR", str(tmp_path))
    environment = gymnasium.make("TriFinger/Reach-v0", observation="goal", duration=0.4)
    model = stable_baselines3.DDPG(
        "MultiInputPolicy",
        environment,
        replay_buffer_class=stable_baselines3.HerReplayBuffer,
        learning_starts=60,
        batch_size=16,
        policy_kwargs={"net_arch": [16]},
    )
    model.learn(120)
    batch = model.replay_buffer.sample(200)
    achieved = batch.next_observations["achieved_goal"].numpy().reshape(-1, 3, 3)
    desired = batch.next_observations["desired_goal"].numpy().reshape(-1, 3, 3)
    distance = np.linalg.norm(achieved - desired, axis=2).mean(axis=1)
    np.testing.assert_allclose(batch.rewards.numpy()[:, 0], -distance, atol=1e-6)
    assert (distance < 1e-6).any()  # the goals that hindsight has chosen


def test_what_is_hidden_is_what_a_simulation_knows():
    varied = {"object_mass": (0.5, 2.0), "pair_friction": {"tip_object": (0.5, 0.9)}}
    noisy = {"object_position_noise": 0.01, "object_speed": (0.1, 0.2)}
    many = VectorEnvironment(
        "push", 3, duration=0.2, autoreset_mode=AutoresetMode.SAME_STEP, **varied, **noisy
    )
    observations, _ = many.reset(seed=4)
    hidden = many.hidden
    seen = many.entries(observations)["object_position"]
    away = np.linalg.norm(hidden["true_object_position"] - seen, axis=1)
    assert (away > 1e-4).all()
    assert (away < 0.06).all()
    speed = np.linalg.norm(hidden["object_velocity"], axis=1)
    assert (speed > 0.09).all()
    assert (speed < 0.21).all()
    for name, low, high in (("object_mass", 0.5, 2.0), ("tip_object", 0.5, 0.9)):
        assert (hidden[name] >= low).all()
        assert (hidden[name] <= high).all()
        assert len(set(hidden[name].ravel())) == 3
    assert (hidden["friction"] == 1.0).all()
    assert "seed" not in hidden
    # With `symmetric_view` it is turned like what is seen: distances stay.
    other = VectorEnvironment("push", 3, symmetric_view=True, duration=0.2, **varied, **noisy)
    turned = other.entries(other.reset(seed=4)[0])["object_position"]
    assert not np.allclose(turned, seen)
    offset = np.linalg.norm(other.hidden["true_object_position"] - turned, axis=1)
    np.testing.assert_allclose(offset, away, atol=1e-6)
    while True:
        *_, ended, _ = many.step(np.zeros((3, 9), np.float32))
        if ended.all():
            break
    before, after = many.final_hidden["object_mass"], many.hidden["object_mass"]
    np.testing.assert_array_equal(before, hidden["object_mass"])
    assert (after != before).all()


def test_long_steps_of_the_physics_take_fewer_of_them_and_end_nearly_alike():
    ends = []
    for step in (0.001, 0.005):
        many = VectorEnvironment("push", 2, physics_step=step, duration=0.4)
        observations, _ = many.reset(seed=4)
        for _ in range(19):
            observations, *_, truncated, _ = many.step(np.full((2, 9), 0.1, np.float32))
        assert not truncated.any()
        assert many.step(np.zeros((2, 9), np.float32))[3].all()
        ends.append(many.entries(observations)["joint_position"])
    away = np.abs(ends[0] - ends[1]).max()
    assert 1e-7 < away < 0.03
    for wrong, said in ((0.0015, "whole part"), (0.02, "at most 0.01"), (0.003, "multiple of 3")):
        with pytest.raises(trifinger.InvalidArgument, match=said):
            VectorEnvironment("push", 1, physics_step=wrong)
    for wrong in (0, -1.0, float("nan"), "fast"):
        with pytest.raises(trifinger.InvalidArgument, match="physics_step"):
            VectorEnvironment("push", 1, physics_step=wrong)
