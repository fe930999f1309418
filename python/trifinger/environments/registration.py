# SPDX-License-Identifier: BSD-3-Clause
"""Registration of all tasks with Gymnasium."""

import functools
from typing import Any

import gymnasium

from trifinger._trifinger import task_names
from trifinger.environments.single import Environment
from trifinger.environments.vector import VectorEnvironment

TASKS: tuple[str, ...] = tuple(task_names())


def _gymnasium_id(task: str) -> str:
    return f"TriFinger/{''.join(word.capitalize() for word in task.split('_'))}-v0"


def register() -> None:
    """Makes the tasks known to Gymnasium: "TriFinger/Reach-v0" and so on.

    "TriFinger/Task-v0" takes any task, as in `task="my_tasks:Middle"`.
    """
    makers: dict[str, tuple[Any, Any]] = {
        _gymnasium_id(task): (
            functools.partial(Environment, task),
            functools.partial(VectorEnvironment, task),
        )
        for task in TASKS
    }
    makers["TriFinger/Task-v0"] = (Environment, VectorEnvironment)
    for name, (make, make_vector) in makers.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point=make, vector_entry_point=make_vector)
