# SPDX-License-Identifier: BSD-3-Clause
"""Cameras of the original stack, on top of this project's own."""

from trifinger_cameras import (
    py_camera_types as camera,
    py_camera_types as py_camera_types,
    py_tricamera_types as py_tricamera_types,
    py_tricamera_types as tricamera,
    utils as utils,
)

CAMERA_NAMES = ("camera60", "camera180", "camera300")

__all__ = [
    "CAMERA_NAMES",
    "camera",
    "py_camera_types",
    "py_tricamera_types",
    "tricamera",
    "utils",
]
