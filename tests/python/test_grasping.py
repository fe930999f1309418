# SPDX-License-Identifier: BSD-3-Clause
"""Planning and controlling grasps from Python, beside their equations in NumPy."""

import itertools
from collections.abc import Sequence

import numpy as np
import pytest
import trifinger
from numpy.typing import NDArray
from trifinger import control
from trifinger.control import GraspPhase

pytestmark = pytest.mark.bindings

Array = NDArray[np.float64]
HALF = 0.0325  # half the edge of the cube [m]
MASS = 0.094  # [kg]
RADIUS = 0.0095  # radius of a tip [m]
PERIOD = 1e-3  # [s]
TORQUE = 0.36  # [Nm]
SAFETY_KD = np.tile([0.09, 0.09, 0.05], 3)
RAISED: dict[str, object] = {"fingers.height": 0.3}


def cube() -> control.RigidBody:
    return control.rigid_body("box", [2 * HALF] * 3, MASS)


def on_table(x: float, y: float, yaw: float) -> control.Pose:
    return control.Pose((x, y, HALF), control.rotation_from_vector((0, 0, yaw)))


def raised(pose: control.Pose, height: float) -> control.Pose:
    return control.Pose(pose.position + np.array([0, 0, height]), pose.orientation)


def upwards(start: control.Pose, height: float) -> list[control.Motion]:
    return [control.Motion(raised(start, share * height)) for share in np.linspace(0, 1, 4)]


def turned(pose: control.Pose, vector: Array) -> Array:
    """`vector` of the frame of `pose` in the world frame."""
    fixed = control.Motion(control.Pose(orientation=pose.orientation))
    return control.point_of_body(fixed, vector).position


# ---- the planner ----


def test_a_grasp_carries_the_cube_with_the_share_of_torque_that_it_says() -> None:
    kinematics = control.Kinematics("sim", RAISED)
    planner = control.GraspPlanner("sim", RAISED)
    for x, y, yaw in [(0, 0, 0), (0.01, -0.01, 0.5), (-0.015, 0.005, 1.1), (0, 0.01, -2.3)]:
        trajectory = upwards(on_table(x, y, yaw), 0.15)
        grasp = planner.plan(trajectory)
        assert grasp is not None
        contacts = []
        for touch in grasp.touches:
            # The contact is on a side face, whose normal points inwards.
            assert touch.normal[2] == 0
            assert touch.point @ -touch.normal == pytest.approx(HALF)
            normal = turned(trajectory[0].pose, touch.normal)
            contacts.append(
                control.Contact(
                    turned(trajectory[0].pose, touch.point),
                    normal,
                    friction=0.45,
                    min_normal_force=0.9,
                )
            )
        weight = control.Wrench(-MASS * control.gravity())
        found = control.ForceOptimizer().solve(contacts, np.zeros(3), weight)
        assert found
        shares = []
        near = np.tile([0, 0.9, -1.7], 3)
        for motion in trajectory:
            for finger, touch in enumerate(grasp.touches):
                tip = control.point_of_body(motion, touch.point - RADIUS * touch.normal).position
                joints = slice(3 * finger, 3 * finger + 3)
                near[joints], reach = kinematics.inverse_kinematics(finger, tip, near[joints])
                assert reach == "yes"
            torques = kinematics.tip_jacobians(near).T @ found.forces
            torques += kinematics.gravity_torques(near)
            shares.append(np.abs(torques).max() / TORQUE)
        assert grasp.torque_share == pytest.approx(max(shares), abs=1e-9)


def test_the_configuration_says_how_strong_and_how_free_the_joints_are() -> None:
    trajectory = upwards(on_table(0, 0, 0.3), 0.1)
    usual = control.GraspPlanner("sim", RAISED).plan(trajectory)
    assert usual is not None
    weak = {"safety.max_torque": TORQUE / 4, "safety.continuous_torque": TORQUE / 4}
    assert control.GraspPlanner("sim", RAISED | weak).plan(trajectory) is None
    settings = control.GraspPlannerConfig(largest_torque=5.0)
    grasp = control.GraspPlanner("sim", RAISED | weak, settings=settings).plan(trajectory)
    assert grasp is not None
    assert grasp.torque_share == pytest.approx(4 * usual.torque_share)
    narrow = {"safety.soft_lower": [-1.6, -1.2, -1.75], "fingers.initial_position": [0, 0.9, -1.7]}
    settings = control.GraspPlannerConfig(limit_margin=0.5)
    assert control.GraspPlanner("sim", RAISED | narrow, settings=settings).plan(trajectory) is None


def test_a_tip_comes_from_above_and_from_the_side() -> None:
    touch = control.Touch((HALF, 0, 0), (-1, 0, 0))
    approach = control.approach_to(touch, on_table(0.1, 0, np.pi / 2), RADIUS)
    np.testing.assert_allclose(approach.beside[:2], [0.1, HALF + RADIUS + 0.035], atol=1e-12)
    np.testing.assert_allclose(approach.above[:2], approach.beside[:2])
    assert approach.above[2] > 2 * HALF + RADIUS


def test_there_is_no_grasp_for_what_is_out_of_reach() -> None:
    planner = control.GraspPlanner()
    assert planner.plan(upwards(on_table(0, 0, 0), 0.4)) is None
    assert planner.plan([control.Motion(control.Pose((np.nan, 0, 0)))]) is None
    assert planner.plan([]) is None


# ---- the controller ----


def random_joints(random: np.random.Generator) -> tuple[Array, Array, Array]:
    position = np.tile([0.0, 0.9, -1.7], 3) + random.uniform(-0.2, 0.2, size=9)
    return position, random.uniform(-1, 1, size=9), random.uniform(-0.3, 0.3, size=9)


def test_tips_accelerate_as_their_jacobians_change() -> None:
    kinematics = control.Kinematics()
    position, velocity, _ = random_joints(np.random.default_rng(1))
    step = 1e-6 * velocity
    jacobians = [kinematics.tip_jacobians(position + sign * step) for sign in (1, -1)]
    expected = (jacobians[0] - jacobians[1]) @ velocity / 2e-6
    accelerations = kinematics.tip_accelerations(position, velocity)
    np.testing.assert_allclose(accelerations.ravel(), expected, atol=1e-6)


def test_torques_at_rest_are_those_of_the_equation() -> None:
    random = np.random.default_rng(2)
    kinematics = control.Kinematics()
    for _ in range(20):
        settings = control.GraspControllerConfig(tips=control.TipGains(damping=3.0))
        controller = control.GraspController(cube(), settings=settings)
        position, velocity, torque = random_joints(random)
        still = control.Motion()
        joints = control.JointState(position, velocity, torque)
        torques = controller.update(PERIOD, joints, still, still)
        jacobians = kinematics.tip_jacobians(position)
        bias = kinematics.bias_torques(position, velocity)
        # The tips are to stay where they are.
        force = -3.0 * jacobians @ velocity
        drift = kinematics.tip_accelerations(position, velocity).ravel()
        acceleration = -np.linalg.solve(jacobians, drift)
        expected = jacobians.T @ force + kinematics.mass_matrix(position) @ acceleration + bias
        expected += SAFETY_KD * velocity
        np.testing.assert_allclose(torques, expected, atol=1e-9)
        state = controller.state
        assert state.phase is GraspPhase.IDLE
        assert state.torque_share == pytest.approx(np.abs(expected).max() / TORQUE)
        # Before any face is known, the normal force of a tip is the force along x.
        pressed = np.linalg.solve(jacobians.T, torque - bias).reshape(3, 3)
        np.testing.assert_allclose(state.normal_forces, pressed[:, 0], atol=1e-9)
        across = np.linalg.norm(pressed[:, 1:], axis=1)
        np.testing.assert_allclose(state.tangential_forces, across, atol=1e-9)
        assert state.wanted.status is control.ForceStatus.INVALID


def test_the_damping_of_the_configuration_is_made_up_for() -> None:
    still = control.Motion()
    position, velocity, torque = random_joints(np.random.default_rng(3))
    joints = control.JointState(position, velocity, torque)
    torques = [
        control.GraspController(cube(), "sim", {"safety.safety_kd": damping}).update(
            PERIOD, joints, still, still
        )
        for damping in (0.0, 0.2)
    ]
    np.testing.assert_allclose(torques[1] - torques[0], 0.2 * velocity, atol=1e-12)


class Scene:
    """A simulated robot with its cube and a controller, which knows where the cube is."""

    def __init__(self) -> None:
        self.simulation = trifinger.Simulation("sim")
        self.robot = self.simulation.connect()
        self.controller = control.GraspController(cube())
        self.rest = self.cube().pose
        self.desired = control.Motion(self.rest)
        self.phases: list[GraspPhase] = []
        action = self.robot.new_action(position=self.robot.latest_observation().position)
        self.observation = self.robot.get_observation(self.robot.append_desired_action(action))

    def cube(self) -> control.Motion:
        return control.Motion(control.Pose(*self.simulation.object_pose("cube")))

    def grasp(self) -> None:
        grasp = control.GraspPlanner().plan(upwards(self.rest, 0.02))
        assert grasp is not None
        self.controller.grasp(grasp.touches, self.rest)

    def step(self) -> GraspPhase:
        y = self.observation
        joints = control.JointState(y.position, y.velocity, y.torque)
        torque = self.controller.update(PERIOD, joints, self.cube(), self.desired)
        t = self.robot.append_desired_action(self.robot.new_action(torque=torque))
        self.observation = self.robot.get_observation(t)
        phase = self.controller.state.phase
        if self.phases[-1:] != [phase]:
            self.phases.append(phase)
        return phase

    def run_until(self, phase: GraspPhase) -> None:
        assert any(self.step() is phase for _ in range(10_000))


def test_a_cube_is_taken_held_and_let_go() -> None:
    scene = Scene()
    scene.grasp()
    scene.run_until(GraspPhase.HOLD)
    lift = control.PoseTrajectory(scene.rest, raised(scene.rest, 0.02), 0.5)
    for i in range(1000):
        scene.desired = lift.at(i * PERIOD)
        assert scene.step() is GraspPhase.HOLD
    state = scene.controller.state
    assert scene.cube().pose.position[2] == pytest.approx(HALF + 0.02, abs=1e-3)
    # The forces computed from the joints match those that the tips measure and those asked for.
    np.testing.assert_allclose(state.normal_forces, scene.observation.tip_force, atol=0.1)
    assert state.wanted.status is control.ForceStatus.EXACT
    assert state.wanted.wrench.force[2] == pytest.approx(MASS * 9.81, abs=0.3)
    assert 0 <= state.travel.max() < 0.01
    scene.desired = control.Motion(scene.rest)
    scene.controller.release()
    scene.run_until(GraspPhase.IDLE)
    assert scene.phases == [
        *(GraspPhase.APPROACH, GraspPhase.CLOSE, GraspPhase.ENGAGE),
        *(GraspPhase.HOLD, GraspPhase.RELEASE, GraspPhase.IDLE),
    ]
    assert scene.observation.tip_force.max() == 0


def test_a_cube_that_is_not_there_is_said_to_be_lost() -> None:
    scene = Scene()
    scene.grasp()
    scene.simulation.place_object("cube", [0.13, 0.1, HALF])
    scene.run_until(GraspPhase.LOST)
    scene.controller.release()
    scene.run_until(GraspPhase.IDLE)
    assert GraspPhase.HOLD not in scene.phases


# ---- what is refused ----


@pytest.mark.parametrize("wrong", [np.zeros(8), np.zeros((3, 3)), [0.0] * 10, "abc", None])
def test_joints_are_nine_numbers(wrong: object) -> None:
    for place, name in enumerate(("position", "velocity", "torque")):
        values: list[object] = [np.zeros(9)] * 3
        values[place] = wrong
        with pytest.raises(TypeError):
            control.JointState(*values)  # type: ignore[arg-type]
        assert getattr(control.JointState(*[np.arange(9)] * 3), name).tolist() == list(range(9))


def test_touches_are_three() -> None:
    touch = control.Touch((HALF, 0, 0), (-1, 0, 0))
    controller = control.GraspController(cube())
    wrong: Sequence[object]
    for wrong in ([touch] * 2, [touch] * 4, [None] * 3):
        with pytest.raises(TypeError):
            controller.grasp(wrong, control.Pose())  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        control.Touch((HALF, 0), (-1, 0, 0))


def test_settings_are_read_and_changed_by_name() -> None:
    config = control.GraspControllerConfig(friction=0.3, roll_time=0.5)
    assert (config.friction, config.roll_time, config.touch_force) == (0.3, 0.5, 0.3)
    config.lost_time = 0.2
    config.object = control.ObjectGains(stiffness=50)
    assert (config.lost_time, config.object.stiffness) == (0.2, 50)
    config.tips.stiffness = 123
    assert control.GraspControllerConfig().tips.stiffness == 300
    planner = control.GraspPlannerConfig(offsets=[0.0], heights=np.array([-0.01]))
    assert (planner.offsets, planner.heights) == ([0.0], [-0.01])
    with pytest.raises(TypeError):
        control.GraspControllerConfig(grip=1.0)  # type: ignore[call-arg]


def test_settings_that_make_no_sense_are_refused_by_name() -> None:
    for name in ("friction", "touch_force", "roll_time", "lost_distance"):
        with pytest.raises(trifinger.InvalidArgument, match=name):
            control.GraspController(cube(), settings=control.GraspControllerConfig(**{name: 0.0}))
    with pytest.raises(trifinger.InvalidArgument, match="clearance"):
        control.GraspPlanner(settings=control.GraspPlannerConfig(clearance=-1.0))
    with pytest.raises(trifinger.InvalidArgument, match="cup"):
        control.GraspPlanner(object="cup")
    with pytest.raises(trifinger.InvalidArgument, match="three fingers"):
        control.GraspController(cube(), "finger_edu")
    scene = {"objects": [{"name": "cube", "type": "cube"}]}
    with pytest.raises(trifinger.InvalidArgument, match="three fingers"):
        control.GraspPlanner("finger_edu", scene)


def test_planning_again_gives_the_same() -> None:
    trajectory = upwards(on_table(0.01, 0, 0.2), 0.1)
    planner = control.GraspPlanner("sim", RAISED)
    grasps = [
        planner.plan(trajectory),
        planner.plan(trajectory),
        control.GraspPlanner("sim", RAISED).plan(trajectory),
    ]
    for a, b in itertools.pairwise(grasps):
        assert a is not None
        assert b is not None
        for x, y in zip(a.touches, b.touches, strict=True):
            np.testing.assert_array_equal(x.point, y.point)
            np.testing.assert_array_equal(x.normal, y.normal)
