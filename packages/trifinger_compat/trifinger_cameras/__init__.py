# SPDX-License-Identifier: BSD-3-Clause
"""Cameras of the original stack, on top of this project's own."""

from trifinger_cameras import (
    py_camera_types as py_camera_types,
    py_tricamera_types as py_tricamera_types,
    utils as utils,
)

CAMERA_NAMES = ("camera60", "camera180", "camera300")

camera = py_camera_types
tricamera = py_tricamera_types
