# SPDX-License-Identifier: BSD-3-Clause
"""D'Claw: in simulation by its name, and on emulated motors in processes of their own."""

from __future__ import annotations

import os
import signal
import subprocess
import termios
import time
import tty
from pathlib import Path

import compare_robots
import numpy as np
import pytest
import trifinger
from conftest import PROGRAM, StartProgram

pytestmark = pytest.mark.bindings

EMULATED = "dclaw_emulated"
# Machines of tests stall for longer than any robot's machine may.
PATIENT = [
    *("--set", "dynamixel.slack=1"),
    *("--set", "dynamixel.watchdog=0"),
    *("--set", "dynamixel.silent_after=10"),
    *("--set", "dynamixel.goal_timeout=10"),
]
NAME = "dclaw-test"
ROBOT = [EMULATED, "--name", NAME, *PATIENT]
START = np.array([0.0, -np.pi / 3, np.pi / 3] * 3)  # [rad]
GOAL = np.array([0.2, -0.8, 0.8] * 3)  # [rad]
PAGE = Path(__file__).parents[2] / "docs" / "dclaw.md"


def hold_for_ever(robot: trifinger.Frontend, position: np.ndarray) -> None:
    while True:
        robot.get_observation(robot.append_desired_action(robot.new_action(position=position)))


def test_it_is_simulated_by_its_name() -> None:
    robot = trifinger.simulate("dclaw")
    t = 0
    for _ in range(400):
        t = robot.append_desired_action(robot.new_action(position=GOAL))
    y = robot.get_observation(t)
    np.testing.assert_allclose(y.position, GOAL, atol=0.05)
    assert y.joint_position.shape == (10,)


def test_the_file_of_its_motors_is_simulated_as_well() -> None:
    """One file describes both, so a program is tried with the limits that hold later."""
    robot = trifinger.simulate("dclaw_dynamixel")
    np.testing.assert_allclose(robot.latest_observation().position, START, atol=1e-6)


@pytest.mark.slow
def test_the_page_has_the_table_that_is_measured() -> None:
    assert compare_robots.table() in PAGE.read_text()


def test_a_finger_of_dclaw_gives_way_to_much_larger_forces_only() -> None:
    trifinger_, dclaw = (
        compare_robots.Finger(robot).push_back() for robot in compare_robots.ROBOTS.values()
    )
    assert dclaw > 20 * trifinger_


@pytest.mark.slow
@pytest.mark.without_sanitizer
def test_it_runs_on_motors_and_survives_a_pulled_plug(start_program: StartProgram) -> None:
    motors = start_program("emulate", *ROBOT)
    motors.wait_for("10 emulated motors are on")
    start_program("run", *ROBOT).wait_for("holds its pose")

    robot = trifinger.connect(NAME)
    np.testing.assert_allclose(robot.latest_observation().position, START, atol=0.09)
    t = 0
    for step in range(1, 2001):
        target = START + min(step / 1500, 1.0) * (GOAL - START)
        t = robot.append_desired_action(robot.new_action(position=target))
    y = robot.get_observation(t)
    np.testing.assert_allclose(y.position, GOAL, atol=0.08)
    assert np.isfinite(y.joint_position).all()

    motors.end(signal.SIGKILL)
    with pytest.raises(trifinger.RobotStopped, match="the serial line to the motors has gone"):
        hold_for_ever(robot, GOAL)


@pytest.mark.slow
@pytest.mark.without_sanitizer
def test_faults_of_motors_are_typed_and_named(start_program: StartProgram) -> None:
    motors = start_program("emulate", *ROBOT, typed=True)
    motors.wait_for("10 emulated motors are on")
    start_program("run", *ROBOT).wait_for("holds its pose")
    robot = trifinger.connect(NAME)
    robot.append_desired_action(robot.new_action(position=START))
    motors.process.stdin.write("motor 21 overload\n")
    motors.process.stdin.flush()
    motors.wait_for("fault 'motor 21 overload' begins")
    with pytest.raises(trifinger.RobotStopped, match="MFJ21: motor 21 has stopped"):
        hold_for_ever(robot, START)
    # The motor is rebooted.
    subprocess.run([PROGRAM, "recover", NAME], check=True, timeout=120)
    with trifinger.connect(NAME, timeout=100) as robot:
        np.testing.assert_allclose(robot.latest_observation().position, START, atol=0.09)


def crc16(data: bytes) -> bytes:
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = ((crc << 1) ^ 0x8005 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc.to_bytes(2, "little")


def read_byte(port: int, motor: int, address: int) -> int:
    """Reads one byte of a motor's memory, as a program that is not ours would."""
    head = bytes([0xFF, 0xFF, 0xFD, 0, motor, 7, 0, 2, address, 0, 1, 0])
    os.write(port, head + crc16(head))
    answer = b""
    while len(answer) < 12:  # one byte of data, and everything around it
        answer += os.read(port, 100)
    assert answer[:8] == bytes([0xFF, 0xFF, 0xFD, 0, motor, 5, 0, 0x55])
    return answer[9]


@pytest.mark.slow
@pytest.mark.without_sanitizer
def test_motors_stop_by_themselves_when_the_program_is_killed(
    start_program: StartProgram, session_folder: Path
) -> None:
    watchdog = 2.0  # [s]; machines of tests stall
    settings = [*ROBOT, "--set", f"dynamixel.watchdog={watchdog}"]
    start_program("emulate", *settings).wait_for("10 emulated motors are on")
    run = start_program("run", *settings)
    run.wait_for("holds its pose")
    run.end(signal.SIGKILL)

    port = os.open(session_folder / f"trifinger-dynamixel.{NAME}", os.O_RDWR | os.O_NOCTTY)
    tty.setraw(port)
    speeds = termios.tcgetattr(port)
    speeds[4] = speeds[5] = termios.B4000000
    termios.tcsetattr(port, termios.TCSANOW, speeds)
    # Each read is an instruction that they hear, so nobody may ask before.
    time.sleep(1.5 * watchdog)
    assert read_byte(port, 10, 98) == 0xFF  # bus_watchdog: it has stopped the motor
    os.close(port)
    # They can be started again.
    start_program("run", *settings).wait_for("holds its pose")


@pytest.mark.slow
@pytest.mark.without_sanitizer
def test_motors_are_not_taken_away_by_a_second_emulator(start_program: StartProgram) -> None:
    motors = start_program("emulate", *ROBOT)
    motors.wait_for("10 emulated motors are on")
    command = [PROGRAM, "emulate", *ROBOT]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "belongs to motors that are emulated already" in done.stderr
    start_program("run", *ROBOT).wait_for("holds its pose")
    # One that was killed is no hindrance.
    motors.end(signal.SIGKILL)
    start_program("emulate", *ROBOT).wait_for("10 emulated motors are on")


@pytest.mark.without_sanitizer
@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ("dynamixel.baud=1000", "must be 9600 to"),
        ("dynamixel.port=/dev/null", "/dev/null"),
        ("dynamixel.motors.FFJ10.id=21", "motor 21 is named twice"),
        ("dynamixel.motors.FFJ11.ratio=3", "knows its angle within one turn only"),
        ("dynamixel.mode=pwm", "must be 'torque' or 'position'"),
    ],
)
def test_a_wrong_value_is_answered_with_a_sentence(setting: str, sentence: str) -> None:
    done = subprocess.run(
        [PROGRAM, "run", EMULATED, "--set", setting], capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert sentence in done.stderr


@pytest.mark.without_sanitizer
def test_it_says_what_is_missing() -> None:
    command = [PROGRAM, "run", EMULATED, "--name", "dclaw-nobody"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "start them with 'trifinger emulate'" in done.stderr
    command = [PROGRAM, "emulate", *ROBOT, "--fault", "motor 10 sings"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "'motor 10 sings' is no fault of Dynamixel motors" in done.stderr
    command = [PROGRAM, "emulate", "dclaw_dynamixel"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "--set dynamixel.port=emulated emulates them" in done.stderr
