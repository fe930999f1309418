# SPDX-License-Identifier: BSD-3-Clause
"""Cameras of a robot: their process shows a folder of images, and others look at them."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
import trifinger
from conftest import PROGRAM, StartChild, StartProgram
from numpy.typing import NDArray
from trifinger.cameras import Cameras, Images, LiveCameras, calibration_of, to_rgb

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
        wait_for_images(robot, cameras)
        # The memory keeps 16 images, a third of a second. What is looked at shall stay in it.
        process.process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, process.process.pid, os.WSTOPPED)
        images = wait_for_images(robot, cameras)
        assert images.names == CAMERAS
        for c, name in enumerate(CAMERAS):
            frame = images.frame(name)
            assert frame.state == "good"
            assert 0 <= frame.missed <= frame.number
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
        process.process.send_signal(signal.SIGCONT)
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


def test_images_that_the_robots_process_draws_are_read_by_others(
    start_program: StartProgram, tmp_path: Path
) -> None:
    words = ("--set", "cameras.size=90", "--set", "cameras.rate=20", "--set", "cameras.delay=0")
    start_program("run", "sim_cameras", "--non-real-time", *words).wait_for("holds its")
    with trifinger.connect("sim") as robot:
        cameras = Cameras(robot)
        seen = set()
        for _ in range(200):
            t = robot.append_desired_action(robot.new_action())
            images = cameras.get_latest_at(t)
            assert images is not None  # a session begins with them
            if t % 50 == 49:
                seen.add(images.frame("camera60").number)
                assert images["camera60"].std() > 1
        assert len(seen) == 4
        # The robot's time stands still, so its newest images are not old.
        command = [PROGRAM, "look", "sim", "-o", str(tmp_path / "all.png")]
        subprocess.run(command, check=True)
    with PIL.Image.open(tmp_path / "all.png") as picture:
        assert picture.size == (270, 90)


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


# A camera at the network, of which there is one at a time on a machine (aravis_device_test.cpp).
NETWORK_CAMERA = """
import ctypes, fcntl, pathlib, sys, tempfile
lock = open(pathlib.Path(tempfile.gettempdir()) / "trifinger_network_camera.lock", "a")
fcntl.flock(lock, fcntl.LOCK_EX)
aravis = ctypes.CDLL("libaravis-0.8.so.0")
aravis.arv_gv_fake_camera_new_full.restype = ctypes.c_void_p
camera = aravis.arv_gv_fake_camera_new_full(b"127.0.0.1", sys.argv[1].encode(), None)
aravis.arv_gv_fake_camera_is_running.argtypes = [ctypes.c_void_p]
assert aravis.arv_gv_fake_camera_is_running(camera)
print("ready", flush=True)
sys.stdin.read()
"""


def has_aravis() -> bool:
    """Whether the library for GenICam cameras is there."""
    done = subprocess.run([PROGRAM, "cameras", "--list"], capture_output=True, text=True)
    return not done.stderr


@pytest.mark.slow
def test_fault_51_a_camera_that_is_unplugged_is_camera_lost_until_it_is_back(
    start_program: StartProgram, start_child: StartChild
) -> None:
    if not has_aravis():
        pytest.skip("Aravis is missing")
    serial = f"P{os.getpid()}"
    words = (
        *("--set", "cameras.source=aravis", "--set", "cameras.rate=10"),
        *("--set", "cameras.size=90"),
        *("--set", f"cameras.devices=[Fake_1, {serial}, Fake_1]"),
    )
    start_program("run", "sim_cameras", "--non-real-time", "--no-sensors", *words).wait_for("holds")
    camera = start_child(sys.executable, "-c", NETWORK_CAMERA, serial)
    process = start_program("cameras", "sim")
    process.wait_for("deliver images")
    with trifinger.connect("sim") as robot:
        cameras = Cameras(robot)

        def look_until(state: str) -> Images:
            while True:
                images = wait_for_images(robot, cameras)
                states = {name: images.frame(name).state for name in CAMERAS}
                if states == {"camera60": "good", "camera180": state, "camera300": "good"}:
                    return images

        before = look_until("good")
        camera.kill()
        images = look_until("lost")
        with pytest.raises(trifinger.CameraLost, match="camera180 is not there: unplugged"):
            images["camera180"]
        # What is known of its last image is as old as it is.
        assert images.frame("camera180").number >= before.frame("camera180").number
        process.wait_for("camera180 is lost; the others go on")
        start_child(sys.executable, "-c", NETWORK_CAMERA, serial)
        after = look_until("good")
        assert after.frame("camera180").number > images.frame("camera180").number
        process.wait_for("camera180 delivers again")


def look_until_refused(path: Path) -> str:
    """Looks until there is no new image any more; returns what the last look has said."""
    while True:
        path.unlink(missing_ok=True)
        command = [PROGRAM, "look", "sim", "-o", str(path), "--timeout", "0.3"]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            assert not path.exists()
            return done.stderr


@pytest.mark.slow
def test_fault_51_look_does_not_take_old_images_for_new_ones(
    start_program: StartProgram, folder: Path, tmp_path: Path
) -> None:
    process = start_program("cameras", "sim_cameras", *settings(folder))
    process.wait_for("deliver images")
    start_program("run", "sim_cameras", "--no-sensors", *settings(folder)).wait_for("holds its")
    picture = tmp_path / "all.png"
    subprocess.run([PROGRAM, "look", "sim", "-o", picture], check=True)
    process.process.send_signal(signal.SIGSTOP)
    assert "old, and no newer ones come; 'trifinger cameras sim'" in look_until_refused(picture)
    process.process.send_signal(signal.SIGCONT)
    subprocess.run([PROGRAM, "look", "sim", "-o", picture], check=True)
    # The session still has images of a process that was killed.
    process.end(signal.SIGKILL)
    assert "old, and no newer ones come" in look_until_refused(picture)


def test_raw_images_of_different_formats_do_not_go_into_one_file(
    start_program: StartProgram, folder: Path, tmp_path: Path
) -> None:
    first = start_program("run", "sim_cameras", "--no-sensors", *settings(folder, "bayer_rggb8"))
    first.wait_for("holds its")
    with trifinger.observe("sim") as robot:
        calibration = calibration_of(robot)
    first.end()
    mixed = calibration.replace("pixels: bayer_rggb8", "pixels: rgb8", 1)
    assert mixed != calibration
    (tmp_path / "cameras.yml").write_text(mixed)
    (tmp_path / "robot.yml").write_text(
        f"extends: sim\nname: sim\ncameras: {{source: folder, folder: {folder}, rate: 20,"
        f" calibration: {tmp_path / 'cameras.yml'}}}\n"
    )
    start_program("run", str(tmp_path / "robot.yml")).wait_for("deliver images")
    command = [PROGRAM, "look", "sim", "--raw", "-o", str(tmp_path / "all.png")]
    refused = subprocess.run(command, capture_output=True, text=True)
    assert refused.returncode == 2
    assert "raw images of camera60 are in rgb8, those of camera180 in bayer_rggb8" in (
        refused.stderr
    )
    subprocess.run([*command[:-1], str(tmp_path / "all")], check=True)
    for name, mode in zip(CAMERAS, ("RGB", "L", "L"), strict=True):
        with PIL.Image.open(tmp_path / "all" / f"{name}.png") as image:
            assert image.mode == mode
    subprocess.run([PROGRAM, "look", "sim", "-o", str(tmp_path / "all.png")], check=True)


def child_of(pid: int) -> int:
    """The only child process of a process with one thread that starts children."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    assert len(children) == 1
    return int(children[0])


def state_of(pid: int) -> str:
    """What the kernel calls the state of a process; "gone" if there is none."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(") ", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return "gone"


def test_a_second_ctrl_c_does_not_wait_for_cameras_that_hang(
    start_program: StartProgram, folder: Path
) -> None:
    running = start_program("run", "sim_cameras", *settings(folder))
    running.wait_for("deliver images")
    cameras = child_of(running.process.pid)
    os.kill(cameras, signal.SIGSTOP)
    running.process.send_signal(signal.SIGINT)
    # The cameras are asked to end, but cannot.
    status = Path(f"/proc/{cameras}/status")
    pending = 1 << (signal.SIGTERM - 1)
    while not int(status.read_text().split("ShdPnd:")[1].split()[0], 16) & pending:
        assert running.process.poll() is None
    running.process.send_signal(signal.SIGINT)
    assert running.process.wait() == -signal.SIGINT
    # Nor does anything remain of them.
    while state_of(cameras) not in ("gone", "Z"):
        pass


@pytest.mark.slow
def test_image_taking_threads_have_real_time_priority(
    start_program: StartProgram, folder: Path
) -> None:
    if not has_aravis():
        pytest.skip("Aravis is missing")
    process = start_program(
        *("cameras", "sim_cameras", "--set", "cameras.source=aravis", "--set", "cameras.rate=10"),
        *("--set", "cameras.devices=[Fake_1, Fake_1, Fake_1]"),
    )
    process.wait_for("deliver images")
    pid = process.process.pid
    tasks = [int(task.name) for task in Path(f"/proc/{pid}/task").iterdir()]
    policies = {os.sched_getscheduler(task) for task in tasks}
    if policies != {os.SCHED_OTHER}:  # this machine grants it
        assert policies == {os.SCHED_FIFO}
    # Files are work like any other.
    files = start_program("cameras", "sim_cameras", "--name", "files", *settings(folder))
    files.wait_for("deliver images")
    assert os.sched_getscheduler(files.process.pid) == os.SCHED_OTHER
    # Images of webcams must be decoded or converted, too.
    webcams = ["--set", "cameras.source=v4l2", "--set", "cameras.devices=[/dev/a, /dev/b, /dev/c]"]
    for source in (settings(folder), webcams):
        command = [PROGRAM, "cameras", "sim_cameras", "--scheduling", "require", *source]
        refused = subprocess.run(command, capture_output=True, text=True)
        assert refused.returncode == 2
        assert "is for GenICam cameras" in refused.stderr


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
