# SPDX-License-Identifier: BSD-3-Clause
"""A robot on emulated motor boards, each program in a process of its own."""

import json
import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trifinger
from conftest import (
    EMULATED,
    PATIENT_BOARDS,
    PROGRAM,
    StartProgram,
    output_of,
    patient_backend,
)

pytestmark = pytest.mark.slow

NAME = "trifinger-edu-emulated"
START = np.array([0.0, 0.9, -1.7] * 3)  # [rad]
GOAL = np.array([0.2, 0.7, -1.5] * 3)  # [rad]


def hold_for_ever(robot: trifinger.Frontend, position: np.ndarray = GOAL) -> None:
    while True:
        t = robot.append_desired_action(robot.new_action(position=position))
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


# ---- running hours ----

# Stands where it is, so that its start takes no time.
STANDING = [
    *PATIENT_BOARDS,
    *("--set", "boards.homing.method=here"),
    *("--set", "boards.homing.home_position=[0, 0.9, -1.7]"),
]


def newest_record(file: Path) -> dict[str, Any]:
    while not file.exists():
        time.sleep(0.01)
    whole = file.read_text().rpartition("\n")[0]
    record: dict[str, Any] = json.loads(whole.splitlines()[-1])
    assert record["robot"] == NAME
    wear: dict[str, Any] = record["wear"]
    return wear


def status() -> str:
    command = [PROGRAM, "status", NAME, "--once"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def swing(robot: trifinger.Frontend, steps: int) -> None:
    for step in range(steps):
        target = START + 0.2 * np.sin(step / 100)
        t = robot.append_desired_action(robot.new_action(position=target))
    robot.get_observation(t)


def test_fault_70_running_hours_survive_a_kill(
    start_program: StartProgram, log_folder: Path, tmp_path: Path
) -> None:
    file = log_folder / f"{NAME}.wear"
    start_program("emulate", EMULATED, *STANDING).wait_for("6 emulated boards are on")
    run = start_program("run", EMULATED, *STANDING, "--record", str(tmp_path / "log"))
    run.wait_for("holds its pose")
    assert newest_record(file)["starts"] == 1
    with trifinger.connect(NAME) as robot:
        swing(robot, 2500)
        shown = robot.companion("wear").latest_observation()
    assert np.all(shown.revolutions > 0.2)
    assert np.all(shown.work > 0)
    np.testing.assert_allclose(shown.powered_time, shown.powered_time[0])
    assert shown.homings == 1
    # The end of a session is written, with all that came after the newest element.
    while np.any(newest_record(file)["revolutions"] < shown.revolutions):
        time.sleep(0.01)
    run.end(signal.SIGKILL)
    kept = newest_record(file)
    with file.open("a") as end:
        end.write('{"time":"2')  # as a kill in the middle of a record leaves it

    run = start_program("run", EMULATED, *STANDING)
    run.wait_for("holds its pose")
    with trifinger.connect(NAME) as robot:
        shown = robot.companion("wear").latest_observation()
        assert shown.starts == 2
        assert shown.homings == 2
        for name in ("powered_time", "revolutions", "work", "squared_current", "index_slips"):
            assert np.all(shown[name] >= kept[name]), name
        text = status()
    assert "wear        2 starts, 2 homings, 0 faults" in text
    # A row for each joint.
    rows = [line.split() for line in text.splitlines() if "A^2s" in line]
    assert [row[0] for row in rows] == [str(joint) for joint in range(9)]
    assert all(float(row[3]) > 0.2 for row in rows)
    assert run.end()[0] == 0
    final = newest_record(file)
    assert final["starts"] == 2
    assert np.all(np.array(final["powered_time"]) > shown.powered_time)

    # The log has them, too.
    logged = trifinger.Log(tmp_path / "log").sessions[0]
    assert f"{NAME}.wear" in [companion.name for companion in logged.companions]


def test_fault_70_homing_by_hand_counts_as_well(
    start_program: StartProgram, log_folder: Path
) -> None:
    start_program("emulate", EMULATED, *STANDING).wait_for("6 emulated boards are on")
    for start in (1, 2):
        subprocess.run([PROGRAM, "home", EMULATED, *STANDING], check=True, timeout=110)
        kept = newest_record(log_folder / f"{NAME}.wear")
        assert kept["starts"] == start
        assert kept["homings"] >= start
        assert all(time > start for time in kept["powered_time"])


def test_fault_70_a_robot_runs_whatever_lies_in_the_place_of_its_running_hours(
    start_program: StartProgram, log_folder: Path
) -> None:
    log_folder.mkdir()
    os.mkfifo(log_folder / f"{NAME}.wear")
    start_program("emulate", EMULATED, *STANDING).wait_for("6 emulated boards are on")
    lines = start_program("run", EMULATED, *STANDING).read_until("holds its pose")
    [line] = [line for line in lines if "running hours" in line]
    assert f"running hours are not kept: open {log_folder}/{NAME}.wear, which is a FIFO" in line
    assert "wear        since this start only, 1 homing, 0 faults" in status()


def test_what_is_no_robot_on_boards_cannot_be_emulated() -> None:
    done = subprocess.run([PROGRAM, "emulate", "sim"], capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert (
        "'sim' is not on motor boards or Dynamixel motors: its driver is simulation" in done.stderr
    )


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
        (
            "backend.mode=non_real_time",
            "a robot on motor boards or Dynamixel motors runs in real time only",
        ),
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


def maintain(*arguments: str, typed: str = "") -> subprocess.CompletedProcess[str]:
    """Runs a command that looks after a robot, to its end."""
    command = [PROGRAM, *arguments, *PATIENT_BOARDS]
    return subprocess.run(
        command, input=typed, capture_output=True, text=True, check=False, timeout=300
    )


@pytest.fixture
def calibrations(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setenv("TRIFINGER_CALIBRATION_DIR", str(tmp_path))
    return tmp_path


@pytest.mark.usefixtures("calibrations")
def test_home_and_self_test(start_program: StartProgram, tmp_path: Path) -> None:
    start_program("emulate", EMULATED, *PATIENT_BOARDS).wait_for("6 emulated boards are on")

    homed = maintain("home", EMULATED)
    assert homed.returncode == 0, homed.stderr
    assert "is home and at its initial position" in homed.stdout

    file = tmp_path / "measured.json"
    tested = maintain("self-test", EMULATED, "-o", str(file))
    assert tested.returncode == 0, tested.stdout + tested.stderr
    written = json.loads(file.read_text())
    assert [joint["problem"] for joint in written] == [""] * 9
    rows = [line.split() for line in tested.stdout.splitlines() if " good " in line]
    assert [int(row[0]) for row in rows] == list(range(9))
    measured = np.array([[float(number) for number in row[2:]] for row in rows])
    load, weight, friction, index_distance = measured.T
    np.testing.assert_allclose([joint["load"] for joint in written], load, atol=6e-4)
    # The simulated robot has no friction, and its weight is that of the model.
    np.testing.assert_allclose(load, weight, atol=0.01)
    np.testing.assert_allclose(friction, 0.0, atol=0.01)
    np.testing.assert_allclose(index_distance, 2 * np.pi / 9, atol=0.001)
    assert "passes" in tested.stdout


def test_calibrate_writes_what_run_reads(start_program: StartProgram, calibrations: Path) -> None:
    start_program("emulate", EMULATED, *PATIENT_BOARDS).wait_for("6 emulated boards are on")
    done = maintain(
        "calibrate", EMULATED, "--serial", "0042", "--pose", "0", "0.9", "-1.7", typed="\n\n"
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "press Enter" in done.stdout
    file = calibrations / f"{NAME}.yml"
    assert 'serial: "0042"' in file.read_text()

    robot = start_program("run", EMULATED, *PATIENT_BOARDS)
    robot.wait_for("was calibrated on")
    robot.wait_for("holds its pose")
    with trifinger.connect(NAME) as session:
        assert 'serial: "0042"' in session.documents()["calibration.yml"]


def test_a_calibration_cannot_be_made_without_a_person(start_program: StartProgram) -> None:
    start_program("emulate", EMULATED, *PATIENT_BOARDS).wait_for("6 emulated boards are on")
    done = maintain("calibrate", EMULATED)
    assert done.returncode == 1
    assert "nobody can press Enter" in done.stderr


@pytest.mark.usefixtures("calibrations")
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--pose", "0", "45", "-90"), "joint 1 is at 45 rad, must be within its hard limits"),
        (("--pose", "0", "1"), "--pose has 2 angles, must have 1, 3 or 9"),
        (("--set", "boards.homing.method=here"), "'here', which finds no place"),
        (("--serial", "a\nb"), "--serial must be one line of text"),
    ],
)
def test_calibrate_refuses_what_makes_no_sense(
    start_program: StartProgram, arguments: tuple[str, ...], sentence: str
) -> None:
    start_program("emulate", EMULATED, *PATIENT_BOARDS).wait_for("6 emulated boards are on")
    done = maintain("calibrate", EMULATED, *arguments)
    assert done.returncode == 2
    assert sentence in done.stderr


CALIBRATION = f"""\
robot: {NAME}
serial: 0042
date: 2026-11-22 21:50:00 UTC
method: end_stop
direction: [1, 1, -1, 1, 1, -1, 1, 1, -1]
polarity: [1, 1, 1, 1, 1, 1, 1, 1, 1]
gear_ratio: 9
home_position: [1.8, 2.0, -3.4, 1.8, 2.0, -3.4, 1.8, 2.0, -3.4]
"""


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (NAME, "left", "is that of the robot 'left'"),
        ("0042", "0043", "is that of the robot with serial number '0043', not '0042'"),
        ("[1.8, 2.0, -3.4, 1.8, 2.0, -3.4, 1.8,", "[1.8,", "has 3 joints, the robot has 9"),
        ("end_stop", "here", "was measured with another homing"),
        ("direction: [1,", "direction: [-1,", "was measured with another homing"),
        ("gear_ratio: 9", "gear_ratio: 6", "was measured with another homing"),
        ("home_position", "home_positions", "is 'home_positions' a misspelling"),
        ("1.8, 2.0", ".nan, 2.0", "home_position"),
    ],
)
def test_a_calibration_of_another_robot_is_refused(
    calibrations: Path, old: str, new: str, sentence: str
) -> None:
    assert old in CALIBRATION
    (calibrations / f"{NAME}.yml").write_text(CALIBRATION.replace(old, new, 1))
    done = maintain("run", EMULATED, "--set", "boards.serial=0042")
    assert done.returncode != 0
    assert sentence in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_who_is_not_on_boards_cannot_be_looked_after() -> None:
    for command in ("home", "calibrate", "self-test"):
        done = subprocess.run(
            [PROGRAM, command, "sim"], input="", capture_output=True, text=True, check=False
        )
        assert done.returncode != 0
        assert "'sim' is not on motor boards" in done.stderr


def test_a_robot_that_runs_cannot_be_looked_after(start_program: StartProgram) -> None:
    start_program("emulate", EMULATED, *PATIENT_BOARDS).wait_for("6 emulated boards are on")
    start_program("run", EMULATED, *PATIENT_BOARDS).wait_for("holds its pose")
    with trifinger.connect(NAME) as robot:
        done = maintain("home", EMULATED)
        assert done.returncode != 0
        assert f"robot '{NAME}' is run by" in done.stderr
        # Nobody has switched its boards off.
        t = robot.append_desired_action(robot.new_action(position=START))
        np.testing.assert_allclose(robot.get_observation(t).position, START, atol=0.03)


# ---- a robot from a file ----

DESK_ARM = f"""name: desk-arm
robot:
  mjcf: desk_arm.xml
  initial_position: {{shoulder: 0.3, elbow: -0.5, wrist: 0.2}}
safety:
  every_joint: {{safety_kd: 0.2, max_velocity: 4, braking: 10, default_kp: 30, default_kd: 1.5}}
  shoulder: {{soft_lower: -1.6, soft_upper: 1.6}}
  elbow: {{soft_lower: -2.2, soft_upper: 2.2}}
  wrist: {{soft_lower: -1.2, soft_upper: 1.2, default_kp: 8, default_kd: 0.2}}
stop: {{damping_time: 0.1}}
{patient_backend(0.001)}"""


def desk_arm(folder: Path) -> str:
    """Writes this robot, with the boards of docs/any_robot.md, for a patient emulator."""
    page = (Path(__file__).parents[2] / "docs" / "any_robot.md").read_text()
    [boards] = re.findall(r"```yaml\n(driver: boards\n.*?)```", page, re.DOTALL)
    for key, value in {
        "bus": "emulated",
        "silent_after": "3",
        "receive_timeout": "10",
        "move_time": "1",
        "self_test": "false",
    }.items():
        boards, count = re.subn(rf"(?m)^  {key}: \S+", f"  {key}: {value}", boards)
        assert count == 1
    shutil.copy(Path(__file__).parents[1] / "robots" / "desk_arm.xml", folder)
    (folder / "desk_arm.yml").write_text(DESK_ARM + boards)
    return str(folder / "desk_arm.yml")


def test_a_robot_from_a_file_runs_on_boards(
    start_program: StartProgram, calibrations: Path, log_folder: Path, tmp_path: Path
) -> None:
    arm = desk_arm(tmp_path)
    emulated = start_program("emulate", arm)
    emulated.wait_for("2 emulated boards are on")
    # The machine of a test has no processor of its own, so not all is good.
    doctor = subprocess.run(
        [PROGRAM, "doctor", arm], capture_output=True, text=True, check=False, timeout=60
    )
    assert "2 answer" in doctor.stdout

    tested = output_of(PROGRAM, "self-test", arm)
    rows = [line.split()[2:] for line in tested.splitlines() if " good " in line]
    load, weight = np.array([[float(number) for number in row[:2]] for row in rows]).T
    np.testing.assert_allclose(load, weight, atol=0.05)
    # The wrist does not turn so far that it passes two indexes.
    indexes = [float(row[3]) for row in rows[:2]]
    np.testing.assert_allclose(indexes, [2 * np.pi / 20, 2 * np.pi / 15], atol=0.01)
    assert "passes" in tested
    assert "home and at its initial position [rad]: 0." in output_of(PROGRAM, "home", arm)

    # It is put to the reference by nobody, so the angles are those of where it hangs.
    done = subprocess.run(
        [PROGRAM, "calibrate", arm, "--serial", "7"],
        input="\n\n",
        capture_output=True,
        text=True,
        check=False,
        timeout=110,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "gear_ratio: [20, 15, 5]" in (calibrations / "desk-arm.yml").read_text()
    (calibrations / "desk-arm.yml").unlink()

    # What is said names keys that the configuration of such a robot has.
    here = "boards.motors.every_joint.homing.method=here"
    refused = output_of(PROGRAM, "calibrate", arm, "--set", here, succeeds=False)
    assert "homing.method of each joint in boards.motors is 'here', which finds no place" in refused
    running = start_program("run", arm)
    running.wait_for("homing.home_position of each joint in boards.motors counts")
    running.wait_for("holds its pose")
    robot = trifinger.connect("desk-arm")
    start, goal = np.array([0.3, -0.5, 0.2]), np.array([-0.4, 0.6, -0.3])
    np.testing.assert_allclose(robot.latest_observation().position, start, atol=0.1)
    for step in range(1, 2001):
        target = start + min(step / 1500, 1.0) * (goal - start)
        t = robot.append_desired_action(robot.new_action(position=target))
    np.testing.assert_allclose(robot.get_observation(t).position, goal, atol=0.1)
    assert robot.companion("wear").latest_observation().starts == 5  # with the refused one
    kept = json.loads((log_folder / "desk-arm.wear").read_text().splitlines()[-1])
    assert kept["type"] == "desk_arm_wear"
    assert len(kept["wear"]["revolutions"]) == 3
    emulated.end(signal.SIGKILL)
    name = r"board \d \(can\d, joints? .*(elbow|wrist)\): no measurements come"
    with pytest.raises(trifinger.RobotStopped, match=name):
        hold_for_ever(robot, goal)
