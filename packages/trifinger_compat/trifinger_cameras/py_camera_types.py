# SPDX-License-Identifier: BSD-3-Clause
"""A single camera."""

import os
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from trifinger_compat.camera_backends import (
    CameraBackend as Backend,
    CameraLogger as Logger,
    SingleProcessCameras as SingleProcessData,
    _RealDriver,
)
from trifinger_compat.camera_info import (
    CameraInfo as CameraInfo,
    CameraParameters as CameraParameters,
)
from trifinger_compat.camera_series import (
    RunningCameras as MultiProcessData,
    TriCameraFrontend as Frontend,
)
from trifinger_simulation.trifinger_platform import CameraObservation as CameraObservation

BaseData = SingleProcessData
# Programs of 2020 make images with it; an array is one here.
cvMat = np.asarray  # noqa: N816

__all__ = [
    "Backend",
    "BaseData",
    "CameraInfo",
    "CameraObservation",
    "CameraParameters",
    "Frontend",
    "Image",
    "Logger",
    "MultiProcessData",
    "OpenCVDriver",
    "PylonDriver",
    "Settings",
    "SingleProcessData",
    "cvMat",
]

Image: TypeAlias = Any


class OpenCVDriver(_RealDriver):
    """A webcam."""


class PylonDriver(_RealDriver):
    """An industrial camera."""


SETTINGS_VARIABLE = "TRIFINGER_CAMERA_CONFIG"


@dataclass
class TriCameraDriverSettings:
    """Settings of three cameras."""

    frame_rate_fps: float = 10.0


@dataclass
class PylonDriverSettings:
    """Settings of a camera, as the file has them; they change nothing here (docs/cameras.md)."""

    values: dict[str, Any] = field(default_factory=dict)


class Settings:
    """What the TOML file says that the variable TRIFINGER_CAMERA_CONFIG names; else defaults."""

    def __init__(self) -> None:
        """Raises RuntimeError if the file cannot be read."""
        self._content: dict[str, Any] = {}
        if path := os.environ.get(SETTINGS_VARIABLE):
            try:
                self._content = tomllib.loads(Path(path).read_text())
            except (OSError, tomllib.TOMLDecodeError) as error:
                raise RuntimeError(f"cannot read the settings {path}: {error}") from error

    def get_tricamera_driver_settings(self) -> TriCameraDriverSettings:
        """Those of the table [tricamera_driver]."""
        return TriCameraDriverSettings(**self._content.get("tricamera_driver", {}))

    def get_pylon_driver_settings(self) -> PylonDriverSettings:
        """Those of the table [pylon_driver]."""
        return PylonDriverSettings(self._content.get("pylon_driver", {}))
