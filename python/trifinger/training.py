# SPDX-License-Identifier: BSD-3-Clause
"""Trainings with Stable-Baselines3, which can go on after a kill.

    plan = training.Plan.of("reach", "ddpg", is_shared=True)
    summary = training.Training(plan, Path("run")).run()

docs/training.md describes the command and the files in the folder of a run.
"""

from __future__ import annotations

import ast
import csv
import dataclasses
import io
import json
import math
import os
import pickle
import random
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Self

# This import comes first because its error says what to install.
from trifinger.stable_baselines import (
    FallingNoise,
    FingerReplayBuffer,
    QuickDDPG,
    Rows,
    Vector,
)

# isort: split
import numpy as np
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv, VecNormalize
from torch.utils.tensorboard import SummaryWriter

from trifinger import policy_file
from trifinger.environments import Environment, Options, VectorEnvironment, policy_metadata
from trifinger.errors import InvalidArgument
from trifinger.evaluation import (
    SHOWN_EPISODES,
    Array,
    Evaluator,
    Summary,
    save_curve,
    save_policy_film,
    save_ways,
)
from trifinger.picture import View

Algorithm = Literal["ddpg", "td3", "sac", "ppo"]
MODELS: dict[str, type[BaseAlgorithm]] = {"ddpg": QuickDDPG, "td3": TD3, "sac": SAC, "ppo": PPO}

CHECKPOINT = "checkpoint"
PLAN = "plan.json"
CURVE = "curve.csv"
# Name of the figure of paths to the goals as seen from above, by task.
WAYS = {"reach": "tips.png", "finger_reach": "tips.png", "push": "object.png"}
FIGURE_AFTER = 200  # the paper's figure shows this episode between the first and the last


@dataclasses.dataclass(frozen=True, kw_only=True)
class Recipe:
    """Settings of how a policy learns."""

    algorithm: Algorithm = "ddpg"
    is_shared: bool = False
    """Whether the fingers share one policy."""
    num_envs: int = 1
    """Number of robots that learn at once; a single one uses the interface of real robots."""
    gamma: float = 0.9
    learning_rate: float = 1e-3
    final_learning_rate: float = 1e-4
    """Learning rate at the end; it falls linearly from `learning_rate`."""
    batch_size: int = 128
    gradient_steps: int = 1
    """Gradient steps after each action of all robots; PPO does not use this."""
    layers: tuple[int, ...] = (256, 256)
    noise: float = 0.2
    final_noise: float = 0.02
    """Standard deviation of noise on actions of DDPG and TD3 at the end; it falls linearly from
    `noise`."""
    reward_scale: float = 10.0
    """Factor on the reward of the task. The reward of `approach` is added to the product; PPO
    divides the sum by the standard deviation of its returns."""
    relabelled: float = 0.0
    """Share of the goals that are replaced by positions that were reached. If it is above zero,
    batches are put together finger by finger. Only for reaches."""
    approach: float = 0.0
    """Reward for a tip that comes nearer to where it could push the object to its goal [1/m]. An
    object that comes nearer to its goal gets twice as much."""
    random_actions: int = 100
    """Random actions of each robot before it learns; PPO does not use this."""
    buffer_size: int = 1_000_000
    """Largest number of transitions that are stored."""
    rollout: int = 100
    """Actions of each robot between two updates of PPO."""
    epochs: int = 10
    """How often an update of PPO goes through the actions of a rollout."""
    initial_noise: float = 1.0
    """Standard deviation of actions of PPO at the start; PPO learns the later ones."""

    @classmethod
    def of(cls, task: str, algorithm: Algorithm, *, is_shared: bool = False) -> Self:
        """A recipe that is known to learn the task, or else a starting point for experiments."""
        if algorithm not in MODELS:
            raise InvalidArgument(f"there is no algorithm '{algorithm}', only {', '.join(MODELS)}")
        common: dict[str, Any] = {"algorithm": algorithm, "is_shared": is_shared}
        if algorithm == "ppo":
            common |= {"learning_rate": 3e-4, "final_learning_rate": 3e-5}
            if task in ("reach", "finger_reach"):
                return cls(**common, num_envs=16, batch_size=160)
            common |= {"gamma": 0.99, "reward_scale": 1.0, "approach": 60.0, "initial_noise": 0.6}
            return cls(**common, num_envs=64, rollout=128, batch_size=1024, epochs=5)
        if task in ("reach", "finger_reach") and is_shared:
            return cls(**common, batch_size=80, final_learning_rate=2e-5, relabelled=0.2)
        if task in ("reach", "finger_reach"):
            return cls(**common, batch_size=64, relabelled=0.8)
        return cls(**common, num_envs=8, gamma=0.98, batch_size=256, learning_rate=3e-4)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Plan:
    """All settings of a training; the same plan gives the same policy."""

    task: str
    recipe: Recipe
    options: Options
    episodes: int = 700
    """Number of episodes of all robots together, if each has its full length."""
    seed: int = 1
    evaluation_interval: int = 50
    """Episodes between two evaluations."""
    checkpoint_interval: int = 25
    """Episodes between two checkpoints."""

    @classmethod
    def of(
        cls,
        task: str,
        algorithm: Algorithm,
        *,
        is_shared: bool = False,
        settings: Mapping[str, Any] | None = None,
        **more: Any,
    ) -> Self:
        """The plan of Recipe.of(); `settings` are other values for fields of Recipe and Options.

        `more` are fields of the plan itself, as in `episodes=100`.
        """
        recipe = Recipe.of(task, algorithm, is_shared=is_shared)
        settings = dict(settings or {})
        names = {field.name for field in dataclasses.fields(Recipe)}
        known = names | {field.name for field in dataclasses.fields(Options)}
        for name in sorted(settings.keys() - known):
            raise InvalidArgument.of_name("setting", name, known)
        changes = {name: settings.pop(name) for name in names & settings.keys()}
        for name, value in changes.items():
            _check_type(name, value, getattr(recipe, name))
        recipe = dataclasses.replace(recipe, **changes)
        if recipe.is_shared or recipe.relabelled > 0:
            settings = {"per_finger": True} | settings
        if (task, algorithm) == ("push", "ppo"):
            settings = {"duration": 6.0} | settings
            more = {"episodes": 30_000} | more
        options = Options.of(task)
        for name, value in settings.items():
            _check_type(name, value, getattr(options, name, value))
        # There are about a hundred evaluations at most, so that they take little of the time.
        episodes = more.get("episodes", 700)
        more.setdefault("evaluation_interval", max(50, episodes // 100))
        more.setdefault("checkpoint_interval", max(25, episodes // 100))
        plan = cls(task=task, recipe=recipe, options=Options.of(task, **settings), **more)
        if recipe.approach > 0 and task in ("reach", "finger_reach"):
            raise InvalidArgument("approach is for tasks with an object")
        if plan.episodes < 1:
            raise InvalidArgument(f"episodes is {plan.episodes}, must be at least 1")
        return plan

    def to_json(self) -> str:
        """The plan as JSON, as the folder of a run holds it."""
        return json.dumps(dataclasses.asdict(self), indent=2)

    @classmethod
    def of_folder(cls, folder: Path) -> Self:
        """The plan of the training in a folder."""
        if not (folder / PLAN).is_file():
            raise InvalidArgument(f"there is no training in {folder}")
        return cls.from_json((folder / PLAN).read_text())

    @classmethod
    def from_json(cls, text: str) -> Self:
        """The plan from the text that to_json() returned."""
        fields = json.loads(text)
        recipe = fields.pop("recipe")
        recipe["layers"] = tuple(recipe["layers"])
        options = Options.from_json(json.dumps(fields.pop("options")))
        return cls(recipe=Recipe(**recipe), options=options, **fields)


def parse_setting(word: str) -> tuple[str, Any]:
    """Key and value of KEY=VALUE; the value is a literal of Python or else a word."""
    name, equals, text = word.partition("=")
    if not equals:
        raise InvalidArgument(f"'{word}' is no KEY=VALUE")
    try:
        return name, ast.literal_eval(text)
    except (SyntaxError, ValueError):
        return name, text


def _check_type(name: str, value: Any, usual: Any) -> None:
    kinds = (int, float) if type(usual) is float else (type(usual),)
    if type(value) not in kinds:
        raise InvalidArgument(f"{name} is {value!r}, must be like {usual!r}")


class Training:
    """A training in a folder; if the folder has a checkpoint of its plan, it goes on from there."""

    def __init__(
        self,
        plan: Plan,
        folder: Path,
        say: Callable[[str], None] = lambda _: None,
        show_progress: Callable[[int], None] = lambda _: None,
        after_evaluation: Callable[[Training], None] = lambda _: None,
    ) -> None:
        """`say` gets lines for people; `show_progress` often gets the number of ended episodes.

        `after_evaluation` is called when `curve` has a new entry; act() is then the policy that was
        evaluated. Raises InvalidArgument if the folder has a training with another plan.
        """
        self.plan, self.folder, self._say, self._show_progress = plan, folder, say, show_progress
        self._after_evaluation = after_evaluation
        if (folder / PLAN).exists() and Plan.from_json((folder / PLAN).read_text()) != plan:
            raise InvalidArgument(f"{folder} has a training by another plan")
        self.curve: list[tuple[int, Summary]] = []
        self._ways: dict[str, Array] = {}
        self._next_checkpoint = 0
        recipe = plan.recipe
        # A set number keeps sums the same. One thread is enough for the batches of a single robot.
        torch.set_num_threads(_threads(recipe))
        self._rows = Rows(
            _environments(plan),
            is_per_finger=plan.options.per_finger,
            is_shared=recipe.is_shared,
            reward_scale=recipe.reward_scale,
            approach=recipe.approach,
            gamma=recipe.gamma,
        )
        self._normalizer = (
            VecNormalize(self._rows, gamma=recipe.gamma) if recipe.algorithm == "ppo" else None
        )
        self._evaluator = Evaluator(plan.task, plan.options)
        self._total = plan.episodes * self._evaluator.episode_actions * self._rows.rows
        self._model = _model(plan, self._normalizer or self._rows, self._total)
        # Each robot begins with episode 0 of its seed.
        self._begin(np.zeros(recipe.num_envs, np.int64))
        folder.mkdir(parents=True, exist_ok=True)
        _replace(folder / PLAN, plan.to_json().encode())
        self._restore()
        board = _Board(folder / "tensorboard", self._model.num_timesteps)
        self._model.set_logger(Logger(str(folder), [board]))

    @classmethod
    def resume(cls, folder: Path, *callbacks: Callable[[Any], None]) -> Self:
        """The training in a folder, which goes on after its newest checkpoint."""
        return cls(Plan.of_folder(folder), folder, *callbacks)

    def run(self) -> Summary:
        """Trains to the end, writes policy and curve, and returns the last evaluation.

        Ctrl-C raises KeyboardInterrupt; resume() then goes on after the newest checkpoint.
        """
        self._say(self.plan.to_json())
        remaining = self._total - self._model.num_timesteps
        if remaining > 0:
            self._started = (time.monotonic(), self._model.num_timesteps)
            self._model.learn(
                remaining,
                callback=_BetweenRollouts(self._look),
                reset_num_timesteps=False,
                log_interval=4 * self._rows.rows,
            )
            self._evaluate("end")
            self._save()
        _replace(self.folder / CURVE, _curve_file(self.curve))
        metadata = policy_metadata(self.plan.task, self.plan.options)
        policy_file.export(self._model, self.policy_path, metadata=metadata)
        return self.curve[-1][1]

    def save_curve(self) -> None:
        """Draws the learning curve into the folder."""
        save_curve({self.plan.task: self.curve}, self.folder / "curve.png")

    def save_figures(self, view: View | None = None) -> None:
        """Draws the learning curve, paths to the goals and a film of the policy into the folder."""
        task = self.plan.task
        self.save_curve()
        if task in WAYS:
            save_ways(self._ways, self.folder / WAYS[task])
        film = self.folder / "film.mp4"
        save_policy_film(self.act, task, self.plan.options, film, self._rows.rows, view)

    @property
    def policy_path(self) -> Path:
        """The file of the policy; it exists after the training."""
        return self.folder / f"{self.plan.task}.policy"

    @property
    def episodes(self) -> int:
        """Number of episodes that have ended."""
        return int(self._rows.episodes.sum())

    @property
    def episode_actions(self) -> int:
        """Number of actions in an episode that is not terminated early."""
        return self._evaluator.episode_actions

    def act(self, observations: Array, *, with_noise: bool = False) -> Array:
        """Actions of the policy; with `with_noise`, SAC and PPO draw them as in training."""
        actions, _ = self._model.predict(
            self._normalized(observations), deterministic=not with_noise
        )
        return actions

    def close(self) -> None:
        """Closes the environments."""
        self._rows.close()

    def _begin(self, episodes: Array) -> None:
        self._model._last_obs = self._normalized(self._rows.begin(self.plan.seed, episodes))
        self._model._last_episode_starts = np.ones(self._rows.num_envs, bool)

    # Observations in the form that the networks get.
    def _normalized(self, observations: Array) -> Array:
        if self._normalizer is None:
            return observations
        # It returns a dictionary only for a dictionary, but its annotation does not say so.
        normalized: Array = self._normalizer.normalize_obs(observations)  # type: ignore[assignment]
        return normalized

    # Called between rollouts, when all transitions are stored and all gradient steps are done.
    def _look(self) -> None:
        episodes = self.episodes
        self._show_progress(episodes)
        interval = self.plan.evaluation_interval
        if not self.curve or episodes // interval > self.curve[-1][0] // interval:
            name = "begin" if not self.curve else None
            if len(self._ways) == 1 and episodes >= FIGURE_AFTER:
                name = f"after {episodes} episodes"
            self._evaluate(name)
        if episodes >= self._next_checkpoint:
            self._next_checkpoint = episodes + self.plan.checkpoint_interval
            self._save()

    def _evaluate(self, name: str | None) -> None:
        evaluation = self._evaluator(self.act, self._rows.rows)
        summary = evaluation.summary()
        self.curve.append((self.episodes, summary))
        if name:
            self._ways[name] = evaluation.ways[:SHOWN_EPISODES].astype(np.float32)
        for field in ("median", "success"):
            self._model.logger.record(f"evaluation/{field}", getattr(summary, field))
        self._model.logger.dump(self._model.num_timesteps)
        begin, first = self._started
        done = self._model.num_timesteps
        spent = time.monotonic() - begin
        left = (
            f", {spent / (done - first) * (self._total - done):.0f} s left"
            if spent and done > first
            else ""
        )
        self._say(
            f"episode {self.episodes} of {self.plan.episodes}: "
            f"{100 * summary.median:.2f} cm, success {100 * summary.success:.0f} %{left}"
        )
        self._after_evaluation(self)

    def _save(self) -> None:
        model = self._model
        saved = io.BytesIO()
        model.save(saved)
        state = {
            "model": saved.getvalue(),
            "buffer": getattr(model, "replay_buffer", None),
            "normalizer": self._normalizer,
            "episodes": self._rows.episodes,
            "curve": self.curve,
            "ways": self._ways,
            "next_checkpoint": self._next_checkpoint,
            "random": (random.getstate(), np.random.get_state(), torch.get_rng_state()),  # noqa: NPY002
            "random_actions": model.action_space.np_random,
        }
        # The whole state is one file, replaced in one step: a kill leaves the old or the new file.
        _replace(self.folder / CHECKPOINT, pickle.dumps(state))
        _replace(self.folder / CURVE, _curve_file(self.curve))

    def _restore(self) -> None:
        path = self.folder / CHECKPOINT
        if not path.exists():
            return
        # Loading a pickle can run code; the file is as trusted as the rest of the folder.
        state = pickle.loads(path.read_bytes())  # noqa: S301
        if self._normalizer is not None:
            self._normalizer = state["normalizer"]
            self._normalizer.set_venv(self._rows)
        environment = self._normalizer or self._rows
        model = MODELS[self.plan.recipe.algorithm].load(
            io.BytesIO(state["model"]), env=environment, device="cpu", force_reset=False
        )
        if state["buffer"] is not None:
            setattr(model, "replay_buffer", state["buffer"])  # noqa: B010  (not all algorithms have one)
        self._model = model
        self._begin(state["episodes"])
        self.curve, self._ways = state["curve"], state["ways"]
        self._next_checkpoint = state["next_checkpoint"]
        python, numpy, pytorch = state["random"]
        random.setstate(python)
        np.random.set_state(numpy)  # noqa: NPY002
        torch.set_rng_state(pytorch)
        model.action_space._np_random = state["random_actions"]


class _BetweenRollouts(BaseCallback):
    def __init__(self, look: Callable[[], None]) -> None:
        super().__init__()
        self._look = look

    def _on_rollout_start(self) -> None:
        self._look()

    def _on_step(self) -> bool:
        return True


class _Board(TensorBoardOutputFormat):
    # Drops what a killed run logged after its last checkpoint.
    def __init__(self, folder: Path, first_step: int) -> None:
        self.writer = SummaryWriter(str(folder), purge_step=first_step)
        self._is_closed = False


def _environments(plan: Plan) -> Vector:
    mode = AutoresetMode.SAME_STEP
    if plan.recipe.num_envs == 1:
        return SyncVectorEnv(
            [lambda: Environment(plan.task, options=plan.options)], autoreset_mode=mode
        )
    return VectorEnvironment(
        plan.task,
        plan.recipe.num_envs,
        options=plan.options,
        num_threads=_threads(plan.recipe),
        autoreset_mode=mode,
    )


def _threads(recipe: Recipe) -> int:
    return 1 if recipe.num_envs == 1 else min(2, len(os.sched_getaffinity(0)))


def _model(plan: Plan, rows: VecEnv, total: int) -> BaseAlgorithm:
    recipe = plan.recipe
    common: dict[str, Any] = {
        "learning_rate": LinearSchedule(recipe.learning_rate, recipe.final_learning_rate, 1.0),
        "gamma": recipe.gamma,
        "batch_size": recipe.batch_size,
        "seed": plan.seed,
        "device": "cpu",
    }
    network: dict[str, Any] = {
        "net_arch": list(recipe.layers),
        "optimizer_kwargs": {"fused": True},  # saves a tenth of the time of a gradient step
    }
    if recipe.algorithm == "ppo":
        network |= {"log_std_init": math.log(recipe.initial_noise)}
        model: BaseAlgorithm = PPO(
            "MlpPolicy",
            rows,
            n_steps=recipe.rollout,
            n_epochs=recipe.epochs,
            policy_kwargs=network,
            **common,
        )
    else:
        common |= {
            "policy_kwargs": network,
            "buffer_size": min(recipe.buffer_size, total),
            "learning_starts": recipe.random_actions * rows.num_envs,
            "train_freq": 1,
            "gradient_steps": recipe.gradient_steps,
        }
        if recipe.relabelled > 0:
            common |= {
                "replay_buffer_class": FingerReplayBuffer,
                "replay_buffer_kwargs": _relabelling(plan),
            }
        if recipe.algorithm in ("ddpg", "td3"):
            calls, (size,) = total // rows.num_envs, rows.action_space.shape or (0,)
            common["action_noise"] = FallingNoise(recipe.noise, recipe.final_noise, calls, size)
        model = MODELS[recipe.algorithm]("MlpPolicy", rows, **common)
    return model


def _relabelling(plan: Plan) -> dict[str, Any]:
    if plan.task not in ("reach", "finger_reach") or not plan.options.per_finger:
        raise InvalidArgument("relabelled is for reaches, with per_finger=True")
    shown = dataclasses.replace(plan.options, observation="dictionary")
    space = VectorEnvironment(plan.task, 1, options=shown).single_observation_space["goal"]  # type: ignore[index]
    return {
        "relabelled": plan.recipe.relabelled,
        "reward_scale": plan.recipe.reward_scale,
        "goal_low": space.low[:3],
        "goal_high": space.high[:3],
    }


def _curve_file(curve: Sequence[tuple[int, Summary]]) -> bytes:
    text = io.StringIO()
    names = [field.name for field in dataclasses.fields(Summary) if field.name != "episodes"]
    writer = csv.writer(text)
    writer.writerow(["episode", *names])
    writer.writerows([episode, *(getattr(one, name) for name in names)] for episode, one in curve)
    return text.getvalue().encode()


def _replace(path: Path, content: bytes) -> None:
    partial = path.with_suffix(path.suffix + ".partial")
    with partial.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
