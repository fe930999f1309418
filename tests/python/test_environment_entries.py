# SPDX-License-Identifier: BSD-3-Clause
"""A step of an environment enters C++ once."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from trifinger import _trifinger
from trifinger.environments import Environment, VectorEnvironment

pytestmark = pytest.mark.bindings

OPTIONS = [
    {},
    {"mapping": "state_augmentation", "action": "torque"},
    {"observation": "dictionary"},
    {"friction": (0.7, 1.2)},
]


class Entries:
    """Counts the calls of functions in C++ and the attributes that are read there."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.names: list[str] = []
        for kind in vars(_trifinger).values():
            if not isinstance(kind, type):
                continue
            for name, member in list(vars(kind).items()):
                if name.startswith("__") and name != "__call__":
                    continue
                label = f"{kind.__name__}.{name}"
                if isinstance(member, property):
                    counted: Any = property(self._counted(label, member.fget), member.fset)
                elif type(member).__name__ == "nb_method":
                    counted = self._counted(label, member)
                else:
                    continue
                monkeypatch.setattr(kind, name, counted)
        for name, function in list(vars(_trifinger).items()):
            if type(function).__name__ == "nb_func":
                monkeypatch.setattr(_trifinger, name, self._counted(name, function))

    def _counted(self, label: str, function: Any) -> Any:
        def counted(*arguments: Any, **named: Any) -> Any:
            self.names.append(label)
            return function(*arguments, **named)

        return counted


@pytest.fixture
def entries(monkeypatch: pytest.MonkeyPatch) -> Iterator[Entries]:
    yield Entries(monkeypatch)
    monkeypatch.undo()


def test_the_count_sees_functions_and_attributes(entries: Entries) -> None:
    environment = Environment("reach")
    environment.reset(seed=1)
    entries.names.clear()
    assert environment.episode_actions == 100
    assert environment.process.robot.current_time_index() >= 0
    assert entries.names == ["Episodes.episode_actions", "Frontend.current_time_index"]


@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize("task", ["reach", "push", "dclaw_turn_fixed"])
def test_a_step_enters_cpp_once(task: str, options: dict[str, Any], entries: Entries) -> None:
    single = Environment(task, **options)
    vector = VectorEnvironment(task, 2, **options)
    for environment, core in ((single, "Episodes"), (vector, "EnvironmentBatch")):
        environment.reset(seed=1)
        entries.names.clear()
        for _ in range(3):
            environment.step(np.zeros(environment.action_space.shape, np.float32))
        assert entries.names == 3 * [f"{core}.step"]
