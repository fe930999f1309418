# SPDX-License-Identifier: BSD-3-Clause
"""Finding the cube in rendered images, in Python and by the program."""

import signal
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
import trifinger
from conftest import PROGRAM, StartProgram, output_of
from trifinger import original_cameras
from trifinger.cameras import to_rgb
from trifinger.tracking import Tracker, faces_in_blocks, tracked_object
from trifinger_camera_calibration.colours import Samples
from trifinger_camera_calibration.commands import (
    cameras as calibrate_cameras,
    colours as calibrate_colours,
)

POSITION = np.array([0.05, -0.04, 0.0325])
ORIENTATION = np.array([np.cos(0.4), 0.0, 0.0, np.sin(0.4)])


@pytest.fixture(scope="module")
def renderer() -> trifinger.CameraRenderer:
    return trifinger.CameraRenderer("sim", multisampling=4)


@pytest.fixture(scope="module")
def images(renderer: trifinger.CameraRenderer) -> list:
    configuration = np.concatenate([[0.0, 0.9, -1.7] * 3, POSITION, ORIENTATION])
    return renderer.render(configuration)


def test_a_cube_is_found_where_it_is(renderer: trifinger.CameraRenderer, images: list) -> None:
    tracker = Tracker(renderer.calibration, tracked_object("sim"))
    estimate = tracker.track(images)
    assert estimate.is_sure
    assert estimate.cameras == 3
    assert estimate.confidence >= 0.5
    np.testing.assert_allclose(estimate.position, POSITION, atol=0.001)
    assert abs(estimate.orientation @ ORIENTATION) > np.cos(np.radians(1) / 2)
    near = tracker.track(images, (estimate.position, estimate.orientation))
    np.testing.assert_allclose(near.position, estimate.position, atol=0.0003)
    assert not tracker.track([None, None, None]).is_found


@pytest.mark.parametrize("factor", [1, 2])
def test_a_cube_is_found_in_images_as_the_original_saves_them(
    factor: int, renderer: trifinger.CameraRenderer, images: list, tmp_path: Path
) -> None:
    (tmp_path / "true.yml").write_text(renderer.calibration)
    true = trifinger.CameraCalibration.read(tmp_path / "true.yml")
    files = original_cameras.write(true, tmp_path / "original")
    shown = [to_rgb(np.asarray(image), "bayer_rggb8") for image in images]
    side = shown[0].shape[0] // factor
    shown = [e.reshape(side, factor, side, factor, 3).mean((1, 3)).astype(np.uint8) for e in shown]
    for name, image in zip(renderer.names, shown, strict=True):
        (tmp_path / "images" / name).mkdir(parents=True)
        PIL.Image.fromarray(image).save(tmp_path / "images" / name / "1.png")
    new = tmp_path / "new.yml"
    command = ["sim", "--file", str(new), "--images", str(tmp_path / "images"), "--from-original"]
    assert calibrate_cameras.main([*command, *map(str, files)]) == 0
    estimate = Tracker(new.read_text(), tracked_object("sim")).track(shown)
    assert estimate.is_sure
    # At half the size, what is left of the rims in mixed pixels moves the cube by some 3 mm.
    np.testing.assert_allclose(estimate.position, POSITION, atol=0.001 if factor == 1 else 0.004)
    assert abs(estimate.orientation @ ORIENTATION) > np.cos(np.radians(2) / 2)


GENERATIONS = {
    "2020": ["red", "green", "blue", "cyan", "yellow", "magenta"],
    "2021": ["red", "green", "blue", "cyan", "magenta", "yellow"],
}


@pytest.mark.parametrize("turn", [[1, 0, 0, 0], [1, -1, 0, 0], [1, 0, -1, 0]], ids="zyx")
@pytest.mark.parametrize("lies", GENERATIONS)
def test_the_cubes_of_both_generations_are_found_and_told_apart(lies: str, turn: list) -> None:
    orientation = np.array(turn) / np.linalg.norm(turn)
    configuration = np.concatenate([[0.0, 0.9, -1.7] * 3, POSITION, orientation])
    cubes = {
        year: {"objects": [{"name": "cube", "type": "cube", "colours": colours}]}
        for year, colours in GENERATIONS.items()
    }
    renderer = trifinger.CameraRenderer("sim", cubes[lies], multisampling=4)
    images = renderer.render(configuration)
    for believed, cube in cubes.items():
        estimate = Tracker(renderer.calibration, tracked_object("sim", cube)).track(images)
        assert estimate.is_sure == (believed == lies)
        if believed == lies:
            np.testing.assert_allclose(estimate.position, POSITION, atol=0.001)
            assert abs(estimate.orientation @ orientation) > np.cos(np.radians(1) / 2)


@pytest.mark.parametrize(
    "box",
    [
        {"type": "cube", "colours": ["yellow", "red", "cyan", "green", "blue", "magenta"]},
        {
            "type": "cuboid",
            "size": [0.08, 0.05, 0.035],
            "colours": ["red", "red", "blue", "cyan", "magenta", "green"],
        },
    ],
    ids=["cube", "cuboid"],
)
def test_a_box_has_the_size_and_the_colours_of_its_configuration(box: dict) -> None:
    overrides = {"objects": [{"name": "brick", **box}]}
    renderer = trifinger.CameraRenderer("sim", overrides, multisampling=4)
    tracker = Tracker(renderer.calibration, tracked_object("sim", overrides, "brick"))
    for orientation in (ORIENTATION, [0.5, 0.5, 0.5, 0.5], [0.5, -0.5, 0.5, 0.5]):
        shown = renderer.render(np.concatenate([[0.0, 0.9, -1.7] * 3, POSITION, orientation]))
        estimate = tracker.track(shown)
        assert estimate.is_sure
        np.testing.assert_allclose(estimate.position, POSITION, atol=0.002)
        assert abs(estimate.orientation @ np.array(orientation)) > np.cos(np.radians(2) / 2)
    usual = Tracker(renderer.calibration, tracked_object())
    assert not usual.track(shown).is_sure


@pytest.mark.slow
def test_colours_are_learned_from_images_of_a_known_pose(
    renderer: trifinger.CameraRenderer,
) -> None:
    cube = tracked_object("sim")
    samples = Samples()
    # Each face must be seen.
    for turn in ([1, 0, 0, 0], [0, 1, 0, 0], [1, 1, 0, 0], [1, 0, 1, 0]):
        orientation = np.array(turn) / np.linalg.norm(turn)
        configuration = np.concatenate([[0.0, 0.9, -1.7] * 3, POSITION, orientation])
        shown = renderer.render(configuration)
        samples.add(shown, renderer.calibration, cube, POSITION, orientation)
    model = samples.learn("A test.")
    tracker = Tracker(renderer.calibration, cube, model)
    estimate = tracker.track(shown)
    assert estimate.is_sure
    np.testing.assert_allclose(estimate.position, POSITION, atol=0.001)


def test_faces_are_named_where_they_are_seen(renderer: trifinger.CameraRenderer) -> None:
    contents = faces_in_blocks(renderer.calibration, tracked_object("sim"), POSITION, ORIENTATION)
    top, bottom = 2, 3
    assert all(np.count_nonzero(np.array(content) == top) > 200 for content in contents)
    assert all(np.count_nonzero(np.array(content) == bottom) == 0 for content in contents)


def test_the_program_writes_the_poses_of_a_running_robot(start_program: StartProgram) -> None:
    start_program("run", "sim_cameras", "--no-sensors").wait_for("holds")
    cameras = start_program("cameras", "sim")
    cameras.wait_for("deliver images")
    tracking = start_program("track", "sim")
    tracking.wait_for("cube is found")
    code, output = tracking.end(signal.SIGINT)
    assert code == 0
    assert "images gave poses" in output


def test_the_doctor_says_which_cameras_are_exchanged(
    renderer: trifinger.CameraRenderer,
    images: list,
    start_program: StartProgram,
    tmp_path: Path,
) -> None:
    for name, image in zip(renderer.names, images, strict=True):
        PIL.Image.fromarray(image).save(tmp_path / f"{name}_0.png")
    values = ["source=folder", f"folder={tmp_path}", "pixels=bayer_rggb8", "rate=10"]
    words = [word for value in values for word in ("--set", f"cameras.{value}")]
    start_program("run", "sim_cameras", "--no-sensors", *words).wait_for("holds")
    cameras = start_program("cameras", "sim")
    cameras.wait_for("deliver images")
    assert "3 cameras fit together" in output_of(PROGRAM, "doctor", "cameras", "sim")
    assert cameras.end(signal.SIGINT)[0] == 0

    (tmp_path / "camera180_0.png").rename(tmp_path / "other")
    (tmp_path / "camera300_0.png").rename(tmp_path / "camera180_0.png")
    (tmp_path / "other").rename(tmp_path / "camera300_0.png")
    start_program("cameras", "sim").wait_for("deliver images")
    said = output_of(PROGRAM, "doctor", "cameras", "sim", succeeds=False)
    assert "camera180 and camera300 are exchanged" in said


def saved_images(renderer: trifinger.CameraRenderer, parent: Path) -> list[str]:
    """Folders of images that show each face of the cube."""
    folders = []
    for number, turn in enumerate(([1, 0, 0, 0], [0, 1, 0, 0], [1, 1, 0, 0], [1, 0, 1, 0])):
        orientation = np.array(turn) / np.linalg.norm(turn)
        shown = renderer.render(np.concatenate([[0.0, 0.9, -1.7] * 3, POSITION, orientation]))
        folder = parent / f"images_{number}"
        folder.mkdir()
        for name, image in zip(renderer.names, shown, strict=True):
            PIL.Image.fromarray(image).save(folder / f"{name}.png")
        folders.append(str(folder))
    return folders


@pytest.mark.slow
def test_the_command_learns_colours_from_saved_images(
    renderer: trifinger.CameraRenderer,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("TRIFINGER_CALIBRATION_DIR", str(tmp_path))
    (tmp_path / "sim.cameras.yml").write_text(renderer.calibration)
    folders = saved_images(renderer, tmp_path)
    target = tmp_path / "colours.yml"
    assert calibrate_colours.main(["sim", "--images", *folders, "-o", str(target)]) == 0
    assert "left out" not in capsys.readouterr().out
    tracker = Tracker(renderer.calibration, tracked_object("sim"), target.read_text())
    images = [np.asarray(PIL.Image.open(Path(folders[-1], f"{n}.png"))) for n in renderer.names]
    assert tracker.track(images).is_sure
    # Colours serve a camera of mosaics, too: the original's programs save such images.
    for folder in folders:
        for path in Path(folder).glob("*.png"):
            raw = np.asarray(PIL.Image.open(path))
            PIL.Image.fromarray(to_rgb(raw, "bayer_rggb8")).save(path)
    assert calibrate_colours.main(["sim", "--images", *folders, "-o", str(target)]) == 0
    assert "left out" not in capsys.readouterr().out
    assert calibrate_colours.main(["sim", "--images", str(tmp_path), "-o", str(target)]) == 1
    assert "camera60.png is missing" in capsys.readouterr().err


@pytest.mark.slow
def test_colours_of_a_laboratory_are_learned_and_used(
    renderer: trifinger.CameraRenderer,
    start_program: StartProgram,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("TRIFINGER_CALIBRATION_DIR", str(tmp_path))
    (tmp_path / "sim.cameras.yml").write_text(renderer.calibration)
    start_program("run", "sim_cameras", "--no-sensors").wait_for("holds")
    start_program("cameras", "sim").wait_for("deliver images")
    seen = str(tmp_path / "seen")
    output_of(PROGRAM, "look", "sim", "--raw", "-o", seen, "--timeout", "60")
    folders = [seen, *saved_images(renderer, tmp_path)]
    colours = str(tmp_path / "colours.yml")
    assert calibrate_colours.main(["sim", "--images", *folders, "-o", colours]) == 0
    start_program("track", "sim", "--colours", colours).wait_for("cube is found")
