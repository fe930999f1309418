# SPDX-License-Identifier: BSD-3-Clause
"""Registration of all tasks with Gymnasium."""

import functools
from typing import Any

import gymnasium

from trifinger._trifinger import task_names
from trifinger.environments.options import AnyTask, options_of
from trifinger.environments.single import Environment, GoalEnvironment
from trifinger.environments.vector import VectorEnvironment

TASKS: tuple[str, ...] = tuple(task_names())


def _gymnasium_id(task: str) -> str:
    return f"TriFinger/{''.join(word.capitalize() for word in task.split('_'))}-v0"


def _make(task: AnyTask, render_mode: Any = None, **arguments: Any) -> Environment:
    options = options_of(task, arguments.get("options"))
    observation = arguments.get("observation", options.observation)
    kind = GoalEnvironment if observation == "goal" else Environment
    return kind(task, render_mode=render_mode, **arguments)


def _make_vector(task: AnyTask, num_envs: int, **arguments: Any) -> VectorEnvironment:
    return VectorEnvironment(task, num_envs, **arguments)


def register() -> None:
    """Makes the tasks known to Gymnasium: "TriFinger/Reach-v0" and so on.

    "TriFinger/Task-v0" takes any task, as in `task="my_tasks:Middle"`.
    """
    makers: dict[str, tuple[Any, Any]] = {
        _gymnasium_id(task): (functools.partial(_make, task), functools.partial(_make_vector, task))
        for task in TASKS
    }
    makers["TriFinger/Task-v0"] = (_make, _make_vector)
    for name, (make, make_vector) in makers.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point=make, vector_entry_point=make_vector)
