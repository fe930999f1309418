# SPDX-License-Identifier: BSD-3-Clause
"""Learns from few transitions, a share of them from demonstrations if there are any.

After Ball, Smith, Kostrikov and Levine, "Efficient Online Reinforcement Learning with Offline Data"
(RLPD, 2023, arXiv 2302.02948): layer norm in critics makes many gradient steps per action stable.
The actor is that of TD3 (Fujimoto et al. 2018, arXiv 1802.09477): a robot adds its noise by itself.
Observations are scaled by what was seen, because 2 cm are a fiftieth of the range of a position.
"""

import copy
import itertools
import math
from collections.abc import Iterable

import torch

from trifinger.training.algorithm import Batch
from trifinger.training.plan import Recipe

CRITICS = 2
TARGET_RATE = 0.005  # of the critics' copy that says what follows
TARGET_NOISE = 0.1  # standard deviation of noise on the actions that this copy values
ACTOR_EVERY = 2  # gradient steps of the critics
FIRST_ACTIONS = 0.1  # factor on the last weights of a new actor, so that it does little
LEAST_VARIANCE = 0.0004  # of a number that hardly varies


class Rlpd:
    """Two critics with layer norm, and an actor that is trained by their mean."""

    def __init__(self, observations: int, actions: int, recipe: Recipe) -> None:
        self._gamma, self._imitation = recipe.gamma, recipe.imitation
        self._scale = torch.nn.BatchNorm1d(observations, LEAST_VARIANCE, None, affine=False)
        last = torch.nn.Linear(recipe.layers[-1], actions)
        last.load_state_dict({name: FIRST_ACTIONS * one for name, one in last.state_dict().items()})
        sizes = itertools.pairwise([observations, *recipe.layers])
        hidden = [part for size in sizes for part in (torch.nn.Linear(*size), torch.nn.ReLU())]
        self._actor = torch.nn.Sequential(*hidden, last, torch.nn.Tanh())
        self._critics = Critics([observations + actions, *recipe.layers])
        self._target = copy.deepcopy(self._critics)
        self._actor_optimizer, self._critics_optimizer = (
            torch.optim.Adam(module.parameters(), recipe.learning_rate, fused=True)
            for module in (self._actor, self._critics)
        )
        self._steps, self._value = 0, 0.0

    def update(self, batch: Batch) -> dict[str, float]:
        """Takes a gradient step of the critics, and every second time one of the actor."""
        before, after, then = self._scaled(batch)
        with torch.no_grad():
            value = self._target(after, then).amin(0)
            value = batch.rewards + self._gamma * (1 - batch.terminated) * value
        loss = (self._critics(before, batch.actions) - value).square().mean(1).sum()
        descend(self._critics_optimizer, self._critics.parameters(), loss)
        self._steps += 1
        if self._steps % ACTOR_EVERY == 0:
            acts = self._actor(before)
            self._improve(batch, acts, self._critics(before, acts).mean(0))
        with torch.no_grad():
            critics: list[torch.Tensor] = list(self._critics.parameters())
            torch._foreach_lerp_(list(self._target.parameters()), critics, TARGET_RATE)
        return {"critic_loss": loss.item() / CRITICS, "value": self._value}

    # Observations before and after, scaled by all that was seen, and what the actor does after.
    def _scaled(self, batch: Batch) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        self._scale.train()(batch.observations)
        self._scale.eval()
        before, after = self._scale(batch.observations), self._scale(batch.next_observations)
        with torch.no_grad():
            then = self._actor(after)
            noise = TARGET_NOISE * torch.randn_like(then).clamp(-2, 2)
        return before, after, (then + noise).clamp(-1, 1)

    # Takes a gradient step of the actor, for what it does and the values of that.
    def _improve(self, batch: Batch, acts: torch.Tensor, value: torch.Tensor) -> None:
        apart = (acts - batch.actions).square().sum(1) @ batch.demonstrated
        apart = apart / batch.demonstrated.sum().clamp(min=1)
        weight = self._imitation * (1 - batch.progress)
        loss = weight * apart - value.mean() / value.detach().abs().mean()
        descend(self._actor_optimizer, self._actor.parameters(), loss)
        self._value = value.mean().item()

    def actor(self) -> torch.nn.Sequential:
        """A copy of what acts; the scale of observations is a part of its first layer."""
        actor = copy.deepcopy(self._actor)
        weight, bias = itertools.islice(actor.parameters(), 2)
        with torch.no_grad():
            mean, variance, _ = self._scale.buffers()
            weight.mul_((variance + LEAST_VARIANCE).rsqrt())
            bias.sub_(weight @ mean)
        return actor


def descend(
    optimizer: torch.optim.Optimizer, parameters: Iterable[torch.Tensor], loss: torch.Tensor
) -> None:
    """Takes a gradient step of these parameters, and leaves all others as they are."""
    own = list(parameters)
    for parameter, gradient in zip(own, torch.autograd.grad(loss, own), strict=True):
        parameter.grad = gradient
    optimizer.step()


class Critics(torch.nn.Module):
    """Critics with layer norm, all at once: arrays have one more dimension, which saves time."""

    def __init__(self, sizes: list[int]) -> None:
        super().__init__()
        self.weights, self.biases = torch.nn.ParameterList(), torch.nn.ParameterList()
        hidden = [(CRITICS, 1, size) for size in sizes[1:]]
        self.gains = torch.nn.ParameterList(map(torch.ones, hidden))
        self.shifts = torch.nn.ParameterList(map(torch.zeros, hidden))
        for inputs, outputs in itertools.pairwise([*sizes, 1]):
            bound = 1 / math.sqrt(inputs)
            self.weights.append(torch.empty(CRITICS, inputs, outputs).uniform_(-bound, bound))
            self.biases.append(torch.empty(CRITICS, 1, outputs).uniform_(-bound, bound))

    def forward(self, observations: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
        """The values of N observations and actions, CRITICS x N."""
        values = torch.cat([observations, actions], 1).expand(CRITICS, -1, -1)
        *layers, last = zip(self.biases, self.weights, strict=True)
        for (bias, weight), gain, shift in zip(layers, self.gains, self.shifts, strict=True):
            values = torch.baddbmm(bias, values, weight)
            values = self.normalised(values)
            values = torch.addcmul(shift, values, gain).relu()
        bias, weight = last
        return torch.baddbmm(bias, values, weight)[..., 0]

    def normalised(self, values: torch.Tensor) -> torch.Tensor:
        """The values of a hidden layer before its gains, shifts and activation."""
        return torch.nn.functional.layer_norm(values, values.shape[-1:])
