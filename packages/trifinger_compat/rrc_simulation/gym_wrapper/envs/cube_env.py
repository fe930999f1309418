# SPDX-License-Identifier: BSD-3-Clause
"""Moving the cube, as an environment of the old Gym, with the figures of 2020-08."""

from typing import Any

from trifinger_simulation.gym_wrapper.envs.cube_env import (
    ActionType as ActionType,
    CubeEnv as _CubeEnv,
    FixedInitializer as FixedInitializer,
    RandomInitializer as _RandomInitializer,
)

from rrc_simulation.tasks import move_cube as _move_cube
from rrc_simulation.trifinger_platform import TriFingerPlatform


class RandomInitializer(_RandomInitializer):
    """Begins each episode at random."""

    _task = _move_cube


class CubeEnv(_CubeEnv):
    """Moving the cube to a goal; the reward of a step is minus the sum of its costs."""

    _platform_class = TriFingerPlatform
    _task: Any = _move_cube

    def _object_pose(self, t: int) -> Any:
        return self.platform.get_object_pose(t)


class RealRobotChallengePhase1(CubeEnv):
    """The environment `real_robot_challenge_phase_1-v1`."""
