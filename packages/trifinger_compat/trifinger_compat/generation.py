# SPDX-License-Identifier: BSD-3-Clause
"""The generations of the original stack, and what differs between them.

All spellings of all generations work everywhere. What cannot be told from a spelling, such as the
default gains, follows the generation: `rrc_simulation` is that of 2020-08, and
`trifinger_simulation` the newest one unless the environment variable TRIFINGER_COMPAT_GENERATION
names another.
"""

import os
from dataclasses import dataclass, replace
from math import radians
from typing import NamedTuple

from trifinger.errors import InvalidArgument

VARIABLE = "TRIFINGER_COMPAT_GENERATION"


class Gains(NamedTuple):
    """Gains of positions of a finger, base to tip."""

    kp: tuple[float, float, float]  # [Nm/rad]
    kd: tuple[float, float, float]  # [Nms/rad]


@dataclass(frozen=True)
class Generation:
    """Figures of one generation; three numbers are those of a finger, base to tip."""

    name: str
    time_step: float  # [s]
    camera_delay_steps: int
    camera_rate: float  # [Hz]
    max_torque: float  # [Nm]
    torque_space: float  # [Nm]
    position_low: tuple[float, float, float]  # [rad]
    position_high: tuple[float, float, float]
    position_default: tuple[float, float, float]
    pro_kp: tuple[float, float, float]  # [Nm/rad]
    pro_kd: tuple[float, float, float]  # [Nms/rad]
    image_size: int  # [pixel]
    episode_length: int  # [steps]
    space_type: str  # of the elements of spaces
    turns_faces: bool  # whether each face of the object may be up when an episode begins
    cube_is_mesh: bool  # or a box, which touches from nearer
    safety_kd: tuple[float, float, float] = (0.08, 0.08, 0.04)  # [Nms/rad]

    def gains(self, finger_type: str) -> "Gains":
        """The gains of the original's simulator for a type of robot."""
        if finger_type in ("fingerpro", "trifingerpro"):
            return Gains(self.pro_kp, self.pro_kd)
        return Gains((10.0, 10.0, 10.0), (0.1, 0.3, 0.001))


LATEST = Generation(
    name="2024",
    time_step=0.001,
    camera_delay_steps=90,
    camera_rate=10,
    max_torque=0.396,
    torque_space=0.397,
    position_low=(-0.33, 0.0, -2.7),
    position_high=(1.0, 1.57, 0.0),
    position_default=(0.0, 0.9, -1.7),
    pro_kp=(15.0, 15.0, 9.0),
    pro_kd=(0.5, 1.0, 0.5),
    image_size=540,
    episode_length=120000,
    space_type="float64",
    turns_faces=True,
    cube_is_mesh=True,
)
_OF_2022 = replace(LATEST, name="2022", image_size=270)
_OF_2021 = replace(_OF_2022, name="2021", camera_delay_steps=0, space_type="float32")
_PHASE_2 = replace(
    _OF_2021,
    name="2020",
    time_step=0.004,
    pro_kp=(10.0, 10.0, 10.0),
    pro_kd=(0.1, 0.3, 0.001),
    turns_faces=False,
    cube_is_mesh=False,
)
FIRST = replace(
    _PHASE_2,
    name="v0",
    camera_rate=30,
    max_torque=0.36,
    torque_space=0.36,
    position_low=(-0.9, -1.57, -2.7),
    position_high=(1.4, 1.57, 0.0),
    position_default=(0.0, radians(70), radians(-130)),
    episode_length=3750,
)
GENERATIONS = {each.name: each for each in (FIRST, _PHASE_2, _OF_2021, _OF_2022, LATEST)}


def chosen() -> Generation:
    """The generation that the environment names, or the newest one."""
    name = os.environ.get(VARIABLE, LATEST.name)
    if name not in GENERATIONS:
        raise InvalidArgument(
            f"{VARIABLE} is '{name}', must be one of {', '.join(GENERATIONS)}: the years in which "
            "the original's versions appeared"
        )
    return GENERATIONS[name]


def why_sizes_differ(size: int) -> str:
    """Why images have another size than the masks of dice that a program made, and what to do."""
    now = chosen()
    fit = [each.name for each in (_OF_2021, _OF_2022, LATEST) if each.image_size == size]
    remedy = f"; {VARIABLE}={' or '.join(fit)} has {size} pixels" if fit else ""
    return f"images of generation {now.name} have {now.image_size} pixels{remedy}"
