# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger new robot`; test_install.py builds and runs what it writes."""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import PROGRAM, StartProgram, output_of

# The survey types `trifinger`.
SEARCHES_HERE = os.environ | {"PATH": f"{Path(PROGRAM).parent}:{os.environ['PATH']}"}
ROOT = Path(__file__).parents[2]
SURVEY = ROOT / "benchmarks/survey_robots.py"
FETCHED = ROOT / "build/robots"

MJCF = """<mujoco model="gantry">
  <compiler angle="radian"/>
  <worldbody>
    <body>
      <joint name="rail" type="slide" axis="1 0 0" range="-1 1" armature="1"/>
      <geom size="0.05" mass="1"/>
      <body pos="0 0 -0.1">
        <joint name="swing" axis="0 1 0" armature="0.01"/>
        <geom size="0.02" pos="0 0 -0.1" mass="0.1"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="rail" ctrlrange="-20 20"/><motor joint="swing"/></actuator>
</mujoco>
"""
URDF = """<robot name="lever">
  <link name="base"/>
  <link name="lever">
    <inertial>
      <mass value="0.2"/>
      <inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="hinge" type="revolute">
    <parent link="base"/><child link="lever"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="2" velocity="3"/>
  </joint>
</robot>
"""


def new_robot(*words: str | Path, succeeds: bool = True) -> str:
    return output_of(PROGRAM, "new", "robot", *words, succeeds=succeeds)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("My-Robot", "cannot name a robot; a name has lower-case letters"),
        ("2_axes", "cannot name a robot"),
        ("a__b", "cannot name a robot"),
        ("../robot", "cannot name a robot"),
        ("trifinger", "means something else already"),
        ("test", "means something else already"),
        ("x" * 41, "has 41 letters, may have 40"),
    ],
)
def test_refuses_names_that_cannot_work(name: str, reason: str, tmp_path: Path) -> None:
    assert reason in new_robot(name, "-o", tmp_path, succeeds=False)
    assert list(tmp_path.iterdir()) in ([], [tmp_path / "sessions"])


def test_leaves_what_is_there_alone(tmp_path: Path) -> None:
    (tmp_path / "cart").mkdir()
    said = new_robot("cart", "-o", tmp_path, succeeds=False)
    assert f"{tmp_path}/cart exists already; nothing was written" in said
    assert list((tmp_path / "cart").iterdir()) == []
    (tmp_path / "gantry.xml").write_text(MJCF)
    (tmp_path / "cart.yml").write_text("mine")
    words = ["cart", "--from", tmp_path / "gantry.xml", "-o", tmp_path]
    assert "cart.yml exists already" in new_robot(*words, succeeds=False)
    assert (tmp_path / "cart.yml").read_text() == "mine"


def move(path: Path, place: Sequence[float]) -> trifinger.Observation:
    """Lets a robot of this configuration go to a place for a second."""
    robot = trifinger.simulate(str(path))
    t = -1
    for _ in range(round(1 / robot.session_info().period)):
        t = robot.append_desired_action(robot.new_action(position=place))
    return robot.get_observation(t)


def test_asks_for_what_the_file_of_a_robot_does_not_say(
    tmp_path: Path, start_program: StartProgram
) -> None:
    models = tmp_path / "models"
    models.mkdir()
    (models / "gantry.xml").write_text(MJCF)
    said = new_robot("gantry", "--from", models / "gantry.xml", "-o", tmp_path)
    assert "gantry.yml has the 2 joints of" in said
    assert "Replace each FILL_IN" in said
    path = tmp_path / "gantry.yml"
    text = path.read_text()
    assert "mjcf: 'models/gantry.xml'" in text
    # All but the torque of a motor is proposed.
    assert "rail: {safety_kd: " in text
    assert "soft_lower: -0.96, soft_upper: 0.96, " in text
    assert "its stops: -1 to 1 m" in text
    assert "swing: {max_torque: FILL_IN, safety_kd: " in text
    assert "no stops; the file says no torque, " in text
    assert text.count("FILL_IN") == 1
    refusal = output_of(PROGRAM, "config", path, succeeds=False)
    assert "'FILL_IN'" in refusal
    bare = tmp_path / "bare.yml"
    bare.write_text("name: bare\ndriver: simulation\nrobot: {mjcf: models/gantry.xml}\n")
    asked = output_of(PROGRAM, "config", bare, succeeds=False)
    assert "rail: {soft_lower: FILL_IN, soft_upper: FILL_IN}  # its stops: -1 to 1 m" in asked

    # With a number it is a robot.
    path.write_text(text.replace("FILL_IN", "1"))
    assert move(path, [0.3, 0.2]).position == pytest.approx([0.3, 0.2], abs=0.02)
    start_program("run", str(path)).wait_for("gantry: holds its pose and waits for a user")


def test_a_robot_of_a_file_that_says_enough_moves_at_once(tmp_path: Path) -> None:
    # A light link, a motor that would throw it, and a zero at a stop.
    urdf = URDF.replace('lower="-1" upper="1" effort="2"', 'lower="0" upper="2" effort="90"')
    (tmp_path / "lever.urdf").write_text(urdf.replace("1e-3", "1e-6"))
    said = new_robot("lever", "--from", tmp_path / "lever.urdf", "-o", tmp_path)
    assert "What the file does not say was proposed for the simulation." in said
    path = tmp_path / "lever.yml"
    assert "initial_position: {hinge: 1}" in path.read_text()
    assert "armature: {hinge: 0.15}" in path.read_text()
    assert move(path, [1.3]).position == pytest.approx([1.3], abs=0.01)
    assert output_of(PROGRAM, "config", path).count("too little") == 0
    # Without the rotor, and with the same gains, it cannot work: who runs it is told.
    path.write_text(path.read_text().replace("armature: {hinge: 0.15}", "armature: {hinge: 0}"))
    warned = output_of(PROGRAM, "config", path)
    assert "joint 'hinge' has an inertia of 1e-06 kgm^2, too little for safety_kd + " in warned
    with pytest.raises(trifinger.errors.RobotStopped, match="too strong for its inertia in such"):
        move(path, [1.3])


def test_bodies_inside_each_other_and_angles_without_a_unit_stop_no_robot(tmp_path: Path) -> None:
    file = tmp_path / "finger.xml"
    file.write_text(
        """<mujoco><worldbody><body name="palm"><geom size="0.03"/>
          <body pos="0 0 0.03"><joint name="turn" axis="0 1 0" range="-1 1"/><geom size="0.01"/>
            <body name="tip" pos="0.02 0 0.02">
              <joint name="bend" axis="0 1 0" range="-1 1"/><geom size="0.04"/>
        </body></body></body></worldbody>
        <actuator><motor joint="turn" ctrlrange="-1 1"/><motor joint="bend" ctrlrange="-1 1"/>
        </actuator></mujoco>"""
    )
    words = ["digit", "--from", file, "-o", tmp_path]
    assert "Some joints can hardly move: if the file means radians" in new_robot(*words)
    path = tmp_path / "digit.yml"
    assert "add angle: radian (--angle radian)" in path.read_text()
    path.unlink()
    assert "hardly" not in new_robot(*words, "--angle", "radian")
    text = path.read_text()
    assert "\n  angle: radian\n" in text
    assert "its stops: -1 to 1 rad" in text
    assert "through each other: 'palm' and 'tip'.\n  exclude_overlaps: true\n" in text
    assert move(path, [0.1, -0.1]).position == pytest.approx([0.1, -0.1], abs=0.02)
    # Where they touch, one throws the other.
    path.write_text(text.replace("exclude_overlaps: true", "exclude_overlaps: false"))
    assert move(path, [0.1, -0.1]).position[0] < -0.5


def test_says_that_a_motor_cannot_carry_the_robot(tmp_path: Path) -> None:
    urdf = URDF.replace("<inertial>", '<inertial><origin xyz="1 0 0"/>')
    (tmp_path / "lever.urdf").write_text(urdf.replace('effort="2"', 'effort="0.1"'))
    new_robot("lever", "--from", tmp_path / "lever.urdf", "-o", tmp_path)
    text = (tmp_path / "lever.yml").read_text()
    assert "CANNOT HOLD where it begins: the weight is 1.96 Nm, the motor has 0.1" in text


def test_repairs_inertias_and_chooses_shapes_if_told_to(tmp_path: Path) -> None:
    (tmp_path / "lever.urdf").write_text(URDF.replace('izz="1e-3"', 'izz="9e-3"'))
    words = ["lever", "--from", tmp_path / "lever.urdf", "-o", tmp_path]
    assert "--repair-inertia, takes the nearest" in new_robot(*words, succeeds=False)
    said = new_robot(*words, "--repair-inertia", "--collision", "none")
    assert "repaired: body 'lever' has the moments of inertia 0.001, 0.001 and 0.009" in said
    path = tmp_path / "lever.yml"
    assert "\n  repair_inertia: true\n  collision: none\n" in path.read_text()
    assert "body 'lever' has the moments of inertia" in path.read_text()
    assert move(path, [0.5]).position == pytest.approx([0.5], abs=0.01)
    assert "requires --from" in new_robot("arm", "--repair-inertia", succeeds=False)


def test_fault_77_takes_any_names_and_stops_and_leaves_no_log_of_mujoco(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    model = MJCF.replace('"gantry"', '"a&#10;b"').replace('"-1 1"', f'"{-1 / 3!r} 1"')
    model = model.replace('name="rail"', 'name="the rail: a\'b"')
    model = model.replace('joint="rail"', 'joint="the rail: a\'b"')
    # A camera whose number is none is a warning of MuJoCo.
    ball = '<body name="my ball"><freejoint/><geom size="0.1"/></body><camera fovy="nan"/>'
    Path("gantry.xml").write_text(model.replace("</worldbody>", ball + "</worldbody>"))
    new_robot("gantry", "--from", "gantry.xml", "-o", "new/folder")
    assert not list(tmp_path.rglob("MUJOCO_LOG.TXT"))
    path = tmp_path / "new/folder/gantry.yml"
    text = path.read_text()
    # What it prints as a stop may be the soft limit.
    stop = text.partition("its stops: ")[2].split(" to ")[0]
    proposed = text.partition("soft_lower: ")[2].split(",")[0]
    text = text.replace(f"soft_lower: {proposed}", f"soft_lower: {stop}", 1)
    path.write_text(text.replace("FILL_IN", "1"))
    robot = trifinger.simulate(str(path))
    t = robot.append_desired_action(robot.new_action(torque=[1, 0]))
    robot.get_observation(t)
    fields = robot.companion("object").get_latest_at(t)
    assert "my_ball" in str(fields)


def test_reads_urdf(tmp_path: Path) -> None:
    (tmp_path / "lever.urdf").write_text(URDF)
    new_robot("lever", "--from", tmp_path / "lever.urdf", "-o", tmp_path)
    text = (tmp_path / "lever.yml").read_text()
    assert "urdf: 'lever.urdf'" in text
    assert "hinge: {safety_kd: " in text
    assert "FILL_IN" not in text
    assert "max_velocity: " not in text.partition("\nsafety:")[2]  # It stands in the file.


def test_finds_the_meshes_of_a_package(tmp_path: Path) -> None:
    package = tmp_path / "lever_description"
    (package / "meshes").mkdir(parents=True)
    (package / "meshes" / "lever.obj").write_text(
        "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    mesh = '<mesh filename="package://lever_description/meshes/lever.obj"/>'
    collision = f"<collision><geometry>{mesh}</geometry></collision>"
    (package / "urdf").mkdir()
    urdf = package / "urdf" / "lever.urdf"
    urdf.write_text(URDF.replace("</inertial>", f"</inertial>{collision}", 1))
    words = ["lever", "--from", urdf, "-o", tmp_path]
    assert "(robot.mesh_folder, --meshes)" in new_robot(*words, succeeds=False)
    new_robot(*words, "--meshes", package)
    path = tmp_path / "lever.yml"
    text = path.read_text()
    assert "urdf: 'lever_description/urdf/lever.urdf'\n  mesh_folder: '..'\n" in text
    robot = trifinger.simulate(str(path))
    t = robot.append_desired_action(robot.new_action(torque=[0.5]))
    assert robot.get_applied_action(t).torque[0] == pytest.approx(0.5)
    assert "--meshes requires --from" in new_robot("arm", "--meshes", package, succeeds=False)


def test_says_what_is_wrong_with_the_file_of_a_robot(tmp_path: Path) -> None:
    words = ["cart", "--from", tmp_path / "cart.xml", "-o", tmp_path]
    assert "cart.xml" in new_robot(*words, succeeds=False)
    (tmp_path / "cart.xml").write_text("<mujoco><worldbody/></mujoco>")
    assert "cart.xml" in new_robot(*words, succeeds=False)
    assert not (tmp_path / "cart.yml").exists()


def test_the_survey_says_which_robots_run(tmp_path: Path) -> None:
    (tmp_path / "lever.urdf").write_text(URDF)
    (tmp_path / "gantry.xml").write_text(MJCF)
    (tmp_path / "table.urdf").write_text('<robot name="table"><link name="top"/></robot>')
    (tmp_path / "broken.urdf").write_text(URDF.replace("</robot>", ""))
    command = [sys.executable, str(SURVEY), str(tmp_path), "--jobs", "1"]
    done = subprocess.run(command, capture_output=True, text=True, env=SEARCHES_HERE, check=False)
    assert done.returncode == 1  # A third of the robots cannot be read.
    assert "3 descriptions with a joint: 2 read, 2 held, 2 moved, 1 refused" in done.stdout
    assert "3 of 3 joints came where they were sent; 2 of 2 robots held" in done.stdout
    assert "it is no XML: the end of an element is missing" in done.stdout


def test_a_robot_of_too_many_joints_is_refused(tmp_path: Path) -> None:
    bodies = '<body pos="0 0 0.1"><joint/><geom size="0.02"/>' * 130 + "</body>" * 130
    path = tmp_path / "snake.xml"
    path.write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    said = new_robot("snake", "--from", path, "-o", tmp_path, succeeds=False)
    assert "the model has 130 driven joints, a robot has at most 128" in said


SHARE = "cmeel.prefix/share"


@pytest.mark.parametrize(
    ("file", "meshes", "way"),
    [
        ("airo_models/grippers/robotiq_2f_85/urdf/robotiq_2f_85.urdf", [], [0.1]),
        (
            f"{SHARE}/example-robot-data/robots/panda_description/urdf/panda.urdf",
            ["--meshes", FETCHED / SHARE],
            [*[0.1] * 7, 0.01],
        ),
    ],
    ids=["2f_85", "panda"],
)
def test_joints_that_follow_are_no_motors(
    file: str, meshes: list[str | Path], way: list[float], tmp_path: Path
) -> None:
    if not (FETCHED / file).exists():
        pytest.skip("the robot is missing: python tools/fetch_robots.py --all")
    new_robot("follows", "--from", FETCHED / file, *meshes, "-o", tmp_path)
    robot = trifinger.simulate(str(tmp_path / "follows.yml"))
    assert robot.new_action().torque.shape == (len(way),)
    begin = robot.latest_observation().position
    for _ in range(1000):
        t = robot.append_desired_action(robot.new_action(position=begin + way))
    assert (robot.get_observation(t).position - begin > 0.5 * np.array(way)).all()
