# SPDX-License-Identifier: BSD-3-Clause
"""Steering a robot from its page, in a real browser: with the mouse, a second tab and the stop."""

import json
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trifinger
from chromium import open_browser
from conftest import PATIENT, Running, StartProgram
from playwright.sync_api import Browser, BrowserContext, Page, expect
from trifinger_view.scene import Scene, scene_of
from viewing import StartView

pytestmark = pytest.mark.slow

NEVER = 280_000.0  # tests have watchdogs of their own [ms]
HANG = """
def hang(self, *_):
    with self._lock:
        time.sleep(1e6)
page_controller.PageController.do = hang
"""
OpenTab = Callable[[str], "Tab"]
UP = np.array([0.0, 0.0, 1.0])
RISE = 0.03  # of a tip that the mouse lifts [m]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with open_browser() as browser:
        yield browser


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    # Few pixels: without a graphics card, the time of a picture goes with their number.
    scale = float(os.environ.get("TRIFINGER_PICTURE_SCALE", "0.25"))
    context = browser.new_context(viewport={"width": 900, "height": 560}, device_scale_factor=scale)
    context.set_default_timeout(NEVER)
    yield context
    context.close()


@pytest.fixture
def open_tab(context: BrowserContext) -> OpenTab:
    def open_tab(url: str) -> Tab:
        tab = Tab(context.new_page())
        tab.page.goto(url)
        return tab

    return open_tab


class Tab:
    """A tab with a page of `trifinger view`, and what its scripts tell the server."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.asked: Any = None
        """Where the handle was moved to last [m]."""
        page.on("websocket", lambda socket: socket.on("framesent", self._note))

    def button(self, name: str) -> Any:
        return self.page.get_by_role("button", name=name, exact=True)

    def says(self, text: str) -> None:
        """Waits until the page says this."""
        expect(self.page.get_by_text(text).first).to_be_visible(timeout=NEVER)

    def take(self, what: str) -> None:
        self.button(f"Take {what}").click()
        expect(self.button(f"Release {what}")).to_be_visible(timeout=NEVER)

    def nearest(self, tips: Any) -> int:
        """The tip that is nearest to the eye."""
        eye = self.page.evaluate("() => trifingerPage.scene.view.eye")
        return int(np.argmin(np.linalg.norm(tips - np.array(eye), axis=1)))

    def hold_tip(self, number: int, tip: Any) -> None:
        """Presses the mouse at the arrow of a tip's handle that points up."""
        self.page.evaluate(
            "() => new Promise((done) => { const look = () => trifingerPage.scene.handles.length"
            " ? done() : setTimeout(look, 10); look(); })"
        )
        length = self.page.evaluate("at => 58 * trifingerPage.scene.pixelAt(at)", tip.tolist())
        self._mouse = self._pixel(tip + 0.8 * length * UP)
        self.page.mouse.move(*self._mouse)
        self.page.mouse.down()
        held = self.page.evaluate(
            "() => trifingerPage.scene.handles.findIndex((handle) => handle.isHeld)"
        )
        assert held == number

    def lift(self, start: Any, height: float) -> None:
        """Moves the mouse with its button pressed to `height` above `start`, in small steps."""
        begin, end = (np.array(self._pixel(start + up * UP)) for up in (0.0, height))
        grip = np.array(self._mouse)
        for part in np.linspace(0.0, 1.0, 5)[1:]:
            self.page.mouse.move(*(grip + part * (end - begin)))
            self._draw()

    def release(self) -> None:
        """Releases the button of the mouse."""
        self.page.mouse.up()

    def keep_picture(self, name: str) -> None:
        """Keeps a picture of the page, if somebody wants to look at it."""
        folder = os.environ.get("TRIFINGER_PICTURES")
        if folder:
            self.page.screenshot(path=Path(folder) / f"{name}.png", timeout=NEVER)

    def _note(self, data: bytes | str) -> None:
        if str(data).startswith("{"):  # not to the stop
            self.asked = json.loads(data).get("point", self.asked)

    def _draw(self) -> None:
        """Waits until the page has drawn."""
        self.page.evaluate("() => new Promise(requestAnimationFrame)")

    def _pixel(self, point: Any) -> Any:
        """Where a point of the world is in the window."""
        return self.page.evaluate(
            "(point) => { const {x, y} = trifingerPage.scene.canvas.getBoundingClientRect(),"
            " [right, down] = trifingerPage.scene.project(point); return [x + right, y + down]; }",
            np.asarray(point).tolist(),
        )


class Robot:
    """A simulated robot that another process runs."""

    def __init__(self, start_program: StartProgram) -> None:
        self.program: Running = start_program("run", "sim", *PATIENT)
        self.program.wait_for("waits for a user")
        self.frontend = trifinger.observe("sim")
        scene = scene_of(self.frontend.documents())
        assert scene is not None
        self.scene: Scene = scene

    def tips(self) -> Any:
        """Where the tips are [m], a row for each."""
        return self.scene.tips(self.frontend.latest_observation()["position"])[0]

    def wait(self, found: Callable[[], bool]) -> None:
        """Waits until this is so, step by step of the robot."""
        while not found():
            _, end = self.frontend.range("observation")
            self.frontend.get_observation(end + 20)


@pytest.fixture
def robot(start_program: StartProgram) -> Robot:
    return Robot(start_program)


def test_the_mouse_drags_a_tip_and_no_other(
    open_tab: OpenTab, start_view: StartView, robot: Robot
) -> None:
    viewing = start_view("sim", "--control")
    tab = open_tab(viewing.url)
    tab.take("control")
    tab.keep_picture("control")
    start = robot.tips()
    number = tab.nearest(start)
    tab.hold_tip(number, start[number])
    tab.lift(start[number], RISE)
    tab.keep_picture("dragged")
    tab.release()
    goal = tab.asked
    assert goal[2] > start[number][2] + RISE / 2
    assert goal[:2] == pytest.approx(start[number][:2], abs=2e-3)  # the arrow leads straight up
    robot.wait(lambda: bool(np.linalg.norm(robot.tips()[number] - goal) < 5e-3))
    others = [other for other in range(3) if other != number]
    assert robot.tips()[others] == pytest.approx(start[others], abs=3e-3)


def test_a_closed_tab_leaves_control_to_another_which_stops_the_robot(
    open_tab: OpenTab, start_view: StartView, robot: Robot
) -> None:
    viewing = start_view("sim", "--control")
    tab = open_tab(viewing.url)
    tab.take("control")
    start = robot.tips()
    second = open_tab(viewing.url)
    expect(second.button("Take control")).to_be_disabled(timeout=NEVER)
    assert second.button("Release control").count() == 0
    second.keep_picture("second")
    tab.page.close()
    second.says("the browser that drove has gone, so the robot holds its pose")
    second.take("control")
    assert robot.tips() == pytest.approx(start, abs=3e-3)
    second.page.keyboard.press("Escape")
    second.says("Stopped: the robot has come to rest")
    second.says("the robot was stopped, and its back-end has ended")
    robot.program.process.wait()
    second.keep_picture("stopped")


def test_the_stop_works_while_the_page_hangs_at_the_robot(
    open_tab: OpenTab, start_view: StartView, robot: Robot
) -> None:
    viewing = start_view("sim", "--control", before=HANG)
    tab = open_tab(viewing.url)
    tab.take("control")
    tab.button("Home").click()
    tab.button("Stop the robot").click()
    tab.says("Stopped: the robot has come to rest")
    robot.program.process.wait()


def test_a_stop_that_does_not_reach_the_server_is_said(
    open_tab: OpenTab, start_view: StartView, robot: Robot
) -> None:
    viewing = start_view("sim", "--control")
    tab = open_tab(viewing.url)
    expect(tab.button("Take control")).to_be_visible(timeout=NEVER)
    viewing.process.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, viewing.process.pid, os.WSTOPPED)
    tab.button("Stop the robot").click()
    tab.says("NOT stopped: this page's server does not answer")
    tab.says("trifinger stop sim")
    tab.keep_picture("unreachable")
    viewing.process.kill()
    viewing.process.wait()
    tab.button("Stop the robot").click()
    tab.says("NOT stopped: this page's server does not answer")
    assert robot.frontend.session_info().backend_is_alive


def test_a_hand_in_the_page_pulls_a_robot_that_another_process_lets_float(
    open_tab: OpenTab, start_view: StartView, robot: Robot
) -> None:
    viewing = start_view("sim", "--hand")
    tab = open_tab(viewing.url)
    tab.take("the hand")
    assert tab.button("Stop the robot").count() == 0  # it ends nothing
    with trifinger.guide("sim") as guide:
        guide.float_freely()
        start = robot.tips()
        number = tab.nearest(start)
        tab.hold_tip(number, start[number])
        tab.lift(start[number], RISE)
        tab.keep_picture("hand")
        robot.wait(lambda: bool(robot.tips()[number][2] > start[number][2] + RISE / 3))
        tab.release()
        guide.hold()
