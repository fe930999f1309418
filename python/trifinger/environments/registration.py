# SPDX-License-Identifier: BSD-3-Clause
"""Registration of all tasks with Gymnasium."""

import functools
from typing import Any

import gymnasium

from trifinger._trifinger import task_names
from trifinger.environments.options import Options
from trifinger.environments.single import Environment, GoalEnvironment
from trifinger.environments.vector import VectorEnvironment

TASKS: tuple[str, ...] = tuple(task_names())


def _gymnasium_id(task: str) -> str:
    return f"TriFinger/{''.join(word.capitalize() for word in task.split('_'))}-v0"


# An argument that the class does not have is an option: gymnasium.make(id, steps_per_action=10).
def _with_options(task: str, arguments: dict[str, Any], own: set[str]) -> dict[str, Any]:
    chosen = {name: arguments.pop(name) for name in own & arguments.keys()}
    options = chosen.get("options") or Options.of(task)
    chosen["options"] = options.changed(**arguments)
    return chosen


def _make(task: str, render_mode: Any = None, **arguments: Any) -> Environment:
    own = {"options", "connect", "config", "config_overrides", "view"}
    chosen = _with_options(task, arguments, own)
    kind = GoalEnvironment if chosen["options"].observation == "goal" else Environment
    return kind(task, render_mode=render_mode, **chosen)


def _make_vector(task: str, num_envs: int, **arguments: Any) -> VectorEnvironment:
    own = {"options", "num_threads", "autoreset_mode", "copy", "config", "config_overrides"}
    return VectorEnvironment(task, num_envs, **_with_options(task, arguments, own))


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
