# SPDX-License-Identifier: BSD-3-Clause
"""Goals, costs and files of the tasks; equal seeds give the goals of the original."""

import json
import pickle
from math import cos, pi, sin, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.spatial.transform import Rotation
from trifinger_simulation.camera import load_camera_parameters
from trifinger_simulation.tasks import (
    move_cube,
    move_cube_on_trajectory as trajectory_task,
    move_cuboid,
    rearrange_dice as dice,
)
from trifinger_simulation.tasks.rearrange_dice import utils

H = sqrt(0.5)


def test_figures_of_the_cube() -> None:
    assert move_cube.episode_length == move_cube.EPISODE_LENGTH == 120000
    assert move_cube._CUBE_WIDTH == 0.065
    assert move_cube._ARENA_RADIUS == 0.195
    assert move_cube._cube_3d_radius == pytest.approx(0.05629, abs=1e-5)
    assert move_cube._max_cube_com_distance_to_center == pytest.approx(0.138708, abs=1e-6)
    assert (move_cube._min_height, move_cube._max_height) == (0.0325, 0.1)
    expected = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    assert move_cube._cube_corners == pytest.approx(0.0325 * np.array(expected))
    assert list(move_cube._CUBOID_SIZE) == [0.02, 0.08, 0.02]
    assert list(move_cube._CUBOID_HALF_SIZE) == [0.01, 0.04, 0.01]


def test_the_six_orientations_turn_their_faces_up() -> None:
    ups = [r.inv().apply([0, 0, 1]) for r in move_cube._base_orientations]
    # Blue, green, cyan, yellow, red, magenta.
    expected = [[0, 0, 1], [0, 1, 0], [0, 0, -1], [0, -1, 0], [1, 0, 0], [-1, 0, 0]]
    assert np.array(ups) == pytest.approx(np.array(expected), abs=1e-12)
    assert move_cube._base_orientations[1].as_quat() == pytest.approx([H, 0, 0, H])


def drawn_position(random: Any, height: Any) -> list[float]:
    radius = (0.195 - 0.065 * sqrt(3) / 2) * sqrt(random.random())
    angle = random.uniform(0, 2 * pi)
    return [radius * cos(angle), radius * sin(angle), height()]


@pytest.mark.parametrize("kind", ["RandomState", "Generator"])
@pytest.mark.parametrize("seed", [0, 7])
def test_equal_seeds_give_the_goals_of_the_original(kind: str, seed: int) -> None:
    def make() -> Any:
        return np.random.RandomState(seed) if kind == "RandomState" else np.random.default_rng(seed)

    move_cube.random = make()
    random = make()
    if kind == "RandomState":
        move_cube.seed(seed)
    goal = move_cube.sample_goal(difficulty=-1)
    assert list(goal.position) == drawn_position(random, lambda: 0.0325)
    face = random.choice(range(6))
    yaw = random.uniform(0, 2 * pi)
    turned = Rotation.from_euler("z", yaw) * move_cube._base_orientations[face]
    assert list(goal.orientation) == list(turned.as_quat())
    for level in (1, 3):
        goal = move_cube.sample_goal(level)
        height = (lambda: 0.0325) if level == 1 else (lambda: random.uniform(0.0325, 0.1))
        assert goal.position == pytest.approx(drawn_position(random, height), abs=1e-15)
        assert goal.orientation.tolist() == [0, 0, 0, 1]
        assert goal.orientation.dtype.kind == "i"
        assert goal.position.dtype == np.float64
    goal = move_cube.sample_goal(2)
    assert list(goal.position) == [0, 0, 0.0825]
    goal = move_cube.sample_goal(4)
    lowest = 0.065 * sqrt(3) / 2
    position = drawn_position(random, lambda: random.uniform(lowest, 0.1))
    assert goal.position == pytest.approx(position, abs=1e-15)
    assert goal.orientation == pytest.approx(Rotation.random(random_state=random).as_quat())


def test_a_cuboid_begins_like_a_cube_with_any_face_up() -> None:
    for task in (move_cube, move_cuboid):
        task.random = np.random.RandomState(3)
    for _ in range(10):
        cuboid, cube = move_cuboid.sample_goal(-1), move_cube.sample_goal(-1)
        assert list(cuboid.orientation) == list(cube.orientation)
        radii = [np.hypot(*pose.position[:2]) for pose in (cuboid, cube)]
        share = move_cuboid._max_cube_com_distance_to_center
        assert radii[0] == pytest.approx(
            radii[1] * share / move_cube._max_cube_com_distance_to_center
        )


@pytest.mark.parametrize("level", [0, 5, -2])
def test_other_levels_are_errors(level: int) -> None:
    with pytest.raises(ValueError, match="difficulty"):
        move_cube.sample_goal(level)
    with pytest.raises(ValueError, match="difficulty"):
        move_cube.evaluate_state(move_cube.Pose(), move_cube.Pose(), level)


@given(seed=st.integers(0, 1000), level=st.sampled_from([-1, 1, 2, 3, 4]))
@settings(max_examples=60)
def test_sampled_goals_are_valid(seed: int, level: int) -> None:
    for task in (move_cube, move_cuboid):
        if task is move_cuboid and level == -1:
            continue  # the original lets it begin on end, partly below the table
        task.random = np.random.RandomState(seed)
        goal = task.sample_goal(level)
        task.validate_goal(goal)
        task.validate_goal(goal.to_dict())


def test_the_cost_is_that_of_the_sheet() -> None:
    goal = {"position": [0, 0, 0.05], "orientation": [0, 0, 0, 1]}
    actual = move_cube.Pose([0.06, 0.08, 0.1], [0, 0, 1, 0])
    for level in (1, 2, 3):
        assert move_cube.evaluate_state(goal, actual, level) == pytest.approx(0.378205, abs=1e-6)
    assert move_cube.evaluate_state(goal, actual, 4) == pytest.approx((0.378205 + 1) / 2, abs=1e-6)
    assert move_cube.evaluate_state(actual, actual, 4) == pytest.approx(0, abs=1e-7)


def test_the_cost_of_a_cuboid_counts_its_long_axis() -> None:
    goal = move_cuboid.Pose([0, 0, 0.05], [0, 0, 0, 1])
    same = move_cuboid.Pose([0, 0, 0.05], [0, 1, 0, 0])  # turned about the long axis
    across = move_cuboid.Pose([0, 0, 0.05], [0, 0, H, H])
    assert move_cuboid.evaluate_state(goal, same, 4) == pytest.approx(0, abs=1e-4)
    assert move_cuboid.evaluate_state(goal, across, 4) == pytest.approx(0.25)
    assert move_cuboid._min_height == 0.01
    assert move_cuboid.sample_goal(2).position[2] == pytest.approx(0.06)


@pytest.mark.parametrize(
    ("position", "orientation", "text"),
    [
        ([0.14, 0, 0.05], [0, 0, 0, 1], "arena"),
        ([0, 0, 0.03], [0, 0, 0, 1], "low"),
        ([0, 0, 0.101], [0, 0, 0, 1], "high"),
        ([0, 0, 0.0325], [0.2, 0, 0, 0.9797958971], "corner"),
    ],
)
def test_goals_out_of_reach_are_errors_that_keep_the_pose(
    position: list[float], orientation: list[float], text: str
) -> None:
    with pytest.raises(move_cube.InvalidGoalError, match=text) as caught:
        move_cube.validate_goal({"position": position, "orientation": orientation})
    assert caught.value.position == position
    assert caught.value.orientation == orientation
    copied = pickle.loads(pickle.dumps(caught.value))
    assert copied.position == position


def test_goals_of_wrong_sizes_are_other_errors() -> None:
    with pytest.raises(ValueError, match="position"):
        move_cube.validate_goal(move_cube.Pose([0, 0], [0, 0, 0, 1]))
    with pytest.raises(ValueError, match="orientation"):
        move_cube.validate_goal(move_cube.Pose([0, 0, 0.05], [0, 0, 1]))
    with pytest.raises(KeyError):
        move_cube.validate_goal({"position": [0, 0, 0.05]})


def test_poses_keep_arrays_without_a_copy_and_go_through_json() -> None:
    position = np.array([0.1, 0.2, 0.3])
    pose = move_cube.Pose(position)
    position[0] = 0.5
    assert pose.position[0] == 0.5
    assert pose.orientation.dtype == np.float32
    again = move_cube.Pose.from_json(pose.to_json())
    assert again.position == pytest.approx(pose.position)
    assert move_cube.Pose.from_dict(pose.to_dict()).position is position
    assert json.loads(move_cube.goal_to_json(pose))["orientation"] == [0, 0, 0, 1]
    assert move_cube.goal_from_json(move_cube.goal_to_json(pose)).position.tolist() == [
        0.5,
        0.2,
        0.3,
    ]


def test_corners_of_a_turned_cube() -> None:
    pose = move_cube.Pose([1, 2, 3], [0, 0, H, H])  # a quarter turn about z
    corners = move_cube.get_cube_corner_positions(pose)
    assert corners.shape == (8, 3)
    assert corners[0] == pytest.approx([1.0325, 2 - 0.0325, 3 - 0.0325])


def test_goal_files(tmp_path: Path) -> None:
    good, sampled, bad = (tmp_path / name for name in ("good.json", "sampled.json", "bad.json"))
    goal = {"position": [0, 0, 0.0825], "orientation": [0, 0, 0, 1]}
    good.write_text(json.dumps({"difficulty": 2, "goal": goal}))
    sampled.write_text(json.dumps({"difficulty": 3}))
    bad.write_text(json.dumps({"difficulty": 7}))
    move_cube.validate_goal_file(good)
    move_cube.validate_goal_file(sampled)
    for wrong in (bad, tmp_path / "none.json"):
        with pytest.raises(AssertionError):
            move_cube.validate_goal_file(wrong)
        with pytest.raises(RuntimeError, match="goal configuration"):
            move_cube.json_goal_from_config(wrong)
    assert json.loads(move_cube.json_goal_from_config(good)) == {"difficulty": 2, "goal": goal}
    assert json.loads(move_cube.json_goal_from_config(sampled))["difficulty"] == 3


def test_a_trajectory_has_ten_goals() -> None:
    trajectory_task.seed(3)
    trajectory = trajectory_task.sample_goal()
    assert [t for t, _ in trajectory] == [0, *range(30000, 120000, 10000)]
    trajectory_task.seed(3)
    again = trajectory_task.sample_goal()
    assert [list(position) for _, position in again] == [list(p) for _, p in trajectory]
    trajectory_task.validate_goal(trajectory)
    assert trajectory_task.get_active_goal(trajectory, 29999) is trajectory[0][1]
    assert trajectory_task.get_active_goal(trajectory, 30000) is trajectory[1][1]
    assert trajectory_task.get_active_goal(trajectory[1:], 5) is None
    assert trajectory_task.evaluate_state(trajectory, 0, trajectory[0][1]) == 0
    text = trajectory_task.trajectory_to_json(trajectory)
    assert json.loads(text)[1][0] == 30000
    assert trajectory_task.INITIAL_CUBE_POSITION == (0, 0, 0.0325)


def test_constants_of_the_trajectory_can_be_overwritten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trajectory_task, "EPISODE_LENGTH", 1000)
    monkeypatch.setattr(trajectory_task, "FIRST_GOAL_DURATION", 400)
    monkeypatch.setattr(trajectory_task, "GOAL_DURATION", 200)
    monkeypatch.setattr(trajectory_task, "GOAL_DIFFICULTY", 1)
    trajectory = trajectory_task.sample_goal()
    assert [t for t, _ in trajectory] == [0, 400, 600, 800]
    assert {position[2] for _, position in trajectory} == {0.0325}


@pytest.mark.parametrize(
    ("trajectory", "error"),
    [
        ([], ValueError),
        ([(1, [0, 0, 0.05])], ValueError),
        ([(0, [0, 0, 0.05]), (0, [0, 0, 0.05])], ValueError),
        ([(0, [0, 0, 0.5])], move_cube.InvalidGoalError),
    ],
)
def test_wrong_trajectories_are_errors(trajectory: Any, error: type[Exception]) -> None:
    with pytest.raises(error):
        trajectory_task.validate_goal(trajectory)


def test_there_are_205_places_for_dice() -> None:
    cells = dice._get_valid_cells()
    assert len(cells) == 205
    assert cells == sorted(cells)
    assert dice._get_cell_center_position((8, 0)) == pytest.approx([0, -0.176, 0.011])


def test_equal_seeds_give_equal_layouts() -> None:
    import random

    dice.seed(42)
    expected = random.Random(42).sample(dice._get_valid_cells(), 25)
    goal = dice.sample_goal()
    assert goal == [dice._get_cell_center_position(cell) for cell in expected]
    dice.validate_goal(goal)
    assert json.loads(dice.goal_to_json(goal))[0] == list(goal[0])


def test_wrong_layouts_are_errors() -> None:
    goal: list[Any] = list(dice.sample_goal())
    with pytest.raises(dice.InvalidGoalError):
        dice.validate_goal(goal[1:])
    with pytest.raises(dice.InvalidGoalError):
        dice.validate_goal([(0, 0), *goal[1:]])
    for wrong in ((0.18, 0.0, 0.011), (0, 0, 0.01)):
        with pytest.raises(dice.OutOfArenaError) as caught:
            dice.validate_goal([wrong, *goal[1:]])
        assert caught.value.position == wrong


def test_goal_masks_show_the_dice_and_cost_counts_pixels() -> None:
    import trifinger_simulation

    folder = trifinger_simulation.get_data_dir() / "camera_params"
    cameras = load_camera_parameters(folder, "camera{id}_cropped_and_downsampled.yml")
    assert [camera.name for camera in cameras] == ["camera60", "camera180", "camera300"]
    goal = dice.sample_goal()
    masks = dice.generate_goal_mask(cameras, goal)
    for mask in masks:
        assert mask.shape == (270, 270)
        assert mask.dtype == np.uint8
        assert set(np.unique(mask)) == {0, 255}
    assert dice.evaluate_state(masks, masks) == 0.0
    full = [np.full_like(mask, 255) for mask in masks]
    cost = dice.evaluate_state(masks, full)
    assert isinstance(cost, float)
    assert cost == sum(np.count_nonzero(mask == 0) for mask in masks)


def test_patterns_of_text_are_layouts(tmp_path: Path) -> None:
    pattern = utils.create_empty_pattern()
    rows = pattern.splitlines()
    assert len(rows) == 17
    assert sum(row.count(".") for row in rows) == 205
    rows[8] = rows[8][:3] + "X" + rows[8][4:]
    path = tmp_path / "pattern"
    path.write_text("\n".join(rows) + "\n\nwhatever\n")
    assert utils.parse_pattern_file(path) == [dice._get_cell_center_position((8, 3))]
    with path.open() as file:
        assert utils.parse_pattern_file(file) == utils.parse_pattern_file(path)
    utils.create_pattern_template_file(path)
    assert utils.parse_pattern_file(path) == []
    with pytest.raises(RuntimeError, match="row 0"):
        utils.parse_pattern(["X" + rows[0][1:], *rows[1:]])


def test_goal_files_of_the_cuboid(tmp_path: Path) -> None:
    path = tmp_path / "goal.json"
    goal = {"position": [0, 0, 0.06], "orientation": [0, 0, 0, 1]}
    path.write_text(json.dumps({"difficulty": 2, "goal": goal}))
    move_cuboid.validate_goal_file(path)
    text = move_cuboid.goal_to_json(move_cuboid.goal_from_json(json.dumps(goal)))
    assert json.loads(text) == goal
    path.write_text(json.dumps({"difficulty": 2, "goal": goal | {"position": [0, 0, 0.5]}}))
    with pytest.raises(AssertionError):
        move_cuboid.validate_goal_file(path)
