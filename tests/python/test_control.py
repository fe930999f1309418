# SPDX-License-Identifier: BSD-3-Clause
"""The parts of controllers from Python, the force optimisation beside another solver."""

import numpy as np
import proxsuite
import pytest
import trifinger
from numpy.typing import NDArray
from trifinger import control

pytestmark = pytest.mark.bindings

Array = NDArray[np.float64]
INSTANCES = 2000


class Program:
    """A quadratic program that was put together without the library: forces in the world frame."""

    def __init__(
        self,
        grasp: list[control.Contact],
        centre: Array,
        wrench: control.Wrench,
        torques: control.TorqueLimits | None,
    ) -> None:
        arms = [contact.position - centre for contact in grasp]
        length = np.sqrt(np.mean([arm @ arm for arm in arms]))
        moments = [np.stack([np.cross(arm, axis) for axis in np.eye(3)], axis=1) for arm in arms]
        self.map = np.vstack([np.hstack([np.eye(3)] * 3), np.hstack(moments) / length])
        self.wrench = np.concatenate([wrench.force, wrench.moment / length])
        rows, lower, upper = [], [], []
        for i, contact in enumerate(grasp):
            inward = contact.normal / np.linalg.norm(contact.normal)
            other = np.array([1.0, 0, 0]) if abs(inward[2]) >= 0.9 else np.array([0, 0, 1.0])
            first = np.cross(other, inward)
            first /= np.linalg.norm(first)
            second = np.cross(inward, first)
            room = contact.friction / np.sqrt(2) * inward
            for row in (room - first, room + first, room - second, room + second, inward):
                rows.append(np.concatenate([np.zeros(3 * i), row, np.zeros(6 - 3 * i)]))
                lower.append(0.0)
                upper.append(np.inf)
            lower[-1], upper[-1] = contact.min_normal_force, contact.max_normal_force
        if torques is not None:
            rows.extend(torques.jacobians.T)
            lower.extend(-torques.limits - torques.bias)
            upper.extend(torques.limits - torques.bias)
        self.rows, self.lower, self.upper = np.array(rows), np.array(lower), np.array(upper)

    def solve(self, hessian: Array, gradient: Array, *, exactly: bool) -> Array | None:
        """Returns the solution of ProxQP; None if there is none."""
        solver = proxsuite.proxqp.dense.QP(9, 6 if exactly else 0, len(self.rows))
        solver.settings.eps_abs = 1e-10
        solver.settings.max_iter = 100_000
        equalities = (self.map, self.wrench) if exactly else (None, None)
        solver.init(hessian, gradient, *equalities, self.rows, self.lower, self.upper)
        solver.solve()
        if solver.results.info.status != proxsuite.proxqp.PROXQP_SOLVED:
            return None
        return np.array(solver.results.x)

    def margin(self, forces: Array) -> float:
        """Returns how far the forces are from the nearest bound; negative outside."""
        left = self.rows @ forces
        return float(min((left - self.lower).min(), (self.upper - left).min()))

    def cost(self, forces: Array) -> float:
        """Returns what `closest_forces` minimises."""
        error = self.map @ forces - self.wrench
        return float(error @ error + 1e-6 * forces @ forces) / 2

    def least_forces(self) -> Array | None:
        """Returns the forces that make the wrench."""
        return self.solve(np.eye(9), np.zeros(9), exactly=True)

    def closest_forces(self) -> Array | None:
        """Returns the forces that come closest to it."""
        hessian = self.map.T @ self.map + 1e-6 * np.eye(9)
        return self.solve(hessian, -self.map.T @ self.wrench, exactly=False)


def random_grasp(random: np.random.Generator, centre: Array) -> list[control.Contact]:
    grasp = []
    for _ in range(3):
        out = random.normal(size=3)
        out /= np.linalg.norm(out)
        grasp.append(
            control.Contact(
                position=centre + random.uniform(0.02, 0.06) * out,
                normal=0.3 * random.normal(size=3) - out,
                friction=random.uniform(0.2, 1.2),
                min_normal_force=random.choice([0.0, 0.5]),
                max_normal_force=random.uniform(1, 10),
            )
        )
    return grasp


def random_torques(random: np.random.Generator) -> control.TorqueLimits:
    jacobians = np.zeros((9, 9))
    for i in range(0, 9, 3):
        jacobians[i : i + 3, i : i + 3] = random.uniform(-0.2, 0.2, size=(3, 3))
    limits = np.full(9, random.uniform(0.2, 0.4))
    return control.TorqueLimits(jacobians, random.uniform(-0.1, 0.1, size=9), limits)


@pytest.mark.slow
def test_forces_are_those_of_another_solver() -> None:
    random = np.random.default_rng(1)
    optimizer = control.ForceOptimizer()
    counts = dict.fromkeys(control.ForceStatus, 0)
    for _ in range(INSTANCES):
        centre = random.uniform(-0.2, 0.2, size=3)
        grasp = random_grasp(random, centre)
        wrench = control.Wrench(random.uniform(-2, 2, size=3), random.uniform(-0.04, 0.04, size=3))
        torques = random_torques(random) if random.random() < 0.5 else None
        found = optimizer.solve(grasp, centre, wrench, torques)
        counts[found.status] += 1
        if found.status is control.ForceStatus.EXACT:
            other = Program(grasp, centre, wrench, torques).least_forces()
            assert other is not None
            np.testing.assert_allclose(found.forces, other, atol=1e-6)
            assert found
            continue
        assert not found
        if found.status is control.ForceStatus.TORQUE_LIMITS_EXCEEDED:
            torques = None
        program = Program(grasp, centre, wrench, torques)
        other = program.closest_forces()
        assert other is not None
        # ProxQP stops where it is within some 1e-5 of the least cost; ours must not be above it.
        np.testing.assert_allclose(found.forces, other, atol=1e-3)
        assert program.cost(found.forces) <= program.cost(other) + 1e-8
        assert program.margin(found.forces) >= -1e-9
        if found.status is control.ForceStatus.CLOSEST_WRENCH:
            assert np.linalg.norm(program.map @ other - program.wrench) > 1e-7
    assert counts[control.ForceStatus.EXACT] > INSTANCES / 20
    assert counts[control.ForceStatus.CLOSEST_WRENCH] > INSTANCES / 20
    assert counts[control.ForceStatus.INVALID] == 0


def cube_grasp() -> list[control.Contact]:
    out = [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]
    return [control.Contact(0.0325 * np.array(x), -np.array(x)) for x in out]


def test_a_cube_rests_between_three_tips() -> None:
    body = control.rigid_body("box", (0.065, 0.065, 0.065), 0.094)
    rest = control.Motion()
    wrench = control.object_impedance(rest, rest.pose, rest.twist, body)
    np.testing.assert_allclose(wrench.force, -body.mass * control.gravity())
    found = control.ForceOptimizer(friction_sides=8).solve(cube_grasp(), (0, 0, 0), wrench)
    assert found.status is control.ForceStatus.EXACT
    np.testing.assert_allclose(found.wrench.force, wrench.force, atol=1e-9)
    map_ = control.grasp_map(cube_grasp(), (0, 0, 0))
    np.testing.assert_allclose(map_ @ found.forces, [*wrench.force, *wrench.moment], atol=1e-9)
    again = control.wrench_of(cube_grasp(), (0, 0, 0), found.forces)
    np.testing.assert_allclose(again.moment, 0, atol=1e-9)


def test_forces_lie_in_their_pyramids() -> None:
    wrench = control.Wrench(force=(0, 0, 1))
    found = control.ForceOptimizer().solve(cube_grasp(), (0, 0, 0), wrench)
    pyramid = control.FrictionPyramid()
    for contact, force in zip(cube_grasp(), found.forces.reshape(3, 3), strict=True):
        local = control.contact_frame(contact.normal).T @ force
        margins = [pyramid.side(i, contact.friction) @ local for i in range(pyramid.sides)]
        assert pyramid.margin(local, contact.friction) == pytest.approx(min(margins))
        assert min(margins) >= -1e-9


def test_the_robot_lifts_with_its_own_jacobians_and_torques() -> None:
    kinematics = control.Kinematics("sim")
    position = np.tile([0.0, 0.9, -1.7], 3)
    velocity = np.linspace(-1, 1, 9)
    jacobians = kinematics.tip_jacobians(position)
    np.testing.assert_array_equal(
        jacobians, np.vstack([kinematics.tip_jacobian(i, position) for i in range(3)])
    )
    at_rest = kinematics.bias_torques(position, np.zeros(9))
    np.testing.assert_array_equal(at_rest, kinematics.gravity_torques(position))
    # Centrifugal and Coriolis torques are quadratic in the velocity.
    once = kinematics.bias_torques(position, velocity) - at_rest
    twice = kinematics.bias_torques(position, 2 * velocity) - at_rest
    np.testing.assert_allclose(twice, 4 * once, atol=1e-12)
    limits = control.TorqueLimits(jacobians, at_rest, np.full(9, 0.36))
    found = control.ForceOptimizer().solve(
        cube_grasp(), (0, 0, 0), control.Wrench(force=(0, 0, 0.9)), limits
    )
    assert np.abs(jacobians.T @ found.forces + at_rest).max() <= 0.36 + 1e-6


def test_a_tip_is_pulled_to_where_it_should_be() -> None:
    desired = control.PointMotion(position=(0, 0, 0.1))
    gains = control.TipGains(stiffness=100, damping=2)
    force = control.tip_impedance(desired, (0, 0, 0.09), (0, 0.1, 0), gains)
    np.testing.assert_allclose(force, [0, -0.2, 1])


def test_rotations_and_their_vectors() -> None:
    vector = np.array([0.1, -0.4, 0.7])
    rotation = control.rotation_from_vector(vector)
    assert rotation[0] == pytest.approx(np.cos(np.linalg.norm(vector) / 2))
    np.testing.assert_allclose(control.rotation_vector(rotation), vector)
    identity = (1, 0, 0, 0)
    np.testing.assert_allclose(control.rotation_error(identity, rotation), -vector)
    turned = control.moved(control.Pose(), control.Twist(angular=vector), 1.0)
    np.testing.assert_allclose(turned.orientation, rotation)
    point = control.point_of_body(control.Motion(twist=control.Twist(angular=(0, 0, 1))), (1, 0, 0))
    np.testing.assert_allclose(point.velocity, [0, 1, 0])


def test_trajectories_begin_and_end_at_rest() -> None:
    line = control.LineTrajectory((0, 0, 0), (0, 0, 0.2), 3.0)
    assert line.duration == 3.0
    np.testing.assert_allclose(line.at(1.5).position, [0, 0, 0.1])
    np.testing.assert_allclose(line.at(3.0).velocity, 0)
    trajectory = control.PoseTrajectory(control.Pose(), control.Pose((0, 0, 0.1)), 1.0)
    np.testing.assert_allclose(trajectory.at(1.0).pose.position, [0, 0, 0.1])
    circle = control.CircleTrajectory((0, 0, 0.03), turns=2, period=4)
    np.testing.assert_allclose(
        circle.at(0).position, circle.at(circle.duration).position, atol=1e-12
    )
    progress = control.minimum_jerk(0.5, 1.0)
    assert (progress.value, progress.acceleration) == (0.5, 0.0)


def test_filters_follow_their_signal() -> None:
    low_pass, derivative = control.LowPassFilter(10), control.Derivative(10)
    rate = np.zeros(3)
    for i in range(1000):
        low_pass.update([1, 2, 3], 0.001)
        rate = derivative.update(np.array([1, 2, 3]) * 0.001 * i, 0.001)
    np.testing.assert_allclose(low_pass.update([1, 2, 3], 0.001), [1, 2, 3])
    np.testing.assert_allclose(rate, [1, 2, 3])


def test_an_estimator_carries_late_poses_forward() -> None:
    estimator = control.PoseEstimator(bandwidth=3)
    assert estimator.last_time == -np.inf
    for time in np.arange(0, 3, 0.01):
        assert estimator.update(time, control.Pose((0.1 * time, 0, 0)))
    assert not estimator.update(0.0, control.Pose())
    motion = estimator.predict(3.05)
    assert motion.pose.position[0] == pytest.approx(0.305, abs=1e-9)
    assert motion.twist.linear[0] == pytest.approx(0.1, abs=1e-9)


@pytest.mark.parametrize("wrong", [(1, 2), (1, 2, 3, 4), ((1, 2, 3),), "abc", None])
def test_what_is_no_vector_of_three_is_refused(wrong: object) -> None:
    with pytest.raises(TypeError):
        control.Wrench(force=wrong)  # type: ignore[arg-type]


def test_settings_that_make_no_sense_are_refused_by_name() -> None:
    with pytest.raises(trifinger.InvalidArgument, match="9 sides"):
        control.ForceOptimizer(friction_sides=9)
    with pytest.raises(trifinger.InvalidArgument, match="side is 4"):
        control.FrictionPyramid().side(4, 0.5)
    with pytest.raises(trifinger.InvalidArgument, match="no shape 'cone', only box, stick, ball"):
        control.rigid_body("cone", (1, 1, 1), 1)


def test_every_name_is_exported_and_documented() -> None:
    for name, thing in vars(control).items():
        assert name.startswith("_") or thing.__doc__, name
