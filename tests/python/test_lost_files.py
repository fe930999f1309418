# SPDX-License-Identifier: BSD-3-Clause
"""If somebody removes, cuts off or overwrites session files, a command restores order."""

import contextlib
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
import trifinger
from conftest import PATIENT_FAKE, PROGRAM, StartProgram


def run(*arguments: str, expect: int | None = None) -> str:
    """Runs the program to its end and returns all that it printed. pytest ends a hang."""
    result = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False)
    if expect is not None:
        assert result.returncode == expect, result.stdout + result.stderr
    return result.stdout + result.stderr


def remove(path: Path) -> None:
    path.unlink()


def cut(path: Path) -> None:
    path.write_bytes(b"")


def overwrite(path: Path) -> None:
    with path.open("r+b") as file:
        file.write(bytes(i * 7919 % 256 for i in range(path.stat().st_size)))


LOSSES = [remove, cut, overwrite]


@pytest.mark.slow
@pytest.mark.parametrize("files", ["*.state", "*.action", "*.lock", "*"])
@pytest.mark.parametrize("lose", LOSSES)
def test_fault_32_a_backend_can_be_stopped_whatever_became_of_its_files(
    session_folder: Path, start_program: StartProgram, lose: Callable[[Path], None], files: str
) -> None:
    robot = start_program("run", "fake", "--name", "x")
    robot.wait_for("holds its pose")
    for path in session_folder.glob(f"trifinger.x.{files}"):
        # A back-end that notices what is lost may take its other files away.
        with contextlib.suppress(FileNotFoundError):
            lose(path)

    second = run("run", "fake", "--name", "x", expect=1)
    assert f"is run by trifinger (process {robot.process.pid})" in second
    assert "'trifinger stop x'" in second
    assert run("list", expect=0)
    stopped = run("stop", "x", expect=0)
    assert f"stopped trifinger (process {robot.process.pid})" in stopped
    assert robot.process.wait() == 0
    # The name is free.
    again = start_program("run", "fake", "--name", "x", *PATIENT_FAKE)
    again.wait_for("holds its pose")
    with trifinger.connect("x") as user:
        user.append_desired_action(user.new_action(setpoint=1.0))
    assert run("stop", "x", expect=0)


def overwrite_beginning(path: Path) -> None:
    with path.open("r+b") as file:
        file.write(bytes(8))


@pytest.mark.parametrize("lose", [remove, overwrite_beginning])
def test_fault_32_errors_name_the_command_that_helps(
    session_folder: Path, start_program: StartProgram, lose: Callable[[Path], None]
) -> None:
    robot = start_program("run", "fake", "--name", "x")
    robot.wait_for("holds its pose")
    lose(session_folder / "trifinger.x.state")
    remedy = "its back-end still runs, 'trifinger stop x' brings the robot to rest and ends it"
    for command in ("status", "recover", "read"):
        assert remedy in run(command, "x", expect=1)
    with pytest.raises(trifinger.Error, match="'trifinger stop x' brings the robot to rest"):
        trifinger.connect("x")


def test_fault_18_a_second_robot_is_refused_without_the_lock_of_the_first(
    session_folder: Path, start_program: StartProgram
) -> None:
    robot = start_program("run", "fake", "--name", "x", *PATIENT_FAKE)
    robot.wait_for("holds its pose")
    (session_folder / "trifinger.x.lock").unlink()
    for _ in range(2):
        assert "is run by trifinger" in run("run", "fake", "--name", "x", expect=1)
    # The first back-end still works.
    assert "dead" not in run("list", expect=0)
    with trifinger.connect("x") as user:
        user.append_desired_action(user.new_action(setpoint=1.0))
    assert run("stop", "x", expect=0)
    assert robot.process.wait() == 0
