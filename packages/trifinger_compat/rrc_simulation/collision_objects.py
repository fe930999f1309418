# SPDX-License-Identifier: BSD-3-Clause
"""Loose objects of a simulation."""

from typing import Any

from trifinger_compat.types import Numbers
from trifinger_simulation.collision_objects import (
    Cube as _Cube,
    Cuboid as Cuboid,
    import_mesh as import_mesh,
)


class Block(_Cube):
    """A cube of 20 g."""

    def __init__(
        self,
        position: Numbers = (0.15, 0.0, 0.0425),
        orientation: Numbers = (0, 0, 0, 1),
        half_size: float = 0.0325,
        mass: float = 0.02,
        **kwargs: Any,
    ) -> None:
        super().__init__(position, orientation, half_size, mass, **kwargs)
