# SPDX-License-Identifier: BSD-3-Clause
"""What calibration says of cameras, by the original's names."""

import numpy as np
import trifinger
from trifinger.poses import inverse

from trifinger_compat.types import Array


class CameraParameters:
    """What calibration says of a camera."""

    def __init__(self) -> None:
        self.image_width = 0
        self.image_height = 0
        self.camera_matrix: Array = np.zeros((3, 3))
        self.distortion_coefficients: Array = np.zeros(5)
        self.tf_world_to_camera: Array = np.zeros((4, 4))


class CameraInfo(CameraParameters):
    """The same, with the number of images per second."""

    def __init__(self) -> None:
        super().__init__()
        self.frame_rate_fps = 0.0


class TriCameraInfo:
    """What is known about the cameras 60, 180 and 300: three CameraInfo in `camera`."""

    def __init__(self) -> None:
        self.camera = [CameraInfo() for _ in range(3)]


def info_of(calibration: trifinger.CameraCalibration, rate: float) -> TriCameraInfo:
    """The info of calibrated cameras with `rate` images per second [Hz]."""
    info = TriCameraInfo()
    info.camera = [_info_of(camera, rate) for camera in calibration.cameras]
    return info


def _info_of(camera: trifinger.Camera, rate: float) -> CameraInfo:
    info = CameraInfo()
    info.image_width, info.image_height = camera.width, camera.height
    info.frame_rate_fps = rate
    (fx, fy), (cx, cy) = camera.lens.focal_length, camera.lens.principal_point
    info.camera_matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    info.distortion_coefficients = np.array(camera.lens.distortion)
    info.tf_world_to_camera = inverse(camera.pose)
    return info
