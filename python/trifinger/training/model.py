# SPDX-License-Identifier: BSD-3-Clause
"""What learns by a plan with the algorithms of Stable-Baselines3."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast

# This import comes first because its error says what to install.
from trifinger.stable_baselines import Flat, Rows, Vector

# isort: split
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from stable_baselines3 import SAC, TD3
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.noise import ActionNoise
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.utils import LinearSchedule

from trifinger import policy_file
from trifinger._trifinger import num_processors
from trifinger.arrays import Array
from trifinger.environments import Environment, VectorEnvironment
from trifinger.errors import InvalidArgument
from trifinger.training import checkpoint
from trifinger.training.ddpg import QuickDDPG
from trifinger.training.plan import ON_POLICY, Plan
from trifinger.training.replay import DemonstrationReplayBuffer, FingerReplayBuffer

MODELS: dict[str, type[OffPolicyAlgorithm]] = {"ddpg": QuickDDPG, "td3": TD3, "sac": SAC}


def rows_of(
    plan: Plan,
    num_envs: int,
    num_threads: int | None = None,
    make_simulations: Callable[..., VectorEnvironment] = VectorEnvironment,
) -> Rows:
    """Environments in the form in which a plan learns from them.

    `make_simulations` makes those of many robots and has the arguments of VectorEnvironment.
    """
    recipe, mode = plan.recipe, AutoresetMode.SAME_STEP
    environment: Vector
    if num_envs == 1:
        environment = SyncVectorEnv([lambda: Environment(**plan.environment)], autoreset_mode=mode)
    else:
        environment = make_simulations(
            num_envs=num_envs,
            num_threads=num_threads or min(2, num_processors()),
            physics_step=recipe.physics_step,
            autoreset_mode=mode,
            **plan.environment,
        )
    return Rows(
        environment,
        is_per_finger=plan.options.per_finger,
        is_shared=recipe.is_shared,
        reward_scale=recipe.reward_scale,
        approach=recipe.approach,
        kernel=recipe.kernel,
        # Plain differences are what PPO learns from: docs/decisions/push_in_simulation.md.
        gamma=1.0 if recipe.algorithm == ON_POLICY else recipe.gamma,
    )


def make_model(plan: Plan, rows: Rows, total: int) -> OffPolicyAlgorithm:
    """The model that learns by a plan, with all its settings; `total` is its number of actions."""
    recipe = plan.recipe
    if recipe.algorithm not in MODELS:
        raise InvalidArgument(
            f"'{recipe.algorithm}' is only for a robot that runs: trifinger learn"
        )
    settings: dict[str, Any] = {
        "learning_rate": LinearSchedule(recipe.learning_rate, recipe.final_learning_rate, 1.0),
        "gamma": recipe.gamma,
        "batch_size": recipe.batch_size,
        "seed": plan.seed,
        "device": "cpu",
        "buffer_size": min(recipe.buffer_size, total),
        "learning_starts": recipe.random_actions * rows.num_envs,
        "train_freq": 1,
        "gradient_steps": recipe.gradient_steps,
        "replay_buffer_class": DemonstrationReplayBuffer,
        "replay_buffer_kwargs": {"demonstrations": recipe.demonstrations},
    }
    network: dict[str, Any] = {
        "net_arch": list(recipe.layers),
        "optimizer_kwargs": {"fused": True},  # saves a tenth of the time of a gradient step
    }
    if recipe.relabelled > 0:
        settings |= {
            "replay_buffer_class": FingerReplayBuffer,
            "replay_buffer_kwargs": relabelling_of(plan, rows.flat),
        }
    if recipe.algorithm in ("ddpg", "td3"):
        calls, (size,) = total // rows.num_envs, rows.action_space.shape or (0,)
        settings["action_noise"] = FallingNoise(recipe.noise, recipe.final_noise, calls, size)
    return MODELS[recipe.algorithm]("MlpPolicy", rows, policy_kwargs=network, **settings)


def relabelling_of(plan: Plan, flat: Flat) -> dict[str, Any]:
    """The arguments of FingerReplayBuffer for a plan with observations that are `flat`."""
    if plan.task not in ("reach", "finger_reach") or not plan.options.per_finger:
        raise InvalidArgument("relabelled is for reaches, with per_finger=True")
    _, low, high = flat["goal"]
    return {
        "relabelled": plan.recipe.relabelled,
        "reward_scale": plan.recipe.reward_scale,
        "goal_low": np.float32(low[:3]),
        "goal_high": np.float32(high[:3]),
    }


class FallingNoise(ActionNoise):
    """Normal noise; its standard deviation falls linearly during `calls` calls, then stays."""

    def __init__(self, begin: float, end: float, calls: int, size: int) -> None:
        super().__init__()
        self._begin, self._end, self._calls, self._size = begin, end, calls, size
        self._count = 0

    def __call__(self) -> Array:
        """Draws the noise for an action."""
        share = min(self._count / self._calls, 1.0)
        self._count += 1
        deviation = self._begin + share * (self._end - self._begin)
        # Stable-Baselines3 uses the global generator, too; its state is in the checkpoints.
        return np.random.normal(0.0, deviation, self._size).astype(np.float32)  # noqa: NPY002


class OffPolicy:
    """What learns by a model of Stable-Baselines3 while it acts in simulations."""

    def __init__(self, plan: Plan, rows: Rows, total: int) -> None:
        """`total` is the number of actions of all rows."""
        self._model, self._rows, self._total = make_model(plan, rows, total), rows, total

    @property
    def actions(self) -> int:
        """Number of actions of all rows so far."""
        return self._model.num_timesteps

    def begin(self, observations: Array) -> None:
        """Begins with the first observations of new episodes."""
        self._model._last_obs = observations
        self._model._last_episode_starts = np.ones(self._rows.num_envs, bool)

    def learn(self, logger: Logger, between: Callable[[], None]) -> None:
        """Learns to the end; `between` is called when all gradient steps that are due are done."""
        self._model.set_logger(logger)
        self._model.learn(
            self._total - self.actions,
            callback=_Between(between),
            reset_num_timesteps=False,
            log_interval=4 * self._rows.rows,
        )

    def act(self, observations: Array, *, with_noise: bool) -> Array:
        """Actions of the policy; `with_noise` SAC draws them as in training."""
        actions, _ = self._model.predict(observations, deterministic=not with_noise)
        return actions

    def export(self, path: Path, metadata: Mapping[str, str]) -> None:
        """Writes the file of the policy without noise."""
        policy_file.export(self._model, path, metadata=metadata)

    def state(self) -> dict[str, Any]:
        """All that learning has changed."""
        return {
            "model": checkpoint.state_of(self._model),
            "memory": checkpoint.arrays_of(self._model.replay_buffer),
            "random_actions": self._model.action_space.np_random.bit_generator.state,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Goes on from a state(); raises errors as checkpoint.restore() does."""
        checkpoint.restore(self._model, state["model"])
        checkpoint.set_arrays(self._model.replay_buffer, state["memory"])
        self._model.action_space.np_random.bit_generator.state = state["random_actions"]


class _Between(BaseCallback):
    def __init__(self, look: Callable[[], None]) -> None:
        super().__init__()
        self._look = look

    def _on_rollout_start(self) -> None:
        self._look()

    def _on_step(self) -> bool:
        return True


class LibraryModel:
    """What learns by a model of Stable-Baselines3 from transitions that others have made."""

    def __init__(self, plan: Plan, rows: Rows, size: int) -> None:
        """`size` is the number of rows that the memory may need."""
        self._model = make_model(plan, rows, size)
        self._model.set_logger(Logger(None, []))
        self._batch_size = plan.recipe.batch_size
        self.memory = cast(ReplayBuffer, self._model.replay_buffer)
        self.losses: dict[str, float] = {}
        """The newest losses, by name."""

    def update(self, steps: int, progress: float) -> None:
        """Takes gradient steps; `progress` is the share of the training that is done."""
        self._model._current_progress_remaining = 1.0 - progress
        self._model.train(steps, self._batch_size)
        values = self._model.logger.name_to_value
        self.losses = {name: float(value) for name, value in values.items()}

    def export(self, path: Path, metadata: Mapping[str, str]) -> None:
        """Writes the file of the policy without noise."""
        policy_file.export(self._model, path, metadata=metadata)

    def state(self) -> dict[str, Any]:
        """What was learned, without the memory."""
        return checkpoint.state_of(self._model)

    def restore(self, state: dict[str, Any]) -> None:
        """Goes on from a state(); raises errors as checkpoint.restore() does."""
        checkpoint.restore(self._model, state)
