# SPDX-License-Identifier: BSD-3-Clause
"""Memories of transitions: one for demonstrations, one that makes more of reaches."""

from typing import Any

import numpy as np
import torch
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.common.vec_env import VecNormalize

from trifinger.arrays import Array
from trifinger.errors import InvalidArgument

FINGER = 9  # numbers of a finger in observations of a reach: positions, velocities, goal
GOAL = slice(6, 9)  # place of the goal in the numbers of a finger


class DemonstrationReplayBuffer(ReplayBuffer):
    """Draws the share `demonstrations` of each batch from demonstrations, once there are any.

    The rest is drawn from all transitions. This is the sampling of RLPD (Ball et al. 2023).
    """

    def __init__(self, *arguments: Any, demonstrations: float, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self._share, self._shown = demonstrations, ReplayBuffer(*arguments, **more)

    def add(self, *transition: Any) -> None:
        """Adds a transition of each environment: demonstrations, if their infos say so."""
        super().add(*transition)
        if transition[-1][0].get("is_demonstration"):
            self._shown.add(*transition)

    def sample(self, batch_size: int, env: VecNormalize | None = None) -> ReplayBufferSamples:
        """Draws a batch."""
        count = round(self._share * batch_size) if self._shown.size() else 0
        if count == 0:
            return super().sample(batch_size, env)
        parts = self._shown.sample(count, env), super().sample(batch_size - count, env)
        return ReplayBufferSamples(*map(torch.cat, zip(*(part[:5] for part in parts), strict=True)))


class FingerReplayBuffer(ReplayBuffer):
    """Stores transitions of a reach; sample() puts rows together finger by finger.

    Each finger of a row gets the transition of any finger at any time. Its goal is the original
    one or, for the share `relabelled`, a position that the finger came to later in the episode.
    Such a row could have happened: fingers that do not touch do not influence each other, all
    fingers are rotated copies of one, and the reward is the mean over the fingers. Options need
    per_finger=True.
    """

    def __init__(
        self,
        buffer_size: int,
        *arguments: Any,
        relabelled: float,
        reward_scale: float,
        goal_low: Array,
        goal_high: Array,
        **more: Any,
    ) -> None:
        super().__init__(buffer_size, *arguments, **more)
        shape = self.observations.shape
        self._fingers = shape[2] // FINGER
        self._relabelled, self._reward_scale = relabelled, reward_scale
        self._middle = (np.asarray(goal_low) + goal_high) / 2
        self._half = (np.asarray(goal_high) - goal_low) / 2
        # Positions that the tips reached, scaled like goals.
        self._achieved = np.zeros((*shape[:2], self._fingers, 3), np.float32)
        # For each place in the buffer, the last place of its episode.
        self._last = np.zeros(shape[0], np.int64)
        self._first = 0

    def add(
        self,
        obs: Array,
        next_obs: Array,
        action: Array,
        reward: Array,
        done: Array,
        infos: list[dict[str, Any]],
    ) -> None:
        """Adds a transition of each environment; all episodes must begin and end together."""
        place = self.pos
        achieved = np.stack([info["achieved_goal"] for info in infos])
        achieved = achieved.reshape(len(infos), self._fingers, 3)
        self._achieved[place] = np.clip((achieved - self._middle) / self._half, -1.0, 1.0)
        self._first = min(self._first, place)
        self._last[self._first : place + 1] = place
        super().add(obs, next_obs, action, reward, done, infos)
        if done.any():
            self._first = self.pos

    def sample(self, batch_size: int, env: VecNormalize | None = None) -> ReplayBufferSamples:
        """Draws a batch. Raises InvalidArgument if `env` asks to normalise it."""
        if env is not None:
            raise InvalidArgument("batches of fingers are not normalised")
        size = (batch_size, self._fingers)
        draw = np.random.randint
        place = draw(0, self.size(), size)
        row = draw(0, self.n_envs, size)
        finger = draw(0, self._fingers, size)
        later = draw(place, self._last[place] + 1)
        blocks = (*self.observations.shape[:2], self._fingers, -1)
        seen = self.observations.reshape(blocks)[place, row, finger]
        next_seen = self.next_observations.reshape(blocks)[place, row, finger]
        actions = self.actions.reshape(blocks)[place, row, finger]
        chosen = np.random.random(size) < self._relabelled  # noqa: NPY002
        goal = np.where(chosen[..., None], self._achieved[later, row, finger], seen[..., GOAL])
        seen[..., GOAL] = next_seen[..., GOAL] = goal
        offset = (goal - self._achieved[place, row, finger]) * self._half
        rewards = -self._reward_scale * np.linalg.norm(offset, axis=-1).mean(axis=1, keepdims=True)
        # Time or a fault truncates a reach, which never terminates: so no transition is the last.
        arrays = (seen, actions, next_seen, np.zeros_like(rewards), rewards)
        return ReplayBufferSamples(
            *(
                torch.from_numpy(array.reshape(batch_size, -1).astype(np.float32))
                for array in arrays
            )
        )
