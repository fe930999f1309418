# SPDX-License-Identifier: BSD-3-Clause
"""Pushing a block to a goal, as an environment of the old Gym."""

from typing import Any

import numpy as np

from trifinger_simulation import sample
from trifinger_simulation.collision_objects import Block
from trifinger_simulation.gym_wrapper.envs.trifinger_reach import TriFingerReach
from trifinger_simulation.gym_wrapper.utils import compute_distance, unscale

HEIGHT = 0.0425  # of block and goal [m]


class TriFingerPush(TriFingerReach):
    """A block is pushed to a random position on the table."""

    _keys = (
        "joint_positions",
        "joint_velocities",
        "action_joint_positions",
        "goal_position",
        "object_position",
    )
    _has_separate_goals = False

    def __init__(
        self,
        control_rate_s: float = 0.02,
        finger_type: str = "trifingerone",
        enable_visualization: bool = False,
    ) -> None:
        """`control_rate_s` is the time of an action [s]."""
        super().__init__(control_rate_s, finger_type, enable_visualization)
        self.block = Block(pybullet_client_id=self.finger._pybullet_client_id)

    def step(self, action: Any) -> Any:
        """Goes to joint positions; gives observation, reward, done and info."""
        state = self._act(unscale(action, self.unscaled_action_space))
        place = state[self.spaces.key_to_index["object_position"]]
        reward = -compute_distance(place, self.goal)
        return self._scaled(state), reward, False, {"is_success": np.float32(0)}

    def reset(self, **_: Any) -> Any:
        """Begins an episode with another place and goal of the block."""
        begin = self._random_pose()
        observation = self.finger.reset_finger_positions_and_velocities(begin)
        self.goal = sample.random_position_in_arena(height_limits=HEIGHT)
        place = sample.random_position_in_arena(height_limits=HEIGHT)
        self.block.set_state(place, [0, 0, 0, 1])
        self.logger.new_episode(place, self.goal)
        return self._scaled(self._state(observation, begin))

    def _more_parts(self) -> dict[str, Any]:
        return {"object_position": self.block.get_state()[0]}
