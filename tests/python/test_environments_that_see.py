# SPDX-License-Identifier: BSD-3-Clause
"""Environments with images, and with poses that a tracker finds in them."""

import os
import subprocess
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest
import trifinger
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode
from trifinger.cameras import to_rgb
from trifinger.environments import Environment, Options, VectorEnvironment
from trifinger.errors import InvalidArgument
from trifinger.tasks import Task

CAMERAS = ("camera60", "camera180", "camera300")
# 54 x 54 pixels are drawn fast. Images are 12 steps apart and 8 steps old when they arrive. So some
# arrive at the very step of an observation, others before it.
SMALL: dict[str, Any] = {
    "observation": "images",
    "camera_size": 54,
    "camera_rate": 1000 / 12,
    "camera_delay": 0.008,
}
TRACKED: dict[str, Any] = {
    "object_poses": "tracked",
    "observation": "dictionary",
    "camera_rate": 20.0,
    "camera_delay": 0.03,
}


def environment_of(task: str, **options: Any) -> Environment:
    return Environment(task, options=Options.of(task, **options))


def actions_of(environment: Any, seed: int = 1) -> Any:
    environment.action_space.seed(seed)
    while True:
        yield environment.action_space.sample()


def last_capture(step: int, period: int, delay: int) -> int:
    """The step of the newest image that has arrived at `step`."""
    return -1 if step < delay else (step - delay) // period * period


class Look(Task):
    """A task in Python, with a cube."""

    config_overrides = {"objects": [{"name": "cube", "type": "cube"}]}  # noqa: RUF012
    object_name = "cube"
    goal_low = (-0.1, -0.1, 0.0)
    goal_high = (0.1, 0.1, 0.1)

    def achieve(self, view: Any) -> Any:
        return view.object_position


@pytest.mark.parametrize(
    "options", [SMALL, TRACKED | {"camera_size": 270}], ids=["images", "poses"]
)
def test_a_task_in_python_sees_the_same_in_one_and_in_many(options: dict[str, Any]) -> None:
    vector = VectorEnvironment(Look(), 2, duration=0.2, **options)
    single = Environment(Look(), duration=0.2, **options)
    many, _ = vector.reset(seed=4)
    one, _ = single.reset(seed=5)
    for action, _ in zip(actions_of(vector), range(9), strict=False):
        for name, part in one.items():
            np.testing.assert_array_equal(many[name][1], part)
        many, rewards, *_ = vector.step(action)
        one, reward, *_ = single.step(action[1])
        assert reward == rewards[1]
    single.close()


@pytest.mark.parametrize("task", ["reach", "push"])
def test_gymnasium_accepts_environments_with_images(task: str) -> None:
    environment = gymnasium.make(
        f"TriFinger/{task.capitalize()}-v0", duration=0.1, disable_env_checker=True, **SMALL
    )
    check_env(environment.unwrapped, skip_render_check=True)
    environment.close()


@pytest.mark.parametrize("mapping", ["approximation", "state_augmentation"])
def test_images_are_the_newest_that_have_arrived(mapping: str) -> None:
    environment = environment_of("push", mapping=mapping, duration=0.3, **SMALL)
    observation, _ = environment.reset(seed=3)
    actions = actions_of(environment)
    ages = set()
    for _ in range(15):
        now = environment.process.time_index
        age = now - last_capture(now, 12, 8)
        assert observation["image_age"].tolist() == [age] * 3
        ages.add(age)
        for name in CAMERAS:
            assert observation[name].shape == (54, 54, 3)
            assert observation[name].dtype == np.uint8
        assert environment.observation_space.contains(observation)
        observation, *_ = environment.step(next(actions))
    assert len(ages) > 2, "images come at another rate than actions"
    environment.close()


def test_images_are_those_of_the_same_scene_drawn_outside() -> None:
    # Each image is of a step at which an observation is made, and arrives at once.
    options = SMALL | {"camera_rate": 50.0, "camera_delay": 0.0}
    environment = environment_of("push", **options)
    core = trifinger._trifinger.environment_overrides("push", environment.options.to_json())
    renderer = trifinger.CameraRenderer("trifinger_edu", core, reduction=10, read_noise=0.0)
    renderer.set_options(shot_noise=0.0)
    observation, _ = environment.reset(seed=1)
    actions = actions_of(environment)
    assert environment.simulation is not None
    for _ in range(5):
        # The action of this step has acted already; it moves nothing by more than a millimetre.
        drawn = renderer.render(environment.simulation.configuration())
        assert observation["image_age"].tolist() == [0, 0, 0]
        for name, mosaic in zip(CAMERAS, drawn, strict=True):
            difference = to_rgb(mosaic, "bayer_rggb8").astype(int) - observation[name]
            assert np.abs(difference).mean() < 2.0, name
        # A cube elsewhere looks different.
        moved = environment.simulation.configuration()
        moved[9:11] += 0.02
        other = (
            to_rgb(renderer.render(moved)[0], "bayer_rggb8").astype(int) - observation["camera60"]
        )
        assert np.abs(other).mean() > 2.0
        observation, *_ = environment.step(next(actions))
    environment.close()


@pytest.mark.parametrize("options", [SMALL, TRACKED | {"camera_size": 270}])
def test_the_same_seed_and_actions_give_the_same_episode(options: dict[str, Any]) -> None:
    def episode(seed: int) -> list[Any]:
        environment = environment_of("push", **options)
        seen: list[Any] = [environment.reset(seed=seed)]
        actions = actions_of(environment)
        seen += [environment.step(next(actions)) for _ in range(4)]
        environment.close()
        return seen

    first = episode(5)
    assert data_equivalence(first, episode(5), exact=True)
    assert not data_equivalence(first, episode(6), exact=True)


def test_the_noise_of_images_is_another_in_each_episode() -> None:
    environment = environment_of("reach", **SMALL)
    images = []
    for number in range(2):
        observation, _ = environment.reset(seed=1, options={"episode": number})
        images.append(observation["camera60"].astype(int))
    # The arms begin elsewhere, but in most of the image there is the same table and wall.
    difference = np.abs(images[0] - images[1]).max(axis=2)
    of_noise = difference[difference <= 8]
    assert len(of_noise) > 0.5 * difference.size
    assert np.mean(of_noise > 0) > 0.3
    environment.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        SMALL,
        SMALL | {"camera_varies": True},
        TRACKED | {"camera_size": 270},
        TRACKED | {"camera_size": 270, "object_delay": 0.045, "mapping": "state_augmentation"},
        {"observation": "dictionary", "object_loss": 0.5, "object_delay": 0.013},
    ],
)
@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP])
def test_many_simulations_see_what_one_sees(options: dict[str, Any], mode: AutoresetMode) -> None:
    wanted = Options.of("push", duration=0.1, **options)
    vector = VectorEnvironment("push", 3, options=wanted, num_threads=2, autoreset_mode=mode)
    singles = [Environment("push", options=wanted) for _ in range(3)]
    observations, infos = vector.reset(seed=7)
    for index, single in enumerate(singles):
        observation, info = single.reset(seed=7 + index)
        assert data_equivalence(row(observations, index), observation, exact=True)
        compare_infos(infos, info, index)
    assert vector.observation_space.contains(observations)
    actions = actions_of(vector)
    has_ended = [False] * 3
    for _ in range(8):
        rows = next(actions)
        observations, rewards, terminated, truncated, infos = vector.step(rows)
        for index, single in enumerate(singles):
            if has_ended[index]:
                observation, info = single.reset()
                has_ended[index] = False
            else:
                observation, reward, ends, stops, info = single.step(rows[index])
                assert reward == rewards[index]
                assert (ends, stops) == (terminated[index], truncated[index])
                has_ended[index] = ends or stops
                if has_ended[index] and mode == AutoresetMode.SAME_STEP:
                    final = infos["final_obs"][index]
                    assert data_equivalence(final, observation, exact=True)
                    compare_infos(infos["final_info"], info, index)
                    observation, info = single.reset()
                    has_ended[index] = False
            assert data_equivalence(row(observations, index), observation, exact=True)
            compare_infos(infos, info, index)
    for single in singles:
        single.close()


def row(observations: dict[str, Any], index: int) -> dict[str, Any]:
    return {name: part[index] for name, part in observations.items()}


def compare_infos(infos: dict[str, Any], info: dict[str, Any], index: int) -> None:
    for name in {"object_age", "object_is_sure", "distance"} & info.keys():
        assert infos[name][index] == info[name], name


def test_light_and_colours_differ_in_each_episode_if_they_shall() -> None:
    def brightness(**options: Any) -> list[float]:
        environment = environment_of("reach", **SMALL, **options)
        means = []
        for number in range(4):
            observation, _ = environment.reset(seed=1, options={"episode": number})
            means.append(float(observation["camera60"].mean()))
        environment.close()
        return means

    assert np.ptp(brightness()) < 5
    assert np.ptp(brightness(camera_varies=True)) > 10


@pytest.mark.parametrize("size", [270, 540])
def test_tracked_poses_are_within_3_mm_of_the_truth_or_said_to_be_unsure(size: int) -> None:
    environment = environment_of("push", **TRACKED | {"camera_size": size}, duration=1.0)
    simulation = environment.simulation
    assert simulation is not None
    distances = []
    for seed in range(4):
        observation, info = environment.reset(seed=seed)
        # Nobody touches the cube, so the truth is that of the beginning.
        truth, _ = simulation.object_pose("cube")
        for _ in range(6):
            if info["object_is_sure"]:
                distances.append(float(np.linalg.norm(observation["object_position"] - truth)))
            observation, *_, info = environment.step(environment_hold(environment))
    environment.close()
    assert len(distances) > 12
    assert max(distances) < 3e-3


def environment_hold(environment: Environment) -> Any:
    """The action that moves nothing: no change of position."""
    return np.zeros(environment.action_space.shape, np.float32)


def test_tracked_poses_have_the_age_of_rate_and_delay() -> None:
    environment = environment_of("push", **TRACKED | {"object_delay": 0.04, "camera_size": 270})
    _, info = environment.reset(seed=2)
    for _ in range(8):
        now = environment.process.time_index
        assert info["object_is_sure"]
        assert info["object_age"] == now - last_capture(now, 50, 40)
        _, *_, info = environment.step(environment_hold(environment))
    environment.close()


def test_a_cube_that_nobody_sees_is_not_said_to_be_seen() -> None:
    environment = environment_of("push", **TRACKED | {"camera_size": 270})
    observation, info = environment.reset(seed=2)
    assert info["object_is_sure"]
    simulation = environment.simulation
    assert simulation is not None
    # Above the cameras' views, where it falls for half a second.
    before = observation["object_position"]
    ages = []
    for _ in range(5):
        simulation.place_object("cube", (0.0, 0.0, 0.6))
        observation, *_, info = environment.step(environment_hold(environment))
        ages.append(info["object_age"])
    assert not info["object_is_sure"]
    assert ages[-1] > 60
    np.testing.assert_allclose(observation["object_position"], before, atol=3e-3)
    # The true pose decides about the reward.
    assert info["achieved_goal"][2] > 0.3
    environment.close()


class NoImages:
    def __init__(self, _robot: Any) -> None:
        pass

    def get_latest_at(self, _step: int) -> None:
        return None


def test_a_camera_that_never_delivered_has_the_oldest_image(monkeypatch: Any) -> None:
    monkeypatch.setattr("trifinger.environments.single.Cameras", NoImages)
    environment = environment_of("push", **SMALL)
    observation, _ = environment.reset(seed=1)
    assert observation["image_age"].tolist() == [10_000] * 3
    assert environment.observation_space.contains(observation)
    assert not observation["camera60"].any()
    environment.close()


def test_without_copies_images_and_ages_are_the_memory_that_is_written() -> None:
    vector = VectorEnvironment("push", 2, options=Options.of("push", **SMALL), copy=False)
    first, _ = vector.reset(seed=1)
    second, *_ = vector.step(next(actions_of(vector)))
    for name in ("image_age", *CAMERAS):
        assert np.shares_memory(first[name], second[name]), name


@pytest.mark.parametrize(
    ("options", "overrides", "age"),
    [
        ({}, {"simulation.object_period": 0.05, "simulation.object_delay": 0.003}, 52),
        (TRACKED, {"cameras.rate": 10.0}, 129),
    ],
)
def test_how_old_a_pose_may_be_follows_from_the_robots_configuration(
    options: dict[str, Any], overrides: dict[str, Any], age: int
) -> None:
    wanted = Options.of("push", **{**options, **({"camera_size": 270} if options else {})})
    environment = Environment("push", options=wanted, config_overrides=overrides)
    vector = VectorEnvironment("push", 1, options=wanted, config_overrides=overrides)
    for one in (environment, vector):
        _, info = one.reset(seed=2)
        oldest = 0
        for _ in range(15):
            assert np.all(info["object_is_sure"])
            oldest = max(oldest, int(np.max(info["object_age"])))
            _, *_, info = one.step(np.zeros(one.action_space.shape, np.float32))
        assert age - 20 < oldest <= age
        assert one._core.oldest_sure_age == age
        one.close()


def test_a_connected_robot_says_how_old_its_poses_may_be() -> None:
    overrides = trifinger._trifinger.environment_overrides("push", Options.of("push").to_json())
    overrides["simulation.object_period"] = 0.05
    simulation = trifinger.Simulation("trifinger_edu", overrides)
    environment = Environment("push", connect=simulation.connect)
    _, info = environment.reset(seed=2)
    for _ in range(15):
        assert info["object_is_sure"]
        _, *_, info = environment.step(environment_hold(environment))
    # One more period: poses of another process may be late.
    assert environment._core.oldest_sure_age == 99
    environment.close()


def test_lost_poses_are_told() -> None:
    environment = environment_of("push", object_loss=0.5, object_period=0.02)
    _, info = environment.reset(seed=1)
    sure = []
    for _ in range(100):
        _, *_, info = environment.step(environment_hold(environment))
        assert info["object_is_sure"] == (info["object_age"] <= 19)
        sure.append(bool(info["object_is_sure"]))
    assert 30 < sum(sure) < 70
    environment.close()


@pytest.mark.parametrize(
    ("task", "options", "message"),
    [
        ("reach", {"object_poses": "tracked"}, "the task 'reach' has no object"),
        ("throw", {"object_poses": "tracked"}, "ball"),
        ("push", {**SMALL, "object_poses": "tracked"}, "no part of the observation 'images'"),
        ("push", {**TRACKED, "object_position_noise": 1e-3}, "the noise of their images"),
        ("push", {**SMALL, "camera_size": 541}, "cameras.size is 541"),
        ("push", {**SMALL, "camera_rate": 0.0}, "rate is 0 Hz"),
    ],
)
def test_options_that_make_no_sense_are_refused(
    task: str, options: dict[str, Any], message: str
) -> None:
    for make in (environment_of, vector_of):
        with pytest.raises((InvalidArgument, trifinger.Error), match=message):
            make(task, **options)


def test_without_opengl_an_error_says_how_to_get_it() -> None:
    program = """
import trifinger
from trifinger.environments import Environment, Options, VectorEnvironment
options = Options.of("push", observation="images", camera_size=54)
for make in Environment, lambda task, options: VectorEnvironment(task, 2, options=options):
    try:
        make("push", options=options)
    except trifinger.Error as error:
        print(error)
"""
    nobody = {**os.environ, "__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent"}
    done = subprocess.run(
        [sys.executable, "-c", program], env=nobody, capture_output=True, text=True, check=True
    )
    assert done.stdout.count("apt-get install libegl1") == 2, done.stdout + done.stderr


def vector_of(task: str, **options: Any) -> VectorEnvironment:
    return VectorEnvironment(task, 2, options=Options.of(task, **options))
