# SPDX-License-Identifier: BSD-3-Clause
"""A TriFingerPro with a cube and three cameras, with the figures of 2020-08."""

from typing import Any

from trifinger_compat.generation import FIRST
from trifinger_compat.types import Numbers, PoseLike
from trifinger_simulation.trifinger_platform import (
    CameraObservation as CameraObservation,
    ObjectPose as ObjectPose,
    TriCameraObservation as TriCameraObservation,
    TriFingerPlatform as _TriFingerPlatform,
)

from rrc_simulation import trifingerpro_limits
from rrc_simulation.sim_finger import SimFinger


class TriFingerPlatform(_TriFingerPlatform):
    """A simulated TriFingerPro; a step takes 4 ms, and the cube's pose is new at each step."""

    spaces = trifingerpro_limits._limits
    _finger_class = SimFinger
    _image_size = FIRST.image_size

    def __init__(
        self,
        visualization: bool = False,
        initial_robot_position: Numbers | None = None,
        initial_object_pose: PoseLike | None = None,
        enable_cameras: bool = False,
        **options: Any,
    ) -> None:
        """Arguments are those of trifinger_simulation.TriFingerPlatform."""
        options.setdefault("time_step_s", FIRST.time_step)
        options.setdefault("camera_delay_steps", FIRST.camera_delay_steps)
        options.setdefault("object_mass", 0.02)
        super().__init__(
            visualization, initial_robot_position, initial_object_pose, enable_cameras, **options
        )
        self.camera_rate_fps = FIRST.camera_rate
