# SPDX-License-Identifier: BSD-3-Clause
"""Tasks for learning, as environments of Gymnasium.

    import gymnasium
    import trifinger.environments

    gymnasium.register_envs(trifinger.environments)
    environment = gymnasium.make("TriFinger/Reach-v0")
    observation, info = environment.reset(seed=1)

`Environment` drives a simulation or a real robot, through the mappings of `trifinger.mappings`.
`VectorEnvironment` drives many simulations at once; it is C++ inside and gives the same numbers,
bit for bit. docs/environments.md has the tasks, spaces and options.
"""

from trifinger.extras import sentence

try:
    import gymnasium as _  # noqa: F401  (only to say what is missing)
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(sentence("learning", "gymnasium"), name=error.name) from error

from trifinger.environments.options import Options as Options, policy_metadata as policy_metadata
from trifinger.environments.registration import TASKS as TASKS, register as register
from trifinger.environments.single import (
    Environment as Environment,
    GoalEnvironment as GoalEnvironment,
)
from trifinger.environments.vector import VectorEnvironment as VectorEnvironment

register()
