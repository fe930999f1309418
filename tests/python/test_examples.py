# SPDX-License-Identifier: BSD-3-Clause
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import BUILD, PROGRAM, Running, StartProgram, assert_steady, patient

pytestmark = pytest.mark.slow

PROGRAMS = BUILD / "examples"
EXAMPLES = Path(__file__).parents[2] / "examples"
CONTROL_LOOP = "01_basic_control_loop"  # connects to a robot that runs elsewhere
TWO_ROBOTS = "16_two_robots"  # connects to two of them
# This machine may be busy with other tests, so late actions must not cause a fault.
PATIENT = (
    "--set",
    "backend.late_action.max_repeats=1000000",
    "--set",
    "backend.max_skipped_ticks=1000000",
)


def python_command(name: str) -> list[str]:
    return [sys.executable, "-W", "error", str(EXAMPLES / f"{name}.py")]


@pytest.mark.parametrize(
    "name",
    sorted({path.stem for path in EXAMPLES.glob("*.py")} - {CONTROL_LOOP, TWO_ROBOTS}),
)
def test_shows_what_it_says(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", f"{PROGRAMS}:{os.environ['PATH']}")
    example = subprocess.run(python_command(name), capture_output=True, text=True)
    assert example.returncode == 0, example.stdout + example.stderr
    assert example.stdout
    assert example.stderr == ""


def test_comes_in_both_languages() -> None:
    in_cpp = {path.stem for path in EXAMPLES.glob("*.cpp")}
    assert {path.stem for path in EXAMPLES.glob("*.py")} == in_cpp


# ---- the basic control loop, in both languages ----


def versions(name: str) -> pytest.MarkDecorator:
    commands = [[str(PROGRAMS / name)], python_command(name)]
    return pytest.mark.parametrize("command", commands, ids=["C++", "Python"])


in_both_languages = versions(CONTROL_LOOP)


@contextmanager
def running(command: list[str]) -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as program:
        try:
            yield program
        finally:
            program.kill()  # does nothing if the program has ended


@in_both_languages
@pytest.mark.parametrize("mode", ["--real-time", "--non-real-time"])
def test_the_control_loop_ends_well_when_the_robot_is_stopped(
    command: list[str], mode: str, start_program: StartProgram
) -> None:
    start_program("run", "sim", mode, *PATIENT).wait_for("holds its pose")
    observer = trifinger.observe("sim")
    with running(command) as program:
        goal = np.array([0.1, 0.8, -1.5] * 3)
        t = 0
        while np.abs(goal - observer.get_observation(t).position).max() > 0.05:
            t += 100
        subprocess.run([PROGRAM, "stop", "sim"], check=True, capture_output=True)
        output, errors = program.communicate()
    assert (program.returncode, errors) == (0, "")
    assert re.fullmatch(
        r"robot 'sim' has stopped: the back-end was asked to stop at step \d+\n", output
    )


@in_both_languages
def test_the_control_loop_fails_when_the_robot_does(
    command: list[str], start_program: StartProgram
) -> None:
    robot = start_program("run", "sim", *PATIENT)
    robot.wait_for("holds its pose")
    observer = trifinger.observe("sim")
    with running(command) as program:
        observer.wait_until_time_index(10)
        robot.process.kill()
        output, errors = program.communicate()
    assert program.returncode == 1
    assert "robot 'sim' has stopped: the back-end died" in output + errors


@in_both_languages
def test_the_control_loop_says_how_to_start_a_robot(command: list[str]) -> None:
    example = subprocess.run(command, capture_output=True, text=True)
    assert example.returncode == 1
    assert "'trifinger run sim" in example.stderr


# ---- two robots ----


@pytest.fixture
def two_robots(start_program: StartProgram, tmp_path: Path) -> dict[str, Running]:
    """A TriFinger and the arm in processes of their own, in real time and recorded."""
    arm = patient(EXAMPLES / "arm.yml", 0.001, tmp_path)
    robots = {"sim": ("sim", *PATIENT), "arm": (str(arm),)}
    started = {}
    for name, words in robots.items():
        started[name] = start_program("run", *words, "--record", str(tmp_path / name))
        started[name].wait_for("waits for a user")
    return started


def whole_session(folder: Path) -> trifinger.LoggedSession:
    """What the only robot in these logs did; nothing is missing."""
    session = trifinger.Log(folder).session()
    assert session.steps is not None
    assert session.steps >= 2000
    assert_steady(session)
    return session


@versions(TWO_ROBOTS)
def test_one_program_controls_two_robots(
    command: list[str], two_robots: dict[str, Running], tmp_path: Path
) -> None:
    with running(command) as program:
        output, errors = program.communicate()
    assert (program.returncode, errors) == (0, ""), output
    for name, robot in two_robots.items():
        assert re.search(rf"^{name}: \d+ steps$", output, re.MULTILINE)
        assert robot.end()[0] == 0
    finger = whole_session(tmp_path / "sim").observations["position"][:, 2]
    elbow = whole_session(tmp_path / "arm").observations["position"][:, 1]
    assert np.ptp(finger) > 0.3
    assert np.ptp(elbow) == pytest.approx(np.ptp(finger), abs=0.2)  # the arm has followed


@versions(TWO_ROBOTS)
@pytest.mark.parametrize(("failing", "other"), [("arm", "sim"), ("sim", "arm")])
def test_a_robot_that_fails_does_not_disturb_the_other(
    command: list[str],
    failing: str,
    other: str,
    two_robots: dict[str, Running],
    tmp_path: Path,
) -> None:
    observer = trifinger.observe(failing)
    with running(command) as program:
        observer.wait_until_time_index(100)
        two_robots[failing].process.kill()
        output, _ = program.communicate()
    assert program.returncode == 1
    assert f"robot '{failing}' has stopped: the back-end died" in output
    assert re.search(rf"^{other}: \d+ steps$", output, re.MULTILINE)
    assert two_robots[other].end()[0] == 0
    whole_session(tmp_path / other)


# ---- ./run examples ----


def run_examples(*names: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(EXAMPLES.parent / "tools/run_examples.py"), str(PROGRAMS)]
    return subprocess.run([*command, *names], capture_output=True, text=True, check=False)


def test_run_examples_shows_what_those_that_are_named_say() -> None:
    done = run_examples("01", "05_own")
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    assert re.findall(r"^\w.*", done.stdout, re.MULTILINE) == [
        *("01_basic_control_loop, C++", "01_basic_control_loop, Python"),
        *("05_own_robot, C++", "05_own_robot, Python"),
        "4 examples succeeded",
    ]
    stopped = "    robot 'sim' has stopped: the back-end was asked to stop at step"
    assert done.stdout.count(stopped) == 2


def test_run_examples_says_which_there_are() -> None:
    done = run_examples("99")
    assert done.returncode == 2
    assert "./run examples: there are 01_basic_control_loop, 02_" in done.stderr
