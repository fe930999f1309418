# SPDX-License-Identifier: BSD-3-Clause
"""The ids that the original has from PyBullet, for what lives in a simulation of this project.

Markers, objects and cameras take them, and so do the calls of PyBullet in `bullet_calls`. Any other
call of PyBullet that is given one raises NotImplementedError, which says what to use instead:
PyBullet has no such world.
"""

from dataclasses import dataclass

PAGE = "docs/coming_from_the_original.md"

# What to use in place of calls of PyBullet on what lives in a simulation here.
INSTEAD = {
    "addUserDebugLine": "`trifinger view` shows goals and tips; remove the call",
    "addUserDebugText": "`trifinger view` shows goals and tips; remove the call",
    "calculateInverseDynamics": "use trifinger.Kinematics('trifinger_pro').gravity_torques(q)",
    "calculateInverseKinematics": "use simfinger.kinematics.inverse_kinematics(tips, q)",
    "calculateJacobian": "use simfinger.kinematics.compute_jacobian(finger, q)",
    "changeDynamics": "only masses of objects can be changed: TriFingerPlatform(object_mass=..)",
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
# Calls that act on a view, not on a body.
VIEWS = frozenset(("configureDebugVisualizer", "resetDebugVisualizerCamera"))


def no_such_call(name: str, instead: str = "") -> NotImplementedError:
    """The error for a call of PyBullet on what lives in a simulation here."""
    return NotImplementedError(
        f"pybullet.{name}: no PyBullet is below this simulation; {instead or _instead(name)}"
    )


def not_installed(name: str) -> NotImplementedError:
    """The error for a call that only PyBullet itself can serve, where it is not installed."""
    return NotImplementedError(
        f"pybullet.{name}: PyBullet is not installed; for a world of your own: "
        f"pip install pybullet; for a simulation here: {_instead(name)}"
    )


def _instead(name: str) -> str:
    return INSTEAD.get(name, f"{PAGE} says what there is")


@dataclass(frozen=True)
class Handle:
    """An id that stands for something of a simulation, and is no number to anyone else."""

    number: int

    def __index__(self) -> int:
        """Raises NotImplementedError: PyBullet asks for a number, and there is none for it."""
        raise NotImplementedError(
            "an id of a simulation here got into PyBullet, which has no such world; if it was an "
            "argument of a call, PyBullet comes before trifinger-compat in sys.path, and must come "
            f"after it; {PAGE} says what there is"
        )

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
