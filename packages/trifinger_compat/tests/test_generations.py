# SPDX-License-Identifier: BSD-3-Clause
"""Environments of the old Gym, cameras, evaluation of policies, and the names of 2020."""

import json
import pickle
import random
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import rrc_simulation
import trifinger_cameras
import trifinger_simulation
from backend import environment
from foreign_writers import WRITERS
from trifinger_cameras import utils
from trifinger_cameras.camera_calibration_file import CameraCalibrationFile
from trifinger_compat import evaluation, generation
from trifinger_object_tracking import py_lightblue_segmenter, py_object_tracker
from trifinger_object_tracking.py_tricamera_types import CubeVisualizer
from trifinger_simulation import camera, collision_objects, sample, visual_objects
from trifinger_simulation.gym_wrapper import (
    data_logger,
    finger_spaces,
    utils as utils_of_environments,
)
from trifinger_simulation.gym_wrapper.envs import cube_env, cube_trajectory_env
from trifinger_simulation.gym_wrapper.envs.trifinger_reach import TriFingerReach
from trifinger_simulation.tasks import move_cube, move_cube_on_trajectory
from trifinger_simulation.tasks.move_cube import __main__ as move_cube_program

HOME = [0, 0.9, -1.7] * 3


@pytest.mark.parametrize("action_type", cube_env.ActionType)
def test_the_environment_of_the_cube(action_type: Any) -> None:
    env = cube_env.CubeEnv(cube_env.RandomInitializer(4), action_type, frameskip=3)
    with pytest.raises(RuntimeError, match="reset"):
        env.step(env.action_space.sample())
    env.seed(5)
    observation = env.reset()
    assert sorted(observation) == ["achieved_goal", "desired_goal", "observation"]
    for _ in range(5):
        observation, reward, is_done, info = env.step(env.action_space.sample())
        assert reward < 0
        assert not is_done
        assert info == {"difficulty": 4}
    assert env.step_count == 15
    assert observation["observation"]["position"].shape == (9,)
    now = env.platform.get_robot_observation(15)
    assert np.array_equal(now.position, observation["observation"]["position"])
    with pytest.raises(ValueError, match="action space"):
        env.step(np.full(9, 99.0))


def test_equal_seeds_give_equal_episodes() -> None:
    env = cube_env.CubeEnv(cube_env.RandomInitializer(3))
    goals = []
    for _ in range(2):
        env.seed(11)
        env.reset()
        goals.append(env.goal["position"])
    assert np.array_equal(*goals)


def test_an_environment_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(move_cube, "episode_length", 4)
    pose = move_cube.Pose([0, 0, 0.0325], [0, 0, 0, 1])
    with pytest.raises(move_cube.InvalidGoalError):
        cube_env.FixedInitializer(1, pose, move_cube.Pose([1, 0, 0.05], [0, 0, 0, 1]))
    env = cube_env.CubeEnv(cube_env.FixedInitializer(1, pose, pose), frameskip=2)
    env.reset()
    assert env.step(np.array(HOME))[2] is False
    assert env.step(np.array(HOME))[2] is True
    with pytest.raises(RuntimeError, match="over"):
        env.step(np.array(HOME))


def test_the_environment_of_trajectories() -> None:
    env = cube_trajectory_env.CubeTrajectoryEnv(
        cube_trajectory_env.RandomInitializer(), cube_trajectory_env.ActionType.POSITION, 2
    )
    observation = env.reset()
    assert observation["achieved_goal"] == pytest.approx([0, 0, 0.0325])
    observation, reward, is_done, info = env.step(np.array(HOME))
    assert reward <= 0
    assert not is_done
    assert info["time_index"] == 2
    assert sorted(observation) == ["achieved_goal", "desired_goal", "observation"]
    assert observation["observation"]["velocity"].shape == (9,)
    assert env.observation_space["desired_goal"].shape == (3,)
    goal = move_cube_on_trajectory.get_active_goal(info["trajectory"], 2)
    assert np.array_equal(observation["desired_goal"], goal)


@pytest.mark.parametrize("name", ["reach-v0", "push-v0"])
def test_environments_are_registered(name: str) -> None:
    env: Any = gymnasium.make(f"trifinger_simulation.gym_wrapper:{name}").unwrapped
    observation = env.reset()
    assert observation.shape == env.observation_space.shape == (36 if name == "reach-v0" else 33,)
    before = env.finger._get_latest_observation()
    observation, reward, is_done, info = env.step(np.zeros(9))
    # The observation is that before the action.
    scaled = env.unscaled_observation_space
    whole = utils_of_environments.unscale(observation, scaled)
    index = env.spaces.key_to_index
    assert whole[index["joint_positions"]] == pytest.approx(before.position)
    wanted = utils_of_environments.unscale(np.zeros(9), env.unscaled_action_space)
    assert whole[index["action_joint_positions"]] == pytest.approx(wanted)
    assert whole[index["goal_position"]] == pytest.approx(np.ravel(env.goal))
    if name == "reach-v0":
        tips = env.finger.kinematics.forward_kinematics(before.position)
        expected = -20 * np.linalg.norm(np.subtract(tips, env.goal))
    else:
        expected = -np.linalg.norm(whole[index["object_position"]] - env.goal)
    assert reward == pytest.approx(expected)
    assert not is_done
    assert info == {"is_success": 0}


@pytest.mark.parametrize("module", ["rrc_simulation", "trifinger_simulation"])
def test_each_generation_makes_its_own_environment(module: str) -> None:
    program = f"""
import gymnasium, trifinger_simulation.gym_wrapper
import {module}.gym_wrapper.envs.cube_env
print(gymnasium.spec("real_robot_challenge_phase_1-v1").entry_point)
"""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        env=environment(),
        capture_output=True,
        text=True,
        check=True,
    )
    place = "gym_wrapper.envs.cube_env:RealRobotChallengePhase1"
    assert done.stdout.strip() == f"{module}.{place}"


def test_actions_of_reaching_are_smoothed_more_and_more() -> None:
    parameters = {"num_episodes": 10, "start_after": 0.2, "stop_after": 0.6, "final_alpha": 0.8}
    env = TriFingerReach(0.001, "fingerone", smoothing_params=parameters)
    alphas = []
    for _ in range(8):
        env.reset()
        alphas.append(round(env.smoothing_alpha, 3))
    assert alphas == [0, 0, 0.2, 0.4, 0.6, 0.8, 0.8, 0.8]
    env.step(np.ones(3))
    env.step(-np.ones(3))
    low, high = env.unscaled_action_space.low, env.unscaled_action_space.high
    assert env.smoothed_action == pytest.approx(0.8 * high + 0.2 * low)


def test_spaces_of_fingers_have_the_bounds_of_the_original() -> None:
    keys = ("joint_positions", "object_position")
    spaces = finger_spaces.FingerSpaces(3, keys, (9, 3), separate_goals=False)
    assert spaces.key_to_index == {"joint_positions": slice(0, 9), "object_position": slice(9, 12)}
    whole = spaces.get_unscaled_observation_space()
    assert whole.low == pytest.approx([*np.radians([-90, -90, -172] * 3), -0.5, -0.5, 0])
    assert whole.high == pytest.approx([*np.radians([90, 100, -2] * 3), 0.5, 0.5, 0.5])
    assert spaces.get_unscaled_action_space().high == pytest.approx(np.radians([70, 0, -2] * 3))
    for scaled in (spaces.get_scaled_observation_space(), spaces.get_scaled_action_space()):
        assert set(scaled.low) | set(scaled.high) == {-1, 1}
    assert spaces.lower_bounds["goal_position"] == pytest.approx([-0.5] * 3)
    with pytest.raises(ValueError, match="zip"):
        finger_spaces.FingerSpaces(3, keys, (9,), separate_goals=False)


def test_whole_episodes_are_logged(tmp_path: Path) -> None:
    logger = data_logger.DataLogger()
    with pytest.raises(RuntimeError, match="new_episode"):
        logger.append(0, 0, 0)
    logger.new_episode([1.0], [2.0])
    logger.append([3.0], [4.0], 5.0)
    logger.store(tmp_path / "log.p")
    assert pickle.loads((tmp_path / "log.p").read_bytes()) == []
    logger.new_episode([0.0], [0.0])
    logger.store(tmp_path / "log.p")
    assert pickle.loads((tmp_path / "log.p").read_bytes()) == [
        {
            "joint_goal": [1.0],
            "tip_goal": [2.0],
            "joint_positions": [[3.0]],
            "tip_positions": [[4.0]],
            "timestamps": [5.0],
        }
    ]


def test_settings_of_cameras_are_in_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TRIFINGER_CAMERA_CONFIG", raising=False)
    settings = trifinger_cameras.camera.Settings()
    assert settings.get_tricamera_driver_settings().frame_rate_fps == 10
    path = tmp_path / "cameras.toml"
    monkeypatch.setenv("TRIFINGER_CAMERA_CONFIG", str(path))
    path.write_text("[tricamera_driver]\nframe_rate_fps = 15.0\n[pylon_driver]\ngain = 2\n")
    settings = trifinger_cameras.camera.Settings()
    assert settings.get_tricamera_driver_settings().frame_rate_fps == 15
    assert settings.get_pylon_driver_settings().values == {"gain": 2}
    path.write_text("[")
    with pytest.raises(RuntimeError, match="cannot read the settings"):
        trifinger_cameras.camera.Settings()


def test_the_simulation_of_2020_has_its_figures() -> None:
    platform = rrc_simulation.TriFingerPlatform()
    assert platform.get_time_step() == 0.004
    finger = platform.simfinger
    assert finger.max_motor_torque == 0.36
    assert list(finger.position_gains[:3]) == [10, 10, 10]
    assert platform.get_robot_observation(0).position[:3] == pytest.approx(
        np.radians([0, 70, -130])
    )
    for i in range(5):
        t = platform.append_desired_action(platform.Action(torque=[1.0] * 9))
        assert t == i
        if i == 0:  # later the damping takes from it
            assert platform.get_applied_action(0).torque == pytest.approx([0.36] * 9)
        assert platform.get_object_pose(t).timestamp == pytest.approx(0.004 * t)
        assert platform.get_object_pose(t + 1).position.shape == (3,)
    assert platform.get_timestamp_ms(5) == pytest.approx(20)
    task = rrc_simulation.tasks.move_cube
    assert task.episode_length == 3750
    task.random = np.random.RandomState(2)
    orientation = task.sample_goal(-1).orientation
    assert list(orientation[:2]) == [0, 0]  # only a yaw
    limits = rrc_simulation.trifingerpro_limits
    assert limits.robot_position.low[:3] == pytest.approx([-0.9, -1.57, -2.7])
    assert platform.spaces.robot_torque.gym.dtype == np.float32


def test_the_environment_of_2020() -> None:
    from rrc_simulation.gym_wrapper.envs.cube_env import ActionType, CubeEnv, RandomInitializer

    env = CubeEnv(RandomInitializer(difficulty=1), ActionType.TORQUE, frameskip=10)
    env.reset()
    observation, _, _, _ = env.step(np.zeros(9))
    now = env.platform.get_object_pose(10).position
    assert np.array_equal(observation["achieved_goal"]["position"], now)


@pytest.mark.parametrize(("name", "step"), [("2020", 0.004), ("2021", 0.001)])
def test_the_environment_names_a_generation(name: str, step: float) -> None:
    text = (
        "import trifinger_simulation as ts; p = ts.TriFingerPlatform(); "
        "print(p.get_time_step(), p._camera_delay_steps, p.simfinger.position_gains[0]); "
        "mc = ts.tasks.move_cube; mc.seed(1); goals = [mc.sample_goal(-1) for _ in range(9)]; "
        "print(all(list(g.orientation[:2]) == [0, 0] for g in goals))"
    )
    said = subprocess.run(
        [sys.executable, "-c", text],
        env=environment(**{generation.VARIABLE: name}),
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert said.split()[:2] == [str(step), "0"]
    assert said.split()[-1] == str(name == "2020")  # whether an episode begins with a yaw alone


def test_an_unknown_generation_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(generation.VARIABLE, "1999")
    with pytest.raises(ValueError, match="must be one of"):
        generation.chosen()


def test_objects_come_and_go_while_a_finger_moves() -> None:
    finger = trifinger_simulation.SimFinger("trifingerpro")
    t = finger.append_desired_action(finger.Action(torque=[0.1] * 9))
    before = finger.get_observation(t + 1)
    block = collision_objects.Block(
        position=[0, 0, 0.2], pybullet_client_id=finger._pybullet_client_id
    )
    after = finger.get_observation(t + 1)
    assert np.array_equal(before.position, after.position)
    assert np.array_equal(before.velocity, after.velocity)
    assert np.array_equal(finger.get_observation(t).torque, before.torque)
    assert block.get_state() == ([0, 0, 0.2], [0, 0, 0, 1])
    fixed = collision_objects.Cuboid(
        [0, 0, 0.4], [0, 0, 0, 1], [0.02, 0.02, 0.02], 0, None, finger._pybullet_client_id
    )
    for _ in range(100):
        finger.append_desired_action(finger.Action(position=HOME))
    assert block.get_state()[0][2] < 0.19
    assert fixed.get_state()[0] == pytest.approx([0, 0, 0.4])
    del block
    finger.append_desired_action(finger.Action(position=HOME))
    assert len(finger._world.items) == 1
    with pytest.raises(ValueError, match="client id"):
        collision_objects.Block(pybullet_client_id=12345)


def test_markers_take_all_spellings() -> None:
    position, orientation = [0, 0, 0.1], [0, 0, 0, 1]
    for marker in (
        visual_objects.CubeMarker(0.065, position, orientation, physicsClientId=0),
        visual_objects.CubeMarker(width=0.065, position=position, orientation=orientation),
        visual_objects.CuboidMarker(
            (0.02, 0.08, 0.02), position, orientation, pybullet_client_id=3
        ),
    ):
        marker.set_state([0, 0, 0.2], orientation)
        assert marker.position[2] == 0.2
    goals = visual_objects.Marker(number_of_goals=3)
    goals.set_state([[0, 0, 0.1]] * 3)
    assert len(goals.positions) == 3
    assert visual_objects.SphereMaker(0.01, position, color=(1, 0, 0, 1)).radius == 0.01


def test_random_positions_come_from_the_global_random() -> None:
    draws = []
    for _ in range(2):
        random.seed(3)
        draws.append([sample.random_joint_positions(3), sample.random_position_in_arena()])
    assert draws[0] == draws[1]
    angles, (x, y, z) = draws[0]
    assert len(angles) == 9
    assert np.hypot(x, y) <= 0.15
    assert 0.05 <= z <= 0.15
    finger = trifinger_simulation.SimFinger("trifingerone")
    bounds = {"low": np.radians([-70, -70, -160] * 3), "high": np.radians([70, 0, -2] * 3)}
    found = sample.feasible_random_joint_positions_for_reaching(finger, bounds)
    assert np.all(found >= bounds["low"])
    assert np.all(found <= bounds["high"])


def test_tips_around_a_point_are_at_0_and_minus_120_and_minus_240_degrees() -> None:
    tips = sample.get_tip_positions_around_position(3, [0.1, 0.2, 0.3])
    height = 0.05 * np.sqrt(3) / 2
    expected = [[0.15, 0.2, 0.3], [0.075, 0.2 - height, 0.3], [0.075, 0.2 + height, 0.3]]
    assert np.array(tips) == pytest.approx(np.array(expected))
    (alone,) = sample.get_tip_positions_around_position(1, [0.1, 0.2, 0.3])
    assert list(alone) == [0.1, 0.2, 0.3]


@pytest.mark.slow
def test_cameras_see_the_cube_where_their_calibration_says() -> None:
    platform = trifinger_simulation.TriFingerPlatform()
    folder = trifinger_simulation.get_data_dir() / "camera_params"
    parameters = camera.load_camera_parameters(folder, "camera{id}_cropped.yml")
    platform.tricamera = camera.create_trifinger_camera_array(
        parameters, platform.simfinger._pybullet_client_id
    )
    platform.enable_cameras = True
    seen = platform._get_current_camera_observation(0)
    for each in seen.cameras:
        assert each.image.shape == (540, 540, 3)
        assert each.image.dtype == np.uint8
    files = [folder / f"camera{i}_cropped.yml" for i in (60, 180, 300)]
    drawn = CubeVisualizer("cube_v2", files).draw_cube(
        [each.image for each in seen.cameras], seen.object_pose, opacity=1.0
    )
    # What the drawing covers is what changes when the cube goes.
    platform.cube.set_state([0, 0, 0.5], [0, 0, 0, 1])
    empty = platform.tricamera.get_images()
    for each, with_faces, without in zip(seen.cameras, drawn, empty, strict=True):
        covered = np.any(with_faces != each.image, axis=2)
        changed = np.abs(each.image.astype(int) - without).max(axis=2) > 10
        assert np.count_nonzero(covered & changed) > 0.85 * np.count_nonzero(covered)
    with pytest.raises(ValueError, match="camera60"):
        camera.create_trifinger_camera_array(parameters[::-1])


# The cameras of the original's platform: position [m] and orientation x, y, z, w.
CAMERAS = (
    ((0.2496, 0.2458, 0.4190), (0.3760, 0.8690, -0.2918, -0.1354)),
    ((0.0047, -0.2834, 0.4558), (0.9655, -0.0098, -0.0065, -0.2603)),
    ((-0.2470, 0.2513, 0.3943), (-0.3633, 0.8686, -0.3141, 0.1220)),
)


def projected_as_opengl_does(number: int, point: Any, size: int) -> Any:
    """Where the original's camera sees a point of the world [pixel].

    It calls gluLookAt with its own third axis as the point to look at, and gluPerspective with
    52 degrees.
    """
    eye, (x, y, z, w) = np.array(CAMERAS[number][0]), CAMERAS[number][1]
    x, y, z, w = np.array([x, y, z, w]) / np.linalg.norm([x, y, z, w])
    up = -np.array([2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)])
    target = np.array([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)])
    forward = (target - eye) / np.linalg.norm(target - eye)
    side = np.cross(forward, up) / np.linalg.norm(np.cross(forward, up))
    ray = np.array(point) - eye
    seen = np.array([ray @ side, ray @ np.cross(forward, side)])  # to the right and down
    on_screen = seen / (ray @ forward * np.tan(np.radians(52 / 2)))  # from -1 to 1
    # The edges of the image are at -0.5 and size - 0.5.
    return (on_screen + 1) * size / 2 - 0.5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "size"),
    [
        (lambda: trifinger_simulation.TriFingerPlatform(enable_cameras=True), 540),
        (lambda: rrc_simulation.TriFingerPlatform(enable_cameras=True), 270),
    ],
    ids=["trifinger_simulation", "rrc_simulation"],
)
def test_the_platform_has_the_picture_of_the_original(make: Any, size: int) -> None:
    platform = make()
    half, colour = 0.006, (0.9, 0.0, 0.9)
    dot = collision_objects.Cuboid(
        [0, 0, 0.1], [0, 0, 0, 1], [half] * 3, 0.1, colour, platform.simfinger._pybullet_client_id
    )
    platform.cube.set_state([0, 0, -1], [0, 0, 0, 1])
    found = []  # camera, size of the dot as if it were 1 m away, how far it is off
    for point in ([0, 0, 0.02], [0.1, 0.03, 0.02], [-0.09, -0.04, 0.02], [0.02, -0.11, 0.02]):
        dot.set_state(point, [0, 0, 0, 1])
        observation = platform._get_current_camera_observation(0)
        for number, each in enumerate(observation.cameras):
            assert each.image.shape == (size, size, 3)
            red, green, blue = np.moveaxis(each.image.astype(int), 2, 0)
            rows, columns = np.nonzero((red - green > 60) & (blue - green > 60))
            if len(rows) == 0:
                continue
            area = len(rows) * np.linalg.norm(np.subtract(point, CAMERAS[number][0])) ** 2
            expected = projected_as_opengl_does(number, point, size)
            miss = np.abs(np.mean([columns, rows], axis=1) - expected).max()
            found.append((number, area, miss))
    # Where a finger hides a part of the dot, its middle says nothing.
    largest = max(area for _, area, _ in found)
    whole = [(number, miss) for number, area, miss in found if area > 0.8 * largest]
    assert {number for number, _ in whole} == {0, 1, 2}
    assert max(miss for _, miss in whole) < 0.7


def test_simple_cameras_have_the_size_that_was_asked_for() -> None:
    platform = trifinger_simulation.TriFingerPlatform()
    cameras = camera.TriFingerCameras(
        image_size=(90, 60), pybullet_client_id=platform.simfinger._pybullet_client_id
    )
    images, mosaics = cameras.get_images(), cameras.get_bayer_images()
    assert [image.shape for image in images] == [(60, 90, 3)] * 3
    assert [image.shape for image in mosaics] == [(60, 90, 1)] * 3
    assert np.array_equal(mosaics[0][0::2, 0::2, 0], images[0][0::2, 0::2, 0])
    assert np.array_equal(mosaics[0][1::2, 1::2, 0], images[0][1::2, 1::2, 2])
    assert (cameras.cameras[0].get_width(), cameras.cameras[0].get_height()) == (90, 60)


def test_calibration_files_survive(tmp_path: Path) -> None:
    folder = trifinger_simulation.get_data_dir() / "camera_params"
    assert len(list(folder.glob("camera*.yml"))) == 9
    first = camera.load_camera_parameters(folder, "camera{id}_cropped.yml")[0]
    assert (first.width, first.height) == (540, 540)
    assert first.camera_matrix[0, 0] == pytest.approx(587.298)
    expected = [-0.701913, 0.712235, -0.004805, 0.002253]
    assert first.tf_world_to_camera[0] == pytest.approx(expected, abs=2e-5)
    path = tmp_path / "camera60.yml"
    with path.open("w") as file:
        first.dump(file)
    with path.open() as file:
        again = camera.CameraParameters.load(file)
    assert np.array_equal(again.tf_world_to_camera, first.tf_world_to_camera)
    assert CameraCalibrationFile(path)["camera_matrix"].shape == (3, 3)


@pytest.mark.parametrize("writer", WRITERS)
def test_calibration_files_are_read_from_every_writer(writer: str, tmp_path: Path) -> None:
    folder = trifinger_simulation.get_data_dir() / "camera_params"
    (first, *_) = known = camera.load_camera_parameters(folder, "camera{id}_cropped.yml")
    for each in known:
        content = {
            "camera_name": each.name,
            "image_width": each.width,
            "image_height": each.height,
            "camera_matrix": each.camera_matrix,
            "distortion_coefficients": np.array(each.distortion_coefficients).reshape(1, 5),
            "tf_world_to_camera": each.tf_world_to_camera,
        }
        (tmp_path / f"{each.name}.yml").write_text(WRITERS[writer](content))
    again, *_ = camera.load_camera_parameters(tmp_path)
    assert again[:3] == first[:3]
    for one, other in zip(again[3:], first[3:], strict=True):
        assert np.array_equal(one, other)
    lens = CameraCalibrationFile(tmp_path / "camera60.yml")["camera_matrix"]
    assert np.array_equal(lens, first.camera_matrix)


def test_raw_images_become_colours() -> None:
    colours = np.zeros((20, 20, 3), dtype=np.uint8)
    colours[:] = (200, 100, 50)
    raw = camera.rbg_to_bayer_bg(colours)
    assert utils.convert_image(raw, "rgb")[10, 10].tolist() == [200, 100, 50]
    assert utils.convert_image(raw)[10, 10].tolist() == [50, 100, 200]
    assert utils.convert_image(raw[:, :, None], format="gray").shape == (20, 20)
    with pytest.raises(ValueError, match="format"):
        utils.convert_image(raw, "hsv")


def test_dice_are_found_by_their_colour() -> None:
    image = np.full((40, 40, 3), 90, dtype=np.uint8)
    image[10:20, 10:20] = (0xCF, 0x7D, 0x0A)
    mask = py_lightblue_segmenter.segment_image(image)
    assert set(np.unique(mask)) == {0, 255}
    assert mask[15, 15] == 255
    assert np.count_nonzero(mask) == pytest.approx(100, abs=12)
    with pytest.raises(RuntimeError, match="three channels"):
        py_lightblue_segmenter.segment_image(image[:, :, 0])


def test_poses_of_a_simulated_object(tmp_path: Path) -> None:
    platform = trifinger_simulation.TriFingerPlatform()
    data = py_object_tracker.Data("object", True)
    backend = py_object_tracker.SimulationBackend(data, platform.cube)
    frontend = py_object_tracker.Frontend(py_object_tracker.Data("object", False))
    assert frontend.get_current_pose().position == pytest.approx([0, 0, 0.0325])
    frontend.wait_until_timeindex(1)
    assert frontend.get_oldest_timeindex() == 0
    assert frontend.has_observations()
    backend.stop()
    data = py_object_tracker.Data("fake", True)
    fake = py_object_tracker.FakeBackend(data)
    assert list(py_object_tracker.Frontend(data).get_pose(0).orientation) == [0, 0, 0, 1]
    fake.stop()
    fake.store_buffered_data(tmp_path / "poses.json")
    assert json.loads((tmp_path / "poses.json").read_text())[0][1:] == [0, 0, 0, 0, 0, 0, 1, 1.0]
    assert py_object_tracker.get_model_by_name("cube_v2") == "cube_v2"
    with pytest.raises(RuntimeError, match="must be one of"):
        py_object_tracker.get_model_by_name("sphere")


def test_an_object_that_has_gone_ends_the_wait_for_its_poses() -> None:
    class Gone:
        """An object that is there once."""

        looks = 0

        def get_state(self) -> tuple[list[float], list[float]]:
            self.looks += 1
            if self.looks > 1:
                raise ValueError("it fell off the table")
            return [0, 0, 1], [0, 0, 0, 1]

    data = py_object_tracker.Data("gone", True)
    backend = py_object_tracker.SimulationBackend(data, Gone())
    frontend = py_object_tracker.Frontend(data)
    assert list(frontend.get_pose(0).position) == [0, 0, 1]
    for wait in (frontend.get_pose, frontend.wait_until_timeindex, frontend.get_timestamp_ms):
        with pytest.raises(RuntimeError, match="no more poses come: it fell off the table"):
            wait(1)
    backend.stop()


@pytest.mark.slow
def test_a_policy_is_run_and_its_log_replayed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(move_cube, "episode_length", 150)
    monkeypatch.setattr(move_cube_program, "SAMPLES", 1)
    (tmp_path / "evaluate_policy.py").write_text(
        "import sys\n"
        "from trifinger_simulation import TriFingerPlatform\n"
        "from trifinger_simulation.tasks import move_cube\n"
        "level, initial, goal, log = sys.argv[1:]\n"
        "pose = move_cube.Pose.from_json(initial)\n"
        "platform = TriFingerPlatform(initial_object_pose=pose)\n"
        "for i in range(150):\n"
        "    platform.append_desired_action(platform.Action(torque=[0.01 * (i % 7)] * 9))\n"
        "platform.store_action_log(log)\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", environment()["PYTHONPATH"])
    folder = tmp_path / "out"
    assert move_cube_program.main(["evaluate_and_check", str(folder)]) == 0
    assert "Total:" in (folder / "reward.txt").read_text()
    (test, *_) = pickle.loads((folder / "test_data.p").read_bytes())
    assert test.difficulty == 1
    words = ["replay_one", "-l", test.logfile, "-d", "1"]
    words += ["-i", test.init_pose_json, "-g", test.goal_pose_json]
    assert move_cube_program.main(words) == 0
    log = evaluation.read_pickle(test.logfile)
    log["actions"][70]["robot_observation"].position[0] += 1e-3
    evaluation.write_pickle(Path(test.logfile), log)
    assert move_cube_program.main(words) == 1


class Touching:
    """Makes a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.path,)


def test_fault_83_an_untrusted_log_runs_nothing(tmp_path: Path) -> None:
    log, ran = tmp_path / "log.p", tmp_path / "ran"
    reaches = (Touching(ran), {"actions": [Touching(ran)]}, evaluation.run_policy, subprocess.run)
    for content in reaches:
        log.write_bytes(pickle.dumps(content))
        with pytest.raises(evaluation.EvaluationError, match=r"log\.p is refused: it has a "):
            evaluation.read_pickle(log)
        assert not ran.exists()
    plain = {"a": [1, 2.5, None, np.arange(3), np.float64(2)], "b": ({1, 2}, "c", b"d")}
    log.write_bytes(pickle.dumps(plain))
    assert repr(evaluation.read_pickle(log)) == repr(plain)


def test_goals_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from trifinger_simulation.tasks import __main__ as old
    from trifinger_simulation.tasks.move_cube_on_trajectory import __main__ as trajectory
    from trifinger_simulation.tasks.rearrange_dice import __main__ as dice

    config = tmp_path / "goal.json"
    config.write_text(json.dumps({"difficulty": 2}))
    for main, words in (
        (move_cube_program.main, ["sample_goal"]),
        (move_cube_program.main, ["goal_from_config", str(config)]),
        (trajectory.main, ["sample_goal"]),
        (trajectory.main, ["goal_from_config", str(config)]),
        (dice.main, ["sample_goal"]),
        (dice.main, ["goal_from_config", str(config)]),
        (old.main, ["move_cube", "sample_goal", "3"]),
    ):
        assert main(words) == 0
        json.loads(capsys.readouterr().out)
    assert old.main(["move_cube", "validate_goal_file", str(config)]) == 0
    assert dice.main(["create_pattern_template"]) == 0
    for main, words in (
        (move_cube_program.main, ["goal_from_config", str(tmp_path / "none")]),
        (move_cube_program.main, ["sample_goal", "--difficulty", "9"]),
        (old.main, ["move_cube", "validate_goal_file", str(tmp_path / "none")]),
    ):
        assert main(words) == 1
        said = capsys.readouterr()
        assert said.err
