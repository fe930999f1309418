# SPDX-License-Identifier: BSD-3-Clause
"""Memories of transitions: one for demonstrations, one that makes more of reaches."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.common.vec_env import VecNormalize

from trifinger.arrays import Array
from trifinger.errors import InvalidArgument
from trifinger.stable_baselines import JOINTS

GOAL = slice(-3, None)  # place of the goal in the numbers of a finger, whatever else is observed
draw = np.random.randint  # by the generator of Stable-Baselines3: its state is in the checkpoints

Augment = Callable[[ReplayBufferSamples, Array, Array], ReplayBufferSamples]


class EpisodeReplayBuffer(ReplayBuffer):
    """Knows which transitions are of the same episode; all environments begin and end together."""

    def __init__(
        self,
        *arguments: Any,
        augment: Augment | None = None,
        is_shown: bool = False,
        **more: Any,
    ) -> None:
        """`augment` makes others of drawn transitions, which could have happened as well.

        It gets, for each of them, also an observation of the same episode that came later, and an
        observation of any time. For demonstrations (`is_shown`) that is the later one, too: whoever
        showed them had no other goals in mind.
        """
        super().__init__(*arguments, **more)
        self._augment, self._is_shown = augment, is_shown
        # For each place in the buffer, the last place of its episode.
        self._last = np.zeros(self.buffer_size, np.int64)
        self._first = 0

    def add(self, *transition: Any) -> None:
        """Adds a transition of each environment, as ReplayBuffer does."""
        place = self.pos
        self._first = min(self._first, place)
        self._last[self._first : place + 1] = place
        super().add(*transition)
        if transition[4].any():
            self._first = self.pos

    def _later(self, place: Array) -> Array:
        return draw(place, self._last[place] + 1)

    def _get_samples(self, batch_inds: Array, env: VecNormalize | None = None) -> Any:
        samples = super()._get_samples(batch_inds, env)
        if self._augment is None:
            return samples
        later = self.next_observations[self._later(batch_inds), 0]
        other = self.observations[draw(0, self.size(), len(batch_inds)), 0]
        return self._augment(samples, later, later if self._is_shown else other)


class DemonstrationReplayBuffer(EpisodeReplayBuffer):
    """Draws the share `demonstrations` of each batch from demonstrations, once there are any.

    The rest is drawn from all transitions. This is the sampling of RLPD (Ball et al. 2023).
    """

    def __init__(self, *arguments: Any, demonstrations: float, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self._share = demonstrations
        self._shown = EpisodeReplayBuffer(*arguments, is_shown=True, **more)

    def add(self, *transition: Any) -> None:
        """Adds a transition of each environment: demonstrations, if their infos say so."""
        super().add(*transition)
        if transition[-1][0].get("is_demonstration"):
            self._shown.add(*transition)

    def demonstrated(self, batch_size: int) -> int:
        """Number of demonstrations in a batch: its first rows."""
        return round(self._share * batch_size) if self._shown.size() else 0

    def sample(self, batch_size: int, env: VecNormalize | None = None) -> ReplayBufferSamples:
        """Draws a batch."""
        count = self.demonstrated(batch_size)
        if count == 0:
            return super().sample(batch_size, env)
        parts = self._shown.sample(count, env), super().sample(batch_size - count, env)
        return ReplayBufferSamples(*map(torch.cat, zip(*(part[:5] for part in parts), strict=True)))


class FingerReplayBuffer(EpisodeReplayBuffer):
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
        self._fingers = self.actions.shape[2] // JOINTS
        self._relabelled, self._reward_scale = relabelled, reward_scale
        self._middle = (np.asarray(goal_low) + goal_high) / 2
        self._half = (np.asarray(goal_high) - goal_low) / 2
        # Positions that the tips reached, scaled like goals.
        self._achieved = np.zeros((*self.actions.shape[:2], self._fingers, 3), np.float32)

    def add(self, *transition: Any) -> None:
        """Adds a transition of each environment."""
        achieved = np.stack([info["achieved_goal"] for info in transition[-1]])
        achieved = achieved.reshape(len(achieved), self._fingers, 3)
        self._achieved[self.pos] = np.clip((achieved - self._middle) / self._half, -1.0, 1.0)
        super().add(*transition)

    def sample(self, batch_size: int, env: VecNormalize | None = None) -> ReplayBufferSamples:
        """Draws a batch. Raises InvalidArgument if `env` asks to normalise it."""
        if env is not None:
            raise InvalidArgument("batches of fingers are not normalised")
        size = (batch_size, self._fingers)
        place = draw(0, self.size(), size)
        row = draw(0, self.n_envs, size)
        finger = draw(0, self._fingers, size)
        later = self._later(place)
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
        rows = (array.reshape(batch_size, -1).astype(np.float32) for array in arrays)
        return ReplayBufferSamples(*map(torch.from_numpy, rows))
