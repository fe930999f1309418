# SPDX-License-Identifier: BSD-3-Clause
"""Kinematics and dynamics of any robot are those of MuJoCo, which judges them here."""

from typing import Any

import mujoco
import numpy as np
import pytest
import trifinger
from test_other_robots import OTHERS, configuration_of
from trifinger.foreign_models import model_of

pytestmark = pytest.mark.bindings

NUM_POSES = 20
# The judge reads the model as text, whose masses are rounded; in C++ both have the same model.
ROUNDED = {"rtol": 1e-5, "atol": 1e-6}
# Robots whose driven joints are all hinges and slides of their own, which MuJoCo can be told.
CHAINS = [name for name in OTHERS if name not in ("shadow",)]
FRAMES = {"panda": "right_hand", "ur5e": "right_hand"}


class Judge:
    """MuJoCo's own answers for a robot with named joints."""

    def __init__(self, config: str, kinematics: trifinger.ModelKinematics) -> None:
        self.model = model_of(trifinger.export_mjcf(config))
        self.data = mujoco.MjData(self.model)
        # Joints without a motor stay where sessions begin.
        self.data.qpos[:] = trifinger.Simulation(config).configuration()[: self.model.nq]
        joints = [self.model.joint(name) for name in kinematics.joint_names]
        self.places = [int(joint.qposadr[0]) for joint in joints]
        self.dofs = [int(joint.dofadr[0]) for joint in joints]

    def pose(self, position: Any, velocity: Any = None) -> None:
        self.data.qpos[self.places] = position
        self.data.qvel[:] = 0
        if velocity is not None:
            self.data.qvel[self.dofs] = velocity
        mujoco.mj_forward(self.model, self.data)

    def frame(self, name: str) -> tuple[Any, Any, int]:
        """Place, matrix and body of a frame."""
        for kind, places, matrices in (
            (mujoco.mjtObj.mjOBJ_SITE, self.data.site_xpos, self.data.site_xmat),
            (mujoco.mjtObj.mjOBJ_BODY, self.data.xpos, self.data.xmat),
        ):
            number = mujoco.mj_name2id(self.model, kind, name)
            if number >= 0:
                is_site = kind == mujoco.mjtObj.mjOBJ_SITE
                body = int(self.model.site_bodyid[number]) if is_site else number
                return places[number].copy(), matrices[number].reshape(3, 3).copy(), body
        raise AssertionError(name)


def drawn(kinematics: trifinger.ModelKinematics, random: np.random.Generator) -> Any:
    low, high = np.clip(kinematics.ranges.T, -2.0, 2.0)
    return random.uniform(low, high)


def matrix_of(orientation: Any) -> Any:
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, orientation)
    return matrix.reshape(3, 3)


@pytest.mark.parametrize("name", CHAINS)
def test_they_are_those_of_mujoco(name: str) -> None:
    config = str(configuration_of(name))
    kinematics = trifinger.ModelKinematics(config)
    judge = Judge(config, kinematics)
    random = np.random.default_rng(1)
    for _ in range(NUM_POSES):
        position = drawn(kinematics, random)
        judge.pose(position)
        for frame in kinematics.frames:
            place, orientation = kinematics.pose(frame, position)
            expected, matrix, body = judge.frame(frame)
            np.testing.assert_allclose(place, expected, **ROUNDED)
            np.testing.assert_allclose(matrix_of(orientation), matrix, **ROUNDED)
            jacobian = np.zeros((6, judge.model.nv))
            mujoco.mj_jac(judge.model, judge.data, jacobian[:3], jacobian[3:], expected, body)
            found = kinematics.jacobian(frame, position)
            np.testing.assert_allclose(found, jacobian[:, judge.dofs], **ROUNDED)
        # A spring that the model has acts, too.
        spring = judge.data.qfrc_spring + judge.data.qfrc_gravcomp
        weight = (judge.data.qfrc_bias - spring)[judge.dofs]
        np.testing.assert_allclose(kinematics.gravity_torques(position), weight, **ROUNDED)
        velocity = random.uniform(-1, 1, len(position))
        judge.pose(position, velocity)
        bias = (judge.data.qfrc_bias - spring)[judge.dofs]
        np.testing.assert_allclose(kinematics.bias_torques(position, velocity), bias, **ROUNDED)
        mass = np.zeros((judge.model.nv, judge.model.nv))
        mujoco.mj_fullM(judge.model, judge.data, mass)
        expected = mass[np.ix_(judge.dofs, judge.dofs)]
        np.testing.assert_allclose(kinematics.mass_matrix(position), expected, **ROUNDED)


def test_those_of_a_trifinger_are_the_ones_that_it_has_already() -> None:
    kinematics, own = (
        trifinger.ModelKinematics("trifinger_pro"),
        trifinger.Kinematics("trifinger_pro"),
    )
    random = np.random.default_rng(2)
    for _ in range(NUM_POSES):
        position = drawn(kinematics, random)
        tips = own.tip_positions(position)
        for finger, frame in enumerate(kinematics.frames):
            np.testing.assert_allclose(
                kinematics.pose(frame, position)[0], tips[finger], atol=1e-12
            )
            jacobian = kinematics.jacobian(frame, position)[:3]
            np.testing.assert_allclose(jacobian, own.tip_jacobian(finger, position), atol=1e-12)
        weight = own.gravity_torques(position)
        np.testing.assert_allclose(kinematics.gravity_torques(position), weight, **ROUNDED)


@pytest.mark.parametrize("name", ["panda", "ur5e"])
def test_inverse_kinematics_finds_what_can_be_reached(name: str) -> None:
    config = str(configuration_of(name))
    frame = FRAMES[name]
    kinematics = trifinger.ModelKinematics(config, [frame])
    judge = Judge(config, kinematics)
    random = np.random.default_rng(3)
    reached = 0
    for _ in range(1000):
        judge.pose(random.uniform(*kinematics.ranges.T))
        goal, matrix, _ = judge.frame(frame)
        orientation = np.zeros(4)
        mujoco.mju_mat2Quat(orientation, matrix.ravel())
        found = kinematics.inverse_kinematics(frame, goal, orientation)
        low, high = kinematics.ranges.T
        assert ((low <= found.position) & (found.position <= high)).all()
        judge.pose(found.position)
        place, turned, _ = judge.frame(frame)
        difference = np.zeros(4)
        mujoco.mju_mat2Quat(difference, (turned.T @ matrix).ravel())
        is_there = np.linalg.norm(place - goal) <= 1e-6 and np.linalg.norm(difference[1:]) <= 1e-6
        reached += is_there
    assert reached >= 990


def test_what_is_wrong_is_said(arm: str) -> None:
    kinematics = trifinger.ModelKinematics(arm, ["hand"])
    assert repr(kinematics.inverse_kinematics("hand", (5.0, 0.0, 0.0))).startswith(
        "JointSolution(is_reached=False, distance="
    )
    with pytest.raises(trifinger.InvalidArgument, match="no frame 'foot'"):
        kinematics.pose("foot", np.zeros(2))
    with pytest.raises(trifinger.InvalidArgument, match="position has 3 numbers, must have 2"):
        kinematics.pose("hand", np.zeros(3))
    with pytest.raises(trifinger.InvalidArgument, match="quaternion"):
        kinematics.inverse_kinematics("hand", np.zeros(3), np.zeros(4))
    with pytest.raises(trifinger.InvalidArgument, match="finite"):
        kinematics.inverse_kinematics("hand", (np.nan, 0.0, 0.0))
    with pytest.raises(trifinger.InvalidArgument, match="the model has no frame 'foot'"):
        trifinger.ModelKinematics(arm, ["foot"])
