# SPDX-License-Identifier: BSD-3-Clause
"""However a program ends, the robot comes to rest or holds, and everything is written."""

import contextlib
import os
import random
import signal
import socket
import stat
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import PATIENT_FAKE, PROGRAM, StartChild, StartProgram
from test_processes import step


def log_of(folder: Path) -> trifinger.LoggedSession:
    """The recorded session that has steps. `trifinger log check` must find nothing wrong."""
    subprocess.run([PROGRAM, "log", "check", str(folder)], check=True, capture_output=True)
    return trifinger.Log(folder).session("fake")


# ---- the back-end is told to end ----


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("mode", ["--real-time", "--non-real-time"])
def test_fault_69_a_signal_ends_everything_in_order(
    start_program: StartProgram, tmp_path: Path, mode: str, number: signal.Signals
) -> None:
    folder = tmp_path / "recording"
    program = start_program("run", "fake", mode, *PATIENT_FAKE, "--record", str(folder))
    program.wait_for("holds its pose")
    robot = trifinger.connect("fake")
    for k in range(100):
        last = step(robot, k)
    status, output = program.end(number)
    assert status == 0
    assert output.endswith("fake: stopped\n")

    # The user gets an error, and the last status has the reason.
    with pytest.raises(trifinger.RobotStopped, match="was asked to stop") as raised:
        robot.get_observation(1_000_000_000)
    fault = raised.value.fault
    assert fault is not None
    assert (fault.code, fault.needs_recovery) == ("stopped", False)
    assert fault.time_index >= last
    end = robot.get_status(fault.time_index)
    assert end.flags & trifinger.Status.END
    # The log holds everything that the robot did, to the last step.
    log = log_of(folder)
    assert log.fault == fault
    assert np.array_equal(
        log.desired_actions["setpoint"],
        robot.get_desired_actions(0, fault.time_index)["setpoint"],
    )
    assert not any(session.backend_is_alive for session in trifinger.list_sessions())


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_fault_69_a_robot_that_waits_for_recovery_ends_as_well(
    start_program: StartProgram, number: signal.Signals
) -> None:
    program = start_program("run", "fake", *PATIENT_FAKE, "--set", "fault_after=5")
    program.wait_for("waits for 'trifinger recover fake'")
    assert program.end(number)[0] == 0


def test_fault_69_a_terminal_that_is_closed_ends_the_robot_in_order(tmp_path: Path) -> None:
    # Like a shell, the program leads the session of a terminal, which then hangs up.
    shown, terminal = os.openpty()
    script = "import os, sys; os.setsid(); import fcntl, termios; "
    script += "fcntl.ioctl(0, termios.TIOCSCTTY, 0); os.execv(sys.argv[1], sys.argv[1:])"
    folder = tmp_path / "recording"
    words = ("run", "fake", *PATIENT_FAKE, "--record", str(folder))
    process = subprocess.Popen(
        [sys.executable, "-c", script, PROGRAM, *words],
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
    )
    os.close(terminal)
    text = ""
    while "holds" not in text:
        text += os.read(shown, 4096).decode(errors="replace")
    robot = trifinger.connect("fake")
    step(robot)
    os.close(shown)
    with pytest.raises(trifinger.RobotStopped, match="was asked to stop"):
        robot.get_observation(1_000_000_000)
    assert process.wait() == 0
    assert log_of(folder).fault == robot.fault()


# ---- the user's program ends ----

LOOP = """
import os, signal, sys, trifinger
def run():
    with trifinger.connect("robot") as robot:
        t = robot.append_desired_action(robot.new_action())
        print("ready", flush=True)
        while True:
            y = robot.get_observation(t)
            if t == 50:
                {end}
            t = robot.append_desired_action(robot.new_action(setpoint=t))
run()
"""


@pytest.mark.parametrize(
    ("end", "status", "said", "reason"),
    [
        ("raise KeyError('mine')", 1, "KeyError: 'mine'", "detached"),
        ("raise KeyboardInterrupt", -signal.SIGINT, "KeyboardInterrupt", "detached"),
        (
            "signal.raise_signal(signal.SIGINT)",
            -signal.SIGINT,
            "Interrupt",
            "detached",
        ),
        ("sys.exit(3)", 3, "", "detached"),
        ("return", 0, "", "finished"),
        ("os._exit(4)", 4, "", "controller_died"),
        ("signal.raise_signal(signal.SIGTERM)", -signal.SIGTERM, "", "controller_died"),
        ("os.abort()", -signal.SIGABRT, "", "controller_died"),
    ],
)
def test_fault_63_however_a_control_loop_ends_the_robot_is_there_for_the_next(
    start_fake: StartChild,
    start_python: StartChild,
    end: str,
    status: int,
    said: str,
    reason: str,
) -> None:
    start_fake("robot")
    observer = trifinger.observe("robot")
    loop = start_python(LOOP.format(end=end))
    result, output = loop.finish()
    assert result == status
    assert said in output
    with pytest.raises(trifinger.RobotStopped) as raised:
        observer.get_observation(1000)
    fault = raised.value.fault
    assert fault is not None
    assert (fault.code, fault.needs_recovery) == (reason, False)
    # Before the end, only an action that nobody had waited for can be lost. After it, the robot
    # holds until somebody acts.
    assert fault.time_index in ([51] if reason == "finished" else [50, 51])
    with trifinger.connect("robot") as robot:
        robot.latest_observation()  # waits until it holds
        assert trifinger.list_sessions()[0].phase == "holding"
        assert step(robot) == 0


@pytest.mark.slow
def test_fault_63_ctrl_c_at_any_line_lets_go_of_the_robot(
    start_fake: StartChild, start_python: StartChild
) -> None:
    start_fake("robot", real_time=True, max_skipped_ticks=1_000_000, max_action_repeats=1_000_000)
    dice = random.Random(1)  # noqa: S311
    for _ in range(10):
        loop = start_python(LOOP.format(end="pass"))
        observer = trifinger.observe("robot")
        # The signal comes at a random instant, because it may come at any line.
        time.sleep(dice.uniform(0.0, 0.02))
        os.kill(loop.pid, signal.SIGINT)
        assert loop.finish()[0] == -signal.SIGINT
        with pytest.raises(trifinger.RobotStopped) as raised:
            observer.get_observation(1_000_000_000)
        fault = raised.value.fault
        assert fault is not None
        assert fault.code == "detached"
    with trifinger.connect("robot") as robot:
        assert step(robot) == 0


def test_fault_63_a_program_that_forgets_its_handle_lets_go_at_its_end(
    start_fake: StartChild, start_python: StartChild
) -> None:
    start_fake("robot")
    observer = trifinger.observe("robot")
    program = start_python(
        """
import trifinger
robot = trifinger.connect("robot")
robot.wait_until_time_index(robot.append_desired_action(robot.new_action()))
print("ready", flush=True)
"""
    )
    assert program.finish() == (0, "")
    with pytest.raises(trifinger.RobotStopped, match=r"let go .* without finish\(\)"):
        observer.get_observation(1000)
    with trifinger.connect("robot") as robot:
        assert step(robot) == 0


RECORDED = """
import signal, sys, trifinger
with trifinger.simulate(record=sys.argv[1]) as robot:
    t = robot.append_desired_action(robot.new_action())
    print("ready", flush=True)
    while True:
        y = robot.get_observation(t)
        if t == 50:
            {end}
        t = robot.append_desired_action(robot.new_action())
"""


@pytest.mark.parametrize(
    "end", ["raise KeyError", "signal.raise_signal(signal.SIGINT)", "sys.exit()"]
)
def test_fault_63_however_a_simulation_ends_its_log_is_finished(
    start_python: StartChild, tmp_path: Path, end: str
) -> None:
    start_python(RECORDED.format(end=end), str(tmp_path / "log")).finish()
    log = trifinger.Log(tmp_path / "log")
    assert log.is_finished
    assert not log.damage
    assert log.session().time_index.tolist() == list(range(log.session().steps or 0))
    assert len(log.session().time_index) in (50, 51)
    fault = log.session().fault
    assert fault is not None
    assert fault.code == "detached"


# ---- nothing listens on the network ----


def sockets_of(pid: int) -> list[int]:
    """The families of all sockets of a process, in the order of its descriptors."""
    listed: dict[str, int] = {}
    for table, family, place in [
        ("tcp", socket.AF_INET, 9),
        ("tcp6", socket.AF_INET6, 9),
        ("udp", socket.AF_INET, 9),
        ("udp6", socket.AF_INET6, 9),
        ("raw", socket.AF_INET, 9),
        ("raw6", socket.AF_INET6, 9),
        ("unix", socket.AF_UNIX, 6),
    ]:
        file = Path(f"/proc/{pid}/net/{table}")
        for line in file.read_text().splitlines()[1:] if file.exists() else []:
            listed[line.split()[place]] = family
    families = []
    for descriptor in Path(f"/proc/{pid}/fd").iterdir():
        # The descriptor of this listing itself is closed by now.
        with contextlib.suppress(FileNotFoundError):
            status = descriptor.stat()
            if stat.S_ISSOCK(status.st_mode):
                # A socket in no table is of a family that no process here should use: -1.
                families.append(listed.get(str(status.st_ino), -1))
    return families


def test_an_open_port_would_be_found() -> None:
    with socket.create_server(("127.0.0.1", 0)):
        assert socket.AF_INET in sockets_of(os.getpid())


def test_fault_68_nothing_listens_on_the_network(
    start_program: StartProgram, tmp_path: Path
) -> None:
    program = start_program("run", "sim", "--real-time", "--record", str(tmp_path / "recording"))
    program.wait_for("holds its pose")
    robot = trifinger.connect("sim")
    # A slow machine may end this session, which does not matter here.
    robot.append_desired_action(robot.new_action(position=robot.latest_observation().position))
    pid = program.process.pid
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    assert children, "the recorder is a process of its own"
    for process in [pid, *map(int, children)]:
        assert sockets_of(process) == []
