# SPDX-License-Identifier: BSD-3-Clause
"""Learns from what a robot lives through, in a process of its own that the robot never waits for.

The process gets experience and sends policies through a connection, so it may be on another
machine. Nothing of what comes through it can run: the messages are those of checkpoint.dump().
"""

from __future__ import annotations

import dataclasses
import tempfile
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

# This import comes first because its error says what to install.
from trifinger.training.model import LibraryModel, rows_of

# isort: split
import numpy as np
import torch

from trifinger.arrays import Array
from trifinger.environments import policy_metadata
from trifinger.errors import Error, InvalidArgument
from trifinger.niceness import be_nice
from trifinger.training import checkpoint
from trifinger.training.algorithm import ClassModel
from trifinger.training.experience import INTERVENTION, PART, Episodes, Transition
from trifinger.training.plan import LIBRARY, Plan

PUBLISH = 1.0  # s between two policies
CHECKPOINT = 20.0  # s between two checkpoints
MOST_STEPS = 50  # gradient steps between two looks for experience
LAST = 20.0  # s for the steps that are still due when the robot has done all episodes


class Learner:
    """Learns by a plan from transitions; knows nothing of robots and connections."""

    def __init__(self, plan: Plan, robot: str | None = None, prior: int = 0) -> None:
        """`robot` is what policies call the configuration of the robot, if not as the plan does.

        `prior` is the number of elements of others, which come first. Their transitions are
        demonstrations, and do not count as a part of the training.
        """
        self.plan = plan
        self._prior, self._others = prior, prior  # elements, and how many of them are to come
        torch.set_num_threads(1)
        # Only its spaces and its geometry are used.
        self._rows = rows_of(plan, 1)
        self.total = plan.episodes * self._rows.one.episode_actions
        """Number of actions until the rates and the noise are what they are at the end."""
        size = (self.total + prior) * self._rows.rows
        is_library = plan.recipe.algorithm in LIBRARY
        self._model = (LibraryModel if is_library else ClassModel)(plan, self._rows, size)
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
        if others := min(self._others, len(elements)):
            elements["flags"][:others] |= INTERVENTION
            self._others -= others
        for transition in self._episodes.add(elements):
            self._remember(transition)

    @property
    def steps_due(self) -> int:
        """How many gradient steps the recipe still has for the experience that is there."""
        recipe = self.plan.recipe
        due = recipe.gradient_steps * (self.transitions - recipe.random_actions)
        return max(0, due - self.updates)

    def update(self, steps: int) -> None:
        """Takes gradient steps; raises Error if the algorithm cannot."""
        self._model.update(steps, self._share)
        self.updates += steps

    def policy(self) -> bytes:
        """The file of the next policy, with the noise by which the robot shall explore.

        Raises Error if there is none, as of weights that are not finite.
        """
        self.published += 1
        metadata = self._metadata | {
            "number": str(self.published),
            "exploration_noise": f"{self.noise:.6f}",
            "exploration_color": f"{self.plan.recipe.noise_color:.6f}",
        }
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "policy"
            try:
                self._model.export(path, metadata)
            except InvalidArgument as error:
                raise Error(f"{self.plan.recipe.algorithm} has no policy: {error}") from error
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
        """The newest losses, by name."""
        return self._model.losses

    def state(self) -> dict[str, Any]:
        """What was learned, without the memory: the experience is in the logs."""
        numbers = (self.transitions, self.updates, self.published)
        return {"model": self._model.state(), "numbers": numbers}

    def restore(self, state: dict[str, Any]) -> None:
        """Goes on from a state() of the same plan, after add() of all that is still remembered.

        Raises InvalidArgument if the state is none of this plan.
        """
        try:
            self._model.restore(state["model"])
            transitions, self.updates, self.published = state["numbers"]
        except (KeyError, RuntimeError, TypeError, ValueError) as error:
            raise InvalidArgument(
                "the state in the file 'learner' is of another algorithm or version: "
                f"{' '.join(str(error).split())}; without it all experience is learned anew"
            ) from error
        self.transitions = max(self.transitions, transitions)

    def _remember(self, transition: Transition) -> None:
        rows, before, after = self._rows, transition.before, transition.after
        reward, achieved = rows.judge(before, after, terminated=transition.terminated)
        infos = {
            "TimeLimit.truncated": transition.ended and not transition.terminated,
            "is_demonstration": bool(after["flags"] & INTERVENTION),
        }
        self._model.memory.add(
            before["observation"].reshape(rows.rows, -1),
            after["observation"].reshape(rows.rows, -1),
            after["action"].reshape(rows.rows, -1),
            reward,
            np.full(rows.rows, transition.ended),
            [infos | {"achieved_goal": one} for one in achieved],
        )
        self.transitions += 1


def serve(connection: Connection, algorithm: str | None = None) -> None:
    """Learns from what comes through the connection, until all of it is learned or the end is gone.

    `algorithm` must be said if it is MODULE:CLASS: only then is that module imported.

    The first message has the plan, and a state() to go on from if there is one. From then on this
    end asks for experience, and sends policies and states.
    """
    be_nice()
    first = checkpoint.load(connection.recv_bytes())
    plan = Plan.from_json(first["plan"])
    plan.require_said(Path("the training"), None, algorithm)
    with tempfile.TemporaryDirectory() as folder:
        # The robot's configuration, which may be on another machine.
        file = Path(folder) / "robot.yml"
        file.write_text(first["configuration"])
        here = dataclasses.replace(plan, robot_config=str(file))
        learner = Learner(here, plan.robot_config, first["prior"])
    try:
        while len(experience := _ask(connection, waits=False)["experience"]) == PART:
            learner.add(experience)
        learner.add(experience)
        if first["state"] is not None:
            learner.restore(first["state"])
        learner.published = max(learner.published, first["published"])
        _go_on(learner, connection)
    except (EOFError, ConnectionError):
        raise Error("the training has ended or is gone") from None


def _ask(connection: Connection, waits: bool) -> Any:
    connection.send_bytes(checkpoint.dump({"kind": "more", "waits": waits}))
    return checkpoint.load(connection.recv_bytes())


def _go_on(learner: Learner, connection: Connection) -> None:
    def send(kind: str, **more: Any) -> None:
        connection.send_bytes(checkpoint.dump({"kind": kind} | more))

    send("policy", **_policy(learner))
    published = saved = time.monotonic()
    updates, is_whole, last = learner.updates, False, time.monotonic()
    while not is_whole or (learner.steps_due and time.monotonic() - last < LAST):
        # What has happened comes first: a slow learner falls behind in learning only.
        message = _ask(connection, waits=not learner.steps_due)
        learner.add(message["experience"])
        if not is_whole:
            is_whole, last = message["is_whole"], time.monotonic()
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
