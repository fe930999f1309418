# SPDX-License-Identifier: BSD-3-Clause
"""Finds an installed PyBullet, and puts what is served of it beside it.

PyBullet is one compiled module. The package `pybullet` of this distribution comes before it in
the same folder, so both can be installed, and uninstalled, in any order.
"""

import sys
from collections.abc import Callable, Mapping
from functools import update_wrapper
from importlib.machinery import (
    EXTENSION_SUFFIXES,
    ExtensionFileLoader,
    FileFinder,
    ModuleSpec,
)
from importlib.util import module_from_spec
from inspect import getmembers, isfunction
from types import BuiltinFunctionType
from typing import Any

from trifinger_compat import bullet_calls
from trifinger_compat.bullet_names import CONSTANTS, FUNCTIONS
from trifinger_compat.handles import VIEWS, Handle, no_such_call, not_installed

SERVED: dict[str, Callable[..., Any]] = {
    name: call for name, call in getmembers(bullet_calls, isfunction) if name in FUNCTIONS
}


class Error(Exception):
    """What PyBullet calls `error`, where it is not installed."""


class _Call:
    """A call of PyBullet, which it gets unless there is an id of a simulation here in it."""

    # pybullet_utils.bullet_client gives its client id to built-in functions alone.
    __class__ = BuiltinFunctionType  # type: ignore[assignment]

    def __init__(self, name: str, theirs: Callable[..., Any]) -> None:
        update_wrapper(self, theirs)
        self.__name__ = name
        self._ours, self._theirs = _ours(name), theirs

    def __call__(self, *words: Any, **named: Any) -> Any:
        return (self._ours if _has_handle(words, named) else self._theirs)(*words, **named)


def _view(name: str, theirs: Any) -> Callable[..., Any]:
    """A call of a view: in the original the one that is meant without an id is the platform's."""

    def call(*words: Any, **named: Any) -> Any:
        is_there = theirs.isConnected(named.get("physicsClientId", 0))
        return (getattr(theirs, name) if is_there else SERVED[name])(*words, **named)

    return call


def find_installed() -> ModuleSpec | None:
    """Where PyBullet is installed; None if it is not."""
    for folder in sys.path:
        finder = FileFinder(folder or ".", (ExtensionFileLoader, EXTENSION_SUFFIXES))
        # The name of this package in front of it: it is no other `pybullet` in sys.modules.
        spec = finder.find_spec(f"{__name__}.pybullet")
        if spec is not None and spec.loader is not None:
            return spec
    return None


def installed() -> Any:
    """PyBullet itself; None if it is not installed."""
    spec = find_installed()
    if spec is None or spec.loader is None:
        return None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def names(theirs: Any) -> Mapping[str, Any]:
    """What `import pybullet` has, with PyBullet itself, or without it if that is None."""
    if theirs is None:
        return {**CONSTANTS, **{name: _ours(name) for name in FUNCTIONS}, "error": Error}
    public = {name: each for name, each in vars(theirs).items() if name[0] != "_"}
    calls = {
        name: _Call(name, _view(name, theirs) if name in VIEWS else each)
        for name, each in public.items()
        if callable(each) and not isinstance(each, type)
    }
    return {**public, **calls}


def _ours(name: str) -> Callable[..., Any]:
    """What becomes of a call that PyBullet does not get."""

    def refuse(*words: Any, **named: Any) -> Any:
        raise no_such_call(name) if _has_handle(words, named) else not_installed(name)

    return SERVED.get(name, refuse)


def _has_handle(words: tuple[Any, ...], named: Mapping[str, Any]) -> bool:
    # Planners make millions of calls: this is faster than `any`.
    for value in words:
        if isinstance(value, Handle):
            return True
    for value in named.values():  # noqa: SIM110
        if isinstance(value, Handle):
            return True
    return False
