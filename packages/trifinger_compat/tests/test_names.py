# SPDX-License-Identifier: BSD-3-Clause
"""Names whose figures no other file checks: limits, constants, types, ids and private members."""

import datetime
import re
import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import pytest
import robot_fingers
import robot_interfaces
import trifinger_cameras
import trifinger_object_tracking
import trifinger_simulation
from backend import PACKAGES
from trifinger_cameras import camera as camera_types, utils as utils_of_cameras
from trifinger_object_tracking import py_lightblue_segmenter
from trifinger_simulation import (
    SimFinger,
    TriFingerPlatform,
    camera,
    trifingerpro_limits as limits,
    visual_objects,
)
from trifinger_simulation.gym_wrapper import utils
from trifinger_simulation.gym_wrapper.envs.cube_env import ActionType, CubeEnv, RandomInitializer
from trifinger_simulation.tasks import move_cube, move_cube_on_trajectory, rearrange_dice
from trifinger_simulation.trifinger_platform import ObjectType

# low, high and default of each range.
FIGURES: dict[str, tuple[list[float], list[float], list[float]]] = {
    "robot_torque": ([-0.397] * 9, [0.397] * 9, [0] * 9),
    "robot_position": ([-0.33, 0, -2.7] * 3, [1, 1.57, 0] * 3, [0, 0.9, -1.7] * 3),
    "robot_velocity": ([-10] * 9, [10] * 9, [0] * 9),
    "object_position": ([-0.3, -0.3, 0], [0.3, 0.3, 0.3], [0, 0, 0.0325]),
    "object_orientation": ([-1] * 4, [1] * 4, [0, 0, 0, 1]),
}


@pytest.mark.parametrize("name", FIGURES)
def test_ranges_have_their_figures(name: str) -> None:
    low, high, default = FIGURES[name]
    for found in (getattr(limits, name), getattr(TriFingerPlatform.spaces, name)):
        assert found.low == pytest.approx(low)
        assert found.high == pytest.approx(high)
        assert found.default == pytest.approx(default)
        assert found.gym.low == pytest.approx(low)
        assert found.gym.high == pytest.approx(high)
    assert TriFingerPlatform().spaces is TriFingerPlatform.spaces
    assert limits.n_fingers == 3


def test_the_page_uninstalls_all_packages_of_the_same_names() -> None:
    page = (PACKAGES.parents[1] / "docs" / "coming_from_the_original.md").read_text()
    command = page[page.index("pip uninstall") : page.index("#", page.index("pip uninstall"))]
    names = {path.parent.name for path in PACKAGES.glob("*/__init__.py")}
    names -= {"trifinger_compat", "pybullet"}  # PyBullet can stay
    assert names == set(command.split()[2:]) - {"\\"}


def test_the_page_and_the_benchmark_compare_with_the_same_speed() -> None:
    root = PACKAGES.parents[1]
    page = (root / "docs" / "coming_from_the_original.md").read_text()
    benchmark = (root / "benchmarks" / "python_measures.py").read_text()
    speed = re.search(r"ORIGINAL_PLATFORM = (\d+)\.0", benchmark)
    assert speed is not None
    assert f"| {int(speed[1]):,} steps/s".replace(",", " ") in page


def test_constants_of_the_tasks() -> None:
    task = move_cube_on_trajectory
    assert task.EPISODE_LENGTH == rearrange_dice.EPISODE_LENGTH == 120000
    assert (task.FIRST_GOAL_DURATION, task.GOAL_DURATION) == (30000, 10000)
    assert task.GOAL_DIFFICULTY == 3
    assert task.move_cube is move_cube
    assert (rearrange_dice.NUM_DICE, rearrange_dice.N_CELLS_PER_ROW) == (25, 17)
    assert (rearrange_dice.ARENA_RADIUS, rearrange_dice.DIE_WIDTH) == (0.19, 0.022)
    assert (rearrange_dice.TOLERANCE, rearrange_dice.TARGET_WIDTH) == (0.004, 0.026)


def test_types_of_goals_can_be_named() -> None:
    def shifted(
        goal: move_cube_on_trajectory.Trajectory, by: move_cube_on_trajectory.Position
    ) -> move_cube_on_trajectory.Trajectory:
        return [(t, np.asarray(position) + by) for t, position in goal]

    ((t, position),) = shifted([(0, (0, 0, 0.05))], (0.01, 0, 0))
    assert (t, list(position)) == (0, [0.01, 0, 0.05])
    goal: rearrange_dice.Goal = rearrange_dice.sample_goal()
    assert np.shape(goal) == (25, 3)


def test_objects_are_chosen_by_their_numbers() -> None:
    assert [each.value for each in ObjectType] == [0, 1, 2]
    platform = TriFingerPlatform(object_type=ObjectType.COLORED_CUBE)
    assert platform.object_type is ObjectType.COLORED_CUBE
    assert platform.cube.get_state() == ([0, 0, pytest.approx(0.0325)], [0, 0, 0, 1])


@pytest.mark.parametrize("action_type", [ActionType.TORQUE, ActionType.TORQUE_AND_POSITION])
def test_types_of_actions_become_actions_of_the_robot(action_type: ActionType) -> None:
    env = CubeEnv(RandomInitializer(difficulty=1), action_type)
    env.reset()
    torque = np.full(9, 0.01)
    action: Any = torque
    if action_type is ActionType.TORQUE_AND_POSITION:
        assert isinstance(env.action_space, gymnasium.spaces.Dict)
        action = {"torque": torque, "position": limits.robot_position.default}
    env.step(action)
    desired = env.platform.get_desired_action(0)
    assert desired.torque == pytest.approx(torque)
    if action_type is ActionType.TORQUE:
        assert np.isnan(desired.position).all()
    else:
        assert desired.position == pytest.approx([0, 0.9, -1.7] * 3)


def test_positions_are_actions_too() -> None:
    env = CubeEnv(RandomInitializer(difficulty=1), ActionType.POSITION)
    env.reset()
    env.step(limits.robot_position.high)
    desired = env.platform.get_desired_action(0)
    assert desired.position == pytest.approx([1, 1.57, 0] * 3)
    assert list(desired.torque) == [0] * 9


def test_an_action_has_gains_that_are_not_numbers_unless_they_are_given() -> None:
    action = trifinger_simulation.Action([0.1] * 9, [0.2] * 9)
    assert np.isnan(action.position_kp).all()
    assert np.isnan(action.position_kd).all()
    action = trifinger_simulation.Action([0.1] * 9, [0.2] * 9, kp=[3] * 9, kd=[0.4] * 9)
    assert list(action.torque) == [0.1] * 9
    assert list(action.position) == [0.2] * 9
    assert list(action.position_kp) == [3] * 9
    assert list(action.position_kd) == [0.4] * 9


def test_actions_of_platform_and_finger_have_defaults() -> None:
    platform = TriFingerPlatform(time_step_s=0.002)
    finger = platform.simfinger
    assert isinstance(finger, SimFinger)
    assert (finger.finger_type, finger.number_of_fingers) == ("trifingerpro", 3)
    assert finger.time_step_s == platform.get_time_step() == 0.002
    for action in (platform.Action(), finger.Action()):
        assert list(action.torque) == [0] * 9
        assert np.isnan(action.position).all()
    assert list(finger.Action(position=[0.5] * 9).position) == [0.5] * 9


@pytest.mark.parametrize(
    ("finger_type", "links", "tips"),
    [
        # From PyBullet, with the descriptions of the original.
        ("trifingerpro", [2, 4, 6, 9, 11, 13, 16, 18, 20], [7, 14, 21]),
        ("fingerpro", [2, 4, 6], [7]),
        ("trifingeredu", [2, 3, 4, 7, 8, 9, 12, 13, 14], [5, 10, 15]),
        ("fingeredu", [1, 2, 3], [4]),
        ("fingerone", [2, 3, 4], [5]),
    ],
)
def test_ids_of_links_are_those_of_the_original(
    finger_type: str, links: list[int], tips: list[int]
) -> None:
    finger = SimFinger(finger_type)
    assert finger.finger_id.client is finger._pybullet_client_id
    assert finger.pybullet_link_indices == finger.pybullet_joint_indices == links
    assert finger.pybullet_tip_link_indices == tips


def test_the_marker_of_a_fork_is_a_cube_marker() -> None:
    marker = visual_objects.CubeMarker2(0.065, [0, 0, 0.1], [0, 0, 0, 1])
    assert list(marker.size) == [0.065] * 3


def test_observations_of_the_cameras_can_be_replaced() -> None:
    class Cameras:
        def get_images(self) -> list[Any]:
            return [np.full((2, 2, 3), i, dtype=np.uint8) for i in range(3)]

    platform = TriFingerPlatform()
    platform.tricamera = Cameras()
    platform.enable_cameras = True
    first = platform._get_current_camera_observation(0)
    assert [each.image[0, 0, 0] for each in first.cameras] == [0, 1, 2]
    assert [each.timestamp for each in first.cameras] == [0, 0, 0]
    platform._delayed_camera_observation = first
    platform._camera_observation_t = first
    assert platform.get_camera_observation(0) is first
    # The rhythm of the images stays.
    changes, last = [], first
    for _ in range(200):
        t = platform.append_desired_action(platform.Action())
        seen = platform.get_camera_observation(t)
        if seen is not last:
            changes.append(t)
            last = seen
    assert changes == [90, 190]


def test_matrices_of_opencv_are_arrays() -> None:
    image = np.arange(6, dtype=np.uint8).reshape(2, 3)
    assert np.array_equal(np.array(camera_types.cvMat(image)), image)


def test_a_camera_sees_what_it_looks_at() -> None:
    platform = TriFingerPlatform()
    client = platform.simfinger._pybullet_client_id
    # From above, with the image's right at the world's x.
    eye = camera.Camera([0, 0, 0.25], [1, 0, 0, 0], image_size=(60, 40), pybullet_client_id=client)
    with_cube = eye.get_image().astype(int)
    assert with_cube.shape == (40, 60, 3)
    platform.cube.set_state([0.04, 0, 0.0325], [0, 0, 0, 1])
    moved = np.abs(eye.get_image() - with_cube).max(axis=2) > 20
    assert np.nonzero(moved)[1].mean() > 32


def test_cameras_of_a_folder_can_get_company() -> None:
    platform = TriFingerPlatform()
    folder = trifinger_simulation.get_data_dir() / "camera_params"
    cameras = camera.create_trifinger_camera_array_from_config(
        folder,
        "camera{id}_cropped_and_downsampled.yml",
        platform.simfinger._pybullet_client_id,
    )
    assert [(one.get_width(), one.get_height()) for one in cameras.cameras] == [(270, 270)] * 3
    cameras.cameras.append(cameras.cameras[0])
    images = cameras.get_images()
    assert len(images) == 4
    assert np.array_equal(images[0], images[3])


def test_what_cannot_be_served_says_what_to_use() -> None:
    cameras, tracked = trifinger_cameras.camera, trifinger_object_tracking.py_tricamera_types
    for refused, text in (
        (trifinger_simulation.collision_objects.import_mesh, "use a Cuboid"),
        (cameras.OpenCVDriver, "docs/cameras.md"),
        (cameras.PylonDriver, "docs/cameras.md"),
        (trifinger_cameras.tricamera.TriCameraDriver, "docs/cameras.md"),
        (tracked.TriCameraObjectTrackerDriver, "docs/cameras.md"),
        (trifinger_object_tracking.py_object_tracker.CubeDetector, "trifinger.tracking.Tracker"),
        (robot_fingers.create_one_joint_backend, "trifinger new robot"),
        (robot_fingers.create_two_joint_backend, "trifinger new robot"),
        (robot_fingers.create_solo_eight_backend, "trifinger new robot"),
    ):
        with pytest.raises(NotImplementedError, match=text):
            refused(1, 2)


@pytest.mark.parametrize(
    "call",
    [
        lambda: utils_of_cameras.convert_image(np.zeros((2, 2), np.uint8)),
        lambda: utils_of_cameras.check_image_sharpness(np.zeros((2, 2), np.uint8)),
        lambda: py_lightblue_segmenter.segment_image(np.zeros((2, 2, 3), np.uint8)),
        lambda: rearrange_dice.generate_goal_mask([SimpleNamespace(width=2, height=2)], []),
    ],
)
def test_what_needs_opencv_names_both_packages_that_have_it(
    call: Callable[[], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)  # type: ignore[arg-type]
    with pytest.raises(ModuleNotFoundError, match=r"opencv-python, or opencv-python-headless"):
        call()


def test_back_ends_refuse_configurations_of_the_original() -> None:
    data = robot_interfaces.trifinger.SingleProcessData()
    for config in (
        robot_fingers.TriFingerConfig({}),
        robot_fingers.FingerConfig({}),
        robot_fingers.OneJointConfig({}),
        robot_fingers.TwoJointConfig({}),
        robot_fingers.SoloEightConfig({}),
    ):
        for create in (
            robot_fingers.create_trifinger_backend,
            robot_fingers.create_real_finger_backend,
        ):
            with pytest.raises(NotImplementedError, match="'The real robot'"):
                create(data, config)


def test_small_helps_of_the_environments() -> None:
    assert utils.compute_distance([0, 3], [4, 0]) == 5
    utils.sleep_until(datetime.datetime.now() - datetime.timedelta(seconds=1))
    space = gymnasium.spaces.Box(np.array([0.0, -2.0]), np.array([1.0, 2.0]), dtype=np.float64)
    assert list(utils.scale([0.5, 2.0], space)) == [0, 1]
    assert list(utils.unscale([0.0, 1.0], space)) == [0.5, 2.0]
