# SPDX-License-Identifier: BSD-3-Clause
"""Learning by PPO (Schulman et al. 2017), with rsl_rl."""

import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

# This import comes first because its error says what to install.
from trifinger.extras import sentence

# isort: split
import numpy as np
import torch
from stable_baselines3.common.logger import Logger

try:
    from rsl_rl.algorithms import PPO
    from rsl_rl.models import MLPModel
    from rsl_rl.modules.distribution import GaussianDistribution
    from rsl_rl.storage import RolloutStorage
    from tensordict import TensorDict
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(sentence("learning", str(error.name)), name=error.name) from error

from trifinger import policy_file
from trifinger.arrays import Array
from trifinger.stable_baselines import Rows
from trifinger.training.plan import Plan

EPSILON = 1e-8  # what files of policies add to a variance
NOISE = (0.05, 1.0)  # least and largest standard deviation of actions
LAMBDA = 0.95  # of generalised advantages (Schulman et al. 2016)


class BoundedGaussian(GaussianDistribution):  # type: ignore[misc]  # rsl_rl has no types
    """Normal noise on actions from -1 to 1: a network that asks for more would learn no more."""

    def update(self, mlp_output: torch.Tensor) -> None:
        """Begins to draw actions around the outputs of a network."""
        super().update(torch.tanh(mlp_output))

    def deterministic_output(self, mlp_output: torch.Tensor) -> torch.Tensor:
        """The actions without noise."""
        return torch.tanh(mlp_output)


class OnPolicy:
    """What learns by PPO while it acts in simulations."""

    def __init__(self, plan: Plan, rows: Rows, total: int) -> None:
        """`total` is the number of actions of all rows."""
        recipe = plan.recipe
        self._rows, self._recipe, self._total = rows, recipe, total
        self.actions = 0
        """Number of actions of all rows so far."""
        torch.manual_seed(plan.seed)
        self._device = device_of(recipe.device)
        (seen,), (acted,) = rows.observation_space.shape or (), rows.action_space.shape or ()
        self._seen = self._looked_at(np.zeros((rows.num_envs, seen), np.float32))
        groups = {"actor": ["seen"], "critic": [*self._seen.keys()]}
        network: dict[str, Any] = {
            "hidden_dims": list(recipe.layers),
            "activation": "elu",
            "obs_normalization": True,
        }
        noise = {
            "class_name": BoundedGaussian,
            "init_std": recipe.initial_noise,
            "std_type": "log",
        }
        self._actor = MLPModel(
            self._seen, groups, "actor", acted, distribution_cfg=noise, **network
        ).to(self._device)
        self._critic = MLPModel(self._seen, groups, "critic", 1, **network).to(self._device)
        # Actions that are small at first explore best (Andrychowicz et al. 2021, section 3.2).
        for model, last in ((self._actor, 0.01), (self._critic, 1.0)):
            model.mlp.init_weights((*[math.sqrt(2.0)] * (len(model.mlp) - 1), last))
        storage = RolloutStorage(
            "rl", rows.num_envs, recipe.rollout, self._seen, [acted], self._device
        )
        self._algorithm = PPO(
            self._actor,
            self._critic,
            storage,
            num_learning_epochs=recipe.epochs,
            num_mini_batches=max(1, rows.num_envs * recipe.rollout // recipe.batch_size),
            gamma=recipe.gamma,
            lam=LAMBDA,
            entropy_coef=recipe.entropy,
            learning_rate=recipe.learning_rate,
            schedule="fixed",
            value_loss_coef=0.5,
            use_clipped_value_loss=False,
            device=self._device,
        )

    def begin(self, observations: Array) -> None:
        """Begins with the first observations of new episodes."""
        self._seen = self._looked_at(observations)

    def learn(self, logger: Logger, between: Callable[[], None]) -> None:
        """Learns to the end; `between` is called between two updates."""
        begin = time.process_time()
        while self.actions < self._total:
            between()
            with torch.inference_mode():
                returns = [one for _ in range(self._recipe.rollout) for one in self._act()]
                self._algorithm.compute_returns(self._seen)
            self._set_learning_rate()
            losses = self._algorithm.update()
            with torch.no_grad():
                self._actor.distribution.log_std_param.clamp_(*map(math.log, NOISE))
            for name, value in losses.items():
                logger.record(f"train/{name}", value)
            logger.record("train/learning_rate", self._algorithm.learning_rate)
            logger.record("train/noise", float(self._actor.output_std.detach().mean()))
            logger.record("time/processor", time.process_time() - begin)
            if returns:
                logger.record("rollout/ep_rew_mean", float(np.mean(returns)))
            logger.dump(self.actions)

    def act(self, observations: Array, *, with_noise: bool) -> Array:
        """Actions of the policy; `with_noise` they are drawn as in training."""
        with torch.inference_mode():
            actions = self._actor(self._shown(observations), stochastic_output=with_noise)
            acted: Array = actions.clamp(-1.0, 1.0).cpu().numpy()
        return acted

    def export(self, path: Path, metadata: Mapping[str, str]) -> None:
        """Writes the file of the policy without noise."""
        normalizer, count = self._actor.obs_normalizer, self._actor.distribution.output_dim
        policy_file.write(
            path,
            policy_file.layers_of(torch.nn.Sequential(*self._actor.mlp, torch.nn.Tanh())),
            mean=normalizer.mean,
            variance=(normalizer.std.double() + normalizer.eps) ** 2 - EPSILON,
            epsilon=EPSILON,
            clip=1e6,  # rsl_rl has none
            low=[-1.0] * count,
            high=[1.0] * count,
            bounding="scale",
            metadata=metadata,
        )

    def state(self) -> dict[str, Any]:
        """All that learning has changed."""
        return {
            "algorithm": self._algorithm.save(),
            "actions": self.actions,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Goes on from a state().

        Raises ValueError, KeyError, TypeError or RuntimeError if that is of another one.
        """
        self._algorithm.load(state["algorithm"], None, strict=True)
        self.actions = state["actions"]

    def _set_learning_rate(self) -> None:
        recipe, share = self._recipe, self.actions / self._total
        rate = recipe.learning_rate + share * (recipe.final_learning_rate - recipe.learning_rate)
        self._algorithm.learning_rate = rate
        for group in self._algorithm.optimizer.param_groups:
            group["lr"] = rate

    # Acts once in all rows, and returns the sums of rewards of episodes that have ended.
    def _act(self) -> list[float]:
        rows, gamma = self._rows, self._recipe.gamma
        actions = self._algorithm.act(self._seen)
        step = rows.move(actions.clamp(-1.0, 1.0).cpu().numpy())
        ended = np.repeat(step.ended, rows.rows)
        rewards = torch.from_numpy(step.rewards)
        rewards -= self._recipe.action_cost * actions.cpu().square().sum(1)
        if step.truncated.any():
            # The time was over, but something would follow: it is worth what the critic says.
            last = np.stack(list(step.info["final_obs"][step.truncated]))
            goes_on = np.repeat(step.truncated, rows.rows)
            hidden = rows.final_hidden[goes_on] if self._recipe.asymmetric else None
            seen = self._shown(last.reshape(-1, self._seen["seen"].shape[1]), hidden)
            rewards[goes_on] += gamma * self._critic(seen).cpu().squeeze(1)
        self._seen = self._looked_at(step.observations)
        self._algorithm.process_env_step(
            self._seen, rewards.to(self._device), torch.from_numpy(ended).to(self._device), {}
        )
        self.actions += rows.num_envs
        return [float(one) for one in step.returns[step.ended]]

    # What networks get of the newest observations of all rows.
    def _looked_at(self, observations: Array) -> TensorDict:
        hidden = self._rows.hidden if self._recipe.asymmetric else None
        return self._shown(observations, hidden)

    # What networks of rsl_rl get: what is observed, and for a critic what is hidden.
    def _shown(self, observations: Array, hidden: Array | None = None) -> TensorDict:
        groups = {"seen": observations} | ({} if hidden is None else {"hidden": hidden})
        tensors = {
            name: torch.from_numpy(np.ascontiguousarray(numbers, np.float32)).to(self._device)
            for name, numbers in groups.items()
        }
        return TensorDict(tensors, batch_size=[len(observations)], device=self._device)


def device_of(name: str) -> torch.device:
    """The device of a learner: "auto" is a GPU where there is one."""
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() else "cpu"
    return torch.device(name)
