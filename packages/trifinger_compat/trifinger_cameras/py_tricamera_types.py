# SPDX-License-Identifier: BSD-3-Clause
"""The three cameras of the platform."""

from trifinger_compat import camera_backends as _backends, camera_series as _series
from trifinger_compat.camera_info import TriCameraInfo as TriCameraInfo
from trifinger_simulation.trifinger_platform import TriCameraObservation as TriCameraObservation

Backend = _backends.CameraBackend
BaseData = _backends.SingleProcessCameras
Frontend = _series.TriCameraFrontend
Logger = _backends.CameraLogger
LogReader = _series.LogReaderBase
MultiProcessData = _series.RunningCameras
PyBulletTriCameraDriver = _backends.PyBulletTriCameraDriver
SingleProcessData = _backends.SingleProcessCameras
TriCameraDriver = _backends.TriCameraDriver
TriCameraLogger = _backends.CameraLogger
