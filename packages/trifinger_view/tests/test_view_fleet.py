# SPDX-License-Identifier: BSD-3-Clause
"""The page of many robots, without a browser: what it is told, and that it only looks."""

import contextlib
import http.client
import http.server
import json
import os
import queue
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trifinger
import websockets.exceptions
import websockets.sync.server
from conftest import PATIENT, PATIENT_FAKE, StartChild, StartProgram, free_port
from test_view_authentication import browse, messages_of, send, wait_for
from trifinger_view import fleet
from trifinger_view.authentication import GLANCE, Authentication
from trifinger_view.commands import view
from trifinger_view.fleet import STRANGER, Address, Card, Fleet, addresses_of, fleet_document
from trifinger_view.glance import Glance
from trifinger_view.live import LiveRun
from trifinger_view.page import document_of
from trifinger_view.page_server import PageServer
from trifinger_view.to_browser import Numbers, message
from trifinger_view.words import Line
from viewing import StartView, Viewing
from websockets.sync.client import ClientConnection, connect

KNOWN = "what-the-robot-knows"


def content_of(told: bytes) -> dict[str, Any]:
    size = int.from_bytes(told[:4], "little")
    return json.loads(told[4 : 4 + size])  # type: ignore[no-any-return]


class Told:
    """A server that notes what browsers are told."""

    def __init__(self) -> None:
        self.messages: list[dict[str, Any]] = []

    def put(self, kind: str, told: bytes) -> None:
        self.messages.append({"put": kind, **content_of(told)})


def glance_at(viewing: Viewing | Authentication, **headers: str) -> ClientConnection:
    """Connects to the page of a robot as a page of many does, with other headers on request."""
    origin = headers.pop("Origin", f"http://127.0.0.1:{viewing.port}")
    return connect(
        f"ws://127.0.0.1:{viewing.port}{GLANCE}",
        origin=origin,  # type: ignore[arg-type]
        additional_headers={"Authorization": f"Bearer {viewing.token}", **headers},
        compression=None,
        max_size=None,
        proxy=None,
    )


@contextlib.contextmanager
def page_of_a_robot() -> Iterator[tuple[Authentication, PageServer]]:
    """The server of a robot's page, without a robot."""
    with contextlib.closing(Authentication(port=0, token=KNOWN)) as authentication:
        authentication.sockets.add(GLANCE)
        server = PageServer(authentication, document_of("test"))
        yield authentication, server
        server.stop()


@contextlib.contextmanager
def fleet_of(*hosts: str) -> Iterator[tuple[Authentication, PageServer]]:
    """A page of these robots, in this process."""
    with contextlib.closing(Authentication(port=0)) as authentication:
        server = PageServer(authentication, fleet_document("test", is_plain=True))
        server.kinds = ()
        with contextlib.closing(Fleet(server, [Address(host, KNOWN) for host in hosts])):
            yield authentication, server
        server.stop()


def state_of(robot: int, browser: ClientConnection, words: str) -> dict[str, Any]:
    """Waits until the first line of a robot's state has these words."""
    for found in messages_of(browser):
        is_own = (found["kind"], found.get("robot")) == ("glance", robot)
        if is_own and words in found["lines"][0]["text"]:
            return found
    raise AssertionError("the connection was closed")


def reason_of(robot: int, browser: ClientConnection, *expected: str) -> str:
    """Waits until a robot cannot be seen for one of these reasons, or can be, and returns it."""
    for found in messages_of(browser):
        if (found["kind"], found.get("robot")) == ("host", robot):
            for reason in expected:
                if (reason in found["reason"]) if reason else not found["reason"]:
                    return str(found["reason"])
    raise AssertionError("the connection was closed")


# ---- addresses ----


@pytest.mark.parametrize(
    ("text", "host"),
    [
        ("http://127.0.0.1:8081/?token=abc-_1", "127.0.0.1:8081"),
        ("robot-3.lab:9000/?token=abc-_1", "robot-3.lab:9000"),
        ("http://robot/?token=abc-_1", "robot:8080"),
        ("http://[::1]:8081/?token=abc-_1", "[::1]:8081"),
    ],
)
def test_an_address_is_read_as_view_prints_it(text: str, host: str) -> None:
    assert addresses_of([text]) == [Address(host, "abc-_1")]


def test_a_file_has_an_address_in_each_line(tmp_path: Path) -> None:
    file = tmp_path / "robots"
    file.write_text("# the lab\n\nhttp://a:1/?token=secret\n  http://b:2/?token=secret  \n")
    found = addresses_of([f"@{file}", "http://c:3/?token=secret"])
    assert [address.host for address in found] == ["a:1", "b:2", "c:3"]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["http://robot:8080/"], "needs the token"),
        (["robot"], "needs the token"),
        (["http://robot:8080/?token="], "needs the token"),
        (["http://robot:8080/?token=sec ret"], "needs the token"),
        (["https://robot:8080/?token=secret"], "no address of a page"),
        (["http:///?token=secret"], "no address of a page"),
        (["http://robot:99999/?token=secret"], "no address of a page"),
        (["http://ro bot/?token=secret"], "no address of a page"),
        (["http://me@robot/?token=secret"], "no address of a page"),
        (["http://[::1/?token=secret"], "no address of a page"),
        (["http://a:1/?token=secret", "a:1?token=secrets"], "a:1 is there twice"),
        (["@/dev/null"], "no address in /dev/null"),
        (["@nothing.txt"], "nothing.txt"),
        (["--control", "http://a:1/?token=secret"], "--fleet only shows"),
        (["--hand"], "--fleet only shows"),
        (["-o", "run.html"], "--fleet only shows"),
        (["--training", "here"], "--fleet only shows"),
        (["--from", "1"], "--from is for a file of a log"),
        (["--token", "short"], "at least 16"),
    ],
)
def test_wrong_words_are_named_without_the_token(
    words: list[str], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert view.main(["--fleet", *words]) in (1, 2)
    error = capsys.readouterr().err
    assert error.startswith("trifinger view: ")
    assert reason in error
    assert error.count("\n") == 1
    assert "secret" not in error


def test_a_name_of_a_robot_is_no_fleet(capsys: pytest.CaptureFixture[str]) -> None:
    assert view.main(["sim", "--fleet"]) == 2
    assert "takes addresses and no robot" in capsys.readouterr().err


# ---- a glance at one robot ----


class Watched:
    """A robot whose state a test sets, and a clock."""

    def __init__(self) -> None:
        self.now = 50.0
        self.glance = Glance(lambda: self.now)
        self.live = LiveRun("bot")
        self.live.session_id = 1
        self.live.info = SimpleNamespace(  # type: ignore[assignment]
            name="bot", type="fake", period=0.001, is_real_time=True, phase="running"
        )

    def at(self, seconds: float, *lines: Line, step: int = 0) -> dict[str, Any]:
        """What is told after so many seconds."""
        self.now = 50.0 + seconds
        self.live.frame = SimpleNamespace(time_index=step)  # type: ignore[assignment]
        return content_of(self.glance.message(self.live, lines))


def test_a_glance_says_since_when_a_state_is_and_whether_it_saw_its_begin() -> None:
    robot = Watched()
    told = robot.at(0, Line("state", "holds"))
    assert (told["age"], told["isAgeKnown"]) == (0, False)
    told = robot.at(7, Line("state", "holds"), Line("step", "8"))
    assert (told["age"], told["isAgeKnown"]) == (7, False)
    told = robot.at(9, Line("state", "runs"))
    assert (told["age"], told["isAgeKnown"]) == (0, True)
    robot.live.session_id = 2  # the next session is in the same state
    robot.at(20, Line("state", "runs"))
    assert robot.at(21, Line("state", "runs"))["age"] == 1


def test_a_glance_has_the_rate_only_of_a_robot_that_runs() -> None:
    robot = Watched()
    assert robot.at(0, Line("state", "runs"), step=10)["rate"] is None
    assert robot.at(2, Line("state", "runs"), step=1810)["rate"] == 900
    assert robot.at(3, Line("state", "gone", "bad"), step=1810)["rate"] is None
    robot.at(4, Line("state", "runs"), step=1810)
    robot.live.session_id = 2
    assert robot.at(5, Line("state", "runs"), step=3)["rate"] is None


def test_a_glance_remembers_the_last_fault_and_how_long_it_is_over() -> None:
    robot = Watched()
    assert robot.at(0, Line("state", "runs"))["lastFault"] == ""
    ended = [Line("state", "has ended", "bad"), Line("fault", "the driver gave up", "bad")]
    assert robot.at(1, *ended)["lastFault"] == ""  # it is there now
    robot.at(9, *ended)
    told = robot.at(12, Line("state", "holds"))
    assert (told["lastFault"], told["faultAge"]) == ("the driver gave up", 3)


def test_a_glance_is_due_once_a_second() -> None:
    robot = Watched()
    assert robot.glance.is_due()
    robot.at(0, Line("state", "holds"))
    robot.now += 0.9
    assert not robot.glance.is_due()
    robot.now += 0.2
    assert robot.glance.is_due()


# ---- what is passed on ----


def test_robots_of_one_model_have_their_meshes_sent_once() -> None:
    told, models = Told(), set[str]()
    numbers = Numbers()
    numbers.add(np.arange(9.0), "<f4")
    for robot in range(3):
        card = Card(told, robot, "host", models)  # type: ignore[arg-type]
        card.take(message("session", numbers, session=robot, bodies=[]))
    kinds = [one["kind"] for one in told.messages]
    assert kinds == ["model", "session", "session", "session"]
    assert {one["model"] for one in told.messages} == {told.messages[0]["model"]}


def test_a_card_gets_the_image_of_one_camera() -> None:
    told, numbers = Told(), Numbers()
    images = [(name, numbers.add_file(name.encode() * 5)) for name in ("left", "right")]
    Card(told, 4, "host", set()).take(message("images", numbers, images=images))  # type: ignore[arg-type]
    (shown,) = told.messages
    assert (shown["put"], shown["images"]) == ("images 4", [["left", [0, 20]]])


def framed(text: str) -> bytes:
    return len(text).to_bytes(4, "little") + text.encode()


@pytest.mark.parametrize(
    "data",
    [
        *(
            b"",
            b"abc",
            "text",
            b"\xff\xff\xff\xff{}",
            framed("[]"),
            framed("{}"),
            framed("[" * 99_999),
        ),
        framed('{"kind": "glance", "rate": Infinity}'),
        framed('{"kind": "glance", "rate": 1e999}'),
        framed('{"kind": "frame", "numbers": 2}'),
        framed('{"kind": "images", "images": 3}'),
        framed('{"kind": "images", "images": [["left", "right"]]}'),
    ],
)
def test_a_message_that_makes_no_sense_reaches_no_browser(data: Any) -> None:
    told = Told()
    card = Card(told, 7, "host", set())  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="no 'trifinger view'"):
        card.take(data)
    assert told.messages == []


def test_a_robot_speaks_only_for_itself() -> None:
    told = Told()
    card = Card(told, 7, "host", set())  # type: ignore[arg-type]
    for kind in ("glance", "host", "model", "none", "state", "curves"):
        card.take(framed(json.dumps({"kind": kind, "robot": 3})))
    assert [(one["put"], one["robot"]) for one in told.messages] == [("glance 7", 7)]


# ---- robots on other machines ----


@pytest.mark.slow
def test_the_page_follows_a_robot_through_its_fault_and_recovery(
    start_view: StartView, start_fake: StartChild, tmp_path: Path
) -> None:
    start_fake("bot", observation_fault_after=20)
    viewing = start_view("bot")
    (tmp_path / "robots").write_text(f"# one\n{viewing.url}\n")
    viewing_all = start_view("--fleet", f"@{tmp_path / 'robots'}")
    with browse(viewing_all) as browser:
        held = state_of(0, browser, "holds its pose")
        assert (held["title"], held["rate"], held["lastFault"]) == ("bot", None, "")
        assert held["facts"].startswith("fake · 1 kHz")
        robot = trifinger.connect("bot")
        with pytest.raises(trifinger.RobotStopped):
            robot.append_desired_actions(np.repeat(robot.new_action(), 100_000))
        lines = {line["label"]: line for line in state_of(0, browser, "has ended")["lines"]}
        assert lines["state"]["level"] == "bad"
        assert "the driver" in lines["fault"]["text"]
        assert lines["remedy"]["text"] == "trifinger recover bot"
        trifinger.recover("bot")
        again = state_of(0, browser, "holds its pose")
        assert again["lastFault"] == lines["fault"]["text"]
        assert again["isAgeKnown"]
    assert viewing_all.said == "Ctrl-C ends the page; the robots do not notice.\n"
    assert viewing_all.end() == (130, "")
    assert viewing.end() == (130, "")


@pytest.mark.slow
def test_a_robot_that_runs_has_its_rate(start_view: StartView, start_program: StartProgram) -> None:
    words = ("fake", "--name", "bot", "--real-time", *PATIENT_FAKE)
    start_program("run", *words).wait_for("waits for a user")
    viewing_all = start_view("--fleet", start_view("bot").url)
    with browse(viewing_all) as browser, trifinger.connect("bot") as robot:
        robot.append_desired_action(robot.new_action())  # it is repeated
        while not state_of(0, browser, "runs")["rate"]:
            pass


@pytest.mark.slow
def test_a_robot_whose_page_was_killed_says_so_and_comes_back(
    start_view: StartView, start_fake: StartChild
) -> None:
    start_fake("bot")
    viewing = start_view("bot")
    with browse(start_view("--fleet", viewing.url)) as browser:
        reason_of(0, browser, "")
        os.kill(viewing.process.pid, signal.SIGKILL)
        reason_of(0, browser, "its page has ended")
        reason_of(0, browser, "nothing listens at this port")
        start_view("bot", "--port", str(viewing.port), "--token", viewing.token)
        reason_of(0, browser, "")
        state_of(0, browser, "holds its pose")


@pytest.mark.slow
def test_a_page_that_stands_still_is_given_up_and_found_again(
    start_view: StartView, start_fake: StartChild
) -> None:
    start_fake("bot")
    viewing = start_view("bot")
    before = "from trifinger_view import fleet\nfleet.SILENCE = 2.0"
    with browse(start_view("--fleet", viewing.url, before=before)) as browser:
        state_of(0, browser, "holds its pose")
        viewing.process.send_signal(signal.SIGSTOP)
        reason_of(0, browser, "nothing was heard of it for 2 s")
        viewing.process.send_signal(signal.SIGCONT)
        reason_of(0, browser, "")


class Html(http.server.BaseHTTPRequestHandler):
    """A server of something else."""

    def do_GET(self) -> None:
        self.send_error(404)

    def log_message(self, *_: Any) -> None: ...


@contextlib.contextmanager
def another_server() -> Iterator[int]:
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Html) as server:
        threading.Thread(target=server.serve_forever).start()
        try:
            yield server.server_port
        finally:
            server.shutdown()


@contextlib.contextmanager
def robot_of(serve: Callable[[Any], None]) -> Iterator[int]:
    """A server of websockets that does what a test wants in place of a robot's page."""
    with websockets.sync.server.serve(serve, "127.0.0.1", 0) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield server.socket.getsockname()[1]
        finally:
            server.shutdown()
            thread.join()


@pytest.mark.slow
def test_each_robot_that_cannot_be_seen_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def talk_nonsense(connection: Any) -> None:
        connection.send(b"nonsense")
        for _ in connection:
            pass

    monkeypatch.setattr(fleet, "SILENCE", 2.0)
    with contextlib.ExitStack() as stack:
        robot, server = stack.enter_context(page_of_a_robot())
        log, _ = stack.enter_context(page_of_a_robot())
        log.sockets.remove(GLANCE)
        other = Authentication(port=0)
        other.sockets.add(GLANCE)
        stack.enter_context(contextlib.closing(other))
        strange = PageServer(other, document_of("test"))
        stack.callback(strange.stop)
        deaf = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        html, nonsense = map(stack.enter_context, (another_server(), robot_of(talk_nonsense)))
        server.put("glance", message("glance", lines=[{"text": "holds"}]))
        reasons = {
            f"127.0.0.1:{robot.port}": "",
            f"127.0.0.1:{log.port}": "its page shows no running robot",
            f"127.0.0.1:{other.port}": "it does not know this token",
            f"127.0.0.1:{free_port()}": "nothing listens at this port",
            f"127.0.0.1:{html}": STRANGER,
            f"127.0.0.1:{nonsense}": STRANGER,
            "nobody.invalid:8080": "there is no machine of this name",
            f"127.0.0.1:{deaf.getsockname()[1]}": "nothing was heard of it for 2 s",
        }
        found: dict[str, str] = {}
        authentication, _ = stack.enter_context(fleet_of(*reasons))
        with browse(authentication) as browser:
            for told in messages_of(browser):
                if told["kind"] == "host" and told["reason"] != "no answer yet":
                    assert told["reason"].startswith(reasons[told["host"]]), told
                    found[told["host"]] = told["reason"]
                if len(found) == len(reasons):
                    break
            assert found[f"127.0.0.1:{robot.port}"] == ""


# ---- who gets in, and that it only looks ----


@pytest.mark.parametrize(
    "headers",
    [
        {"Authorization": "Bearer another-token"},
        {"Authorization": ""},
        {"Origin": "http://evil.example"},
        {"Authorization": "", "Cookie": "trifinger_view_0=what-the-robot-knows"},
    ],
)
def test_fault_68_without_the_token_there_is_no_glance(headers: dict[str, str]) -> None:
    with page_of_a_robot() as (authentication, _):
        with (
            pytest.raises(websockets.exceptions.InvalidStatus) as refused,
            glance_at(authentication, **headers),
        ):
            pass
        assert refused.value.response.status_code == 403


def test_fault_68_a_glance_that_asks_for_anything_is_ended_and_nothing_is_done() -> None:
    with page_of_a_robot() as (authentication, server):
        done = queue.SimpleQueue[Any]()
        server.on_message = lambda *asked: done.put(asked)
        server.on_gone = lambda _: done.put("gone")
        server.put("glance", message("glance", number=1))
        with glance_at(authentication) as glance:
            wait_for(glance, "glance", number=1)
            assert server.is_glanced_at
            assert server.browsers == []  # for which a page would be quick
            send(glance, "take")
            with contextlib.suppress(websockets.exceptions.ConnectionClosedError):
                for _ in glance:
                    pass
            assert glance.close_code == 1003
        assert done.get() == "gone"


def test_fault_68_no_message_of_a_browser_reaches_a_robot_or_its_page() -> None:
    received = queue.SimpleQueue[Any]()

    def serve(connection: Any) -> None:
        connection.send(message("glance", lines=[{"text": "holds"}]))
        for data in connection:
            received.put(data)
        received.put(None)

    with robot_of(serve) as port:
        with fleet_of(f"127.0.0.1:{port}") as (authentication, server):
            heard = queue.SimpleQueue[Any]()
            server.on_message = lambda _, asked: heard.put(asked)
            with browse(authentication) as browser:
                state_of(0, browser, "holds")
                everything = ("take", "release", "recover", "mode", "joint", "drag", "stop")
                for do in everything:
                    send(browser, do, robot=0, mode="home", joint=0, position=0.1)
                for do in everything:
                    assert heard.get()["do"] == do
            for path in ("/stop", "/stopped", "/actions"):
                cookie = f"{authentication.cookie}={authentication.token}"
                asker = http.client.HTTPConnection("127.0.0.1", authentication.port)
                with contextlib.closing(asker):
                    asker.request("GET", path, headers={"Cookie": cookie, "X-TriFinger": "stop"})
                    assert asker.getresponse().status == 404
        assert received.get() is None  # the connection has ended, and nothing came before


@pytest.mark.slow
def test_fault_68_a_fleet_page_takes_no_control_and_knows_no_token_of_a_robot(
    start_view: StartView, start_program: StartProgram
) -> None:
    start_program("run", "sim", *PATIENT).wait_for("waits for a user")
    viewing = start_view("sim", "--control")
    viewing_all = start_view("--fleet", viewing.url)
    everything = b""
    with browse(viewing_all) as browser:
        send(browser, "take")
        for data in browser:
            assert isinstance(data, bytes)
            everything += data
            told = content_of(data)
            if told["kind"] == "frame":
                break
    assert viewing.token.encode() not in everything
    with browse(viewing) as driver:
        send(driver, "take")
        assert wait_for(driver, "seat", isDriver=True)


def test_a_slow_browser_gets_the_robots_in_turn() -> None:
    with fleet_of() as (authentication, server):
        server.put("frame 2", message("frame", number=0))
        server.put("frame 1", message("frame", number=1))
        server.put("frame 2", message("frame", number=2))
        with browse(authentication) as browser:
            found = messages_of(browser)
            assert [next(found)["number"] for _ in range(2)] == [1, 2]


# ---- robots of this machine ----


@pytest.mark.slow
def test_without_an_address_the_robots_of_this_machine_are_shown_as_they_come(
    start_view: StartView, start_fake: StartChild
) -> None:
    viewing_all = start_view("--fleet")
    with browse(viewing_all) as browser:
        none = wait_for(browser, "none")
        assert none["text"] == "no robot runs; this page shows each that does"
        first = start_fake("first")
        state_of(0, browser, "holds its pose")
        start_fake("second")
        assert state_of(1, browser, "holds its pose")["title"] == "second"
        first.kill()
        assert state_of(0, browser, "the back-end is gone")["title"] == "first"
    assert viewing_all.end() == (130, "")


@pytest.mark.slow
def test_a_fleet_of_this_machine_sees_a_robot_of_which_it_draws_a_picture(
    start_view: StartView, start_program: StartProgram
) -> None:
    start_program("run", "sim", "--non-real-time", *PATIENT).wait_for("waits for a user")
    with browse(start_view("--fleet")) as browser:
        session = wait_for(browser, "session", robot=0)
        assert len(session["bodies"]) > 9
        assert wait_for(browser, "frame", robot=0)["step"] == -1
