# SPDX-License-Identifier: BSD-3-Clause
"""Markers in the picture of a simulation. They are kept and given back, and drawn by nobody."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from trifinger_compat.handles import Client
from trifinger_compat.types import Array, Numbers


class ObjectMarker:
    """A shape that marks a pose."""

    def __init__(
        self,
        shape_type: Any,
        position: Numbers,
        orientation: Numbers,
        color: Numbers = (0, 1, 0, 0.5),
        pybullet_client_id: Client | int = 0,
        **kwargs: Any,
    ) -> None:
        self.shape_type = shape_type
        self.color = tuple(np.asarray(color, dtype=float))
        self._pybullet_client_id = kwargs.get("physicsClientId", pybullet_client_id)
        self.body_id = -1
        self.set_state(position, orientation)

    def set_state(self, position: Numbers, orientation: Numbers) -> None:
        """Moves the marker: position [m], orientation x, y, z, w."""
        self.position: Array = np.array(position, dtype=float)
        self.orientation: Array = np.array(orientation, dtype=float)


class CuboidMarker(ObjectMarker):
    """A box with side lengths `size` [m]; other arguments as for ObjectMarker."""

    def __init__(self, size: Numbers, *arguments: Any, **named: Any) -> None:
        self.size = np.array(size, dtype=float)
        super().__init__("box", *arguments, **named)


class CubeMarker(CuboidMarker):
    """A cube."""

    def __init__(self, width: float, *arguments: Any, **named: Any) -> None:
        super().__init__((width, width, width), *arguments, **named)


CubeMarker2 = CubeMarker


class SphereMaker(ObjectMarker):
    """A ball, by the name that some programs have given it."""

    def __init__(
        self, radius: float, position: Numbers, color: Numbers = (0, 1, 0, 0.5), **kwargs: Any
    ) -> None:
        self.radius = radius
        super().__init__("sphere", position, (0, 0, 0, 1), color, **kwargs)


class Marker:
    """Balls at the goals of tips."""

    def __init__(
        self,
        number_of_goals: int,
        goal_size: float = 0.015,
        initial_position: Sequence[float] = (0.18, 0.18, 0.08),
        **_: Any,
    ) -> None:
        self.goal_size = goal_size
        self.positions: list[Array] = [
            np.array(initial_position, dtype=float) for _i in range(number_of_goals)
        ]

    def set_state(self, positions: Sequence[Numbers]) -> None:
        """Moves the balls: a position [m] for each."""
        self.positions = [np.array(position, dtype=float) for position in positions]
