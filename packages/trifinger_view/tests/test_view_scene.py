# SPDX-License-Identifier: BSD-3-Clause
"""The scene of a session: meshes and poses without a page."""

import numpy as np
import pytest
import trifinger
from trifinger import Simulation
from trifinger.foreign_models import model_of
from trifinger.look import BELOW, FLOOR, look_of
from trifinger.picture import SceneCamera, View
from trifinger_view.frame import frame_of
from trifinger_view.scene import Scene, scene_of

SHAPES = """
<mujoco>
  <asset>
    <mesh name="wedge" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/>
    <hfield name="hills" nrow="4" ncol="5" size="1 2 0.3 0.1"
            elevation="0 1 0 1 0  1 0 1 0 1  0 1 0 1 0  1 0 1 0 1"/>
  </asset>
  <worldbody>
    <geom type="plane" size="1 2 0.1"/>
    <geom type="hfield" hfield="hills"/>
    <body name="arm"><joint name="turn" axis="0 0 1"/>
      <geom type="box" size="0.1 0.2 0.3" pos="0.5 0 0" euler="10 20 30"/>
      <geom type="sphere" size="0.1"/>
      <geom type="capsule" size="0.1 0.4"/>
      <geom type="cylinder" size="0.1 0.4"/>
      <geom type="ellipsoid" size="0.1 0.2 0.3"/>
      <geom type="mesh" mesh="wedge"/>
      <geom type="sphere" size="9" group="3"/>
      <geom type="box" size="0.1 0.1 0.1" rgba="1 0 0 0.5" group="1"/>
    </body>
    <body name="stone"><freejoint/><geom type="sphere" size="0.1" rgba="1 0 0 1"/></body>
  </worldbody>
</mujoco>"""


@pytest.fixture(scope="module")
def robot():
    with Simulation("sim").connect() as robot:
        yield robot


def test_a_robot_has_all_its_moving_bodies_and_objects(robot):
    scene = scene_of(robot.documents())
    names = [body.name for body in scene.bodies]
    assert [body.object for body in scene.bodies if body.object] == ["cube"]
    assert scene.object_names == ("cube",)
    assert len(scene.joint_names) == 9
    assert len(scene.tip_names) == 3
    for number in (0, 120, 240):
        assert {f"finger_{part}_link_{number}" for part in ("upper", "middle", "lower")} <= {*names}
    assert {body.name for body in scene.bodies if not body.is_moving} == {
        "world",
        "platform",
        *(f"finger_base_link_{number}" for number in (0, 120, 240)),
    }


def test_bodies_are_where_the_kinematics_of_the_controllers_say(robot):
    scene, kinematics = scene_of(robot.documents()), trifinger.Kinematics("sim")
    numbers = np.random.default_rng(1)
    for _ in range(20):
        position = numbers.uniform(-1, 1, 9)
        tips, directions = scene.tips(position)
        np.testing.assert_allclose(tips, kinematics.tip_positions(position), atol=1e-6)
        np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)


def test_objects_are_where_the_frame_says_and_the_rest_stays(robot):
    scene = scene_of(robot.documents())
    pose = np.array([0.1, 0.2, 0.3, 0.5, 0.5, 0.5, 0.5])
    before = scene.poses()
    after = scene.poses(objects={"cube": pose, "unknown": pose})
    cube = [body.object for body in scene.bodies].index("cube")
    np.testing.assert_allclose(after[0][cube], pose[:3])
    np.testing.assert_allclose(after[1][cube], pose[3:])
    np.testing.assert_allclose(np.delete(after[0], cube, 0), np.delete(before[0], cube, 0))


def test_the_picture_is_around_robot_and_objects_where_they_are_now():
    scene = Scene(SHAPES)
    far = np.array([3.0, -2, 1, 1, 0, 0, 0])
    box = np.array([0.5, 0, 0])  # on the arm, which turns about z
    for angle in (0.0, 2.0):
        turned = np.array([np.cos(angle), np.sin(angle), 0]) * box[0]
        low, high = scene.bounds([angle], {"stone": far})
        for point in (far[:3] - 0.1, far[:3] + 0.1, turned, [0, 0, 0.5], [0, 0, -0.5]):
            assert (low - 1e-6 <= point).all()
            assert (point <= high + 1e-6).all()
        middle, radius = scene.sphere([([angle], {"stone": far})])
        assert np.linalg.norm(far[:3] - middle) < radius < 3


def test_every_triangle_looks_outwards():
    for body in Scene(SHAPES).bodies:
        for mesh in body.meshes:
            corners = mesh.vertices[mesh.faces].astype(float)
            across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            normals = mesh.normals[mesh.faces].mean(axis=1)
            assert (np.einsum("ij,ij->i", across, normals) >= -1e-9).all()
            np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)


def test_shapes_are_sorted_by_what_hides_others_and_hidden_groups_are_left_out():
    world, arm, stone = Scene(SHAPES).bodies
    assert [(mesh.is_transparent, mesh.is_surround) for mesh in arm.meshes] == [
        (False, False),
        (True, True),
    ]
    assert max(abs(mesh.vertices).max() for mesh in arm.meshes) < 2  # not the sphere of 9 m
    assert stone.meshes[0].colours[0].tolist() == [255, 0, 0, 255]
    assert not world.is_moving
    assert arm.is_moving
    assert stone.object == "stone"


def without_ground(mjcf):
    plane, hills = '<geom type="plane" size="1 2 0.1"/>', '<geom type="hfield" hfield="hills"/>'
    return mjcf.replace(plane, "").replace(hills, "")


def test_the_floor_is_the_ground_or_below_the_robot_in_every_moment():
    high = SHAPES.replace('size="1 2 0.1"/>', 'size="1 2 0.1" pos="0 0 0.3"/>')
    here = [(None, {})]
    assert Scene(high).floor(here) == pytest.approx(0.3 - BELOW)
    alone = Scene(without_ground(SHAPES))
    assert alone.floor(here) == pytest.approx(-0.5 - BELOW)  # the capsule, but not the stone
    tilting = Scene(without_ground(SHAPES).replace('axis="0 0 1"', 'axis="0 1 0"'))
    lying = [([np.pi / 2], {})]
    box = tilting.bodies[0].meshes[0].vertices[:, 0].max()
    assert tilting.floor(lying) == pytest.approx(-box - BELOW, abs=1e-3)
    assert tilting.floor(here + lying) == tilting.floor(lying)


@pytest.mark.parametrize(
    "robot", ["sim", "dclaw", "a file without ground", "a file with ground that is not drawn"]
)
def test_films_and_pages_have_the_same_floor(robot):
    mjcf = without_ground(SHAPES)
    if robot.endswith("drawn"):
        mjcf = SHAPES.replace('size="1 2 0.1"/>', 'size="1 2 0.1" pos="0 0 0.1" group="3"/>')
    elif not robot.startswith("a file"):
        with trifinger.simulate(robot) as simulated:
            mjcf = simulated.documents()["model.xml"]
    model = model_of(mjcf, look_of)
    SceneCamera(model, View())
    scene = Scene(mjcf)
    assert scene.floor([(None, {})]) == pytest.approx(model.geom(FLOOR).pos[2], abs=1e-6)
    # Nothing else is drawn there.
    low = min(np.ptp(mesh.vertices[:, 2]) for body in scene.bodies for mesh in body.meshes)
    assert low > 0


def test_a_picture_has_room_for_all_moments():
    scene, here, there = Scene(SHAPES), np.zeros(7), np.array([4.0, 0, 0, 1, 0, 0, 0])
    here[3] = 1
    moments = [([0.0], {"stone": pose}) for pose in (here, there)]
    middle, radius = scene.sphere(moments)
    for moment in moments:
        for corner in scene.bounds(*moment):
            assert np.linalg.norm(corner - middle) <= radius + 1e-9


def test_a_session_without_a_model_has_no_scene():
    assert scene_of({}) is None


def test_a_damaged_model_and_a_wrong_number_of_positions_are_named():
    with pytest.raises(trifinger.InvalidArgument, match="cannot be read"):
        scene_of({"model.xml": "<mujoco"})
    with pytest.raises(trifinger.InvalidArgument, match="2 positions, but the model has 1 joints"):
        Scene(SHAPES).poses(np.zeros(2))


def test_a_frame_holds_what_the_robot_measures_and_what_it_is_asked_for(robot):
    action = robot.new_action(position=np.full(9, 0.1))
    t = robot.append_desired_action(action)
    frame = frame_of(t, 0.001, robot.get_observation(t), robot.get_desired_action(t))
    np.testing.assert_allclose(frame.desired, 0.1)
    assert len(frame.position) == len(frame.torque) == 9
    assert len(frame.tip_force) == 3
    assert {*frame.values} == {"position", "velocity", "torque", "tip_force"}
    torque_only = robot.new_action(torque=0.0)
    assert frame_of(t, 0.001, robot.get_observation(t), torque_only).desired is None


def test_a_robot_without_joints_has_a_frame_of_its_own_fields():
    with trifinger.fake() as fake:
        t = fake.append_desired_action(fake.new_action())
        frame = frame_of(t, 0.001, fake.get_observation(t), fake.get_desired_action(t))
    assert frame.position is None
    assert {*frame.values} >= {"setpoint", "applied_actions"}
