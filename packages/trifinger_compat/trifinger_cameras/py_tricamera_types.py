# SPDX-License-Identifier: BSD-3-Clause
"""The three cameras of the platform."""

from trifinger_compat.camera_backends import (
    CameraBackend as Backend,
    CameraLogger as Logger,
    PyBulletTriCameraDriver as PyBulletTriCameraDriver,
    SingleProcessCameras as SingleProcessData,
    TriCameraDriver as TriCameraDriver,
)
from trifinger_compat.camera_info import TriCameraInfo as TriCameraInfo
from trifinger_compat.camera_series import (
    LogReaderBase as LogReader,
    RunningCameras as MultiProcessData,
    TriCameraFrontend as Frontend,
)
from trifinger_simulation.trifinger_platform import TriCameraObservation as TriCameraObservation

BaseData = SingleProcessData
TriCameraLogger = Logger

__all__ = [
    "Backend",
    "BaseData",
    "Frontend",
    "LogReader",
    "Logger",
    "MultiProcessData",
    "PyBulletTriCameraDriver",
    "SingleProcessData",
    "TriCameraDriver",
    "TriCameraInfo",
    "TriCameraLogger",
    "TriCameraObservation",
]
