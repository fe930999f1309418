# SPDX-License-Identifier: BSD-3-Clause
"""The calls of PyBullet that act on what lives in a simulation of this project.

Mathematics works as it does there. So do poses, speeds, forces and masses of the objects that
`trifinger_simulation` has made. Calls that change the view do nothing.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from trifinger.errors import InvalidArgument

from trifinger_compat.bullet_names import CONSTANTS
from trifinger_compat.handles import Body, Client, no_such_call
from trifinger_compat.types import Array, Numbers
from trifinger_compat.world import World, is_open, link_indices, world_of


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
    return isinstance(physicsClientId, Client) and is_open(physicsClientId)


def resetBasePositionAndOrientation(  # noqa: N802
    bodyUniqueId: Body,  # noqa: N803
    posObj: Numbers,  # noqa: N803
    ornObj: Numbers,  # noqa: N803
    physicsClientId: object = None,  # noqa: N803
) -> None:
    """Places an object at rest: position [m], orientation x, y, z, w."""
    world, name = _object(bodyUniqueId, physicsClientId, "resetBasePositionAndOrientation")
    world.place(name, posObj, ornObj)


def getBasePositionAndOrientation(  # noqa: N802
    bodyUniqueId: Body,  # noqa: N803
    physicsClientId: object = None,  # noqa: N803
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Position [m] and orientation x, y, z, w of an object."""
    world, name = _object(bodyUniqueId, physicsClientId, "getBasePositionAndOrientation")
    position, orientation = world.pose(name)
    return _numbers(position), _numbers(orientation)


def resetBaseVelocity(  # noqa: N802
    objectUniqueId: Body,  # noqa: N803
    linearVelocity: Numbers = (0, 0, 0),  # noqa: N803
    angularVelocity: Numbers = (0, 0, 0),  # noqa: N803
    physicsClientId: object = None,  # noqa: N803
) -> None:
    """Sets the velocities of an object in the world frame [m/s], [rad/s]."""
    world, name = _object(objectUniqueId, physicsClientId, "resetBaseVelocity")
    world.core.set_object_velocity(name, linearVelocity, angularVelocity)


def getBaseVelocity(  # noqa: N802
    bodyUniqueId: Body,  # noqa: N803
    physicsClientId: object = None,  # noqa: N803
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The velocities of an object in the world frame [m/s], [rad/s]."""
    world, name = _object(bodyUniqueId, physicsClientId, "getBaseVelocity")
    linear, angular = world.core.object_velocity(name)
    return _numbers(linear), _numbers(angular)


def changeDynamics(  # noqa: N802
    bodyUniqueId: Body,  # noqa: N803
    linkIndex: int,  # noqa: N803
    mass: float | None = None,
    *,
    physicsClientId: object = None,  # noqa: N803
    **others: Any,
) -> None:
    """Sets the mass of an object [kg]; nothing else of it can be changed."""
    world, name = _object(bodyUniqueId, physicsClientId, "changeDynamics")
    if mass is None or linkIndex > 0 or others:
        raise no_such_call("changeDynamics")
    world.core.set_object_mass(name, mass)


def applyExternalForce(  # noqa: N802
    objectUniqueId: Body,  # noqa: N803
    linkIndex: int,  # noqa: ARG001, N803  # objects are one body
    forceObj: Numbers,  # noqa: N803
    posObj: Numbers,  # noqa: N803
    flags: int,
    physicsClientId: object = None,  # noqa: N803
) -> None:
    """Lets a force act on an object in the next step [N], at a place [m]."""
    world, name = _object(objectUniqueId, physicsClientId, "applyExternalForce")
    turn, centre = _frame(world, name, flags)
    force = turn.apply(forceObj)
    lever = turn.apply(posObj) - (centre if flags == CONSTANTS["WORLD_FRAME"] else 0)
    world.core.push_object(name, force, np.cross(lever, force))


def applyExternalTorque(  # noqa: N802
    objectUniqueId: Body,  # noqa: N803
    linkIndex: int,  # noqa: ARG001, N803  # objects are one body
    torqueObj: Numbers,  # noqa: N803
    flags: int,
    physicsClientId: object = None,  # noqa: N803
) -> None:
    """Lets a moment act on an object in the next step [Nm]."""
    world, name = _object(objectUniqueId, physicsClientId, "applyExternalTorque")
    world.core.push_object(name, np.zeros(3), _frame(world, name, flags)[0].apply(torqueObj))


def getJointStates(  # noqa: N802
    bodyUniqueId: Body,  # noqa: N803
    jointIndices: Sequence[int],  # noqa: N803
    physicsClientId: object = None,  # noqa: N803
) -> list[tuple[float, float, tuple[float, ...], float]]:
    """Position [rad], velocity [rad/s], six zeros and torque [Nm] of joints of the robot."""
    if not isinstance(bodyUniqueId, Body) or bodyUniqueId.name:
        raise no_such_call("getJointStates", "give simfinger.finger_id")
    world = _world(bodyUniqueId, physicsClientId, "getJointStates")
    position, velocity, torque, _forces = world.core.observation()
    links, _tips = link_indices(world.finger_type)
    places = [links.index(index) for index in jointIndices]
    no_forces = (0.0,) * 6
    return [(float(position[i]), float(velocity[i]), no_forces, float(torque[i])) for i in places]


def _object(body: object, client: object, call: str) -> tuple[World, str]:
    """World and name of an object; raises NotImplementedError for other bodies."""
    if not isinstance(body, Body) or not body.name:
        raise no_such_call(call, "give the id of an object here, such as platform.cube._object_id")
    return _world(body, client, call), body.name


def _world(body: Body, client: object, call: str) -> World:
    """The world of a body; raises ValueError if the call names another one."""
    if client is not None and client != body.client:
        number = client.number if isinstance(client, Client) else client
        raise InvalidArgument(
            f"pybullet.{call}: the body is one of the simulation {body.client.number}, but "
            f"physicsClientId is {number}; give `_pybullet_client_id` of its simulation, or none"
        )
    return world_of(body.client)


def _frame(world: World, name: str, flags: int) -> tuple[Rotation, Array]:
    """The rotation from the frame that `flags` names, and where the object is."""
    position, orientation = world.pose(name)
    is_world = flags == CONSTANTS["WORLD_FRAME"]
    return Rotation.identity() if is_world else Rotation.from_quat(orientation), position


def _numbers(values: Array) -> tuple[float, ...]:
    return tuple(map(float, values))
