# SPDX-License-Identifier: BSD-3-Clause
"""The program `trifinger`, as its users see it: what it prints, and its exit codes."""

import contextlib
import fcntl
import os
import pty
import re
import signal
import socket
import struct
import subprocess
import tempfile
import termios
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import PATIENT_FAKE, PROGRAM, StartChild, StartProgram, diverging_state
from link_into_venv import PROJECTS, ROOT

COMMANDS = (
    "run",
    "list",
    "status",
    "read",
    "record",
    "stop",
    "recover",
    "config",
    "model",
    "doctor",
)
ESCAPE = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


def run(*arguments: str, expect: int = 0, user: int | None = None) -> str:
    """Runs the program to its end, as another user on request; returns all that it printed."""
    result = subprocess.run(
        [PROGRAM, *arguments], capture_output=True, text=True, check=False, user=user
    )
    assert result.returncode == expect, result.stdout + result.stderr
    assert "\x1b" not in result.stdout + result.stderr  # nobody asked for colours
    return result.stdout + result.stderr


class Screen:
    """The program on a terminal with `columns` columns."""

    def __init__(self, columns: int, *arguments: str) -> None:
        self.pid, self.terminal = pty.fork()
        if self.pid == 0:
            fcntl.ioctl(1, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
            os.environ["TERM"] = "xterm"
            os.execv(PROGRAM, [PROGRAM, *arguments])
        self.text = ""

    def wait_for(self, text: str) -> None:
        """Reads until `text` has been shown."""
        while text not in ESCAPE.sub("", self.text):
            self.text += os.read(self.terminal, 4096).decode(errors="replace")

    def press(self, key: str) -> None:
        os.write(self.terminal, key.encode())

    def end(self) -> int:
        """Waits for the end and returns the exit status."""
        try:
            while part := os.read(self.terminal, 4096):
                self.text += part.decode(errors="replace")
        except OSError:
            pass  # the other side has closed the terminal
        os.close(self.terminal)
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])

    def drawn_lines(self) -> list[str]:
        return re.split(r"[\r\n]+", ESCAPE.sub("", self.text))


# ---- usage ----


@pytest.mark.parametrize("command", [*COMMANDS, "model export", "model info"])
def test_every_command_has_help_with_an_example(command: str) -> None:
    assert re.search(
        rf"Example:\n(  .*\n)*  trifinger {command}\b", run(*command.split(), "--help")
    )


def test_the_help_lists_every_command() -> None:
    text = run("--help")
    assert all(re.search(rf"^  {command} ", text, re.MULTILINE) for command in COMMANDS)


def commands_of_packages() -> Iterator[tuple[str, str, str]]:
    """The commands that are written in Python, each with its package and where that is."""
    for path in PROJECTS:
        project = tomllib.loads(path.read_text())["project"]
        folder = path.parent.relative_to(ROOT)
        for program in project.get("scripts", {}):
            if program.startswith("trifinger-") and program != "trifinger-run-policy-of-python":
                verb = program.removeprefix("trifinger-")
                command = re.sub(r"^(log|calibrate)-", r"\1 ", verb)
                yield command, project["name"], f"./{folder}" if folder.parts else "."


COMMANDS_OF_PACKAGES = list(commands_of_packages())
PROGRAMS_OF_PYTHON = [command for command, _, _ in COMMANDS_OF_PACKAGES]


@pytest.mark.parametrize(
    ("command", "package", "folder"), COMMANDS_OF_PACKAGES, ids=PROGRAMS_OF_PYTHON
)
def test_what_is_written_in_python_says_how_to_get_it_where_it_is_missing(
    command: str, package: str, folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    for arguments in ("", "--help", "run --output stop"):
        message = run(*command.split(), *arguments.split(), expect=2)
        assert f"'trifinger {command}' is part of the Python package {package}, " in message
        assert f"'pip install {folder}' in the sources of TriFinger installs it" in message


def test_the_help_tells_what_is_installed_from_what_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "trifinger-compat-check"
    program.write_text("")
    monkeypatch.setenv("PATH", str(tmp_path))
    missing = "Not installed, 'pip install ./packages/trifinger_compat' in the sources of TriFinger"
    assert f"\n{missing} adds them:\n  compat-check " in run("--help")
    program.chmod(0o755)
    assert "\nPython package trifinger-compat:\n  compat-check " in run("--help")


@pytest.mark.parametrize(
    "command", [*PROGRAMS_OF_PYTHON, "endurance", "job", "manipulate", "run-policy"]
)
def test_the_help_lists_programs_of_their_own(command: str) -> None:
    *above, verb = command.split()
    assert re.search(rf"^  {verb}  +\w", run(*above, "--help"), re.MULTILINE)


def test_programs_are_found_beside_this_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert "Usage: trifinger manipulate" in run("manipulate", "--help")
    monkeypatch.delenv("PATH")
    assert "Usage: trifinger run-policy" in run("run-policy", "--help")


def test_the_version_is_that_of_the_package() -> None:
    assert run("--version") == f"trifinger {trifinger.__version__}\n"


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ("lisst", "did you mean 'list'?"),
        ("stat", "did you mean 'status'?"),
        ("run", "ROBOT is required; 'trifinger run --help' tells more"),
        ("run nobody", "there is no configuration 'nobody'; there are .*trifinger_pro"),
        # Versions of CLI11 differ.
        ("run sim --priority 100", r"--priority: Value 100 not in range (1 to 99|\[1 - 99\])"),
        (
            "run sim --scheduling never",
            "--scheduling is 'never', must be 'require', 'try' or 'off'",
        ),
        ("run sim --real-time --non-real-time", "--real-time excludes --non-real-time"),
        ("run sim --set fingers.height=3", "fingers.height is 3 m, must be 0.2 to 0.6 m"),
        ("run sim --set fingers.heigth=0.3", "did you mean 'height'?"),
        ("run fake --set periot=0.01", "periot is not a known key; did you mean 'period'?"),
        ("run fake --name a/b", "'a/b' cannot name a robot"),
        ("read sim --series images", "--series is 'images', must be 'desired_action', "),
        ("read sim 3 --last 5", "--last excludes STEP|STEP excludes --last"),
        ("model export", "--format is required"),
        ("model export --format stl", "--format is 'stl', must be 'mjcf' or 'urdf'"),
        ("model info --finger-height 3", "finger_height.*3.*0.2 to 0.6"),
        (
            "model info --object bal",
            "--object is 'bal', must be 'cube', 'cuboid', 'stick' or 'ball'",
        ),
    ],
)
def test_wrong_usage_names_the_thing_and_what_is_allowed(arguments: str, problem: str) -> None:
    assert re.search(problem, run(*arguments.split(), expect=2))


@pytest.mark.parametrize("command", ["status", "read", "stop", "recover"])
def test_an_unknown_session_is_an_error_that_names_those_there_are(
    command: str, start_fake: StartChild
) -> None:
    start_fake("left")
    message = run(command, "lift", expect=1)
    assert "there is no robot 'lift' on this machine; running: left" in message


def test_an_unknown_verb_is_a_program_on_the_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "trifinger-greet"
    program.write_text('#!/bin/sh\necho "hello $1 $2"\nexit 7\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    assert run("greet", "--to", "you", expect=7) == "hello --to you\n"
    assert "greet" in run("--help")
    assert "did you mean 'greet'?" in run("gret", expect=2)


# ---- run ----


def test_a_robot_is_told_apart_by_its_name_and_says_what_happens_to_late_actions(
    start_program: StartProgram,
) -> None:
    left = start_program("run", "fake", "--name", "left")
    right = start_program("run", "fake", "--name", "right", "--set", "max_repeats=0")
    assert "a late action is repeated at most 100 times in a row" in left.wait_for("real-time mode")
    assert "a late action ends the session with a fault" in right.wait_for("real-time mode")
    left.wait_for("left: holds")
    right.wait_for("right: holds")
    assert [session.name for session in trifinger.list_sessions() if not session.is_companion] == [
        "left",
        "right",
    ]


def test_the_life_of_each_session_is_told(start_program: StartProgram) -> None:
    program = start_program("run", "fake", "--non-real-time")
    program.wait_for("holds its pose")
    for _ in range(2):
        with trifinger.connect("fake") as robot:
            robot.append_desired_actions(np.repeat(robot.new_action(), 30))
            robot.wait_until_time_index(29)
            program.wait_for(f"(process {os.getpid()})")
            robot.finish()
        program.wait_for("the controller finished at step 30")
        program.wait_for("30 steps")
        program.wait_for("holds its pose")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_brings_the_robot_to_rest(
    start_program: StartProgram, number: signal.Signals
) -> None:
    program = start_program("run", "fake")
    program.wait_for("holds its pose")
    status, output = program.end(number)
    assert status == 0
    assert output.endswith("fake: stopped\n")
    assert not any(session.backend_is_alive for session in trifinger.list_sessions())


def test_a_second_signal_kills(start_program: StartProgram) -> None:
    program = start_program("run", "fake", "--set", "stop_periods=1000000")
    program.wait_for("holds its pose")
    program.process.send_signal(signal.SIGINT)
    program.wait_for("comes to rest")
    assert program.end(signal.SIGINT)[0] == -signal.SIGINT
    assert trifinger.list_sessions() == []


def test_a_reader_that_goes_away_does_not_end_the_robot(start_program: StartProgram) -> None:
    program = start_program("run", "fake", *PATIENT_FAKE)
    program.wait_for("holds its pose")
    assert program.process.stdout is not None
    program.process.stdout.close()
    with trifinger.connect("fake") as robot:  # nobody reads what is printed now
        robot.append_desired_action(robot.new_action())
    assert "stopped" in run("stop", "fake")
    assert program.process.wait() == 0


def test_fault_18_two_back_ends_cannot_have_one_name(start_program: StartProgram) -> None:
    program = start_program("run", "fake")
    program.wait_for("holds its pose")
    message = run("run", "fake", expect=1)
    assert f"robot 'fake' is run by trifinger (process {program.process.pid})" in message


def test_what_the_machine_refuses_is_said_or_ends_the_program(start_program: StartProgram) -> None:
    start_program("run", "fake", "--cpu", "1023").wait_for("cannot stay on processor 1023")
    message = run(
        "run", "fake", "--name", "b", "--cpu", "1023", "--scheduling", "require", expect=1
    )
    assert "the machine refuses what real time requires" in message
    assert "cannot stay on processor 1023" in message


@pytest.mark.skipif(not os.access("/dev/cpu_dma_latency", os.W_OK), reason="not allowed here")
@pytest.mark.parametrize(
    ("options", "is_held"),
    [
        (["--real-time"], True),
        (["--real-time", "--let-cpus-sleep"], False),
        (["--real-time", "--scheduling", "off"], False),
        (["--non-real-time"], False),
    ],
)
def test_processors_are_kept_awake_while_a_robot_needs_it(
    start_program: StartProgram, options: list[str], is_held: bool
) -> None:
    program = start_program("run", "fake", *options)
    program.wait_for("holds its pose")
    files = []
    for file in Path(f"/proc/{program.process.pid}/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # the program has closed it meanwhile
            files.append(file.readlink())
    assert (Path("/dev/cpu_dma_latency") in files) == is_held


def may_be_run_by_all(program: Path) -> bool:
    """Whether the user `nobody` can find and start the program."""
    return all(folder.stat().st_mode & 0o001 for folder in (program, *program.parents))


@pytest.mark.skipif(os.geteuid() != 0, reason="only the administrator can become nobody")
def test_fault_58_without_permission_a_robot_runs_and_says_what_to_do(
    start_program: StartProgram, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not may_be_run_by_all(Path(PROGRAM)):
        pytest.skip(f"nobody may not start {PROGRAM}")
    nobody = 65534
    with tempfile.TemporaryDirectory() as folder:
        os.chown(folder, nobody, nobody)
        monkeypatch.setenv("TRIFINGER_SESSION_DIR", folder)
        monkeypatch.setenv("TRIFINGER_LOG_DIR", folder)
        program = start_program("run", "fake", user=nobody)
        lines = program.read_until("holds its pose")
        for problem, remedy in [
            ("no real-time priority 80", "rtprio"),
            ("memory is not locked", "memlock"),
            ("processors may fall asleep", "udev rule"),
        ]:
            assert len([line for line in lines if problem in line and remedy in line]) == 1
        assert program.end()[0] == 0
        message = run("run", "fake", "--scheduling", "require", expect=1, user=nobody)
        assert "the machine refuses what real time requires" in message
        assert "rtprio" in message
        quiet = start_program("run", "fake", "--scheduling", "off", user=nobody)
        assert not [line for line in quiet.read_until("holds its pose") if "allow it" in line]


@pytest.mark.skipif(os.geteuid() != 0, reason="only the administrator can become nobody")
def test_fault_80_a_robot_of_another_user_is_named_with_its_owner_and_the_remedy(
    start_program: StartProgram, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not may_be_run_by_all(Path(PROGRAM)):
        pytest.skip(f"nobody may not start {PROGRAM}")
    nobody = 65534
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o1777)  # as /dev/shm
        monkeypatch.setenv("TRIFINGER_SESSION_DIR", folder)
        monkeypatch.setenv("TRIFINGER_LOG_DIR", folder)
        runs = ("run", "fake", "--name", "x", "--scheduling", "off")

        def tries() -> list[str]:
            commands = [runs, ("stop", "x"), ("recover", "x"), ("status", "x"), ("list",)]
            return [run(*words, expect=int(words != ("list",)), user=nobody) for words in commands]

        robot = start_program(*runs)
        robot.wait_for("holds its pose")
        for text in tries():
            assert "belongs to user root" in text
            assert "its back-end runs" in text
            assert "root can stop it" in text
        robot.process.kill()
        robot.process.wait()
        for text in tries():
            assert "belongs to user root" in text
            assert "was killed" in text
            assert f"'rm {folder}/trifinger.x.*'" in text
        for file in Path(folder).glob("trifinger.x.*"):  # the remedy
            file.unlink()
        # After an orderly end nobody needs one.
        for user in (nobody, None, nobody):
            robot = start_program(*runs, user=user)
            robot.wait_for("holds its pose")
            assert robot.end()[0] == 0
            assert not list(Path(folder).glob("trifinger*"))


def test_fault_18_of_a_robot_in_another_container_nothing_wrong_is_said(
    start_program: StartProgram,
) -> None:
    container = ("unshare", "--pid", "--fork", "--kill-child", "--mount-proc")
    if subprocess.run([*container, "true"], capture_output=True, check=False).returncode != 0:
        pytest.skip("this user may not make namespaces")

    def run_there(*words: str) -> str:
        done = subprocess.run(
            [*container, PROGRAM, *words], capture_output=True, text=True, check=False
        )
        return done.stdout + done.stderr

    start_program("run", "fake", "--name", "x", "--real-time").wait_for("holds its pose")
    status = run_there("status", "x", "--once")
    assert "not known here: the back-end runs in another container" in status
    assert "none, other programs may be first" not in status
    text = run_there("stop", "x")
    assert "call 'trifinger stop x' in that container" in text
    assert "already gone" not in text
    # It was left alone.
    assert "holding" in run("status", "x", "--once")


def test_fault_59_a_mistake_in_a_file_is_named_with_its_place(tmp_path: Path) -> None:
    file = tmp_path / "robot.yml"
    file.write_text("name: robot\ndriver: simulation\nrobot:\n  variant: edu2\n")
    assert f"{file}:4:12: robot.variant is 'edu2'" in run("run", str(file), expect=1)


def test_fault_60_a_configuration_that_changes_while_the_robot_runs_changes_nothing(
    start_program: StartProgram, tmp_path: Path
) -> None:
    file = tmp_path / "trifinger_edu.yml"
    text = (ROOT / "config" / file.name).read_text()
    height = "height: 0.283"
    assert text.count(height) == 1
    file.write_text(text)
    logs = tmp_path / "recorded"
    program = start_program(
        *("run", str(file), "--name", "robot", "--non-real-time", "--record", str(logs))
    )
    program.wait_for("holds its pose")
    for change in (
        text.replace(height, "height: 0.35"),
        "this is: [no configuration",
        None,
    ):
        if change is None:
            file.unlink()
        else:
            file.write_text(change)
        with trifinger.connect("robot") as robot:
            robot.append_desired_action(robot.new_action())
            robot.finish()
        program.wait_for("the controller finished")
        program.wait_for("holds its pose")
    assert program.end()[0] == 0
    sessions = [session for session in trifinger.Log(logs).sessions if session.steps]
    assert len(sessions) == 3
    for session in sessions:
        assert height in session.documents["configuration.yml"]
        assert session.documents == sessions[0].documents


def test_a_simulated_robot_runs_with_its_objects(start_program: StartProgram) -> None:
    program = start_program("run", "sim", "--non-real-time", "--set", "fingers.height=0.3")
    program.wait_for("holds its pose")
    with trifinger.connect("sim") as robot:
        action = robot.new_action(position=robot.latest_observation().position)
        robot.append_desired_actions(np.repeat(action, 101))
        robot.wait_until_time_index(100)
        assert "trifinger" in run("list")
        assert re.search(r"arrival_index +100\n", run("read", "sim.object"))
    assert program.end()[0] == 0


# ---- run: divergence ----


@pytest.mark.parametrize("mode", ["--real-time", "--non-real-time"])
def test_fault_61_a_divergence_leaves_the_state_before_in_a_file_to_begin_in(
    start_program: StartProgram, tmp_path: Path, log_folder: Path, mode: str
) -> None:
    state = tmp_path / "start.state"
    state.write_bytes(diverging_state())
    for _ in range(2):  # the second run starts with the files that the first left
        program = start_program("run", "sim", mode, "--state", str(state))
        if mode == "--non-real-time":  # in real time it diverges while the robot holds its pose
            program.wait_for("holds its pose")
            robot = trifinger.connect("sim")
            robot.append_desired_action(robot.new_action())
        program.wait_for("the simulation diverged")
        line = program.wait_for("the state before the divergence is in ")
        state = Path(line.split(" is in ")[1].rstrip("\n"))
        assert program.end()[0] == 0
        assert re.fullmatch(r"sim_[\d-]{10}_[\d-]{8}\.\d{3}_fault\.state", state.name)
        assert state.parent == log_folder
    assert len(list(log_folder.glob("*.state"))) == 2


def test_a_state_that_cannot_be_saved_is_said(
    start_program: StartProgram, tmp_path: Path, log_folder: Path
) -> None:
    state = tmp_path / "start.state"
    state.write_bytes(diverging_state())
    log_folder.write_text("no folder")
    program = start_program("run", "sim", "--state", str(state))
    line = program.wait_for("the state before the divergence could not be saved: ")
    assert f"use {log_folder} as folder for logs: Not a directory" in line
    assert program.end()[0] == 0


@pytest.mark.parametrize(
    ("content", "arguments", "problem"),
    [
        (b"text", "sim", "file.state: this is not the saved state of a simulation"),
        (None, "sim", "open .*file.state: No such file"),
        (b"", "fake", "--state is for simulations"),
    ],
)
def test_a_state_to_begin_in_must_be_one(
    tmp_path: Path, content: bytes | None, arguments: str, problem: str
) -> None:
    file = tmp_path / "file.state"
    if content is not None:
        file.write_bytes(content)
    expect = 1 if content is None else 2
    assert re.search(problem, run("run", arguments, "--state", str(file), expect=expect))


def test_a_state_of_another_model_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "file.state"
    file.write_bytes(trifinger.Simulation().save())
    message = run("run", "sim", "--state", str(file), "--set", "objects=[]", expect=2)
    assert f"{file}: this state was saved from another model" in message


# ---- looking at sessions ----


def test_nothing_is_listed_where_nothing_runs(session_folder: Path) -> None:
    assert (
        run("list") == f"There is no session in {session_folder}; 'trifinger run sim' starts one.\n"
    )


def test_sessions_are_listed_with_who_is_who(start_foreign: StartChild) -> None:
    child = start_foreign("odd", "cart")
    header, robot, companion = run("list").splitlines()
    assert header.split() == ["NAME", "STATE", "RATE", "STEPS", "TYPE", "BACK-END", "CONTROLLER"]
    assert re.fullmatch(rf"cart +holding +- +0 +odd +\S+ \(process {child.pid}\) +nobody", robot)
    assert re.match(r"cart.lamp +holding +- +0 +odd_lamp ", companion)
    with trifinger.connect("cart") as cart:
        cart.wait_until_time_index(cart.append_desired_action(cart.new_action()))
        assert re.search(rf"^cart +running .*\(process {os.getpid()}\)$", run("list"), re.MULTILINE)


def test_fault_28_a_dead_back_end_is_called_dead(start_fake: StartChild) -> None:
    child = start_fake("robot")
    child.kill()
    assert re.search(r"^robot +dead +- ", run("list"), re.MULTILINE)
    assert "the back-end died" in run("status", "robot")
    assert run("stop", "robot") == "robot: its back-end is already gone.\n"
    assert "the back-end died" in run("recover", "robot", expect=1)


@pytest.mark.slow
def test_a_stopped_back_end_is_called_silent(start_program: StartProgram) -> None:
    program = start_program("run", "fake")
    program.wait_for("holds its pose")
    program.process.send_signal(signal.SIGSTOP)
    while "silent for" not in run("list"):
        pass
    assert "silent for" in run("status", "fake")


def test_fault_58_the_status_says_whether_the_loop_has_priority(
    start_program: StartProgram,
) -> None:
    none = "priority    none, other programs may be first; see 'trifinger doctor'"
    start_program("run", "fake", "--name", "a", "--scheduling", "off").wait_for("holds its pose")
    assert none in run("status", "a", "--once")
    program = start_program("run", "fake", "--name", "b", "--priority", "7")
    is_refused = any(
        "no real-time priority 7" in line for line in program.read_until("holds its pose")
    )
    status = run("status", "b", "--once")
    assert (none if is_refused else "priority    SCHED_FIFO 7\n") in status


@pytest.mark.parametrize(
    ("options", "warnings"),
    [
        (["--scheduling", "off"], ["no real-time settings were asked for"]),
        (["--cpu", "1023"], ["cannot stay on processor 1023"]),
        (["--non-real-time"], []),
    ],
)
def test_fault_58_what_a_loop_lacks_is_in_its_status_and_its_log(
    options: list[str], warnings: list[str], start_program: StartProgram, tmp_path: Path
) -> None:
    words = (*options, *PATIENT_FAKE, "--record", str(tmp_path))
    program = start_program("run", "fake", *words)
    program.wait_for("holds its pose")
    with trifinger.connect("fake") as robot:
        robot.wait_until_time_index(robot.append_desired_action(robot.new_action()) + 1)
        found = robot.session_info().realtime_warnings
    is_real_time = "--non-real-time" not in options
    for sentence in warnings:
        assert any(sentence in line for line in found)
    status = run("status", "fake", "--once")
    assert ("realtime" in status) == is_real_time
    program.end()
    info = run("log", "info", str(tmp_path))
    session = trifinger.Log(tmp_path).sessions[0]
    if is_real_time:
        assert f"realtime    no: {found[0]}" in status
        assert f"realtime    no: {found[0]}" in info
        assert tuple(session.realtime_warnings or ()) == found
    else:
        assert "realtime" not in info
        assert session.realtime_warnings is None


def test_the_status_counts_what_the_back_end_has_noted(start_program: StartProgram) -> None:
    start_program("run", "fake", *PATIENT_FAKE).wait_for("holds its pose")
    with trifinger.connect("fake") as robot:
        t = robot.append_desired_action(robot.new_action())
        robot.wait_until_time_index(t + 50)
        status = run("status", "fake")
    assert int(re.search(r"repeats +\d+ in the last second, (\d+) since step 0", status)[1]) >= 49
    assert re.search(r"lateness +p50 \d.*, p99 \d.*, max \d", status)
    assert re.search(r"since 0 +p50 \d.*, p99 \d.*, max \d", status)
    assert re.search(r"in time +\d+\.\d % of the last \d+ steps", status)
    assert re.search(r"late +\d+ of \d+ steps were late \((user|scheduler)", status)
    assert re.search(r"worst +step \d+ by \d.* \((user|scheduler|driver)\)", status)
    assert re.search(r"rate +\d+ Hz", status)
    assert re.search(r"mode +real-time, 1000 Hz", status)


def test_a_fault_is_shown_with_its_remedy_which_works(start_program: StartProgram) -> None:
    program = start_program("run", "fake", *PATIENT_FAKE, "--set", "max_repeats=0")
    program.wait_for("holds its pose")
    assert "there is nothing to recover from, it is holding" in run("recover", "fake")
    robot = trifinger.connect("fake")
    t = robot.append_desired_action(robot.new_action())
    with pytest.raises(trifinger.RobotStopped, match="was not there in time"):
        robot.get_observation(t + 2)
    program.wait_for("waits for 'trifinger recover fake'")
    assert "fault: action_late" in run("list")
    assert re.search(r"end +the action for step \d+ was not there in time", run("status", "fake"))
    assert "remedy      trifinger recover fake\n" in run("status", "fake.sensor")
    assert "recovered; now " in run("recover", "fake")
    program.wait_for("holds its pose")


def test_companions_have_no_life_of_their_own(start_fake: StartChild) -> None:
    start_fake("robot", sensor_period=1)
    for command in ("stop", "recover"):
        assert "name the robot" in run(command, "robot.sensor", expect=2)


def test_stop_waits_until_the_back_end_is_gone(start_program: StartProgram) -> None:
    program = start_program("run", "fake", "--set", "stop_periods=200")
    program.wait_for("holds its pose")
    assert run("stop", "fake") == f"fake: stopped trifinger (process {program.process.pid}).\n"
    assert not any(session.backend_is_alive for session in trifinger.list_sessions())
    assert program.process.wait() == 0


# ---- on a terminal ----


def test_the_status_is_live_on_a_terminal_until_ctrl_c(start_fake: StartChild) -> None:
    start_fake("robot")
    screen = Screen(80, "status", "robot")
    screen.wait_for("holding")
    with trifinger.connect("robot") as robot:
        robot.wait_until_time_index(robot.append_desired_action(robot.new_action()))
        screen.wait_for("running")
    screen.wait_for("holding")
    screen.press("\x03")
    assert screen.end() == 0


@pytest.mark.parametrize("columns", [20, 40, 80])
def test_live_lines_fit_in_the_window(start_fake: StartChild, columns: int) -> None:
    start_fake("a_robot_with_a_long_name")
    with trifinger.connect("a_robot_with_a_long_name") as robot:
        robot.wait_until_time_index(robot.append_desired_action(robot.new_action()))
        screen = Screen(columns, "status", "a_robot_with_a_long_name")
        screen.wait_for("Ctrl-C leaves")
        screen.press("\x03")
        assert screen.end() == 0
    assert max(map(len, screen.drawn_lines())) <= columns


def test_a_running_back_end_has_one_line_on_a_terminal() -> None:
    screen = Screen(100, "run", "fake", *PATIENT_FAKE)
    screen.wait_for("fake: holds")
    with trifinger.connect("fake") as robot:
        for _ in range(50):
            robot.wait_until_time_index(robot.append_desired_action(robot.new_action()))
        screen.wait_for("running  ")
        screen.wait_for("repeats")
    screen.press("\x03")
    assert screen.end() == 0
    lines = screen.drawn_lines()
    assert max(map(len, lines)) <= 100
    assert "fake: stopped" in lines


def test_colours_are_for_terminals_and_can_be_refused(
    start_fake: StartChild, monkeypatch: pytest.MonkeyPatch
) -> None:
    start_fake("robot")
    colour = re.compile(r"\x1b\[[0-9;]+m")
    screen = Screen(80, "list")
    assert screen.end() == 0
    assert colour.search(screen.text)
    monkeypatch.setenv("NO_COLOR", "1")
    screen = Screen(80, "list")
    assert screen.end() == 0
    assert "robot" in screen.text
    assert not colour.search(screen.text)


# ---- read ----


def test_elements_of_an_unknown_robot_are_read_by_their_description(
    start_foreign: StartChild,
) -> None:
    start_foreign("odd", "cart")
    with trifinger.connect("cart") as cart:
        for k in range(20):
            action = cart.new_action(speed=[0.1 * k, -k], gear=[k, 2])
            t = cart.append_desired_action(action)
        cart.wait_until_time_index(t + 1)
        observations = cart.get_observations(11, 21)
        header, *rows = run("read", "cart", "--last", "10", "--csv").splitlines()
        table = np.array([row.split(",") for row in rows])
        element = run("read", "cart", "12", "--series", "desired_action")

    assert header == (
        "time_index,left.angle,left.speed,right.angle,right.speed,"
        "gears[0][0],gears[0][1],gears[1][0],gears[1][1]"
    )
    assert table[:, 0].tolist() == [str(t) for t in range(11, 21)]
    assert table[:, 3].astype(np.float32).tolist() == observations["right"]["angle"].tolist()
    assert table[:, 5].astype(int).tolist() == observations["gears"][:, 0, 0].tolist()
    assert element == (
        "cart desired_action 12\n  speed   1.2 -12 rad/s\n  gear    12 2\n  colour  0\n"
    )


def test_the_fields_of_a_session_can_be_printed(start_foreign: StartChild) -> None:
    start_foreign("odd", "cart")
    assert run("read", "cart", "--fields", "--series", "desired_action") == (
        "speed float32[2] rad/s\ngear int8[2]\ncolour uint16\n"
    )


def test_steps_that_cannot_be_read_are_named(start_fake: StartChild) -> None:
    start_fake("robot", history=16)
    assert "has no observation yet, it is holding" in run("read", "robot", expect=1)
    assert run("read", "robot", "--series", "holding").startswith("robot holding 0\n")
    with trifinger.connect("robot") as robot:
        for _ in range(30):
            t = robot.append_desired_action(robot.new_action())
        robot.wait_until_time_index(t + 1)
        assert "step 31 has not come yet: the newest observation of 'robot' is 30" in run(
            "read", "robot", "31", expect=1
        )
        assert "step 14 has been overwritten; the oldest step still kept is 15" in run(
            "read", "robot", "14", expect=1
        )


def test_fault_28_the_last_session_of_a_dead_back_end_can_be_read(start_fake: StartChild) -> None:
    child = start_fake("robot")
    robot = trifinger.connect("robot")
    robot.get_applied_action(robot.append_desired_action(robot.new_action(setpoint=2.5)))
    child.kill()
    assert "setpoint  2.5\n" in run("read", "robot", "--series", "applied_action")


# ---- model ----


def test_an_exported_scene_is_one_that_mujoco_can_read(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    file = tmp_path / "scene.xml"
    run(
        "model",
        "export",
        "--format",
        "mjcf",
        "--variant",
        "pro",
        "--object",
        "ball",
        "-o",
        str(file),
    )
    model = mujoco.MjModel.from_xml_path(str(file))
    assert model.nu == 9
    assert model.body("ball").id > 0


def test_an_exported_urdf_has_the_joints_that_info_names() -> None:
    robot = ET.fromstring(run("model", "export", "--format", "urdf", "--single-finger"))  # noqa: S314
    moving = [joint.get("name") for joint in robot.iter("joint") if joint.get("type") == "revolute"]
    joints = re.search(r"^joints +(.*)$", run("model", "info", "--single-finger"), re.MULTILINE)
    assert joints is not None
    assert sorted(joints[1].split()) == sorted(str(name) for name in moving)


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    file = tmp_path / "nowhere" / "robot.urdf"
    message = run("model", "export", "--format", "urdf", "-o", str(file), expect=1)
    assert f"write {file}: No such file or directory" in message


# ---- doctor ----

# A machine with all that real time needs.
GOOD_MACHINE = {
    "proc/version": "Linux version 6.1.0-rt (gcc) #1 SMP PREEMPT_RT Debian",
    "proc/sys/kernel/osrelease": "6.1.0-rt",
    "proc/self/status": "Name:\ttrifinger\nCapEff:\t0000000000000000\n",
    "proc/self/limits": (
        "Limit                     Soft Limit           Hard Limit           Units\n"
        "Max locked memory         unlimited            unlimited            bytes\n"
        "Max realtime priority     99                   99\n"
    ),
    "proc/stat": "cpu  1000 0 1000 100000 0 0 0 0 0 0\n",
    "proc/sys/fs/protected_regular": "2",
    "proc/sys/kernel/sched_rt_runtime_us": "-1",
    "proc/sys/kernel/sched_rt_period_us": "1000000",
    "proc/irq/24/smp_affinity_list": "0-2",
    "proc/irq/default_smp_affinity": "7",
    "proc/1/comm": "systemd",
    "sys/devices/system/cpu/isolated": "3",
    "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor": "performance",
    "sys/devices/system/clocksource/clocksource0/current_clocksource": "tsc",
    "dev/shm/.keep": "",
    "dev/cpu_dma_latency": "",
}


def examine(folder: Path, changes: dict[str, str], expect: int) -> str:
    for path, text in (GOOD_MACHINE | changes).items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text + "\n")
    return run("doctor", "--root", str(folder), expect=expect)


def test_the_doctor_finds_nothing_on_a_good_machine(tmp_path: Path) -> None:
    report = examine(tmp_path, {}, expect=0)
    assert "note" not in report
    assert "fails" not in report


def test_the_page_on_real_time_turns_every_line_of_the_doctor_green(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "real_time.md").read_text()
    lines = re.findall(r"^ok +(\S.*?) {2,}", examine(tmp_path, {}, expect=0), re.MULTILINE)
    assert len(lines) == 12
    assert [line for line in lines if f"`{line}`" not in page] == []


@pytest.mark.parametrize(
    ("path", "text", "what", "remedy"),
    [
        ("proc/version", "Linux version 6.1.0 #1 SMP", "kernel", "linux-image-rt-amd64"),
        (
            "proc/self/limits",
            "Max locked memory  unlimited  unlimited  bytes\nMax realtime priority  0  0",
            "real-time priority",
            "rtprio 99",
        ),
        (
            "proc/self/limits",
            "Max locked memory  8388608  8388608  bytes\nMax realtime priority  99  99",
            "locked memory",
            "memlock unlimited",
        ),
        (
            "sys/devices/system/cpu/cpu1/cpufreq/scaling_governor",
            "powersave",
            "frequency governor",
            "cpupower frequency-set",
        ),
        ("proc/stat", "cpu  1000 0 1000 1000 0 0 0 500 0 0", "stolen time", "hypervisor"),
        (
            "proc/sys/kernel/sched_rt_runtime_us",
            "0",
            "real-time throttling",
            "sched_rt_runtime_us=-1",
        ),
    ],
)
def test_the_doctor_tells_what_is_lacking_and_the_remedy(
    tmp_path: Path, path: str, text: str, what: str, remedy: str
) -> None:
    report = examine(tmp_path, {path: text}, expect=1)
    assert re.search(rf"^fails  {what} .*\n +.*{remedy}", report, re.MULTILINE)
    assert "fails 1 of 12 checks" in report


@pytest.mark.parametrize(
    ("path", "text", "what", "remedy"),
    [
        ("proc/version", "Linux version 6.1.0 #1 SMP PREEMPT_DYNAMIC", "kernel", "PREEMPT_RT"),
        ("sys/devices/system/cpu/isolated", "", "isolated processors", "isolcpus=N"),
        (
            "sys/devices/system/clocksource/clocksource0/current_clocksource",
            "hpet",
            "clock source",
            "tsc=reliable",
        ),
        ("proc/sys/fs/protected_regular", "0", "fs.protected_regular", "protected_regular=2"),
        ("proc/irq/24/smp_affinity_list", "0-3", "interrupts", "irqaffinity=M"),
        ("proc/irq/24/smp_affinity_list", "3", "interrupts", "smp_affinity_list"),
        ("proc/77/comm", "irqbalance", "interrupts", "BANNED_CPULIST=3"),
        (
            "proc/sys/kernel/sched_rt_runtime_us",
            "950000",
            "real-time throttling",
            "sched_rt_runtime_us=-1",
        ),
    ],
)
def test_what_could_be_better_is_no_failure(
    tmp_path: Path, path: str, text: str, what: str, remedy: str
) -> None:
    report = examine(tmp_path, {path: text}, expect=0)
    assert re.search(rf"^note   {what} .*\n +.*{remedy}", report, re.MULTILINE)


def test_processors_that_cannot_be_kept_awake_are_noted(tmp_path: Path) -> None:
    examine(tmp_path, {}, expect=0)
    (tmp_path / "dev" / "cpu_dma_latency").unlink()
    report = run("doctor", "--root", str(tmp_path))
    assert re.search(r"^note   processor sleep .*\n +.*--device", report, re.MULTILINE)


@pytest.mark.parametrize("isolated", ["3", "2-3", "0,3"])
def test_only_interrupts_on_isolated_processors_disturb(tmp_path: Path, isolated: str) -> None:
    changes = {
        "sys/devices/system/cpu/isolated": isolated,
        "proc/irq/24/smp_affinity_list": "1",
        "proc/irq/25/smp_affinity_list": "1,4-7",
    }
    assert "note" not in examine(tmp_path, changes, expect=0)


def test_capabilities_stand_above_limits(tmp_path: Path) -> None:
    changes = {
        "proc/self/status": "CapEff:\t0000000000804000",
        "proc/self/limits": "Max locked memory  0  0  bytes\nMax realtime priority  0  0",
    }
    report = examine(tmp_path, changes, expect=0)
    assert "CAP_SYS_NICE" in report
    assert "CAP_IPC_LOCK" in report


def can_lines(report: str) -> list[str]:
    """What the report says of CAN and boards, each finding with its remedy in one line."""
    joined = re.sub(r"\n {20,}", " ", report)
    return re.findall(r"^\S+ +(?:CAN interface|motor boards) .*", joined, re.MULTILINE)


def has_can() -> bool:
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except OSError:
        return False
    return True


def examine_robot(*arguments: str) -> list[str]:
    result = subprocess.run(
        [PROGRAM, "doctor", *arguments], capture_output=True, text=True, check=False
    )
    assert result.returncode == (1 if "fails" in result.stdout else 0), result.stderr
    return can_lines(result.stdout)


@pytest.mark.slow
def test_the_doctor_hears_whether_emulated_boards_are_on(start_program: StartProgram) -> None:
    robot = "trifinger_edu_emulated"
    silent = (
        r"fails +motor boards +none answers on can0, can1, can2, can3, can4, can5 "
        f"start them: trifinger emulate {robot}"
    )
    [line] = examine_robot(robot)
    assert re.fullmatch(silent, line)
    boards = start_program("emulate", robot, "--name", "mine")
    boards.wait_for("6 emulated boards are on")
    [line] = examine_robot(robot, "--name", "mine")
    assert re.fullmatch(r"ok +motor boards +6 answer", line)
    [line] = examine_robot(robot)  # the boards of another robot do not count
    assert re.fullmatch(silent, line)
    # What a killed emulator leaves behind answers nothing.
    boards.end(signal.SIGKILL)
    [line] = examine_robot(robot, "--name", "mine")
    assert re.fullmatch(silent, line)


def test_the_doctor_names_every_interface_that_a_robot_lacks() -> None:
    interfaces = [f"no-can{i}" for i in range(6)]
    lines = examine_robot(
        "trifinger_edu_can", "--set", f"boards.interfaces=[{', '.join(interfaces)}]"
    )
    if not has_can():
        [line] = lines
        assert "this process gets no CAN sockets" in line
        assert "modprobe can_raw" in line
        return
    assert len(lines) == 6
    for line, interface in zip(lines, interfaces, strict=True):
        assert f"there is no network interface '{interface}'" in line


def test_the_doctor_asks_for_no_can_unless_a_robot_needs_it() -> None:
    assert examine_robot("sim") == []


def test_the_doctor_refuses_an_interface_that_is_used_twice() -> None:
    report = run(
        "doctor", "trifinger_edu_can", "--set", "boards.interfaces=[a, b, c, d, e, e]", expect=1
    )
    assert "are both on e" in report


def test_interfaces_of_a_robot_are_not_in_a_copy_of_files(tmp_path: Path) -> None:
    assert "excludes" in run("doctor", "sim", "--root", str(tmp_path), expect=2)
