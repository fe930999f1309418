# SPDX-License-Identifier: BSD-3-Clause
"""Logs played as if they were the robot, and motions that a robot does again."""

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import PROGRAM, StartChild, StartProgram
from trifinger import Status

STEPS = 400
PERIOD = 0.001


def run(*arguments: str, expect: int = 0) -> str:
    """Runs the program to its end and returns all that it printed."""
    result = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False)
    assert result.returncode == expect, result.stdout + result.stderr
    return result.stdout + result.stderr


def policy(robot: trifinger.Frontend, t: int, y: trifinger.Element, cube: float) -> object:
    """An action that depends on all measurements: one wrong bit changes all later actions."""
    return robot.new_action(
        torque=0.1 * np.sin(1e3 * (y.position + y.velocity) + 1e6 * cube),
        position=y.position + 0.001 if t % 3 == 0 else np.nan,
    )


def drive(robot: trifinger.Frontend, steps: int = STEPS) -> None:
    """Lets a deterministic policy drive the robot, and finishes."""
    objects = robot.companion("object")
    cube = 0.0
    y = robot.latest_observation()
    for i in range(steps):
        t = robot.append_desired_action(policy(robot, i, y, cube))
        y = robot.get_observation(t)
        cube = float(objects.get_latest_at(t).cube.position[0])
    robot.finish()


def swing(robot: trifinger.Frontend, steps: int = STEPS) -> None:
    """Moves all joints to and fro by position actions, beginning at rest."""
    start = robot.latest_observation().position
    for i in range(steps):
        offset = 0.15 * (1 - np.cos(i * 2 * np.pi / steps))
        t = robot.append_desired_action(robot.new_action(position=start + offset))
        robot.wait_until_time_index(t)
    robot.finish()


@pytest.fixture
def record(tmp_path: Path) -> Callable[..., Path]:
    """Records what a function does with a simulation; returns the log."""

    def record(program: Callable[..., None]) -> Path:
        simulation = trifinger.Simulation()
        with simulation.record(tmp_path / "recorded") as recorder:
            program(simulation.connect())
        assert recorder.file is not None
        return recorder.file

    return record


Record = Callable[..., Path]


def without_clocks(statuses: np.ndarray) -> bytes:
    statuses = statuses.copy()
    statuses["time"] = statuses["lateness"] = 0
    return statuses.tobytes()


# ---- a log as the robot ----


def test_the_same_program_sees_the_same_series_bit_for_bit(record: Record) -> None:
    log = record(drive)
    session = trifinger.Log(log).session()
    robot = trifinger.replay(log)
    drive(robot)
    last = STEPS
    assert robot.get_observations(0, last + 1).tobytes() == (
        session.get_observations(0, last + 1).tobytes()
    )
    for series in ("desired_actions", "applied_actions"):
        replayed = getattr(robot, f"get_{series}")(0, last)
        assert replayed.tobytes() == getattr(session, series).tobytes(), series
    statuses = robot.get_statuses(0, last)
    assert without_clocks(statuses) == without_clocks(session.statuses)
    assert not np.any(statuses["flags"] & Status.ACTION_REJECTED)


def test_another_user_is_told_at_which_steps_he_differs(record: Record) -> None:
    log = trifinger.Log(record(drive))
    actions = log.session().desired_actions.copy()
    differing = [3, 100, 101, STEPS - 1]
    actions["torque"][differing, 4] += 1e-12
    with trifinger.replay(log) as robot:
        robot.append_desired_actions(actions)
        robot.wait_until_time_index(STEPS)
        flags = robot.get_statuses(0, STEPS)["flags"]
    assert np.flatnonzero(flags & Status.ACTION_REJECTED).tolist() == differing


def test_a_log_ends_without_a_fault_and_can_be_played_again(record: Record) -> None:
    session = trifinger.Log(record(swing)).session()
    for _ in range(2):
        robot = trifinger.replay(session, first=100, last=150)
        for _ in range(50):
            robot.wait_until_time_index(robot.append_desired_action(robot.new_action()))
        robot.wait_until_time_index(50)
        with pytest.raises(trifinger.RobotStopped) as stopped:
            robot.append_desired_action(robot.new_action())
        assert stopped.value.fault.code == "exhausted"
        assert stopped.value.fault.time_index == 50
        assert not stopped.value.fault.needs_recovery
        assert robot.get_observation(50).position == pytest.approx(
            session.get_observation(150).position, abs=0
        )
        robot.close()


def test_steps_that_are_not_there_cannot_be_played(record: Record) -> None:
    log = record(swing)
    with pytest.raises(trifinger.InvalidArgument, match=f"the log has 0 to {STEPS - 1}"):
        trifinger.replay(log, first=STEPS)
    with pytest.raises(trifinger.InvalidArgument, match="'nobody'"):
        trifinger.replay(log, robot="nobody")


def test_the_program_offers_a_log_to_other_processes(
    record: Record, start_program: StartProgram
) -> None:
    log = record(drive)
    program = start_program("run", str(log), "--name", "again", "--set", "last=300")
    program.wait_for("waits for a user")
    session = trifinger.Log(log).session()
    with trifinger.connect("again") as robot:
        drive(robot, 300)
        assert robot.get_observations(0, 300).tobytes() == session.observations[:300].tobytes()
        assert not np.any(robot.get_statuses(0, 300)["flags"] & Status.ACTION_REJECTED)
    program.wait_for("the log that is replayed is over")
    message = run("run", str(log), "--set", "frist=1", expect=2)
    assert "frist is not a known key; did you mean 'first'?" in message


# ---- actions on a robot ----


@pytest.fixture
def sim(start_program: StartProgram) -> trifinger.Frontend:
    """A simulated robot in another process, and an observer of its first session."""
    start_program("run", "sim", "--non-real-time").wait_for("waits for a user")
    return trifinger.observe("sim")


@pytest.mark.parametrize("program", [drive, swing])
def test_actions_on_the_same_simulation_give_the_same_observations_bit_for_bit(
    program: Callable[..., None], record: Record, sim: trifinger.Frontend
) -> None:
    log = record(program)
    assert "at most 0 rad from the recorded positions\n" in run(
        "log", "replay", str(log), "--on", "sim"
    )
    session = trifinger.Log(log).session()
    assert sim.get_observations(0, STEPS).tobytes() == session.observations.tobytes()
    assert sim.get_applied_actions(0, STEPS).tobytes() == session.applied_actions.tobytes()
    assert sim.fault() is not None
    assert sim.fault().code == "finished"


def test_fault_67_a_motion_does_not_begin_in_another_pose(
    record: Record, sim: trifinger.Frontend
) -> None:
    log = record(swing)
    message = run("log", "replay", str(log), "--on", "sim", "--first", "200", expect=1)
    assert "the robot is not within 0.05 rad of where step 200 of the motion began" in message
    assert "--blend SECONDS" in message
    assert len(re.findall(r"^ +\d( +-?\d+\.\d{4}){3}  too far$", message, re.MULTILINE)) == 9
    assert sim.current_time_index() == -1, "something was done"
    # With this tolerance, the motion may begin there.
    run("log", "replay", str(log), "--on", "sim", "--first", "200", "--tolerance", "0.5")


@pytest.mark.parametrize("first", [150, 200, 250])
def test_fault_67_a_blend_never_jumps(first: int, record: Record, sim: trifinger.Frontend) -> None:
    log = record(swing)
    limit = 2.0
    text = run(
        *("log", "replay", str(log), "--on", "sim", "--first", str(first)),
        *("--blend", "0.2", "--max-velocity", str(limit)),
    )
    assert "moves to the start pose, 0." in text
    recorded = trifinger.Log(log).session().desired_actions["position"][first:]
    end = sim.range("applied_action")[1]
    targets = sim.get_desired_actions(0, end)["position"]
    # No step of the way from the robot's pose to the start is longer than the limit.
    assert np.all(np.abs(targets[0] - sim.get_observation(0).position) <= limit * PERIOD)
    way = end - len(recorded)
    assert np.max(np.abs(np.diff(targets[:way], axis=0))) <= limit * PERIOD * (1 + 1e-9)
    # The step into the motion is no longer than the limit plus the largest step of the motion.
    own = np.max(np.abs(np.diff(recorded, axis=0)))
    assert np.max(np.abs(np.diff(targets[way - 1 :], axis=0))) <= limit * PERIOD + own
    # The robot is there when the motion begins, and the motion ends with the recorded actions.
    assert np.allclose(sim.get_observation(way).position, targets[way - 1], atol=0.05)
    assert np.array_equal(targets[-100:], recorded[-100:])


def test_fault_67_a_robot_that_cannot_be_brought_there_does_not_begin(
    record: Record, sim: trifinger.Frontend
) -> None:
    log = record(swing)
    message = run(
        *("log", "replay", str(log), "--on", "sim", "--first", "200"),
        *("--blend", "0.2", "--tolerance", "1e-9"),
        expect=1,
    )
    assert "it could not be brought nearer" in message
    recorded = trifinger.Log(log).session().get_observation(200).position
    # The robot rests at the pose to which it was brought.
    rest = sim.get_desired_actions(*sim.range("applied_action"))["position"][-1]
    assert np.array_equal(rest, recorded)
    assert sim.fault() is not None
    assert sim.fault().code == "finished"


def test_applied_torques_are_what_the_motors_get_again(
    record: Record, sim: trifinger.Frontend
) -> None:
    log = record(swing)
    run("log", "replay", str(log), "--on", "sim", "--what", "applied")
    actions = sim.get_desired_actions(0, STEPS)
    recorded = trifinger.Log(log).session().applied_actions
    assert np.array_equal(actions["torque"], recorded["torque"])
    assert np.all(np.isnan(actions["position"]))


def test_a_motion_of_another_robot_is_refused(
    record: Record, start_program: StartProgram, start_fake: StartChild
) -> None:
    log = record(swing)
    start_fake("fake")
    message = run("log", "replay", str(log), "--on", "fake", expect=1)
    assert "session 'fake' is a robot of type 'fake'; this program expects 'trifinger'" in message
    start_program("run", "sim", "--non-real-time", "--set", "backend.period=0.002").wait_for(
        "waits for a user"
    )
    message = run("log", "replay", str(log), "--on", "sim", expect=2)
    assert "recorded with steps of 1 ms, those of the robot are 2 ms" in message


def test_a_robot_without_joints_begins_only_if_forced(start_program: StartProgram) -> None:
    start = ("run", "fake", "--non-real-time", "--name")
    robot = start_program(*start, "fake")
    robot.wait_for("waits for a user")
    user = trifinger.connect("fake")
    for i in range(50):
        t = user.append_desired_action(user.new_action(setpoint=i))
    user.get_status(t)
    robot.process.kill()
    robot.process.wait()
    user.close()
    log = re.match(r"(\S+) written: .*, steps 0 to 49 of 'fake'", run("log", "rescue", "fake"))
    assert log
    start_program(*start, "other").wait_for("waits for a user")
    observer = trifinger.observe("other")
    replay = ("log", "replay", log[1], "--on", "other")
    assert "--force begins in any pose" in run(*replay, expect=1)
    run(*replay, "--force")
    assert observer.get_desired_actions(0, 50)["setpoint"].tolist() == list(range(50))


# ---- what faults leave ----


def use_up(name: str) -> None:
    """Drives a robot until it stops."""

    def act() -> None:
        robot = trifinger.connect(name)
        for _ in range(40):
            robot.wait_until_time_index(robot.append_desired_action(robot.new_action()))

    with pytest.raises(trifinger.RobotStopped):
        act()


def test_a_fault_leaves_a_log_that_status_and_the_program_name(
    start_program: StartProgram, log_folder: Path
) -> None:
    program = start_program("run", "fake", "--non-real-time", "--set", "fault_after=30")
    program.wait_for("waits for a user")
    use_up("fake")
    line = program.wait_for("what came before the fault is in ")
    path = Path(line.split(" is in ")[1].strip())
    assert path.parent == log_folder
    assert re.fullmatch(r"fake_\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d_fault\.mcap", path.name)
    assert str(path) in run("status", "fake", "--once")
    session = trifinger.Log(path).session()
    assert session.steps == 30
    assert session.fault.code == "driver"
    assert "name: fake" in session.documents["configuration.yml"]


def test_no_log_is_left_where_none_is_wanted(start_program: StartProgram, log_folder: Path) -> None:
    program = start_program(
        *("run", "fake", "--non-real-time", "--set", "fault_after=3", "--fault-log", "0")
    )
    program.wait_for("waits for a user")
    use_up("fake")
    program.wait_for("trifinger recover")
    program.end()
    assert not log_folder.exists() or list(log_folder.iterdir()) == []


def test_a_robot_that_lives_is_recorded_and_not_rescued(start_fake: StartChild) -> None:
    start_fake("left")
    message = run("log", "rescue", "left", expect=2)
    assert "is alive: record it with 'trifinger record left'" in message
    assert "there is no robot 'right'" in run("log", "rescue", "right", expect=1)


def test_a_dead_robot_is_known_to_be_worth_a_rescue(start_fake: StartChild) -> None:
    backend = start_fake("left")
    backend.kill()
    assert "trifinger log rescue left" in run("status", "left", "--once")
    assert "no whole step of 'left'" in run("log", "rescue", "left")


def test_a_folder_with_the_name_of_a_configuration_does_not_hide_it(
    start_program: StartProgram, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sim").mkdir()
    monkeypatch.chdir(tmp_path)
    robot = start_program("run", "sim", "--non-real-time")
    robot.wait_for("sim: holds its pose and waits for a user")
