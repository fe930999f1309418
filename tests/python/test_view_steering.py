# SPDX-License-Identifier: BSD-3-Clause
"""Steering a robot through the server of its page, with the messages that a browser sends."""

import contextlib
import http.client
import subprocess
import sys
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trifinger
from conftest import PATIENT, StartProgram
from test_view_gate import browse, messages_of, send
from trifinger.view.scene import scene_of

pytestmark = pytest.mark.release

TOKEN = "a-token-of-a-test-0"  # noqa: S105
PAGE = ("--no-browser", "--port", "0", "--token", TOKEN)
VIEW = """
import sys, time
from trifinger.view import pilot
{before}
from trifinger.commands.view import main
sys.exit(main())
"""
PATIENTLY = "pilot.PATIENCE = 60.0"  # a busy machine can be silent for seconds
StartView = Callable[..., Any]


@pytest.fixture
def start_view() -> Iterator[StartView]:
    """Starts `trifinger view` and returns what reaches its page."""
    started = []

    def start(*words: str, before: str = PATIENTLY) -> Any:
        process = subprocess.Popen(
            [sys.executable, "-c", VIEW.format(before=before), *words, *PAGE],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        started.append(process)
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith("Open http://127.0.0.1:"), line + process.stdout.read()
        gate = SimpleNamespace(
            host="127.0.0.1", token=TOKEN, port=int(line.split(":")[2].split("/")[0])
        )
        gate.cookie = f"trifinger_view_{gate.port}"
        return gate

    yield start
    for process in started:
        with process:
            process.kill()


def ask(gate: Any, path: str, **headers: str) -> tuple[int, str]:
    """Asks as a script of the page does."""
    connection = http.client.HTTPConnection(gate.host, gate.port)
    with contextlib.closing(connection):
        cookie = {"Cookie": f"{gate.cookie}={gate.token}"}
        connection.request("GET", path, headers=cookie | headers)
        answer = connection.getresponse()
        return answer.status, answer.read().decode()


def wait_for(browser: Any, found: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    for message in messages_of(browser):
        if found(message):
            return message
    raise AssertionError("the connection was closed")


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


def take_control(browser: Any) -> dict[str, Any]:
    """Takes control and returns the handle of the first tip."""
    send(browser, "ViewerCameraMessage", **CAMERA)  # only then the server knows the browser
    made = wait_for(browser, lambda one: (one.get("props") or {}).get("label") == "Take control")

    def found(message: dict[str, Any]) -> bool:
        send(browser, "GuiUpdateMessage", uuid=made["uuid"], updates={"value": True})
        return is_handle(message)

    return wait_for(browser, found)


def says(browser: Any, text: str) -> None:
    wait_for(browser, lambda one: text in str(one))


def drag(browser: Any, handle: dict[str, Any], *points: Any) -> None:
    own = {"name": handle["name"], "owner": handle["owner"]}
    send(browser, "TransformControlsDragStartMessage", **own)
    for point in points:
        send(
            browser,
            "TransformControlsUpdateMessage",
            wxyz=[1.0, 0.0, 0.0, 0.0],
            position=[float(one) for one in point],
            **own,
        )
    send(browser, "TransformControlsDragEndMessage", **own)


def is_handle(message: dict[str, Any]) -> bool:
    is_made = message["type"] == "TransformControlsMessage"
    return is_made and message["name"] == "/handles/tip_0"


def test_a_drag_moves_a_tip_and_a_driver_that_goes_leaves_the_robot_to_others(
    start_view: StartView, start_program: StartProgram
) -> None:
    program = start_program("run", "sim", *PATIENT)
    program.wait_for("waits for a user")
    gate = start_view("sim", "--control")
    robot = trifinger.observe("sim")
    scene = scene_of(robot.documents())
    assert scene is not None

    def tip() -> Any:
        return scene.tips(robot.latest_observation()["position"])[0][0]

    with browse(gate) as second:
        with browse(gate) as driver:
            handle = take_control(driver)
            start = tip()
            drag(
                driver, handle, *(start + np.array([0.0, 0.0, 0.001 * step]) for step in range(31))
            )
            wait_for(driver, lambda _: bool(tip()[2] > start[2] + 0.02))
            says(second, "a browser has control")
            # The handle is not the other browser's, whatever it sends.
            drag(second, handle, start - [0.0, 0.0, 0.02])
            assert tip()[2] > start[2] + 0.01
        says(second, "the browser that drove has gone")
    with browse(gate) as third:
        take_control(third)
    assert ask(gate, "/stop")[0] == 403
    assert robot.session_info().backend_is_alive
    assert ask(gate, "/stop", **{"X-TriFinger": "stop"})[0] == 202
    program.process.wait()
    assert ask(gate, "/stopped", **{"X-TriFinger": "stop"})[0] == 200


def test_the_stop_works_while_the_page_hangs_at_the_robot(
    start_view: StartView, start_program: StartProgram
) -> None:
    program = start_program("run", "sim", *PATIENT)
    program.wait_for("waits for a user")
    hang = "pilot.Pilot.drag_tip = lambda *_: time.sleep(1e6)"
    gate = start_view("sim", "--control", before=f"{PATIENTLY}\n{hang}")
    with browse(gate) as driver:
        handle = take_control(driver)
        drag(driver, handle, [0.0, 0.0, 0.1])
        assert "trifinger-stop" in ask(gate, "/")[1]
        assert ask(gate, "/stop", **{"X-TriFinger": "stop"})[0] == 202
        program.process.wait()
        assert ask(gate, "/stopped", **{"X-TriFinger": "stop"})[0] == 200
