# SPDX-License-Identifier: BSD-3-Clause
"""Logs by time: any moment of a log, its frames, and the time line that plays them."""

import gc
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import BUILD
from hypothesis import given, settings, strategies as st
from strange_log import copy_changed
from trifinger.errors import InvalidArgument
from trifinger_view.logged import MARKS, Course, LoggedRun
from trifinger_view.playing import FASTEST, SLOWEST, TimeLine

# An exception in a check is shown by Python, and is meant here.
raises_in_a_check = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
HOME = np.array([0.0, 0.9, -1.7] * 3)
STEPS = 1500


def record(folder: Path, steps: int = STEPS, seed: int = 0) -> Path:
    """A log of a simulation with random targets; one of three times it has none."""
    generator = np.random.default_rng(seed)
    with trifinger.simulate(record=folder) as robot:
        for start in range(0, steps, 100):
            actions = np.repeat(robot.new_action(), min(100, steps - start))
            if start // 100 % 3 != 2:
                actions["position"] = HOME + generator.uniform(-0.2, 0.2, 9)
            robot.append_desired_actions(actions)
            robot.wait_until_time_index(start + len(actions) - 1)
        robot.finish()
    return folder


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> LoggedRun:
    return LoggedRun(record(tmp_path_factory.mktemp("log")))


@pytest.fixture(scope="module")
def log_with_gap(tmp_path_factory: pytest.TempPathFactory) -> LoggedRun:
    """A log of random numbers that lacks the steps 200 to 249."""
    folder = tmp_path_factory.mktemp("gap")
    program = str(BUILD / "tests/python/write_log")
    subprocess.run([program, str(folder), "trifinger", "600", "200", "249"], check=True)
    return LoggedRun(folder / "log.mcap")


FAULT = 40


def fail(folder: Path) -> None:
    """Records a session that a check ends with a fault in the step FAULT."""

    def broken(_: trifinger.Element, action: trifinger.Element) -> None:
        if action["torque"][0] > 0.1:
            raise ValueError("too much")

    with trifinger.simulate(checks=[broken], record=folder) as robot:
        actions = np.repeat(robot.new_action(), FAULT + 1)
        actions["torque"][FAULT, 0] = 0.2
        robot.append_desired_actions(actions)
        robot.get_observation(FAULT + 2)


@pytest.fixture
def failed(tmp_path: Path) -> LoggedRun:
    with pytest.raises(trifinger.RobotStopped):
        fail(tmp_path)
    gc.collect()  # the simulation, and its recorder with it, so that the log is finished
    return LoggedRun(tmp_path)


# ---- any moment ----


def test_the_frame_of_a_time_is_the_newest_step_that_had_been_measured(run: LoggedRun) -> None:
    session = run.session
    times = (session.times.astype(np.int64) - session.times.astype(np.int64)[0]) * 1e-9
    for time in np.random.default_rng(1).uniform(0, times[-1], 100):
        newest = int(np.flatnonzero(times <= time)[-1])
        frame = run.frame_at(time)
        assert frame.time_index == newest
        assert frame.time == pytest.approx(times[newest], abs=1e-9)
        np.testing.assert_array_equal(frame.position, session.observations["position"][newest])
        np.testing.assert_array_equal(frame.torque, session.observations["torque"][newest])
        seen = session.companion("object").get_latest_at(newest)
        assert seen is not None
        np.testing.assert_array_equal(frame.objects["cube"][:3], seen["cube"]["position"])
        np.testing.assert_array_equal(frame.objects["cube"][3:], seen["cube"]["orientation"])


def test_the_time_of_each_step_finds_this_step_again(run: LoggedRun) -> None:
    for step in range(run.first, run.last + 1):
        assert run.step_at(run.time_of(step)) == step


def test_times_beyond_the_log_give_its_first_and_its_last_observation(run: LoggedRun) -> None:
    assert run.frame_at(-1.0).time_index == run.first == 0
    last = run.frame_at(1e6)
    assert last.time_index == run.last == STEPS
    assert last.time == run.end
    assert last.fault is not None
    assert last.fault.code == "finished"
    assert last.status == run.session.fault_text


def test_a_frame_has_a_desired_pose_only_where_one_was_asked_for(run: LoggedRun) -> None:
    assert run.frame_at(0.25).desired is None
    np.testing.assert_array_equal(
        run.frame_at(0.35).desired, run.session.get_desired_action(350)["position"]
    )


def test_a_time_in_a_gap_shows_the_step_before_it(log_with_gap: LoggedRun) -> None:
    run = log_with_gap
    before, after = run.time_of(199), run.time_of(250)
    assert after > before
    for time in np.linspace(before, after, 20, endpoint=False):
        assert run.frame_at(time).time_index == 199
    assert run.frame_at(after).time_index == 250
    assert run.time_of(220) == before


def test_a_session_without_a_fault_has_none_to_jump_to(run: LoggedRun) -> None:
    assert run.fault is None
    assert run.ends_in_log


@raises_in_a_check
def test_the_fault_is_found_with_its_time_and_its_sentence(failed: LoggedRun) -> None:
    assert failed.fault is not None
    assert failed.fault.time_index == FAULT
    assert failed.step_at(failed.fault.time) == FAULT
    assert "too much" in failed.fault.text
    frame = failed.frame_at(failed.fault.time)
    assert frame.fault_text == failed.fault.text


def test_a_robot_without_model_or_joints_has_frames_with_its_numbers(tmp_path: Path) -> None:
    program = str(BUILD / "tests/python/write_log")
    subprocess.run([program, str(tmp_path), "odd", "300"], check=True)
    run = LoggedRun(tmp_path / "log.mcap")
    assert run.scene is None
    frame = run.frame_at(run.end / 2)
    assert frame.position is None
    assert frame.values
    course = run.course(100.0)
    assert course.positions is None
    assert len(course)


def test_a_session_is_chosen_by_its_number_or_its_id(tmp_path: Path) -> None:
    simulation = trifinger.Simulation()
    with simulation.record(tmp_path) as recorder:
        for steps in (20, 30):
            with simulation.connect() as robot:
                robot.append_desired_actions(np.repeat(robot.new_action(), steps))
                robot.wait_until_time_index(steps - 1)
                robot.finish()
        recorder.stop()
    assert LoggedRun(tmp_path).last == 30
    ids = [session.session_id for session in trifinger.Log(tmp_path).sessions]
    for number, (session_id, steps) in enumerate(zip(ids, (20, 30), strict=False), 1):
        for wanted in (number, session_id):
            assert LoggedRun(tmp_path, "sim", wanted).last == steps
    with pytest.raises(InvalidArgument, match=r"no session 9 of 'sim'; it has 1 of 'sim' \(20 ste"):
        LoggedRun(tmp_path, "sim", 9)
    with pytest.raises(InvalidArgument, match="no session 1 of 'other'"):
        LoggedRun(tmp_path, "other", 1)


def test_a_log_without_steps_is_refused_by_the_name_of_its_robot(tmp_path: Path) -> None:
    with trifinger.simulate(record=tmp_path):
        pass
    with pytest.raises(InvalidArgument, match="sim"):
        LoggedRun(tmp_path)


# ---- frames of a part ----


def assert_is_of_the_log(course: Course, run: LoggedRun) -> None:
    assert (np.diff(course.time_index) > 0).all()
    for row, step in enumerate(course.time_index):
        frame = run.frame_at(run.time_of(int(step)))
        assert frame.time_index == step
        assert frame.time == pytest.approx(course.times[row], abs=1e-9)
        assert course.positions is not None
        np.testing.assert_array_equal(course.positions[row], frame.position)
        for name, pose in frame.objects.items():
            np.testing.assert_array_equal(course.objects[name][row], pose)


@pytest.mark.slow
@settings(max_examples=30)
@given(rate=st.floats(1.0, 3000.0), ends=st.lists(st.floats(0.0, 1.6), min_size=2, max_size=2))
def test_frames_of_a_part_are_steps_of_the_log_at_the_asked_times(
    run: LoggedRun, rate: float, ends: list[float]
) -> None:
    begin, end = sorted(ends)
    if begin > run.end:
        with pytest.raises(InvalidArgument):
            run.course(rate, begin, end)
        return
    course = run.course(rate, begin, end)
    expected = {run.step_at(time) for time in np.arange(begin, min(end, run.end), 1 / rate)}
    expected.add(run.step_at(min(end, run.end)))
    assert set(course.time_index) == expected


def test_frames_hold_what_the_log_has(run: LoggedRun) -> None:
    assert_is_of_the_log(run.course(50.0), run)


def test_frames_do_not_depend_on_how_many_steps_are_in_memory_at_once(
    run: LoggedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = run.course(77.0)
    for rows in (7, 100, 333):
        monkeypatch.setattr("trifinger.log.steps.ROWS", rows)
        part = run.course(77.0)
        np.testing.assert_array_equal(part.time_index, whole.time_index)
        np.testing.assert_array_equal(part.positions, whole.positions)
        np.testing.assert_array_equal(part.marks, whole.marks)


def test_no_mark_is_lost_however_few_frames_there_are(log_with_gap: LoggedRun) -> None:
    # The flags in this log are random.
    every = log_with_gap.course(1e5)
    for rate in (3.0, 20.0, 150.0):
        few = log_with_gap.course(rate)
        assert np.bitwise_or.reduce(few.marks) == np.bitwise_or.reduce(every.marks)
        for row in range(1, len(few)):
            between = (every.time_index > few.time_index[row - 1]) & (
                every.time_index <= few.time_index[row]
            )
            assert few.marks[row] == np.bitwise_or.reduce(every.marks[between])
    assert np.bitwise_or.reduce(every.marks) < 1 << len(MARKS)


@raises_in_a_check
@raises_in_a_check
def test_the_fault_is_always_among_the_frames(failed: LoggedRun) -> None:
    assert FAULT in failed.course(1.0).time_index


def test_a_part_that_the_log_does_not_have_is_refused_with_what_it_has(run: LoggedRun) -> None:
    with pytest.raises(InvalidArgument, match=re.escape("the log has 1.500 s")):
        run.course(30.0, 2.0, 3.0)
    with pytest.raises(InvalidArgument, match="above 0"):
        run.course(0.0)


# ---- the time line ----


class Clock:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


SPANS = st.lists(st.floats(0.0, 5.0), min_size=1, max_size=20)


@given(spans=SPANS, speed=st.floats(SLOWEST, FASTEST))
def test_playing_moves_by_speed_times_time_until_the_end(spans: list[float], speed: float) -> None:
    clock = Clock()
    line = TimeLine(2.0, 40.0, clock=clock)
    line.speed = speed
    line.play()
    for span in spans:
        clock.now += span
        expected = min(2.0 + speed * (clock.now - 100.0), 40.0)
        assert line.position == pytest.approx(expected)
        assert line.is_playing == (line.position < 40.0)


@given(spans=SPANS, moves=st.lists(st.floats(-10, 50), min_size=20, max_size=20))
def test_the_position_never_leaves_the_log(spans: list[float], moves: list[float]) -> None:
    clock = Clock()
    line = TimeLine(0.0, 30.0, clock=clock, is_looping=len(spans) % 2 == 0)
    line.play()
    for span, move in zip(spans, moves, strict=False):
        clock.now += span
        assert 0.0 <= line.position <= 30.0
        line.move_to(move)
        assert line.position == min(max(move, 0.0), 30.0)


@given(spans=SPANS)
def test_what_is_paused_stands_still(spans: list[float]) -> None:
    clock = Clock()
    line = TimeLine(0.0, 1000.0, clock=clock)
    line.play()
    clock.now += 3.0
    line.pause()
    for span in spans:
        clock.now += span
        assert line.position == pytest.approx(3.0)


@given(first=st.floats(SLOWEST, FASTEST), second=st.floats(SLOWEST, FASTEST))
def test_another_speed_goes_on_from_the_same_place(first: float, second: float) -> None:
    clock = Clock()
    line = TimeLine(0.0, 1000.0, clock=clock)
    line.speed = first
    line.play()
    clock.now += 2.0
    line.speed = second
    assert line.position == pytest.approx(2.0 * first)
    clock.now += 3.0
    assert line.position == pytest.approx(2.0 * first + 3.0 * second)


def test_a_line_that_loops_begins_again_with_what_was_left() -> None:
    clock = Clock()
    line = TimeLine(1.0, 5.0, clock=clock, is_looping=True)
    line.play()
    clock.now += 4.0 * 3 + 1.5
    assert line.position == pytest.approx(2.5)
    assert line.is_playing


def test_playing_at_the_end_begins_again() -> None:
    clock = Clock()
    line = TimeLine(0.0, 2.0, clock=clock)
    line.move_to(2.0)
    line.play()
    assert line.position == 0.0
    clock.now += 0.5
    assert line.position == pytest.approx(0.5)


def test_steps_and_the_jump_to_the_fault_stand_still_there() -> None:
    clock = Clock()
    line = TimeLine(0.0, 10.0, fault=7.0, clock=clock)
    line.play()
    clock.now += 1.0
    line.step(0.25)
    clock.now += 1.0
    assert line.position == pytest.approx(1.25)
    line.step(-5.0)
    assert line.position == 0.0
    line.play()
    assert line.jump_to_fault()
    clock.now += 1.0
    assert line.position == 7.0
    assert not line.is_playing
    assert not TimeLine(0.0, 1.0).jump_to_fault()


def test_a_clock_that_goes_back_moves_nothing() -> None:
    clock = Clock()
    line = TimeLine(0.0, 10.0, clock=clock)
    line.play()
    clock.now += 2.0
    assert line.position == pytest.approx(2.0)
    clock.now -= 1.0
    assert line.position == pytest.approx(2.0)


@pytest.mark.parametrize("speed", [0.0, SLOWEST / 2, FASTEST * 2, float("nan"), -1.0])
def test_speeds_out_of_range_are_refused_and_change_nothing(speed: float) -> None:
    line = TimeLine(0.0, 1.0)
    with pytest.raises(InvalidArgument, match=re.escape("from 0.1 to 10 times")):
        line.speed = speed
    assert line.speed == 1.0


def test_a_log_of_one_moment_can_be_shown_but_not_played() -> None:
    line = TimeLine(3.0, 3.0)
    line.play()
    assert not line.is_playing
    assert line.position == 3.0
    with pytest.raises(InvalidArgument, match="must begin before it ends"):
        TimeLine(1.0, 0.0)
    with pytest.raises(InvalidArgument, match="not a number"):
        line.move_to(float("nan"))


# ---- damaged logs ----


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    (file,) = record(tmp_path_factory.mktemp("whole"), steps=100).glob("*.mcap")
    return file


@pytest.mark.parametrize("damaged", [range(5), range(95, 100), range(20, 30)])
def test_a_log_with_damaged_steps_is_shown_without_them(
    whole: Path, tmp_path: Path, damaged: range
) -> None:
    count = iter(range(1000))

    def cut(topic: str, data: bytes) -> bytes:
        return data[:-1] if topic == "/sim/step" and next(count) in damaged else data

    copy_changed(whole, tmp_path / "damaged.mcap", {}, cut)
    run = LoggedRun(tmp_path / "damaged.mcap")
    frames = run.course(1000.0)
    assert not {int(step) for step in frames.time_index} & set(damaged)
    assert run.step_at(0.0) == frames.time_index[0]
    assert run.step_at(run.end) == frames.time_index[-1]


def test_a_log_with_damaged_messages_only_is_refused_with_a_sentence(
    whole: Path, tmp_path: Path
) -> None:
    path = tmp_path / "damaged.mcap"
    copy_changed(whole, path, {}, lambda _, data: data[: len(data) // 2])
    with pytest.raises(InvalidArgument, match=r"no step of 'sim' can be read.*log check"):
        LoggedRun(path)
