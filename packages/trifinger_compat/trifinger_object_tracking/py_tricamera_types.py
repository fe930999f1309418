# SPDX-License-Identifier: BSD-3-Clause
"""The three cameras of the platform, and where the object is in their images."""

from trifinger_compat.camera_backends import (
    CameraBackend as Backend,
    CameraObjectLogger as Logger,
    PyBulletTriCameraObjectTrackerDriver as PyBulletTriCameraObjectTrackerDriver,
    SingleProcessCameras as SingleProcessData,
    TriCameraObjectTrackerDriver as TriCameraObjectTrackerDriver,
)
from trifinger_compat.camera_info import TriCameraInfo as TriCameraInfo
from trifinger_compat.camera_series import (
    LogReaderBase as _LogReader,
    RunningCameras as MultiProcessData,
    TriCameraFrontend as _Frontend,
)
from trifinger_simulation.trifinger_platform import (
    ObjectPose as ObjectPose,
    TriCameraObjectObservation as TriCameraObjectObservation,
)

from trifinger_object_tracking.cube_visualizer import CubeVisualizer as CubeVisualizer

BaseData = SingleProcessData

__all__ = [
    "Backend",
    "BaseData",
    "CubeVisualizer",
    "Frontend",
    "LogReader",
    "Logger",
    "MultiProcessData",
    "ObjectPose",
    "PyBulletTriCameraObjectTrackerDriver",
    "SingleProcessData",
    "TriCameraInfo",
    "TriCameraObjectObservation",
    "TriCameraObjectTrackerDriver",
]


class Frontend(_Frontend):
    """Reads images and poses of a running robot by their own numbers."""

    has_object = True


class LogReader(_LogReader):
    """Reads a log of three cameras with poses of the object."""

    has_object = True
