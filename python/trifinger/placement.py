# SPDX-License-Identifier: BSD-3-Clause
"""Where joints and objects are in the configuration of a MuJoCo model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from trifinger.arrays import Array
from trifinger.errors import InvalidArgument


class Placement:
    """Makes MuJoCo's `qpos` of a model from the positions of its joints and the poses of objects.

    Joints are hinges and slides, objects are bodies that float freely. The model may have both in
    any order.
    """

    def __init__(self, model: Any) -> None:
        """`model` is a `mujoco.MjModel`."""
        import mujoco

        kinds = mujoco.mjtJoint
        scalar = np.isin(model.jnt_type, [int(kinds.mjJNT_HINGE), int(kinds.mjJNT_SLIDE)])
        self._rows = np.array(model.jnt_qposadr[scalar], int)
        self.joint_names = tuple(model.joint(int(i)).name for i in np.flatnonzero(scalar))
        """Names of the joints, in the order of the positions."""
        free = np.flatnonzero(model.jnt_type == int(kinds.mjJNT_FREE))
        self.object_bodies = {
            int(body): _object_name(model, int(body)) for body in model.jnt_bodyid[free]
        }
        """Names of the objects that can move freely, by the numbers of their bodies."""
        self._objects = dict(
            zip(self.object_bodies.values(), map(int, model.jnt_qposadr[free]), strict=True)
        )
        self._start = np.array(model.key_qpos[0] if model.nkey else model.qpos0, float)

    @property
    def object_names(self) -> tuple[str, ...]:
        """Names of the objects that can move freely."""
        return tuple(self._objects)

    def qpos(
        self, position: Array | None = None, objects: Mapping[str, Array] | None = None
    ) -> Array:
        """The configuration float[nq]. What is None, not finite or missing is where it starts.

        `position` are those of the joints [rad], [m]; `objects` are poses by name: position [m] and
        quaternion w, x, y, z.

        Raises:
            InvalidArgument: if there are more or fewer positions than joints
        """
        values = self._start.copy()
        if position is not None:
            if len(position) != len(self._rows):
                raise InvalidArgument(
                    f"there are {len(position)} positions, but the model has {len(self._rows)} "
                    "joints"
                )
            values[self._rows] = np.where(np.isfinite(position), position, values[self._rows])
        for name, pose in (objects or {}).items():
            first = self._objects.get(name)
            if first is not None:
                values[first : first + 7] = pose
        return values


def _object_name(model: Any, body: int) -> str:
    """The name of a free body as a session has it: a name of fields begins with it."""
    name: str = model.body(body).name or f"body{body}"
    return name.replace(" ", "_").replace("\n", "_")
