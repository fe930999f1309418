# SPDX-License-Identifier: BSD-3-Clause
"""Environments of 2020-08. Importing this registers them."""

from trifinger_compat.spaces import gym_package as _gym_package, registry as _registry

_NAME = "real_robot_challenge_phase_1-v1"


def _register() -> None:
    gym = _gym_package()
    for name in (_NAME, f"rrc_simulation/{_NAME}"):
        # Programs of 2020-08 mean theirs, also if trifinger_simulation has one of this name.
        _registry().pop(name, None)
        gym.register(
            id=name,
            entry_point="rrc_simulation.gym_wrapper.envs.cube_env:RealRobotChallengePhase1",
            disable_env_checker=True,
            order_enforce=False,
        )


_register()
