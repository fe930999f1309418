# SPDX-License-Identifier: BSD-3-Clause
"""What unauthenticated clients can do at a server, and what they cannot: its users get in, and its
stop works.
"""

import asyncio
import contextlib
import gc
import http.client
import json
import random
import resource
import socket
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
from conftest import PATIENT, StartProgram
from test_view_authentication import browse, wait_for
from test_view_steering import ask
from trifinger_view import web_server
from trifinger_view.authentication import Authentication
from trifinger_view.page import document_of
from trifinger_view.page_server import PageServer
from trifinger_view.to_browser import Numbers, message
from viewing import StartView, Viewing
from websockets.sync.client import ClientConnection, connect

# A page with few files, so that a test needs few clients.
FEW_FILES = """
import resource
resource.setrlimit(resource.RLIMIT_NOFILE, (200, 200))
"""
CLIENTS = 400
STOP = {"X-TriFinger": "stop"}


@pytest.fixture
def many_files() -> Iterator[None]:
    """Lets this process open as many files as it may."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@contextlib.contextmanager
def other_clients(
    port: int, count: int = CLIENTS, says: bytes = b""
) -> Iterator[list[socket.socket]]:
    """Connections of somebody who says this and then nothing."""
    with contextlib.ExitStack() as stack:
        connections = []
        for _ in range(count):
            connection = stack.enter_context(socket.create_connection(("127.0.0.1", port)))
            with contextlib.suppress(ConnectionError):  # it may have lost its place already
                connection.sendall(says)
            connections.append(connection)
        yield connections


def wait_for_end(connection: socket.socket) -> None:
    """Waits until the other side has closed a connection."""
    with contextlib.suppress(ConnectionError):
        assert connection.recv(1) == b""


@pytest.mark.usefixtures("many_files")
def test_fault_76_silent_clients_do_not_keep_the_stop_from_working(
    start_view: StartView, start_program: StartProgram
) -> None:
    robot = start_program("run", "sim", *PATIENT)
    robot.wait_for("waits for a user")
    page = start_view("sim", "--control", before=FEW_FILES)
    with other_clients(page.port):
        status, text = ask(page, "/stop", **STOP)
        assert (status, "Stopping" in text) == (202, True), text
        robot.process.wait()
        assert ask(page, "/stopped", **STOP)[0] == 200
        assert "/stopped" in ask(page, "/")[1]
    assert page.end()[1] == ""  # neither tracebacks nor anything else


def line_of(page: Viewing | Authentication) -> ClientConnection:
    """The websocket that a page keeps open for its stop."""
    return connect(
        f"ws://127.0.0.1:{page.port}/actions",
        origin=f"http://127.0.0.1:{page.port}",  # type: ignore[arg-type]
        additional_headers={"Cookie": f"{page.cookie}={page.token}"},
    )


@pytest.mark.usefixtures("many_files")
def test_fault_76_the_stop_of_an_open_page_needs_no_new_connection(
    start_view: StartView, start_program: StartProgram
) -> None:
    robot = start_program("run", "sim", *PATIENT)
    robot.wait_for("waits for a user")
    page = start_view("sim", "--control", before=FEW_FILES)
    with line_of(page) as line, other_clients(page.port):
        line.send("1 /stop")
        answer = json.loads(line.recv())
        assert (answer["number"], answer["status"]) == ("1", 202)
        robot.process.wait()
        line.send("2 /stopped")
        assert json.loads(line.recv())["status"] == 200
        line.send("3 /other")
        assert json.loads(line.recv())["status"] == 404


STOP_WITHOUT_FILES = """
import os, resource, sys
from trifinger_view.stop import Stop
stop = Stop(sys.argv[1])
resource.setrlimit(resource.RLIMIT_NOFILE, (100, 100))
try:
    while True:
        os.open(os.devnull, os.O_RDONLY)
except OSError:
    print("ready", *stop.order(), flush=True)
"""


def test_fault_76_the_files_of_the_stop_are_reserved(start_program: StartProgram) -> None:
    robot = start_program("run", "sim", *PATIENT)
    robot.wait_for("waits for a user")
    done = subprocess.run(
        [sys.executable, "-c", STOP_WITHOUT_FILES, "sim"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.startswith("ready 202 Stopping"), done.stdout
    robot.process.wait()


@pytest.fixture
def authentication() -> Iterator[Authentication]:
    authentication = Authentication(port=0)
    server = PageServer(authentication, document_of("test"))
    server.put("state", message("state"))
    yield authentication
    server.stop()
    authentication.close()


@pytest.mark.usefixtures("many_files")
def test_fault_76_unauthenticated_clients_have_few_places_and_the_oldest_loses_its_own(
    authentication: Authentication,
) -> None:
    with browse(authentication) as browser, other_clients(authentication.port) as connections:
        for one in connections[: CLIENTS - web_server.MAX_UNAUTHENTICATED]:
            wait_for_end(one)
        # Who belongs here keeps the connection and gets in as always.
        wait_for(browser, "state")
        with browse(authentication) as another:
            wait_for(another, "state")


BRIDGE = "import sys; from trifinger_view.commands.bridge import main; sys.exit(main())"


@contextlib.contextmanager
def bridging(*words: str, before: str = "") -> Iterator[tuple[subprocess.Popen[str], int]]:
    """A bridge to Foxglove in a process of its own, and its port."""
    bridge = subprocess.Popen(
        [sys.executable, "-c", before + BRIDGE, "foxglove", "robot", "--port", "0", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    with bridge:
        try:
            assert bridge.stdout is not None
            yield bridge, int(bridge.stdout.readline().rpartition(":")[2].partition("/")[0])
        finally:
            bridge.kill()


@pytest.mark.usefixtures("many_files")
@pytest.mark.parametrize(
    "says", [b"", b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"], ids=["nothing", "a request"]
)
def test_fault_76_the_bridge_serves_its_clients_while_others_connect(says: bytes) -> None:
    with bridging(before=FEW_FILES) as (bridge, port):
        with other_clients(port, says=says):
            address = f"ws://127.0.0.1:{port}"
            with connect(address, subprotocols=["foxglove.sdk.v1"]) as viewer:  # type: ignore[list-item]
                assert json.loads(viewer.recv())["op"] == "serverInfo"
        bridge.terminate()
        assert "files" not in bridge.communicate()[0]  # there were always enough


# ---- a server that cannot open files ----


@contextlib.contextmanager
def no_files() -> Iterator[None]:
    """Lets this process open no file."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_fault_76_a_server_says_once_that_files_are_missing_and_ends_in_order(
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    delay = 0.01  # until asyncio tries again [s]
    monkeypatch.setattr(asyncio.constants, "ACCEPT_RETRY_DELAY", delay)

    async def fail() -> None:
        raise FileNotFoundError("another mistake")

    async def main() -> None:
        listener = socket.create_server(("127.0.0.1", 0))
        loop = asyncio.get_running_loop()
        failed = asyncio.Event()
        with socket.socket() as other_client:
            async with web_server.serve(lambda _: None, listener, lambda *_: None):
                handler = loop.get_exception_handler()
                assert handler is not None

                def note(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
                    handler(loop, context)
                    failed.set()

                loop.set_exception_handler(note)
                with no_files():
                    other_client.connect(listener.getsockname())
                    for _ in range(2):
                        await failed.wait()
                        failed.clear()
            await asyncio.sleep(delay)  # asyncio's plan to try again is older
            assert caplog.text == ""
            task = asyncio.ensure_future(fail())
            await asyncio.wait([task])
            del task
            gc.collect()

    asyncio.run(main())
    said = capsys.readouterr().err
    assert said == "trifinger: a connection could not be taken: Too many open files\n"
    assert "another mistake" in caplog.text


# ---- clients of a page that read nothing, say nothing, or say nonsense ----

FRAMES = 40
FRAME = Numbers()
FRAME.add_file(bytes(240_000))  # all frames together are more than buffers hold
LARGE = b"\x81\xfe\xff\xff" + bytes(4)  # a text of 64 KB begins


@pytest.mark.parametrize(
    "says",
    [
        b"",
        b"GET / HTTP/1.1\r\nHost: 127",
        bytes(range(128, 256)),
        b"{request}",
        b"{request}" + bytes(range(256)),  # no frame of a websocket
        b"{request}\x82",  # half a frame
        b"{request}" + LARGE + bytes(1000),  # half a message
        b"{request}\x81\x85" + bytes(4) + b"[1,2}",  # a message that is none
        b"{request}\x88\x80" + bytes(4),  # the end, whose answer it does not read
    ],
    ids=lambda says: repr(says)[2:30],
)
def test_a_client_that_reads_nothing_holds_up_neither_the_others_nor_the_end(says: bytes) -> None:
    authentication = Authentication(port=0)
    server = PageServer(authentication, document_of("test"))
    server.put("frame", message("frame", FRAME, number=-1))
    request = (
        f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{authentication.port}\r\nUpgrade: websocket\r\n"
        f"Origin: http://127.0.0.1:{authentication.port}\r\nConnection: Upgrade\r\n"
        f"Cookie: {authentication.cookie}={authentication.token}\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    )
    says = says.replace(b"{request}", request.encode())
    with browse(authentication) as browser, socket.socket() as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.connect(("127.0.0.1", authentication.port))
        client.sendall(says)
        for number in range(FRAMES):
            server.put("frame", message("frame", FRAME, number=number))
            wait_for(browser, "frame", number=number)
        server.stop()  # pytest's watchdog ends it if it hangs
        for _ in browser:  # until its end, which is in order
            pass
    authentication.close()


# ---- port scans and requests that are none ----

SCANS = [
    b"",
    b"\r\n\r\n",
    b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(range(256)),  # TLS
    b"GET / HTTP/1.0\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"OPTIONS sip:nm SIP/2.0\r\n\r\n",
    b"GET //[ HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"GET /?token=\xff\xfe HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: \x1b]0;evil\x07\r\nConnection: Upgrade\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: \x1b[31mevil\r\n\r\n",
    b"GET / HTTP/1.1\r\nno header\r\n\r\n",
    b"GET / HTTP/1.1\r\nContent-Length: x\r\n\r\n",
    b"GET /" + b"a" * 100_000,
    b"SSH-2.0-scan\r\n",
]


def scan(port: int) -> None:
    """Sends what scans of ports send, whole and in parts, and random bytes."""
    chance = random.Random(1)  # noqa: S311 (not for secrets)
    noise = [chance.randbytes(chance.randrange(200)) for _ in range(50)]
    halves = [one[: len(one) // 2] for one in SCANS]
    waits = [one for one in SCANS if one.endswith(b"\r\n\r\n")]  # for an answer
    for number, content in enumerate((*waits, *SCANS, *halves, *noise)):
        with (
            socket.create_connection(("127.0.0.1", port)) as connection,
            contextlib.suppress(OSError),
        ):
            connection.sendall(content)
            if number >= len(waits):
                connection.shutdown(socket.SHUT_WR)
            while connection.recv(4096):
                pass


def test_fault_81_scans_of_a_page_print_nothing(start_view: StartView) -> None:
    page = start_view("sim")
    scan(page.port)
    assert "<html" in ask(page, "/")[1].lower()
    assert page.end()[1] == ""


def test_fault_81_scans_of_the_bridge_print_no_traceback_and_no_escape_sequence() -> None:
    with bridging("--token", "t" * 16) as (bridge, port):
        scan(port)
        bridge.terminate()
        output, _ = bridge.communicate()
    assert bridge.returncode == 0
    assert "Traceback" not in output
    assert "\x1b" not in output
    # One sentence a second tells of all that were refused.
    assert "a client was refused" in output


@pytest.mark.parametrize("path", ["/?" + "a=1&" * 9, "//[", "/?token=x&" + "b=&c" * 20])
def test_fault_81_a_query_with_too_many_fields_is_refused_with_a_sentence(
    authentication: Authentication, path: str
) -> None:
    for cookie in ("", f"{authentication.cookie}={authentication.token}"):
        connection = http.client.HTTPConnection("127.0.0.1", authentication.port)
        with contextlib.closing(connection):
            connection.request("GET", path, headers={"Cookie": cookie})
            answer = connection.getresponse()
            text = answer.read().decode()
        assert answer.status in (400, 403, 404, 303), text
        if path.startswith("/?"):
            assert answer.status == 400
            assert "at most 8 fields" in text
