# SPDX-License-Identifier: BSD-3-Clause
"""Marks what will be removed: docs/stability.md has the rules, and a check holds us to them."""

import functools
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, ParamSpec, TypeVar

if TYPE_CHECKING:
    from typing_extensions import deprecated as deprecated  # editors and mypy show its users
else:
    P = ParamSpec("P")
    T = TypeVar("T")

    def deprecated(message: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
        """Lets each call of a function, or each object of a class, warn with this message."""

        def mark(old: Callable[P, T]) -> Callable[P, T]:
            if isinstance(old, type):
                old.__init__ = mark(old.__init__)
                return old

            @functools.wraps(old)
            def call(*arguments: P.args, **named: P.kwargs) -> T:
                warnings.warn(message, DeprecationWarning, stacklevel=2)
                return old(*arguments, **named)

            call.__deprecated__ = message
            return call

        return mark
