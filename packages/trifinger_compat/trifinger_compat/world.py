# SPDX-License-Identifier: BSD-3-Clause
"""The simulated worlds of a process: a robot and loose objects in each.

The original gives its worlds numbers, and objects, markers and cameras take such a number. Worlds
here are numbered in the same way: each new one gets the lowest number that is free.
"""

import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np
from trifinger._trifinger import DirectSimulation
from trifinger.errors import InvalidArgument

from trifinger_compat import physics
from trifinger_compat.generation import Generation
from trifinger_compat.handles import Client
from trifinger_compat.types import Array, Numbers, wxyz, xyzw

CONFIGURATIONS = {
    "fingerone": "finger_one",
    "trifingerone": "trifinger_one",
    "fingeredu": "finger_edu",
    "trifingeredu": "trifinger_edu",
    "fingerpro": "finger_pro",
    "trifingerpro": "trifinger_pro",
}
STATIC_MASS = 2.0  # of what the original cannot move; it is put back after each step

_worlds: dict[Client, "weakref.ref[World]"] = {}


def link_indices(finger_type: str) -> tuple[list[int], list[int]]:
    """PyBullet's numbers of the links, in the order of the joints, and of the tips."""
    if finger_type.endswith("pro"):  # each link has a fixed part
        links, tip = (2, 4, 6), 7
    elif finger_type == "fingeredu":
        links, tip = (1, 2, 3), 4
    else:
        links, tip = (2, 3, 4), 5
    # Those of the next finger come after the tip.
    begins = [finger * tip for finger in range(3 if finger_type.startswith("tri") else 1)]
    return [begin + link for begin in begins for link in links], [b + tip for b in begins]


def whole_milliseconds(time_step: float) -> int:
    """The length of a step [s] in ms; raises ValueError if a simulation cannot have it."""
    milliseconds = time_step * 1000
    if not milliseconds >= 1 or abs(milliseconds - round(milliseconds)) > 1e-6:
        raise InvalidArgument(
            f"the time step is {time_step} s; this simulation moves in whole milliseconds, so "
            "it must be 0.001, 0.002, 0.003 and so on"
        )
    return round(milliseconds)


def world_of(client_id: Client | int) -> "World":
    """The world of this number; raises ValueError if there is none."""
    key = client_id if isinstance(client_id, Client) else Client(client_id)
    world = _worlds[key]() if key in _worlds else None
    if world is None:
        raise InvalidArgument(
            f"there is no simulation with the client id {key.number}; create a SimFinger or a "
            "TriFingerPlatform first and give its `_pybullet_client_id`"
        )
    return world


def is_open(client_id: Client) -> bool:
    """True while there is a world of this number."""
    return client_id in _worlds and _worlds[client_id]() is not None


@dataclass
class Item:
    """A loose object of a world."""

    shape: Mapping[str, object]  # as in a configuration
    position: Array
    orientation: Array  # x, y, z, w
    is_static: bool = False
    margin: float = 0.0  # distance at which it touches already [m]


class _NotBuilt:
    """Stands where the simulation will be. Whoever asks for anything gets it from the real one."""

    def __init__(self, world: "World") -> None:
        self._world = weakref.ref(world)

    def __getattr__(self, name: str) -> object:
        world = self._world()
        if world is None:
            raise InvalidArgument("the simulation is gone")
        return getattr(world.build(), name)


class World:
    """A robot, objects, and their simulation `core`, which is built when it is first needed.

    Objects may come and go at any time: the simulation is built again and continues where it was.
    """

    def __init__(self, finger_type: str, time_step: float, generation: Generation) -> None:
        """`finger_type` is a name in CONFIGURATIONS, `time_step` whole milliseconds [s]."""
        milliseconds = whole_milliseconds(time_step)
        self.finger_type = finger_type
        self.config = CONFIGURATIONS[finger_type]
        self.generation = generation
        self.time_step = milliseconds / 1000
        self.items: dict[str, Item] = {}
        self.statics: list[str] = []
        self.joint_friction = 0.0  # [Nm]; set it before the first step
        self._built: DirectSimulation | None = None
        self._present: set[str] = set()
        self._number_of_items = 0
        self.core = cast(DirectSimulation, _NotBuilt(self))
        numbers = map(Client, range(len(_worlds) + 1))
        self.client_id = next(client for client in numbers if client not in _worlds)
        _worlds[self.client_id] = weakref.ref(self)
        weakref.finalize(self, _worlds.pop, self.client_id, None)

    @property
    def overrides(self) -> dict[str, object]:
        """What the configuration of this world has in place of its own values."""
        shapes = [
            {"name": name, **item.shape, "position": [0.0, 0.0, 0.5]}
            for name, item in self.items.items()
        ]
        return {
            **physics.settings(self.finger_type),
            "objects": shapes,
            "backend.period": self.time_step,
            "simulation.object_period": self.time_step,
            "joints.friction": self.joint_friction,
        }

    def build(self) -> DirectSimulation:
        """The simulation with all objects of now."""
        core = DirectSimulation(self.config, self.overrides)
        lower, upper = physics.stops(self.finger_type, self.generation)
        fingers = 3 if self.finger_type.startswith("tri") else 1
        core.use_physics(
            stop_lower=lower * fingers,
            stop_upper=upper * fingers,
            margin=physics.MESH_MARGIN,
            link_friction=physics.LINK_FRICTION,
            boundary_friction=physics.DEFAULT_FRICTION,
            object_margins={name: item.margin for name, item in self.items.items()},
        )
        if self._built is not None:
            core.continue_from(self._built)
        for name, item in self.items.items():
            if name not in self._present:
                core.place_object(name, item.position, wxyz(item.orientation))
        self._built = self.core = core
        self._present = set(self.items)
        return core

    def add(self, item: Item) -> str:
        """Adds an object and returns its name."""
        name = f"object_{self._number_of_items}"
        self._number_of_items += 1
        self.items[name] = item
        if item.is_static:
            self.statics.append(name)
        self.core = cast(DirectSimulation, _NotBuilt(self))
        return name

    def remove(self, name: str) -> None:
        """Removes an object."""
        if self.items.pop(name).is_static:
            self.statics.remove(name)
        self.core = cast(DirectSimulation, _NotBuilt(self))

    def hold_statics(self) -> None:
        """Puts back what cannot move."""
        for name in self.statics:
            item = self.items[name]
            self.core.place_object(name, item.position, wxyz(item.orientation))

    def place(self, name: str, position: Numbers, orientation: Numbers) -> None:
        """Places an object at rest; `orientation` is x, y, z, w."""
        item = self.items[name]
        item.position = np.array(position, dtype=float)
        item.orientation = np.array(orientation, dtype=float)
        self.core.place_object(name, item.position, wxyz(item.orientation))

    def pose(self, name: str) -> tuple[Array, Array]:
        """Position and orientation x, y, z, w of an object."""
        position, orientation = self.core.object_pose(name)
        return position, xyzw(orientation)
