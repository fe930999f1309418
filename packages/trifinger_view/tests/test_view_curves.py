# SPDX-License-Identifier: BSD-3-Clause
"""Curves of the last seconds: few points, and no peak is lost."""

import dataclasses
import itertools

import numpy as np
import trifinger
from hypothesis import given, strategies
from trifinger.session_info import Fault
from trifinger_view.curves import EVENTS, TORQUE, TRACKING, Window, series_of
from trifinger_view.words import lines_of, missing

PERIOD = 0.001


def cut(total: int, places: list[int]) -> list[slice]:
    edges = sorted({0, total, *(place % (total + 1) for place in places)})
    return [slice(first, last) for first, last in itertools.pairwise(edges)]


@given(
    steps=strategies.integers(1, 3000),
    first=strategies.integers(0, 10_000_000),
    places=strategies.lists(strategies.integers(0, 3000), max_size=8),
    seed=strategies.integers(0, 99),
)
def test_a_window_does_not_depend_on_how_often_one_looks(
    steps: int, first: int, places: list[int], seed: int
) -> None:
    times = (first + np.arange(steps)) * PERIOD
    numbers = np.random.default_rng(seed)
    series = {"a": numbers.normal(size=(steps, 2)), EVENTS: np.ones((steps, 1))}
    whole, parts = Window(seconds=1.0), Window(seconds=1.0)
    whole.add(times, series)
    for part in cut(steps, places):
        parts.add(times[part], {title: rows[part] for title, rows in series.items()})
    np.testing.assert_array_equal(whole.times, parts.times)
    for title in series:
        np.testing.assert_array_equal(whole.series[title], parts.series[title])


@given(strategies.integers(1, 900), strategies.integers(0, 899), strategies.booleans())
def test_a_peak_of_a_single_step_stays_and_every_event_counts(
    steps: int, place: int, is_low: bool
) -> None:
    rows = np.full((steps, 1), 0.25)
    rows[place % steps] = -9.0 if is_low else 9.0
    window = Window(seconds=1.0)
    window.add(np.arange(steps) * PERIOD, {"a": rows, EVENTS: np.ones((steps, 1))})
    assert (window.series["a"] == rows[place % steps]).sum() == 1
    assert window.series[EVENTS].sum() == steps


def test_a_window_is_bounded_and_begins_anew_when_time_goes_back() -> None:
    window = Window(seconds=2.0, rate=10.0)
    for k in range(100):
        window.add(np.array([k * 0.5]), {"a": np.array([[k]])})
        assert len(window.times) <= 20
        assert window.times[-1] - window.times[0] < 2.0
    window.add(np.array([0.0]), {"a": np.array([[7.0]])})
    assert window.times.tolist() == [0.0]
    window.add(np.array([0.5]), {"b": np.array([[1.0, 2.0]])})  # other lines
    assert list(window.series) == ["b"]


def test_robots_with_joints_have_torques_and_errors_without_targets_that_were_not_given() -> None:
    with trifinger.simulate() as robot:
        actions = np.repeat(robot.new_action(), 50)
        actions["position"][:, 1] = 1.0
        last = robot.append_desired_actions(actions)
        robot.get_observation(last)
        read = robot.get_observations(0, 50), robot.get_desired_actions(0, 50)
        series = series_of(*read, robot.get_statuses(0, 50), PERIOD, False)
    assert series[TORQUE].shape == (50, 9)
    error = series[TRACKING]
    np.testing.assert_allclose(error[:, 1], 1.0 - read[0]["position"][:, 1])
    assert not np.delete(error, 1, axis=1).any()
    assert EVENTS not in series  # without real time nothing is late


def test_robots_of_other_kinds_have_curves_of_their_own_fields() -> None:
    with trifinger.fake() as robot:
        robot.get_observation(robot.append_desired_actions(np.repeat(robot.new_action(), 5)))
        series = series_of(
            robot.get_observations(0, 5), robot.get_desired_actions(0, 5), None, PERIOD, True
        )
        assert {*series} >= {"setpoint", "applied_actions"}
        lines = lines_of(robot.session_info(), None, robot.timing(), {"stuck": [1, 4]})
    texts = {line.label: line for line in lines}
    assert texts["state"].text == "runs"
    assert texts["safety"].text == "joints 1, 4: stuck"
    assert texts["safety"].level == "warning"


def test_a_back_end_that_was_asked_to_stop_is_no_error() -> None:
    with trifinger.fake() as robot:
        info = robot.session_info()
    for code, level in (("stopped", ""), ("driver", "bad")):
        ended = dataclasses.replace(
            info, backend_is_alive=False, phase="ended", fault=Fault(code), fault_text="it ended"
        )
        lines = {line.label: line for line in lines_of(ended, None, None, {})}
        assert lines["state"].level == level
        assert ("remedy" in lines) == bool(level)


def test_without_a_robot_the_words_say_how_to_start_it() -> None:
    assert [line.text for line in missing("bot")] == [
        "no robot 'bot' runs; this page shows it as soon as it does",
        "trifinger run bot",
    ]
    assert missing("")[1].text == "trifinger run sim"
