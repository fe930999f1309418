# SPDX-License-Identifier: BSD-3-Clause
"""Pushing a block to a goal, as an environment of the old Gym."""

from typing import Any

import numpy as np
from trifinger_compat.spaces import box

from trifinger_simulation import sample
from trifinger_simulation.collision_objects import Block
from trifinger_simulation.gym_wrapper.envs.trifinger_reach import TriFingerReach

HEIGHT = 0.0425  # of block and goal [m]


class TriFingerPush(TriFingerReach):
    """A block is pushed to a random position on the table."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        """Arguments are those of TriFingerReach."""
        super().__init__(*arguments, **options)
        self.block = Block(pybullet_client_id=self.finger._pybullet_client_id)
        size = 12 * self.finger.number_of_fingers - 3 * self.finger.number_of_fingers + 10
        self.observation_space = box(-np.full(size, np.inf), np.full(size, np.inf), "float64")
        self._block_goal = np.zeros(3)

    def step(self, action: Any) -> Any:
        """Goes to joint positions; gives observation, reward, done and info."""
        _, _, done, info = super().step(action)
        position, _ = self.block.get_state()
        reward = -float(np.linalg.norm(np.array(position) - self._block_goal))
        return self._observation(), reward, done, info

    def reset(self, **options: Any) -> Any:
        """Begins an episode with another place and goal of the block."""
        super().reset(**options)
        limits = (HEIGHT, HEIGHT)
        place = sample.random_position_in_arena(height_limits=limits)
        self._block_goal = np.array(sample.random_position_in_arena(height_limits=limits))
        self.block.set_state(place, [0, 0, 0, 1])
        return self._observation()

    def _observation(self) -> Any:
        robot = self.finger._get_latest_observation()
        tips = np.array(self.finger.kinematics.forward_kinematics(robot.position)).ravel()
        position, orientation = self.block.get_state()
        return np.concatenate(
            [tips, robot.position, robot.velocity, position, orientation, self._block_goal]
        )
