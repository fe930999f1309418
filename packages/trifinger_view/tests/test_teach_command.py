# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger teach`, with somebody who presses Enter."""

import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import trifinger
from conftest import PATIENT, Running, StartProgram
from trifinger_view.motion import Motion


@pytest.fixture
def robot(start_program: StartProgram) -> Running:
    running = start_program("run", "sim", *PATIENT)
    running.wait_for("waits for a user")
    return running


class Command:
    """`trifinger teach` with somebody who can press Enter."""

    def __init__(self, *words: str, stdin: int = subprocess.PIPE) -> None:
        program = "import sys; from trifinger_view.commands.teach import main; sys.exit(main())"
        self.process = subprocess.Popen(
            [sys.executable, "-c", program, *words],
            stdin=stdin,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def wait_for(self, text: str) -> None:
        assert self.process.stdout is not None
        lines = []
        for line in self.process.stdout:
            lines.append(line)
            if text in line:
                return
        raise AssertionError("".join(lines))

    def end(self, typed: str = "") -> tuple[int, str]:
        output, _ = self.process.communicate(typed)
        return self.process.returncode, output


def run(*words: str) -> tuple[int, str]:
    return Command(*words).end()


def wait_for_steps(count: int) -> None:
    trifinger.observe("sim").wait_until_time_index(count)


@pytest.mark.parametrize("end", ["\n", signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_fault_69_the_recording_is_written_however_it_is_ended(
    robot: Running, tmp_path: Path, end: str | signal.Signals
) -> None:
    file = tmp_path / "wave.motion"
    command = Command("sim", "-o", str(file))
    command.wait_for("'sim' floats")
    wait_for_steps(300)
    if isinstance(end, signal.Signals):
        command.process.send_signal(end)
    status, output = command.end("" if isinstance(end, signal.Signals) else end)
    assert status == 0, output
    assert re.search(r"wave.motion written: \d+\.\d s", output)
    assert f"trifinger motion play {file} --robot sim" in output
    motion = Motion.load(file)
    assert motion.duration > 0.2
    with trifinger.connect("sim") as next_user:  # the session has ended in order
        next_user.latest_observation()
    assert robot.process.poll() is None


def test_ends_by_itself(robot: Running, tmp_path: Path) -> None:
    assert robot.process.pid
    command = Command(
        "sim", "-o", str(tmp_path / "a"), "--seconds", "0.3", stdin=subprocess.DEVNULL
    )
    status, output = command.end()
    assert (status, Motion.load(tmp_path / "a").duration) == (0, pytest.approx(0.3)), output


def test_fault_63_when_the_robot_dies_what_was_recorded_is_written(
    robot: Running, tmp_path: Path
) -> None:
    command = Command("sim", "-o", str(tmp_path / "a"))
    command.wait_for("'sim' floats")
    wait_for_steps(500)
    robot.process.kill()
    status, output = command.end()
    assert status == 1
    assert "the back-end died" in output
    assert Motion.load(tmp_path / "a").duration > 0.1


def refused(robot: Running, words: Sequence[str], sentence: str) -> None:
    """A command that is refused before the robot has moved."""
    status, output = run(*words)
    assert status in (1, 2)
    assert re.search(sentence, output), output
    assert trifinger.list_sessions()[0].phase == "holding"
    assert robot.process.poll() is None


def test_what_cannot_be_written_is_refused_before_the_robot_floats(
    robot: Running, tmp_path: Path
) -> None:
    there = tmp_path / "there"
    there.write_text("mine")
    refused(robot, ["sim", "-o", str(there)], "exists; --force replaces it")
    assert there.read_text() == "mine"
    refused(robot, ["sim", "-o", str(tmp_path / "no/file")], "No such file or directory")
    refused(robot, ["sim", "-o", str(tmp_path), "--force"], "is not a file")
    refused(robot, ["sim", "-o", str(tmp_path / "a"), "--seconds", "-1"], "must be above 0")
    refused(robot, ["sam", "-o", str(tmp_path / "a")], "sam")
    assert not (tmp_path / "a").exists()


def test_force_replaces_a_file(robot: Running, tmp_path: Path) -> None:
    assert robot.process.pid
    file = tmp_path / "there"
    file.write_text("mine")
    status, output = run("sim", "-o", str(file), "--seconds", "0.1", "--force")
    assert status == 0, output
    assert Motion.load(file).duration == pytest.approx(0.1)


def test_without_anybody_who_can_press_enter_the_recording_ends_at_once(
    robot: Running, tmp_path: Path
) -> None:
    assert robot.process.pid
    status, output = Command("sim", "-o", str(tmp_path / "a"), stdin=subprocess.DEVNULL).end()
    assert status == 0
    assert "The robot holds its pose." in output


def test_a_hand_in_simulation_teaches_what_it_leads(robot: Running, tmp_path: Path) -> None:
    """The hand pulls at a tip with a spring; the motion is where it led the finger."""
    assert robot.process.pid
    command = Command("sim", "-o", str(tmp_path / "a"))
    command.wait_for("'sim' floats")
    observer = trifinger.observe("sim")
    kinematics = trifinger.Kinematics()

    def tip() -> npt.NDArray[np.float64]:
        return kinematics.tip_positions(observer.latest_observation().position)[0]

    start = tip()
    with trifinger.hand("sim") as hand:
        height = 0.0
        while tip()[2] < start[2] + 0.03:
            height = min(height + 0.001, 0.06)
            hand.pull("tip_0", target=start + np.array([0.0, 0.0, height]))
            observer.wait_until_time_index(observer.current_time_index() + 20)
    status, output = command.end("\n")
    assert status == 0, output

    motion = Motion.load(tmp_path / "a")
    assert motion.robot == "trifinger-edu"
    assert len(motion.joints) == 9
    assert motion.tips is not None
    assert motion.tips[:, 0, 2].max() >= start[2] + 0.03
    assert np.abs(motion.tips[:, 1:] - motion.tips[0, 1:]).max() < 0.005  # nobody took the others
    assert re.search(r"taught by hand: robot 'sim', session \d+, from step \d+", motion.history[0])
