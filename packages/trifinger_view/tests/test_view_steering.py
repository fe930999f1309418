# SPDX-License-Identifier: BSD-3-Clause
"""Steering a robot through the server of its page, with the messages that a browser sends."""

import contextlib
import http.client
import os
import signal
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import trifinger
from conftest import PATIENT, StartProgram
from test_view_authentication import browse, messages_of, send
from trifinger_view.authentication import LOOPBACK
from trifinger_view.scene import scene_of
from viewing import StartView, Viewing

pytestmark = pytest.mark.slow

UP = np.array([0.0, 0.0, 1.0])


def ask(page: Viewing, path: str, **headers: str) -> tuple[int, str]:
    """Asks as a script of the page does."""
    connection = http.client.HTTPConnection(LOOPBACK, page.port)
    with contextlib.closing(connection):
        cookie = {"Cookie": f"{page.cookie}={page.token}"}
        connection.request("GET", path, headers=cookie | headers)
        answer = connection.getresponse()
        return answer.status, answer.read().decode()


class Steering:
    """A browser as a program: what the server has sent it, and what it sends."""

    def __init__(self, connection: Any) -> None:
        self._connection = connection
        self._messages = messages_of(connection)
        self.seat: dict[str, Any] = {}
        """The sliders and handles that it has."""
        self.control: dict[str, Any] = {}
        """What the panel shows to all."""

    def send(self, do: str, **asked: Any) -> None:
        send(self._connection, do, **asked)

    def wait(self, found: Callable[[dict[str, Any]], bool]) -> None:
        """Reads up to the message for which this is so."""
        for message in self._messages:
            if message["kind"] in ("seat", "control"):
                setattr(self, message["kind"], message)
            if found(message):
                return
        raise AssertionError("the connection was closed")

    def wait_until(self, is_so: Callable[[], bool]) -> None:
        """Reads until this is so; a robot that is shown sends something all the time."""
        if not is_so():
            self.wait(lambda _: is_so())

    def says(self, text: str) -> None:
        """Waits until the panel says this."""
        self.wait_until(lambda: text in self.words)

    @property
    def words(self) -> str:
        """What the panel says."""
        if not self.control:
            return ""
        return f"{self.control['words']} {self.control['others'] * self.control['isTaken']}"

    def watch(self, times: int = 2) -> None:
        """Waits until the page has shown the robot anew so many times."""
        for _ in range(times):
            self.wait(lambda message: message["kind"] == "state")

    def take_control(self, handle: str = "frame_0") -> None:
        """Takes control and waits for a handle."""
        self.send("take")
        self.wait_until(lambda: _name(handle) in self.seat.get("handles", ()))

    def move(self, handle: str, *points: object) -> None:
        for point in points:
            place = point.tolist() if isinstance(point, np.ndarray) else point
            self.send("drag", point=place, **_name(handle))

    def end_drag(self) -> None:
        self.send("drop")

    def drag(self, handle: str, *points: object) -> None:
        self.move(handle, *points)
        self.end_drag()


def _name(handle: str) -> dict[str, object]:
    """How a page names a handle: "frame_0", or an object."""
    kind, _, number = handle.partition("_")
    return {"frame": int(number)} if kind == "frame" else {"object": handle}


class Robot:
    """A simulated robot that another process runs."""

    def __init__(self, start_program: StartProgram, *words: str) -> None:
        self.program = start_program("run", "sim", *PATIENT, *words)
        self.program.wait_for("waits for a user")
        self.follow()

    def follow(self) -> None:
        """Looks at the newest session."""
        self.frontend = trifinger.observe("sim")
        self.objects = self.frontend.companion("object")
        scene = scene_of(self.frontend.documents())
        assert scene is not None
        self.scene = scene

    def wait_for_end(self) -> None:
        with contextlib.suppress(trifinger.RobotStopped):
            while True:
                self.frontend.get_observation(self.frontend.range("observation")[1] + 10)

    def joints(self) -> Any:
        return self.frontend.latest_observation()["position"]

    def tips(self) -> Any:
        return self.scene.tips(self.joints())[0]

    def object(self) -> Any:
        """Where the cube is [m]."""
        return self.objects.latest_observation()["cube"]["position"]

    def is_pulled(self) -> bool:
        """Whether a hand pulls at something."""
        return bool(self.frontend.companion("hand").latest_observation()["body"] >= 0)


@pytest.fixture
def robot(start_program: StartProgram) -> Robot:
    return Robot(start_program)


def path(start: Any, end: Any) -> Iterator[Any]:
    """Where a hand leads something: in steps of about a millimetre."""
    steps = int(np.linalg.norm(end - start) / 1e-3) + 2
    yield from np.linspace(start, end, steps)


def is_near(place: Any, goal: Any, distance: float = 5e-3) -> bool:
    return bool(np.linalg.norm(place - goal) < distance)


def test_a_drag_moves_a_tip_and_a_driver_that_goes_leaves_the_robot_to_others(
    start_view: StartView, robot: Robot
) -> None:
    page = start_view("sim", "--control")
    with browse(page) as watching:
        second = Steering(watching)
        with browse(page) as driving:
            driver = Steering(driving)
            driver.take_control()
            start = robot.tips()
            goal = start[0] + 0.03 * UP
            driver.drag("frame_0", *path(start[0], goal))
            driver.wait_until(lambda: is_near(robot.tips()[0], goal))
            assert robot.tips()[1:] == pytest.approx(start[1:], abs=3e-3)
            second.says("a browser has control")
            # The handle is not the other browser's, whatever it sends.
            assert "handles" not in second.seat
            second.drag("frame_0", start[0] - 0.02 * UP)
            second.send("take")
            second.says("another browser has control")
            assert is_near(robot.tips()[0], goal)
        second.says("the browser that drove has gone")
    with browse(page) as connection:
        Steering(connection).take_control()
    assert ask(page, "/stop")[0] == 403
    assert robot.frontend.session_info().backend_is_alive
    assert ask(page, "/stop", **{"X-TriFinger": "stop"})[0] == 202
    robot.program.process.wait()
    assert ask(page, "/stopped", **{"X-TriFinger": "stop"})[0] == 200


# Points that are none: they are refused.
NO_POINTS: tuple[Any, ...] = (
    [],
    [0.0, 0.1],
    [0.0, 0.0, 0.1, 0.1],
    ["up", "up", "up"],
    [[0.0, 0.0, 0.1]],
    [0.0] * 500,
    [1e300, 0.0, 0.0],
    [2**63, 0, 0],
    {},
    "abc",
    None,
    0.1,
    [None, None, None],
    {"x": 1, "y": 2, "z": 3},
)
# What is no message: it ends its connection.
NO_MESSAGES = (
    '{"do": "drag", "frame": 0, "point": [NaN, 0, 0.1]}',
    '{"do": "drag", "frame": 0, "point": [0, Infinity, 0.1]}',
    '{"do": "joint", "joint": 0, "position": NaN}',
    "drag",
    '["drag"]',
)


def test_fault_68_points_that_are_none_move_nothing_and_control_goes_on(
    start_view: StartView, robot: Robot
) -> None:
    page = start_view("sim", "--control")
    with browse(page) as connection:
        driver = Steering(connection)
        driver.take_control()
        start = robot.tips()
        for point in NO_POINTS:
            driver.drag("frame_0", point)
            driver.drag("cube", point)
            driver.send("mode", mode=point)
            if type(point) is not float:
                driver.send("joint", joint=1, position=point)
                driver.send("joint", joint=point, position=0.1)
            driver.watch(1)
        unknown: Any
        for unknown in (7, -1, 0.5, "0", True, None, [], 2**70):
            driver.send("drag", frame=unknown, point=[0.0, 0.0, 0.1])
            driver.send("joint", joint=unknown if unknown != 7 else 9, position=0.1)
        for unknown in ("", "x" * 2000, None, 7):
            driver.send("drag", object=unknown, point=[0.0, 0.0, 0.1])
            driver.send("mode", mode=unknown)
            driver.send(str(unknown))
            driver.send("drag")
        driver.drag("frame_0", [0.0, 0.0, 1e6])
        driver.says("at most 10 m from the origin")  # all before was read
        assert robot.tips() == pytest.approx(start, abs=3e-3)
        # Points that are far away are points: the tip goes near them, and no further than it may.
        driver.drag("frame_0", [0.0, 0.0, 9.0])
        driver.says("goes only to (")
        goal = start[0] + 0.02 * UP
        driver.drag("frame_0", *path(start[0], goal))
        driver.wait_until(lambda: is_near(robot.tips()[0], goal))
        assert robot.tips()[1:] == pytest.approx(start[1:], abs=3e-3)


def test_fault_68_a_driver_whose_messages_make_no_sense_loses_control(
    start_view: StartView, robot: Robot
) -> None:
    page = start_view("sim", "--control")
    start = robot.tips()
    with browse(page) as watching:
        second = Steering(watching)
        for nonsense in NO_MESSAGES:
            with browse(page) as connection:
                driver = Steering(connection)
                driver.take_control()
                second.says("a browser has control")
                connection.send(nonsense)
                second.says("the browser that drove has gone")
        second.take_control()
        assert robot.tips() == pytest.approx(start, abs=3e-3)
        goal = start[0] + 0.02 * UP
        second.drag("frame_0", *path(start[0], goal))
        second.wait_until(lambda: is_near(robot.tips()[0], goal))


def test_sliders_and_buttons_move_joints(start_view: StartView, robot: Robot) -> None:
    page = start_view("sim", "--control")
    with browse(page) as connection:
        driver = Steering(connection)
        driver.take_control()
        start = robot.joints()
        sliders = driver.seat["joints"]
        assert (sliders[1]["name"], sliders[1]["unit"]) == ("upper middle 0", "rad")
        assert len(sliders) == len(start)
        goal = start.copy()
        for number, change in ((1, 0.15), (5, -0.1)):  # fast: the first has not arrived
            goal[number] += change
            driver.send("joint", joint=number, position=float(goal[number]))
        driver.says("the robot moves its joints")
        driver.wait_until(lambda: bool(np.abs(robot.joints() - goal).max() < 0.02))
        # No slider leads beyond its limits, whatever a browser sends.
        driver.send("joint", joint=1, position=100.0)
        goal[1] = sliders[1]["high"]
        driver.wait_until(lambda: bool(np.abs(robot.joints() - goal).max() < 0.02))
        driver.send("mode", mode="home")
        driver.says("the robot moves home")
        driver.wait_until(lambda: bool(np.abs(robot.joints() - start).max() < 0.02))
        driver.send("mode", mode="hold")
        driver.says("the robot holds")
        driver.send("mode", mode="float")
        driver.says("the robot floats")


def test_an_object_is_pushed_by_its_handle(start_view: StartView, robot: Robot) -> None:
    page = start_view("sim", "--control")
    with browse(page) as connection:
        driver = Steering(connection)
        driver.take_control(handle="cube")
        start, tips = robot.object(), robot.tips()
        goal = start + np.array([0.03, 0.0, 0.0])
        driver.move("cube", *path(start, goal))
        driver.wait_until(lambda: bool(robot.object()[0] > start[0] + 0.015))
        driver.end_drag()
        driver.wait_until(lambda: robot.is_pulled() is False)
        assert robot.tips() == pytest.approx(tips, abs=5e-3)  # nothing else was moved


def test_while_the_robot_floats_a_handle_pulls_the_tip_that_it_shows(
    start_view: StartView, robot: Robot
) -> None:
    frames = ("finger_tip_link_240", "finger_lower_link_0")
    page = start_view("sim", "--control", *(f"--frame={name}" for name in frames))
    with browse(page) as connection:
        driver = Steering(connection)
        driver.take_control(handle="frame_1")
        driver.send("mode", mode="float")
        driver.says("the robot floats")
        driver.move("frame_1", robot.tips()[0])
        driver.says("there is no 'finger_lower_link_0' to pull; there are tip_0, tip_1, tip_2")
        driver.end_drag()
        start = robot.tips()
        driver.move("frame_0", *path(start[2], start[2] + 0.03 * UP))
        driver.wait_until(lambda: bool(robot.tips()[2][2] > start[2][2] + 0.015))
        assert robot.tips()[:2] == pytest.approx(start[:2], abs=5e-3)  # nothing else was moved


def test_a_hand_leads_a_robot_that_another_process_lets_float(
    start_view: StartView, robot: Robot
) -> None:
    page = start_view("sim", "--hand")
    assert ask(page, "/stop", **{"X-TriFinger": "stop"})[0] != 202  # this page ends nothing
    with trifinger.guide("sim") as guide, browse(page) as connection:
        guide.float_freely()
        driver = Steering(connection)
        driver.take_control()
        assert driver.seat["joints"] is None
        start = robot.tips()
        goal = start[0] + 0.03 * UP
        driver.move("frame_0", *path(start[0], goal))
        driver.wait_until(lambda: bool(robot.tips()[0][2] > start[0][2] + 0.015))
        driver.end_drag()
        driver.wait_until(lambda: robot.is_pulled() is False)
        assert guide.state().mode == "float"
        guide.hold()


def test_after_a_fault_the_page_recovers_the_robot_on_request(
    start_view: StartView, start_program: StartProgram
) -> None:
    robot = Robot(start_program, "--set", "backend.late_action.max_repeats=3000")
    page = start_view("sim", "--control")
    with browse(page) as connection:
        driver = Steering(connection)
        driver.send("recover")  # which is not shown: nothing happens
        # The page must have dealt with that before it is stopped, or it would recover afterwards.
        driver.take_control()
        driver.watch()
        page.process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, page.process.pid, os.WSTOPPED)
        robot.wait_for_end()
        page.process.send_signal(signal.SIGCONT)
        driver.wait_until(lambda: bool(driver.control["recovers"]))
        driver.says("robot 'sim' has stopped: ")
        driver.send("recover")
        driver.wait_until(lambda: not driver.control["recovers"])
        driver.says("nobody controls the robot from here")
        robot.follow()
        start = robot.tips()
        driver.seat.clear()
        driver.take_control()
        driver.drag("frame_0", *path(start[0], start[0] + 0.03 * UP))
        driver.wait_until(lambda: bool(robot.tips()[0][2] > start[0][2] + 0.02))


HANG = """
def hang(self, *_):
    with self._lock:
        time.sleep(1e6)
page_controller.PageController.drag_frame = hang
"""


def test_the_stop_works_while_the_page_hangs_at_the_robot(
    start_view: StartView, robot: Robot
) -> None:
    page = start_view("sim", "--control", before=HANG)
    with browse(page) as connection:
        driver = Steering(connection)
        driver.take_control()
        driver.drag("frame_0", [0.0, 0.0, 0.1])
        driver.watch(3)  # the page goes on, and asks for signs of life
        assert "/stopped" in ask(page, "/")[1]
        assert ask(page, "/stop", **{"X-TriFinger": "stop"})[0] == 202
        robot.program.process.wait()
        assert ask(page, "/stopped", **{"X-TriFinger": "stop"})[0] == 200
