# SPDX-License-Identifier: BSD-3-Clause
"""The page of a running robot and of a log, in a real browser."""

import contextlib
import json
import os
import re
import signal
from collections.abc import Iterator
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np
import pytest
import trifinger
from chromium import open_browser
from conftest import PATIENT, StartChild, StartProgram
from playwright.sync_api import Browser, Page, expect
from trifinger.training import Plan
from trifinger.training.report import Tally
from trifinger_view import page as viewed
from trifinger_view.authentication import Authentication
from trifinger_view.commands import view
from trifinger_view.frame import Frame
from trifinger_view.page_server import PageServer
from trifinger_view.scene import Scene
from trifinger_view.to_browser import message
from trifinger_view.words import Line
from viewing import StartView

pytestmark = [
    pytest.mark.slow,
    # An exception in a check is shown by Python, and is meant here.
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

HOME = np.array([0.0, 0.9, -1.7] * 3)
NEVER = 280_000.0  # tests have watchdogs of their own [ms]
ROBOT = ("run", "sim", "--non-real-time", *PATIENT)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with open_browser() as browser:
        yield browser


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    context = browser.new_context(viewport={"width": 640, "height": 400})
    context.set_default_timeout(NEVER)
    page = context.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("request", lambda asked: asked.url.startswith(OWN) or errors.append(asked.url))
    yield page
    context.close()
    assert errors == []  # nothing failed, and nothing was loaded from elsewhere


OWN = ("http://127.0.0.1:", "ws://127.0.0.1:", "data:", "blob:")


def says(page: Page, label: str, text: str) -> None:
    """Waits until a line of the state has a text."""
    expect(page.locator(f".says-{label}")).to_contain_text(text, timeout=NEVER)


def settled(page: Page, but: bytes = b"") -> bytes:
    """Waits until the picture of the scene no longer changes, and is another than `but`."""
    before = b""
    while True:
        picture = page.locator("canvas").first.screenshot(timeout=NEVER)
        if picture == before and picture != but:
            return picture
        before = picture


def drive(robot: trifinger.Frontend, position: np.ndarray, steps: int = 600) -> None:
    actions = np.repeat(robot.new_action(position=position), steps)
    robot.append_desired_actions(actions)


def test_the_page_shows_a_robot_that_moves_and_its_state_in_words(
    page: Page, start_view: StartView, start_program: StartProgram
) -> None:
    start_program(*ROBOT).wait_for("waits for a user")
    viewing = start_view("sim")
    page.goto(viewing.url)
    says(page, "state", "holds its pose and waits for a controller")
    assert "token" not in page.url
    expect(page).to_have_title("sim")
    first = settled(page)
    with trifinger.connect("sim") as robot:
        drive(robot, HOME + 0.3)
        says(page, "state", "runs")
        says(page, "step", "600 (0.6 s)")
        says(page, "controller", str(os.getpid()))
        settled(page, but=first)
        expect(page.get_by_text("torque [Nm]")).to_be_visible(timeout=NEVER)
    says(page, "before", "the controller finished at step 600")
    assert viewing.end() == (130, "")


def test_the_page_says_how_a_training_goes(
    page: Page, start_view: StartView, start_fake: StartChild, tmp_path: Path
) -> None:
    start_fake("bot")
    tally = Tally(episodes=3, actions=60, faults={"late": 2}, recoveries=2, time_lost=4.4)
    page.goto(start_view("bot", "--training", str(tmp_path)).url)
    says(page, "learning", "has no training on a robot")
    rows = tally.rows(Plan.of("reach", "ddpg"))
    (tmp_path / "tally.json").write_text(json.dumps({"rows": rows}))
    says(page, "learning", "episode 3 of 700, 60 actions")
    says(page, "faults", "2 x late")
    says(page, "time", "4 s lost")
    says(page, "by-itself", "2 recoveries, 0 cares, 0 rests")


def test_the_page_waits_for_a_robot_and_follows_its_sessions_and_faults(
    page: Page, start_view: StartView, start_fake: StartChild
) -> None:
    page.goto(start_view("bot").url)
    says(page, "state", "no robot 'bot' runs")
    says(page, "start-one", "trifinger run bot")
    expect(page.locator("aside")).to_be_hidden()
    start_fake("bot", observation_fault_after=20)
    says(page, "state", "holds its pose")
    robot = trifinger.connect("bot")
    with pytest.raises(trifinger.RobotStopped):
        robot.append_desired_actions(np.repeat(robot.new_action(), 100_000))
    says(page, "state", "has ended")
    says(page, "fault", "the driver")
    says(page, "remedy", "trifinger recover bot")
    trifinger.recover("bot")
    says(page, "state", "holds its pose")
    says(page, "before", "the driver")


def test_a_robot_without_a_model_has_curves_of_its_own_fields(
    page: Page, start_view: StartView, start_fake: StartChild
) -> None:
    start_fake("bot")
    page.goto(start_view().url)  # the robot that runs
    with trifinger.connect("bot") as robot:
        for k in range(200):
            robot.append_desired_action(robot.new_action(setpoint=k))
        expect(page.get_by_text("applied_actions")).to_be_visible(timeout=NEVER)
        expect(page.get_by_text("setpoint")).to_be_visible(timeout=NEVER)
        says(page, "step", "200 (0.2 s)")


def test_a_back_end_that_was_killed_is_named_with_the_remedy(
    page: Page, start_view: StartView, start_fake: StartChild
) -> None:
    child = start_fake("bot")
    page.goto(start_view("bot").url)
    says(page, "state", "holds its pose")
    child.kill()
    says(page, "state", "the back-end is gone")
    says(page, "remedy", "trifinger log rescue bot")


def test_the_page_shows_what_cameras_see(
    page: Page, start_view: StartView, start_program: StartProgram
) -> None:
    words = ["sim_cameras", "--name", "sim", "--non-real-time"]
    start_program("run", *words).wait_for("waits for a user")
    page.goto(start_view("sim").url)
    for camera in ("camera60", "camera180", "camera300"):
        expect(page.get_by_text(camera)).to_be_visible(timeout=NEVER)
    # 540 pixels are too many for a panel; each pixel is the mean of four.
    # The page allows no strings to be run as scripts, which wait_for_function() needs.
    page.evaluate(
        "() => new Promise((done) => { const look = () => [...document.images].filter("
        "one => one.naturalWidth == 270).length == 3 ? done() : setTimeout(look, 10); look(); })"
    )


@pytest.fixture
def log(tmp_path: Path, start_program: StartProgram) -> Path:
    """A log of a robot without a model, which ends with a fault at step 2000."""
    folder = tmp_path / "log"
    words = ["fake", "--non-real-time", "--set", "fault_after=2000", "--record", str(folder)]
    program = start_program("run", *words)
    program.wait_for("waits for a user")
    robot = trifinger.connect("fake")
    with pytest.raises(trifinger.RobotStopped):
        robot.append_desired_actions(np.repeat(robot.new_action(), 100_000))
    program.wait_for("waits for 'trifinger recover fake'")
    assert program.end()[0] == 0
    return folder


def test_a_log_plays_scrubs_and_jumps_to_its_fault(
    page: Page, start_view: StartView, log: Path
) -> None:
    page.goto(start_view(str(log)).url)
    says(page, "time", "0.000 of 2.")
    page.locator("#later").click()
    says(page, "time", "1.000 of 2.")
    page.locator("#back").click()
    says(page, "step", "999")
    page.locator("#time").fill("1.9")
    says(page, "time", "1.900 of 2.")
    page.locator("#fault").click()
    says(page, "state", "a fault was injected")
    page.locator("#play").click()  # from the beginning
    says(page, "state", "running")
    says(page, "state", "a fault was injected")
    expect(page.locator("#play")).to_have_text("▶", timeout=NEVER)


def test_fault_68_a_viewer_that_stands_still_does_not_hold_up_the_robot(
    page: Page, start_view: StartView, start_fake: StartChild
) -> None:
    start_fake("bot")
    viewing = start_view("bot")
    page.goto(viewing.url)
    says(page, "state", "holds its pose")
    viewing.process.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, viewing.process.pid, os.WSTOPPED)
    with trifinger.connect("bot") as robot:
        for _ in range(20):  # more than the history holds
            robot.append_desired_actions(np.repeat(robot.new_action(), 1000))
    viewing.process.send_signal(signal.SIGCONT)
    says(page, "before", "the controller finished at step 20000")


def test_fault_68_texts_of_a_session_are_shown_as_texts(page: Page) -> None:
    with contextlib.closing(Authentication(port=0)) as authentication:
        server = PageServer(authentication, viewed.document_of("test"))
        shown = viewed.Page(server)
        shown.begin(None, "<b>&test</b>")
        shown.show_state([Line("state", "<img src=x onerror=alert(1)> & more", "bad")])
        page.goto(authentication.url)
        says(page, "state", "<img src=x onerror=alert(1)> & more")
        expect(page).to_have_title("<b>&test</b>")
        server.stop()


def test_the_camera_goes_after_what_walks_away_and_not_after_what_waves(page: Page) -> None:
    with contextlib.closing(Authentication(port=0)) as authentication:
        server = PageServer(authentication, viewed.document_of("test"))
        page.goto(authentication.url)
        target, radius = page.evaluate(
            "() => [trifingerPage.scene.target, trifingerPage.scene.home.radius]"
        )

        def follow(way: float) -> float:
            """How far the camera has gone after something that is so far away in the end [m]."""
            found = page.evaluate(
                "([way, [x, y, z]]) => { for (let i = 0; i <= 1000; ++i)"
                " trifingerPage.scene.follow([x + way * Math.min(i / 100, 1), y, z]);"
                " return trifingerPage.scene.target; }",
                [way, target],
            )
            assert found[1:] == target[1:]
            return float(found[0] - target[0])

        assert follow(0.3 * radius) == 0.0
        assert 9.5 * radius < follow(10 * radius) < 10 * radius
        server.stop()


ARM = """<mujoco><worldbody><body name="{0}"><joint axis="0 0 1"/>
<geom type="capsule" size="0.05" fromto="0 0 0 0.4 0 {1}"/></body></worldbody></mujoco>"""
KNOWN = "what-all-servers-know"


class Served:
    """A server of a page that shows an arm, at the port of the one before."""

    def __init__(self, port: int = 0, robot: str = "arm", **told: object) -> None:
        self.authentication = Authentication(port=port, token=KNOWN)
        self.server = PageServer(self.authentication, viewed.document_of(robot))
        self.shown = viewed.Page(self.server)
        self.show(robot, 1, **told)

    def show(self, robot: str, step: int, height: float = 0.0, **told: object) -> None:
        """Begins a session, whose first frame is that of this step."""
        self.shown.begin(Scene(ARM.format(robot, height)), robot, **told)
        self.shown.show(Frame(time_index=step, time=0.0, position=np.zeros(1)))

    def end(self) -> int:
        """Ends the server; returns its port."""
        self.server.stop()
        self.authentication.close()
        return self.authentication.port


def shows(page: Page, step: int) -> None:
    """Waits until the page shows a step."""
    expect(page.locator("body")).to_have_attribute("data-step", str(step), timeout=NEVER)


def camera_of(page: Page) -> list[float]:
    """How the camera looks at the middle of the scene."""
    return page.evaluate(  # type: ignore[no-any-return]
        "() => { const {azimuth, elevation, zoom, target, middle} = trifingerPage.scene;"
        " return [azimuth, elevation, zoom, ...minus(target, middle)]; }"
    )


def turn(page: Page) -> list[float]:
    page.evaluate(
        "() => { const {scene} = trifingerPage;"
        " scene.turn(80, 30); scene.closer(0.5); scene.shift(20, 10); }"
    )
    return camera_of(page)


def test_the_camera_stays_as_it_was_turned_until_there_is_another_robot(page: Page) -> None:
    served = Served()
    page.goto(served.authentication.url)
    shows(page, 1)
    home = camera_of(page)
    turned = turn(page)
    assert turned[0] != home[0]
    served.shown.begin(None, "arm")  # it does not run
    served.show("arm", 2, height=0.2)
    shows(page, 2)
    assert camera_of(page) == pytest.approx(turned)
    page.evaluate("() => { delete document.body.dataset.step; trifingerPage.socket.close(); }")
    shows(page, 2)
    assert camera_of(page) == pytest.approx(turned)
    served.show("another arm", 3)
    shows(page, 3)
    assert camera_of(page) == pytest.approx(home)
    served.end()


def test_a_page_that_finds_another_server_shows_what_that_one_has(page: Page) -> None:
    line = {"position": 0.0, "isPlaying": False, "isLooping": False, "speed": 1.0}
    served = Served(line={"end": 9.0, "fault": 5.0, **line})
    page.goto(served.authentication.url)
    shows(page, 1)
    expect(page.locator("footer")).to_be_visible(timeout=NEVER)
    turned = turn(page)
    served = Served(served.end())  # the robot that was in the log
    expect(page.locator("footer")).to_be_hidden(timeout=NEVER)
    shows(page, 1)
    assert camera_of(page) == pytest.approx(turned)
    served = Served(served.end(), "another arm", line={"end": 2.0, "fault": None, **line})
    expect(page).to_have_title("another arm", timeout=NEVER)
    shows(page, 1)
    expect(page.locator("#time")).to_have_attribute("max", "2", timeout=NEVER)
    assert camera_of(page)[0] != pytest.approx(turned[0])
    served.end()


def test_two_fingers_at_two_handles_move_each_its_own(browser: Browser) -> None:
    context = browser.new_context(viewport={"width": 640, "height": 400}, has_touch=True)
    page = context.new_page()
    touch = context.new_cdp_session(page)
    served, messages = Served(), SimpleQueue[dict[str, Any]]()
    served.server.on_message = lambda _, asked: messages.put(asked)
    handles, points = [{"frame": 0}, {"frame": 1}], [[0.0, 0.0, 0.1], [0.4, 0.0, 0.1]]
    seat = message("seat", isDriver=True, words="", joints=None, handles=handles)
    served.server.put("seat", seat)
    served.server.put("targets", message("targets", joints=[], points=points))
    page.goto(served.authentication.url)
    shows(page, 1)
    page.evaluate(
        "() => new Promise((done) => { const look = () => trifingerPage.scene.handles.length"
        " ? done() : setTimeout(look, 10); look(); })"
    )
    camera, corner = camera_of(page), page.locator("#view").bounding_box()
    assert corner is not None

    def pixel(point: list[float]) -> list[float]:
        x, y = page.evaluate("point => trifingerPage.scene.project(point)", point)
        return [x + corner["x"], y + corner["y"]]

    def fingers(kind: str, **places: list[float]) -> None:
        points = [{"x": x, "y": y, "id": int(name[1:])} for name, (x, y) in places.items()]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    def wait_for_drags(*ends: tuple[int, list[float]]) -> None:
        """Waits until these frames are dragged to these pixels; each moves along one line."""
        left = dict(ends)
        while left:
            asked = messages.get()
            if asked["do"] == "drag":
                at, frame = pixel(asked["point"]), asked["frame"]
                along = 1 - frame  # the first finger moves across, the second one up
                assert at[along] == pytest.approx(starts[frame][along], abs=1)
                if at == pytest.approx(left.get(frame), abs=1):
                    del left[frame]

    first, second = starts = [pixel(point) for point in points]
    there, up = [first[0] + 40, first[1]], [second[0], second[1] - 40]
    farther = [first[0] + 60, first[1]]
    fingers("touchStart", _0=first)
    fingers("touchStart", _0=first, _1=second)
    fingers("touchMove", _0=there, _1=up)
    wait_for_drags((0, there), (1, up))
    fingers("touchEnd", _1=up)
    while messages.get()["do"] != "drop":
        pass
    again = messages.get()  # a hand has let go of the other, and pulls at this one
    assert (again["do"], again["frame"]) == ("drag", 0)
    fingers("touchMove", _0=farther)
    wait_for_drags((0, farther))
    assert page.evaluate("trifingerPage.handles.map((handle) => Boolean(handle.isHeld))") == [1, 0]
    fingers("touchEnd", _0=farther)
    while messages.get()["do"] != "drop":
        pass
    assert camera_of(page) == camera
    served.end()
    context.close()


# ---- the command line ----


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["sim", "-o", "run.html"], "-o needs a log"),
        (["sim", "--from", "1"], "--from is for a file of a log"),
        (["./nothing.mcap"], "nothing.mcap"),
        (["sim", "--token", "short"], "at least 16"),
        (["sim", "--host", "192.0.2.1"], r"192\.0\.2\.1"),
    ],
)
def test_wrong_words_are_named(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert view.main(words) in (1, 2)
    error = capsys.readouterr().err
    assert error.startswith("trifinger view: ")
    assert re.search(message, error)
    assert error.count("\n") == 1


def test_over_ssh_the_way_to_the_page_is_printed(
    start_view: StartView, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SSH_CONNECTION", "10.0.0.1 5000 10.0.0.2 22")
    viewing = start_view("sim")
    port = viewing.port
    assert re.search(rf"ssh -L {port}:127\.0\.0\.1:{port} \w+@10\.0\.0\.2", viewing.said)
