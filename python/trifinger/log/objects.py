# SPDX-License-Identifier: BSD-3-Clause
"""Where objects were in a session, and what a pen has written.

Measured poses of objects are noisy, so each is the mean of several. A pen is a stick whose nib, the
end along its x axis, touches the table.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from trifinger._trifinger import LoggedSession
from trifinger.arrays import Array

SMOOTHING = 5  # poses of an object in a mean
TOUCH = 0.001  # height up to which a nib writes, more than seen poses are wrong [m]
LIFT = 0.0003  # height of the ink, so that it is not in the table [m]
GRAIN = 0.0003  # a nib that moves less writes nothing new [m]


def object_poses(session: LoggedSession) -> tuple[Array, dict[str, Array]]:
    """The steps at which objects were seen, and for each a row of position and quaternion."""
    elements = session.companion("object").observations
    if not len(elements):
        return np.empty(0), {}
    kernel = np.ones(SMOOTHING) / SMOOTHING
    objects = {}
    for name in elements.dtype.names or ():
        if name == "stamp":
            continue
        parts = [np.asarray(elements[name][part]) for part in ("position", "orientation")]
        poses = np.concatenate(parts, axis=1)
        # A quaternion and its negative are the same rotation, but have no mean.
        turn = poses[:, 3:]
        signs = np.sign(np.einsum("ij,ij->i", turn[1:], turn[:-1]))
        turn[1:] *= np.cumprod(np.where(signs == 0, 1, signs))[:, None]
        padded = np.pad(poses, ((SMOOTHING // 2, SMOOTHING // 2), (0, 0)), mode="edge")
        columns = [np.convolve(column, kernel, "valid") for column in padded.T]
        objects[name] = np.stack(columns, axis=1)
    return np.asarray(elements["stamp"]["capture_index"]), objects


def written(model: Any, steps: Array, objects: Mapping[str, Array]) -> tuple[Array, Array]:
    """The steps at which lines were written, and for each line its two ends [m], float[n, 2, 3].

    `model` is a `mujoco.MjModel`; `objects` are poses by name, a row of position and quaternion
    w, x, y, z for each of `steps`. An object is a stick if a capsule has its name. The table is
    where z is 0. Lines are in the order of their steps.
    """
    ends, lines = [np.empty(0)], [np.empty((0, 2, 3))]
    for name, poses in objects.items():
        length = stick_length(model, name)
        if length is None or len(steps) < 2:
            continue
        w, x, y, z = (poses[:, 3:] / np.linalg.norm(poses[:, 3:], axis=1)[:, None]).T
        axis = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], 1)
        nib = poses[:, :3] + length * axis
        touches = np.abs(nib[:, 2]) < TOUCH
        nib[:, 2] = LIFT
        # Where the nib has gone on, or come down again: a new number of the stroke, or a new cell.
        stroke = np.cumsum(~touches)[touches]
        places = np.column_stack([stroke, np.round(nib[touches] / GRAIN)])
        goes_on = np.append(True, (np.diff(places, axis=0) != 0).any(axis=1))[: len(places)]
        kept, stroke = np.flatnonzero(touches)[goes_on], stroke[goes_on]
        is_line = stroke[1:] == stroke[:-1]
        ends.append(steps[kept[1:]][is_line])
        lines.append(np.stack([nib[kept[:-1]], nib[kept[1:]]], 1)[is_line])
    order = np.argsort(np.concatenate(ends), kind="stable")
    return np.concatenate(ends)[order], np.concatenate(lines)[order]


def stick_length(model: Any, name: str) -> float | None:
    """From the middle of a stick to its nib [m]; None if the object is no stick."""
    import mujoco

    shape = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name)
    if shape < 0 or model.geom_type[shape] != mujoco.mjtGeom.mjGEOM_CAPSULE:
        return None
    return float(model.geom_size[shape, :2].sum())
