# SPDX-License-Identifier: BSD-3-Clause
"""The physics of the packages has the original's figures.

What is expected is computed here from the figures of the original's descriptions.
"""

from typing import Any

import numpy as np
import pytest
import rrc_simulation
import trifinger_simulation
from hypothesis import given, strategies as st
from trifinger_simulation import SimFinger, collision_objects

HOME = (0, 0.9, -1.7)
STEP, GRAVITY = 0.001, 9.81  # [s], [m/s^2]
# A finger of a TriFingerPro at HOME has this inertia [kgm^2] without rotors, and this torque holds
# it [Nm]. Both follow from the masses in robot_properties_fingers 2.0.2.
INERTIA = np.array(
    [
        [3.957752e-3, -1.469125e-3, 2.198430e-4],
        [-1.469125e-3, 4.920565e-3, 3.551826e-4],
        [2.198430e-4, 3.551826e-4, 4.318493e-4],
    ]
)
WEIGHT = np.array([-0.218749, 0.234337, -0.026142])
SAFETY_DAMPING = np.array([0.08, 0.08, 0.04])  # [Nms/rad]


def speeds_after(steps: int, torque: Any) -> Any:
    """Speeds of a finger that begins at rest, by its inertia and damping alone [rad/s]."""
    speed = np.zeros(3)
    for _ in range(steps):
        applied = np.asarray(torque) - SAFETY_DAMPING * speed
        speed = speed + STEP * np.linalg.solve(INERTIA, applied - WEIGHT)
    return speed


@given(st.lists(st.floats(-0.39, 0.39), min_size=9, max_size=9))
def test_a_torque_accelerates_joints_as_their_inertia_says(torque: list[float]) -> None:
    finger = SimFinger("trifingerpro")
    finger.reset_finger_positions_and_velocities(HOME * 3)
    t = finger.append_desired_action(finger.Action(torque=torque))
    speed = finger.get_observation(t + 1).velocity.reshape(3, 3)
    for number, each in enumerate(np.reshape(torque, (3, 3))):
        assert speed[number] == pytest.approx(speeds_after(1, each), abs=2e-4)


def test_joint_2_is_as_fast_as_in_the_original() -> None:
    expected = speeds_after(11, [0, 0, 0.01])
    assert expected[2] == pytest.approx(0.69, abs=0.002)  # and so in PyBullet
    finger = SimFinger("trifingerpro")
    finger.reset_finger_positions_and_velocities(HOME * 3)
    for _ in range(11):
        t = finger.append_desired_action(finger.Action(torque=[0, 0, 0.01] * 3))
    speed = finger.get_observation(t + 1).velocity.reshape(3, 3)
    for each in speed:
        assert each == pytest.approx(expected, abs=0.01)


LATEST = ((-0.33, 0, -2.7), (1.0, 1.57, 0))
FIRST = ((-0.9, -1.57, -2.7), (1.4, 1.57, 0))
ONE = ((-1.5708, -1.35263, -3.001966), (1.5708, 4.494223, 3.001966))
EDU = ((-1.5708, -1.5708, -3.141593), (1.5708, 1.5708, 3.141593))


@pytest.mark.parametrize(
    ("package", "finger_type", "limits"),
    [
        (trifinger_simulation, "fingerpro", LATEST),
        (rrc_simulation, "fingerpro", FIRST),
        (trifinger_simulation, "fingerone", ONE),
        (trifinger_simulation, "fingeredu", EDU),
    ],
)
@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize("joint", [0, 1, 2])
def test_joints_stop_at_the_limits_of_the_descriptions(
    package: Any, finger_type: str, limits: Any, end: int, joint: int
) -> None:
    finger = package.SimFinger(finger_type)
    # High above everything that it could touch, and just before the limit.
    start = np.mean(limits, axis=0)
    start[joint] = limits[end][joint] + (0.05 if end == 0 else -0.05)
    start[1] = start[1] if joint == 1 else limits[1][1] - 0.3
    finger.reset_finger_positions_and_velocities(start)
    torque, finger.max_motor_torque = np.zeros(3), 1.0
    torque[joint] = 1.0 if end else -1.0  # more than all weights
    for _ in range(300):
        t = finger.append_desired_action(finger.Action(torque=torque))
    reached = finger.get_observation(t + 1).position[joint]
    assert reached == pytest.approx(limits[end][joint], abs=0.02)


@pytest.mark.parametrize(
    ("package", "margin"), [(trifinger_simulation, 0.001), (rrc_simulation, 0.0)]
)
def test_a_flat_cube_lies_where_its_shape_touches(package: Any, margin: float) -> None:
    # PyBullet's meshes touch from 1 mm away, its boxes do not. The first cube was a box.
    platform = package.TriFingerPlatform()
    client = platform.simfinger._pybullet_client_id
    die = collision_objects.Cuboid([0.1, 0, 0.02], [0, 0, 0, 1], [0.011] * 3, 0.012, None, client)
    for _ in range(500):
        platform.append_desired_action(platform.Action(position=np.array(HOME * 3)))
    assert platform.cube.get_state()[0][2] == pytest.approx(0.0325 + margin, abs=2e-4)
    assert die.get_state()[0][2] == pytest.approx(0.011, abs=2e-4)


def test_what_slides_is_braked_by_a_friction_of_1() -> None:
    finger = SimFinger("trifingerpro")
    # A flat box, because a cube would topple.
    box = collision_objects.Cuboid(
        [0, 0, 0.01], [0, 0, 0, 1], [0.04, 0.04, 0.01], 0.1, None, finger._pybullet_client_id
    )
    hold = finger.Action(position=np.array(HOME * 3))
    for _ in range(300):
        finger.append_desired_action(hold)
    speed, begin = 0.3, box.get_state()[0][0]
    finger._world.core.set_object_velocity("object_0", [speed, 0, 0], [0, 0, 0])
    for _ in range(100):
        finger.append_desired_action(hold)
    slid = box.get_state()[0][0] - begin
    assert slid == pytest.approx(speed**2 / (2 * 1.0 * GRAVITY), rel=0.1)


@pytest.mark.parametrize("share", [0.4, 0.6])
def test_a_die_slides_at_a_tip_if_it_is_pulled_with_more_than_half_of_what_it_presses(
    share: float,
) -> None:
    # PyBullet's default of 0.5 for the tip of a Pro, times 1 of the object.
    finger = SimFinger("fingerpro")
    (tip,) = finger.kinematics.forward_kinematics(HOME)
    half, mass, pressed, steps = 0.011, 0.1, 2.0, 20
    below = [tip[0], tip[1], tip[2] - 0.010 - 0.001 - half]
    die = collision_objects.Cuboid(
        below, [0, 0, 0, 1], [half] * 3, mass, None, finger._pybullet_client_id
    )
    core = finger._world.build()
    stops = np.array(HOME)
    core.use_physics(
        stop_lower=stops - 1e-3,
        stop_upper=stops + 1e-3,
        margin=0.001,
        link_friction=0.1,
        boundary_friction=0.5,
        object_margins={},
    )
    pull = share * pressed
    for aside in [0.0] * steps + [pull] * steps:
        # The moment keeps the die level although it is pulled at its middle and held at its top.
        core.push_object("object_0", [aside, 0, pressed + mass * GRAVITY], [0, aside * half, 0])
        finger.append_desired_action(finger.Action())
    speed = core.object_velocity("object_0")[0][0]
    free = max(pull - 0.5 * pressed, 0) / mass * steps * STEP
    assert speed == pytest.approx(free, abs=0.02)
    assert die.get_state()[0][2] == pytest.approx(below[2], abs=0.001)
