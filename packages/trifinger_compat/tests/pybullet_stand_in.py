# SPDX-License-Identifier: BSD-3-Clause
"""A module with the interface of PyBullet, where PyBullet itself is not needed."""

import operator
from functools import partial
from types import SimpleNamespace
from typing import Any

from trifinger_compat.bullet_names import CONSTANTS, FUNCTIONS


class PyBullet(SimpleNamespace):
    """Keeps what it was called with, and gives back the name of each call."""

    def __init__(self) -> None:
        functions = {name: partial(self._call, name) for name in FUNCTIONS}
        super().__init__(**CONSTANTS, **functions, error=type("error", (Exception,), {}))
        self._calls: list[tuple[Any, ...]] = []
        self._is_connected = True

    def _call(self, name: str, *words: Any, **named: Any) -> Any:
        for value in (*words, *named.values()):
            if not isinstance(value, list | tuple | str | float):
                operator.index(value)  # so does PyBullet, written in C
        self._calls.append((name, words, named))
        return self._is_connected if name == "isConnected" else name
