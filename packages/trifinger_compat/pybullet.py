# SPDX-License-Identifier: BSD-3-Clause
"""What programs for the original call of PyBullet beside it, where PyBullet is not installed.

Mathematics works as it does there. So do poses, speeds, forces and masses of the objects that
`trifinger_simulation` has made. Calls that change the view do nothing. All others raise
NotImplementedError, which says what to use instead. An installed PyBullet comes first.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from trifinger_compat.handles import Body, Client, no_such_call
from trifinger_compat.types import Array, Numbers
from trifinger_compat.world import World, link_indices, world_of

# PyBullet's numbers of what programs name.
GUI, DIRECT, SHARED_MEMORY = 1, 2, 3
LINK_FRAME, WORLD_FRAME = 1, 2
GEOM_SPHERE, GEOM_BOX, GEOM_CYLINDER, GEOM_MESH, GEOM_PLANE, GEOM_CAPSULE = 2, 3, 4, 5, 6, 7
COV_ENABLE_GUI, COV_ENABLE_SHADOWS, COV_ENABLE_WIREFRAME = 1, 2, 3
COV_ENABLE_RENDERING = 7
COV_ENABLE_RGB_BUFFER_PREVIEW = 13
COV_ENABLE_DEPTH_BUFFER_PREVIEW = 14
COV_ENABLE_SEGMENTATION_MARK_PREVIEW = 15
STATE_LOGGING_VIDEO_MP4 = 3
ER_TINY_RENDERER, ER_BULLET_HARDWARE_OPENGL = 1 << 16, 1 << 17


def __getattr__(name: str) -> Callable[..., Any]:
    """A function that raises NotImplementedError when it is called."""
    if name.startswith("_") or name.isupper():
        raise AttributeError(f"module 'pybullet' of trifinger-compat has no '{name}'")

    def refuse(*_: Any, **__: Any) -> Any:
        raise no_such_call(name)

    return refuse


def getQuaternionFromEuler(eulerAngles: Numbers, **_: Any) -> tuple[float, ...]:  # noqa: N802, N803
    """The quaternion x, y, z, w of turns about the fixed axes x, y and z, in this order [rad]."""
    return _numbers(Rotation.from_euler("xyz", eulerAngles).as_quat())


def getEulerFromQuaternion(quaternion: Numbers, **_: Any) -> tuple[float, ...]:  # noqa: N802
    """Turns about the fixed axes x, y and z, in this order [rad]."""
    return _numbers(Rotation.from_quat(quaternion).as_euler("xyz"))


def getMatrixFromQuaternion(quaternion: Numbers, **_: Any) -> tuple[float, ...]:  # noqa: N802
    """The nine numbers of the rotation, row by row."""
    return _numbers(Rotation.from_quat(quaternion).as_matrix().ravel())


def configureDebugVisualizer(*_: Any, **__: Any) -> None:  # noqa: N802
    """Does nothing: views belong to `trifinger view`."""


def resetDebugVisualizerCamera(*_: Any, **__: Any) -> None:  # noqa: N802
    """Does nothing: views belong to `trifinger view`."""


def isConnected(physicsClientId: object = 0) -> bool:  # noqa: N802, N803
    """True for the client id of a simulation."""
    return isinstance(physicsClientId, Client)


def resetBasePositionAndOrientation(  # noqa: N802
    bodyUniqueId: Body,  # noqa: N803
    posObj: Numbers,  # noqa: N803
    ornObj: Numbers,  # noqa: N803
    *_: Any,
    **__: Any,
) -> None:
    """Places an object at rest: position [m], orientation x, y, z, w."""
    world, name = _object(bodyUniqueId, "resetBasePositionAndOrientation")
    world.place(name, posObj, ornObj)


def getBasePositionAndOrientation(  # noqa: N802
    bodyUniqueId: Body,  # noqa: N803
    *_: Any,
    **__: Any,
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Position [m] and orientation x, y, z, w of an object."""
    world, name = _object(bodyUniqueId, "getBasePositionAndOrientation")
    position, orientation = world.pose(name)
    return _numbers(position), _numbers(orientation)


def resetBaseVelocity(  # noqa: N802
    objectUniqueId: Body,  # noqa: N803
    linearVelocity: Numbers = (0, 0, 0),  # noqa: N803
    angularVelocity: Numbers = (0, 0, 0),  # noqa: N803
    *_: Any,
    **__: Any,
) -> None:
    """Sets the velocities of an object in the world frame [m/s], [rad/s]."""
    world, name = _object(objectUniqueId, "resetBaseVelocity")
    world.core.set_object_velocity(name, linearVelocity, angularVelocity)


def getBaseVelocity(  # noqa: N802
    bodyUniqueId: Body,  # noqa: N803
    *_: Any,
    **__: Any,
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The velocities of an object in the world frame [m/s], [rad/s]."""
    world, name = _object(bodyUniqueId, "getBaseVelocity")
    linear, angular = world.core.object_velocity(name)
    return _numbers(linear), _numbers(angular)


def changeDynamics(  # noqa: N802
    bodyUniqueId: Body,  # noqa: N803
    linkIndex: int,  # noqa: N803
    mass: float | None = None,
    **others: Any,
) -> None:
    """Sets the mass of an object [kg]; nothing else of it can be changed."""
    world, name = _object(bodyUniqueId, "changeDynamics")
    if mass is None or linkIndex > 0 or set(others) - {"physicsClientId"}:
        raise no_such_call("changeDynamics")
    world.core.set_object_mass(name, mass)


def applyExternalForce(  # noqa: N802
    objectUniqueId: Body,  # noqa: N803
    linkIndex: int,  # noqa: ARG001, N803  # objects are one body
    forceObj: Numbers,  # noqa: N803
    posObj: Numbers,  # noqa: N803
    flags: int,
    *_: Any,
    **__: Any,
) -> None:
    """Lets a force act on an object in the next step [N], at a place [m]."""
    world, name = _object(objectUniqueId, "applyExternalForce")
    turn, centre = _frame(world, name, flags)
    force = turn.apply(forceObj)
    lever = turn.apply(posObj) - (centre if flags == WORLD_FRAME else 0)
    world.core.push_object(name, force, np.cross(lever, force))


def applyExternalTorque(  # noqa: N802
    objectUniqueId: Body,  # noqa: N803
    linkIndex: int,  # noqa: ARG001, N803  # objects are one body
    torqueObj: Numbers,  # noqa: N803
    flags: int,
    *_: Any,
    **__: Any,
) -> None:
    """Lets a moment act on an object in the next step [Nm]."""
    world, name = _object(objectUniqueId, "applyExternalTorque")
    world.core.push_object(name, np.zeros(3), _frame(world, name, flags)[0].apply(torqueObj))


def getJointStates(  # noqa: N802
    bodyUniqueId: Body,  # noqa: N803
    jointIndices: Sequence[int],  # noqa: N803
    *_: Any,
    **__: Any,
) -> list[tuple[float, float, tuple[float, ...], float]]:
    """Position [rad], velocity [rad/s], six zeros and torque [Nm] of joints of the robot."""
    if not isinstance(bodyUniqueId, Body) or bodyUniqueId.name:
        raise no_such_call("getJointStates")
    world = world_of(bodyUniqueId.client)
    position, velocity, torque, _forces = world.core.observation()
    links, _tips = link_indices(world.finger_type)
    places = [links.index(index) for index in jointIndices]
    no_forces = (0.0,) * 6
    return [(float(position[i]), float(velocity[i]), no_forces, float(torque[i])) for i in places]


def _object(body: object, call: str) -> tuple[World, str]:
    """World and name of an object; raises NotImplementedError for other bodies."""
    if not isinstance(body, Body) or not body.name:
        raise no_such_call(call)
    return world_of(body.client), body.name


def _frame(world: World, name: str, flags: int) -> tuple[Rotation, Array]:
    """The rotation from the frame that `flags` names, and where the object is."""
    position, orientation = world.pose(name)
    is_world = flags == WORLD_FRAME
    return Rotation.identity() if is_world else Rotation.from_quat(orientation), position


def _numbers(values: Array) -> tuple[float, ...]:
    return tuple(map(float, values))
