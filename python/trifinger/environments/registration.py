# SPDX-License-Identifier: BSD-3-Clause
"""Registration of all tasks with Gymnasium."""

import functools
from typing import Any

import gymnasium

from trifinger._trifinger import task_names
from trifinger.environments.options import options_of
from trifinger.environments.single import Environment, GoalEnvironment
from trifinger.environments.vector import VectorEnvironment

TASKS: tuple[str, ...] = tuple(task_names())


def _gymnasium_id(task: str) -> str:
    return f"TriFinger/{''.join(word.capitalize() for word in task.split('_'))}-v0"


def _make(task: str, render_mode: Any = None, **arguments: Any) -> Environment:
    options = options_of(task, arguments.get("options"))
    observation = arguments.get("observation", options.observation)
    kind = GoalEnvironment if observation == "goal" else Environment
    return kind(task, render_mode=render_mode, **arguments)


def _make_vector(task: str, num_envs: int, **arguments: Any) -> VectorEnvironment:
    return VectorEnvironment(task, num_envs, **arguments)


def register() -> None:
    """Makes the tasks known to Gymnasium: "TriFinger/Reach-v0" and so on."""
    for task in TASKS:
        name = _gymnasium_id(task)
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point=functools.partial(_make, task),
                vector_entry_point=functools.partial(_make_vector, task),
            )
