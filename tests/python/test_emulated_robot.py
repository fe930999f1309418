# SPDX-License-Identifier: BSD-3-Clause
"""A robot on emulated motor boards, each program in a process of its own."""

import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import trifinger

pytestmark = pytest.mark.release

ROBOT = "trifinger_edu_emulated"
# Machines of tests stall for longer than any robot's machine may.
PATIENT = ["boards.silent_after=10", "boards.receive_timeout=10", "boards.move_time=1"]
START = [0.0, 0.9, -1.7] * 3  # [rad]


def arguments(name: str) -> list[str]:
    settings = [word for setting in PATIENT for word in ("--set", setting)]
    return [ROBOT, "--name", name, *settings]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., "subprocess.Popen[str]"]]:
    processes: list[subprocess.Popen[str]] = []

    def start_one(verb: str, *words: str, awaited: str) -> "subprocess.Popen[str]":
        process = subprocess.Popen(
            ["trifinger", verb, *words], stdout=subprocess.PIPE, text=True, cwd=tmp_path
        )
        processes.append(process)
        assert process.stdout is not None
        for line in process.stdout:
            if awaited in line:
                return process
        pytest.fail(f"trifinger {verb} has ended with {process.wait()}")

    yield start_one
    for process in processes:
        process.kill()
        process.communicate()


def test_it_homes_moves_and_survives_an_emergency_stop(start, session_name) -> None:
    boards = start("emulate", *arguments(session_name), awaited="are on")
    start(
        "run",
        *arguments(session_name),
        "--set",
        "boards.silent_after=1",
        awaited="holds its pose",
    )

    with trifinger.connect(session_name) as robot:
        observation = robot.latest_observation()
        np.testing.assert_allclose(observation.position, START, atol=0.03)

        goal = np.array([0.2, 0.7, -1.5] * 3)
        for step in range(1, 1001):
            target = np.array(START) + min(step / 700, 1.0) * (goal - np.array(START))
            t = robot.append_desired_action(robot.new_action(position=target))
        np.testing.assert_allclose(robot.get_observation(t).position, goal, atol=0.05)

        # The supply fails: the process of the boards is gone.
        boards.send_signal(signal.SIGKILL)
        boards.wait()
        with pytest.raises(trifinger.RobotStopped, match=r"board \d .* no measurements come"):
            while True:
                t = robot.append_desired_action(robot.new_action(position=goal))
                robot.get_observation(t)

    start("emulate", *arguments(session_name), awaited="are on")
    subprocess.run(["trifinger", "recover", session_name], check=True, timeout=120)
    with trifinger.connect(session_name, timeout=60) as robot:
        np.testing.assert_allclose(robot.latest_observation().position, START, atol=0.03)


def test_what_is_no_robot_on_boards_cannot_be_emulated() -> None:
    done = subprocess.run(
        ["trifinger", "emulate", "sim"], capture_output=True, text=True, check=False
    )
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
        ("boards.bus=can", "must be socketcan or emulated"),
        ("backend.mode=non_real_time", "a robot on motor boards runs in real time"),
    ],
)
def test_a_wrong_value_is_answered_with_a_sentence(setting: str, sentence: str) -> None:
    done = subprocess.run(
        ["trifinger", "run", ROBOT, "--set", setting], capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert sentence in done.stderr


def test_an_interface_that_does_not_exist_is_named() -> None:
    settings = ["--set", "boards.bus=socketcan", "--set", "boards.interfaces=[x0,x1,x2,x3,x4,x5]"]
    done = subprocess.run(
        ["trifinger", "run", ROBOT, *settings], capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert "CAN" in done.stderr or "x0" in done.stderr
