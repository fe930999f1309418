# SPDX-License-Identifier: BSD-3-Clause
"""The one place where Python gives MuJoCo the text of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from trifinger import _trifinger
from trifinger.errors import InvalidArgument

if TYPE_CHECKING:
    import mujoco


def model_of(mjcf: str) -> mujoco.MjModel:
    """Compiles a model that anybody may have written: it names no files, and its size is limited.

    Raises:
        InvalidArgument: if it is not a model, or asks for more than a text on its own may have
    """
    import mujoco

    try:
        return mujoco.MjModel.from_xml_string(_trifinger.checked_model_text(mjcf))
    except (ValueError, InvalidArgument, mujoco.FatalError) as error:
        raise InvalidArgument(f"the model cannot be read: {error}") from error
