# SPDX-License-Identifier: BSD-3-Clause
"""A robot from an MJCF file: sessions, logs, plots and pictures without a line of C++."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import ARM, output_of
from trifinger.environments import Environment, Options, VectorEnvironment
from trifinger_view.scene import scene_of

pytestmark = pytest.mark.bindings

CONFIGS = Path(__file__).parents[2] / "config"

# Seven joints in a row, which stand for the arm of the page.
CHAIN = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002"/>
  <worldbody>{bodies}</worldbody>
  <actuator>{motors}</actuator>
</mujoco>
""".format(
    bodies="".join(
        f'<body pos="0 0 0.1"><joint name="joint{i}" range="-4 4" armature="0.1"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 0.1" size="0.02"/>'
        for i in range(1, 8)
    )
    + "</body>" * 7,
    motors="".join(
        f'<motor joint="joint{i}" ctrllimited="true" ctrlrange="-80 80"/>' for i in range(1, 8)
    ),
)


def test_a_robot_from_a_file_moves_like_any_other(arm: str) -> None:
    robot = trifinger.simulate(arm)
    assert robot.new_action().torque.shape == (2,)
    t = -1
    for _ in range(1000):
        t = robot.append_desired_action(robot.new_action(position=[0.5, -0.4]))
    observation = robot.get_observation(t)
    np.testing.assert_allclose(observation.position, [0.5, -0.4], atol=0.1)
    # The motors are in the order of the actuators, the joints in that of the model.
    assert observation.joint_position.shape == (3,)
    np.testing.assert_array_equal(observation.joint_position[[1, 0]], observation.position)


def test_the_owner_of_the_simulation_places_everything(arm: str) -> None:
    simulation = trifinger.Simulation(arm)
    simulation.reset([0.1, -0.2])
    simulation.place_object("ball", [0.3, 0.4, 0.5])
    position, orientation = simulation.object_pose("ball")
    np.testing.assert_allclose(position, [0.3, 0.4, 0.5])
    np.testing.assert_allclose(orientation, [1, 0, 0, 0])
    robot = simulation.connect()
    state = simulation.save()
    t = robot.append_desired_action(robot.new_action(position=[0.5, 0.5]))
    first = robot.get_observation(t + 1)
    simulation.restore(state)
    assert first.position[0] != pytest.approx(0.1, abs=1e-12)
    simulation.reset([0.1, -0.2])
    np.testing.assert_allclose(simulation.configuration()[:2], [-0.2, 0.1])
    with pytest.raises(trifinger.InvalidArgument, match="pair_friction is for TriFingers"):
        simulation.vary(pair_friction={"tip_object": 0.5})
    with pytest.raises(trifinger.InvalidArgument, match="position has 3 numbers, must have 2"):
        simulation.reset([0, 0, 0])
    assert simulation.bodies == ["ball", "flap"]


def test_what_safety_needs_is_asked_for_by_name(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(ARM)
    (tmp_path / "arm.yml").write_text("name: arm\ndriver: simulation\nrobot: {mjcf: arm.xml}\n")
    with pytest.raises(trifinger.Error, match=r"elbow: \{soft_lower: FILL_IN"):
        trifinger.simulate(str(tmp_path / "arm.yml"))


def test_its_sessions_are_recorded_and_drawn(arm: str, tmp_path: Path) -> None:
    simulation = trifinger.Simulation(arm)
    with simulation.record(tmp_path):
        robot = simulation.connect()
        for _ in range(100):
            t = robot.append_desired_action(robot.new_action(position=[0.5, -0.4]))
        last = robot.get_observation(t)
        robot.finish()
    session = trifinger.Log(tmp_path).session("arm")
    assert session.type == "arm"
    np.testing.assert_array_equal(session.observations["position"][t], last.position)
    scene = scene_of(session.documents)
    assert scene is not None
    assert scene.joint_names == ("shoulder", "elbow", "flap")
    assert scene.object_names == ("ball",)
    positions, _ = scene.poses(last.joint_position)
    assert positions.shape[0] == len(scene.bodies)


def test_the_program_of_the_page_runs(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "any_robot.md").read_text()
    fences = re.findall(r"```(yaml|python)\n(.*?)```", page, re.DOTALL)
    # The last one is a part of a configuration, which test_emulated_robot.py runs.
    [(_, configuration), (_, program), _] = fences
    (tmp_path / "panda.yml").write_text(configuration)
    (tmp_path / "panda").mkdir()
    (tmp_path / "panda" / "robot.xml").write_text(CHAIN)
    printed = output_of(sys.executable, "-c", program, cwd=tmp_path).strip("[] \n")
    expected = [0, -0.4, 0, -2.4, 0, 2.0, 0.8]
    np.testing.assert_allclose(list(map(float, printed.split())), expected, atol=0.01)


# An arm on a table, two cameras in its file, and a cube of the configuration.
SEEN = """<mujoco model="seen">
  <option timestep="0.002"/>
  <worldbody>
    <geom type="plane" size="2 2 0.1" rgba="0.5 0.5 0.55 1"/>
    <camera name="front" pos="0.9 -0.5 0.6" xyaxes="2 3.5 0 -1.6 1 3.5" resolution="640 480"/>
    <camera name="above" pos="0.2 0 1" xyaxes="0 -1 0 1 0 0" fovy="55" resolution="640 480"/>
    <body pos="-0.2 0 0.22">
      <joint name="yaw" axis="0 0 1" range="-150 150"/>
      <geom name="hand" type="capsule" fromto="0 0 0 0.2 0 0" size="0.03" rgba="0.9 0.5 0.1 1"/>
      <camera name="at_the_arm"/>
    </body>
  </worldbody>
  <actuator><motor joint="yaw" ctrllimited="true" ctrlrange="-5 5"/></actuator>
</mujoco>
"""
SEEN_CONFIG = """name: seen
driver: simulation
robot: {mjcf: seen.xml}
safety:
  every_joint: {safety_kd: 0.1, max_velocity: 5, braking: 50, default_kp: 10, default_kd: 0.5}
  yaw: {soft_lower: -2, soft_upper: 2}
objects:
  - {name: cube, type: cube, size: [0.065], mass: 0.094, position: [0.25, -0.15, 0.0325]}
simulation: {object_period: 0.02, object_delay: 0.06, object_poses: exact}
stop: {damping_time: 0.1, rest_position: [0.5], move_time: 2}
"""


@pytest.fixture
def seen(tmp_path: Path) -> str:
    """Its cameras are like those of sim_cameras, but for rate and size."""
    section = (CONFIGS / "sim_cameras.yml").read_text().partition("\ncameras:")[2]
    for line, other in {"rate: 100": "rate: 50", "size: 540": "size: 640"}.items():
        assert line in section
        section = section.replace(line, other)
    (tmp_path / "seen.xml").write_text(SEEN)
    (tmp_path / "seen.yml").write_text(f"{SEEN_CONFIG}cameras:{section}")
    return str(tmp_path / "seen.yml")


def test_cameras_of_the_file_see_the_scene_and_a_tracker_finds_the_cube(seen: str) -> None:
    simulation = trifinger.Simulation(seen, {"simulation.object_poses": "tracked"})
    robot = simulation.connect()
    for _ in range(100):
        t = robot.append_desired_action(robot.new_action(position=[0.3]))
    robot.wait_until_time_index(t)
    pose = robot.companion("object").get_latest_at(t)
    true_position, _ = simulation.object_pose("cube")
    np.testing.assert_allclose(pose.cube.position, true_position, atol=5e-3)
    assert pose.stamp.arrival_index - pose.stamp.capture_index == 30
    renderer = trifinger.CameraRenderer(seen, pixels="rgb8")
    front, above = renderer.render(simulation.configuration())
    assert np.asarray(front).shape == np.asarray(above).shape == (480, 640, 3)
    # The cube's top is blue, and the arm is orange.
    assert np.asarray(above)[215, 1032 - 640].argmax() == 2
    assert np.asarray(above)[:, :, 0].max() > 150


def test_a_hand_pulls_an_object_of_a_robot_from_a_file(seen: str) -> None:
    simulation = trifinger.Simulation(seen)
    assert simulation.bodies == ["cube", "body1"]
    robot = simulation.connect()
    simulation.pull("cube", [0.3, 0.1, 0.2])
    for _ in range(1000):
        t = robot.append_desired_action(robot.new_action(position=[-0.5]))
    robot.wait_until_time_index(t)
    position, _ = simulation.object_pose("cube")
    np.testing.assert_allclose(position, [0.3, 0.1, 0.2], atol=0.01)


@pytest.mark.parametrize("poses", ["exact", "tracked"])
def test_an_environment_shows_the_images_of_these_cameras(seen: str, poses: str) -> None:
    options = Options.of("reach", frames=("hand",), observation="images", camera_size=160)
    settings = {"simulation.object_poses": poses}
    one = Environment("reach", options=options, config=seen, config_overrides=settings)
    many = VectorEnvironment("reach", 2, options=options, config=seen, config_overrides=settings)
    alone, _ = one.reset(seed=3)
    together, _ = many.reset(seed=3)
    for _ in range(4):
        assert alone["front"].shape == alone["above"].shape == (120, 160, 3)
        assert alone["above"].max() > 150
        for key, value in alone.items():
            np.testing.assert_array_equal(value, together[key][0])
        alone, *_ = one.step(np.full(1, 0.5, np.float32))
        together, *_ = many.step(np.full((2, 1), 0.5, np.float32))
    one.close()
    many.close()
