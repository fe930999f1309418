# SPDX-License-Identifier: BSD-3-Clause
"""What the original's simulator assumes of robots and objects, in place of this project's figures.

The original's descriptions have no rotors, and neither damping nor friction of joints. Joints stop
at the limits of the descriptions. PyBullet multiplies the frictions of two surfaces, and shapes
that come from meshes touch from 1 mm away. The tips of a Pro are links of their own, which have
PyBullet's default friction; those of other robots are parts of the lower links.
"""

from math import pi

from trifinger_compat.generation import Generation

MESH_MARGIN = 0.001  # distance at which meshes of PyBullet touch already [m]

LINK_FRICTION = 0.1  # against objects and table, which have 1
DEFAULT_FRICTION = 0.5  # PyBullet's own, against objects; the boundary has it

Angles = tuple[float, float, float]  # base to tip [rad]
_STOPS: dict[str, tuple[Angles, Angles]] = {
    "one": ((-pi / 2, -1.352630, -3.001966), (pi / 2, 4.494223, 3.001966)),
    "edu": ((-pi / 2, -pi / 2, -pi), (pi / 2, pi / 2, pi)),
}


def settings(finger_type: str) -> dict[str, object]:
    """What a configuration has to say, as far as configurations know it."""
    is_pro, is_tri = finger_type.endswith("pro"), finger_type.startswith("tri")
    return {
        "joints.rotor_inertia": 0.0,
        "joints.damping": 0.0,
        "joints.friction": 0.0,
        "joints.stop_time_constant": 0.005,
        "contact.tip_friction": DEFAULT_FRICTION if is_pro else LINK_FRICTION,
        # Both surfaces add to friction against twisting: 0.001 of the object, 0.1 of links.
        "contact.tip_torsional_friction": 0.0005 if is_pro else 0.1,
        # Objects, and the table of three fingers, which is not a mesh.
        "contact.floor_friction": 1.0 if is_tri else DEFAULT_FRICTION,
    }


def stops(finger_type: str, generation: Generation) -> tuple[Angles, Angles]:
    """Where the joints of a finger are stopped."""
    if finger_type.endswith("pro"):
        return generation.position_low, generation.position_high
    return _STOPS[finger_type.removeprefix("tri").removeprefix("finger")]
