# SPDX-License-Identifier: BSD-3-Clause
"""The ids that the original has from PyBullet, for what lives in a simulation of this project.

Markers, objects and cameras take them. If one of them gets into a call of PyBullet itself, the call
raises NotImplementedError, which says what to use instead: PyBullet has no such world.
"""

import linecache
import re
import sys
from dataclasses import dataclass
from itertools import islice
from types import FrameType

PAGE = "docs/coming_from_the_original.md"

# What to use in place of calls of PyBullet. trifinger_compat's own module `pybullet` has some more.
INSTEAD = {
    "addUserDebugLine": "`trifinger view` shows goals and tips; remove the call",
    "addUserDebugText": "`trifinger view` shows goals and tips; remove the call",
    "calculateInverseDynamics": "use trifinger.Kinematics('trifinger_pro').gravity_torques(q)",
    "calculateInverseKinematics": "use simfinger.kinematics.inverse_kinematics(tips, q)",
    "calculateJacobian": "use simfinger.kinematics.compute_jacobian(finger, q)",
    "connect": "create a TriFingerPlatform or a SimFinger: each has a world of its own",
    "createMultiBody": "use trifinger_simulation.visual_objects or collision_objects",
    "createVisualShape": "use trifinger_simulation.visual_objects",
    "getContactPoints": "use tip_force of an observation",
    "loadURDF": "use trifinger_simulation.collision_objects",
    "removeBody": "delete the object of trifinger_simulation.collision_objects",
    "restoreState": "use trifinger.Simulation, which saves and restores its state",
    "saveState": "use trifinger.Simulation, which saves and restores its state",
    "setTimeStep": "give TriFingerPlatform(time_step_s=..)",
    "startStateLogging": "`trifinger film` makes a film of a log",
    "stepSimulation": "use simfinger._step_simulation()",
}
# These work without PyBullet, by the module `pybullet` that comes with this package.
SERVED = {
    "applyExternalForce": "platform.cube has the body",
    "applyExternalTorque": "platform.cube has the body",
    "changeDynamics": "give TriFingerPlatform(object_mass=..)",
    "configureDebugVisualizer": "views belong to `trifinger view`; remove the call",
    "getBasePositionAndOrientation": "use platform.cube.get_state()",
    "getBaseVelocity": "platform.cube has the body",
    "getEulerFromQuaternion": "use scipy.spatial.transform.Rotation.from_quat(..).as_euler('xyz')",
    "getJointStates": "use simfinger.get_observation(t)",
    "getMatrixFromQuaternion": "use scipy.spatial.transform.Rotation.from_quat(..).as_matrix()",
    "getQuaternionFromEuler": "use scipy.spatial.transform.Rotation.from_euler(..).as_quat()",
    "isConnected": "a simulation here always is; remove the call",
    "resetBasePositionAndOrientation": "use platform.cube.set_state(position, orientation)",
    "resetBaseVelocity": "platform.cube has the body",
    "resetDebugVisualizerCamera": "views belong to `trifinger view`; remove the call",
}


def no_such_call(name: str) -> NotImplementedError:
    """The error for a call of PyBullet that cannot be served."""
    instead = (INSTEAD | SERVED).get(name, f"{PAGE} says what there is")
    return NotImplementedError(f"pybullet.{name}: no PyBullet is below this simulation; {instead}")


@dataclass(frozen=True)
class Handle:
    """An id that stands for something of a simulation, and is no number to anyone else."""

    number: int

    def __index__(self) -> int:
        """Raises NotImplementedError: PyBullet asks for a number, and there is none for it."""
        raise no_such_call(_called(sys._getframe(1)))

    def __eq__(self, other: object) -> bool:
        return self.number == (other.number if isinstance(other, Handle) else other)

    def __hash__(self) -> int:
        return hash(self.number)


class Client(Handle):
    """A simulated world."""


@dataclass(frozen=True, eq=False)
class Body(Handle):
    """The robot of a world, whose name is empty, or a loose object."""

    client: Client
    name: str = ""


def _called(frame: FrameType) -> str:
    """The function that a frame calls just now, by the text of its program."""
    positions = islice(frame.f_code.co_positions(), frame.f_lasti // 2, None)
    line, _, column, _ = next(positions)
    text = linecache.getline(frame.f_code.co_filename, line or 0).encode()[column or 0 :].decode()
    found = re.match(r"(?:\w+\.)*(\w+)\(", text)
    return found[1] if found else "*"
