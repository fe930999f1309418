# SPDX-License-Identifier: BSD-3-Clause
"""Logs of three cameras in HDF5, version 2.1 of the original. They need h5py."""

from pathlib import Path
from typing import Any

import numpy as np
from trifinger.errors import Error
from trifinger.log.original import CameraEntry
from trifinger.whole_file import whole_file

MAGIC, VERSION, MINOR_VERSION = 0x3CDA7A00, 2, 1
_SIGNATURE = b"\x89HDF\r\n\x1a\n"


def is_hdf5(path: str | Path) -> bool:
    """True if a file begins as HDF5 does; False also if there is none."""
    try:
        with Path(path).open("rb") as file:
            return file.read(len(_SIGNATURE)) == _SIGNATURE
    except OSError:
        return False


def write(path: str | Path, entries: list[CameraEntry], names: tuple[str, ...]) -> None:
    """Writes images and their times; raises RuntimeError if there are none."""
    import h5py

    if not entries:
        raise Error(f"there are no images to write to {path}")
    images = np.array([entry.images for entry in entries])
    with whole_file(path) as part, h5py.File(part, "w") as file:
        file.attrs["magic"] = np.uint32(MAGIC)
        file.attrs["format_version"] = np.uint32(VERSION)
        file.attrs["format_version_minor"] = np.uint32(MINOR_VERSION)
        file.attrs["num_cameras"] = np.uint32(len(names))
        file.attrs["image_width"] = np.uint32(images.shape[3])
        file.attrs["image_height"] = np.uint32(images.shape[2])
        file["images"] = images
        file["timestamps"] = np.array([entry.times for entry in entries])
        file["sensor_data_timestamps"] = np.array([entry.stamp for entry in entries])
        for name in names:
            file.create_group(f"camera_info/{name}")


def read(path: str | Path) -> list[CameraEntry]:
    """Reads what write() or the original has written; raises RuntimeError."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            _require_version(path, file.attrs)
            series = [file[name][:] for name in ("sensor_data_timestamps", "images", "timestamps")]
    except (OSError, KeyError) as error:
        raise Error(f"{path} is damaged: {error}") from error
    return [
        CameraEntry(float(stamp), list(images), times.tolist(), [])
        for stamp, images, times in zip(*series, strict=True)
    ]


def _require_version(path: str | Path, attributes: Any) -> None:
    magic, version = attributes["magic"], attributes["format_version"]
    if (magic, version) != (MAGIC, VERSION):
        raise Error(
            f"{path} has magic {magic:#x} and version {version}, must have {MAGIC:#x} and {VERSION}"
        )
