# SPDX-License-Identifier: BSD-3-Clause
"""Teaching, motions, teleoperation and the page with robots from files: an arm, and D'Claw."""

import shutil
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trifinger
from conftest import PATIENT_DCLAW, Running, StartProgram, output_of
from test_teleop_command import PAGE_UP, Terminal, start_teleop as start_teleop
from test_view_authentication import browse
from test_view_steering import Steering, is_near, path
from trifinger.arrays import Array
from trifinger.foreign_models import model_of
from trifinger_view.motion import JointFacts, Motion, play
from trifinger_view.motion.facts import ModelDynamics
from trifinger_view.teaching import teach
from viewing import StartView, start_view as start_view

EXAMPLES = Path(__file__).parents[3] / "examples"
ARM_JOINTS = ("shoulder", "elbow")


@pytest.fixture
def arm(start_program: StartProgram, patient_arm: Path) -> Running:
    running = start_program("run", str(patient_arm), "--name", "arm")
    running.wait_for("waits for a user")
    return running


def module(command: str) -> tuple[str, str, str]:
    """How a command of the package begins."""
    main = f"from trifinger_view.commands.{command} import main; raise SystemExit(main())"
    return sys.executable, "-c", main


def hand_of(robot: trifinger.Frontend) -> Array:
    """Where the hand of the arm is [m]."""
    model = model_of(robot.documents()["model.xml"])
    data = mujoco.MjData(model)
    data.qpos[:] = robot.latest_observation().position
    mujoco.mj_kinematics(model, data)
    return np.array(data.site("hand").xpos)


@pytest.mark.usefixtures("arm")
def test_an_arm_is_taught_and_plays_its_motion(tmp_path: Path) -> None:
    with trifinger.guide("arm") as guide:
        start = guide.state().joints
        goal = start + np.array([0.2, 0.3])

        def lead() -> None:
            guide.move_joints(goal)
            guide.wait_until_arrived()

        motion = teach(guide, lead).motion()
    assert (motion.robot, motion.joints) == ("arm", ARM_JOINTS)
    assert motion.positions[-1] == pytest.approx(goal, abs=0.05)
    motion.smooth(5.0).save(tmp_path / "reach.motion")
    loaded = Motion.load(tmp_path / "reach.motion")
    assert loaded.violations() == []
    slow = loaded.slow(2.0)
    with trifinger.connect("arm") as robot:
        last = play(robot, slow)
        assert robot.get_observation(last).position == pytest.approx(slow.positions[-1], abs=0.02)
        torques = JointFacts.of_session(robot).holding_torques(slow.positions[-1:])
        assert torques is not None
        assert robot.get_desired_action(last)["torque"] == pytest.approx(torques[0], abs=1e-3)
        robot.finish()


def test_a_robot_whose_model_has_a_name_with_signs_plays_what_it_was_taught_and_what_its_log_has(
    start_program: StartProgram, patient_arm: Path, tmp_path: Path
) -> None:
    model = (EXAMPLES / "arm.xml").read_text()
    (tmp_path / "arm.xml").write_text(model.replace('model="arm"', 'model="trifinger-arm No 2"'))
    shutil.copy(EXAMPLES / "arm.yml", tmp_path)
    patient_arm.write_text(patient_arm.read_text().replace(str(EXAMPLES / "arm.yml"), "arm.yml"))
    start_program("run", str(patient_arm), "--name", "arm").wait_for("waits for a user")
    taught, logged = tmp_path / "taught.motion", tmp_path / "logged.motion"
    output_of(*module("teach"), "arm", "-o", str(taught), "--seconds", "0.3")
    output_of(*module("motion"), "play", str(taught), "--robot", "arm")
    log = tmp_path / "log"
    with trifinger.simulate(str(tmp_path / "arm.yml"), record=log) as robot:
        play(robot, Motion.load(taught))
        robot.finish()
    output_of(*module("motion"), "from-log", str(log), "-o", str(logged))
    assert Motion.load(logged).robot == Motion.load(taught).robot
    assert JointFacts.load(str(tmp_path / "arm.yml")).kinematics is None  # no TriFinger
    output_of(*module("motion"), "play", str(logged), "--robot", "arm")


def test_the_dynamics_of_a_file_hold_its_robot() -> None:
    arm = str(EXAMPLES / "arm.yml")
    facts = JointFacts.load(arm)
    assert facts.units == ("rad", "rad")
    with trifinger.simulate(arm) as robot:
        pose = np.array([0.5, -1.0])
        for _ in range(4000):
            step = robot.append_desired_action(robot.new_action(position=pose))
        rested = robot.get_observation(step)
        torques = facts.holding_torques(rested.position[None])
        assert torques is not None
        assert np.abs(torques).max() > 0.1
        assert rested.torque == pytest.approx(torques[0], abs=1e-3)


def test_a_tendon_shares_its_torque_among_its_joints() -> None:
    model = ModelDynamics(
        """<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
        <body><joint name="a" armature="1"/><geom size=".01" mass="1e-9"/>
        <body><joint name="s" type="slide" armature="2"/><geom size=".01" mass="1e-9"/></body>
        </body>
        </worldbody><tendon><fixed name="both"><joint joint="a" coef="0.5"/>
        <joint joint="s" coef="0.5"/></fixed></tendon>
        <actuator><motor tendon="both"/></actuator></mujoco>"""
    )
    assert model.joints == ("both",)
    assert model.units == ("rad",)
    # Both joints turn by 1 for each of the tendon: forces of 1 and 2, halved, of a sum of 0.5.
    torque = model.torques(np.zeros(1), np.zeros(1), np.ones(1))
    assert torque == pytest.approx([3.0], abs=1e-6)


def test_a_motion_from_a_log_opens_no_file(tmp_path: Path) -> None:
    for name in ("arm.yml", "arm.xml"):
        shutil.copy(EXAMPLES / name, tmp_path)
    with trifinger.simulate(str(tmp_path / "arm.yml"), record=tmp_path / "logs") as robot:
        start = robot.latest_observation().position
        for i in range(1000):
            robot.append_desired_action(robot.new_action(position=start + 0.1 * np.sin(i / 200)))
        robot.finish()
    (tmp_path / "arm.xml").unlink()
    motion = Motion.from_log(trifinger.Log(tmp_path / "logs").session())
    assert (motion.robot, motion.joints) == ("arm", ARM_JOINTS)
    facts = motion.facts()
    assert facts.soft_upper == pytest.approx([2.2, 2.5])
    assert motion.violations() == []
    with pytest.raises(trifinger.InvalidArgument, match="not opened here"):
        JointFacts.of_configuration(motion.configuration)


def test_dclaw_is_taught_by_joints(start_program: StartProgram) -> None:
    start_program("run", "dclaw", *PATIENT_DCLAW).wait_for("waits for a user")
    with trifinger.guide("dclaw") as guide:
        motion = teach(guide, duration=0.3).motion()
        assert len(motion.joints) == 9
        assert motion.joints == guide.joint_names
        # Its weight is carried, so that it stays where the hand leaves it.
        assert np.ptp(motion.positions, axis=0).max() < 0.02
        assert motion.facts().max_torque == pytest.approx(3.0)


@pytest.mark.usefixtures("arm")
def test_keys_move_the_hand_and_a_joint_of_an_arm(start_teleop: type[Terminal]) -> None:
    robot = trifinger.observe("arm")

    def wait() -> None:
        robot.wait_until_time_index(robot.current_time_index() + 50)

    terminal = start_teleop("arm", "--frame", "hand")
    terminal.wait_for("holds its pose")
    begin = robot.latest_observation().position.copy()
    while np.abs(robot.latest_observation().position - begin).min() < 0.02:
        terminal.press(PAGE_UP)
        wait()
    terminal.wait_for("hand")
    moved = robot.latest_observation().position.copy()
    terminal.press("]")
    while robot.latest_observation().position[1] < moved[1] + 0.1:
        terminal.press(".")
        wait()
    assert robot.latest_observation().position[0] == pytest.approx(moved[0], abs=0.03)
    terminal.wait_for("elbow")
    terminal.press("q")
    assert terminal.end()[0] == 0


@pytest.mark.slow
@pytest.mark.usefixtures("arm")
def test_the_page_moves_the_joints_and_the_hand_of_an_arm(start_view: StartView) -> None:
    robot = trifinger.observe("arm")
    page = start_view("arm", "--control", "--frame", "hand")
    with browse(page) as connection:
        driver = Steering(connection)
        driver.take_control(handle="frame_0")
        start = robot.latest_observation().position.copy()
        (elbow,) = (n for n, one in enumerate(driver.seat["joints"]) if one["name"] == "elbow")
        driver.send("joint", joint=elbow, position=float(start[1] + 0.3))
        driver.wait_until(
            lambda: is_near(robot.latest_observation().position, start + np.array([0.0, 0.3]), 0.02)
        )
        hand = hand_of(robot)
        goal = hand + np.array([0.03, 0.0, 0.03])
        driver.drag("frame_0", *path(hand, goal))
        driver.wait_until(
            lambda: (
                is_near(hand_of(robot), goal)
                and np.abs(robot.latest_observation().velocity).max() < 0.01  # it ends there
            )
        )
