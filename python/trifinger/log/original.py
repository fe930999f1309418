# SPDX-License-Identifier: BSD-3-Clause
"""The log files of the original stack: `robot_data.dat` and `camera_data.dat`.

Robot logs have a row for each step, with the types of `row_type`. Their time stamps are in the
format of x86's `long double`, which is decoded here, so that files can be read on every machine.
"""

import gzip
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from trifinger._trifinger import LoggedSession
from trifinger.arrays import Array
from trifinger.errors import Error
from trifinger.log.images import LoggedCameras
from trifinger.whole_file import whole_file

ROBOT_VERSION = 2
CAMERA_VERSION = 1
BLOCK = 1 << 20  # bytes that are read at once
MESSAGE_SIZE = 64  # bytes, with a zero at the end
ACTION_FIELDS = ("torque", "position", "position_kp", "position_kd")
OBSERVATION_FIELDS = ("position", "velocity", "torque", "tip_force")
NEWTONS = 5.0  # of a tip force of 1
OFFSET = 0.05  # of a tip that touches nothing
DRIVER_ERROR, BACKEND_ERROR = 1, 2  # of "error_status"

# x86's long double: 64 bits of mantissa, sign and 15 bits of exponent, 6 bytes without meaning.
_STAMP = np.dtype([("mantissa", "<u8"), ("exponent", "<u2"), ("nothing", "V6")])
_BIAS = 16383


def row_type(joints: int, tips: int) -> "np.dtype[np.void]":
    """The row of a robot log, without padding."""
    sizes = dict.fromkeys(OBSERVATION_FIELDS, joints) | {"tip_force": tips}
    fields: list[tuple[Any, ...]] = [
        ("time_index", "<i8"),
        ("stamp", _STAMP),
        ("action_repetitions", "<u4"),
        ("error_status", "<i4"),
        ("message", f"S{MESSAGE_SIZE}"),
    ]
    fields += [(f"observation_{name}", "<f8", (size,)) for name, size in sizes.items() if size]
    for series in ("desired_action", "applied_action"):
        fields += [(f"{series}_{name}", "<f8", (joints,)) for name in ACTION_FIELDS]
    return np.dtype(fields)


def set_times(rows: NDArray[np.void], seconds: Array) -> None:
    """Writes the time stamps of rows, which are not negative [s]."""
    fraction, exponent = np.frexp(seconds)
    # 53 of the 64 bits come from a double; the first one is always set.
    rows["stamp"]["mantissa"] = (fraction * 2.0**53).astype(np.uint64) << np.uint64(11)
    rows["stamp"]["exponent"] = np.where(seconds > 0, exponent - 1 + _BIAS, 0)


def error_status_of(fault_codes: NDArray[Any]) -> NDArray[np.int32]:
    """The numbers that the original has for fault codes: 0 for clean ends."""
    is_of_driver = np.isin(fault_codes, (21, 22))  # kDriver, kDriverHangs
    is_fault = np.asarray(fault_codes) >= 16
    status: NDArray[np.int32] = np.where(is_of_driver, DRIVER_ERROR, BACKEND_ERROR * is_fault)
    return status.astype(np.int32)


def tip_forces_of(newtons: Array) -> Array:
    """Tip forces as the original has them, from 0 to 1."""
    forces: Array = np.clip(np.asarray(newtons) / NEWTONS + OFFSET, 0, 1)
    return forces


def times_of(rows: NDArray[np.void]) -> Array:
    """The time stamps of rows [s]."""
    mantissa = rows["stamp"]["mantissa"].astype(np.float64)
    exponent = (rows["stamp"]["exponent"] & np.uint16(0x7FFF)).astype(np.int32)
    sign = np.where(rows["stamp"]["exponent"] & np.uint16(0x8000), -1.0, 1.0)
    with np.errstate(over="ignore"):  # a damaged one may be infinite here
        seconds: Array = sign * np.ldexp(mantissa, exponent - _BIAS - 63)
    return seconds


def _open(path: Path) -> BinaryIO:
    """Opens a file, compressed or not; raises Error if there is none."""
    try:
        with path.open("rb") as file:
            is_compressed = file.read(2) == b"\x1f\x8b"
        return cast(BinaryIO, gzip.open(path, "rb") if is_compressed else path.open("rb"))
    except OSError as error:
        raise Error(f"the log {path} cannot be opened: {error.strerror}") from error


def _read_some(file: IO[bytes], size: int, path: Path) -> bytes:
    try:
        return file.read(size)
    except (OSError, EOFError, zlib.error) as error:
        raise Error(f"the log {path} is damaged: {error}") from error


def _read(file: IO[bytes], size: int, path: Path) -> bytearray:
    """So many bytes. A size that is damaged needs no more memory than the file has data."""
    data = bytearray()
    while len(data) < size:
        block = _read_some(file, min(size - len(data), BLOCK), path)
        if not block:
            raise Error(f"the log {path} is cut off")
        data += block
    return data


def _read_count(file: IO[bytes], version: int, path: Path) -> int:
    found, count = struct.unpack("<IQ", _read(file, 12, path))
    if found != version:
        raise Error(f"the log {path} has format version {found}, must have {version}")
    return int(count)


def read_robot_log(path: str | Path, joints: int, tips: int) -> NDArray[np.void]:
    """The rows of a robot log; raises Error if it is none of such a robot."""
    path = Path(path)
    row = row_type(joints, tips)
    with _open(path) as file:
        count = _read_count(file, ROBOT_VERSION, path)
        data = _read(file, count * row.itemsize, path)
        if _read_some(file, 1, path):
            raise Error(f"the log {path} is longer than one of a robot with {joints} joints")
    return np.frombuffer(data, dtype=row)


@contextmanager
def _written(path: str | Path, level: int) -> Iterator[gzip.GzipFile]:
    """A compressed file that is written; one that is not complete never gets the final name."""
    path = Path(path)
    with (
        whole_file(path) as part,
        part.open("wb") as raw,
        gzip.GzipFile(path.name, "wb", level, raw) as file,
    ):
        yield file


def write_robot_log(path: str | Path, rows: NDArray[np.void]) -> None:
    """Writes a robot log, compressed."""
    with _written(path, level=6) as file:
        file.write(struct.pack("<IQ", ROBOT_VERSION, len(rows)))
        file.write(np.ascontiguousarray(rows).tobytes())


def write_robot_csv(path: str | Path, rows: NDArray[np.void], *, is_compressed: bool) -> None:
    """Writes a robot log as text with a header, separated by spaces."""
    order = ["observation", "applied_action", "desired_action"]
    fields = rows.dtype.names or ()
    names = [name for kind in order for name in fields if name.startswith(kind)]
    header = ["#time_index", "timestamp", "status_action_repetitions", "status_error_status"]
    for name in names:
        size = rows.dtype[name].shape[0]
        header += [name] if size == 1 else [f"{name}_{i}" for i in range(size)]
    with whole_file(path) as part, _open_text(part, is_compressed) as file:
        file.write(" ".join(header) + "\n")
        for row, stamp in zip(rows, times_of(rows), strict=True):
            words = [str(row["time_index"]), repr(float(stamp))]
            words += [str(row["action_repetitions"]), str(row["error_status"])]
            words += [repr(float(number)) for name in names for number in row[name]]
            file.write(" ".join(words) + "\n")


def _open_text(path: Path, is_compressed: bool) -> IO[str]:
    return cast(IO[str], gzip.open(path, "wt") if is_compressed else path.open("w"))


@dataclass
class CameraEntry:
    """An element of a camera log."""

    stamp: float
    """When it was written, since 1970 [ms]."""
    images: list[NDArray[np.uint8]]
    """Height x width, as the camera delivers them."""
    times: list[float]
    """When each image was taken, since 1970 [s]."""
    poses: list[Array] = field(default_factory=list)
    """None, or the pose of the object and the filtered one: x, y, z [m], quaternion x, y, z, w,
    confidence."""


_IMAGE_HEAD = struct.Struct("<iii?")


def read_camera_log(path: str | Path, *, has_object: bool) -> Iterator[CameraEntry]:
    """The elements of a log of three cameras, one by one; raises Error if it is none."""
    path = Path(path)
    with _open(path) as file:
        for _ in range(_read_count(file, CAMERA_VERSION, path)):
            yield _read_entry(file, path, has_object)
        if _read_some(file, 1, path):
            raise Error(
                f"the log {path} has more data than expected: it was written "
                f"{'without' if has_object else 'with'} poses of an object"
            )


def _read_entry(file: IO[bytes], path: Path, has_object: bool) -> CameraEntry:
    (stamp,) = struct.unpack("<d", _read(file, 8, path))
    entry = CameraEntry(stamp, [], [])
    for _ in range(3):
        rows, columns, kind, _ = _IMAGE_HEAD.unpack(_read(file, _IMAGE_HEAD.size, path))
        channels = (kind >> 3) + 1
        is_kind = 0 <= kind < 1 << 12 and kind & 7 == 0
        if not (is_kind and 0 <= rows < 1 << 16 and 0 <= columns < 1 << 16):
            # It is read at a wrong place, or of a type that no camera has.
            raise Error(
                f"the log {path} cannot be read: it has no image where one must be; perhaps it was "
                f"written {'without' if has_object else 'with'} poses of an object"
            )
        pixels = np.frombuffer(_read(file, rows * columns * channels, path), dtype=np.uint8)
        shape = (rows, columns) if channels == 1 else (rows, columns, channels)
        entry.images.append(pixels.reshape(shape))
        entry.times.append(struct.unpack("<d", _read(file, 8, path))[0])
    if has_object:
        numbers = np.frombuffer(_read(file, 128, path), dtype="<f8").astype(float)
        entry.poses = [numbers[:8], numbers[8:]]
    return entry


def write_camera_log(path: str | Path, count: int, entries: Iterable[CameraEntry]) -> None:
    """Writes a log of `count` elements, compressed."""
    written = 0
    with _written(path, level=1) as file:
        file.write(struct.pack("<IQ", CAMERA_VERSION, count))
        for entry in entries:
            file.write(struct.pack("<d", entry.stamp))
            for image, time in zip(entry.images, entry.times, strict=True):
                channels = 1 if image.ndim == 2 else image.shape[2]
                file.write(_IMAGE_HEAD.pack(*image.shape[:2], (channels - 1) << 3, True))
                file.write(np.ascontiguousarray(image).tobytes())
                file.write(struct.pack("<d", time))
            for pose in entry.poses:
                file.write(np.asarray(pose, dtype="<f8").tobytes())
            written += 1
        if written != count:
            raise Error(f"{path} should have {count} elements, would have {written}")


def has_cameras(session: LoggedSession) -> bool:
    """True if the session has what cameras saw."""
    return any(companion.name.endswith(".cameras") for companion in session.companions)


def export(
    session: LoggedSession, folder: Path, first: int | None = None, last: int | None = None
) -> list[Path]:
    """Writes a session to `robot_data.dat` and, if it has cameras, `camera_data.dat`.

    Both have what programs could see in the steps from `first` to before `last`. Returns the files.
    Tip forces become numbers from 0 to 1, as the original has them.
    """
    folder.mkdir(parents=True, exist_ok=True)
    robot, camera = folder / "robot_data.dat", folder / "camera_data.dat"
    write_robot_log(robot, robot_rows(session, first, last))
    if not has_cameras(session):
        return [robot]
    export_cameras(session, camera, first, last)
    return [robot, camera]


def export_cameras(
    session: LoggedSession, path: Path, first: int | None = None, last: int | None = None
) -> None:
    """Writes the images that a program could see in the steps from `first` to before `last`.

    These are also those that were the newest at `first`. Only one element is in memory at a time.
    """
    cameras = LoggedCameras(session)
    newest = None if first is None else cameras.get_latest_at(first)
    wanted = [
        images.index
        for images in cameras
        if (newest is None or images.index >= newest.index)
        and (last is None or images.element["stamp"]["arrival_index"] < last)
        and all(images.has(name) for name in cameras.names)
    ]
    write_camera_log(path, len(wanted), _camera_entries(session, cameras, wanted))


def _given(series: NDArray[Any] | None) -> NDArray[Any]:
    if series is None:  # only those that nobody asked for
        raise Error("the log lacks a series")
    return series


def robot_rows(
    session: LoggedSession, first: int | None = None, last: int | None = None
) -> NDArray[np.void]:
    """The whole steps of a session as rows of a robot log."""
    steps = session.read(first, last)
    observations, statuses = _given(steps.observations), _given(steps.statuses)
    series = {
        "desired_action": _given(steps.desired_actions),
        "applied_action": _given(steps.applied_actions),
    }
    joints = observations["position"].shape[1]
    names = observations.dtype.names or ()
    tips = observations["tip_force"].shape[1] if "tip_force" in names else 0
    rows = np.zeros(len(steps.time_index), dtype=row_type(joints, tips))
    rows["time_index"] = steps.time_index
    set_times(rows, steps.times.astype("datetime64[ns]").astype(np.int64) * 1e-9)
    rows["action_repetitions"] = statuses["action_repeats"]
    rows["error_status"] = error_status_of(statuses["fault_code"])
    for name in OBSERVATION_FIELDS[:3]:
        rows[f"observation_{name}"] = observations[name]
    if tips:
        rows["observation_tip_force"] = tip_forces_of(observations["tip_force"])
    for kind, actions in series.items():
        for name in ACTION_FIELDS:
            rows[f"{kind}_{name}"] = actions[name]
    return rows


def _arrivals(companion: LoggedSession) -> NDArray[np.int64]:
    """When the elements arrived at the robot, since 1970 [ns]."""
    measured = companion.times.astype("datetime64[ns]").astype(np.int64)
    stamps = companion.observations["stamp"]
    arrivals: NDArray[np.int64] = measured + stamps["arrival_time"] - stamps["capture_time"]
    return arrivals


def _camera_entries(
    session: LoggedSession, cameras: LoggedCameras, wanted: Iterable[int]
) -> Iterator[CameraEntry]:
    objects = next((each for each in session.companions if each.name.endswith(".object")), None)
    poses = _poses(objects) if objects is not None else None
    arrivals = _arrivals(cameras.companion).tolist()
    by_index = dict(zip(cameras.companion.time_index.tolist(), arrivals, strict=True))
    for index in wanted:
        images = cameras.at(index)
        pixels = [images.raw(name) for name in cameras.names]
        times = [float(images.time_of(name).astype(np.int64)) * 1e-9 for name in cameras.names]
        arrival = by_index[index]
        pose = [] if poses is None else [poses(arrival)] * 2
        yield CameraEntry(arrival * 1e-6, pixels, times, pose)


def _poses(objects: LoggedSession) -> Callable[[int], Array]:
    """The pose that was known at a time: x, y, z, quaternion x, y, z, w, confidence."""
    elements = objects.observations
    times = _arrivals(objects)
    name = next(name for name in elements.dtype.names or () if name != "stamp")

    def pose_at(time: int) -> Array:
        i = int(np.searchsorted(times, time, side="right")) - 1
        if i < 0:
            return np.zeros(8)
        w, x, y, z = elements[name]["orientation"][i]
        return np.array([*elements[name]["position"][i], x, y, z, w, 1.0])

    return pose_at
