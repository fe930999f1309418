# SPDX-License-Identifier: BSD-3-Clause
"""Calls of PyBullet beside the simulation: what works without it, and what says what to use."""

import copy
import operator
import pickle
from types import SimpleNamespace
from typing import Any

import numpy as np
import pybullet as p
import pytest
from trifinger_simulation import SimFinger, TriFingerPlatform
from trifinger_simulation.trifinger_platform import ObjectType

# PyBullet, written in C, asks what it is given for a number like this.
REAL = SimpleNamespace(getContactPoints=operator.index, anything=operator.index)


def test_an_installed_pybullet_gets_an_error_that_says_what_to_use() -> None:
    platform = TriFingerPlatform()
    for handle in (
        platform.simfinger._pybullet_client_id,
        platform.simfinger.finger_id,
        platform.cube._object_id,
        platform.cube.block,
    ):
        with pytest.raises(NotImplementedError, match=r"getContactPoints: .*tip_force"):
            REAL.getContactPoints(
                handle,
            )
        with pytest.raises(NotImplementedError, match=r"anything: .*coming_from_the_original"):
            (operator.index(0), REAL.anything(handle))
        for copied in (copy.deepcopy(handle), pickle.loads(pickle.dumps(handle))):
            assert copied == handle
            assert copied == handle.number


@pytest.mark.parametrize("call", ["connect", "loadURDF", "createMultiBody", "somethingElse"])
def test_without_pybullet_calls_that_need_it_say_what_to_use(call: str) -> None:
    function = getattr(p, call)
    with pytest.raises(NotImplementedError, match=f"{call}: no PyBullet is below"):
        function(1, x=2)
    with pytest.raises(AttributeError, match="no 'NO_CONSTANT'"):
        p.NO_CONSTANT  # noqa: B018


def test_mathematics_is_that_of_pybullet() -> None:
    # From PyBullet 3.2.7.
    angles = (0.1, -0.5, 1.2)
    quaternion = (0.179487, -0.176593, 0.556611, 0.791697)
    assert p.getQuaternionFromEuler(angles) == pytest.approx(quaternion, abs=1e-6)
    assert p.getEulerFromQuaternion(quaternion) == pytest.approx(angles, abs=1e-5)
    quarter = p.getMatrixFromQuaternion((0, 0, np.sqrt(0.5), np.sqrt(0.5)))
    assert quarter == pytest.approx((0, -1, 0, 1, 0, 0, 0, 0, 1))
    assert p.ER_TINY_RENDERER == 65536


def test_views_are_left_alone_and_a_simulation_is_connected() -> None:
    client = SimFinger("trifingerpro")._pybullet_client_id
    p.configureDebugVisualizer(p.COV_ENABLE_GUI, 0, physicsClientId=client)
    p.resetDebugVisualizerCamera(
        cameraDistance=0.6, cameraYaw=0, cameraPitch=-40, cameraTargetPosition=[0, 0, 0]
    )
    assert p.isConnected(client)
    assert not p.isConnected(0)


def hold(platform: Any, steps: int) -> None:
    for _ in range(steps):
        platform.append_desired_action(platform.Action(position=[0, 0.9, -1.7] * 3))


def test_the_cube_is_moved_pushed_and_weighed() -> None:
    platform = TriFingerPlatform()
    cube, client = platform.cube.block, platform.simfinger._pybullet_client_id
    p.resetBasePositionAndOrientation(cube, [0.02, 0, 0.6], [0, 0, 0, 1], client)
    assert p.getBasePositionAndOrientation(cube)[0] == pytest.approx((0.02, 0, 0.6))
    p.resetBaseVelocity(cube, [0.1, 0, 0.5], [0, 0, 2], physicsClientId=client)
    linear, angular = p.getBaseVelocity(cube, client)
    assert (*linear, *angular) == pytest.approx((0.1, 0, 0.5, 0, 0, 2))
    p.changeDynamics(cube, -1, mass=0.5, physicsClientId=client)
    p.resetBaseVelocity(cube)
    at = [0.02, 0, 0.6]
    p.applyExternalForce(cube, -1, [0, 0, 0.5 * 9.81], at, p.WORLD_FRAME)
    hold(platform, 1)
    assert p.getBaseVelocity(cube)[0] == pytest.approx((0, 0, 0), abs=1e-4)
    hold(platform, 100)
    assert p.getBaseVelocity(cube)[0][2] == pytest.approx(-0.981, rel=0.02)
    with pytest.raises(NotImplementedError, match="object_mass"):
        p.changeDynamics(cube, -1, lateralFriction=0.5)
    with pytest.raises(NotImplementedError, match="platform"):
        p.getBaseVelocity(platform.simfinger.finger_id)


def test_forces_beside_the_centre_turn_the_cube_and_frames_are_told_apart() -> None:
    rates = []
    for flags, place in ((p.WORLD_FRAME, [0.02, 0, 0.6]), (p.LINK_FRAME, [0.02, 0, 0])):
        platform = TriFingerPlatform()
        cube = platform.cube.block
        # A quarter turn about z: the frame's x is the world's y.
        p.resetBasePositionAndOrientation(cube, [0, 0, 0.6], [0, 0, np.sqrt(0.5), np.sqrt(0.5)])
        p.applyExternalForce(cube, -1, [0, 0, 1], place, flags)
        hold(platform, 1)
        rates.append(p.getBaseVelocity(cube)[1])
    # The moment is place x force: about -y of the frame that was meant, which is +x of the world.
    assert rates[0][1] < -0.1
    assert rates[0][0] == pytest.approx(0, abs=1e-3)
    assert rates[1][0] == pytest.approx(-rates[0][1], rel=0.01)
    platform = TriFingerPlatform()
    p.resetBasePositionAndOrientation(platform.cube.block, [0, 0, 0.6], [0, 0, 0, 1])
    p.applyExternalTorque(platform.cube.block, -1, [0, 0, 0.01], p.WORLD_FRAME)
    hold(platform, 1)
    assert p.getBaseVelocity(platform.cube.block)[1][2] > 0.1


def test_states_of_joints_are_in_the_order_of_the_links() -> None:
    platform = TriFingerPlatform(object_type=ObjectType.NONE)
    finger = platform.simfinger
    hold(platform, 3)
    seen = platform.get_robot_observation(3)
    states = p.getJointStates(finger.finger_id, finger.pybullet_link_indices)
    assert [state[0] for state in states] == list(seen.position)
    assert [state[1] for state in states] == list(seen.velocity)
    assert [state[3] for state in states] == list(seen.torque)
