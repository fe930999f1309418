# SPDX-License-Identifier: BSD-3-Clause
"""A LEAP hand: in simulation by its name, and on emulated motors in processes of their own."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest
import trifinger
from conftest import PROGRAM, StartProgram
from test_dclaw import PATIENT, hold_for_ever

pytestmark = pytest.mark.bindings

NAME = "leap-hand-test"
ROBOT = ["leap_hand_emulated", "--name", NAME, *PATIENT]
JOINTS = 16
GOAL = np.full(JOINTS, 0.4)  # [rad]


def test_it_is_simulated_by_its_name() -> None:
    for name in ("leap_hand", "leap_hand_dynamixel"):
        robot = trifinger.simulate(name)
        t = 0
        for _ in range(1000):
            t = robot.append_desired_action(robot.new_action(position=GOAL))
        np.testing.assert_allclose(robot.get_observation(t).position, GOAL, atol=0.1)


@pytest.mark.slow
@pytest.mark.without_sanitizer
def test_it_runs_on_motors_and_stops_when_one_fails(start_program: StartProgram) -> None:
    motors = start_program("emulate", *ROBOT, typed=True)
    motors.wait_for("16 emulated motors are on")
    start_program("run", *ROBOT).wait_for("holds its pose")
    robot = trifinger.connect(NAME)
    t = 0
    for _ in range(1500):
        t = robot.append_desired_action(robot.new_action(position=GOAL))
    y = robot.get_observation(t)
    np.testing.assert_allclose(y.position, GOAL, atol=0.1)
    assert np.abs(y.torque).max() > 0.0

    motors.process.stdin.write("motor 0 overload\n")
    motors.process.stdin.flush()
    with pytest.raises(trifinger.RobotStopped, match="index_side: motor 0 has stopped"):
        hold_for_ever(robot, GOAL)
    subprocess.run([PROGRAM, "recover", NAME], check=True, timeout=120)
    with trifinger.connect(NAME, timeout=100) as robot:
        assert np.isfinite(robot.latest_observation().position).all()


@pytest.mark.slow
@pytest.mark.without_sanitizer
def test_torques_that_nobody_measures_are_no_numbers(start_program: StartProgram) -> None:
    robot_of_xl430 = [
        *ROBOT,
        *("--set", "dynamixel.model=XL430-W250"),
        *("--set", "dynamixel.max_current=.inf"),
    ]
    start_program("emulate", *robot_of_xl430).wait_for("16 emulated motors are on")
    start_program("run", *robot_of_xl430).wait_for("holds its pose")
    robot = trifinger.connect(NAME)
    t = robot.append_desired_action(robot.new_action(position=GOAL))
    y = robot.get_observation(t)
    assert np.isnan(y.torque).all()
    assert np.isfinite(y.position).all()
