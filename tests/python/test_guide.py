# SPDX-License-Identifier: BSD-3-Clause
import os
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import PATIENT, PATIENT_DCLAW, Running, StartChild, StartProgram


@pytest.fixture(params=["sim", "finger_pro"])
def running(request: pytest.FixtureRequest, start_program: StartProgram) -> Running:
    robot = start_program("run", request.param, "--name", "g", *PATIENT)
    robot.wait_for("waits for a user")
    return robot


def wait_for_mode(guide: trifinger.Guide, mode: str) -> None:
    while guide.state().mode != mode:
        time.sleep(0.001)


@pytest.mark.usefixtures("running")
def test_a_robot_follows_setpoints() -> None:
    with trifinger.guide("g") as guide:
        fingers = guide.num_fingers
        begin = guide.state()
        assert begin.mode == "hold"
        assert begin.joints.shape == (guide.num_joints,) == (3 * fingers,)
        assert begin.tips.shape == begin.reference_tips.shape == (fingers, 3)
        raised = begin.tips + np.array([0.0, 0.0, 0.03])
        for finger in range(fingers):
            guide.move_tip(finger, raised[finger])
        guide.wait_until_arrived()
        assert guide.state().tips == pytest.approx(raised, abs=0.005)
        assert guide.state().refusal == ""
        guide.move_joints(begin.joints)
        guide.wait_until_arrived()
        assert guide.state().joints == pytest.approx(begin.joints, abs=0.02)
        guide.home()
        guide.wait_until_arrived()
        guide.move_tip(0, (0.0, 0.0, 3.0))
        wait_for_mode(guide, "move_frame")
        while not (refusal := guide.state().refusal):
            time.sleep(0.001)
        assert f"{guide.frame_names[0]} goes only to (" in refusal
        guide.float_freely()
        wait_for_mode(guide, "float")
        with pytest.raises(trifinger.InvalidArgument, match="floats"):
            guide.wait_until_arrived()
    assert not guide.is_running()
    with pytest.raises(trifinger.InvalidArgument, match="has ended"):
        guide.hold()


@pytest.mark.usefixtures("running")
def test_setpoints_that_make_no_sense_are_refused() -> None:
    with trifinger.guide("g") as guide:
        with pytest.raises(trifinger.InvalidArgument, match="frame 7 does not exist"):
            guide.move_tip(7, (0.0, 0.0, 0.1))
        with pytest.raises(trifinger.InvalidArgument, match="finite"):
            guide.move_tip(0, (0.0, np.nan, 0.1))
        with pytest.raises(trifinger.InvalidArgument, match="1 positions were given"):
            guide.move_joints([0.0])
        with pytest.raises(trifinger.InvalidArgument, match="joint 12 does not exist"):
            guide.move_joint(12, 0.0)
        with pytest.raises(trifinger.InvalidArgument, match="finite"):
            guide.move_joint(0, np.inf)
        with pytest.raises(trifinger.InvalidArgument, match="there is no joint 'knee'"):
            guide.move_joint("knee", 0.0)
        with pytest.raises(TypeError):
            guide.move_tip(0, (0.0, 0.1))  # type: ignore[arg-type, unused-ignore]
        assert guide.state().mode == "hold"


@pytest.mark.parametrize("robot", ["dclaw", "arm"])
def test_robots_from_files_follow_setpoints(
    start_program: StartProgram, patient_arm: Path, robot: str
) -> None:
    step: tuple[float, float, float]
    if robot == "dclaw":
        words, frames, step = (
            ["dclaw", *PATIENT_DCLAW],
            ("FFtip", "MFtip", "THtip"),
            (0, 0.01, 0.02),
        )
    else:
        words, frames, step = [str(patient_arm)], ("hand",), (0.03, 0, 0.03)
    start_program("run", *words, "--name", "f").wait_for("waits for a user")
    with trifinger.guide("f") as guide:
        assert guide.frame_names == frames
        assert guide.num_joints == len(guide.joint_names) == len(guide.soft_lower)
        assert set(guide.joint_units) == {"rad"}
        begin = guide.state()
        assert begin.frames.shape == (len(frames), 3)
        for number, frame in enumerate(frames):
            guide.move_frame(frame, begin.frames[number] + step)
        guide.wait_until_arrived()
        moved = guide.state()
        assert moved.refusal == ""
        assert moved.target_frames == pytest.approx(begin.frames + step, abs=1e-6)
        assert moved.frames == pytest.approx(begin.frames + step, abs=0.006)
        guide.move_joints(np.full(guide.num_joints, 10.0))
        wait_for_mode(guide, "move_joints")
        last = guide.joint_names[-1]
        assert f"{last} goes only to its soft limit of" in guide.state().refusal
        guide.home()
        guide.wait_until_arrived()
        guide.move_joint(last, begin.joints[-1] + 0.1)
        guide.wait_until_arrived()
        change = guide.state().target_joints - begin.target_joints
        assert change == pytest.approx([*[0.0] * (guide.num_joints - 1), 0.1], abs=0.03)
        guide.home()
        guide.wait_until_arrived()
        assert guide.state().joints == pytest.approx(begin.joints, abs=0.03)
        with pytest.raises(trifinger.InvalidArgument, match="there is no frame 'toe'"):
            guide.move_frame("toe", (0.0, 0.0, 0.0))


def test_frames_are_chosen_by_name(start_program: StartProgram) -> None:
    start_program("run", "dclaw", "--name", "f", *PATIENT_DCLAW).wait_for("waits for a user")
    with pytest.raises(trifinger.InvalidArgument, match="no frame 'toe'; its sites are"):
        trifinger.guide("f", frames=["toe"])
    with pytest.raises(trifinger.InvalidArgument, match="no motor moves the frame 'valve'"):
        trifinger.guide("f", frames=["valve"])
    with trifinger.guide("f", frames=["THtip"]) as guide:
        assert guide.frame_names == ("THtip",)
        assert guide.state().frames.shape == (1, 3)


@pytest.mark.usefixtures("running")
def test_a_block_ends_the_session_and_keeps_its_exception() -> None:
    guide = trifinger.guide("g")

    def block() -> None:
        with guide:
            guide.home()
            guide.state()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        block()
    assert not guide.is_running()
    with trifinger.guide("g") as guide:  # the robot is free again
        guide.wait_until_arrived()


def test_a_block_raises_the_fault_that_happened_in_it(running: Running) -> None:
    guide = trifinger.guide("g")

    def block() -> None:
        with guide:
            guide.wait_until_arrived()
            running.end()
            while guide.is_running():
                time.sleep(0.001)

    with pytest.raises(trifinger.RobotStopped):
        block()
    with pytest.raises(trifinger.RobotStopped):
        guide.check()
    guide.stop()  # always works


@pytest.mark.usefixtures("running")
def test_stop_ends_the_session_while_others_wait() -> None:
    guide = trifinger.guide("g")
    guide.wait_until_arrived()
    guide.float_freely()
    wait_for_mode(guide, "float")
    guide.move_tip(0, (0.0, 0.0, 3.0))
    threads = [
        threading.Thread(target=call) for call in (guide.stop, guide.finish, guide.stop, guide.stop)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not guide.is_running()
    guide.check()


def test_a_backend_that_stands_still_does_not_hold_the_program(running: Running) -> None:
    guide = trifinger.guide("g")
    guide.wait_until_arrived()
    os.kill(running.process.pid, signal.SIGSTOP)
    os.waitid(os.P_PID, running.process.pid, os.WSTOPPED)
    try:
        with pytest.raises(trifinger.TimedOut, match="does not answer"):
            guide.finish(timeout=0.1)
        assert not guide.is_running()
        del guide
    finally:
        os.kill(running.process.pid, signal.SIGCONT)


@pytest.mark.usefixtures("running")
def test_a_guide_shares_the_frontend_of_its_user() -> None:
    with trifinger.connect("g") as robot:
        with trifinger.Guide(robot) as guide:
            guide.wait_until_arrived()
            with pytest.raises(trifinger.ControlHeld):
                robot.append_desired_action(robot.new_action())
            while (step := guide.state().step) < 0:  # the session has not begun yet
                time.sleep(0.001)
            assert robot.get_observation(step).position.shape == (guide.num_joints,)
        assert robot.fault() is not None


@pytest.mark.usefixtures("running")
def test_only_robots_in_real_time_are_guided() -> None:
    with pytest.raises(trifinger.InvalidArgument, match="only observes"):
        trifinger.Guide(trifinger.observe("g"))
    with (
        trifinger.simulate() as simulation,
        pytest.raises(trifinger.InvalidArgument, match="real-time"),
    ):
        trifinger.Guide(simulation)
    with trifinger.fake() as fake, pytest.raises(trifinger.InvalidArgument, match="real-time"):
        trifinger.Guide(fake)
    with pytest.raises(trifinger.InvalidArgument, match="scheduling"):
        trifinger.guide("g", scheduling="always")
    with pytest.raises(trifinger.InvalidArgument, match="joint_speed"):
        trifinger.guide("g", joint_speed=-1.0)
    trifinger.guide("g").stop()


FORGOTTEN = """
import sys, trifinger
guide = trifinger.guide("g")
guide.wait_until_arrived()
print("ready", flush=True)
sys.stdin.read()
"""


@pytest.mark.usefixtures("running")
def test_a_program_may_end_without_ending_its_guide(start_python: StartChild) -> None:
    assert start_python(FORGOTTEN).finish() == (0, "")
    with trifinger.guide("g") as guide:
        guide.wait_until_arrived()
