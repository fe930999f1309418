# SPDX-License-Identifier: BSD-3-Clause
"""Faults of rows 37 to 50 by command, each program in a process of its own.

Times are tested in C++, with a clock that tests move (tests/boards). Here the faults are what a
user types, and what he then reads.
"""

import contextlib
from collections.abc import Callable

import numpy as np
import pytest
import trifinger
from conftest import EMULATED, PATIENT_BOARDS, PROGRAM, Running, StartProgram, output_of

pytestmark = pytest.mark.slow

NAME = "trifinger-edu-emulated"
START = np.array([0.0, 0.9, -1.7] * 3)  # [rad]
# The joints are at home where they are, which saves the way to their end stops.
SETTINGS = [
    *PATIENT_BOARDS,
    *("--set", "boards.homing.method=here", "--set", "boards.homing.home_position=[0,0.9,-1.7]"),
]

StartFaulty = Callable[..., "Faulty"]


class Faulty:
    """A robot, its emulated boards, and what one types to these."""

    def __init__(self, start_program: StartProgram, *settings: str) -> None:
        self.boards: Running = start_program("emulate", EMULATED, *SETTINGS, *settings, typed=True)
        self.boards.wait_for("6 emulated boards are on")
        faults = [i for i, word in enumerate(settings) if word == "--fault"]
        of_robot = settings[: faults[0]] if faults else settings
        self.robot = start_program("run", EMULATED, *SETTINGS, *of_robot)

    def wait_until_it_holds(self) -> None:
        self.robot.wait_for("holds its pose")

    def type(self, line: str) -> None:
        assert self.boards.process.stdin is not None
        self.boards.process.stdin.write(line + "\n")
        self.boards.process.stdin.flush()

    def begins(self, fault: str) -> None:
        self.type(fault)
        self.boards.wait_for(f"fault '{fault}' begins")

    def move(self, steps: int, torque: float = 0.0) -> None:
        """Moves the joints to and fro."""
        with trifinger.connect(NAME, timeout=100) as robot:
            for i in range(steps):
                action = robot.new_action(position=START + 0.1 * np.sin(i / 200))
                action.torque[:] = torque
                t = robot.append_desired_action(action)
                robot.wait_until_time_index(t)
            robot.finish()

    def sentence(self, torque: float = 0.0) -> str:
        """Moves the joints until the session ends, and returns why."""
        with pytest.raises(trifinger.RobotStopped) as stopped:
            self.move(1_000_000, torque)
        return str(stopped.value)

    def goes_on(self, steps: int = 300) -> None:
        with trifinger.connect(NAME, timeout=100) as robot:
            for _ in range(steps):
                t = robot.append_desired_action(robot.new_action(position=START))
                robot.wait_until_time_index(t)
            robot.finish()

    def recovers(self) -> None:
        output_of(PROGRAM, "recover", NAME)
        self.goes_on(50)


@pytest.fixture
def start_faulty(start_program: StartProgram) -> StartFaulty:
    def start(*settings: str) -> Faulty:
        return Faulty(start_program, *settings)

    return start


def expect_that_it_goes_on(faulty: Faulty, fault: str) -> None:
    faulty.wait_until_it_holds()
    faulty.begins(fault)
    faulty.goes_on()


def expect_end_and_recovery(faulty: Faulty, fault: str, sentence: str) -> None:
    faulty.wait_until_it_holds()
    faulty.begins(fault)
    assert sentence in faulty.sentence()
    if " for " in fault:
        faulty.boards.wait_for(f"fault '{fault}' is over")
    faulty.recovers()


def test_faults_that_are_given_begin_at_their_times(start_program: StartProgram) -> None:
    silent, loses = "board 3 silent at 0.5 s for 0.2 s", "bus 0 loses 1 %"
    boards = start_program("emulate", EMULATED, *SETTINGS, "--fault", silent, "--fault", loses)
    # What begins at once may be told together with what begins later: the machine may stall.
    boards.read_until(f"fault '{loses}' begins", f"fault '{silent}' begins")
    boards.wait_for(f"fault '{silent}' is over")


def test_fault_37_lost_frames_by_command(start_faulty: StartFaulty) -> None:
    expect_that_it_goes_on(start_faulty(), "bus 2 loses 10 %")


def test_fault_38_frames_that_come_twice_or_late_by_command(start_faulty: StartFaulty) -> None:
    faulty = start_faulty()
    expect_that_it_goes_on(faulty, "bus 2 duplicates 50 %")
    faulty.begins("bus 3 delays 20 % by 0.003 s")
    faulty.goes_on()


def test_fault_39_corrupt_frames_by_command(start_faulty: StartFaulty) -> None:
    """Most change nothing; a false position of a plausible size is a fault that names its joint."""
    faulty = start_faulty("--set", "safety.plausibility.max_position_rate=500")
    faulty.wait_until_it_holds()
    faulty.begins("bus 2 corrupts 20 % for 1 s")
    with contextlib.suppress(trifinger.RobotStopped):
        faulty.goes_on(1000)
    faulty.boards.wait_for("is over")
    fault = trifinger.observe(NAME).fault()
    if fault is not None:
        faulty.recovers()


def test_fault_40_an_interface_that_is_down_by_command(start_faulty: StartFaulty) -> None:
    sentence = "board 2 (can2, joints 4 and 5): its CAN interface is down"
    expect_end_and_recovery(start_faulty(), "bus 2 down for 1 s", sentence)


def test_fault_40_a_controller_that_is_off_by_command(start_faulty: StartFaulty) -> None:
    sentence = "board 3 (can3, joint 3): the CAN controller has left the bus"
    expect_end_and_recovery(start_faulty(), "bus 3 off for 1 s", sentence)


def test_fault_41_a_flood_by_command(start_faulty: StartFaulty) -> None:
    expect_that_it_goes_on(start_faulty(), "bus 1 flooded with 3000 frames/s")


def test_fault_42_a_silent_board_by_command(start_faulty: StartFaulty) -> None:
    sentence = "board 3 (can3, joint 3): no measurements come"
    expect_end_and_recovery(start_faulty(), "board 3 silent for 5 s", sentence)


def test_fault_43_a_board_that_restarts_by_command(start_faulty: StartFaulty) -> None:
    expect_end_and_recovery(start_faulty(), "board 4 restarts", "board 4 (can4, joints 7 and 8): ")


def test_fault_44_an_error_of_a_board_by_command(start_faulty: StartFaulty) -> None:
    expect_end_and_recovery(
        start_faulty(), "board 1 error temperature", "board 1 (can1, joint 0): "
    )


def test_fault_45_an_encoder_that_jumps_by_command(start_faulty: StartFaulty) -> None:
    faulty = start_faulty("--set", "safety.plausibility.max_position_rate=500")
    faulty.wait_until_it_holds()
    faulty.begins("joint 4 jumps by 1 rad")
    assert "joint 4 has measured a position that changed faster" in faulty.sentence()


def test_fault_45_an_encoder_that_stands_still_by_command(start_faulty: StartFaulty) -> None:
    faulty = start_faulty("--set", "safety.plausibility.stuck_time=1")
    faulty.wait_until_it_holds()
    faulty.begins("joint 4 stuck")
    assert "joint 4" in faulty.sentence()


def test_fault_46_a_rollover_by_command(start_faulty: StartFaulty) -> None:
    faulty = start_faulty(
        *("--set", "boards.homing.method=end_stop"),
        *("--set", "boards.homing.home_position=[1.8,2.0,-3.4]"),
        *("--fault", "board 0 near rollover at 0 s"),
    )
    faulty.wait_until_it_holds()
    goal = START + [0.2, 0.1, 0.3] * 3
    with trifinger.connect(NAME, timeout=100) as robot:
        for s in np.linspace(0, 1, 1000):
            t = robot.append_desired_action(robot.new_action(position=START + s * (goal - START)))
        for _ in range(500):
            t = robot.append_desired_action(robot.new_action(position=goal))
        np.testing.assert_allclose(robot.get_observation(t).position, goal, atol=0.05)
        robot.finish()


def test_fault_47_a_motor_that_gets_too_hot_by_command(start_faulty: StartFaulty) -> None:
    faulty = start_faulty("--set", "safety.thermal_time=2")
    faulty.wait_until_it_holds()
    faulty.begins("joint 1 draws 3 times the current")
    assert "joint 1" in faulty.sentence(torque=0.3)


def test_fault_48_an_emergency_stop_by_command(start_faulty: StartFaulty) -> None:
    expect_end_and_recovery(
        start_faulty(), "emergency stop for 5 s", "no measurements come; check its supply"
    )


def test_fault_48_the_supply_comes_back_when_it_is_typed(start_faulty: StartFaulty) -> None:
    faulty = start_faulty()
    faulty.wait_until_it_holds()
    faulty.begins("power off")
    assert "no measurements come" in faulty.sentence()
    faulty.begins("power on")
    faulty.recovers()


def test_fault_49_a_homing_that_fails_by_command(start_faulty: StartFaulty) -> None:
    faulty = start_faulty(
        *("--set", "boards.homing.method=end_stop", "--set", "boards.homing.max_travel=4"),
        *("--fault", "joint 7 loose"),  # before the robot looks for its end stop
    )
    line = faulty.robot.wait_for("did not find its end stop")
    assert "joint 7" in line


@pytest.mark.parametrize("fault", ["joints 1 and 2 swapped", "joint 4 reversed", "joint 8 loose"])
def test_fault_50_a_wrong_wiring_by_command(fault: str, start_program: StartProgram) -> None:
    boards = start_program("emulate", EMULATED, *SETTINGS, "--fault", fault)
    boards.wait_for(f"fault '{fault}' begins")


def test_objects_are_put_back_by_command(start_faulty: StartFaulty) -> None:
    faulty = start_faulty()
    faulty.wait_until_it_holds()
    faulty.type("reset objects")
    with trifinger.connect(NAME, timeout=100) as robot:
        poses = robot.companion("object")
        while True:  # until a pose comes that was seen after that
            t = robot.append_desired_action(robot.new_action(position=START))
            pose = poses.get_latest_at(t)
            if pose is not None and pose.cube.position == pytest.approx([0, 0, 0.0325], abs=2e-3):
                break
        robot.finish()


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        ("board 1 slient", "'slient' is not understood after '1'; did you mean 'silent'"),
        ("board 7 silent", "there is no board 7, only 0 to 5"),
        ("joint 9 stuck", "there is no joint 9, only 0 to 8"),
    ],
)
def test_a_wrong_fault_is_answered_with_a_sentence(fault: str, sentence: str) -> None:
    assert sentence in output_of(PROGRAM, "emulate", EMULATED, "--fault", fault, succeeds=False)
