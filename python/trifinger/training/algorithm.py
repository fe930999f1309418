# SPDX-License-Identifier: BSD-3-Clause
"""Learning by a class with two functions, of the user's own or of this package."""

from __future__ import annotations

import math
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, Protocol

# This import comes first because its error says what to install.
from trifinger.stable_baselines import Rows

# isort: split
import numpy as np
import torch
from stable_baselines3.common.utils import set_random_seed

from trifinger import own_class, policy_file
from trifinger.errors import Error, InvalidArgument
from trifinger.training import checkpoint
from trifinger.training.plan import CLASSES, Plan, Recipe
from trifinger.training.pushes import Pushes, offsets_of
from trifinger.training.replay import DemonstrationReplayBuffer


class Batch(NamedTuple):
    """Transitions, a row each, in single precision."""

    observations: torch.Tensor
    """N x numbers of an observation, from -1 to 1."""
    actions: torch.Tensor
    """N x numbers of an action, from -1 to 1."""
    rewards: torch.Tensor
    """N numbers, times the `reward_scale` of the recipe."""
    next_observations: torch.Tensor
    terminated: torch.Tensor
    """N numbers: 1 if nothing can follow, so the value of the next observation does not count."""
    demonstrated: torch.Tensor
    """N numbers: 1 for those that were drawn from demonstrations."""
    progress: float
    """Share of the training that is done."""


class Algorithm(Protocol):
    """How to learn: docs/training.md has an example.

    Checkpoints have the attributes that are modules, optimizers, tensors and numbers.
    """

    def __init__(self, observations: int, actions: int, recipe: Recipe) -> None:
        """Gets the numbers of an observation and of an action."""

    def update(self, batch: Batch) -> Mapping[str, float]:
        """Takes a gradient step, and returns its losses by name."""

    def actor(self) -> torch.nn.Sequential:
        """What acts: Linear, ReLU and Tanh, from an observation to an action without noise."""


class ClassModel:
    """What learns by an Algorithm, as LibraryModel does by Stable-Baselines3."""

    def __init__(self, plan: Plan, rows: Rows, size: int) -> None:
        """`size` is the number of rows that the memory may need.

        Raises InvalidArgument if the class cannot be used.
        """
        recipe = plan.recipe
        spaces = (rows.observation_space, rows.action_space)
        self._sizes = [int(np.prod(space.shape or 0)) for space in spaces]
        self._name = CLASSES.get(recipe.algorithm, recipe.algorithm)
        self._batch_size = recipe.batch_size
        self.memory = DemonstrationReplayBuffer(
            min(recipe.buffer_size, size),
            *spaces,
            "cpu",
            rows.num_envs,
            demonstrations=recipe.demonstrations,
            augment=Pushes(plan, rows) if recipe.relabelled > 0 or recipe.symmetry else None,
        )
        self.losses: dict[str, float] = {}
        """The newest losses, by name."""
        more = offsets_of(rows.flat) if recipe.offsets else np.zeros((0, self._sizes[0]))
        self._offsets = torch.from_numpy(more.astype(np.float32))
        kind = own_class.load("algorithm", self._name)
        if not all(callable(getattr(kind, name, None)) for name in ("update", "actor")):
            raise InvalidArgument(f"'{self._name}' has no functions update() and actor()")
        set_random_seed(plan.seed)
        try:
            self._algorithm: Algorithm = kind(self._sizes[0] + len(more), self._sizes[1], recipe)
            self._layers()
        except Exception as error:
            raise InvalidArgument(self._failure("cannot be used", error)) from error

    def update(self, steps: int, progress: float) -> None:
        """Takes gradient steps; raises Error if the class cannot."""
        # All batches are drawn at once, which saves overhead; each has its share of all parts.
        count = steps * self._batch_size
        seen, acted, then, *others = self.memory.sample(count)[:5]
        seen, then = (torch.cat([one, one @ self._offsets.T], 1) for one in (seen, then))
        demonstrated = (torch.arange(count) < self.memory.demonstrated(count)).float()
        drawn = (seen, acted, then, *others, demonstrated)
        for step in range(steps):
            seen, acted, then, ended, rewards, shown = (one[step::steps] for one in drawn)
            batch = Batch(seen, acted, rewards[:, 0], then, ended[:, 0], shown, progress)
            try:
                losses = {name: float(one) for name, one in self._algorithm.update(batch).items()}
            except Exception as error:
                raise Error(self._failure("failed", error)) from error
            if not all(map(math.isfinite, losses.values())):
                raise Error(f"the losses of '{self._name}' are {losses}: it learns nothing more")
            self.losses = {f"train/{name}": loss for name, loss in losses.items()}

    def export(self, path: Path, metadata: Mapping[str, str]) -> None:
        """Writes the file of the policy without noise."""
        layers = self._layers()
        policy_file.write(
            path,
            layers,
            low=[-1.0] * self._sizes[1],
            high=[1.0] * self._sizes[1],
            bounding="scale" if layers[-1][2] == "tanh" else "clip",
            metadata=metadata,
        )

    def state(self) -> dict[str, Any]:
        """What was learned, without the memory."""
        return checkpoint.learned_by(self._algorithm)

    def restore(self, state: dict[str, Any]) -> None:
        """Goes on from a state(); raises errors as checkpoint.restore_learned() does."""
        checkpoint.restore_learned(self._algorithm, state)

    def _layers(self) -> list[policy_file.Layer]:
        layers = policy_file.layers_of(self._algorithm.actor())
        sizes = [np.shape(layers[0][0])[1], np.shape(layers[-1][0])[0]] if layers else [0, 0]
        inputs, outputs = self._sizes[0] + len(self._offsets), self._sizes[1]
        if sizes != [inputs, outputs]:
            raise InvalidArgument(
                f"actor() is from {sizes[0]} to {sizes[1]} numbers, must be from {inputs} to "
                f"{outputs}"
            )
        # Offsets are sums of numbers of an observation, so they become a part of its first layer.
        (weight, bias, activation), *rest = layers
        of_seen, of_offsets = np.split(np.asarray(weight), [self._sizes[0]], axis=1)
        return [(of_seen + of_offsets @ self._offsets.numpy(), bias, activation), *rest]

    def _failure(self, what: str, error: Exception) -> str:
        # The first place is in this file; the second one, if any, is in the class.
        places = traceback.extract_tb(error.__traceback__)[1:2]
        where = "".join(f" at {Path(one.filename).name}:{one.lineno}" for one in places)
        text = " ".join(f"{type(error).__name__}: {error}".split())
        return f"'{self._name}' {what}{where}: {text}"
