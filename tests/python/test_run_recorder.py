# SPDX-License-Identifier: BSD-3-Clause
"""Whatever happens to the recorder of `trifinger run --record`, every lost step is reported."""

import os
import resource
import signal
import subprocess
from pathlib import Path

import pytest
import trifinger
from conftest import PATIENT_FAKE, PROGRAM, Running, StartProgram
from test_orderly_end import log_of
from test_recording import child_of, wait_for_end_of

INCOMPLETE = 3


def connected() -> trifinger.Frontend:
    """The robot "fake", which repeats its first action for ever."""
    robot = trifinger.connect("fake")
    robot.append_desired_action(robot.new_action())
    return robot


def start(start_program: StartProgram, folder: Path, mode: str = "--real-time") -> Running:
    program = start_program("run", "fake", mode, *PATIENT_FAKE, "--record", str(folder))
    program.wait_for("records into")
    return program


def limit_files_of(pid: int, size: int) -> None:
    """Lets all writes of a process fail that would make a file larger: EFBIG and SIGXFSZ."""
    _, most = resource.prlimit(pid, resource.RLIMIT_FSIZE)
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (size, most))


def stop(pid: int) -> None:
    """Stops a process, and returns when all its threads stand still, which takes its time.

    The kernel counts a process as stopped when its last thread stands still.
    """
    os.kill(pid, signal.SIGSTOP)
    threads = Path(f"/proc/{pid}/task")
    while any("State:\tT" not in (task / "status").read_text() for task in threads.iterdir()):
        os.sched_yield()


def assert_complete(path: Path, robot: trifinger.Frontend) -> None:
    """The log has every step to the end, or says which one was lost."""
    log = log_of(path)
    missing = {t for gap in log.gaps for t in range(gap.first, gap.last + 1)}
    steps = sorted({*log.time_index.tolist(), *missing})
    assert steps == list(range(len(steps)))
    assert len(steps) == robot.session_info().steps
    assert log.fault == robot.fault()


@pytest.mark.slow
def test_fault_74_a_recorder_that_stands_still_is_told_of_and_so_is_its_return(
    tmp_path: Path, start_program: StartProgram
) -> None:
    program = start(start_program, tmp_path / "out")
    robot = connected()
    robot.wait_until_time_index(50)
    recorder = child_of(program.process.pid)
    stop(recorder)
    assert program.wait_for("recorder: ").startswith("recorder: has stood still for 2 s")
    step = robot.current_time_index()
    robot.wait_until_time_index(step + 50)  # the robot does not notice
    os.kill(recorder, signal.SIGCONT)
    said = program.read_until("recorder: is well again after")
    assert not any("stood still" in line for line in said), "it was told once"
    status, output = program.end(signal.SIGINT)
    assert (status, output.splitlines()[-1]) == (0, "fake: stopped")
    assert_complete(tmp_path / "out", robot)


@pytest.mark.slow
def test_fault_74_a_recorder_that_stands_still_at_the_end_is_replaced(
    tmp_path: Path, start_program: StartProgram
) -> None:
    program = start(start_program, tmp_path / "out")
    robot = connected()
    robot.wait_until_time_index(50)
    recorder = child_of(program.process.pid)
    stop(recorder)
    status, output = program.end(signal.SIGTERM)
    assert (status, output.splitlines()[-1]) == (0, "fake: stopped")
    assert "recorder: stood still at the end and was killed; another one goes on" in output
    assert_complete(tmp_path / "out", robot)
    wait_for_end_of(recorder)


@pytest.mark.slow
def test_fault_74_a_recorder_that_is_killed_again_and_again_is_replaced_each_time(
    tmp_path: Path, start_program: StartProgram
) -> None:
    program = start(start_program, tmp_path / "out")
    robot = connected()
    for _ in range(5):
        os.kill(child_of(program.process.pid), signal.SIGKILL)
        program.wait_for("recorder: was killed by signal 9; another one goes on")
        program.wait_for("recorder: is well again after")
    # This kill is noticed only at the end.
    os.kill(child_of(program.process.pid), signal.SIGKILL)
    assert program.end(signal.SIGINT)[0] == 0
    assert_complete(tmp_path / "out", robot)


@pytest.mark.parametrize("mode", ["--real-time", "--non-real-time"])
def test_fault_74_an_end_that_cannot_be_written_stays_in_memory(
    mode: str, tmp_path: Path, start_program: StartProgram
) -> None:
    program = start(start_program, tmp_path / "out", mode)
    robot = connected()
    if mode == "--real-time":
        limit_files_of(child_of(program.process.pid), 0)
    limit_files_of(program.process.pid, 0)
    robot.wait_until_time_index(robot.append_desired_action(robot.new_action()))
    program.wait_for("recorder: cannot write: write to a log: File too large; 'ulimit -f'")
    status, output = program.end(signal.SIGTERM)
    assert status == INCOMPLETE
    assert "stopped" not in output.splitlines()[-1]
    remedy = ["record", "fake", "--until-end", "-o", str(tmp_path / "out")]
    assert f"trifinger {' '.join(remedy)}" in output
    subprocess.run([PROGRAM, *remedy], check=True, capture_output=True)
    assert_complete(tmp_path / "out", robot)
    # The memory that is left over does not keep the name of the robot.
    again = start(start_program, tmp_path / "out", mode)
    assert again.end()[0] == 0


@pytest.mark.slow
def test_fault_74_run_can_be_started_again_as_soon_as_it_was_killed(
    tmp_path: Path, start_program: StartProgram
) -> None:
    program = start(start_program, tmp_path / "out")
    for _ in range(20):
        robot = connected()
        robot.wait_until_time_index(5)
        program.process.kill()
        # The old recorder has not yet noticed the kill, or is writing the end.
        program = start(start_program, tmp_path / "out")
    assert program.end()[0] == 0
    assert len(trifinger.Log(tmp_path / "out").files) == 1  # the newest recording
    assert len(list((tmp_path / "out").glob("*.mcap"))) >= 20


def test_fault_74_a_recorder_that_stands_still_when_run_is_killed_finishes_nevertheless(
    tmp_path: Path, start_program: StartProgram
) -> None:
    program = start(start_program, tmp_path / "out")
    robot = connected()
    robot.wait_until_time_index(50)
    stop(child_of(program.process.pid))
    # The kernel continues a stopped process when its last relative outside its group dies.
    program.process.kill()
    again = start(start_program, tmp_path / "out")
    with pytest.raises(trifinger.RobotStopped):
        robot.get_observation(1_000_000_000)
    assert again.end()[0] == 0
    assert_complete(min((tmp_path / "out").glob("*.mcap")), robot)


def test_fault_22_a_limit_of_file_sizes_is_like_a_full_disk(
    tmp_path: Path, start_program: StartProgram
) -> None:
    program = start(start_program, tmp_path / "out")
    robot = connected()
    recorder = child_of(program.process.pid)
    limit_files_of(recorder, 0)
    program.wait_for("recorder: cannot write: write to a log: File too large")
    limit_files_of(recorder, resource.RLIM_INFINITY)
    program.wait_for("recorder: writes again after")
    assert program.end()[0] == 0
    assert_complete(tmp_path / "out", robot)


def test_fault_22_a_limit_of_file_sizes_costs_the_log_of_a_fault_and_no_more(
    start_program: StartProgram,
) -> None:
    program = start_program("run", "fake", *PATIENT_FAKE, "--set", "fault_after=1000")
    program.wait_for("holds its pose")
    robot = connected()
    limit_files_of(program.process.pid, 0)
    with pytest.raises(trifinger.RobotStopped):
        robot.get_observation(1_000_000_000)
    program.wait_for("what came before the fault is lost: write to a log: File too large")
    assert program.end()[0] == 0
