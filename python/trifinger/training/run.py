# SPDX-License-Identifier: BSD-3-Clause
"""A training from its beginning, or from its newest checkpoint, to its end."""

import csv
import dataclasses
import io
import random
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, cast

# This import comes first because its error says what to install.
from trifinger.training.model import OffPolicy, rows_of

# isort: split
import numpy as np
import torch
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat
from torch.utils.tensorboard import SummaryWriter

from trifinger.arrays import Array
from trifinger.environments import (
    Environment,
    ResetStates,
    VectorEnvironment,
    policy_metadata,
)
from trifinger.errors import InvalidArgument
from trifinger.evaluation import (
    SHOWN_EPISODES,
    Evaluator,
    Summary,
    save_curve,
    save_paths,
    save_policy_film,
)
from trifinger.picture import View
from trifinger.stable_baselines import Rows
from trifinger.training import checkpoint
from trifinger.training.plan import ON_POLICY, PLAN, TALLY, Plan
from trifinger.whole_file import replace_file

if TYPE_CHECKING:
    from trifinger.training.on_policy import OnPolicy

CHECKPOINT = "checkpoint"
CURVE = "curve.csv"
RESET_STATES = "reset_states.npz"
# Name of the figure of paths to the goals as seen from above, by task.
PATH_FIGURES = {
    "reach": "tips.png",
    "finger_reach": "tips.png",
    "push": "object.png",
    "lift": "object.png",
}
FIGURE_AFTER = 200  # the paper's figure shows this episode between the first and the last


class Training:
    """A training in a folder; if the folder has a checkpoint of its plan, it goes on from there."""

    def __init__(
        self,
        plan: Plan,
        folder: Path,
        say: Callable[[str], None] = lambda _: None,
        show_progress: Callable[[int], None] = lambda _: None,
        after_evaluation: Callable[[Any], None] = lambda _: None,
        *,
        num_threads: int | None = None,
        make_simulations: Callable[..., VectorEnvironment] = VectorEnvironment,
    ) -> None:
        """`say` gets lines for people; `show_progress` often gets the number of ended episodes.

        `after_evaluation` is called when `curve` has a new entry; act() is then the policy that was
        evaluated. Many robots move on `num_threads`, by default two where there are as many
        processors; it changes no result. `make_simulations` makes them, such as ones on a GPU.
        Raises InvalidArgument if the folder has a training with another plan.
        """
        self.plan, self.folder, self._say, self._show_progress = plan, folder, say, show_progress
        self._after_evaluation = after_evaluation
        if (folder / TALLY).exists():
            raise InvalidArgument(f"{folder} has a training on a robot: trifinger learn --resume")
        if (folder / PLAN).exists() and Plan.from_json((folder / PLAN).read_text()) != plan:
            raise InvalidArgument(f"{folder} has a training by another plan")
        self.policy_path = folder / f"{plan.name}.policy"
        """The file of the policy; it exists after the training."""
        self.curve: list[tuple[int, Summary]] = []
        self._paths: dict[str, Array] = {}
        self._next_checkpoint = 0
        recipe = plan.recipe
        # A set number keeps sums the same. Batches are so small that a second thread mostly waits.
        torch.set_num_threads(1)
        self._rows = rows_of(plan, recipe.num_envs, num_threads, make_simulations)
        self._evaluator = Evaluator(**plan.environment)
        self._total = plan.episodes * self._evaluator.episode_actions * self._rows.rows
        self._model = _model_of(plan, self._rows, self._total)
        # A training that goes on begins in the same states, whatever has become of their file.
        kept = folder / RESET_STATES
        states = kept if kept.exists() else recipe.reset_states
        name = self._rows.one._core.object_name
        resets = ResetStates.load(states, name) if recipe.reset_states else None
        if resets is not None:
            cast(VectorEnvironment, self._rows.one).set_reset_states(resets, recipe.reset_share)
        # Each robot begins with episode 0 of its seed.
        self._begin(np.zeros(recipe.num_envs, np.int64))
        folder.mkdir(parents=True, exist_ok=True)
        if resets is not None and not kept.exists():
            resets.save(kept)
        replace_file(folder / PLAN, plan.to_json().encode())
        self._restore()
        board = _Board(folder / "tensorboard", self._model.actions)
        self._logger = Logger(str(folder), [board])

    @classmethod
    def resume(
        cls, folder: Path, *callbacks: Callable[[Any], None], task: str | None = None
    ) -> Self:
        """The training in a folder, which goes on after its newest checkpoint."""
        return cls(Plan.of_folder(folder, task), folder, *callbacks)

    def run(self) -> Summary:
        """Trains to the end, writes policy and curve, and returns the last evaluation.

        Ctrl-C raises KeyboardInterrupt; resume() then goes on after the newest checkpoint.
        """
        plan, count = self.plan, self.plan.recipe.num_envs
        self._say(
            f"{plan.task} by {plan.recipe.algorithm}: {plan.episodes} episodes of {count} "
            f"robot{'s' if count > 1 else ''}, seed {plan.seed}; {self.folder / PLAN} has all "
            "settings."
        )
        if self._model.actions < self._total:
            self._started = (time.monotonic(), self._model.actions)
            self._model.learn(self._logger, self._look)
            self._evaluate("end")
            self._save()
        replace_file(self.folder / CURVE, _curve_file(self.curve))
        self._model.export(self.policy_path, policy_metadata(**self.plan.environment))
        return self.curve[-1][1]

    def save_curve(self) -> None:
        """Draws the learning curve into the folder."""
        save_curve({self.plan.name: self.curve}, self.folder / "curve.png")

    def save_figures(self, view: View | None = None) -> None:
        """Draws the learning curve, paths to the goals and a film of the policy into the folder."""
        task = self.plan.task
        self.save_curve()
        if task in PATH_FIGURES:
            save_paths(self._paths, self.folder / PATH_FIGURES[task])
        scene = Environment(**self.plan.environment, render_mode="rgb_array", view=view)
        save_policy_film(self.act, scene, self.folder / "film.mp4", self._rows.rows)

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
        return self._model.act(observations, with_noise=with_noise)

    def close(self) -> None:
        """Closes the environments."""
        self._rows.close()

    def _begin(self, episodes: Array) -> None:
        # Trainings with other seeds have other episodes.
        first = self.plan.seed * self.plan.recipe.num_envs
        self._model.begin(self._rows.begin(first, episodes))

    # Called between rollouts, when all transitions are stored and all gradient steps are done.
    def _look(self) -> None:
        episodes = self.episodes
        self._show_progress(episodes)
        interval = self.plan.evaluation_interval
        if not self.curve or episodes // interval > self.curve[-1][0] // interval:
            name = "begin" if not self.curve else None
            if len(self._paths) == 1 and episodes >= FIGURE_AFTER:
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
            self._paths[name] = evaluation.paths[:SHOWN_EPISODES].astype(np.float32)
        for field in ("median", "success"):
            self._logger.record(f"evaluation/{field}", getattr(summary, field))
        self._logger.dump(self._model.actions)
        begin, first = self._started
        done = self._model.actions
        spent = time.monotonic() - begin
        left = ""
        if spent and done > first:
            left = f", {spent / (done - first) * (self._total - done):.0f} s left"
        self._say(f"episode {self.episodes} of {self.plan.episodes}: {summary.in_short}{left}")
        self._after_evaluation(self)

    def _save(self) -> None:
        state = {
            "model": self._model.state(),
            "episodes": self._rows.episodes,
            "curve": [(episode, dataclasses.asdict(one)) for episode, one in self.curve],
            "ways": self._paths,
            "next_checkpoint": self._next_checkpoint,
            "random": (random.getstate(), np.random.get_state(), torch.get_rng_state()),  # noqa: NPY002
            "random_of_gpus": torch.cuda.get_rng_state_all(),  # none without a GPU
        }
        # The whole state is one file, replaced in one step: a kill leaves the old or the new file.
        replace_file(self.folder / CHECKPOINT, checkpoint.dump(state))
        replace_file(self.folder / CURVE, _curve_file(self.curve))

    def _restore(self) -> None:
        path = self.folder / CHECKPOINT
        if not path.exists():
            return
        if not path.is_file():
            raise InvalidArgument(f"{path} is no regular file")
        try:
            self._take(checkpoint.load(path.read_bytes()))
        except (LookupError, RuntimeError, TypeError, ValueError) as error:
            raise InvalidArgument(
                f"{path} is no checkpoint of this training: {error}. It is damaged or from an "
                f"earlier version; without it --resume {self.folder} begins anew"
            ) from error

    def _take(self, state: dict[str, Any]) -> None:
        self._model.restore(state["model"])
        self._begin(state["episodes"])
        self.curve = [(episode, Summary(**one)) for episode, one in state["curve"]]
        self._paths = state["ways"]
        self._next_checkpoint = state["next_checkpoint"]
        python, numpy, pytorch = state["random"]
        random.setstate(python)
        np.random.set_state(numpy)  # noqa: NPY002
        torch.set_rng_state(pytorch)
        torch.cuda.set_rng_state_all(state["random_of_gpus"])


def _model_of(plan: Plan, rows: Rows, total: int) -> "OffPolicy | OnPolicy":
    if plan.recipe.algorithm != ON_POLICY:
        return OffPolicy(plan, rows, total)
    # Its import takes a second that the others need not wait.
    from trifinger.training.on_policy import OnPolicy

    return OnPolicy(plan, rows, total)


class _Board(TensorBoardOutputFormat):
    # Drops what a killed run logged after its last checkpoint.
    def __init__(self, folder: Path, first_step: int) -> None:
        self.writer = SummaryWriter(str(folder), purge_step=first_step)
        self._is_closed = False


def _curve_file(curve: Sequence[tuple[int, Summary]]) -> bytes:
    text = io.StringIO()
    names = [one.name for one in dataclasses.fields(Summary)]
    names = [name for name in names if name not in ("episodes", "unit")]
    writer = csv.writer(text)
    writer.writerow(["episode", *names])
    writer.writerows([episode, *(getattr(one, name) for name in names)] for episode, one in curve)
    return text.getvalue().encode()
