# SPDX-License-Identifier: BSD-3-Clause
"""The page of a log without a browser: what its panel does and what it shows."""

import gc
import json
from typing import Any

import numpy as np
import pytest
import trifinger
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


class Server:
    """Notes what browsers would be told: the newest of each kind."""

    browsers = (1,)

    def __init__(self) -> None:
        self.told: dict[str, dict[str, Any]] = {}
        self.numbers: dict[str, bytes] = {}

    def put(self, kind: str, message: bytes) -> None:
        size = 4 + int.from_bytes(message[:4], "little")
        self.told[kind], self.numbers[kind] = json.loads(message[4:size]), message[size:]

    def poses(self) -> np.ndarray:
        """Those of the bodies in the newest frame."""
        offset, count = self.told["frame"]["poses"]
        return np.frombuffer(self.numbers["frame"], "<f4", count, offset).reshape(-1, 7)


@pytest.fixture
def server() -> Server:
    return Server()


@pytest.fixture
def page(server: Server) -> Page:
    return Page(server)  # type: ignore[arg-type]


def test_the_page_shows_the_step_of_the_time_line(
    server: Server, page: Page, run: LoggedRun
) -> None:
    clock = Clock()
    shown = LogPage(page, run, clock)
    for time in (0.0, 0.5, 2.25, run.end, 1.0):
        shown.do({"do": "move", "time": time})
        clock.now += 1.0
        shown.renew()
        frame = run.frame_at(time)
        lines = {line["label"]: line["text"] for line in server.told["state"]["lines"]}
        assert lines["step"] == str(frame.time_index)
        assert server.told["frame"]["session"] == server.told["session"]["session"]
        assert run.scene is not None
        poses = np.concatenate(run.scene.poses(frame.position, frame.objects), axis=1)
        np.testing.assert_allclose(server.poses(), poses, atol=1e-6)
        assert server.told["line"]["position"] == pytest.approx(time, abs=0.001)


def test_the_camera_has_room_for_the_whole_log(server: Server, page: Page, run: LoggedRun) -> None:
    LogPage(page, run, Clock()).renew()
    home = server.told["session"]["home"]
    assert run.scene is not None
    for time in np.linspace(0, run.end, 7):
        frame = run.frame_at(time)
        for corner in run.scene.bounds(frame.position, frame.objects):
            assert np.linalg.norm(corner - home["middle"]) < 1.05 * home["radius"]


def test_the_ghost_appears_only_where_the_robot_is_not_yet(
    server: Server, page: Page, run: LoggedRun
) -> None:
    clock = Clock()
    shown = LogPage(page, run, clock)
    seen = []
    for time in (0.5, 1.01, 2.9):
        shown.line.move_to(time)
        clock.now += 1.0
        shown.renew()
        seen.append(server.told["frame"]["ghosts"] is not None)
    assert seen == [False, True, False]


def test_it_plays_at_the_speed_of_the_clock_and_stops_at_the_end(
    server: Server, page: Page, run: LoggedRun
) -> None:
    clock = Clock()
    shown = LogPage(page, run, clock)
    shown.do({"do": "speed", "speed": 0.5})
    shown.do({"do": "toggle"})
    shown.renew()
    assert server.told["line"]["isPlaying"]
    clock.now += 2.0
    shown.renew()
    assert shown.line.position == pytest.approx(1.0)
    clock.now += 60.0
    shown.renew()
    assert shown.line.position == run.end
    assert not server.told["line"]["isPlaying"]


def test_buttons_go_by_steps_and_by_seconds(page: Page, run: LoggedRun) -> None:
    shown = LogPage(page, run, Clock())
    shown.line.move_to(1.0)
    for asked, step in (
        ({"do": "step", "steps": 1}, 1001),
        ({"do": "step", "steps": -1}, 1000),
        ({"do": "skip", "seconds": 1}, 2000),
    ):
        shown.do(asked)
        assert run.step_at(shown.line.position) == step
        assert not shown.line.is_playing


@pytest.mark.parametrize("value", [None, "x", [], {}, 1e9, -1.0, float("nan")])
def test_what_makes_no_sense_changes_nothing(page: Page, run: LoggedRun, value: object) -> None:
    shown = LogPage(page, run, Clock())
    shown.line.move_to(1.0)
    shown.do({"do": "speed", "speed": value})
    if not isinstance(value, float) or value != value:
        for do, name in (("move", "time"), ("skip", "seconds"), ("step", "steps")):
            shown.do({"do": do, name: value})
            shown.do({"do": do})
    shown.do({"do": str(value)})
    assert (shown.line.speed, shown.line.position) == (1.0, 1.0)


def test_curves_are_those_of_the_seconds_around(page: Page, run: LoggedRun) -> None:
    window = LogPage(page, run, Clock()).curves_at(1.5)
    assert window.times[0] == 0.0
    assert abs(window.times[-1] - run.end) < 0.1
    assert window.series[TORQUE].shape[1] == 9
    largest = np.abs(window.series[TRACKING]).max(axis=1)
    assert window.times[largest.argmax()] == pytest.approx(1.0, abs=0.05)


def test_nothing_is_read_while_nobody_watches(server: Server, page: Page, run: LoggedRun) -> None:
    shown = LogPage(page, run, Clock())
    shown.renew(is_watched=False)
    assert server.told == {}
