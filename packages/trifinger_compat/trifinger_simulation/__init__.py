# SPDX-License-Identifier: BSD-3-Clause
"""The simulation of the original stack, on top of this project's own."""

from pathlib import Path

from trifinger_compat.camera_files import data_folder as _data_folder

from trifinger_simulation import (
    action as action,
    camera as camera,
    collision_objects as collision_objects,
    finger_types_data as finger_types_data,
    observation as observation,
    sim_finger as sim_finger,
    tasks as tasks,
    trifinger_platform as trifinger_platform,
    trifingerpro_limits as trifingerpro_limits,
)
from trifinger_simulation.action import Action as Action
from trifinger_simulation.observation import Observation as Observation
from trifinger_simulation.sim_finger import SimFinger as SimFinger
from trifinger_simulation.trifinger_platform import (
    CameraObservation as CameraObservation,
    ObjectPose as ObjectPose,
    TriCameraObjectObservation as TriCameraObjectObservation,
    TriCameraObservation as TriCameraObservation,
    TriFingerPlatform as TriFingerPlatform,
)


def get_data_dir() -> Path:
    """The folder with `camera_params`: the calibration of the three cameras."""
    return _data_folder()
