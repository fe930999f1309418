# SPDX-License-Identifier: BSD-3-Clause
"""`./run evaluate algorithms`: which algorithm learns most from few transitions of one robot.

RLPD of `trifinger learn`, and CrossQ and DroQ, which are classes of this file: a reach from scratch
without tricks of its own, and a push with 20 demonstrations. Each takes the gradient steps that
a fifth of a processor has time for, by what a step costs in this run. The robot is a
simulation in this process, so an hour of it takes some minutes.
"""

import argparse
import copy
import dataclasses
import itertools
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
import trifinger
from gymnasium.vector import AutoresetMode
from push_demonstrations import Demonstrator
from torch import nn
from torch.nn import functional
from trifinger.environments import VectorEnvironment
from trifinger.training import Plan, Recipe, rlpd
from trifinger.training.algorithm import Batch
from trifinger.training.experience import INTERVENTION, TERMINATED, TRUNCATED, Transition
from trifinger.training.learner import Learner
from trifinger.training.rlpd import descend

SHARE = 0.2  # of a processor that learns
DROPOUT = 0.01  # the value of the paper for most tasks
MOMENTUM = (0.5, 0.999)  # of Adam, in CrossQ
SHOWN = 20  # successful demonstrations of a push
JUDGED = 50  # new episodes, without noise


class DroppedCritics(rlpd.Critics):
    """The critics of RLPD with dropout before each layer norm."""

    def normalised(self, values: torch.Tensor) -> torch.Tensor:
        """The values of a hidden layer before its gains, shifts and activation."""
        return super().normalised(functional.dropout(values, DROPOUT))


class Droq(rlpd.Rlpd):
    """RLPD with dropout in the critics (Hiraoka et al. 2022, arXiv 2110.02034)."""

    def __init__(self, observations: int, actions: int, recipe: Recipe) -> None:
        super().__init__(observations, actions, recipe)
        self._critics = DroppedCritics([observations + actions, *recipe.layers])
        self._target = copy.deepcopy(self._critics)
        parameters = self._critics.parameters()
        self._critics_optimizer = torch.optim.Adam(parameters, recipe.learning_rate, fused=True)


class NormedCritics(nn.Module):
    """Critics with batch norm before each layer."""

    def __init__(self, sizes: list[int]) -> None:
        super().__init__()
        self.critics = nn.ModuleList(nn.Sequential(*_normed(sizes)) for _ in range(rlpd.CRITICS))

    def forward(self, observations: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
        """The values, a row for each critic."""
        seen = torch.cat([observations, actions], 1)
        return torch.stack([critic(seen)[:, 0] for critic in self.critics])


def _normed(sizes: list[int]) -> Iterator[nn.Module]:
    for inputs, outputs in itertools.pairwise([*sizes, 1]):
        yield nn.BatchNorm1d(inputs, track_running_stats=False)
        yield nn.Linear(inputs, outputs)
        if outputs > 1:
            yield nn.ReLU()


class CrossQ(rlpd.Rlpd):
    """No copy of the critics, and batch norm over both halves (Bhatt et al. 2024, 1902.05605)."""

    def __init__(self, observations: int, actions: int, recipe: Recipe) -> None:
        super().__init__(observations, actions, recipe)
        self._normed = NormedCritics([observations + actions, *recipe.layers])
        self._actor_optimizer, self._critics_optimizer = (
            torch.optim.Adam(module.parameters(), recipe.learning_rate, MOMENTUM, fused=True)
            for module in (self._actor, self._normed)
        )

    def update(self, batch: Batch) -> dict[str, float]:
        """Takes a gradient step of the critics, and every second time one of the actor."""
        before, after, then = self._scaled(batch)
        now, later = self._both(before, batch.actions, after, then)
        value = batch.rewards + self._gamma * (1 - batch.terminated) * later.detach().amin(0)
        loss = (now - value).square().mean(1).sum()
        descend(self._critics_optimizer, self._normed.parameters(), loss)
        self._steps += 1
        if self._steps % rlpd.ACTOR_EVERY == 0:
            acts = self._actor(before)
            _, values = self._both(before, batch.actions, before, acts)
            self._improve(batch, acts, values.mean(0))
        return {"critic_loss": loss.item() / rlpd.CRITICS}

    def _both(
        self, seen: torch.Tensor, acted: torch.Tensor, then: torch.Tensor, acts: torch.Tensor
    ) -> tuple[torch.Tensor, ...]:
        values: torch.Tensor = self._normed(torch.cat([seen, then]), torch.cat([acted, acts]))
        return values.chunk(2, 1)


KINDS = {"RLPD": "rlpd", "CrossQ": f"{__name__}:CrossQ", "DroQ": f"{__name__}:Droq"}


class Trial:
    """A learner beside a simulated robot."""

    def __init__(self, plan: Plan) -> None:
        self.plan, self.learner = plan, Learner(plan)
        self.robot = VectorEnvironment(
            plan.task,
            1,
            options=plan.options,
            num_threads=1,
            autoreset_mode=AutoresetMode.DISABLED,
        )
        self._random = np.random.default_rng(plan.seed)
        self._demonstrator: Demonstrator | None = None

    def episode(self, seed: int, number: int, noise: float = 0.0) -> list[Transition]:
        """What happens in an episode, with white noise on actions."""
        seen: Any
        seen, _ = self.robot.reset(seed=seed, options={"episode": number})
        policy = self._policy()
        happened: list[Transition] = []
        is_over = False
        while not is_over:
            before = seen[0].copy()
            if self._demonstrator is not None:
                change = self.plan.options.position_change
                action = self._demonstrator.action(self.robot.entries(before), change)
            else:
                action = policy(before)
                action = action + noise * self._random.standard_normal(len(action))
            action = np.clip(action, -1.0, 1.0).astype(np.float32)
            seen, rewards, terminated, truncated, info = self.robot.step(action[None])
            flags = TERMINATED * terminated[0] | TRUNCATED * truncated[0]
            after: Any = {
                "observation": seen[0].copy(),
                "action": action,
                "reward": rewards[0],
                "achieved": info["achieved_goal"][0].copy(),
                "desired": info["desired_goal"][0].copy(),
                "distance": float(np.max(info["distance"])),
                "flags": int(flags) | INTERVENTION * (self._demonstrator is not None),
            }
            happened.append(Transition(cast(Any, {"observation": before}), after, is_cut=False))
            is_over = bool(flags)
        return happened

    def show(self, count: int) -> None:
        """Remembers successful demonstrations."""
        number = 0
        while count > 0:
            self._demonstrator = Demonstrator()
            happened = self.episode(20, number)
            number += 1
            if happened[-1].after["distance"] < 0.02:
                self.remember(happened)
                count -= 1
        self._demonstrator = None
        self.learner._prior = self.learner.transitions  # no part of the training

    def remember(self, happened: list[Transition]) -> None:
        """Gives transitions to the learner."""
        for one in happened:
            self.learner._remember(one)

    def _policy(self) -> trifinger.Policy:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "policy"
            path.write_bytes(self.learner.policy())
            return trifinger.Policy(path)

    def judged(self) -> list[float]:
        """Final distances of new episodes [m]."""
        return [float(self.episode(1000, i)[-1].after["distance"]) for i in range(JUDGED)]


def train(plan: Plan, every: int) -> Iterator[str]:
    """Trains; yields a row of the table after every so many episodes."""
    trial = Trial(plan)
    learner, robot = trial.learner, trial.robot
    if plan.task == "push":
        trial.show(SHOWN)
    period = plan.options.steps_per_action / 1000  # s between two actions
    spent, owed, lived = 0.0, learner.transitions * period * SHARE, 0.0
    for number in range(plan.episodes):
        happened = trial.episode(plan.seed, number, learner.noise)
        trial.remember(happened)
        lived += len(happened) * period
        owed += len(happened) * period * SHARE
        begin = time.process_time()
        while spent + time.process_time() - begin < owed:
            learner.update(10)
        spent += time.process_time() - begin
        if (number + 1) % every == 0:
            ends = trial.judged()
            success = 100 * float(np.mean(np.array(ends) < 0.02))
            low, median, high = (100 * float(one) for one in np.percentile(ends, [25, 50, 75]))
            yield (
                f"{lived / 60:.0f} min | {median:.2f} ({low:.2f} to {high:.2f}) | "
                f"{success:.0f} | {learner.updates / learner.transitions:.1f} | "
                f"{1000 * spent / learner.updates:.1f}"
            )
    robot.close()


def main() -> None:
    """Compares."""
    parser = argparse.ArgumentParser(prog="./run evaluate algorithms", description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument(
        "--only", default="", metavar="TEXT", help="task and algorithm, as in push-RLPD"
    )
    arguments = parser.parse_args()
    head = "task, algorithm, seed | time of the robot | median (quartiles) [cm] | within 2 cm [%]"
    print(f"| {head} | steps per action | ms per step |\n|---|---|---|---|---|---|", flush=True)
    tasks = {"reach": (700, 175), "push": (300, 75)}
    for (task, (episodes, every)), (name, algorithm), seed in itertools.product(
        tasks.items(), KINDS.items(), range(1, arguments.seeds + 1)
    ):
        if arguments.only not in f"{task}-{name}":
            continue
        plan = Plan.of(task, "rlpd", episodes=episodes, seed=seed)
        recipe = dataclasses.replace(plan.recipe, algorithm=algorithm, layers=(128, 128))
        plan = dataclasses.replace(plan, recipe=dataclasses.replace(recipe, batch_size=128))
        for row in train(plan, every):
            print(f"| {task}, {name}, {seed} | {row} |", flush=True)


if __name__ == "__main__":
    main()
