# SPDX-License-Identifier: BSD-3-Clause
"""A robot on emulated motor boards, each program in a process of its own."""

import signal
import subprocess

import numpy as np
import pytest
import trifinger
from conftest import EMULATED, PATIENT_BOARDS, PROGRAM, StartProgram

pytestmark = pytest.mark.release

NAME = "trifinger-edu-emulated"
START = np.array([0.0, 0.9, -1.7] * 3)  # [rad]
GOAL = np.array([0.2, 0.7, -1.5] * 3)  # [rad]


def hold_for_ever(robot: trifinger.Frontend) -> None:
    while True:
        t = robot.append_desired_action(robot.new_action(position=GOAL))
        robot.get_observation(t)


def test_it_homes_moves_and_survives_an_emergency_stop(start_program: StartProgram) -> None:
    boards = start_program("emulate", EMULATED, *PATIENT_BOARDS)
    boards.wait_for("6 emulated boards are on")
    start_program("run", EMULATED, *PATIENT_BOARDS).wait_for("holds its pose")

    robot = trifinger.connect(NAME)
    np.testing.assert_allclose(robot.latest_observation().position, START, atol=0.03)
    for step in range(1, 2001):
        target = START + min(step / 1500, 1.0) * (GOAL - START)
        t = robot.append_desired_action(robot.new_action(position=target))
    np.testing.assert_allclose(robot.get_observation(t).position, GOAL, atol=0.05)

    # The supply of all boards fails.
    boards.end(signal.SIGKILL)
    with pytest.raises(trifinger.RobotStopped, match=r"board \d .* no measurements come"):
        hold_for_ever(robot)

    start_program("emulate", EMULATED, *PATIENT_BOARDS).wait_for("6 emulated boards are on")
    subprocess.run([PROGRAM, "recover", NAME], check=True, timeout=120)
    with trifinger.connect(NAME, timeout=100) as robot:
        np.testing.assert_allclose(robot.latest_observation().position, START, atol=0.03)


def test_what_is_no_robot_on_boards_cannot_be_emulated() -> None:
    done = subprocess.run([PROGRAM, "emulate", "sim"], capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "'sim' is not on motor boards: its driver is simulation" in done.stderr


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        (
            "boards.interfaces=[can0, can1, can2, can3, can4]",
            "is on board 5, but there are 5 interfaces",
        ),
        ("boards.polarity=0.5", "of joint 0 is 0.5, must be 1 or -1"),
        ("boards.homing.torque=1", "must be at most safety.max_torque"),
        ("boards.max_current=-1", "must be more than 0"),
        ("boards.bus=can", "must be 'socketcan' or 'emulated'"),
        ("backend.mode=non_real_time", "a robot on motor boards runs in real time only"),
        ("boards.receive_timeout=0.0005", "must be a whole number of ms"),
        ("boards.interfaces=[a, b, c, d, e, e]", "are both on e"),
    ],
)
def test_a_wrong_value_is_answered_with_a_sentence(setting: str, sentence: str) -> None:
    done = subprocess.run(
        [PROGRAM, "run", EMULATED, "--set", setting], capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert sentence in done.stderr


def test_an_interface_that_does_not_exist_is_named() -> None:
    settings = ["--set", "boards.bus=socketcan", "--set", "boards.interfaces=[x0,x1,x2,x3,x4,x5]"]
    done = subprocess.run(
        [PROGRAM, "run", EMULATED, *settings], capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert "CAN" in done.stderr or "x0" in done.stderr
