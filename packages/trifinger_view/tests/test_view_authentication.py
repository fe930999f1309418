# SPDX-License-Identifier: BSD-3-Clause
"""Who gets to a page, and what they can do there."""

import contextlib
import http.client
import ipaddress
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec.msgpack
import numpy as np
import pytest
import viser
import websockets.exceptions
from hypothesis import given, strategies
from trifinger import Error, InvalidArgument
from trifinger_view import authentication as authentication_module
from trifinger_view.authentication import Authentication, page_server
from viewing import Viewing
from websockets.sync.client import ClientConnection, connect

VERSION = f"viser-v{viser.__version__}"


@pytest.fixture
def authentication() -> Iterator[Authentication]:
    authentication = Authentication(port=0)
    yield authentication
    authentication.close()


@pytest.fixture
def server(authentication: Authentication) -> Iterator[Any]:
    server = page_server(authentication, "test")
    yield server
    server.stop()


def get(
    authentication: Authentication, path: str = "/", **headers: str
) -> tuple[int, dict[str, str], bytes]:
    """Asks for a page; `headers` are added to those of a browser, or replace them."""
    browser = {
        "Host": f"127.0.0.1:{authentication.port}",
        "Cookie": f"{authentication.cookie}={authentication.token}",
    }
    connection = http.client.HTTPConnection("127.0.0.1", authentication.port)
    with contextlib.closing(connection):
        connection.putrequest("GET", path, skip_host=True)
        for name, value in (browser | headers).items():
            if value:
                connection.putheader(name, value)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read()


def browse(
    authentication: Authentication | Viewing, *, max_queue: int | None = None, **headers: str
) -> ClientConnection:
    """Connects as the page does, with other headers on request.

    As a browser, it answers the server's pings however late a test reads its messages. With a
    `max_queue` it takes no more than these, so the network fills up.
    """
    origin = headers.pop("Origin", f"http://127.0.0.1:{authentication.port}")
    cookies = headers.pop("Cookie", f"{authentication.cookie}={authentication.token}")
    return connect(
        f"ws://127.0.0.1:{authentication.port}",
        origin=origin or None,  # type: ignore[arg-type]
        additional_headers={"Cookie": cookies, **headers},
        subprotocols=[VERSION],  # type: ignore[list-item]
        max_size=None,
        compression=None,
        ping_interval=None,
        max_queue=max_queue,
    )


def send(browser: ClientConnection, kind: str, **fields: Any) -> None:
    browser.send(msgspec.msgpack.encode({"type": kind, **fields}))


def messages_of(browser: ClientConnection) -> Iterator[dict[str, Any]]:
    """Yields the messages that a browser gets, without large arrays."""
    import zstandard

    for data in browser:
        assert isinstance(data, bytes)
        size = int.from_bytes(data[8:16], "little")
        packed = zstandard.ZstdDecompressor().decompress(data[16 : 16 + size])
        yield from msgspec.msgpack.decode(packed)["messages"]


def wait_for(browser: ClientConnection, kind: str, **fields: Any) -> dict[str, Any]:
    for message in messages_of(browser):
        if message["type"] == kind and all(message[name] == fields[name] for name in fields):
            return message
    raise AssertionError("the connection was closed")


# ---- who gets in ----


@pytest.mark.usefixtures("server")
def test_the_address_with_the_token_leads_to_the_page(authentication: Authentication) -> None:
    path = authentication.url.removeprefix(f"http://127.0.0.1:{authentication.port}")
    status, headers, _ = get(authentication, path, Cookie="")
    assert (status, headers["Location"]) == (303, "/")
    cookie = headers["Set-Cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite" in cookie
    status, headers, page = get(authentication, Cookie=cookie.split(";")[0])
    assert status == 200
    assert b"<html" in page.lower()
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    with browse(authentication) as browser:
        wait_for(browser, "ReplayDoneMessage")


@pytest.mark.usefixtures("server")
@pytest.mark.parametrize(
    "headers",
    [
        {"Cookie": ""},  # another user of this machine
        {"Cookie": "trifinger_view_0=guess"},
        {"Host": "evil.example"},  # another site whose name points here
        {"Host": "evil.example:8080"},
        {"Host": "127.0.0.1.evil.example"},
        {"Host": "10.1.2.3"},
        {"Host": "127.0.0.1@evil.example"},
        {"Host": "["},
    ],
)
def test_fault_68_without_the_token_there_is_no_page_and_no_connection(
    authentication: Authentication, headers: dict[str, str]
) -> None:
    status, answer, page = get(authentication, **headers)
    assert status == 403
    assert authentication.token not in str(answer)
    assert authentication.token.encode() not in page
    if "Host" not in headers:
        with (
            pytest.raises(websockets.exceptions.InvalidStatus) as refused,
            browse(authentication, **headers),
        ):
            pass
        assert refused.value.response.status_code == 403


@pytest.mark.usefixtures("server")
@pytest.mark.parametrize("origin", ["", "null", "http://evil.example", "http://127.0.0.1:1"])
def test_fault_68_a_page_of_another_site_cannot_connect(
    authentication: Authentication, origin: str
) -> None:
    with (
        pytest.raises(websockets.exceptions.InvalidStatus) as refused,
        browse(authentication, Origin=origin),
    ):
        pass
    assert refused.value.response.status_code == 403


@pytest.mark.usefixtures("server")
@pytest.mark.parametrize(
    "path", ["/?token=guess", "/?token=", "/?token=%C3%A9%FF", "/other?token={}"]
)
def test_fault_68_a_wrong_token_or_place_is_refused(
    authentication: Authentication, path: str
) -> None:
    status, headers, _ = get(authentication, path.format(authentication.token), Cookie="")
    assert status == 403
    assert "Set-Cookie" not in headers


@pytest.mark.usefixtures("server")
def test_fault_68_the_address_cannot_tell_the_page_to_obey_another_server(
    authentication: Authentication,
) -> None:
    status, headers, _ = get(authentication, "/?websocket=ws://evil.example")
    assert (status, headers["Location"]) == (303, "/")


ANYTHING = strategies.text(strategies.characters(), max_size=40)


@given(ANYTHING, ANYTHING)
def test_fault_68_only_the_token_is_known(name: str, value: str) -> None:
    authentication = AUTHENTICATION
    headers = {"Host": [f"localhost:{authentication.port}"], "Cookie": [f"{name}={value}"]}

    class Headers:
        def get_all(self, key: str) -> list[str]:
            return headers.get(key, [])

    assert authentication.refusal("/", Headers(), False) is not None
    headers["Cookie"] = [f"a=b; {authentication.cookie}={authentication.token}"]
    assert authentication.refusal("/", Headers(), False) is None
    headers["Host"] *= 2
    assert authentication.refusal("/", Headers(), False) is not None


AUTHENTICATION = Authentication(port=0)


def test_names_of_this_machine_are_known_and_foreign_addresses_only_on_the_network() -> None:
    everywhere = Authentication("0.0.0.0", 0)  # noqa: S104
    with contextlib.closing(everywhere.socket):
        assert not everywhere.is_local
        for host in ("localhost:1", "127.0.0.1", "[::1]:9", socket.gethostname(), "10.1.2.3:8"):
            assert everywhere._is_own(host), host
        assert not everywhere._is_own("evil.example")
        assert everywhere.url.startswith(f"http://{socket.gethostname()}:")
    assert AUTHENTICATION.is_local
    assert not AUTHENTICATION._is_own("10.1.2.3")


# ---- what listens ----


def listening() -> set[str]:
    """The addresses at which this process listens."""
    mine = set()
    for descriptor in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError):
            mine.add(str(descriptor.readlink()))
    found = set()
    for kind in ("tcp", "tcp6"):
        for line in Path(f"/proc/self/net/{kind}").read_text().splitlines()[1:]:
            words = line.split()
            if words[3] == "0A" and f"socket:[{words[9]}]" in mine:
                raw = bytes.fromhex(words[1].partition(":")[0])
                found.add(str(ipaddress.ip_address(raw[::-1] if kind == "tcp" else raw)))
    return found


@pytest.mark.usefixtures("server")
def test_fault_68_nothing_listens_beyond_this_machine() -> None:
    assert listening() == {"127.0.0.1"}


def test_a_port_in_use_is_named_and_without_a_choice_the_next_one_is_taken(
    authentication: Authentication,
) -> None:
    with pytest.raises(Error, match=f"port {authentication.port}.*--port"):
        Authentication(port=authentication.port)
    first, second = Authentication(), Authentication()
    with contextlib.closing(first.socket), contextlib.closing(second.socket):
        assert first.port != second.port


def test_addresses_and_tokens_that_cannot_be_used_are_named() -> None:
    with pytest.raises(Error, match=r"192\.0\.2\.1"):
        Authentication("192.0.2.1", 0)
    for token in ("short", "with a space and so on", "ümlaut-ümlaut-ümlaut"):
        with pytest.raises(InvalidArgument, match="at least 16"):
            Authentication(port=0, token=token)


# ---- what a browser can do ----


def test_fault_68_no_browser_opens_a_tunnel(
    server: Any, authentication: Authentication, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    for name in ("request_share_url", "disconnect_share_url"):
        monkeypatch.setattr(server, name, lambda name=name: asked.append(name))
    box = server.gui.add_checkbox("box", False)
    with browse(authentication) as browser:
        wait_for(browser, "ReplayDoneMessage")
        pose = {"wxyz": [1, 0, 0, 0], "position": [0, 0, 1], "look_at": [0, 0, 0], "fov": 1.0}
        size = {"image_height": 10, "image_width": 10, "near": 0.1, "far": 9.0}
        send(browser, "ViewerCameraMessage", up_direction=[0, 0, 1], **pose, **size)
        send(browser, "ShareUrlRequest")
        send(browser, "ShareUrlDisconnect")
        changed = threading.Event()
        box.on_update(lambda _: changed.set())
        send(browser, "GuiUpdateMessage", uuid=box._impl.uuid, updates={"value": True})
        changed.wait()
        # The pool of threads has done what came before: its last task is ours.
        server._thread_executor.shutdown(wait=True)
    assert asked == []
    with pytest.raises(Error, match="never shared"):
        type(server).request_share_url(server)


def test_fault_68_a_browser_changes_values_alone(
    server: Any, authentication: Authentication
) -> None:
    number = server.gui.add_number("number", 1.0)
    uuid, passed = number._impl.uuid, []
    tell = number._impl.sync_cb

    def note(client: Any, updates: dict[str, Any]) -> None:
        passed.append(updates)
        tell(client, updates)

    number._impl.sync_cb = note
    with browse(authentication) as browser, browse(authentication) as other:
        wait_for(browser, "ReplayDoneMessage")
        wait_for(other, "ReplayDoneMessage")
        for updates in (
            {"label": "<script>"},
            {"value": 2.0, "removed": True},
            {"value": float("nan")},
            {"value": "x" * 2000},
            {"value": [0.0] * 2000},
            {},
        ):
            send(browser, "GuiUpdateMessage", uuid=uuid, updates=updates)
        send(browser, "GuiUpdateMessage", uuid=uuid, updates={"value": 3.0})
        wait_for(other, "GuiUpdateMessage", updates={"value": 3.0})
    assert passed == [{"value": 3.0}]
    assert number.label == "number"


@pytest.mark.parametrize(
    "data",
    [
        *(b"", b"\xc1", b"\x80", "text", msgspec.msgpack.encode({"type": "Unknown"})),
        msgspec.msgpack.encode(
            {"type": "GuiUpdateMessage", "uuid": "", "updates": {"value": "x" * 2_000_000}}
        ),
    ],
)
def test_fault_68_a_message_that_makes_no_sense_ends_that_connection_alone(
    server: Any, authentication: Authentication, data: bytes | str
) -> None:
    with browse(authentication) as browser, browse(authentication) as other:
        wait_for(browser, "ReplayDoneMessage")
        wait_for(other, "ReplayDoneMessage")
        with contextlib.suppress(websockets.exceptions.ConnectionClosed):
            browser.send(data)
        with contextlib.suppress(websockets.exceptions.ConnectionClosed):
            for _ in browser:  # until the server closes it
                pass
        server.gui.add_text("text", "still here")
        wait_for(other, "GuiTextMessage", value="still here")


@pytest.mark.usefixtures("server")
def test_fault_68_connections_are_bounded(authentication: Authentication) -> None:
    with contextlib.ExitStack() as browsers:
        for _ in range(authentication_module.MAX_BROWSERS):
            wait_for(browsers.enter_context(browse(authentication)), "ReplayDoneMessage")
        with pytest.raises(websockets.exceptions.InvalidStatus) as refused:
            browsers.enter_context(browse(authentication))
        assert refused.value.response.status_code == 503


@pytest.mark.slow
def test_fault_68_a_slow_browser_loses_frames_alone(
    server: Any, authentication: Authentication
) -> None:
    """One browser reads nothing while much more is sent than buffers hold; another sees it all."""
    frames, points = 100, np.zeros((20_000, 3), np.float32)  # 240 kB each
    cloud = server.scene.add_point_cloud("/cloud", points, (0, 0, 0))
    mark = server.gui.add_number("mark", -1.0)
    with browse(authentication, max_queue=1) as slow, browse(authentication) as quick:
        wait_for(slow, "ReplayDoneMessage")
        wait_for(quick, "ReplayDoneMessage")
        for number in range(frames):
            with server.atomic():
                cloud.points = points + number
                mark.value = number
            wait_for(quick, "GuiUpdateMessage", updates={"value": number})
        # viser keeps one value of each thing, however slow a browser is.
        buffer = server._websock_server.get_message_buffer()
        assert (
            sum(
                type(one).__name__ == "SceneNodeUpdateMessage"
                for one in buffer.message_from_id.values()
            )
            <= 1
        )
        seen = []
        for message in messages_of(slow):
            if message["type"] == "GuiUpdateMessage":
                seen.append(message["updates"]["value"])
                if seen[-1] == frames - 1:
                    break
    assert len(seen) < frames / 2  # buffers hold a few megabytes
    assert seen == sorted(seen)
