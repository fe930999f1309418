# SPDX-License-Identifier: BSD-3-Clause
"""Loose objects of a simulation."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from trifinger_compat.handles import Body, Client
from trifinger_compat.physics import MESH_MARGIN
from trifinger_compat.types import Numbers
from trifinger_compat.world import STATIC_MASS, Item, World, world_of


class BaseCollisionObject:
    """A box in a simulation. It disappears when nobody refers to it any more."""

    def __init__(
        self,
        position: Numbers,
        orientation: Numbers,
        shape: dict[str, object],
        mass: float,
        pybullet_client_id: Client | int,
        margin: float = 0.0,
    ) -> None:
        is_static = mass == 0
        if mass < 0:
            raise ValueError(f"the mass is {mass} kg, must not be negative")
        item = Item(
            shape={**shape, "mass": STATIC_MASS if is_static else mass},
            position=np.array(position, dtype=float),
            orientation=np.array(orientation, dtype=float),
            is_static=is_static,
            margin=margin,
        )
        self._world: World = world_of(pybullet_client_id)
        self._pybullet_client_id = pybullet_client_id
        self._name = self._world.add(item)
        # Robot and table have the lower numbers.
        number = 10 + int(self._name.removeprefix("object_"))
        self._object_id = Body(number, self._world.client_id, self._name)
        self.block = self._object_id
        self.block_id = self._object_id

    def __del__(self) -> None:
        if hasattr(self, "_name"):
            self._world.remove(self._name)

    def set_state(self, position: Numbers, orientation: Numbers) -> None:
        """Places the object at rest: position [m], orientation x, y, z, w."""
        self._world.place(self._name, position, orientation)

    def get_state(self) -> tuple[list[float], list[float]]:
        """Position [m] and orientation x, y, z, w."""
        position, orientation = self._world.pose(self._name)
        return position.tolist(), orientation.tolist()


class Cuboid(BaseCollisionObject):
    """A box of any size; with a mass of 0 it does not move. Without a colour it has six."""

    def __init__(
        self,
        position: Numbers,
        orientation: Numbers,
        half_extents: Sequence[float],
        mass: float,
        color_rgba: Numbers | None = None,
        pybullet_client_id: Client | int = 0,
        **kwargs: Any,
    ) -> None:
        pybullet_client_id = kwargs.pop("physicsClientId", pybullet_client_id)
        shape: dict[str, object] = {
            "type": "cuboid",
            "size": [2 * float(half) for half in half_extents],
        }
        if color_rgba is not None:
            red, green, blue = np.rint(255 * np.asarray(color_rgba, dtype=float)[:3]).astype(int)
            shape["colours"] = [f"#{red:02x}{green:02x}{blue:02x}"] * 6
        super().__init__(position, orientation, shape, mass, pybullet_client_id)


class Cube(Cuboid):
    """A cube."""

    def __init__(
        self,
        position: Numbers = (0.15, 0.0, 0.0425),
        orientation: Numbers = (0, 0, 0, 1),
        half_width: float = 0.0325,
        mass: float = 0.08,
        color_rgba: Numbers | None = None,
        pybullet_client_id: Client | int = 0,
        **kwargs: Any,
    ) -> None:
        half_width = kwargs.pop("half_size", half_width)
        super().__init__(
            position, orientation, [half_width] * 3, mass, color_rgba, pybullet_client_id, **kwargs
        )


Block = Cube


class ColoredCubeV2(BaseCollisionObject):
    """The cube of the competitions of 2020 and 2021: 65 mm, 94 g, six colours."""

    def __init__(
        self,
        position: Numbers = (0, 0, 0),
        orientation: Numbers = (0, 0, 0, 1),
        pybullet_client_id: Client | int = 0,
        *,
        mass: float = 0.094,
        scale: float = 1.0,
        margin: float = MESH_MARGIN,
    ) -> None:
        super().__init__(
            position,
            orientation,
            {"type": "cube", "size": [0.065 * scale]},
            mass,
            pybullet_client_id,
            margin,
        )


def import_mesh(*_: Any, **__: Any) -> int:
    """Meshes cannot be added here; raises NotImplementedError."""
    raise NotImplementedError(
        "objects of meshes cannot be added to this simulation; use a Cuboid of the same size"
    )
