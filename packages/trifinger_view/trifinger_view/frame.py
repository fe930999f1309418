# SPDX-License-Identifier: BSD-3-Clause
"""What a picture shows: one step of a session, whether it runs or is in a log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from trifinger.element_text import fields_of, positions_field
from trifinger.session_info import Fault

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from trifinger.arrays import Array


@dataclass(frozen=True, kw_only=True)
class Frame:
    """One step of a session. What the robot does not have is None or empty."""

    time_index: int
    """The step; -1 before step 0."""
    time: float
    """Time of the step since step 0 [s]."""
    position: Array | None = None
    """Measured positions of the joints of the model [rad], float[joints]."""
    desired: Array | None = None
    """Desired positions of the joints [rad], float[joints]. A joint that is moved by torque alone
    has its measured position. None if no joint has a desired position."""
    torque: Array | None = None
    """Measured torques [Nm], float[joints]."""
    tip_force: Array | None = None
    """Measured forces of the tips along their pressing direction [N], float[tips]."""
    objects: Mapping[str, Array] = field(default_factory=dict)
    """Pose of each object in the world frame, by name: x, y, z [m], then quaternion w, x, y, z."""
    images: Mapping[str, NDArray[np.uint8]] = field(default_factory=dict)
    """RGB images by the name of the camera, uint8[height, width, 3]; only good ones."""
    values: Mapping[str, Array] = field(default_factory=dict)
    """All number fields of the observation by name, float[n]: for robots without joints."""
    lateness: float = 0.0
    """How late the step began [s]."""
    status: str = ""
    """The state of the session in words."""
    fault: Fault | None = None
    """Why the session ended; None while it runs."""
    fault_text: str = ""
    """A sentence about `fault`; empty while the session runs."""


def frame_of(
    time_index: int,
    period: float,
    observation: Any,
    desired: Any = None,
    objects: Any = None,
    **others: Any,
) -> Frame:
    """Makes a frame of the elements of a step.

    `period` is that of the session [s], `observation` an element, `desired` the desired action of
    the same step or None, `objects` the newest element of the companion "object" or None. `others`
    are further fields of Frame.
    """
    values = values_of(observation)
    joints = positions_field(values)
    position = values.get(joints)
    # Targets of some joints are no pose of the model.
    desired = desired if joints == "position" else None
    return Frame(
        time_index=time_index,
        time=max(time_index, 0) * period,
        position=position,
        desired=desired_position(position, desired),
        torque=values.get("torque"),
        tip_force=values.get("tip_force"),
        objects=poses_of(objects),
        values=values,
        **others,
    )


def values_of(element: Any) -> dict[str, Array]:
    """The number fields of an element by name, each as a row. A stamp is left out."""
    if element is None:
        return {}
    return {
        name: np.ravel(np.asarray(value, float))
        for name, value in fields_of(element)
        if not name.startswith("stamp.") and np.asarray(value).dtype.kind in "fiub"
    }


def desired_position(position: Array | None, desired: Any) -> Array | None:
    """The positions that an action asks for [rad]; see Frame.desired."""
    if position is None or desired is None or "position" not in (desired.dtype.names or ()):
        return None
    wanted = np.asarray(desired["position"], float)
    if wanted.shape != position.shape or not np.isfinite(wanted).any():
        return None
    return np.where(np.isfinite(wanted), wanted, position)


def poses_of(element: Any) -> dict[str, Array]:
    """The pose of each object in an element of the companion "object"; see Frame.objects."""
    if element is None:
        return {}
    poses = {}
    for name in element.dtype.names or ():
        parts = element.dtype[name].names or ()
        if "position" in parts and "orientation" in parts:
            pose = np.concatenate([element[name]["position"], element[name]["orientation"]])
            if pose.shape == (7,) and np.isfinite(pose).all():
                poses[name] = pose.astype(float)
    return poses
