# SPDX-License-Identifier: BSD-3-Clause
"""Trainings with Stable-Baselines3, which go on where they were killed.

    plan = training.Plan.of("reach", "ddpg", is_shared=True)
    summary = training.Training(plan, Path("run")).run()

docs/training.md has the command, and what lies in the folder of a run.
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

# First, because it says what to install.
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
# The figure of what comes near to its goals, as seen from above.
WAYS = {"reach": "tips.png", "finger_reach": "tips.png", "push": "object.png"}
FIGURE_AFTER = 200  # The episode that the paper shows between begin and end.


@dataclasses.dataclass(frozen=True, kw_only=True)
class Recipe:
    """How a policy learns."""

    algorithm: Algorithm = "ddpg"
    is_shared: bool = False
    """Whether the fingers share one policy."""
    num_envs: int = 1
    """How many robots learn at once; a single one goes through the interface of real ones."""
    gamma: float = 0.9
    learning_rate: float = 1e-3
    final_learning_rate: float = 1e-4
    """It falls linearly, to this at the end."""
    batch_size: int = 128
    gradient_steps: int = 1
    """After each action of all robots; not of PPO."""
    layers: tuple[int, ...] = (256, 256)
    noise: float = 0.2
    final_noise: float = 0.02
    """Of actions of DDPG and TD3, as standard deviations; it falls linearly."""
    reward_scale: float = 10.0
    """Times the reward of the task. PPO divides the sum with that of `approach` by the deviation of
    its returns."""
    relabelled: float = 0.0
    """Above zero: batches are put together finger by finger, with this share of the goals replaced
    by positions that were reached. Only for reaches."""
    approach: float = 0.0
    """Reward of a tip that comes nearer to where it could push the object to its goal; an object
    that comes nearer to its goal has twice as much [1/m]."""
    random_actions: int = 100
    """Of each robot, before it learns; not of PPO."""
    buffer_size: int = 1_000_000
    """The most transitions that are remembered."""
    rollout: int = 100
    """Actions of each robot between updates of PPO."""
    epochs: int = 10
    """How often PPO goes through them."""
    initial_noise: float = 1.0
    """Of actions of PPO at the beginning, as a standard deviation; it learns the rest."""

    @classmethod
    def of(cls, task: str, algorithm: Algorithm, *, is_shared: bool = False) -> Self:
        """What is known to learn, or a beginning where nothing is."""
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
    """A training from begin to end; the same plan gives the same policy."""

    task: str
    recipe: Recipe
    options: Options
    episodes: int = 700
    """Of full length, of all robots together."""
    seed: int = 1
    evaluation_interval: int = 50
    """Episodes."""
    checkpoint_interval: int = 25
    """Episodes."""

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
        """The known recipe, with some fields of `Recipe` and `Options` set otherwise.

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
        # A hundred evaluations at most, so that they take little of the time.
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
        """As the folder of a run has it."""
        return json.dumps(dataclasses.asdict(self), indent=2)

    @classmethod
    def of_folder(cls, folder: Path) -> Self:
        """The plan of the training in a folder."""
        if not (folder / PLAN).is_file():
            raise InvalidArgument(f"there is no training in {folder}")
        return cls.from_json((folder / PLAN).read_text())

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Reads what to_json() has written."""
        fields = json.loads(text)
        recipe = fields.pop("recipe")
        recipe["layers"] = tuple(recipe["layers"])
        options = Options.from_json(json.dumps(fields.pop("options")))
        return cls(recipe=Recipe(**recipe), options=options, **fields)


def parse_setting(word: str) -> tuple[str, Any]:
    """KEY=VALUE, with a value as Python writes it, or a word."""
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
    """A training with its folder. In a folder that has its plan already, it goes on from there."""

    def __init__(
        self,
        plan: Plan,
        folder: Path,
        say: Callable[[str], None] = lambda _: None,
        show_progress: Callable[[int], None] = lambda _: None,
        after_evaluation: Callable[[Training], None] = lambda _: None,
    ) -> None:
        """`say` is given lines for people; `show_progress` how many episodes have ended, often.

        `after_evaluation` is called when `curve` has got another entry; `act` is the policy then.
        """
        self.plan, self.folder, self._say, self._show_progress = plan, folder, say, show_progress
        self._after_evaluation = after_evaluation
        if (folder / PLAN).exists() and Plan.from_json((folder / PLAN).read_text()) != plan:
            raise InvalidArgument(f"{folder} has a training by another plan")
        self.curve: list[tuple[int, Summary]] = []
        self._ways: dict[str, Array] = {}
        self._next_checkpoint = 0
        recipe = plan.recipe
        # Deterministic, and for the batches of a single robot as fast as more.
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
        # The episodes of a seed, from the first on.
        self._begin(np.zeros(recipe.num_envs, np.int64))
        folder.mkdir(parents=True, exist_ok=True)
        _replace(folder / PLAN, plan.to_json().encode())
        self._restore()
        board = _Board(folder / "tensorboard", self._model.num_timesteps)
        self._model.set_logger(Logger(str(folder), [board]))

    @classmethod
    def resume(cls, folder: Path, *callbacks: Callable[[Any], None]) -> Self:
        """The training of a folder, after its newest checkpoint."""
        return cls(Plan.of_folder(folder), folder, *callbacks)

    def run(self) -> Summary:
        """Trains to the end, writes policy and curve, and returns how good the policy is.

        Raises KeyboardInterrupt for Ctrl-C; resume() goes on after the newest checkpoint.
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
        """Draws learning curve, ways to the goals, and a film of the policy into the folder."""
        task = self.plan.task
        self.save_curve()
        if task in WAYS:
            save_ways(self._ways, self.folder / WAYS[task])
        film = self.folder / "film.mp4"
        save_policy_film(self.act, task, self.plan.options, film, self._rows.rows, view)

    @property
    def policy_path(self) -> Path:
        """The file of the policy, once it is trained."""
        return self.folder / f"{self.plan.task}.policy"

    @property
    def episodes(self) -> int:
        """How many have ended."""
        return int(self._rows.episodes.sum())

    @property
    def episode_actions(self) -> int:
        """How many actions an episode has that is not terminated."""
        return self._evaluator.episode_actions

    def act(self, observations: Array, *, with_noise: bool = False) -> Array:
        """What the policy does; `with_noise` as it is drawn in trainings by SAC and PPO."""
        actions, _ = self._model.predict(
            self._normalized(observations), deterministic=not with_noise
        )
        return actions

    def close(self) -> None:
        """Lets go of the environments."""
        self._rows.close()

    def _begin(self, episodes: Array) -> None:
        self._model._last_obs = self._normalized(self._rows.begin(self.plan.seed, episodes))
        self._model._last_episode_starts = np.ones(self._rows.num_envs, bool)

    # As networks see them.
    def _normalized(self, observations: Array) -> Array:
        if self._normalizer is None:
            return observations
        # It gives a dictionary for those of dictionaries alone, which its annotation does not say.
        normalized: Array = self._normalizer.normalize_obs(observations)  # type: ignore[assignment]
        return normalized

    # Where nothing is under way: transitions are stored, gradient steps are done.
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
        # The state of all in one file, replaced in one step: a kill leaves the old or the new one.
        _replace(self.folder / CHECKPOINT, pickle.dumps(state))
        _replace(self.folder / CURVE, _curve_file(self.curve))

    def _restore(self) -> None:
        path = self.folder / CHECKPOINT
        if not path.exists():
            return
        # A pickle, which is code to whoever loads it; it is as trusted as the rest of the folder.
        state = pickle.loads(path.read_bytes())  # noqa: S301
        if self._normalizer is not None:
            self._normalizer = state["normalizer"]
            self._normalizer.set_venv(self._rows)
        environment = self._normalizer or self._rows
        model = MODELS[self.plan.recipe.algorithm].load(
            io.BytesIO(state["model"]), env=environment, device="cpu", force_reset=False
        )
        if state["buffer"] is not None:
            setattr(model, "replay_buffer", state["buffer"])  # noqa: B010  (not of all algorithms)
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
    # What a killed run has logged behind its checkpoint is forgotten.
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
        "optimizer_kwargs": {"fused": True},  # a tenth of the time of a gradient step less
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
