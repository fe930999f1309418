# SPDX-License-Identifier: BSD-3-Clause
"""Calibration of cameras, against the truth of rendered and of computed images."""

import dataclasses
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import rendered_boards as boards
import trifinger
from conftest import BUILD, PROGRAM, output_of
from foreign_writers import WRITERS
from hypothesis import given, strategies as st
from link_into_venv import write_scripts
from rendered_boards import Look, TrueCamera
from trifinger import (
    CameraCalibration,
    Lens,
    foreign_yaml,
    original_cameras as original,
)
from trifinger.errors import Error, InvalidArgument
from trifinger.poses import pose as pose_of
from trifinger_camera_calibration import (
    PRESETS,
    Board,
    ImageSet,
    Options,
    Result,
    calibrate as calibrate_images,
    geometry,
)
from trifinger_camera_calibration.calibration import board_on_turntable, calibrate_views
from trifinger_camera_calibration.check import check_views
from trifinger_camera_calibration.commands import cameras as calibrate_cameras
from trifinger_camera_calibration.detection import View, find_corners, look, look_at_all
from trifinger_camera_calibration.drawing import pdf, svg
from trifinger_camera_calibration.images import Quality, natural_order, pixels_of, to_grey
from trifinger_camera_calibration.page import page

BOARD = PRESETS["a4"]
SHARP = Quality(200, 190, 0, 3)
ARENA = np.stack(
    [
        each.ravel()
        for each in np.meshgrid(
            np.linspace(-0.14, 0.14, 9), np.linspace(-0.14, 0.14, 9), np.linspace(0, 0.1, 3)
        )
    ],
    axis=1,
)


# In files of the original.
MATRICES = (
    "camera_matrix",
    "distortion_coefficients",
    "tf_world_to_camera",
    "tf_world_to_camera_std",
)


def computed_views(
    cameras: dict[str, TrueCamera],
    poses: dict[str, np.ndarray],
    board: Board = BOARD,
    noise: float = 0.05,
    scale: tuple[float, float] = (1.0, 1.0),
    seed: int = 1,
) -> list[View]:
    """What perfect detection with a little noise would find."""
    random = np.random.default_rng(seed)
    views = []
    for camera in cameras.values():
        for name, pose in poses.items():
            points = board.corners * (*scale, 1) @ pose[:3, :3].T + pose[:3, 3]
            pixels = camera.project(points)
            seen = ((pixels > 5) & (pixels < np.array(camera.size) - 6)).all(axis=1)
            pixels = pixels + random.normal(0, noise, pixels.shape)
            numbers = np.flatnonzero(seen)
            reason = "" if len(numbers) >= 8 else "shows no board"
            path = Path(camera.name, f"{name}.png")
            views.append(
                View(camera.name, name, path, camera.size, SHARP, numbers, pixels[seen], reason)
            )
    return views


def calibrated(views: list[View], board: Board = BOARD, options: Options | None = None) -> Result:
    cameras = sorted({view.camera for view in views}, key=natural_order)
    formats = dict.fromkeys(cameras, "bayer_rggb8")
    return calibrate_views(views, board, formats, options)


def assert_true(
    calibration: CameraCalibration,
    cameras: dict[str, TrueCamera],
    pixel: float = 0.3,
    position: float = 0.001,
    angle: float = 0.1,
) -> None:
    """Every point of the arena is seen where it should be, and each camera is where it is."""
    assert [camera.name for camera in calibration.cameras] == list(cameras)
    for camera in calibration.cameras:
        truth = cameras[camera.name]
        expected = truth.project(ARENA)
        visible = ((expected > 0) & (expected < np.array(truth.size) - 1)).all(axis=1)
        misses = np.linalg.norm(camera.project(ARENA) - expected, axis=1)[visible]
        assert misses.max() <= pixel, camera.name
        assert np.linalg.norm(camera.pose[:3, 3] - truth.pose[:3, 3]) <= position, camera.name
        turn = geometry.angle_between(camera.pose[:3, :3], truth.pose[:3, :3])
        assert np.degrees(turn) <= angle, camera.name


@pytest.fixture(scope="module")
def cameras() -> dict[str, TrueCamera]:
    return boards.real_cameras()


@pytest.fixture(scope="module")
def poses() -> dict[str, np.ndarray]:
    return boards.places(BOARD, free=14)


@pytest.fixture(scope="module")
def images(
    tmp_path_factory: pytest.TempPathFactory,
    cameras: dict[str, TrueCamera],
    poses: dict[str, np.ndarray],
) -> Path:
    folder = tmp_path_factory.mktemp("boards")
    boards.write_images(folder, cameras, BOARD, poses)
    return folder


@pytest.fixture(scope="module")
def result(images: Path) -> Result:
    return calibrate_images(ImageSet.of_folder(images), BOARD)


# From images.


@pytest.mark.slow
def test_rendered_boards_give_the_true_cameras(
    result: Result, cameras: dict[str, TrueCamera]
) -> None:
    assert_true(result.calibration, cameras)
    assert result.rms < 0.1
    assert result.problems == []
    assert {camera.pixels for camera in result.calibration.cameras} == {"bayer_rggb8"}
    for each in result.flatness:
        assert abs(each.height) < 0.0005


@pytest.mark.slow
def test_the_page_is_whole_and_asks_nobody(result: Result) -> None:
    text = page(result, "trifinger-pro")
    assert text.count("<figure>") == len(result.views)
    assert text.count("<svg") == 2 * len(result.adjustment.cameras) + 2
    assert not re.search(r"(src|href)=[\"'](?!data:)", text)
    assert "<script" not in text
    for camera in result.adjustment.cameras:
        assert camera in text
    for sentence in result.advice:
        assert sentence[1:] in text  # it may begin with a capital there


@pytest.mark.slow
def test_the_program_calibrates_checks_and_converts(
    images: Path,
    cameras: dict[str, TrueCamera],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scripts = tmp_path / "bin"
    scripts.mkdir()
    write_scripts(scripts)
    monkeypatch.setenv("PATH", f"{scripts}:{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", str(BUILD / "python"))
    few = tmp_path / "few"
    for path in images.rglob("*.png"):
        if not re.search(r"held_(0[1-9])", path.stem):
            (few / path.parent.name).mkdir(parents=True, exist_ok=True)
            shutil.copy(path, few / path.parent.name)
    command = [PROGRAM, "calibrate", "cameras", "trifinger-pro", "--file", "cameras.yml"]
    said = output_of(*command, "--images", str(few), cwd=tmp_path)
    assert "cameras.yml written" in said
    assert (tmp_path / "trifinger-pro.cameras.html").exists()
    assert_true(CameraCalibration.read(tmp_path / "cameras.yml"), cameras)
    assert "holds" in output_of(*command, "--check", "--images", str(few), cwd=tmp_path)
    output_of(*command, "--to-original", "original", cwd=tmp_path)
    files = sorted(str(path) for path in (tmp_path / "original").iterdir())
    assert len(files) == 9
    again = [*command[:-1], "again.yml", "--from-original", *files]
    output_of(*again, cwd=tmp_path)
    assert_true(CameraCalibration.read(tmp_path / "again.yml"), cameras)

    swapped = tmp_path / "swapped"
    shutil.copytree(few, swapped)
    (swapped / "camera60").rename(swapped / "other")
    (swapped / "camera180").rename(swapped / "camera60")
    (swapped / "other").rename(swapped / "camera180")
    before = (tmp_path / "cameras.yml").read_text()
    said = output_of(*command, "--images", str(swapped), cwd=tmp_path, succeeds=False)
    assert "camera60 and camera180 are exchanged" in said
    assert (tmp_path / "cameras.yml").read_text() == before


@pytest.mark.slow
@pytest.mark.parametrize("pixels", ["bayer_rggb8", "mono8", "rgb8"])
@pytest.mark.parametrize("turns", [(0.4, 0.3, -0.2), (2.2, 0.4, 0.45), (-0.9, -0.45, -0.3)])
def test_corners_are_found_to_a_tenth_of_a_pixel(
    turns: tuple[float, float, float], pixels: str, cameras: dict[str, TrueCamera]
) -> None:
    pose = boards.held(BOARD, 0, 0, 0.1, turns)
    how = Look(gains=(0.3, 1.0, 0.45))
    image = boards.render(cameras["camera60"], BOARD, pose, how, pixels, 5)
    numbers, found, _ = find_corners(to_grey(image), BOARD)
    points = BOARD.corners[numbers] @ pose[:3, :3].T + pose[:3, 3]
    misses = found - cameras["camera60"].project(points)
    assert len(numbers) > 20
    assert np.sqrt(np.mean(np.sum(misses**2, axis=1))) < 0.1
    assert np.abs(misses.mean(axis=0)).max() < 0.03  # a mosaic must not move edges
    assert pixels_of([image]) == pixels


@pytest.mark.slow
@pytest.mark.parametrize(
    ("camera", "name"), [("camera60", "held_04"), ("camera60", "held_11"), ("camera180", "held_03")]
)
def test_corners_of_a_steep_board_are_as_good(
    camera: str, name: str, cameras: dict[str, TrueCamera], poses: dict[str, np.ndarray]
) -> None:
    image = boards.render(cameras[camera], BOARD, poses[name], Look(), "mono8", 5)
    numbers, found, _ = find_corners(image, BOARD)
    points = BOARD.corners[numbers] @ poses[name][:3, :3].T + poses[name][:3, 3]
    misses = found - cameras[camera].project(points)
    assert len(numbers) > 20
    assert np.sqrt(np.mean(np.sum(misses**2, axis=1))) < 0.1


@pytest.mark.parametrize(
    ("how", "sentence"),
    [
        (Look(white=20, noise=1), "is dark: white is"),
        (Look(blur=7), "is blurred: edges are"),
        (Look(motion=25), "is blurred: edges are"),
        (Look(white=255 * 4), "is too bright"),
    ],
)
def test_a_bad_image_is_called_bad(
    how: Look, sentence: str, cameras: dict[str, TrueCamera], tmp_path: Path
) -> None:
    pose = boards.flat(BOARD, 0, 0, 0.2)
    image = boards.render(cameras["camera60"], BOARD, pose, how, "mono8", 1)
    boards.save(image, tmp_path / "mark.png")
    view = look("camera60", "mark", tmp_path / "mark.png", BOARD)
    assert sentence in (view.reason or view.quality.problem())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shown", "sentence"),
    [
        (Board(dictionary="5x5_50"), "markers of the dictionary 5x5_50, not of 4x4_50"),
        (Board(columns=5, rows=8), "not in the order of a board of 8 x 5 squares"),
    ],
)
def test_another_board_is_named(
    shown: Board, sentence: str, cameras: dict[str, TrueCamera], tmp_path: Path
) -> None:
    pose = boards.flat(shown, 0, 0, 0.2)
    image = boards.render(cameras["camera60"], shown, pose, Look(), "mono8", 1)
    boards.save(image, tmp_path / "mark.png")
    assert sentence in look("camera60", "mark", tmp_path / "mark.png", BOARD).reason


def test_a_board_whose_markers_begin_later_is_found_and_named(
    cameras: dict[str, TrueCamera], tmp_path: Path
) -> None:
    shown = dataclasses.replace(BOARD, first_id=17)
    assert "ids from 17 on" in str(shown)
    pose = boards.flat(shown, 0, 0, 0.2)
    image = boards.render(cameras["camera60"], shown, pose, Look(), "mono8", 1)
    numbers, found, _ = find_corners(image, shown)
    points = shown.corners[numbers] @ pose[:3, :3].T + pose[:3, 3]
    assert len(numbers) == len(shown.corners)
    assert np.abs(found - cameras["camera60"].project(points)).max() < 0.5
    boards.save(image, tmp_path / "mark.png")
    assert "say --first-id 17" in look("camera60", "mark", tmp_path / "mark.png", BOARD).reason
    file = tmp_path / "board.svg"
    assert calibrate_cameras.main(["--print-board", str(file), "--first-id", "17"]) == 0
    assert svg(shown) == file.read_text() != svg(BOARD)


@pytest.mark.parametrize(
    ("names", "words", "sentence"),
    [
        ({"camera60": ["a", "b", "c", "d"]}, [], "no image shows the board at the mark"),
        ({"camera60": ["mark", "a", "b"]}, [], "camera60 sees the board in 3 images; 4 are needed"),
        (
            {"camera60": ["mark", "a", "b", "c"], "camera180": ["d", "e", "f", "g"]},
            [],
            "no image of camera180 shows the board together with one of camera60",
        ),
        ({"camera60": ["mark", "a", "raised_up", "c"]}, [], "must say the height of the block"),
        ({"camera60": ["mark", "a", "b", "c"]}, ["--check"], "no two images of one name"),
        ({"camera7": ["mark", "a", "b", "c"]}, ["--check"], "does not know camera7"),
        (
            {"camera60": ["mark", "a"], "camera180": ["mark", "a"]},
            ["--check"],
            "has 54 x 54 pixels, the calibration of camera60 is of 540 x 540",
        ),
    ],
)
def test_what_names_and_sizes_of_images_tell_is_said_before_anybody_looks_for_boards(
    names: dict[str, list[str]],
    words: list[str],
    sentence: str,
    cameras: dict[str, TrueCamera],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def nobody_looks(*_: Any) -> None:
        raise AssertionError

    monkeypatch.setattr("trifinger_camera_calibration.detection.find_corners", nobody_looks)
    for camera, images in names.items():
        for name in images:
            boards.save(np.zeros((54, 54), np.uint8), tmp_path / camera / f"{name}.png")
    file = tmp_path / "pro.yml"
    file.write_text(true_calibration(cameras).text())
    command = ["pro", "--images", str(tmp_path), "--file", str(file), *words]
    assert calibrate_cameras.main(command) in (1, 2)
    assert sentence in capsys.readouterr().err


def test_a_board_of_an_older_opencv_is_known(
    cameras: dict[str, TrueCamera], tmp_path: Path
) -> None:
    shown = PRESETS["original"]
    pose = boards.held(shown, 0, 0, 0.05, (0.5, 0, 0.2))
    image = boards.render(cameras["camera180"], shown, pose, Look(), "bayer_rggb8", 1)
    boards.save(image, tmp_path / "mark.png")
    assert look("camera180", "mark", tmp_path / "mark.png", shown).is_used
    other = dataclasses.replace(shown, legacy=False)
    assert "say --legacy" in look("camera180", "mark", tmp_path / "mark.png", other).reason


def test_an_image_without_a_board_says_so(tmp_path: Path) -> None:
    picture = np.random.default_rng(1).integers(0, 255, (54, 54), np.uint8)
    boards.save(cv2.resize(picture, (540, 540)), tmp_path / "mark.png")
    view = look("camera60", "mark", tmp_path / "mark.png", BOARD)
    assert not view.is_used
    boards.save(np.full((540, 540), 120, np.uint8), tmp_path / "grey.png")
    assert "little contrast" in look("camera60", "grey", tmp_path / "grey.png", BOARD).reason


def test_images_of_several_sizes_are_refused(tmp_path: Path) -> None:
    boards.save(np.zeros((540, 540), np.uint8), tmp_path / "camera60" / "mark.png")
    boards.save(np.zeros((270, 270), np.uint8), tmp_path / "camera60" / "table.png")
    with pytest.raises(InvalidArgument, match=r"mark\.png has 540 x 540 .* table\.png 270 x 270"):
        look_at_all(ImageSet.of_folder(tmp_path), BOARD)


def test_folders_may_be_of_cameras_or_of_instants(tmp_path: Path) -> None:
    for camera in ("camera180", "camera60"):
        for name in ("mark", "held_10", "held_9"):
            boards.save(np.zeros((8, 8), np.uint8), tmp_path / "1" / camera / f"{name}.png")
            boards.save(np.zeros((8, 8), np.uint8), tmp_path / "2" / name / f"{camera}.png")
    for folder in ("1", "2"):
        images = ImageSet.of_folder(tmp_path / folder)
        assert images.cameras == ["camera60", "camera180"]
        assert images.names == ["held_9", "held_10", "mark"]
        assert images.paths["camera60"]["held_9"].exists()


def test_folders_say_what_they_lack(tmp_path: Path) -> None:
    with pytest.raises(InvalidArgument, match="no images; there must be a folder for each camera"):
        ImageSet.of_folder(tmp_path)
    with pytest.raises(InvalidArgument, match="is no folder"):
        ImageSet.of_folder(tmp_path / "nothing")
    (tmp_path / "camera60").mkdir()
    (tmp_path / "camera60" / "mark.png").write_bytes(b"no image")
    with pytest.raises(InvalidArgument, match="cannot be read"):
        look_at_all(ImageSet.of_folder(tmp_path), BOARD)
    (tmp_path / "camera60" / "mark.jpg").write_bytes(b"")
    with pytest.raises(InvalidArgument, match="two images of one name"):
        ImageSet.of_folder(tmp_path)


# From corners.


@pytest.mark.slow
def test_the_truth_lies_within_the_uncertainty_that_is_told(
    cameras: dict[str, TrueCamera],
) -> None:
    ratios = []
    for seed in range(4):
        poses = boards.places(BOARD, free=14, seed=seed)
        found = calibrated(computed_views(cameras, poses, seed=seed))
        assert_true(found.calibration, cameras)
        assert found.rms == pytest.approx(0.05 * np.sqrt(2), rel=0.1)
        for camera in found.calibration.cameras:
            move = np.linalg.norm(camera.pose[:3, 3] - cameras[camera.name].pose[:3, 3])
            ratios.append(move / found.uncertainty[camera.name].position)
    # The squares of errors in units of their deviations are 1 on average.
    assert 0.4 < np.sqrt(np.mean(np.square(ratios))) < 1.8


def test_the_table_is_where_z_is_zero(cameras: dict[str, TrueCamera]) -> None:
    # The mark's image alone would tilt the world by its noise; the table's images correct it.
    poses = boards.places(BOARD, free=14)
    tilted = np.eye(4)
    tilted[:3, :3], tilted[2, 3] = boards.turn("x", np.radians(2)), 0.006
    lab = {
        name: dataclasses.replace(camera, pose=tilted @ camera.pose)
        for name, camera in cameras.items()
    }
    found = calibrated(computed_views(lab, {name: tilted @ at for name, at in poses.items()}))
    assert_true(found.calibration, cameras)
    before = CameraCalibration([camera_of(lab[name]) for name in lab])
    views = [
        view
        for view in computed_views(cameras, poses)
        if view.name in ("mark", "table_1", "table_2", "table_3")
    ]
    worn = check_views(views, BOARD, before)
    assert any(
        "6.0 mm above z = 0 of the calibration and is tilted by 2.0 degrees" in problem
        for problem in worn.problems
    )


def camera_of(camera: TrueCamera) -> trifinger.Camera:
    lens = Lens(camera.intrinsics[:2], camera.intrinsics[2:], camera.distortion)
    return trifinger.Camera(camera.name, *camera.size, "bayer_rggb8", lens, camera.pose)


def true_calibration(cameras: dict[str, TrueCamera]) -> CameraCalibration:
    return CameraCalibration([camera_of(camera) for camera in cameras.values()], residual=0.05)


def test_lenses_may_be_given(cameras: dict[str, TrueCamera]) -> None:
    poses = {
        name: pose for name, pose in boards.places(BOARD).items() if not name.startswith("held")
    }
    options = Options(lenses=true_calibration(cameras))
    found = calibrated(computed_views(cameras, poses), options=options)
    assert_true(found.calibration, cameras, pixel=0.15, position=0.0003)


def exchange(views: list[View], one: str, other: str, only: str = "") -> list[View]:
    names = {one: other, other: one}
    return [
        dataclasses.replace(view, camera=names.get(view.camera, view.camera))
        if only in ("", view.name)
        else view
        for view in views
    ]


@pytest.mark.parametrize("expected", [False, True])
def test_fault_54_exchanged_cameras_are_found_and_named(
    expected: bool, cameras: dict[str, TrueCamera], poses: dict[str, np.ndarray]
) -> None:
    views = exchange(computed_views(cameras, poses), "camera180", "camera300")
    options = Options(expected=true_calibration(cameras) if expected else None)
    (problem,) = calibrated(views, options=options).problems
    assert problem.startswith("camera180 and camera300 are exchanged")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["held_03", "table_2", "mark"])
def test_fault_54_images_of_one_instant_that_are_exchanged_are_named_and_left_out(
    name: str, cameras: dict[str, TrueCamera], poses: dict[str, np.ndarray]
) -> None:
    views = exchange(computed_views(cameras, poses), "camera60", "camera180", only=name)
    if name == "mark":  # without another one nobody knows where the world is
        views += computed_views(cameras, {"mark_2": poses["mark"]}, seed=2)
    found = calibrated(views)
    (remark,) = [each for each in found.remarks if f"the images '{name}'" in each]
    assert "are exchanged" in remark
    assert "that of camera60 shows what camera180 sees" in remark
    assert_true(found.calibration, cameras)


@pytest.mark.slow
def test_fault_54_an_image_of_another_instant_is_named_and_left_out(
    cameras: dict[str, TrueCamera], poses: dict[str, np.ndarray]
) -> None:
    later = poses["held_04"].copy()
    later[:3, 3] += (0.01, 0.02, 0)
    moved = computed_views({"camera60": cameras["camera60"]}, {"held_04": later})
    views = [
        view
        for view in computed_views(cameras, poses)
        if (view.camera, view.name) != ("camera60", "held_04")
    ]
    found = calibrated([*moved, *views])
    (remark,) = [each for each in found.remarks if "'held_04'" in each]
    assert "not of one instant" in remark
    assert_true(found.calibration, cameras)


def test_a_board_that_lay_turned_at_the_mark_is_noticed(
    cameras: dict[str, TrueCamera], poses: dict[str, np.ndarray]
) -> None:
    turned = poses | {"mark": boards.flat(BOARD, 0, 0, np.pi)}
    problems = calibrated(computed_views(cameras, turned)).problems
    assert any("turned" in problem for problem in problems)


@pytest.mark.slow
def test_a_wrong_size_of_print_is_found_if_heights_tell_it(
    cameras: dict[str, TrueCamera], poses: dict[str, np.ndarray]
) -> None:
    small = dataclasses.replace(BOARD, square=0.98 * BOARD.square, marker=0.98 * BOARD.marker)
    lay = {
        name: pose @ pose_of(np.eye(3), BOARD.middle - small.middle) for name, pose in poses.items()
    }
    found = calibrated(computed_views(cameras, lay, small))
    (problem,) = found.problems
    assert "printed at 98.0% of its size: its squares have 34." in problem
    # Without known heights nobody can know, and the page says so.
    level = {name: pose for name, pose in lay.items() if not name.startswith("raised")}
    unknown = calibrated(computed_views(cameras, level, small))
    assert unknown.problems == []
    assert any("nothing in the images tells the size" in advice for advice in unknown.advice)


def test_a_print_that_is_longer_along_one_side_is_found(
    cameras: dict[str, TrueCamera], poses: dict[str, np.ndarray]
) -> None:
    problems = calibrated(computed_views(cameras, poses, scale=(1.0, 1.01))).problems
    assert any("1.0% longer along y than along x" in problem for problem in problems)


def test_too_little_is_said_in_a_sentence(
    cameras: dict[str, TrueCamera], poses: dict[str, np.ndarray]
) -> None:
    views = computed_views(cameras, poses)
    few = [view for view in views if view.camera != "camera60" or view.name in ("mark", "table_1")]
    with pytest.raises(Error, match="camera60 sees the board in 2 images; 4 are needed"):
        calibrated(few)
    with pytest.raises(Error, match="no image shows the board at the mark"):
        calibrated([view for view in views if view.name != "mark"])
    alone = [
        dataclasses.replace(view, name=f"{view.name}_alone") if view.camera == "camera60" else view
        for view in views
    ]
    with pytest.raises(Error, match="no image of camera60 shows the board together with one of"):
        calibrated(alone)
    nothing = [dataclasses.replace(view, reason="shows no board") for view in views]
    with pytest.raises(Error, match=r"no image shows the board; 57 of 57 are like camera60/"):
        calibrated(nothing)
    with pytest.raises(InvalidArgument, match="must say the height"):
        calibrated([dataclasses.replace(view, name="raised") for view in views])


@pytest.mark.slow
def test_advice_names_the_part_of_an_image_without_a_board(
    cameras: dict[str, TrueCamera], poses: dict[str, np.ndarray]
) -> None:
    views = []
    for view in computed_views(cameras, poses):
        if view.camera == "camera180":
            keep = ~((view.pixels[:, 0] < 180) & (view.pixels[:, 1] > 360))
            view = dataclasses.replace(view, numbers=view.numbers[keep], pixels=view.pixels[keep])
            if len(view.numbers) < 8:
                continue
        views.append(view)
    advice = calibrated(views).advice
    assert any("no board in the lower left corner of camera180" in each for each in advice)
    few = [view for view in views if not re.match(r"held_(0[3-9]|1)", view.name)]
    advice = calibrated(few).advice
    assert any("camera60 sees the board in 8 images only" in each for each in advice)


# The turntable of the original stack.


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1, -1])
def test_the_turntable_gives_the_world(sign: int, cameras: dict[str, TrueCamera]) -> None:
    board = PRESETS["original"]
    at_first = board_on_turntable(board, 0.0)
    poses = {}
    for step in range(18):
        turned = np.eye(4)
        turned[:3, :3] = boards.turn("z", sign * np.radians(20) * step)
        poses[f"image_{step:04}"] = turned @ at_first
    options = Options(turntable=True, step=np.radians(20))
    views = computed_views(cameras, poses, board)
    assert_true(calibrated(views, board, options).calibration, cameras)

    # The turntable stands tilted on the table: the table counts.
    tilted = np.eye(4)
    tilted[:3, :3], tilted[2, 3] = boards.turn("x", 0.02), 0.004
    places = {name: tilted @ pose for name, pose in poses.items()}
    for i, (x, y) in enumerate([(0.05, 0), (-0.05, 0.05), (0, -0.06)]):
        places[f"table_{i}"] = boards.flat(board, x, y, i)
    found = calibrated(computed_views(cameras, places, board), board, options)
    assert_true(found.calibration, cameras)
    assert any("stands 4.0 mm above the table" in remark for remark in found.remarks)


@pytest.mark.slow
def test_the_program_calibrates_with_the_turntable_of_the_original(
    cameras: dict[str, TrueCamera], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    board = PRESETS["original"]
    poses = {}
    for step in range(0, 36, 4):
        turned = np.eye(4)
        turned[:3, :3] = boards.turn("z", np.radians(10) * step)
        poses[f"image_{step:04}"] = turned @ board_on_turntable(board, 0.0)
    coarse = {
        name: dataclasses.replace(camera, samples=1, _rays=None) for name, camera in cameras.items()
    }
    boards.write_images(tmp_path / "images", coarse, board, poses)
    monkeypatch.setenv("TRIFINGER_CALIBRATION_DIR", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    words = ["trifinger-pro", "--images", "images", "--board", "original", "--turntable"]
    assert calibrate_cameras.main(words) == 0
    assert_true(CameraCalibration.read(tmp_path / "trifinger-pro.cameras.yml"), cameras)


def test_the_board_on_the_turntable_is_where_its_drawing_says() -> None:
    board = PRESETS["original"]
    pose = board_on_turntable(board, 0.0)
    corners = np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.4, 0], [0.2, 0.4, 0]])
    upper_left, upper_right, lower_left, lower_right = corners @ pose[:3, :3].T + pose[:3, 3]
    assert lower_left[2] == pytest.approx(lower_right[2])
    slope = (upper_left - lower_left) / 0.4
    assert np.degrees(np.arcsin(slope[2])) == pytest.approx(22)
    assert upper_right[2] > 0.15
    assert lower_left[2] < 0.035  # a margin of 38 mm, tilted, above the plates
    assert (-pose[:3, 2])[2] > 0.9  # it looks up
    assert lower_left[1] < -0.09


# Checks of a calibration.


def test_a_camera_that_has_moved_is_named(
    cameras: dict[str, TrueCamera], poses: dict[str, np.ndarray]
) -> None:
    few = {name: poses[name] for name in ("mark", "table_1", "table_2", "held_01")}
    calibration = true_calibration(cameras)
    assert check_views(computed_views(cameras, few), BOARD, calibration).problems == []
    for name, camera in cameras.items():
        bumped = camera.pose.copy()
        bumped[:3, :3] = boards.turn("z", np.radians(0.5)) @ bumped[:3, :3]
        moved = cameras | {name: dataclasses.replace(camera, pose=bumped)}
        problems = check_views(computed_views(moved, few), BOARD, calibration).problems
        assert any(re.match(rf"{name} has moved by .* 0\.[45]\d degrees", p) for p in problems)


def test_a_check_refuses_images_that_are_not_of_the_calibration(
    cameras: dict[str, TrueCamera], poses: dict[str, np.ndarray]
) -> None:
    calibration = true_calibration(cameras)
    views = computed_views(cameras, {"mark": poses["mark"]})
    other = [dataclasses.replace(view, camera="camera7") for view in views]
    with pytest.raises(InvalidArgument, match="does not know camera7"):
        check_views(other, BOARD, calibration)
    small = [dataclasses.replace(view, size=(270, 270)) for view in views]
    with pytest.raises(InvalidArgument, match="has 270 x 270 pixels"):
        check_views(small, BOARD, calibration)
    with pytest.raises(Error, match="no two images of one name"):
        check_views(views[:1], BOARD, calibration)


# Files.


@pytest.mark.bindings
def test_cpp_reads_what_it_has_written(cameras: dict[str, TrueCamera], tmp_path: Path) -> None:
    written = true_calibration(cameras)
    (tmp_path / "cameras.yml").write_text(written.text())
    read = CameraCalibration.read(tmp_path / "cameras.yml")
    assert read.residual == written.residual
    for one, other in zip(read.cameras, written.cameras, strict=True):
        assert (one.name, one.width, one.pixels) == (other.name, other.width, other.pixels)
        assert np.abs(one.pose - other.pose).max() < 1e-15
        assert (one.lens.distortion == other.lens.distortion).all()


@pytest.mark.bindings
def test_lens_and_projection_are_the_same_in_both_languages(
    cameras: dict[str, TrueCamera],
) -> None:
    for truth in cameras.values():
        camera = camera_of(truth)
        expected = truth.project(ARENA)
        assert np.abs(camera.project(ARENA) - expected).max() < 1e-9
        numbers = np.array([*truth.intrinsics, *truth.distortion])
        seen = (ARENA - truth.pose[:3, 3]) @ truth.pose[:3, :3]
        assert np.abs(geometry.project(numbers, seen) - expected).max() < 1e-9
        rays = camera.lens.unproject(expected)
        assert np.abs(rays - seen[:, :2] / seen[:, 2:]).max() < 1e-9
    assert np.isnan(camera.project([camera.pose[:3, 3] - camera.pose[:3, 2]])).all()


def test_files_of_the_original_come_back(cameras: dict[str, TrueCamera], tmp_path: Path) -> None:
    written = true_calibration(cameras)
    paths = original.write(written, tmp_path)
    for suffix in ("_full", "_cropped", "_cropped_and_downsampled"):
        read = original.read([path for path in paths if path.stem.endswith(suffix)])
        assert [camera.name for camera in read.cameras] == list(cameras)
        assert_true(read, cameras, pixel=1e-9, position=1e-12, angle=1e-9)
    assert len(original.read(paths).cameras) == 3
    # OpenCV's own reader takes them.
    storage = cv2.FileStorage(str(tmp_path / "camera60_full.yml"), cv2.FILE_STORAGE_READ)
    assert storage.getNode("camera_name").string() == "camera60"
    assert storage.getNode("camera_matrix").getNode("data").at(2).real() == pytest.approx(379.286)


@pytest.mark.parametrize("writer", WRITERS)
def test_files_of_the_original_are_read_from_every_writer(
    writer: str, cameras: dict[str, TrueCamera], tmp_path: Path
) -> None:
    paths = original.write(true_calibration(cameras), tmp_path)
    for path in paths:
        content = foreign_yaml.parse(path.read_text())
        for name in MATRICES:
            content[name] = foreign_yaml.matrix(content[name])
        path.write_text(WRITERS[writer](content))
    new = tmp_path / "new.yml"
    command = ["pro", "--file", str(new), "--from-original", *map(str, paths)]
    assert calibrate_cameras.main(command) == 0
    assert_true(CameraCalibration.read(new), cameras, pixel=1e-9, position=1e-12, angle=1e-9)


def test_half_the_size_is_the_originals_in_files_and_ours_in_images(
    cameras: dict[str, TrueCamera], tmp_path: Path
) -> None:
    original.write(true_calibration(cameras), tmp_path)
    text = (tmp_path / "camera60_cropped_and_downsampled.yml").read_text()
    assert "291.286" not in text
    assert "145.643" in text  # c / 2
    ours = camera_of(cameras["camera60"]).reduced(2).lens.principal_point
    assert ours[0] == pytest.approx(145.643 - 0.25)


@pytest.mark.parametrize("suffix", original.SUFFIXES)
@pytest.mark.parametrize("kind", original.SUFFIXES)
@pytest.mark.parametrize("is_mosaic", [True, False])
def test_images_of_the_original_are_taken_as_they_are(
    suffix: str, kind: str, is_mosaic: bool, cameras: dict[str, TrueCamera], tmp_path: Path
) -> None:
    paths = original.write(true_calibration(cameras), tmp_path / "original")
    width, height = original.SUFFIXES[kind]
    for name in cameras:
        shape = (height, width) if is_mosaic else (height, width, 3)
        boards.save(np.zeros(shape, np.uint8), tmp_path / "images" / "1" / f"{name}.png")
    new = tmp_path / "new.yml"
    command = ["pro", "--file", str(new), "--images", str(tmp_path / "images"), "--from-original"]
    files = [str(path) for path in paths if path.stem.endswith(suffix)]
    assert calibrate_cameras.main([*command, *files]) == 0
    read = CameraCalibration.read(new)
    for camera in read.cameras:
        assert (camera.width, camera.height) == (width, height)
        assert camera.pixels == ("bayer_rggb8" if is_mosaic else "rgb8")
        seen = cameras[camera.name].project(ARENA)  # in images of 540 x 540
        expected = {
            "_full": seen + np.array([88, 0]),
            "_cropped": seen,
            "_cropped_and_downsampled": (seen + 0.5) / 2 - 0.5,
        }[kind]
        assert np.abs(camera.project(ARENA) - expected).max() < 1e-9


def test_images_that_are_not_those_of_the_original_are_refused(
    cameras: dict[str, TrueCamera], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = original.write(true_calibration(cameras), tmp_path / "original")
    images = tmp_path / "images"
    command = ["pro", "--file", str(tmp_path / "new.yml"), "--images", str(images)]

    def refuses(sentence: str) -> None:
        assert calibrate_cameras.main([*command, "--from-original", *map(str, paths)]) == 2
        assert sentence in capsys.readouterr().err

    for name in list(cameras)[1:]:
        boards.save(np.zeros((540, 540), np.uint8), images / "1" / f"{name}.png")
    refuses("has no images of camera60")
    boards.save(np.zeros((480, 640), np.uint8), images / "1" / "camera60.png")
    refuses("camera60 has images of 640 x 480 pixels, must be 720 x 540, 540 x 540 or 270 x 270")
    for number, side in enumerate((540, 270), 1):
        boards.save(np.zeros((side, side), np.uint8), images / str(number) / "camera60.png")
    refuses("the images of camera60 in")
    assert not (tmp_path / "new.yml").exists()


def test_files_of_the_original_that_make_no_sense_are_refused(
    cameras: dict[str, TrueCamera], tmp_path: Path
) -> None:
    original.write(true_calibration(cameras), tmp_path)
    good = (tmp_path / "camera60_full.yml").read_text()
    bad = tmp_path / "bad.yml"

    def refuses(text: str, sentence: str) -> None:
        bad.write_text(text)
        with pytest.raises(InvalidArgument, match=sentence):
            original.read([bad])

    refuses(good.replace("camera_matrix", "other"), "has no 'camera_matrix'")
    refuses(good.replace("image_width: 720", "image_width: 640"), "must be 720 x 540")
    refuses(
        re.sub(r"data: \[-0.238.*\]", "data: [1, 2]", good),
        "'distortion_coefficients': it must have 1 x 5",
    )
    refuses(re.sub(r"data: \[-0.70", "data: [-0.90", good), "no rotation and translation")
    refuses("{[", "is not YAML")
    # What the original writes: no first line, lists over lines, and rotations that are means.
    plain = good.split("---\n")[1].replace("-0.7019", "-0.7019")
    bad.write_text(plain)
    assert original.read([bad]).cameras[0].name == "camera60"
    moved = good.replace("720", "720").replace("0.5238", "0.5538")
    bad.write_text(moved)
    with pytest.raises(InvalidArgument, match="do not agree"):
        original.read([tmp_path / "camera60_full.yml", bad])


# Boards.


def raster(shapes: list[tuple[float, ...]], size: tuple[float, float], per_mm: int) -> np.ndarray:
    """Black where a rectangle is, with x and y in mm from the upper left corner."""
    picture = np.full((round(size[1] * per_mm), round(size[0] * per_mm)), 255, np.uint8)
    for x, y, width, height in shapes:
        left, top = round(x * per_mm), round(y * per_mm)
        picture[top : round((y + height) * per_mm), left : round((x + width) * per_mm)] = 0
    return picture


def svg_shapes(board: Board) -> list[tuple[float, ...]]:
    pattern = r'<rect x="([-\d.]+)" y="([-\d.]+)" width="([\d.]+)" height="([\d.]+)"/>'
    return [tuple(map(float, each)) for each in re.findall(pattern, svg(board))]


def pdf_shapes(board: Board) -> list[tuple[float, ...]]:
    text = pdf(board).decode()
    height = float(re.search(r"MediaBox \[0 0 [\d.]+ ([\d.]+)\]", text)[1])  # type: ignore[index]
    shapes = []
    for each in re.findall(r"([-\d.]+) ([-\d.]+) ([-\d.]+) ([-\d.]+) re", text):
        x, y, w, h = map(float, each)
        shapes.append(tuple(number * 25.4 / 72 for number in (x, height - y - h, w, h)))
    return shapes


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("shapes_of", [svg_shapes, pdf_shapes])
def test_a_printed_board_is_what_opencv_draws(
    name: str, shapes_of: Callable[[Board], list[tuple[float, ...]]]
) -> None:
    board = PRESETS[name]
    shapes = shapes_of(board)
    left, top = (min(each[i] for each in shapes if each[2] > 1 and each[3] > 1) for i in (0, 1))
    inside = [(x - left, y - top, w, h) for x, y, w, h in shapes if w > 1 and h > 1]
    drawn = raster(inside, tuple(1e3 * side for side in board.size), 4)
    size = (round(board.size[0] * 4000), round(board.size[1] * 4000))
    expected = board.to_opencv().generateImage(size, marginSize=0, borderBits=1)
    assert np.mean(drawn != expected) < 1e-4


@given(
    columns=st.integers(3, 9),
    rows=st.integers(3, 9),
    legacy=st.booleans(),
    share=st.floats(0.5, 0.9),
)
def test_corners_of_boards_are_those_of_opencv(
    columns: int, rows: int, legacy: bool, share: float
) -> None:
    board = Board(columns=columns, rows=rows, marker=0.035 * share, legacy=legacy)
    expected = board.to_opencv().getChessboardCorners()
    assert np.abs(board.corners - expected).max() < 1e-6


def test_boards_that_cannot_be_are_refused() -> None:
    with pytest.raises(InvalidArgument, match="markers must be smaller than squares"):
        Board(marker=0.04)
    with pytest.raises(InvalidArgument, match="there is no dictionary 'x'; there are 4x4_100"):
        Board(dictionary="x")
    with pytest.raises(InvalidArgument, match="apriltag_16h5 has 30 markers"):
        Board(columns=9, rows=9, dictionary="apriltag_16h5")
    with pytest.raises(InvalidArgument, match="must have 3 to 50"):
        Board(columns=2)
    with pytest.raises(InvalidArgument, match="thickness"):
        Board(thickness=-1)


# The command line.


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["robot.yml", "--images", "."], "'robot.yml' is no name of a robot"),
        (["pro", "--check", "--images", "."], "pro has no calibration"),
        (["pro", "--images", ".", "--squares", "8"], "--squares is '8', must be like 8x5"),
        (["--print-board", "board.png"], "boards are drawn as .svg or .pdf"),
    ],
)
def test_the_command_says_what_is_wrong(
    words: list[str],
    sentence: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("TRIFINGER_CALIBRATION_DIR", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    boards.save(np.zeros((54, 54), np.uint8), tmp_path / "camera60" / "mark.png")
    assert calibrate_cameras.main(words) in (1, 2)
    assert sentence in capsys.readouterr().err


def test_the_command_draws_the_board_and_keeps_the_calibration_before(
    tmp_path: Path, cameras: dict[str, TrueCamera]
) -> None:
    file = tmp_path / "board.svg"
    assert calibrate_cameras.main(["--print-board", str(file), "--square", "0.03"]) == 0
    assert "squares of 30 mm" in file.read_text()
    paths = original.write(true_calibration(cameras), tmp_path / "original")
    calibration = tmp_path / "new" / "cameras.yml"
    command = ["pro", "--file", str(calibration), "--from-original", *map(str, paths)]
    assert calibrate_cameras.main(command) == 0
    first = calibration.read_text()
    assert calibrate_cameras.main(command) == 0
    assert (tmp_path / "new" / "cameras.yml.before").read_text() == first
