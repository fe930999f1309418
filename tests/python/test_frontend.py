# SPDX-License-Identifier: BSD-3-Clause
"""What the front-end promises, with a robot inside the program."""

import os
import re
import threading

import numpy as np
import pytest
import trifinger
from conftest import StartChild
from hypothesis import given, strategies as st

pytestmark = pytest.mark.bindings


def append(robot: trifinger.Frontend, count: int, start: float = 0.0) -> int:
    t = -1
    for i in range(count):
        t = robot.append_desired_action(robot.new_action(setpoint=start + i))
    return t


def test_the_observation_of_step_t_shows_the_actions_before_t(robot: trifinger.Frontend) -> None:
    t = robot.append_desired_action(robot.new_action(setpoint=1.5))
    assert t == 0
    assert robot.get_observation(0).applied_actions == 0
    t = robot.append_desired_action(robot.new_action(setpoint=2.5))
    assert t == 1
    assert robot.get_observation(1).setpoint == 1.5
    assert robot.get_observation(1).applied_actions == 1


def test_every_series_can_be_read_by_step(robot: trifinger.Frontend) -> None:
    append(robot, 3, start=10.0)
    robot.wait_until_time_index(2)
    assert robot.get_desired_action(2).setpoint == 12.0
    assert robot.get_applied_action(2).setpoint == 12.0
    assert robot.get_status(2).tick == 2
    assert robot.current_time_index() == 2


@given(
    count=st.integers(1, 200),
    data=st.data(),
)
def test_a_range_of_steps_is_the_steps_one_by_one(count: int, data: st.DataObject) -> None:
    robot = trifinger.fake()
    append(robot, count)
    first = data.draw(st.integers(0, count - 1))
    last = data.draw(st.integers(first, count))
    many = robot.get_observations(first, last)
    assert many.shape == (last - first,)
    assert many.dtype == robot.observation_dtype
    assert [element.tobytes() for element in many] == [
        robot.get_observation(t).tobytes() for t in range(first, last)
    ]
    assert robot.get_desired_actions(first, last)["setpoint"].tolist() == list(range(first, last))
    assert (robot.get_statuses(first, last)["tick"] == np.arange(first, last)).all()
    assert len(robot.get_applied_actions(first, last)) == last - first


@given(st.lists(st.floats(allow_nan=False), min_size=1, max_size=50))
def test_a_burst_is_its_actions_one_by_one(setpoints: list[float]) -> None:
    robot = trifinger.fake()
    actions = np.zeros(len(setpoints), robot.action_dtype)
    actions["setpoint"] = setpoints
    assert robot.append_desired_actions(actions) == len(setpoints) - 1
    robot.finish()
    taken = robot.get_desired_actions(0, len(setpoints))
    assert taken.tobytes() == actions.tobytes()


def test_a_burst_may_be_a_slice_with_gaps(robot: trifinger.Frontend) -> None:
    actions = np.zeros(10, robot.action_dtype)
    actions["setpoint"] = np.arange(10)
    assert robot.append_desired_actions(actions[::3]) == 3
    robot.finish()
    assert robot.get_desired_actions(0, 4)["setpoint"].tolist() == [0, 3, 6, 9]


def test_a_burst_may_be_longer_than_the_queue(robot: trifinger.Frontend) -> None:
    actions = np.zeros(10_000, robot.action_dtype)
    actions["setpoint"] = np.arange(10_000)
    assert robot.append_desired_actions(actions) == 9_999
    robot.finish()
    assert robot.range("applied_action") == (0, 10_000)


def test_one_can_look_before_acting(robot: trifinger.Frontend) -> None:
    assert robot.latest_observation().applied_actions == 0
    assert robot.current_time_index() == -1


def test_fault_34_the_history_is_finite() -> None:
    robot = trifinger.fake(history=64)
    last = append(robot, 100)
    robot.wait_until_time_index(last)
    oldest, end = robot.range("observation")
    assert (oldest, end) == (36, 100)
    assert len(robot.get_observations(oldest, end)) == 64
    with pytest.raises(trifinger.HistoryLost, match="step 35 has been overwritten") as raised:
        robot.get_observation(35)
    assert raised.value.oldest == 36


def test_a_wait_for_an_action_that_nobody_appends_is_an_error(robot: trifinger.Frontend) -> None:
    with pytest.raises(trifinger.ActionMissing, match="needs an action that has not been appended"):
        robot.get_observation(1)


def test_an_action_after_its_observation_is_marked(robot: trifinger.Frontend) -> None:
    append(robot, 1)
    robot.get_observation(1)
    append(robot, 1)
    robot.get_observation(2)
    assert robot.get_status(1).flags & trifinger.Status.ACAUSAL
    assert not robot.get_status(0).flags & trifinger.Status.ACAUSAL


def test_strict_front_ends_refuse_an_action_after_its_observation() -> None:
    robot = trifinger.fake(strict=True)
    append(robot, 1)
    robot.get_observation(1)
    with pytest.raises(trifinger.AcausalAction, match=r"compute a\[t\+1\] from y\[t\]"):
        append(robot, 1)


def test_finish_ends_the_session_after_the_last_action(robot: trifinger.Frontend) -> None:
    append(robot, 5)
    assert robot.fault() is None
    robot.finish()
    assert robot.range("applied_action") == (0, 5)
    assert robot.range("observation") == (0, 6)
    assert robot.get_status(5).flags & trifinger.Status.END
    assert robot.fault() == trifinger.Fault("finished", time_index=5)
    with pytest.raises(trifinger.RobotStopped, match="the controller finished at step 5") as raised:
        robot.get_observation(6)
    assert raised.value.fault == robot.fault()


def test_a_fault_reaches_the_user_with_its_code_and_step() -> None:
    robot = trifinger.fake(action_fault_after=3)
    append(robot, 10)
    with pytest.raises(trifinger.RobotStopped, match="a fault was injected") as raised:
        robot.get_observation(5)
    assert raised.value.fault == trifinger.Fault(
        "driver", detail=7, time_index=3, needs_recovery=True
    )


def test_a_clean_with_block_finishes() -> None:
    with trifinger.fake() as robot:
        append(robot, 2)
        observer = robot  # the end of the block closes the handle
    with pytest.raises(trifinger.InvalidArgument, match="closed"):
        observer.latest_observation()


def test_a_with_block_does_not_hide_the_exception_that_ends_it() -> None:
    def fail() -> None:
        with trifinger.fake(action_fault_after=0) as robot:
            append(robot, 1)
            raise KeyError

    with pytest.raises(KeyError):
        fail()


def test_a_with_block_that_ends_in_a_fault_says_so() -> None:
    def end_in_a_fault() -> None:
        with trifinger.fake(action_fault_after=1) as robot:
            append(robot, 5)

    with pytest.raises(trifinger.RobotStopped, match="a fault was injected"):
        end_in_a_fault()


def test_close_can_be_called_again() -> None:
    robot = trifinger.fake()
    robot.close()
    robot.close()


def test_companions_are_read_by_the_step_at_which_they_arrived() -> None:
    robot = trifinger.fake(sensor_period=5, sensor_delay=2)
    sensor = robot.companion("sensor")
    append(robot, 20)
    for t in range(20):
        reading = sensor.get_latest_at(t)
        if t < 2:
            assert reading is None
            continue
        assert reading is not None
        assert reading.stamp.capture_index == (t - 2) // 5 * 5
        assert reading.stamp.arrival_index == reading.stamp.capture_index + 2
        assert reading.applied_actions == reading.stamp.capture_index


def test_a_companion_outlives_the_handle_it_came_from() -> None:
    robot = trifinger.fake(sensor_period=1)
    append(robot, 3)
    robot.wait_until_time_index(2)
    sensor = robot.companion("sensor")
    robot.close()
    reading = sensor.get_latest_at(2)
    assert reading is not None
    assert reading.applied_actions == 2


def test_a_companion_has_observations_only() -> None:
    robot = trifinger.fake(sensor_period=1)
    sensor = robot.companion("sensor")
    with pytest.raises(trifinger.InvalidArgument):
        sensor.get_desired_action(0)
    with pytest.raises(trifinger.InvalidArgument):
        _ = sensor.action_dtype
    with pytest.raises(trifinger.InvalidArgument):
        sensor.append_desired_action(robot.new_action())
    with pytest.raises(trifinger.InvalidArgument, match="get_latest_at reads companions"):
        robot.get_latest_at(0)


@pytest.mark.parametrize("timeout", [-1, -0.001, float("nan"), "soon", [1]])
def test_a_timeout_is_a_time(robot: trifinger.Frontend, timeout: float) -> None:
    with pytest.raises(trifinger.InvalidArgument, match="timeout is"):
        robot.latest_observation(timeout=timeout)


@pytest.mark.parametrize("timeout", [None, 0, 0.0, 1, np.float32(1), float("inf"), 1e300])
def test_every_time_is_a_timeout(robot: trifinger.Frontend, timeout: float | None) -> None:
    robot.latest_observation(timeout=timeout)


@pytest.mark.parametrize(("first", "last"), [(-1, 0), (2, 1), (-5, -3)])
def test_a_range_goes_forward_from_0(robot: trifinger.Frontend, first: int, last: int) -> None:
    with pytest.raises(trifinger.InvalidArgument, match="no range"):
        robot.get_observations(first, last)


def test_a_range_is_no_longer_than_the_history(robot: trifinger.Frontend) -> None:
    with pytest.raises(trifinger.InvalidArgument, match="more than the history keeps"):
        robot.get_observations(0, 1_000_000)


def test_steps_begin_at_0(robot: trifinger.Frontend) -> None:
    with pytest.raises(trifinger.InvalidArgument, match="steps begin at 0"):
        robot.get_observation(-1)


def test_an_unknown_series_is_an_error_that_names_those_there_are(
    robot: trifinger.Frontend,
) -> None:
    with pytest.raises(trifinger.InvalidArgument, match=r"'obs'.*desired_action"):
        robot.range("obs")


def test_session_info_says_who_takes_part(robot: trifinger.Frontend) -> None:
    info = robot.session_info()
    assert info.type == "fake"
    assert info.period == 0.001
    assert info.phase == "holding"
    assert info.controller_pid == info.backend_pid
    assert info.fault is None
    append(robot, 4)
    robot.finish()
    assert robot.session_info().steps == 4
    assert robot.session_info().fault == robot.fault()


# ---- printed ----


def test_a_front_end_prints_with_robot_and_step(start_fake: StartChild) -> None:
    start_fake("printed", sensor_period=2)
    with trifinger.connect("printed") as robot, trifinger.observe("printed") as observer:
        assert re.fullmatch(r"<Frontend of 'printed', (preparing|holding)>", repr(robot))
        robot.append_desired_actions(np.repeat(robot.new_action(), 11))
        robot.wait_until_time_index(11)
        assert repr(robot) == repr(observer) == "<Frontend of 'printed', running, step 11>"
        assert str(robot) == repr(robot)
        assert re.fullmatch(
            r"<Frontend of 'printed.sensor', running, \d+ elements>",
            repr(robot.companion("sensor")),
        )
        robot.finish()
        assert repr(robot) == "<Frontend of 'printed', ended (finished), step 11>"
    assert repr(robot) == "<Frontend, closed>"


def test_a_front_end_prints_when_its_back_end_is_gone(start_fake: StartChild) -> None:
    backend = start_fake("killed")
    robot = trifinger.connect("killed")
    robot.append_desired_action(robot.new_action())
    robot.wait_until_time_index(0)
    backend.kill()
    assert re.match(r"<Frontend of 'killed', its back-end is gone, step \d>", repr(robot))
    robot.close()


def test_a_front_end_prints_while_another_thread_waits_with_it() -> None:
    with trifinger.run_fake("waits"), trifinger.connect("waits") as robot:
        robot.append_desired_action(robot.new_action())
        thread = threading.Thread(target=robot.wait_until_time_index, args=(5,))
        thread.start()
        assert "of 'waits'" in repr(robot)
        robot.append_desired_actions(np.repeat(robot.new_action(), 5))
        thread.join()


def test_a_front_end_of_another_process_prints() -> None:
    robot = trifinger.fake()
    child = os.fork()
    if child == 0:
        os._exit(0 if repr(robot).startswith("<Frontend") else 1)
    assert os.waitpid(child, 0)[1] == 0
    robot.close()


def test_simulations_back_ends_and_times_print() -> None:
    simulation = trifinger.Simulation("trifinger_edu")
    assert repr(simulation) == "<Simulation of 'trifinger-edu'>"
    with trifinger.run_fake("printed") as backend:
        assert repr(backend) == "<Backend of 'printed'>"
    assert repr(backend) == "<Backend of 'printed', stopped>"
