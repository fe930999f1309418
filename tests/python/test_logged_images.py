# SPDX-License-Identifier: BSD-3-Clause
"""Images in logs: what the cameras saw is what the log has, for us and for other programs."""

import contextlib
import csv
import io
import itertools
import json
import pickle
import subprocess
import weakref
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
import trifinger
from conftest import PATIENT, PROGRAM, StartProgram
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from PIL import Image
from trifinger.cameras import Cameras
from trifinger.commands import export, film
from trifinger.errors import CameraLost, HistoryLost, InvalidArgument, NotInLog
from trifinger.log import camera_film, original
from trifinger.log.images import LoggedCameras, LoggedImages
from trifinger.picture import FILM_RATE

NAMES = ("camera60", "camera180", "camera300")
SIZE = 270
STEPS = 401
EVERY = 50  # steps between images
OVERRIDES = {"cameras.size": SIZE, "cameras.rate": 1000 / EVERY, "cameras.delay": 0.005}


@dataclass
class Recorded:
    """A recording, and what the robot's cameras saw meanwhile: the pixels by camera."""

    path: Path
    seen: list[dict[str, Any]]
    storage: str

    @property
    def session(self) -> trifinger.LoggedSession:
        return trifinger.Log(self.path).session()

    @property
    def cameras(self) -> LoggedCameras:
        return LoggedCameras(self.session)


def record(folder: Path, storage: str) -> Recorded:
    seen: list[dict[str, Any]] = []
    simulation = trifinger.Simulation("sim_cameras", OVERRIDES)
    with simulation.record(folder, images=storage) as recorder, simulation.connect() as robot:
        cameras = Cameras(robot)
        hold = robot.new_action(position=robot.latest_observation().position)
        for _ in range(STEPS):
            t = robot.append_desired_action(hold)
            robot.wait_until_time_index(t)
            images = cameras.get_latest_at(t)
            assert images is not None
            if images.frame(NAMES[0]).number == len(seen):
                seen.append({name: images.raw(name) for name in NAMES})
        robot.finish()
        recorder.stop()
        assert recorder.file is not None
        return Recorded(recorder.file, seen, storage)


@pytest.fixture(scope="module")
def raw(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return record(tmp_path_factory.mktemp("raw"), "raw")


@pytest.fixture(scope="module")
def jpeg(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return record(tmp_path_factory.mktemp("jpeg"), "jpeg")


def messages_of(path: Path) -> dict[str, list[tuple[Any, Any]]]:
    """All messages of a log by topic, decoded by the official readers."""
    found: dict[str, list[tuple[Any, Any]]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message, decoded))
    return found


def nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def test_raw_images_are_those_that_the_robot_saw(raw: Recorded) -> None:
    cameras = raw.cameras
    assert cameras.names == NAMES
    assert len(cameras) == len(raw.seen) >= STEPS // EVERY
    for images, seen in zip(cameras, raw.seen, strict=True):
        for name in NAMES:
            np.testing.assert_array_equal(images.raw(name), seen[name])
            assert images.recorded(name) == ("bayer_rggb8", seen[name].tobytes())
            np.testing.assert_array_equal(
                images[name], trifinger.cameras.to_rgb(seen[name], "bayer_rggb8")
            )


def test_pickles_of_images_are_the_same_images(raw: Recorded) -> None:
    images = raw.cameras.get_latest_at(STEPS // 2)
    assert images is not None
    same, cameras = pickle.loads(pickle.dumps((images, raw.cameras)))  # noqa: S301
    assert (same.index, cameras.names) == (images.index, NAMES)
    for name in NAMES:
        assert np.array_equal(same.raw(name), images.raw(name))


def test_images_of_a_step_are_those_that_had_arrived(raw: Recorded) -> None:
    cameras, session = raw.cameras, raw.session
    for t in (0, 4, 5, 54, 55, 56, STEPS):
        images = cameras.get_latest_at(t)
        assert images is not None
        stamp = images.element["stamp"]
        assert stamp["arrival_index"] <= t
        newer = [one for one in cameras if one.index == images.index + 1]
        assert all(one.element["stamp"]["arrival_index"] > t for one in newer)
        # The time is that of the step of the capture.
        since = images.time_of("camera180") - session.times[0]
        assert since == np.timedelta64(int(stamp["capture_index"]) * 1_000_000, "ns")
        assert images.frame("camera180").exposure > 0


def test_the_official_reader_has_the_images(jpeg: Recorded) -> None:
    messages = messages_of(jpeg.path)
    cameras = jpeg.cameras
    for name in NAMES:
        found = messages[f"/sim/{name}/image"]
        assert len(found) == len(cameras)
        for (message, decoded), images, seen in zip(found, cameras, jpeg.seen, strict=True):
            assert decoded.format == "jpeg"
            assert decoded.header.frame_id == f"sim/{name}"
            assert nanoseconds(decoded.header.stamp) == message.log_time
            assert np.datetime64(message.log_time, "ns") == images.time_of(name)
            picture = np.asarray(Image.open(io.BytesIO(bytes(decoded.data))))
            np.testing.assert_array_equal(picture, images[name])
            expected = trifinger.cameras.to_rgb(seen[name], "bayer_rggb8").astype(float)
            assert np.abs(picture - expected).mean() < 4
            assert images.file(name) == (".jpg", bytes(decoded.data))


def test_the_official_reader_has_raw_images(raw: Recorded) -> None:
    messages = messages_of(raw.path)
    for name in NAMES:
        for (_, decoded), seen in zip(messages[f"/sim/{name}/image"], raw.seen, strict=True):
            assert (decoded.height, decoded.width, decoded.step) == (SIZE, SIZE, SIZE)
            assert decoded.encoding == "bayer_rggb8"
            assert bytes(decoded.data) == seen[name].tobytes()


def test_viewers_know_the_cameras(jpeg: Recorded) -> None:
    messages = messages_of(jpeg.path)
    text = jpeg.cameras.calibration
    path = jpeg.path.with_suffix(".yml")
    path.write_text(text)
    calibration = trifinger.CameraCalibration.read(path)
    frames = {
        frame.child_frame_id: frame
        for _, decoded in messages["/sim/tf_static"]
        for frame in decoded.transforms
    }
    for camera in calibration.cameras:
        ((_, info),) = messages[f"/sim/{camera.name}/camera_info"]
        (fx, fy), (cx, cy) = camera.lens.focal_length, camera.lens.principal_point
        assert (info.width, info.height) == (camera.width, camera.height)
        assert info.distortion_model == "plumb_bob"
        assert list(info.d) == list(camera.lens.distortion)
        assert list(info.k) == [fx, 0, cx, 0, fy, cy, 0, 0, 1]
        assert list(info.r) == [1, 0, 0, 0, 1, 0, 0, 0, 1]
        assert list(info.p) == [fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0]
        frame = frames[f"sim/{camera.name}"]
        assert info.header.frame_id == frame.child_frame_id
        assert frame.header.frame_id == "world"
        place = frame.transform.translation
        np.testing.assert_allclose([place.x, place.y, place.z], camera.pose[:3, 3])
        turn = frame.transform.rotation
        x, y, z, w = turn.x, turn.y, turn.z, turn.w
        forward = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
        np.testing.assert_allclose(forward, camera.pose[:3, 2], atol=1e-12)


def test_without_images_the_log_knows_only_of_them(tmp_path: Path) -> None:
    none = record(tmp_path, "none")
    images = none.cameras.at(2)
    assert images.frame("camera60").state == "good"
    assert not images.has("camera60")
    with pytest.raises(NotInLog, match="lacks the image of camera60 of element 2"):
        images["camera60"]
    with pytest.raises(InvalidArgument, match="no camera 'camera61'"):
        images["camera61"]
    assert not any(topic.endswith("/image") for topic in messages_of(none.path))
    (session,) = info_of(none.path)["sessions"]
    assert session["images"] == []


def test_a_log_without_cameras_says_so(tmp_path: Path) -> None:
    simulation = trifinger.Simulation()
    with simulation.record(tmp_path), simulation.connect() as robot:
        robot.wait_until_time_index(robot.append_desired_action(robot.new_action()))
        robot.finish()
    with pytest.raises(InvalidArgument, match="'sim' has no cameras in this log"):
        LoggedCameras(trifinger.Log(tmp_path).session())


def info_of(path: Path) -> Any:
    words = [PROGRAM, "log", "info", "--json", str(path)]
    return json.loads(subprocess.run(words, capture_output=True, check=True).stdout)


def test_info_counts_images(raw: Recorded) -> None:
    (session,) = info_of(raw.path)["sessions"]
    for name, images in zip(NAMES, session["images"], strict=True):
        assert images == {
            "camera": name,
            "images": len(raw.seen),
            "left_out": 0,
            "bytes": len(raw.seen) * SIZE * SIZE,
            "encoding": "bayer_rggb8",
        }
    text = subprocess.run(
        [PROGRAM, "log", "info", str(raw.path)], capture_output=True, check=True, text=True
    ).stdout
    assert f"{len(raw.seen)} images in bayer_rggb8" in text


def test_what_is_left_out_is_counted(raw: Recorded, tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.mcap"
    data = bytearray(raw.path.read_bytes())
    image = raw.seen[3]["camera300"].tobytes()
    data[data.index(image) + 1000] ^= 1
    damaged.write_bytes(data)
    (session,) = info_of(damaged)["sessions"]
    assert sum(images["left_out"] for images in session["images"]) > 0
    assert session["steps"] == STEPS


@pytest.mark.parametrize("ending", [".png", ".jpg"])
def test_exported_images_are_files(
    ending: str, raw: Recorded, jpeg: Recorded, tmp_path: Path
) -> None:
    recorded = raw if ending == ".png" else jpeg
    assert export.main([str(recorded.path), "--images", str(tmp_path)]) == 0
    with (tmp_path / "images.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 * len(recorded.seen)
    for row, (images, name) in zip(rows, itertools.product(recorded.cameras, NAMES), strict=True):
        assert row["camera"] == name
        assert row["state"] == "good"
        assert int(row["time_index"]) == images.element["stamp"]["arrival_index"]
        assert int(row["number"]) == images.frame(name).number
        assert float(row["exposure"]) == images.frame(name).exposure
        assert np.datetime64(row["time"]) == images.time_of(name)
        path = tmp_path / row["file"]
        assert path.suffix == ending
        picture = np.asarray(Image.open(path))
        expected = images.raw(name) if ending == ".png" else images[name]
        np.testing.assert_array_equal(picture, expected)


def test_a_part_of_the_images_is_exported(raw: Recorded, tmp_path: Path) -> None:
    words = [str(raw.path), "--images", str(tmp_path), "--from", "0.1", "--to", "0.3"]
    assert export.main(words) == 0
    with (tmp_path / "images.csv").open(newline="") as file:
        indices = {int(row["time_index"]) for row in csv.DictReader(file)}
    assert indices == {105, 155, 205, 255}


def test_the_film_shows_images_at_their_time(jpeg: Recorded) -> None:
    session = jpeg.session
    pictures = list(camera_film.frames(session))
    times = np.arange(len(pictures)) / FILM_RATE
    duration = (session.times[-1] - session.times[0]).astype(np.int64) * 1e-9
    assert duration - 1 / FILM_RATE < times[-1] <= duration + 1e-9
    width = camera_film.SIZE
    for time, picture in zip(times, pictures, strict=True):
        assert picture.shape == (width + camera_film.PLOT_HEIGHT, 3 * width, 3)
        newest = [
            images
            for images in jpeg.cameras
            if images.time_of("camera180") <= session.times[0] + np.timedelta64(round(time * 1e9))
        ][-1]
        drawn = Image.fromarray(newest["camera180"]).resize(
            (width, width), Image.Resampling.BILINEAR
        )
        # Below the label.
        np.testing.assert_array_equal(picture[60:width, width : 2 * width], np.asarray(drawn)[60:])
    # The line of time moves to the right.
    columns = [
        np.flatnonzero((picture[width:] == camera_film.CURSOR).all(axis=2).sum(axis=0) > 50)[0]
        for picture in pictures
    ]
    assert all(before < after for before, after in itertools.pairwise(columns))


def test_images_become_files_and_a_film(jpeg: Recorded, tmp_path: Path) -> None:
    assert export.main([str(jpeg.path.parent), "--images", str(tmp_path / "images")]) == 0
    assert len(list((tmp_path / "images").rglob("*.jpg"))) == 3 * len(jpeg.seen)
    assert film.main([str(jpeg.path.parent), "--cameras", "-o", str(tmp_path / "film")]) == 0
    with av.open(str(tmp_path / "film/cameras.mp4")) as made:
        assert made.streams.video[0].width == 3 * camera_film.SIZE


def test_a_lost_camera_is_said(raw: Recorded) -> None:
    images = raw.cameras.at(1)
    element = images.element.copy()
    element["camera60"]["state"] = 3
    lost = type(images)(element, images.index, images._log)
    with pytest.raises(CameraLost, match="camera60 is not there"):
        lost["camera60"]
    assert not lost.has("camera60")


def test_a_log_can_be_the_cameras_of_a_robot(
    raw: Recorded, start_program: StartProgram, tmp_path: Path
) -> None:
    # A simulation without real time would draw its images itself.
    values = {
        "cameras.source": "folder",
        "cameras.folder": tmp_path,
        "cameras.size": SIZE,
        "cameras.rate": 20,
    }
    settings = [word for key, value in values.items() for word in ("--set", f"{key}={value}")]
    start_program("run", "sim_cameras", "--non-real-time", "--no-sensors", *settings).wait_for(
        "waits for a user"
    )
    start_program("cameras", "sim", "--log", str(raw.path))
    with trifinger.connect("sim") as robot:
        cameras = Cameras(robot)
        numbers = set()
        while len(numbers) < 4:
            t = robot.append_desired_action(robot.new_action())
            robot.wait_until_time_index(t)
            images = cameras.get_latest_at(t)
            if images is None:
                continue
            try:
                pixels = {name: images.raw(name) for name in NAMES}
            except HistoryLost:  # this test was interrupted for long
                continue
            number = images.frame("camera60").number
            for name in NAMES:
                np.testing.assert_array_equal(pixels[name], raw.seen[number % len(raw.seen)][name])
            numbers.add(number)
        robot.finish()


def test_a_log_with_other_cameras_is_refused(raw: Recorded, start_program: StartProgram) -> None:
    program = start_program("cameras", "sim_cameras", "--log", str(raw.path))
    status, output = program.process.wait(), program.process.stdout
    assert status == 2
    assert output is not None
    text = output.read()
    assert "has images of camera60 (270 x 270, bayer_rggb8)" in text
    assert "sim has camera60 (540 x 540, bayer_rggb8)" in text


def test_a_log_that_is_the_robot_shows_its_images(
    raw: Recorded, start_program: StartProgram
) -> None:
    start_program("run", str(raw.path)).wait_for("waits for a user")
    with trifinger.connect("sim") as robot:
        cameras = Cameras(robot)
        for _ in range(STEPS - 1):
            t = robot.append_desired_action(robot.new_action())
            robot.wait_until_time_index(t)
            images = cameras.get_latest_at(t)
            assert images is not None
            number = images.frame("camera300").number
            np.testing.assert_array_equal(images.raw("camera300"), raw.seen[number]["camera300"])


@pytest.mark.slow
def test_a_robot_in_real_time_is_recorded(start_program: StartProgram, tmp_path: Path) -> None:
    words = ["--set", "cameras.size=270", "--set", "cameras.rate=5"]
    running = start_program(
        "run", "sim_cameras", *PATIENT, *words, "--record", str(tmp_path), "--images", "raw"
    )
    running.wait_for("deliver images")
    with trifinger.connect("sim") as robot:
        cameras = Cameras(robot)
        seen: dict[int, Any] = {}
        hold = robot.new_action(position=robot.latest_observation().position)
        while len(seen) < 5:
            t = robot.append_desired_action(hold)
            robot.wait_until_time_index(t)
            images = cameras.get_latest_at(t)
            if images is not None:
                with contextlib.suppress(HistoryLost):
                    seen[images.frame("camera60").number] = images.raw("camera60")
        robot.finish()
    running.wait_for("finished at step")
    running.end()
    logged = LoggedCameras(trifinger.Log(tmp_path).session())
    by_number = {images.frame("camera60").number: images for images in logged}
    for number, image in seen.items():
        if by_number[number].has("camera60"):  # a very busy machine may be too slow
            np.testing.assert_array_equal(by_number[number].raw("camera60"), image)
    assert sum(by_number[number].has("camera60") for number in seen) > 0


def test_logs_of_the_original_have_the_images_of_their_steps(
    raw: Recorded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Picture(np.ndarray):  # type: ignore[type-arg]
        """An image that a weak reference can name."""

    taken: list[weakref.ref[Any]] = []
    pixels = LoggedImages.raw

    def raw_of(images: LoggedImages, camera: str) -> Any:
        alive = sum(image() is not None for image in taken)
        assert alive < 2 * len(NAMES)  # of one element, and the one before
        picture = pixels(images, camera).view(Picture)
        taken.append(weakref.ref(picture))
        return picture

    monkeypatch.setattr(LoggedImages, "raw", raw_of)
    arrivals = [int(images.element["stamp"]["arrival_index"]) for images in raw.cameras]
    for first, last in ((None, None), (100, 300), (None, 120), (arrivals[2], arrivals[4])):
        _, path = original.export(raw.session, tmp_path, first, last)
        expected = [
            seen
            for seen, arrival, following in zip(
                raw.seen, arrivals, [*arrivals[1:], STEPS + 1], strict=True
            )
            if following > (first or 0) and arrival < (last or STEPS + 1)
        ]
        entries = list(original.read_camera_log(path, has_object=True))  # sim_cameras has a cube
        assert len(entries) == len(expected)
        for entry, seen in zip(entries, expected, strict=True):
            for image, name in zip(entry.images, NAMES, strict=True):
                np.testing.assert_array_equal(image, seen[name])
    assert len(taken) > 3 * len(NAMES)
