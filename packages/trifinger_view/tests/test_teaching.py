# SPDX-License-Identifier: BSD-3-Clause
"""What a hand teaches a robot: here the hand is a script. test_teach_command.py has the command."""

import threading
from collections.abc import Iterator

import numpy as np
import pytest
import trifinger
from conftest import PATIENT, Running, StartProgram
from trifinger_view.teaching import Teaching, teach

GOAL = np.array([0.1, 0.9, -1.6] * 3)


@pytest.fixture
def robot(start_program: StartProgram) -> Running:
    running = start_program("run", "sim", *PATIENT)
    running.wait_for("waits for a user")
    return running


@pytest.fixture
def guide(robot: Running) -> Iterator[trifinger.Guide]:
    assert robot.process.pid
    with trifinger.guide("sim") as guide:
        yield guide


def test_every_step_is_recorded_as_it_was_measured(guide: trifinger.Guide) -> None:
    def lead() -> None:
        guide.move_joints(GOAL)
        guide.wait_until_arrived()

    shown: list[float] = []
    recording = teach(guide, lead, watch=shown.append)
    steps = len(recording.times)
    observer = trifinger.observe("sim")
    measured = observer.get_observations(recording.first_step, recording.first_step + steps)
    assert np.array_equal(recording.positions, measured["position"])
    assert recording.times == pytest.approx(1e-3 * np.arange(steps))
    assert np.abs(recording.positions[-1] - GOAL).max() < 0.1
    assert shown == sorted(shown)
    assert 0 < shown[-1] <= recording.duration
    guide.wait_until_arrived()
    assert guide.state().mode == "hold"

    tips = recording.tips()
    assert tips.shape == (steps, 3, 3)
    assert tips[-1] == pytest.approx(trifinger.Kinematics().tip_positions(recording.positions[-1]))


def test_the_robot_floats_while_it_is_recorded(guide: trifinger.Guide) -> None:
    modes: list[str] = []
    recording = teach(guide, duration=0.5, watch=lambda _: modes.append(guide.state().mode))
    assert set(modes) == {"float"}
    assert len(recording.times) == 501
    # Its weight is carried, so that it stays where the hand leaves it.
    assert np.abs(recording.positions - recording.positions[0]).max() < 0.05


def test_a_person_who_never_answers_keeps_nobody_waiting(guide: trifinger.Guide) -> None:
    for_ever = threading.Event()
    assert teach(guide, for_ever.wait, duration=0.05).duration == pytest.approx(0.05)
    for_ever.set()


def test_an_error_of_the_hand_is_raised_and_the_robot_holds(guide: trifinger.Guide) -> None:
    def lead() -> None:
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        teach(guide, lead)
    guide.wait_until_arrived()
    assert guide.state().mode == "hold"


def test_what_nothing_would_end_is_refused(guide: trifinger.Guide) -> None:
    with pytest.raises(trifinger.InvalidArgument, match="nothing ends the recording"):
        teach(guide)
    for duration in (0.0, -1.0, float("nan")):
        with pytest.raises(trifinger.InvalidArgument, match="must be above 0"):
            teach(guide, duration=duration)
    guide.wait_until_arrived()
    assert guide.state().mode == "hold"


def test_a_recording_is_made_once(guide: trifinger.Guide) -> None:
    teaching = Teaching(guide)
    assert len(teaching.recording().times) == 0
    teaching.run(duration=0.05)
    with pytest.raises(trifinger.InvalidArgument, match="begin another one"):
        teaching.run(duration=0.05)
    assert len(teaching.recording().times) == 51


def test_fault_63_what_was_recorded_before_the_robot_died_is_kept(robot: Running) -> None:
    guide = trifinger.guide("sim")
    guide.state()
    teaching = Teaching(guide)

    def kill(duration: float) -> None:
        if duration > 0.2:
            robot.process.kill()

    with pytest.raises(trifinger.RobotStopped, match="the back-end died"):
        teaching.run(threading.Event().wait, watch=kill)
    recording = teaching.recording()
    assert recording.duration > 0.2
    assert np.isfinite(recording.positions).all()
    guide.stop()
