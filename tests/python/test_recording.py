# SPDX-License-Identifier: BSD-3-Clause
"""Recording from the command line, read with the official packages `mcap` and `mcap_ros2`."""

import os
import re
import select
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trifinger
from conftest import PATIENT_FAKE, PROGRAM, StartChild, StartProgram
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from test_command_line import Screen

STEPS = 300
Messages = dict[str, list[Any]]


def run(*arguments: str, expect: int = 0) -> str:
    """Runs the program to its end and returns all that it printed."""
    result = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False)
    assert result.returncode == expect, result.stdout + result.stderr
    return result.stdout + result.stderr


def files_in(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.mcap"))


def read_messages(folder: Path) -> Messages:
    """What the official packages find in the one file of `folder`, by topic."""
    (path,) = files_in(folder)
    messages: Messages = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
            messages.setdefault(channel.topic, []).append(decoded)
            assert message.log_time > 0
    return messages


def read_metadata(folder: Path, name: str) -> list[dict[str, str]]:
    with files_in(folder)[0].open("rb") as file:
        return [entry.metadata for entry in make_reader(file).iter_metadata() if entry.name == name]


def attribute(message: Any, name: str) -> Any:
    """`message.a.b` for the field "a.b"."""
    for part in name.split("."):
        message = getattr(message, part)
    return message


def leaves(dtype: np.dtype[Any], prefix: str = "") -> Iterator[tuple[str, Callable[[Any], Any]]]:
    """The numbers of a structured type: their name, and how to get them from an array."""
    for name in dtype.names or ():
        inner = dtype[name]
        if inner.names:
            for leaf, get in leaves(inner, f"{prefix}{name}."):
                yield leaf, lambda array, name=name, get=get: get(array[name])
        else:
            yield f"{prefix}{name}", lambda array, name=name: array[name]


def assert_same(decoded: list[Any], array: np.ndarray[Any, Any], single: bool = False) -> None:
    """Every number of every field is the same, NaN for NaN; or the nearest float32."""
    assert len(decoded) == len(array)
    names = 0
    for name, get in leaves(array.dtype):
        found = np.array([attribute(message, name) for message in decoded])
        expected = get(array).reshape(found.shape)
        if single and expected.dtype == np.float64:
            expected = expected.astype(np.float32).astype(np.float64)
        np.testing.assert_array_equal(found.astype(expected.dtype), expected, err_msg=name)
        names += 1
    assert names > 0


def assert_log_has(robot: trifinger.Frontend, folder: Path, single: bool = False) -> Messages:
    """The official readers find what the front-end shows: all series of the whole steps."""
    messages = read_messages(folder)
    name = robot.session_info().name
    steps = messages[f"/{name}/step"]
    # In real time, on a busy machine, the robot may take more steps before it has to finish.
    count = robot.session_info().steps
    assert count >= STEPS
    assert [step.time_index for step in steps] == list(range(count))
    assert {step.session_id for step in steps} == {robot.session_info().session_id}
    for field, array in {
        "status": robot.get_statuses(0, count),
        "observation": robot.get_observations(0, count),
        "applied_action": robot.get_applied_actions(0, count),
        "desired_action": robot.get_desired_actions(0, count),
    }.items():
        assert_same([getattr(step, field) for step in steps], array, single)
    end = messages[f"/{name}/end"][0]
    assert end.time_index == count
    assert_same([end.status], robot.get_statuses(count, count + 1))
    assert_same([end.observation], robot.get_observations(count, count + 1), single)
    return messages


def random_bytes_as(dtype: np.dtype[Any], count: int) -> np.ndarray[Any, Any]:
    """Elements whose floats are small numbers and whose integers may be anything."""
    random = np.random.default_rng(7)
    array = np.zeros(count, dtype)
    for _, get in leaves(dtype):
        view = get(array)
        if view.dtype.kind == "f":
            view[...] = random.uniform(-1, 1, view.shape)
        else:
            limits = np.iinfo(view.dtype)
            view[...] = random.integers(limits.min, limits.max, view.shape, view.dtype)
    return array


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_the_official_readers_decode_a_robot_that_nobody_has_heard_of(
    compression: str, tmp_path: Path, start_foreign: StartChild, start_program: StartProgram
) -> None:
    start_foreign("odd", "odd")
    options = ("-o", str(tmp_path / "out"), "--compression", compression)
    recorder = start_program("record", "odd", *options)
    recorder.wait_for("records into")
    with trifinger.connect("odd") as robot:
        actions = random_bytes_as(robot.action_dtype, STEPS)
        robot.append_desired_actions(actions)
        robot.wait_until_time_index(STEPS - 1)
        lamp = robot.companion("lamp")
        readings = [lamp.get_latest_at(t) for t in range(STEPS)]
        robot.finish()
        recorder.wait_for("the controller finished")
        assert recorder.end(signal.SIGINT)[0] == 0
        messages = assert_log_has(robot, tmp_path / "out")
        session_id = robot.session_info().session_id
    # A front-end shows only the newest element of a companion.
    shown = {reading.stamp.arrival_index: reading for reading in readings if reading is not None}
    decoded = {message.stamp.arrival_index: message for message in messages["/odd/lamp"]}
    assert len(shown) > STEPS // 4
    for arrival, reading in shown.items():
        assert decoded[arrival].colour == reading.colour.tolist()
        assert decoded[arrival].gear == reading.gear.tolist()
        assert decoded[arrival].session_id == session_id
    assert [message.index for message in messages["/odd/lamp"]] == list(range(len(decoded)))


@pytest.mark.parametrize("precision", ["double", "single"])
def test_the_official_readers_decode_a_simulation(
    precision: str, tmp_path: Path, start_program: StartProgram
) -> None:
    simulation = start_program("run", "sim", "--non-real-time")
    simulation.wait_for("holds its pose")
    recorder = start_program("record", "sim", "-o", str(tmp_path / "out"), "--precision", precision)
    recorder.wait_for("records into")
    random = np.random.default_rng(1)
    with trifinger.connect("sim") as robot:
        action = robot.new_action()
        for _ in range(STEPS):
            action.torque = random.uniform(-0.2, 0.2, 9)
            robot.append_desired_action(action)
        robot.wait_until_time_index(STEPS - 1)
        robot.finish()
        recorder.wait_for("the controller finished")
        assert recorder.end()[0] == 0
        messages = assert_log_has(robot, tmp_path / "out", single=precision == "single")
    assert len(messages["/sim/object"]) > 1
    assert read_metadata(tmp_path / "out", "trifinger.log")[0]["precision"] == precision
    assert any("finished" in event.msg for event in messages["/events"])
    assert {event.level for event in messages["/events"]} == {20}


@pytest.mark.parametrize("mode", ["--real-time", "--non-real-time"])
def test_run_records_its_robot_from_the_first_step_to_the_last(
    mode: str, tmp_path: Path, start_program: StartProgram
) -> None:
    program = start_program("run", "fake", mode, *PATIENT_FAKE, "--record", str(tmp_path / "out"))
    program.wait_for("records into")
    with trifinger.connect("fake") as robot:
        robot.append_desired_actions(np.repeat(robot.new_action(), STEPS))
        robot.wait_until_time_index(STEPS - 1)
        robot.finish()
        status, output = program.end(signal.SIGINT)
        assert (status, output.splitlines()[-1]) == (0, "fake: stopped")
        # The file is complete when the program has ended, whichever process wrote it.
        assert_log_has(robot, tmp_path / "out")
        steps = robot.session_info().steps
    ends = read_metadata(tmp_path / "out", "trifinger.end")
    assert (ends[0]["fault"], ends[0]["steps"]) == ("finished", str(steps))


def child_of(pid: int) -> int:
    """The process number of the one child of a process."""
    (child,) = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return int(child)


def wait_for_end_of(pid: int) -> None:
    """Waits for a process that is not our child."""
    try:
        descriptor = os.pidfd_open(pid)
    except ProcessLookupError:
        return
    with os.fdopen(descriptor) as file:
        select.select([file], [], [])


def test_the_recorder_of_a_killed_back_end_writes_the_end(
    tmp_path: Path, start_program: StartProgram
) -> None:
    words = ("--real-time", *PATIENT_FAKE, "--record", str(tmp_path / "out"))
    program = start_program("run", "fake", *words)
    program.wait_for("records into")
    recorder = child_of(program.process.pid)
    robot = trifinger.connect("fake")
    robot.append_desired_action(robot.new_action())
    robot.wait_until_time_index(50)
    program.process.kill()
    wait_for_end_of(recorder)
    steps = robot.session_info().steps
    (end,) = read_metadata(tmp_path / "out", "trifinger.end")
    assert (end["fault"], end["steps"]) == ("backend_died", str(steps))
    recorded = [step.time_index for step in read_messages(tmp_path / "out")["/fake/step"]]
    assert recorded == list(range(steps))


@pytest.mark.slow
def test_a_killed_recorder_of_run_is_replaced_and_nothing_is_missing(
    tmp_path: Path, start_program: StartProgram
) -> None:
    options = ("--real-time", *PATIENT_FAKE, "--record", str(tmp_path / "out"))
    program = start_program("run", "fake", *options)
    program.wait_for("records into")
    robot = trifinger.connect("fake")
    robot.append_desired_action(robot.new_action())
    robot.wait_until_time_index(50)
    os.kill(child_of(program.process.pid), signal.SIGKILL)
    program.wait_for("another one goes on")
    program.wait_for("goes on with")
    robot.wait_until_time_index(2000)
    assert program.end(signal.SIGINT)[0] == 0
    steps = robot.session_info().steps
    recorded = [step.time_index for step in read_messages(tmp_path / "out")["/fake/step"]]
    assert recorded == list(range(steps))


def test_a_folder_where_the_robot_is_recorded_already_is_refused(
    tmp_path: Path, start_program: StartProgram
) -> None:
    first = start_program("record", "fake", "-o", str(tmp_path / "out"))
    first.wait_for("waits for fake")
    message = run("record", "fake", "-o", str(tmp_path / "out"), expect=1)
    assert re.search(
        rf"'fake' is recorded into .* by trifinger \(process {first.process.pid}\)", message
    )
    # The program refuses before the robot moves.
    for mode in ("--real-time", "--non-real-time"):
        message = run("run", "fake", mode, "--record", str(tmp_path / "out"), expect=1)
        assert "is recorded into" in message
    first.end()
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_finishes_the_log(
    number: signal.Signals, tmp_path: Path, start_fake: StartChild, start_program: StartProgram
) -> None:
    start_fake("robot")
    recorder = start_program("record", "robot", "-o", str(tmp_path / "out"))
    recorder.wait_for("records into")
    with trifinger.connect("robot") as robot:
        robot.append_desired_actions(np.repeat(robot.new_action(), 10))
        robot.get_status(9)  # what is written last: now the step is whole, and is recorded
        status, output = recorder.end(number)
    assert status == 0
    assert "finishes the log" in output
    assert "recorder: 10 steps in " in output
    with files_in(tmp_path / "out")[0].open("rb") as file:
        assert make_reader(file).get_summary() is not None


def test_a_recorder_ends_with_its_robot_if_that_is_wanted(
    tmp_path: Path, start_fake: StartChild, start_program: StartProgram
) -> None:
    recorder = start_program("record", "robot", "--until-end", "-o", str(tmp_path / "out"))
    recorder.wait_for("waits for robot")
    child = start_fake("robot")
    recorder.wait_for("records into")
    child.finish()
    assert recorder.process.wait() == 0


def test_logs_go_to_the_usual_place(
    log_folder: Path, start_fake: StartChild, start_program: StartProgram
) -> None:
    start_fake("robot")
    recorder = start_program("record", "robot")
    recorder.wait_for(f"records into {log_folder}/robot_")
    recorder.end()


def test_a_terminal_shows_how_the_recorder_is_doing(tmp_path: Path, start_fake: StartChild) -> None:
    start_fake("robot")
    with trifinger.connect("robot") as robot:
        screen = Screen(100, "record", "robot", "-o", str(tmp_path / "out"))
        screen.wait_for("robot  recording")
        robot.append_desired_actions(np.repeat(robot.new_action(), 123))
        robot.wait_until_time_index(122)
        screen.wait_for("step 123")
        screen.press("\x03")
        assert screen.end() == 0
    assert all(len(line) <= 100 for line in screen.drawn_lines())


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ("robot.sensor", "companions are recorded with their robot"),
        ("robot robot", "'robot' is named twice"),
        ("robot --rotate-size 5apples", "--rotate-size is '5apples', must be a size such as"),
        ("robot --rotate-size 3", "--rotate-size is 3 bytes, must be at least 1 MB: every file"),
        ("robot --max-total 7MB", "--max-total is 7 MB, must be at least 8 MB"),
        ("robot --rotate-time 3", "--rotate-time is '3', must be a time such as 30s, 10min or 1h"),
        ("robot --keep-free -1MB", "--keep-free is '-1MB', must be a size"),
        ("robot --compression gzip", "must be 'zstd', 'lz4' or 'none'"),
        ("robot --precision half", "must be 'double' or 'single'"),
    ],
)
def test_wrong_usage_of_record_names_the_thing_and_what_is_allowed(
    arguments: str, problem: str
) -> None:
    assert problem in run("record", *arguments.split(), expect=2)
