# SPDX-License-Identifier: BSD-3-Clause
"""The one place where Python gives MuJoCo the text of a model."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from trifinger import _trifinger
from trifinger.errors import InvalidArgument

if TYPE_CHECKING:
    import mujoco


def model_of(mjcf: str, change: Callable[[Any], None] | None = None) -> mujoco.MjModel:
    """Compiles a model that anybody may have written: it names no files, and its size is limited.

    `change` may change the `mujoco.MjSpec` before.

    Raises:
        InvalidArgument: if it is not a model, or asks for more than a text on its own may have
    """
    import mujoco

    try:
        spec = mujoco.MjSpec.from_string(_trifinger.checked_model_text(mjcf))
        # Inertias that were possible need not be so when they are rounded to the digits of a text.
        spec.compiler.balanceinertia = True
        if change is not None:
            change(spec)
        return spec.compile()
    except (ValueError, InvalidArgument, mujoco.FatalError) as error:
        raise InvalidArgument(f"the model cannot be read: {error}") from error
