# SPDX-License-Identifier: BSD-3-Clause
"""Recording simulations of this process."""

import multiprocessing
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trifinger

pytestmark = pytest.mark.bindings

HISTORY = 16384


def run(robot, steps):
    """Random torques; returns the desired actions."""
    random = np.random.default_rng(1)
    torques = random.uniform(-0.2, 0.2, (steps, 9))
    action = robot.new_action()
    for torque in torques:
        action.torque = torque
        robot.wait_until_time_index(robot.append_desired_action(action))
    robot.finish()
    return torques


def only_file(folder):
    (file,) = folder.glob("*.mcap")
    return file


def test_a_simulation_is_recorded_without_loss_though_its_history_is_shorter(tmp_path):
    simulation = trifinger.Simulation()
    with simulation.record(tmp_path) as recorder:
        torques = run(simulation.connect(), 2 * HISTORY)
    session = trifinger.Log(recorder.file).session("sim")
    assert session.gaps == []
    assert session.steps == 2 * HISTORY
    np.testing.assert_array_equal(session.desired_actions["torque"], torques)


def test_the_log_has_what_the_front_end_has_shown(tmp_path):
    simulation = trifinger.Simulation()
    with simulation.record(tmp_path) as recorder:
        robot = simulation.connect()
        run(robot, 500)
    session = trifinger.Log(recorder.file).session()
    for series in ("observations", "applied_actions", "desired_actions", "statuses"):
        shown = getattr(robot, f"get_{series}")(0, 500)
        assert getattr(session, series).tobytes() == shown.tobytes(), series
    last = session.get_observations(500, 501)
    assert last.tobytes() == robot.get_observations(500, 501).tobytes()


def test_every_session_is_recorded(tmp_path):
    simulation = trifinger.Simulation()
    with simulation.record(tmp_path) as recorder:
        for steps in (10, 20, 30):
            run(simulation.connect(), steps)
    assert [session.steps for session in trifinger.Log(recorder.file).sessions] == [10, 20, 30]


def test_the_short_form_of_simulate_records(tmp_path):
    robot = trifinger.simulate(record=tmp_path)
    run(robot, 100)
    del robot
    assert trifinger.Log(only_file(tmp_path)).session("sim").steps == 100


def test_single_precision_takes_half_the_space_and_is_near(tmp_path):
    sizes = {}
    for precision in ("double", "single"):
        simulation = trifinger.Simulation()
        with simulation.record(tmp_path / precision, precision=precision) as recorder:
            torques = run(simulation.connect(), 3000)
        sizes[precision] = recorder.file.stat().st_size
        session = trifinger.Log(recorder.file).session()
        np.testing.assert_allclose(session.desired_actions["torque"], torques, rtol=1e-7)
    assert sizes["single"] < 0.65 * sizes["double"]


def test_an_unknown_precision_is_refused(tmp_path):
    with pytest.raises(trifinger.InvalidArgument, match="'double' or 'single'"):
        trifinger.Simulation().record(tmp_path, precision="half")


def test_two_recorders_do_not_share_a_folder(tmp_path):
    first, second = trifinger.Simulation(), trifinger.Simulation()
    with first.record(tmp_path), pytest.raises(trifinger.AlreadyRecorded, match="another folder"):
        second.record(tmp_path)


def test_there_is_no_file_before_the_first_session(tmp_path):
    with trifinger.Simulation().record(tmp_path) as recorder:
        assert recorder.file is None


def test_fault_66_the_end_of_the_program_finishes_the_file(tmp_path):
    program = f"""
import trifinger
robot = trifinger.simulate(record={str(tmp_path)!r})
t = robot.append_desired_action(robot.new_action())
for _ in range(99):
    robot.get_observation(t)
    t = robot.append_desired_action(robot.new_action())
robot.get_observation(t)
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=100)
    log = trifinger.Log(only_file(tmp_path))
    assert log.is_finished
    assert len(log.session("sim").applied_actions) >= 99


def leave_quietly(recorder, path):
    """In a forked child: neither stops nor waits for the parent's recorder."""
    try:
        recorder.stop()
    except trifinger.InheritedHandle:
        Path(path).write_text("refused")


@pytest.mark.without_sanitizer  # its lock may be held by another thread at the fork
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_fault_64_a_forked_child_leaves_the_recorder_alone(tmp_path):
    simulation = trifinger.Simulation()
    with simulation.record(tmp_path) as recorder:
        child = multiprocessing.get_context("fork").Process(
            target=leave_quietly, args=(recorder, tmp_path / "said")
        )
        child.start()
        child.join(100)
        assert child.exitcode == 0
        run(simulation.connect(), 50)
    assert (tmp_path / "said").read_text() == "refused"
    assert trifinger.Log(recorder.file).session("sim").steps == 50
