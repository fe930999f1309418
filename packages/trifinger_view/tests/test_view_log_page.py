# SPDX-License-Identifier: BSD-3-Clause
"""The page of a log without a browser: what its panel does and what it shows."""

import contextlib
import gc
from collections.abc import Iterator

import numpy as np
import pytest
import trifinger
from trifinger_view.authentication import Authentication, page_server
from trifinger_view.curves import TORQUE, TRACKING
from trifinger_view.log_page import LogPage
from trifinger_view.logged import LoggedRun
from trifinger_view.page import Page


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> LoggedRun:
    """Three seconds of a simulated robot; its joints are asked for another pose after one."""
    folder = tmp_path_factory.mktemp("log")
    with trifinger.simulate(record=folder) as robot:
        actions = np.repeat(robot.new_action(), 3000)
        actions["position"] = robot.latest_observation().position
        actions["position"][1000:] += 0.2
        robot.append_desired_actions(actions)
        robot.finish()
    del robot
    gc.collect()  # the simulation, and its recorder with it, so that the log is finished
    return LoggedRun(folder)


@pytest.fixture
def page() -> Iterator[Page]:
    with contextlib.closing(Authentication(port=0)) as authentication:
        server = page_server(authentication, "test")
        yield Page(server, "test")
        server.stop()


def test_the_page_shows_the_step_of_the_time_line(page: Page, run: LoggedRun) -> None:
    clock = Clock()
    shown = LogPage(page, run, clock)
    for time in (0.0, 0.5, 2.25, run.end, 1.0):
        shown.line.move_to(time)
        clock.now += 1.0
        shown.renew()
        frame = run.frame_at(time)
        assert f'class="trifinger-step">{frame.time_index}<' in page._shown_state
        assert page.scene.scene is not None
        places, _ = page.scene.scene.poses(frame.position, frame.objects)
        for node, place in zip(page.scene._bodies, places, strict=True):
            np.testing.assert_allclose(node._place, place)
        assert shown._slider.value == pytest.approx(time, abs=0.001)


def test_the_ghost_appears_only_where_the_robot_is_not_yet(page: Page, run: LoggedRun) -> None:
    clock = Clock()
    shown = LogPage(page, run, clock)
    seen = []
    for time in (0.5, 1.01, 2.9):
        shown.line.move_to(time)
        clock.now += 1.0
        shown.renew()
        seen.append(any(node._is_seen for node in page.scene._ghosts))
    assert seen == [False, True, False]


def test_it_plays_at_the_speed_of_the_clock_and_stops_at_the_end(
    page: Page, run: LoggedRun
) -> None:
    clock = Clock()
    shown = LogPage(page, run, clock)
    shown._set_speed("0.5")
    shown._set_speed("1e9")  # a browser can send anything
    shown.line.play()
    shown.renew()
    assert shown._play.label == "Pause"
    clock.now += 2.0
    shown.renew()
    assert shown.line.position == pytest.approx(1.0)
    clock.now += 60.0
    shown.renew()
    assert shown.line.position == run.end
    assert shown._play.label == "Play"


def test_buttons_go_by_steps_and_by_seconds(page: Page, run: LoggedRun) -> None:
    shown = LogPage(page, run, Clock())
    shown.line.move_to(1.0)
    for what, step in (("+1 step", 1001), ("-1 step", 1000), ("+1 s", 2000), ("nothing", 2000)):
        shown._step(what)
        assert run.step_at(shown.line.position) == step
        assert not shown.line.is_playing


def test_a_slider_that_a_hand_moves_is_not_moved_by_the_page(page: Page, run: LoggedRun) -> None:
    clock = Clock()
    shown = LogPage(page, run, clock)
    shown.line.play()
    clock.now += 0.25
    shown._slider.value = 2.0
    shown._move(is_by_hand=True)
    shown.renew()
    assert shown.line.position == pytest.approx(2.0)
    clock.now += 0.25
    shown.renew()
    assert shown._slider.value == 2.0
    clock.now += 0.5
    shown.renew()
    assert shown._slider.value == pytest.approx(2.75)


def test_curves_are_those_of_the_seconds_around(page: Page, run: LoggedRun) -> None:
    window = LogPage(page, run, Clock()).curves_at(1.5)
    assert window.times[0] == 0.0
    assert abs(window.times[-1] - run.end) < 0.1
    assert window.series[TORQUE].shape[1] == 9
    largest = np.abs(window.series[TRACKING]).max(axis=1)
    assert window.times[largest.argmax()] == pytest.approx(1.0, abs=0.05)


def test_nothing_is_read_while_nobody_watches(page: Page, run: LoggedRun) -> None:
    shown = LogPage(page, run, Clock())
    shown.renew(is_watched=False)
    assert page._shown_state == ""
