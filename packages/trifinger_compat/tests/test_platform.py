# SPDX-License-Identifier: BSD-3-Clause
"""The simulated platform: indices, observations, cameras, logs."""

import copy
import gc
import pickle
import weakref
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import robot_interfaces
import trifinger_simulation
from hypothesis import given, settings, strategies as st
from trifinger_object_tracking.py_lightblue_segmenter import segment_image
from trifinger_simulation import SimFinger, TriFingerPlatform, trifingerpro_limits as limits
from trifinger_simulation.camera import create_trifinger_camera_array, load_camera_parameters
from trifinger_simulation.tasks import move_cube, rearrange_dice
from trifinger_simulation.trifinger_platform import ObjectType

HOME = [0, 0.9, -1.7] * 3


def hold(platform: Any) -> Any:
    return platform.Action(position=limits.robot_position.default.copy())


def test_observation_0_is_what_was_given_even_outside_of_the_arena() -> None:
    position = np.linspace(-1.2, 1.1, 9)
    pose = SimpleNamespace(position=[0.31, -0.42, 0.123456789], orientation=[0.6, 0, 0, 0.8])
    platform = TriFingerPlatform(initial_robot_position=position, initial_object_pose=pose)
    assert np.array_equal(platform.get_robot_observation(0).position, position)
    seen = platform.get_camera_observation(0).object_pose
    assert np.array_equal(seen.position, pose.position)
    assert seen.orientation == pytest.approx(pose.orientation, abs=1e-6)
    assert seen.confidence == 1.0


def test_defaults_are_those_of_the_limits() -> None:
    platform = TriFingerPlatform()
    assert platform.get_robot_observation(0).position == pytest.approx(HOME)
    pose = platform.get_camera_observation(0).filtered_object_pose
    assert pose.position == pytest.approx([0, 0, 0.0325])
    assert list(pose.orientation) == [0, 0, 0, 1]
    assert platform.get_time_step() == 0.001


def test_indices_count_from_0_and_only_the_newest_steps_can_be_read() -> None:
    platform = TriFingerPlatform()
    with pytest.raises(ValueError, match="no action"):
        platform.get_current_timeindex()
    for get in (platform.get_desired_action, platform.get_applied_action):
        with pytest.raises(ValueError, match="before the first"):
            get(0)
    for t in range(3):
        assert platform.append_desired_action(hold(platform)) == t
        assert platform.get_current_timeindex() == t
    for get in (
        platform.get_robot_observation,
        platform.get_camera_observation,
        platform.get_timestamp_ms,
        platform.get_object_pose,
    ):
        get(2)
        get(3)
        for wrong in (-1, 1, 4):
            with pytest.raises(ValueError, match=r"\d"):
                get(wrong)
    for get in (platform.get_desired_action, platform.get_applied_action):
        get(2)
        for wrong in (-1, 1, 3):
            with pytest.raises(ValueError, match=r"\d"):
                get(wrong)
    assert platform.get_timestamp_ms(3) == pytest.approx(3.0)
    assert not hasattr(platform, "get_robot_status")
    assert not hasattr(platform, "wait_until_timeindex")


def test_before_the_first_action_there_is_step_0_alone() -> None:
    platform = TriFingerPlatform()
    platform.get_robot_observation(0)
    platform.get_camera_observation(0)
    assert platform.get_timestamp_ms(0) == 0
    for wrong in (-1, 1):
        with pytest.raises(ValueError, match=r"\d"):
            platform.get_robot_observation(wrong)


def test_an_observation_is_not_affected_by_the_action_of_its_step() -> None:
    platform = TriFingerPlatform()
    before = platform.get_robot_observation(0)
    t = platform.append_desired_action(platform.Action(torque=[0.3] * 9))
    again, after = platform.get_robot_observation(t), platform.get_robot_observation(t + 1)
    assert np.array_equal(before.position, again.position)
    assert np.array_equal(before.velocity, again.velocity)
    assert not np.array_equal(after.velocity, again.velocity)
    assert list(before.torque) == [0] * 9
    applied = platform.get_applied_action(t).torque
    assert np.array_equal(again.torque, applied)
    assert np.array_equal(after.torque, applied)


def test_observations_are_arrays_that_do_not_change_later() -> None:
    platform = TriFingerPlatform()
    t = platform.append_desired_action(hold(platform))
    observation = platform.get_robot_observation(t)
    kept = copy.deepcopy(observation)
    for name, size in (("position", 9), ("velocity", 9), ("torque", 9), ("tip_force", 3)):
        value = getattr(observation, name)
        assert value.dtype == np.float64
        assert value.shape == (size,)
    platform.append_desired_action(platform.Action(torque=[0.3] * 9))
    assert np.array_equal(observation.position, kept.position)
    assert pickle.loads(pickle.dumps(observation)).position == pytest.approx(kept.position)


def test_tips_that_touch_nothing_feel_a_twentieth() -> None:
    platform = TriFingerPlatform()
    platform.append_desired_action(hold(platform))
    assert platform.get_robot_observation(1).tip_force == pytest.approx([0.05] * 3)


def test_a_tip_that_presses_feels_more_and_never_more_than_1() -> None:
    finger = SimFinger("trifingerpro")
    down = [0, 0.9, -1.9] * 3
    forces = []
    for _ in range(500):
        t = finger.append_desired_action(finger.Action(position=down))
        forces.append(finger.get_observation(t + 1).tip_force)
    assert np.max(forces) <= 1
    reached = np.array(finger.kinematics.forward_kinematics(finger.get_observation(500).position))
    assert reached.shape == (3, 3)


def test_an_appended_action_is_copied() -> None:
    platform = TriFingerPlatform()
    action = hold(platform)
    action.torque = np.full(9, 0.1)
    t = platform.append_desired_action(action)
    action.torque[:] = 0.3
    action.position[:] = 0
    desired = platform.get_desired_action(t)
    assert type(desired) is trifinger_simulation.Action
    assert desired.torque == pytest.approx([0.1] * 9)
    assert desired.position == pytest.approx(HOME)
    assert np.isnan(desired.position_kp).all()


def test_actions_of_robot_interfaces_are_taken_and_come_back_as_such() -> None:
    platform = TriFingerPlatform()
    action = robot_interfaces.trifinger.Action(position=HOME, position_kp=[5] * 9)
    t = platform.append_desired_action(action)
    desired, applied = platform.get_desired_action(t), platform.get_applied_action(t)
    assert type(desired) is robot_interfaces.trifinger.Action
    assert np.isnan(desired.position_kp).all()
    assert applied.position_kp == pytest.approx([5] * 9)
    assert applied.position_kd == pytest.approx([0.5, 1, 0.5] * 3)


@given(
    torque=st.lists(st.floats(-2, 2), min_size=9, max_size=9),
    position=st.lists(st.floats(-3, 3) | st.just(np.nan), min_size=9, max_size=9),
    kp=st.lists(st.floats(0, 30) | st.just(np.nan), min_size=9, max_size=9),
    speed=st.lists(st.floats(-5, 5), min_size=9, max_size=9),
)
@settings(max_examples=30)
def test_the_applied_torque_follows_the_original_law(
    torque: list[float], position: list[float], kp: list[float], speed: list[float]
) -> None:
    finger = SimFinger("trifingerpro")
    q, v = np.array(HOME), np.array(speed)
    finger.reset_finger_positions_and_velocities(q, v)
    t = finger.append_desired_action(
        trifinger_simulation.Action(torque, position, kp=kp)  # lists are fine
    )
    gains = np.where(np.isnan(kp), finger.position_gains, kp)
    feedback = np.nan_to_num(gains * (np.array(position) - q) - finger.velocity_gains * v, nan=0.0)
    expected = np.clip(np.array(torque) + feedback, -0.396, 0.396)
    expected = np.clip(expected - finger.safety_kd * v, -0.396, 0.396)
    assert finger.get_applied_action(t).torque == pytest.approx(expected, abs=1e-12)


def test_wrong_numbers_of_joints_and_torques_that_are_none_are_errors() -> None:
    platform = TriFingerPlatform()
    with pytest.raises(ValueError, match="must have 9"):
        platform.append_desired_action(platform.Action(torque=[0.1] * 8))
    with pytest.raises(RuntimeError, match="diverged"):
        platform.append_desired_action(platform.Action(torque=[np.nan] * 9))


def captured(platform: TriFingerPlatform, steps: int) -> list[tuple[int, float]]:
    """The steps at which another observation of the cameras is published, and its time."""
    changes, last = [], None
    for _ in range(steps):
        t = platform.append_desired_action(hold(platform))
        seen = platform.get_camera_observation(t)
        assert seen is platform.get_camera_observation(t + 1)
        if seen is not last:
            changes.append((t, round(seen.cameras[0].timestamp, 6)))
        last = seen
    return changes


def test_images_come_ten_times_per_second_and_90_steps_late() -> None:
    platform = TriFingerPlatform()
    expected = [(0, 0.0), (90, 0.0), (190, 0.1), (290, 0.2)]
    assert captured(platform, 300) == expected


def test_without_delay_images_come_at_once() -> None:
    platform = TriFingerPlatform(camera_delay_steps=0)
    assert captured(platform, 201) == [(0, 0.0), (100, 0.1), (200, 0.2)]


def test_a_long_delay_makes_images_rarer() -> None:
    platform = TriFingerPlatform(camera_delay_steps=150)
    assert captured(platform, 310) == [(0, 0.0), (150, 0.0), (301, 0.151)]


def test_the_rate_of_images_can_change_and_follows_the_time_step() -> None:
    platform = TriFingerPlatform(time_step_s=0.004, camera_delay_steps=0)
    assert platform._compute_camera_update_step_interval() == 25
    platform.camera_rate_fps = 50
    assert captured(platform, 16) == [(0, 0.0), (5, 0.02), (10, 0.04), (15, 0.06)]


def test_without_a_cube_there_is_no_pose() -> None:
    platform = TriFingerPlatform(object_type=ObjectType.NONE)
    seen = platform.get_camera_observation(0)
    assert len(seen.cameras) == 3
    with pytest.raises(AttributeError):
        seen.object_pose  # noqa: B018
    assert not hasattr(platform, "cube")


def test_25_dice_lie_on_the_table() -> None:
    platform = TriFingerPlatform(object_type=ObjectType.DICE)
    assert len(platform.dice) == 25
    assert not hasattr(platform, "cube")
    before = np.array([die.get_state()[0] for die in platform.dice])
    for _ in range(20):
        platform.append_desired_action(hold(platform))
    after = np.array([die.get_state()[0] for die in platform.dice])
    assert np.abs(after - before).max() < 0.002


def test_dice_are_light_blue_in_images() -> None:
    rearrange_dice.seed(1)
    platform = TriFingerPlatform(object_type=ObjectType.DICE)
    empty = TriFingerPlatform(object_type=ObjectType.NONE)
    goal = [die.get_state()[0] for die in platform.dice]
    folder = trifinger_simulation.get_data_dir() / "camera_params"
    cameras = load_camera_parameters(folder, "camera{id}_cropped.yml")
    masks = rearrange_dice.generate_goal_mask(cameras, goal)
    dice, robot = (
        create_trifinger_camera_array(cameras, each.simfinger._pybullet_client_id).get_images()
        for each in (platform, empty)
    )
    for mask, seen, other in zip(masks, dice, robot, strict=True):
        # One of the fingers is blue, too.
        found, of_robot = (
            segment_image(np.ascontiguousarray(one[:, :, ::-1])) for one in (seen, other)
        )
        assert np.count_nonzero(found & ~mask & ~of_robot) < 50
        assert np.count_nonzero(found & mask) > 0.4 * np.count_nonzero(mask)


def test_images_are_kept_only_as_long_as_they_are_published(tmp_path: Path) -> None:
    class Picture(np.ndarray):  # type: ignore[type-arg]
        """An image that a weak reference can name."""

    taken: list[weakref.ref[Any]] = []

    def get_images() -> list[Any]:
        images = [np.zeros((2, 2, 3), dtype=np.uint8).view(Picture) for _ in range(3)]
        taken.extend(map(weakref.ref, images))
        return images

    platform = TriFingerPlatform(camera_delay_steps=0)
    platform.enable_cameras, platform.tricamera = True, SimpleNamespace(get_images=get_images)
    for _ in range(501):
        platform.append_desired_action(platform.Action())
    gc.collect()
    assert len(taken) == 3 * 6
    assert sum(image() is not None for image in taken) == 3
    platform.store_action_log(tmp_path / "log.p")
    actions = pickle.loads((tmp_path / "log.p").read_bytes())["actions"]
    assert len({action["object_pose"].timestamp for action in actions}) == 6


def test_platforms_are_independent_and_equal_ones_are_equal_bit_for_bit() -> None:
    first, second = TriFingerPlatform(), TriFingerPlatform()
    assert first.simfinger._pybullet_client_id != second.simfinger._pybullet_client_id
    for i in range(50):
        action = first.Action(torque=0.2 * np.sin(np.arange(9) + i))
        first.append_desired_action(action)
    for i in range(50):
        second.append_desired_action(second.Action(torque=0.2 * np.sin(np.arange(9) + i)))
    one, other = first.get_robot_observation(50), second.get_robot_observation(50)
    assert np.array_equal(one.position, other.position)
    assert np.array_equal(one.velocity, other.velocity)


def test_a_deleted_platform_gives_its_number_back() -> None:
    gc.collect()
    platform = TriFingerPlatform()
    number = platform.simfinger._pybullet_client_id
    world = weakref.ref(platform.simfinger._world)
    del platform
    assert world() is None
    assert TriFingerPlatform().simfinger._pybullet_client_id == number


def test_the_cube_can_be_moved_and_asked() -> None:
    platform = TriFingerPlatform()
    platform.cube.set_state([0.01, 0.0, 0.1], [0, 0, 1, 0])
    position, orientation = platform.cube.get_state()
    assert isinstance(position, list)
    assert position == pytest.approx([0.01, 0.0, 0.1])
    assert orientation == pytest.approx([0, 0, 1, 0])
    for _ in range(500):
        platform.append_desired_action(hold(platform))
    assert platform.cube.get_state()[0][2] == pytest.approx(0.0325, abs=0.001)
    assert platform.get_object_pose(500).position[2] == pytest.approx(0.0325, abs=0.001)


def test_an_action_log_has_all_steps_with_the_original_types(tmp_path: Path) -> None:
    pose = move_cube.Pose([0.02, 0.03, 0.0325], [0, 0, 0, 1])
    platform = TriFingerPlatform(initial_object_pose=pose)
    path = tmp_path / "log.p"
    with pytest.raises(ValueError, match="no action"):
        platform.store_action_log(path)
    observations = []
    for i in range(120):
        action = robot_interfaces.trifinger.Action(position=HOME) if i == 7 else hold(platform)
        t = platform.append_desired_action(action)
        observations.append(platform.get_robot_observation(t))
    platform.store_action_log(path)
    log = pickle.loads(path.read_bytes())
    assert sorted(log) == [
        "actions",
        "final_object_pose",
        "initial_object_pose",
        "initial_robot_position",
    ]
    assert type(log["initial_object_pose"]) is move_cube.Pose
    assert [entry["t"] for entry in log["actions"]] == list(range(120))
    for entry, observation in zip(log["actions"], observations, strict=True):
        assert np.array_equal(entry["robot_observation"].position, observation.position)
        assert np.array_equal(entry["robot_observation"].torque, observation.torque)
    assert type(log["actions"][7]["action"]) is robot_interfaces.py_trifinger_types.Action
    assert type(log["actions"][8]["action"]) is trifinger_simulation.action.Action
    shown = log["actions"][100]["object_pose"]
    assert type(shown) is trifinger_simulation.trifinger_platform.ObjectPose
    assert shown.position == pytest.approx(pose.position)
    assert log["final_object_pose"]["t"] == 119


def test_velocities_of_tips_follow_from_those_of_joints() -> None:
    platform = TriFingerPlatform()
    q, v = np.array(HOME) + 0.1, np.linspace(-1, 1, 9)
    tips, speeds = platform.forward_kinematics(q, v)
    step = 1e-6
    ahead = np.array(platform.forward_kinematics(q + step * v))
    behind = np.array(platform.forward_kinematics(q - step * v))
    assert np.array(speeds) == pytest.approx((ahead - behind) / (2 * step), abs=1e-8)
    assert isinstance(tips[0], list)


def test_the_state_of_a_finger_can_be_set_at_any_time() -> None:
    finger = SimFinger("trifingerpro")
    for _ in range(3):
        finger.append_desired_action(finger.Action())
    position, velocity = np.linspace(-0.5, 0.5, 9), np.linspace(1, 2, 9)
    observation = finger.reset_finger_positions_and_velocities(position, velocity)
    assert np.array_equal(observation.position, position)
    assert np.array_equal(observation.velocity, velocity)
    assert finger.get_current_timeindex() == 2
    assert np.array_equal(finger.get_observation(3).position, position)


@pytest.mark.parametrize(
    ("finger_type", "fingers"),
    [
        ("fingerone", 1),
        ("trifingerone", 3),
        ("fingeredu", 1),
        ("trifingeredu", 3),
        ("fingerpro", 1),
        ("trifingerpro", 3),
    ],
)
def test_all_types_of_robots_have_their_figures(finger_type: str, fingers: int) -> None:
    finger = SimFinger(finger_type)
    assert finger.number_of_fingers == fingers
    assert finger.max_motor_torque == 0.396
    is_pro = finger_type.endswith("pro")
    assert list(finger.position_gains) == ([15, 15, 9] if is_pro else [10, 10, 10]) * fingers
    assert list(finger.velocity_gains) == ([0.5, 1, 0.5] if is_pro else [0.1, 0.3, 0.001]) * fingers
    assert list(finger.safety_kd) == [0.08, 0.08, 0.04] * fingers
    t = finger.append_desired_action(finger.Action(torque=[1.0] * 3 * fingers))
    assert finger.get_observation(t).torque == pytest.approx([0.396] * 3 * fingers)
    assert finger.get_observation(t).tip_force.shape == (fingers,)


def test_gains_can_be_written() -> None:
    finger = SimFinger("trifingerpro")
    finger.position_gains[:] = 0
    finger.velocity_gains = np.zeros(9)
    t = finger.append_desired_action(finger.Action(position=[0.0] * 9))
    assert list(finger.get_applied_action(t).torque) == [0] * 9


def test_unknown_types_of_robots_are_refused() -> None:
    with pytest.raises(ValueError, match="Valid types are"):
        SimFinger("trifingerxl")


def test_a_step_can_be_done_in_two_parts() -> None:
    whole, parts = SimFinger("trifingerpro"), SimFinger("trifingerpro")
    for i in range(20):
        action = whole.Action(torque=0.1 * np.sin(np.arange(9) * i))
        whole.append_desired_action(action)
        parts._set_desired_action(action)
        parts._step_simulation()
    one, other = whole._get_latest_observation(), parts._get_latest_observation()
    assert np.array_equal(one.position, other.position)


def test_limits_are_float32_and_spaces_take_whatever_has_the_numbers() -> None:
    spaces = TriFingerPlatform.spaces
    for name in (
        "robot_torque",
        "robot_position",
        "robot_velocity",
        "object_position",
        "object_orientation",
    ):
        limit = getattr(limits, name)
        assert getattr(spaces, name) is limit
        for value in (limit.low, limit.high, limit.default):
            assert value.dtype == np.float32
        space = limit.gym
        assert space.dtype == np.float64
        for kind in (np.float32, np.float64, list):
            middle = (limit.low + limit.high) / 2
            assert space.contains(middle.tolist() if kind is list else middle.astype(kind))
        assert not space.contains(limit.high + 1)
        assert not space.contains(limit.high[:-1])
        assert space.contains(space.sample())
    assert limits.robot_torque.high == pytest.approx([0.397] * 9)
    assert limits.robot_position.low == pytest.approx([-0.33, 0, -2.7] * 3)
    assert limits.robot_position.high == pytest.approx([1, 1.57, 0] * 3)
    assert (limits.n_joints, limits.n_fingers) == (9, 3)
    assert (limits.max_torque_Nm, limits.max_velocity_radps) == (0.397, 10)
