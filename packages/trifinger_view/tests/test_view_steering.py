# SPDX-License-Identifier: BSD-3-Clause
"""Steering a robot through the server of its page, with the messages that a browser sends."""

import contextlib
import html
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
from websockets.exceptions import ConnectionClosed

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


CAMERA = {
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [1.0, 0.0, 1.0],
    "image_height": 300,
    "image_width": 400,
    "fov": 0.6,
    "near": 0.1,
    "far": 10.0,
    "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}


class Steering:
    """A browser as a program: what the server has sent it, and what it sends."""

    def __init__(self, connection: Any) -> None:
        self._connection = connection
        self._messages = messages_of(connection)
        self.parts: dict[str, dict[str, Any]] = {}
        """Buttons and sliders by their labels."""
        self.handles: dict[str, dict[str, Any]] = {}
        """Handles in the scene by their names."""
        self.words = ""
        """What the panel says."""
        self.send("ViewerCameraMessage", **CAMERA)  # only then the server knows the browser

    def send(self, kind: str, **fields: Any) -> None:
        send(self._connection, kind, **fields)

    def wait(self, found: Callable[[dict[str, Any]], bool]) -> None:
        """Reads up to the message for which this is so."""
        for message in self._messages:
            label = (message.get("props") or {}).get("label")
            if label:
                self.parts[label] = message
            text = str((message.get("updates") or {}).get("content", ""))
            if 'class="trifinger-control"' in text:
                self.words = html.unescape(text)
            for part in self.parts.values():
                if message["type"] == "GuiUpdateMessage" and part["uuid"] == message["uuid"]:
                    part["props"] |= message["updates"]
            if message["type"] == "TransformControlsMessage":
                self.handles[message["name"].removeprefix("/handles/")] = message
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

    def is_visible(self, label: str) -> bool:
        return label in self.parts and bool(self.parts[label]["props"]["visible"])

    def watch(self, times: int = 2) -> None:
        """Waits until the page has shown the robot anew so many times."""
        for _ in range(times):
            self.wait(lambda message: "trifinger-step" in str(message.get("updates")))

    def press(self, label: str, value: object = True) -> None:
        """Presses a button or moves a slider."""
        self.wait_until(lambda: label in self.parts)
        self.send("GuiUpdateMessage", uuid=self.parts[label]["uuid"], updates={"value": value})

    def take_control(self, label: str = "Take control", handle: str = "frame_0") -> None:
        """Takes control and waits for a handle."""
        self.press(label)
        self.wait_until(lambda: handle in self.handles)

    def begin_drag(self, handle: str) -> None:
        self.send("TransformControlsDragStartMessage", **self._own(handle))

    def move(self, handle: str, *points: object) -> None:
        for point in points:
            place = point.tolist() if isinstance(point, np.ndarray) else point
            self.send(
                "TransformControlsUpdateMessage",
                wxyz=[1.0, 0.0, 0.0, 0.0],
                position=place,
                **self._own(handle),
            )

    def end_drag(self, handle: str) -> None:
        self.send("TransformControlsDragEndMessage", **self._own(handle))

    def drag(self, handle: str, *points: object) -> None:
        self.begin_drag(handle)
        self.move(handle, *points)
        self.end_drag(handle)

    def _own(self, handle: str) -> dict[str, Any]:
        made = self.handles.get(handle, {"name": f"/handles/{handle}", "owner": ""})
        return {"name": made["name"], "owner": made["owner"]}


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
            second.handles = driver.handles
            second.drag("frame_0", start[0] - 0.02 * UP)
            second.press("Take control")
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


# Points that are none: such a message is not obeyed.
NO_POINTS = (
    [float("nan"), 0.0, 0.1],
    [0.0, float("inf"), 0.1],
    [0.0, 0.0, -float("inf")],
    [],
    [0.0, 0.1],
    [0.0, 0.0, 0.1, 0.1],
    ["up", "up"],
    [[0.0, 0.0, 0.1]],
    [0.0] * 1000,
    [1e300, 0.0, 0.0],
    [2**63, 0, 0],
    {},
)
# What viser cannot read: such a message ends its connection.
NO_NUMBERS = (["up", "up", "up"], [None, None, None], "abc", None, 0.1, {"x": 1, "y": 2, "z": 3})


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
            driver.drag("object_0", point)
            driver.press("Robot", point)
            driver.press("upper middle 0 [rad]", point)
            driver.watch()
        for unknown in ("frame_7", "frame_-1", "../frame_0", "object_9", "", "x" * 2000):
            driver.drag(unknown, [0.0, 0.0, 0.1])
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
        for numbers in NO_NUMBERS:
            with browse(page) as connection:
                driver = Steering(connection)
                driver.take_control()
                second.says("a browser has control")
                with contextlib.suppress(ConnectionClosed):
                    driver.drag("frame_0", numbers)
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
        labels = [
            label for label, part in driver.parts.items() if part["type"] == "GuiSliderMessage"
        ]
        assert labels[1] == "upper middle 0 [rad]"
        assert len(labels) == len(start)
        goal = start.copy()
        for number, change in ((1, 0.15), (5, -0.1)):  # fast: the first has not arrived
            goal[number] += change
            driver.press(labels[number], float(goal[number]))
        driver.says("the robot moves its joints")
        driver.wait_until(lambda: bool(np.abs(robot.joints() - goal).max() < 0.02))
        # No slider leads beyond its limits, whatever a browser sends.
        limits = driver.parts[labels[1]]["props"]
        driver.press(labels[1], 100.0)
        goal[1] = limits["max"]
        driver.wait_until(lambda: bool(np.abs(robot.joints() - goal).max() < 0.02))
        driver.press("Robot", "Home")
        driver.says("the robot moves home")
        driver.wait_until(lambda: bool(np.abs(robot.joints() - start).max() < 0.02))
        driver.press("Robot", "Hold")
        driver.says("the robot holds")
        driver.press("Robot", "Float")
        driver.says("the robot floats")


def test_an_object_is_pushed_by_its_handle(start_view: StartView, robot: Robot) -> None:
    page = start_view("sim", "--control")
    with browse(page) as connection:
        driver = Steering(connection)
        driver.take_control(handle="object_0")
        start, tips = robot.object(), robot.tips()
        goal = start + np.array([0.03, 0.0, 0.0])
        driver.begin_drag("object_0")
        driver.move("object_0", *path(start, goal))
        driver.wait_until(lambda: bool(robot.object()[0] > start[0] + 0.015))
        driver.end_drag("object_0")
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
        driver.press("Robot", "Float")
        driver.says("the robot floats")
        driver.begin_drag("frame_1")
        driver.move("frame_1", robot.tips()[0])
        driver.says("there is no 'finger_lower_link_0' to pull; there are tip_0, tip_1, tip_2")
        driver.end_drag("frame_1")
        start = robot.tips()
        driver.begin_drag("frame_0")
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
        driver.take_control("Take the hand")
        assert not {"Robot", "Joints [rad]"} & set(driver.parts)
        start = robot.tips()
        goal = start[0] + 0.03 * UP
        driver.begin_drag("frame_0")
        driver.move("frame_0", *path(start[0], goal))
        driver.wait_until(lambda: bool(robot.tips()[0][2] > start[0][2] + 0.015))
        driver.end_drag("frame_0")
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
        driver.press("Recover")  # which is not shown: nothing happens
        # The page must have dealt with that before it is stopped, or it would recover afterwards.
        driver.take_control()
        driver.watch()
        page.process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, page.process.pid, os.WSTOPPED)
        robot.wait_for_end()
        page.process.send_signal(signal.SIGCONT)
        driver.wait_until(lambda: driver.is_visible("Recover"))
        driver.wait_until(lambda: not driver.is_visible("Take control"))
        driver.says("robot 'sim' has stopped: ")
        driver.press("Recover")
        driver.wait_until(lambda: driver.is_visible("Take control"))
        driver.wait_until(lambda: not driver.is_visible("Recover"))
        driver.says("nobody controls the robot from here")
        robot.follow()
        start = robot.tips()
        driver.handles.clear()
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
        assert "trifinger-stop" in ask(page, "/")[1]
        assert ask(page, "/stop", **{"X-TriFinger": "stop"})[0] == 202
        robot.program.process.wait()
        assert ask(page, "/stopped", **{"X-TriFinger": "stop"})[0] == 200
