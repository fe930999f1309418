# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger endurance`: what happens to its processes and files. The rest is tested in C++."""

import json
import os
import resource
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import BUILD, Running, StartProgram

PROGRAM = str(BUILD / "apps/trifinger-endurance")
# Tests of one file may run in several processes at once.
NAME = f"lasting-{os.getpid()}"
# A robot that waits for each action lives faster than the clock.
ROBOT = ("run", "sim", "--name", NAME, "--non-real-time")

Drive = Callable[..., Running]


@pytest.fixture
def drive(start_program: StartProgram, tmp_path: Path) -> Drive:
    """Starts a drive that writes to `tmp_path`/health."""

    def start(*options: str) -> Running:
        words = (NAME, "--output", str(tmp_path / "health"), "--write-every", "0.1s")
        return start_program(*words, *options, program=[PROGRAM])

    return start


def history(folder: Path) -> tuple[dict, list[dict]]:
    lines = [json.loads(line) for line in (folder / "health.jsonl").read_text().splitlines()]
    return lines[0], lines[1:-1]


def counted(folder: Path, name: str) -> int:
    return sum(interval[name] for interval in history(folder)[1])


def wait_for_steps(folder: Path, steps: int) -> None:
    while counted(folder, "steps") < steps:
        pass


@pytest.mark.slow
def test_goes_on_after_kills_of_the_robot_and_of_itself(
    start_program: StartProgram, drive: Drive, tmp_path: Path
) -> None:
    folder = tmp_path / "health"
    robot = start_program(*ROBOT)
    robot.wait_for("waits for a user")
    first = drive()
    first.wait_for("its health is in")
    wait_for_steps(folder, 10_000)
    robot.process.kill()
    robot.process.wait()
    first.wait_for("backend_died")
    robot = start_program(*ROBOT)
    first.wait_for("moves again")
    wait_for_steps(folder, counted(folder, "steps") + 1)
    first.process.kill()
    first.process.wait()

    before = counted(folder, "steps")
    second = drive()
    assert f"goes on counting after {before} steps" in second.wait_for("goes on counting")
    wait_for_steps(folder, before + 10_000)
    status, output = second.end()
    assert status == 0, output
    head, intervals = history(folder)
    assert head["starts"] == 2
    assert counted(folder, "recoveries") == 1
    assert sum(interval["troubles"].get("backend_died", 0) for interval in intervals) == 1
    assert "It has ended as requested" in (folder / "health.html").read_text()
    assert "fault" not in robot.end()[1]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_brings_the_robot_to_rest_and_writes_the_page(
    start_program: StartProgram, drive: Drive, tmp_path: Path, number: signal.Signals
) -> None:
    robot = start_program(*ROBOT)
    robot.wait_for("waits for a user")
    lasting = drive()
    lasting.wait_for("its health is in")
    wait_for_steps(tmp_path / "health", 1000)
    status, _ = lasting.end(number)
    assert status == 0
    page = (tmp_path / "health/health.html").read_text()
    assert "It has ended as requested" in page
    assert "http-equiv" not in page
    status, output = robot.end()
    assert status == 0, output
    assert "fault" not in output


@pytest.mark.slow
def test_ends_when_its_time_is_over(
    start_program: StartProgram, drive: Drive, tmp_path: Path
) -> None:
    start_program(*ROBOT).wait_for("waits for a user")
    lasting = drive("--duration", "2s")
    output, _ = lasting.process.communicate()
    assert lasting.process.returncode == 0, output
    assert counted(tmp_path / "health", "steps") > 0
    assert "It has ended as requested" in (tmp_path / "health/health.html").read_text()


@pytest.mark.slow
def test_asks_for_a_hand_if_nobody_starts_the_robot_again(
    start_program: StartProgram, drive: Drive, tmp_path: Path
) -> None:
    robot = start_program(*ROBOT)
    robot.wait_for("waits for a user")
    lasting = drive("--timeout", "1s")
    lasting.wait_for("its health is in")
    wait_for_steps(tmp_path / "health", 1000)
    robot.process.kill()
    output, _ = lasting.process.communicate()
    assert lasting.process.returncode == 4, output
    assert "an operator is needed" in output
    assert "trifinger run" in (tmp_path / "health/health.html").read_text()


def test_a_full_disk_stops_nothing_and_is_told_once(
    start_program: StartProgram, drive: Drive, tmp_path: Path
) -> None:
    folder = tmp_path / "health"
    robot = start_program(*ROBOT)
    robot.wait_for("waits for a user")
    lasting = drive()
    lasting.wait_for("its health is in")
    wait_for_steps(folder, 1000)
    # No file may become larger than this, as if the disk had no room.
    _, most = resource.prlimit(lasting.process.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(lasting.process.pid, resource.RLIMIT_FSIZE, (100, most))
    lasting.wait_for("cannot be written")
    before = counted(folder, "steps")
    resource.prlimit(lasting.process.pid, resource.RLIMIT_FSIZE, (most, most))
    told = lasting.read_until("written again")
    assert not [line for line in told if "cannot be written" in line]
    wait_for_steps(folder, before + 1)
    assert lasting.end()[0] == 0


def test_a_damaged_file_is_set_aside(
    start_program: StartProgram, drive: Drive, tmp_path: Path
) -> None:
    folder = tmp_path / "health"
    folder.mkdir()
    (folder / "health.jsonl").write_text("nonsense\n")
    robot = start_program(*ROBOT)
    robot.wait_for("waits for a user")
    lasting = drive("--steps", "100")
    lasting.wait_for("was damaged")
    lasting.process.communicate()
    assert lasting.process.returncode == 0
    assert (folder / "health.jsonl.damaged").read_text() == "nonsense\n"
    assert counted(folder, "steps") >= 100


@pytest.mark.slow
def test_the_memory_of_a_drive_stays_the_same(tmp_path: Path) -> None:
    def largest(steps: int) -> int:
        command = [PROGRAM, "--simulate", "sim", "--steps", str(steps), "--output", str(tmp_path)]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        assert status == 0
        process.returncode = 0
        return usage.ru_maxrss

    # Ten times the steps, on top of those that are on disk already.
    short = largest(20_000)
    assert largest(200_000) < short + 3000  # [kB]


def test_says_what_is_wrong_with_its_arguments(tmp_path: Path) -> None:
    def error_of(*words: str) -> str:
        done = subprocess.run(
            [PROGRAM, *words, "--output", str(tmp_path)],
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode in (1, 2)
        return done.stderr

    assert "no robot" in error_of("nobody") or "nobody" in error_of("nobody")
    assert "--simulate" in error_of("--faults-every", "5")
    assert "--speed" in error_of("--speed", "2")
