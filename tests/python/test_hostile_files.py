# SPDX-License-Identifier: BSD-3-Clause
"""Foreign files, links and FIFOs in the places of our files: no command hangs."""

import os
import re
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
import trifinger
from conftest import PROGRAM, StartChild, StartProgram


def run(*arguments: str, expect: int) -> str:
    """Runs the program to its end and returns all that it printed. pytest ends a hang."""
    result = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False)
    assert result.returncode == expect, result.stdout + result.stderr
    return result.stdout + result.stderr


def put_fifo(path: Path) -> None:
    os.mkfifo(path)


def put_link_to_fifo(path: Path) -> None:
    os.mkfifo(path.parent / "pipe")
    path.symlink_to("pipe")


def put_folder(path: Path) -> None:
    path.mkdir()


def put_link_to_device(path: Path) -> None:
    path.symlink_to("/dev/zero")


THINGS = [
    (put_fifo, "a FIFO"),
    (put_link_to_fifo, "a symbolic link"),
    (put_folder, "a folder"),
    (put_link_to_device, "a symbolic link"),
]
things = pytest.mark.parametrize(
    ("put", "what"), THINGS, ids=[what.split()[-1] + "_" + put.__name__ for put, what in THINGS]
)
Put = Callable[[Path], None]


@things
def test_fault_73_no_command_waits_for_what_is_no_session(
    session_folder: Path, start_fake: StartChild, put: Put, what: str
) -> None:
    put(session_folder / "trifinger.x.state")
    start_fake("robot")
    assert re.search("^robot ", run("list", expect=0), re.MULTILINE)
    assert "running: robot" in run("status", "missing", expect=1)
    for command in ("status", "stop", "recover", "read"):
        text = run(command, "x", expect=1)
        assert f"trifinger.x.state, which is {what} of user " in text
    with pytest.raises(OSError, match=what):
        trifinger.connect("x", timeout=1.0)
    with pytest.raises(trifinger.SessionNotFound, match="running: robot"):
        trifinger.connect("missing", timeout=1.0)


@things
def test_fault_73_no_backend_waits_for_what_is_no_lock(
    session_folder: Path, put: Put, what: str
) -> None:
    put(session_folder / "trifinger.x.lock")
    text = run("run", "fake", "--name", "x", expect=1)
    assert f"trifinger.x.lock, which is {what} of user " in text
    assert "remove it, or choose another name" in text


@things
def test_fault_73_a_recorder_says_what_is_in_the_way_and_goes_on(
    session_folder: Path, log_folder: Path, start_program: StartProgram, put: Put, what: str
) -> None:
    put(session_folder / "trifinger.x.state")
    recorder = start_program("record", "x")
    recorder.wait_for(f"trifinger.x.state, which is {what} of user ")
    if what != "a folder":  # no file can take the place of a folder
        robot = start_program("run", "fake", "--name", "x")
        recorder.wait_for("records into")
        assert robot.end()[0] == 0
        recorder.wait_for("was asked to stop")
    assert recorder.end(signal.SIGTERM)[0] == 0
    assert list(log_folder.glob("x_*.mcap")) or what == "a folder"


def test_fault_73_a_recorder_writes_through_no_link(tmp_path: Path, log_folder: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_text("precious text")
    log_folder.mkdir()
    (log_folder / ".x.recorder").symlink_to(precious)
    assert ".x.recorder, which is a symbolic link of" in run("record", "x", expect=1)
    assert precious.read_text() == "precious text"


@things
def test_fault_73_logs_that_are_no_files_are_left_alone(
    log_folder: Path, start_program: StartProgram, start_fake: StartChild, put: Put, what: str
) -> None:
    log_folder.mkdir()
    path = log_folder / "x_2026-01-01_00-00-00_000.mcap"
    put(path)
    start_fake("x")
    recorder = start_program("record", "x")
    recorder.wait_for("records into")
    assert recorder.end(signal.SIGTERM)[0] == 0
    assert path.is_symlink() or not path.is_file()
    assert "x" in run("log", "info", str(log_folder), expect=0)
    assert what


USER_FILES = [
    ("run {}.yml", 1),
    ("run sim --state {}", 1),
    ("log info {}.mcap", 1),
    ("log check {}.mcap", 1),
    ("log recover {}.mcap", 1),
    ("run {}.mcap", 1),
    ("run-policy {}.policy --robot x", 1),
]


@pytest.mark.parametrize("command", [command for command, _ in USER_FILES])
@pytest.mark.parametrize(("put", "what"), [(put_fifo, "a FIFO"), (put_link_to_device, "a device")])
def test_fault_73_a_file_that_a_user_names_must_be_one(
    tmp_path: Path, start_fake: StartChild, command: str, put: Put, what: str
) -> None:
    if "--robot" in command:
        start_fake("x")
    words = command.format(tmp_path / "thing").split()
    (path,) = [word for word in words if word.startswith(str(tmp_path))]
    put(Path(path))
    assert f"{path}, which is {what} of user " in run(*words, expect=1)


def test_fault_73_devices_are_neither_configurations_nor_policies() -> None:
    assert "/dev/zero, which is a device" in run("run", "/dev/zero", expect=1)
    with pytest.raises(OSError, match="/dev/zero, which is a device"):
        trifinger.Policy("/dev/zero")


def test_links_to_files_that_a_user_names_are_followed(tmp_path: Path) -> None:
    (tmp_path / "real.yml").write_text("extends: none.yml\n")
    (tmp_path / "link.yml").symlink_to("real.yml")
    assert "there is no such file" in run("run", str(tmp_path / "link.yml"), expect=1)
