# SPDX-License-Identifier: BSD-3-Clause
"""Learns from what a robot lives through, in a process of its own that the robot never waits for.

The process gets experience and sends policies through a connection, so it may be on another
machine. Nothing of what comes through it can run: the messages are those of checkpoint.dump().
"""

from __future__ import annotations

import dataclasses
import os
import tempfile
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, cast

# This import comes first because its error says what to install.
from trifinger.training.model import make_model, rows_of

# isort: split
import numpy as np
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from trifinger import policy_file
from trifinger.arrays import Array
from trifinger.environments import Environment, policy_metadata
from trifinger.errors import Error
from trifinger.tasks import task_of_file
from trifinger.training import checkpoint
from trifinger.training.experience import Episodes, Transition
from trifinger.training.plan import Plan

PUBLISH = 1.0  # s between two policies
CHECKPOINT = 20.0  # s between two checkpoints
MOST_STEPS = 50  # gradient steps between two looks for experience


class Learner:
    """Learns by a plan from transitions; knows nothing of robots and connections."""

    def __init__(self, plan: Plan, robot: str | None = None, prior: int = 0) -> None:
        """`robot` is what policies call the configuration of the robot, if not as the plan does.

        `prior` is the number of transitions of others, which come first and do not count as a part
        of the training.
        """
        self.plan, self._prior = plan, prior
        torch.set_num_threads(1)
        # Only its spaces and its geometry are used.
        environment = SyncVectorEnv(
            [lambda: Environment(**plan.environment)], autoreset_mode=AutoresetMode.SAME_STEP
        )
        self._rows = rows_of(plan, environment)
        one: Environment = environment.envs[0].unwrapped  # type: ignore[assignment]
        self.total = plan.episodes * one.episode_actions
        """Number of actions until the rates and the noise are what they are at the end."""
        model = make_model(plan, self._rows, (self.total + prior) * self._rows.rows)
        model.set_logger(Logger(None, []))
        self._model = cast(OffPolicyAlgorithm, model)
        self._memory = cast(ReplayBuffer, self._model.replay_buffer)
        self._metadata = policy_metadata(**plan.environment)
        self._metadata["robot"] = robot or self._metadata["robot"]
        self._episodes = Episodes()
        self.transitions = 0
        """Number of transitions in the memory of the learner, or that were there."""
        self.updates = 0
        self.published = -1
        """Number of the newest policy."""

    def add(self, elements: Array) -> None:
        """Adds experience: elements that follow those of the last call."""
        for transition in self._episodes.add(elements):
            self._remember(transition)

    @property
    def steps_due(self) -> int:
        """How many gradient steps the recipe still has for the experience that is there."""
        recipe = self.plan.recipe
        due = recipe.gradient_steps * (self.transitions - recipe.random_actions)
        return max(0, due - self.updates)

    def update(self, steps: int) -> None:
        """Takes gradient steps."""
        model = self._model
        model._update_current_progress_remaining(int(self._share * self.total), self.total)
        model.train(steps, self.plan.recipe.batch_size)
        self.updates += steps

    def policy(self) -> bytes:
        """The file of the next policy, with the noise by which the robot shall explore."""
        self.published += 1
        metadata = self._metadata | {
            "number": str(self.published),
            "exploration_noise": f"{self.noise:.6f}",
            "exploration_color": f"{self.plan.recipe.noise_color:.6f}",
        }
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "policy"
            policy_file.export(self._model, path, metadata=metadata)
            return path.read_bytes()

    @property
    def noise(self) -> float:
        """Standard deviation of the noise of exploration; it falls linearly over the training."""
        recipe = self.plan.recipe
        return recipe.noise + self._share * (recipe.final_noise - recipe.noise)

    # The share of the training that is done.
    @property
    def _share(self) -> float:
        return min(max(self.transitions - self._prior, 0) / self.total, 1.0)

    @property
    def losses(self) -> dict[str, float]:
        """The newest losses, by the names of Stable-Baselines3."""
        values = self._model.logger.name_to_value
        return {name: float(value) for name, value in values.items() if name.startswith("train/")}

    def state(self) -> dict[str, Any]:
        """What was learned, without the memory: the experience is in the logs."""
        numbers = (self.transitions, self.updates, self.published)
        return {"model": checkpoint.state_of(self._model), "numbers": numbers}

    def restore(self, state: dict[str, Any]) -> None:
        """Goes on from a state() of the same plan, after add() of all that is still remembered.

        Raises ValueError, KeyError, TypeError or RuntimeError if the state is none of this plan.
        """
        checkpoint.restore(self._model, state["model"])
        transitions, self.updates, self.published = state["numbers"]
        self.transitions = max(self.transitions, transitions)

    def _remember(self, transition: Transition) -> None:
        before, after = transition.before, transition.after
        rows = self._rows
        reward, achieved = rows.judge(
            before["observation"],
            after["observation"],
            after["reward"],
            after["achieved"],
            after["desired"],
            terminated=transition.terminated,
        )
        truncated = transition.ended and not transition.terminated
        infos = [{"achieved_goal": one, "TimeLimit.truncated": truncated} for one in achieved]
        self._memory.add(
            before["observation"].reshape(rows.rows, -1),
            after["observation"].reshape(rows.rows, -1),
            after["action"].reshape(rows.rows, -1),
            reward,
            np.full(rows.rows, transition.ended),
            infos,
        )
        self.transitions += 1


def serve(connection: Connection) -> None:
    """Learns from what comes through the connection, until all of it is learned or the end is gone.

    The first message has the plan, the experience so far, and a state() to go on from if there is
    one. From then on this end asks for more experience, and sends policies and states.
    """
    os.nice(10)
    first = checkpoint.load(connection.recv_bytes())
    plan = Plan.from_json(first["plan"])
    task_of_file(plan.task, None, Path("the training"))  # whose module would be imported here
    with tempfile.TemporaryDirectory() as folder:
        # The robot's configuration, which may be on another machine.
        file = Path(folder) / "robot.yml"
        file.write_text(first["configuration"])
        here = dataclasses.replace(plan, robot_config=str(file))
        learner = Learner(here, plan.robot_config, first["prior"])
    learner.add(first["experience"])
    if first["state"] is not None:
        learner.restore(first["state"])
    learner.published = max(learner.published, first["published"])
    try:
        _go_on(learner, connection)
    except (EOFError, ConnectionError):
        raise Error("the training has ended or is gone") from None


def _go_on(learner: Learner, connection: Connection) -> None:
    def send(kind: str, **more: Any) -> None:
        connection.send_bytes(checkpoint.dump({"kind": kind} | more))

    send("policy", **_policy(learner))
    published = saved = time.monotonic()
    updates, is_whole = learner.updates, False
    while not is_whole or learner.steps_due:
        # What has happened comes first: a slow learner falls behind in learning only.
        send("more", waits=not learner.steps_due)
        message = checkpoint.load(connection.recv_bytes())
        learner.add(message["experience"])
        is_whole = message["is_whole"]
        if steps := min(learner.steps_due, MOST_STEPS):
            learner.update(steps)
        now = time.monotonic()
        if now - published > PUBLISH and learner.updates > updates:
            published, updates = now, learner.updates
            send("policy", **_policy(learner))
        if now - saved > CHECKPOINT:
            saved = now
            send("state", state=learner.state())
    send("policy", **_policy(learner))
    send("state", state=learner.state())
    send("done")


def _policy(learner: Learner) -> dict[str, Any]:
    return {
        "policy": np.frombuffer(learner.policy(), np.uint8),
        "number": learner.published,
        "transitions": learner.transitions,
        "updates": learner.updates,
        "noise": learner.noise,
        "losses": learner.losses,
    }
