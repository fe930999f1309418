# SPDX-License-Identifier: BSD-3-Clause
"""Environments of the original up to 2022. Importing this registers them."""

from trifinger_compat.spaces import gym_package as _gym_package, registry as _registry

_ENVIRONMENTS = {
    "real_robot_challenge_phase_1-v1": "cube_env:RealRobotChallengePhase1",
    "cube_trajectory-v1": "cube_trajectory_env:RealRobotChallengeTrajectory",
    "reach-v0": "trifinger_reach:TriFingerReach",
    "push-v0": "trifinger_push:TriFingerPush",
}


def _register() -> None:
    gym = _gym_package()
    for name, place in _ENVIRONMENTS.items():
        if name not in _registry():
            gym.register(
                id=name,
                entry_point=f"trifinger_simulation.gym_wrapper.envs.{place}",
                # These environments have the interface of the old Gym.
                disable_env_checker=True,
                order_enforce=False,
            )


_register()
