# SPDX-License-Identifier: BSD-3-Clause
"""Calls of PyBullet beside the simulation: what is served, what is handed on, what says no."""

import copy
import importlib.machinery
import inspect
import operator
import pickle
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pybullet as p
import pytest
from pybullet_stand_in import PyBullet
from trifinger.errors import InvalidArgument
from trifinger_compat import bullet
from trifinger_compat.bullet_names import CONSTANTS, FUNCTIONS
from trifinger_compat.handles import VIEWS
from trifinger_simulation import SimFinger, TriFingerPlatform
from trifinger_simulation.trifinger_platform import ObjectType


@pytest.fixture
def theirs() -> PyBullet:
    return PyBullet()


@pytest.fixture
def both(theirs: PyBullet) -> Any:
    """What `import pybullet` gives where PyBullet is installed."""
    return SimpleNamespace(**bullet.names(theirs))


def without() -> Any:
    """What `import pybullet` gives where it is not."""
    return SimpleNamespace(**bullet.names(None))


def handles(platform: TriFingerPlatform) -> list[Any]:
    finger, cube = platform.simfinger, platform.cube
    return [finger._pybullet_client_id, finger.finger_id, cube._object_id, cube.block]


@pytest.mark.parametrize("name", sorted(FUNCTIONS - {"isConnected"}))
def test_calls_without_our_ids_are_those_of_an_installed_pybullet(
    name: str, both: Any, theirs: PyBullet
) -> None:
    words: Any
    for words, named in (((), {}), ((0, [1.0, 2.0]), {}), ((3,), {"physicsClientId": 1})):
        theirs._calls.clear()
        assert getattr(both, name)(*words, **named) == name
        assert theirs._calls[-1] == (name, words, named)


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_no_call_hands_our_ids_to_pybullet(name: str, both: Any, theirs: PyBullet) -> None:
    """Whatever the call makes of them, a world of PyBullet's is not moved in place of ours."""
    for handle in handles(TriFingerPlatform()):
        for words, named in (((handle,), {}), ((0,), {"physicsClientId": handle})):
            for module in (both, without()):
                call = partial(getattr(module, name), *words, **named)
                if name in bullet.SERVED:  # something else may be wrong with the arguments
                    with suppress(LookupError, NotImplementedError, TypeError, ValueError):
                        call()
                else:
                    with pytest.raises(NotImplementedError, match=rf"\.{name}: no PyBullet is be"):
                        call()
    assert theirs._calls == []


def test_all_names_are_those_of_pybullet() -> None:
    space: dict[str, Any] = {}
    exec("from pybullet import *", space)  # noqa: S102 (no function may do so)
    del space["__builtins__"]
    assert space.keys() == {name for name in bullet.names(bullet.installed()) if name[0] != "_"}


def test_a_planner_moves_a_world_of_its_own_beside_the_simulation(
    both: Any, theirs: PyBullet
) -> None:
    platform = TriFingerPlatform()
    client, cube = platform.simfinger._pybullet_client_id, platform.cube._object_id
    both.resetBasePositionAndOrientation(cube, [0.05, 0, 0.6], [0, 0, 0, 1], client)
    position, orientation = both.getBasePositionAndOrientation(cube, physicsClientId=client)
    both.resetBasePositionAndOrientation(7, [*position], [*orientation], physicsClientId=0)
    assert theirs._calls == [
        (
            "resetBasePositionAndOrientation",
            (7, [0.05, 0, 0.6], [0, 0, 0, 1]),
            {"physicsClientId": 0},
        )
    ]
    assert platform.cube.get_state()[0] == [0.05, 0, 0.6]


def test_views_of_nobody_are_left_alone(both: Any, theirs: PyBullet) -> None:
    """In the original, what names no client is the platform's view."""
    theirs._is_connected = False
    for name in VIEWS:
        assert getattr(both, name)(both.COV_ENABLE_GUI, 0) is None
    assert {call[0] for call in theirs._calls} == {"isConnected"}


def test_clients_of_pybullet_utils_give_their_number_to_served_calls_too(both: Any) -> None:
    """BulletClient does so if `inspect.isbuiltin` says yes."""
    for name in bullet.SERVED:
        assert inspect.isbuiltin(getattr(both, name))
        assert getattr(both, name).__name__ == name


def test_a_body_and_the_client_of_another_world_do_not_go_together(both: Any) -> None:
    one, other = TriFingerPlatform(), SimFinger("trifingerpro")
    for module in (both, without()):
        for client in (other._pybullet_client_id, 5):
            with pytest.raises(InvalidArgument, match="getBaseVelocity: the body is one of"):
                module.getBaseVelocity(one.cube.block, physicsClientId=client)
        finger = one.simfinger
        with pytest.raises(InvalidArgument, match="getJointStates: the body is one of"):
            module.getJointStates(finger.finger_id, [2], other._pybullet_client_id)
        assert module.getBaseVelocity(one.cube.block, finger._pybullet_client_id.number)


def test_ids_are_numbers_when_they_are_compared_and_kept() -> None:
    for handle in handles(TriFingerPlatform()):
        with pytest.raises(NotImplementedError, match="PyBullet, which has no such world"):
            operator.index(handle)
        for copied in (copy.deepcopy(handle), pickle.loads(pickle.dumps(handle))):
            assert copied == handle
            assert copied == handle.number


@pytest.mark.parametrize("name", sorted(FUNCTIONS - bullet.SERVED.keys()))
def test_without_pybullet_calls_that_need_it_say_how_to_get_it(name: str) -> None:
    with pytest.raises(NotImplementedError, match=f"{name}: PyBullet is not installed; .*: pip in"):
        getattr(without(), name)(1, x=2)


def test_there_is_nothing_that_pybullet_has_not(both: Any) -> None:
    for module in (both, without(), p):  # p has PyBullet itself where that is installed
        public = {name for name in vars(module) if name[0] != "_"} - {"Any", "bullet"}
        assert public == {*CONSTANTS, *FUNCTIONS, "error"}
        assert issubclass(module.error, Exception)
        assert {name: getattr(module, name) for name in CONSTANTS} == CONSTANTS
    with pytest.raises(AttributeError, match="no attribute 'NO_CONSTANT'"):
        p.NO_CONSTANT  # noqa: B018


@pytest.mark.skipif(bullet.find_installed() is None, reason="PyBullet itself is not installed")
def test_pybullet_itself_moves_a_mirror_of_the_robot_and_tests_collisions() -> None:
    platform = TriFingerPlatform()
    finger, cube = platform.simfinger, platform.cube._object_id
    for world in (p.connect(p.DIRECT), p.connect(p.DIRECT)):
        robot = p.loadURDF(finger.finger_urdf_path, useFixedBase=True, physicsClientId=world)
        box = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.0325] * 3, physicsClientId=world)
        mirror = p.createMultiBody(0.1, box, physicsClientId=world)
        states = p.getJointStates(finger.finger_id, finger.pybullet_link_indices)
        for joint, state in zip(finger.pybullet_joint_indices, states, strict=True):
            p.resetJointState(robot, joint, state[0], physicsClientId=world)
        tips = platform.forward_kinematics([state[0] for state in states])
        for link, tip in zip(finger.pybullet_tip_link_indices, tips, strict=True):
            seen = p.getLinkState(robot, link, computeForwardKinematics=1, physicsClientId=world)
            assert seen[4] == pytest.approx(tip, abs=1e-5)
        for place, distance in ((tips[0], 0), ([0.0, 0.0, 0.6], None)):
            p.resetBasePositionAndOrientation(mirror, place, [0, 0, 0, 1], physicsClientId=world)
            near = p.getClosestPoints(robot, mirror, 0.001, physicsClientId=world)
            assert bool(near) is (distance == 0)
        pose = p.getBasePositionAndOrientation(cube)
        p.resetBasePositionAndOrientation(mirror, *pose, physicsClientId=world)
        assert p.getBasePositionAndOrientation(mirror, physicsClientId=world) == pose
        with pytest.raises(NotImplementedError, match=r"getContactPoints: .*tip_force"):
            p.getContactPoints(finger.finger_id, physicsClientId=world)
    p.disconnect(0)
    p.disconnect(1)


def test_pybullet_is_found_in_whatever_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packages = Path(p.__file__).parents[1]
    name = f"pybullet{importlib.machinery.EXTENSION_SUFFIXES[0]}"
    # pip puts both into one folder: the package is what Python finds.
    (tmp_path / "pybullet").symlink_to(packages / "pybullet")
    (tmp_path / name).touch()
    monkeypatch.setattr("sys.path", [str(packages), str(tmp_path)])
    spec = bullet.find_installed()
    assert spec is not None
    assert spec.origin == str(tmp_path / name)
    found = importlib.machinery.PathFinder.find_spec("pybullet", [str(tmp_path)])
    assert found is not None
    assert found.origin == str(tmp_path / "pybullet" / "__init__.py")
    monkeypatch.setattr("sys.path", [str(packages)])
    assert bullet.find_installed() is None


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
    assert not p.isConnected(client)  # its world has gone
    finger = SimFinger("trifingerpro")
    assert p.isConnected(finger._pybullet_client_id)


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
    with pytest.raises(NotImplementedError, match=r"platform\.cube"):
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
