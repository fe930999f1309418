# SPDX-License-Identifier: BSD-3-Clause
"""The simulation of 2020-08, on top of this project's own."""

from trifinger_simulation.action import Action as Action
from trifinger_simulation.observation import Observation as Observation

from rrc_simulation import (
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
from rrc_simulation.sim_finger import SimFinger as SimFinger
from rrc_simulation.trifinger_platform import (
    ObjectPose as ObjectPose,
    TriFingerPlatform as TriFingerPlatform,
)
