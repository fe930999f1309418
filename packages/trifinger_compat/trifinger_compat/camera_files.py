# SPDX-License-Identifier: BSD-3-Clause
"""Calibration files of the original's cameras: `camera60_cropped.yml` and so on."""

import os
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import trifinger

from trifinger_compat.types import Array
from trifinger_compat.urdf import write_text

NAMES = ("camera60", "camera180", "camera300")
IDS = (60, 180, 300)
MATRICES = ("camera_matrix", "distortion_coefficients", "tf_world_to_camera")

# For worlds of PyBullet; the original's has a mesh with colours.
_CUBE = """\
<?xml version="1.0"?>
<robot name="cube_v2">
  <link name="cube_v2">
    <inertial>
      <mass value="0.094"/>
      <inertia ixx="6.62e-5" iyy="6.62e-5" izz="6.62e-5" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual><geometry><box size="0.065 0.065 0.065"/></geometry></visual>
    <collision><geometry><box size="0.065 0.065 0.065"/></geometry></collision>
  </link>
</robot>
"""


@cache
def figures() -> trifinger.CameraCalibration:
    """The cameras of the robot's model."""
    return calibration(trifinger.CameraRenderer("trifinger_pro").calibration)


def calibration(text: str) -> trifinger.CameraCalibration:
    """The cameras of the text of a calibration."""
    with tempfile.NamedTemporaryFile("w", suffix=".yml") as file:
        file.write(text)
        file.flush()
        return trifinger.CameraCalibration.read(file.name)


@cache
def data_folder() -> Path:
    """A folder with `camera_params`, the calibrations of the model's cameras, and `cube_v2`."""
    from trifinger.original_cameras import SUFFIXES, text_of

    cache_home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = cache_home / "trifinger-compat" / trifinger.__version__ / "data"
    parameters = folder / "camera_params"
    write_text(folder / "cube_v2" / "cube_v2.urdf", _CUBE)
    for each in figures().cameras:
        for suffix in SUFFIXES:
            write_text(parameters / f"{each.name}{suffix}.yml", text_of(each, suffix))
    return folder


def matrix_text(name: str, matrix: Array) -> str:
    """A matrix in a file."""
    rows, columns = np.atleast_2d(matrix).shape
    data = ", ".join(repr(float(number)) for number in np.ravel(matrix))
    return f"{name}:\n  rows: {rows}\n  cols: {columns}\n  data: [{data}]\n"
