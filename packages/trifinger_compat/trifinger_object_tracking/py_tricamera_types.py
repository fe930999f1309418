# SPDX-License-Identifier: BSD-3-Clause
"""The three cameras of the platform, and where the object is in their images."""

from trifinger_compat import camera_backends as _backends, camera_series as _series
from trifinger_compat.camera_info import TriCameraInfo as TriCameraInfo
from trifinger_simulation.trifinger_platform import (
    ObjectPose as ObjectPose,
    TriCameraObjectObservation as TriCameraObjectObservation,
)

from trifinger_object_tracking.cube_visualizer import CubeVisualizer as CubeVisualizer

Backend = _backends.CameraBackend
BaseData = _backends.SingleProcessCameras
Logger = _backends.CameraObjectLogger
MultiProcessData = _series.RunningCameras
PyBulletTriCameraObjectTrackerDriver = _backends.PyBulletTriCameraObjectTrackerDriver
SingleProcessData = _backends.SingleProcessCameras
TriCameraObjectTrackerDriver = _backends.TriCameraObjectTrackerDriver


class Frontend(_series.TriCameraFrontend):
    """Reads images and poses of a running robot by their own numbers."""

    has_object = True


class LogReader(_series.LogReaderBase):
    """Reads a log of three cameras with poses of the object."""

    has_object = True
