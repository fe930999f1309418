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

from trifinger.extras import how_to_install, sentence

try:
    import gymnasium
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(sentence("learning", "gymnasium"), name=error.name) from error
if not hasattr(gymnasium.vector, "AutoresetMode"):  # `trifinger` itself works with older ones
    raise ImportError(
        f"these environments need Gymnasium 1.1 or newer, and gymnasium {gymnasium.__version__} is "
        f"installed: {how_to_install('learning')}",
        name="gymnasium",
    )

from trifinger.environments.options import Options as Options, policy_metadata as policy_metadata
from trifinger.environments.registration import TASKS as TASKS, register as register
from trifinger.environments.reset_states import ResetStates as ResetStates
from trifinger.environments.single import Environment as Environment
from trifinger.environments.vector import VectorEnvironment as VectorEnvironment

register()
