# SPDX-License-Identifier: BSD-3-Clause
"""A hand pulls at a simulated robot: in this process, and at one that `trifinger run` runs."""

import itertools
import os
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import StartChild, StartProgram

pytestmark = pytest.mark.bindings

TARGET = np.array([0.0, 0.0, 0.15])

PULLING = """
import time
import trifinger
with trifinger.hand("sim") as hand:
    hand.pull("cube", (0.0, 0.0, 0.15))
    print("ready", flush=True)
    time.sleep(1000)
"""


def hands(robot: trifinger.Frontend) -> Iterator[trifinger.Element]:
    """What acted in each step of a robot that this controls."""
    companion = robot.companion("hand")
    for _ in itertools.count():
        t = robot.append_desired_action(robot.new_action())
        robot.get_observation(t + 1)
        yield companion.get_latest_at(t + 1)


def until(robot: trifinger.Frontend, body: int) -> trifinger.Element:
    """The first step in which this body was pulled; -1: none."""
    for hand in hands(robot):
        if hand.body == body:
            return hand
        time.sleep(0.001)
    raise AssertionError


# ---- in this process ----


def test_a_script_lifts_a_cube_without_real_time() -> None:
    simulation = trifinger.Simulation("sim", {"simulation.hand": True})
    assert simulation.bodies == ["tip_0", "tip_1", "tip_2", "cube"]
    with simulation.connect() as robot:
        for step in range(1500):
            height = min(0.15, 0.0325 + 0.0002 * step)
            simulation.pull("cube", [0.0, 0.0, height], stiffness=500.0)
            robot.append_desired_action(robot.new_action())
        robot.get_observation(1499)
        position, _ = simulation.object_pose("cube")
        # The weight stretches the spring.
        np.testing.assert_allclose(position, TARGET - [0, 0, 0.094 * 9.81 / 500.0], atol=1e-3)
        hand = robot.companion("hand").get_latest_at(1499)
        assert hand.body == 3
        assert hand.process == 0
        np.testing.assert_allclose(hand.force, [0, 0, 0.094 * 9.81], atol=0.05)


def test_a_pull_without_its_companion_is_the_same_pull() -> None:
    poses = []
    for overrides in ({}, {"simulation.hand": True}):
        simulation = trifinger.Simulation("sim", overrides)
        with simulation.connect() as robot:
            simulation.pull(3, TARGET, point=(0.01, 0.0, 0.0))
            for _ in range(100):
                robot.append_desired_action(robot.new_action())
            robot.get_observation(99)
            poses.append(simulation.configuration())
    np.testing.assert_array_equal(*poses)


@pytest.mark.parametrize(
    ("body", "options", "message"),
    [
        ("sphere", {}, "no 'sphere' to pull; there are tip_0, tip_1, tip_2, cube"),
        (4, {}, "no body 4 to pull"),
        ("cube", {"target": (np.nan, 0.0, 0.0)}, "the target of a pull is"),
        ("cube", {"point": (0.0, np.inf, 0.0)}, "the point of a pull is"),
        ("cube", {"stiffness": 1e9}, "the stiffness of a pull is"),
    ],
)
def test_pulls_that_make_no_sense_are_refused(
    body: str | int, options: dict[str, object], message: str
) -> None:
    simulation = trifinger.Simulation("sim")
    arguments: dict = {"target": TARGET} | options
    with pytest.raises(trifinger.InvalidArgument, match=message):
        simulation.pull(body, **arguments)
    with pytest.raises(TypeError):
        simulation.pull(body, (0.0, 0.0))


# ---- in another process ----


@pytest.fixture
def robot(start_program: StartProgram) -> Iterator[trifinger.Frontend]:
    start_program("run", "sim", "--non-real-time").wait_for("holds")
    with trifinger.connect("sim") as robot:
        yield robot


@pytest.mark.without_sanitizer
def test_a_hand_pulls_at_a_robot_in_another_process(robot: trifinger.Frontend) -> None:
    with trifinger.hand("sim") as hand:
        assert hand.bodies == ["tip_0", "tip_1", "tip_2", "cube"]
        hand.pull("cube", TARGET)
        pulled = until(robot, 3)
        assert pulled.process == os.getpid()
        np.testing.assert_array_equal(pulled.target, TARGET)
        for seen in itertools.islice(hands(robot), 1000):
            assert seen.body == 3
        t = robot.current_time_index()
        cube = robot.companion("object").get_latest_at(t).cube
        np.testing.assert_allclose(cube.position, TARGET, atol=0.01)
        hand.let_go()
        assert next(hands(robot)).body == -1


@pytest.mark.without_sanitizer
def test_a_hand_pulls_at_a_robot_from_a_file(arm: str, start_program: StartProgram) -> None:
    start_program("run", arm, "--non-real-time").wait_for("holds")
    with trifinger.connect("arm") as robot, trifinger.hand("arm") as hand:
        assert hand.bodies == ["ball"]
        hand.pull("ball", TARGET)
        assert until(robot, 0).process == os.getpid()
        hand.let_go()
        assert next(hands(robot)).body == -1


@pytest.mark.without_sanitizer
def test_a_second_hand_is_refused_until_the_first_has_ended(robot: trifinger.Frontend) -> None:
    with trifinger.hand("sim") as hand:
        with pytest.raises(trifinger.Error, match=str(os.getpid())):
            trifinger.hand("sim")
        hand.pull("cube", TARGET)
        until(robot, 3)
    assert next(hands(robot)).body == -1
    with pytest.raises(trifinger.Error, match="was closed"):
        hand.pull("cube", TARGET)
    hand.close()
    with trifinger.hand("sim") as second:
        second.pull("tip_1", TARGET)
        until(robot, 1)


@pytest.mark.without_sanitizer
def test_a_hand_whose_process_is_killed_lets_go(
    robot: trifinger.Frontend, start_python: StartChild
) -> None:
    child = start_python(PULLING)
    until(robot, 3)
    child.kill()
    until(robot, -1)


@pytest.mark.without_sanitizer
def test_a_forked_child_has_no_hand(robot: trifinger.Frontend) -> None:
    with trifinger.hand("sim") as hand:
        hand.pull("cube", TARGET)
        until(robot, 3)
        pid = os.fork()
        if pid == 0:
            code = 1
            try:
                hand.let_go()
                hand.pull("tip_0", TARGET)
            except trifinger.InheritedHandle:
                hand.close()
                code = 0
            os._exit(code)
        assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
        assert next(hands(robot)).body == 3


@pytest.mark.without_sanitizer
def test_a_hand_lets_go_by_itself_after_its_time(robot: trifinger.Frontend) -> None:
    with trifinger.hand("sim") as hand:
        hand.pull("cube", TARGET)
        until(robot, 3)
        hand.pull("cube", TARGET, seconds=0.05)
        until(robot, -1)


@pytest.mark.without_sanitizer
def test_the_program_says_who_pulls_and_the_log_what(
    start_program: StartProgram, tmp_path: Path
) -> None:
    program = start_program("run", "sim", "--non-real-time", "--record", str(tmp_path))
    program.wait_for("holds")
    with trifinger.hand("sim") as hand:
        program.wait_for(f"sensor 'hand': process {os.getpid()} delivers")
        hand.pull("tip_0", TARGET, stiffness=20.0)
        with trifinger.connect("sim") as robot:
            until(robot, 0)
            robot.finish()
    program.end()
    (path,) = tmp_path.glob("*.mcap")
    (hand_in_log,) = (
        companion
        for companion in trifinger.Log(path).session("sim").companions
        if companion.name == "sim.hand"
    )
    elements = hand_in_log.observations
    assert 0 in elements["body"]
    assert os.getpid() in elements["process"]


@pytest.mark.without_sanitizer
def test_a_hand_needs_a_simulation_that_runs(start_program: StartProgram) -> None:
    with pytest.raises(trifinger.SessionNotFound):
        trifinger.hand("sim")
    start_program("run", "fake").wait_for("holds")
    with pytest.raises(trifinger.InvalidArgument, match="'fake' cannot be pulled"):
        trifinger.hand("fake")
