# SPDX-License-Identifier: BSD-3-Clause
"""Cameras of a robot: their process shows a folder of images, and others look at them."""

import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
import trifinger
from conftest import PROGRAM, StartProgram
from numpy.typing import NDArray
from trifinger.cameras import Cameras, Images, LiveCameras, calibration_of, to_rgb

pytestmark = pytest.mark.release

CAMERAS = ("camera60", "camera180", "camera300")
SIZE = 270


def write_netpbm(path: Path, image: NDArray[np.uint8]) -> None:
    """Writes an image as PNG, with what Pillow makes of it: not with our own code."""
    PIL.Image.fromarray(image).save(path)


def picture(camera: int, number: int) -> NDArray[np.uint8]:
    """A colour for each camera, and a column that says the number."""
    image = np.zeros((SIZE, SIZE, 3), np.uint8)
    image[..., camera] = 200
    image[:, 20 * number : 20 * number + 20] = 255
    return image


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Ten images of each camera."""
    images = tmp_path / "images"
    images.mkdir()
    for c, name in enumerate(CAMERAS):
        for i in range(10):
            write_netpbm(images / f"{name}_{i}.png", picture(c, i))
    return images


def settings(folder: Path, pixels: str = "rgb8") -> list[str]:
    values = [
        "cameras.source=folder",
        f"cameras.folder={folder}",
        f"cameras.size={SIZE}",
        "cameras.rate=50",
        f"cameras.pixels={pixels}",
    ]
    return [word for value in values for word in ("--set", value)]


def wait_for_images(robot: trifinger.Frontend, cameras: Cameras) -> Images:
    """Moves the robot until it has images."""
    while True:
        t = robot.append_desired_action(robot.new_action())
        images = cameras.get_latest_at(t)
        if images is not None:
            return images


def test_images_of_another_process_are_read_by_step(
    start_program: StartProgram, folder: Path
) -> None:
    start_program("run", "sim_cameras", "--non-real-time", *settings(folder)).wait_for("holds")
    process = start_program("cameras", "sim")
    process.wait_for("deliver images")
    with trifinger.connect("sim") as robot:
        cameras = Cameras(robot)
        assert "camera180" in cameras.calibration
        images = wait_for_images(robot, cameras)
        assert images.names == CAMERAS
        for c, name in enumerate(CAMERAS):
            frame = images.frame(name)
            assert frame.state == "good"
            assert frame.missed == 0
            assert frame.time == pytest.approx(images.time, abs=1e-3)
            np.testing.assert_array_equal(images[name], picture(c, frame.number % 10))
            np.testing.assert_array_equal(images.raw(name), images[name])
        assert 0 <= time.monotonic() - images.time < 60
        with pytest.raises(trifinger.InvalidArgument, match="did you mean 'camera60'"):
            images["camera66"]

        payload = cameras.companion.payload(images.element)
        with payload as view:
            assert view["camera60"].shape == (SIZE, SIZE, 3)
            with pytest.raises(ValueError, match="read-only"):
                view["camera60"][0, 0] = 0
        copy = payload.copy()
        # After 16 more the memory holds others, and everybody is told.
        while payload.is_valid():
            t = robot.append_desired_action(robot.new_action())
            robot.get_observation(t)
        with pytest.raises(trifinger.HistoryLost), payload:
            pass
        with pytest.raises(trifinger.HistoryLost, match="was overwritten"):
            images["camera60"]
        np.testing.assert_array_equal(
            copy["camera60"], picture(0, images.frame("camera60").number % 10)
        )
        # The element of a step stays for ever.
        same = cameras.companion.get_latest_at(images.element.stamp.arrival_index)
        assert same == images.element
    code, output = process.end(signal.SIGINT)
    assert code == 0
    assert "camera300:" in output


def test_live_cameras_see_without_a_step_of_the_robot(
    start_program: StartProgram, folder: Path, tmp_path: Path
) -> None:
    start_program("run", "sim_cameras", "--no-sensors", *settings(folder, "bayer_rggb8")).wait_for(
        "holds its"
    )
    with trifinger.observe("sim") as robot:
        live = LiveCameras("sim", calibration_of(robot))
        assert live.next(0) is None
        start_program("cameras", "sim")
        for _ in range(3):
            images = live.next(60)
            assert images is not None
            frame = images.frame("camera180")
            mosaic = images.raw("camera180")
            assert mosaic.shape == (SIZE, SIZE)
            np.testing.assert_array_equal(images["camera180"], to_rgb(mosaic, "bayer_rggb8"))
            expected = picture(1, frame.number % 10)
            np.testing.assert_array_equal(mosaic[1::2, ::2], expected[1::2, ::2, 1])
            np.testing.assert_array_equal(mosaic[1::2, 1::2], expected[1::2, 1::2, 2])

        subprocess.run([PROGRAM, "look", "sim", "-o", "all.png"], check=True, cwd=tmp_path)
        together = np.asarray(PIL.Image.open(tmp_path / "all.png"))
        assert together.shape == (SIZE, 3 * SIZE, 3)
        # Between the stripes, each third has the colour of its camera.
        for c in range(3):
            column = together[SIZE // 2, c * SIZE + 260]
            assert column[c] == 200
            assert column.sum() == 200


def test_fault_51_images_end_with_their_process_and_come_again(
    start_program: StartProgram, folder: Path
) -> None:
    running = start_program("run", "sim_cameras", "--non-real-time", *settings(folder))
    running.wait_for("holds its pose")
    process = start_program("cameras", "sim")
    process.wait_for("deliver images")
    with trifinger.connect("sim") as robot:
        cameras = Cameras(robot)
        images = wait_for_images(robot, cameras)
        process.end(signal.SIGKILL)
        running.wait_for("sensor 'cameras': its process has ended")
        newest = cameras.latest()
        assert newest is not None
        # What it says is as old as it is.
        assert newest.frame("camera60").number >= images.frame("camera60").number
        start_program("cameras", "sim").wait_for("deliver images")
        running.wait_for("delivers")
        memory = newest.element.payload.memory
        while True:
            t = robot.append_desired_action(robot.new_action())
            again = cameras.get_latest_at(t)
            assert again is not None
            if again.element.payload.memory != memory:
                break
        number = again.frame("camera60").number
        np.testing.assert_array_equal(again["camera60"], picture(0, number % 10))


def test_a_second_process_and_a_robot_without_cameras_are_told(
    start_program: StartProgram, folder: Path
) -> None:
    start_program("cameras", "sim_cameras", *settings(folder)).wait_for("deliver images")
    command = [PROGRAM, "cameras", "sim_cameras", *settings(folder)]
    second = subprocess.run(command, capture_output=True, text=True)
    assert second.returncode != 0
    assert "is already the writer of the payloads of sensor 'cameras' of robot 'sim'" in (
        second.stderr
    )
    without = subprocess.run([PROGRAM, "cameras", "sim"], capture_output=True, text=True)
    assert "has no cameras; its configuration needs a section 'cameras'" in without.stderr
    nothing = subprocess.run(
        [PROGRAM, "cameras", "sim_cameras", "--set", "cameras.source=folder"],
        capture_output=True,
        text=True,
    )
    assert "cameras.folder" in nothing.stderr
    nobody = subprocess.run([PROGRAM, "look", "sim"], capture_output=True, text=True)
    assert "there is no robot 'sim' on this machine" in nobody.stderr


def test_to_rgb_refuses_what_is_no_image() -> None:
    with pytest.raises(trifinger.InvalidArgument, match="is no format of pixels"):
        to_rgb(np.zeros((4, 4), np.uint8), "yuv")
    with pytest.raises(trifinger.InvalidArgument, match=r"has the shape \(height, width\)"):
        to_rgb(np.zeros((4, 4, 3), np.uint8), "bayer_rggb8")
    grey = np.arange(16, dtype=np.uint8).reshape(4, 4)
    np.testing.assert_array_equal(to_rgb(grey, "mono8"), np.repeat(grey[..., None], 3, axis=2))
