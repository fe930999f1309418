# SPDX-License-Identifier: BSD-3-Clause
"""Actions and observations of robots with a fixed number of joints."""

from collections.abc import Callable
from typing import Any

import numpy as np

from trifinger_compat.types import Array, Numbers


def _field(name: str, size: Callable[[type], int]) -> Any:
    """Numbers that are read as an array and can be assigned from any sequence."""
    slot = f"_{name}"

    def read(self: Any) -> Array:
        array: Array = getattr(self, slot)
        return array

    def write(self: Any, values: Numbers) -> None:
        setattr(self, slot, _copied(values, size(type(self)), name))

    return property(read, write, doc=f"The {name}, one number for each.")


def _copied(values: Numbers, size: int, name: str) -> Array:
    if not isinstance(values, np.ndarray) and not hasattr(values, "__len__"):
        raise TypeError(f"{name} must be a sequence of {size} numbers")
    array = np.array(values, dtype=np.float64)
    if array.shape != (size,):
        raise TypeError(f"{name} has shape {array.shape}, must have ({size},)")
    return array


class BaseAction:
    """The torques [Nm] and positions [rad] that are asked for.

    A position that is NaN asks for nothing, and a gain that is NaN stands for the robot's own.
    """

    JOINTS = 0
    __slots__ = ("_position", "_position_kd", "_position_kp", "_torque")

    torque = _field("torque", lambda cls: cls.JOINTS)  # type: ignore[attr-defined]
    position = _field("position", lambda cls: cls.JOINTS)  # type: ignore[attr-defined]
    position_kp = _field("position_kp", lambda cls: cls.JOINTS)  # type: ignore[attr-defined]
    position_kd = _field("position_kd", lambda cls: cls.JOINTS)  # type: ignore[attr-defined]

    def __init__(
        self,
        torque: Numbers | None = None,
        position: Numbers | None = None,
        position_kp: Numbers | None = None,
        position_kd: Numbers | None = None,
    ) -> None:
        """Each is a number for each joint; TypeError for another number of them."""
        size = self.JOINTS
        self.torque = np.zeros(size) if torque is None else torque
        nan = np.full(size, np.nan)
        self.position = nan if position is None else position
        self.position_kp = nan if position_kp is None else position_kp
        self.position_kd = nan if position_kd is None else position_kd

    @classmethod
    def Zero(cls) -> "BaseAction":  # noqa: N802
        """An action without torque."""
        return cls()

    @classmethod
    def Torque(cls, torque: Numbers) -> "BaseAction":  # noqa: N802
        """An action of torques only."""
        return cls(torque=torque)

    @classmethod
    def Position(  # noqa: N802
        cls, position: Numbers, kp: Numbers | None = None, kd: Numbers | None = None
    ) -> "BaseAction":
        """An action of positions only."""
        return cls(position=position, position_kp=kp, position_kd=kd)

    def __getstate__(self) -> tuple[Array, ...]:
        return self._torque, self._position, self._position_kp, self._position_kd  # type: ignore[attr-defined]

    def __setstate__(self, state: tuple[Array, ...]) -> None:
        self.torque, self.position, self.position_kp, self.position_kd = state

    def __repr__(self) -> str:
        return f"Action(torque={self.torque!r}, position={self.position!r})"


class BaseObservation:
    """Measurements of the joints, and of the tips if they have sensors; zeros at first."""

    JOINTS = 0
    TIPS = 0
    __slots__ = ("_position", "_tip_force", "_torque", "_velocity")

    position = _field("position", lambda cls: cls.JOINTS)  # type: ignore[attr-defined]
    velocity = _field("velocity", lambda cls: cls.JOINTS)  # type: ignore[attr-defined]
    torque = _field("torque", lambda cls: cls.JOINTS)  # type: ignore[attr-defined]

    def __init__(self) -> None:
        for name in ("_position", "_velocity", "_torque"):
            setattr(self, name, np.zeros(self.JOINTS))
        self._tip_force = np.zeros(self.TIPS)

    def __getstate__(self) -> tuple[Array, ...]:
        state = self._position, self._velocity, self._torque  # type: ignore[attr-defined]
        return (*state, self._tip_force) if self.TIPS else state

    def __setstate__(self, state: tuple[Array, ...]) -> None:
        self.position, self.velocity, self.torque, *rest = state
        self._tip_force = np.array(rest[0]) if rest else np.zeros(0)

    def __repr__(self) -> str:
        return f"Observation(position={self.position!r}, velocity={self.velocity!r})"


class BaseTipObservation(BaseObservation):
    """Measurements of the joints and tips."""

    __slots__ = ()

    tip_force = _field("tip_force", lambda cls: cls.TIPS)  # type: ignore[attr-defined]
