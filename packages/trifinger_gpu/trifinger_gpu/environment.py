# SPDX-License-Identifier: BSD-3-Clause
"""Many simulations of a task, moved by MuJoCo Warp."""

from typing import Any

from trifinger.environments import VectorEnvironment
from trifinger.environments.options import AnyTask
from trifinger.extras import require


class WarpEnvironment(VectorEnvironment):
    """A `VectorEnvironment` whose physics are those of MuJoCo Warp, on `device`.

    "cpu" is for tests, "cuda:0" is the first GPU. All arguments of VectorEnvironment are the same,
    but no options with cameras. Motors, safety checks, goals and rewards stay those of C++, on
    processors. The physics have single precision: results differ from VectorEnvironment by what
    contacts make of the seventh digit. `contacts` and `constraints` are the room of each
    simulation; by default Warp guesses them.
    """

    def __init__(
        self,
        task: AnyTask,
        num_envs: int,
        *,
        device: str,
        contacts: int | None = None,
        constraints: int | None = None,
        **arguments: Any,
    ) -> None:
        require("trifinger-gpu[warp]", "mujoco", "mujoco_warp", "warp")
        from trifinger_gpu.physics import WarpPhysics

        super().__init__(task, num_envs, **arguments)
        self._physics = WarpPhysics(self._core, device, contacts=contacts, constraints=constraints)
        self._core.set_physics(self._physics)
