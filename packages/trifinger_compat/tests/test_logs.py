# SPDX-License-Identifier: BSD-3-Clause
"""Log files of the original, byte by byte, and what our programs make of our logs."""

import gzip
import os
import pickle
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import robot_fingers
import robot_interfaces
import trifinger
from backend import running
from hypothesis import given, strategies as st
from trifinger.commands import export
from trifinger.log import original
from trifinger_cameras.py_tricamera_types import LogReader as ImagesReader
from trifinger_compat import camera_hdf5, robot_data
from trifinger_object_tracking.py_tricamera_types import LogReader as ObjectReader


def x87(value: float) -> bytes:
    """A long double of x86, from its definition."""
    mantissa, exponent = np.frexp(value)
    whole = int(mantissa * 2**64)
    return struct.pack("<QH6x", whole, exponent - 1 + 16383 if value else 0)


def entry(index: int, stamp: float, **changes: Any) -> bytes:
    numbers = np.arange(102.0) + 1000 * index
    head = struct.pack("<q", index) + x87(stamp) + struct.pack("<Ii", 3, changes.get("error", 0))
    return head + b"oh no".ljust(64, b"\0") + numbers.astype("<f8").tobytes()


@pytest.mark.parametrize("is_compressed", [True, False])
def test_a_robot_log_is_read_as_the_sheet_describes_it(tmp_path: Path, is_compressed: bool) -> None:
    data = struct.pack("<IQ", 2, 2) + entry(5, 1234.5) + entry(6, 1234.501, error=1)
    assert len(entry(0, 0.0)) == 912
    path = tmp_path / "robot_data.dat"
    path.write_bytes(gzip.compress(data) if is_compressed else data)
    log = robot_interfaces.trifinger.BinaryLogReader(path)
    assert [each.timeindex for each in log.data] == [5, 6]
    assert [each.timestamp for each in log.data] == [1234.5, 1234.501]
    first, second = log.data
    assert first.observation.position == pytest.approx(5000 + np.arange(9))
    assert first.observation.tip_force == pytest.approx(5000 + np.arange(27, 30))
    assert first.desired_action.torque == pytest.approx(5000 + np.arange(30, 39))
    assert first.applied_action.position_kd == pytest.approx(5000 + np.arange(93, 102))
    assert first.status.action_repetitions == 3
    assert second.status.error_status == 1
    assert second.status.get_error_message() == "oh no"


@given(st.lists(st.floats(0, 4e9), min_size=1, max_size=9))
def test_time_stamps_survive_exactly(seconds: list[float]) -> None:
    rows = np.zeros(len(seconds), dtype=original.row_type(9, 3))
    values = np.array(seconds)
    original.set_times(rows, values)
    assert np.array_equal(original.times_of(rows), values)
    assert [row["stamp"].tobytes()[:10] for row in rows] == [x87(value)[:10] for value in seconds]


def test_damaged_robot_logs_are_errors(tmp_path: Path) -> None:
    path = tmp_path / "log"
    reader = robot_interfaces.trifinger.BinaryLogReader
    with pytest.raises(RuntimeError, match="cannot be opened"):
        reader(path)
    good = struct.pack("<IQ", 2, 1) + entry(0, 1.0)
    for bad, text in (
        (struct.pack("<IQ", 1, 0), "version 1"),
        (good[:-1], "cut off"),
        (good + b"\0", "longer"),
        (gzip.compress(good)[:-20], r"damaged|cut off"),
    ):
        path.write_bytes(bad)
        with pytest.raises(RuntimeError, match=text):
            reader(path)


def image_bytes(image: Any, seconds: float) -> bytes:
    return struct.pack("<iiiB", *image.shape, 0, 1) + image.tobytes() + struct.pack("<d", seconds)


def spoiled(good: bytes) -> Iterator[bytes]:
    """A file with each single bit flipped, and cut off everywhere."""
    for i in range(len(good)):
        yield good[:i]
        for bit in range(8):
            changed = bytearray(good)
            changed[i] ^= 1 << bit
            yield bytes(changed)


def robot_log() -> bytes:
    return struct.pack("<IQ", 2, 1) + entry(5, 1234.5, error=1)


def camera_log(has_object: bool) -> bytes:
    image = np.arange(12, dtype=np.uint8).reshape(3, 4)
    data = struct.pack("<IQd", 1, 1, 5000.0) + 3 * image_bytes(image, 5.0)
    return data + (np.arange(16.0).tobytes() if has_object else b"")


@pytest.mark.slow
@pytest.mark.parametrize("is_compressed", [True, False])
@pytest.mark.parametrize(
    ("data", "reader"),
    [
        (robot_log(), robot_interfaces.trifinger.BinaryLogReader),
        (camera_log(False), ImagesReader),
        (camera_log(True), ObjectReader),
    ],
)
def test_damage_is_an_error_or_changes_nothing(
    data: bytes, reader: Any, is_compressed: bool, tmp_path: Path
) -> None:
    def content(log: Any) -> bytes:
        return pickle.dumps(vars(log))

    path = tmp_path / "log"
    good = gzip.compress(data, mtime=0) if is_compressed else data
    path.write_bytes(good)
    expected = content(reader(path))
    errors = 0
    for bad in spoiled(good):
        path.write_bytes(bad)
        try:
            read = reader(path)
        except RuntimeError:
            errors += 1
        else:
            # Only compressed files have a sum that tells.
            assert not is_compressed or content(read) == expected
    assert errors > len(good)  # each cut, and some bits


@pytest.mark.parametrize("count", [2, 2**40, 2**63, 2**64 - 1])
def test_a_damaged_count_needs_no_memory(count: int, tmp_path: Path) -> None:
    path = tmp_path / "log"
    for version, reader in ((2, robot_interfaces.trifinger.BinaryLogReader), (1, ImagesReader)):
        good = robot_log() if version == 2 else camera_log(False)
        path.write_bytes(struct.pack("<IQ", version, count) + good[12:])
        with pytest.raises(RuntimeError, match="cut off"):
            reader(path)
    size = struct.pack("<iiiB", 65535, 65535, 0, 1)
    path.write_bytes(struct.pack("<IQd", 1, 1, 0.0) + size)
    with pytest.raises(RuntimeError, match="cut off"):
        ImagesReader(path)


def test_a_log_that_is_not_complete_never_gets_its_name(tmp_path: Path) -> None:
    path = tmp_path / "logs" / "camera_data.dat"
    path.parent.mkdir()
    element = original.CameraEntry(0.0, [np.zeros((2, 2), dtype=np.uint8)] * 3, [0.0] * 3)

    def entries(count: int) -> Iterator[original.CameraEntry]:
        for _ in range(count):
            yield element
        raise OSError("no space")

    with pytest.raises(OSError, match="no space"):
        original.write_camera_log(path, 3, entries(2))
    assert list(path.parent.iterdir()) == []
    original.write_camera_log(path, 1, [element])
    good = path.read_bytes()
    with pytest.raises(RuntimeError, match="should have 2 elements, would have 1"):
        original.write_camera_log(path, 2, [element])
    assert list(path.parent.iterdir()) == [path]
    assert path.read_bytes() == good
    link = tmp_path / "link"
    link.symlink_to(path)
    original.write_camera_log(link, 2, [element] * 2)
    assert link.is_symlink()
    assert len(ImagesReader(path).data) == 2
    # What is no file, as /dev/null, is written and not replaced.
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pipe.open("r+b", buffering=0) as reading:
        original.write_camera_log(pipe, 2, [element] * 2)
        assert pipe.is_fifo()
        assert gzip.decompress(reading.read(1 << 16)) == gzip.decompress(path.read_bytes())


@pytest.mark.parametrize("has_object", [True, False])
def test_a_camera_log_is_read_and_written_as_the_sheet_describes_it(
    tmp_path: Path, has_object: bool
) -> None:
    images = [np.arange(12, dtype=np.uint8).reshape(3, 4) + i for i in range(3)]
    poses = np.arange(16.0)
    data = struct.pack("<IQ", 1, 2)
    for i in range(2):
        data += struct.pack("<d", 5000.0 + i)
        data += b"".join(image_bytes(image, 5.0 + i) for image in images)
        data += poses.astype("<f8").tobytes() if has_object else b""
    path = tmp_path / "camera_data.dat"
    path.write_bytes(gzip.compress(data))
    log: Any = ObjectReader(path) if has_object else ImagesReader(path)
    assert log.timestamps == [5000.0, 5001.0]
    assert np.array_equal(log.data[1].cameras[2].image, images[2])
    assert log.data[1].cameras[0].timestamp == 6.0
    if has_object:
        assert list(log.data[0].object_pose.position) == [0, 1, 2]
        assert list(log.data[0].filtered_object_pose.orientation) == [11, 12, 13, 14]
        assert log.data[0].object_pose.confidence == 7
    again = tmp_path / "again.dat"
    entries = list(original.read_camera_log(path, has_object=has_object))
    original.write_camera_log(again, len(entries), entries)
    assert gzip.decompress(again.read_bytes()) == data
    with pytest.raises(RuntimeError, match=r"pose|cut off"):
        (ImagesReader if has_object else ObjectReader)(path)


def test_a_camera_log_in_hdf5_has_the_layout_of_the_sheet(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    images = [np.arange(12, dtype=np.uint8).reshape(3, 4) + i for i in range(3)]
    path = tmp_path / "camera_data.hdf5"
    entries = [original.CameraEntry(1000.0 * i, images, [i, i + 0.1, i + 0.2], []) for i in (1, 2)]
    camera_hdf5.write(path, entries, ("camera60", "camera180", "camera300"))
    with h5py.File(path) as file:
        assert dict(file.attrs) == {
            "magic": 0x3CDA7A00,
            "format_version": 2,
            "format_version_minor": 1,
            "num_cameras": 3,
            "image_width": 4,
            "image_height": 3,
        }
        assert file["images"].shape == (2, 3, 3, 4)
        assert file["timestamps"].shape == (2, 3)
        assert list(file["sensor_data_timestamps"]) == [1000.0, 2000.0]
        assert sorted(file["camera_info"]) == ["camera180", "camera300", "camera60"]
    log = ImagesReader(path)
    assert log.timestamps == [1000.0, 2000.0]
    assert np.array_equal(log.data[1].cameras[2].image, images[2])
    assert log.data[1].cameras[1].timestamp == 2.1
    with pytest.raises(RuntimeError, match="no poses"):
        ObjectReader(path)
    with h5py.File(path, "a") as file:
        file.attrs["format_version"] = 3
    with pytest.raises(RuntimeError, match="version 3"):
        ImagesReader(path)
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(RuntimeError, match="damaged"):
        ImagesReader(path)
    with pytest.raises(RuntimeError, match="no images"):
        camera_hdf5.write(path, [], ())


@pytest.mark.slow
def test_a_recorded_run_becomes_files_that_a_platform_log_reads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, camera = tmp_path / "robot_data.dat", tmp_path / "camera_data.dat"
    words = ["-a", "250", "--robot-logfile", robot, "--camera-logfile", camera, "--render-images"]
    positions, poses = [], []
    with running(*words, ends=True) as name:
        monkeypatch.setenv(robot_data.VARIABLE, name)
        frontend = robot_fingers.TriFingerPlatformWithObjectFrontend()
        for i in range(250):
            action = frontend.Action(position=[0, 0.9, -1.7 + 0.001 * i] * 3)
            t = frontend.append_desired_action(action)
            positions.append(frontend.get_robot_observation(t).position)
            seen = frontend.get_camera_observation(t)
            poses.append(seen.object_pose.position)
            assert seen.cameras[0].image.shape == (540, 540)
    log = robot_fingers.TriFingerPlatformWithObjectLog(robot, camera)
    assert (log.get_first_timeindex(), log.get_last_timeindex()) == (0, 249)
    for t, position in enumerate(positions):
        assert np.array_equal(log.get_robot_observation(t).position, position)
    assert log.get_desired_action(100).position[2] == pytest.approx(-1.6)
    mapping = log.get_map_robot_to_camera_index()
    assert mapping == sorted(mapping)
    known = [t for t in range(250) if mapping[t] >= 0]
    seen = log.get_camera_observation(known[-1])
    assert seen.cameras[1].image.shape == (540, 540)
    assert seen.object_pose.position == pytest.approx([0, 0, 0.0325], abs=1e-3)
    for wrong in (-1, 250):
        with pytest.raises(IndexError):
            log.get_robot_observation(wrong)
    # Its images are also there without the poses, as programs before 2021 read them.
    assert robot_fingers.TriFingerPlatformLog(robot, camera).get_last_timeindex() == 249


def test_a_log_of_ours_is_exported_to_the_original_format(tmp_path: Path) -> None:
    simulation = trifinger.Simulation("trifinger_pro")
    with simulation.record(tmp_path) as recorder, simulation.connect() as robot:
        for _ in range(40):
            t = robot.append_desired_action(robot.new_action(torque=0.01))
            robot.get_observation(t)
        robot.finish()
    assert recorder.file is not None
    session = trifinger.Log(recorder.file).session()
    (path,) = original.export(session, tmp_path / "run", 10, 30)
    data = robot_interfaces.trifinger.BinaryLogReader(path).data
    assert [each.timeindex for each in data] == list(range(10, 30))
    for each in data:
        logged = session.get_observation(each.timeindex)
        assert np.array_equal(each.observation.position, logged.position)
    steps = np.diff([each.timestamp for each in data])
    assert np.all(steps > 0)
    whole = tmp_path / "whole"
    assert export.main([str(recorder.file), "--format", "original", "-o", str(whole)]) == 0
    (path,) = whole.iterdir()
    assert len(robot_interfaces.trifinger.BinaryLogReader(path).data) >= 40
