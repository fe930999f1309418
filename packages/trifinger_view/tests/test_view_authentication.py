# SPDX-License-Identifier: BSD-3-Clause
"""Who gets to a page, and what they can do there."""

import contextlib
import http.client
import ipaddress
import json
import queue
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import websockets.exceptions
from hypothesis import given, strategies
from trifinger import Error, InvalidArgument
from trifinger_view import authentication as authentication_module
from trifinger_view.authentication import Authentication
from trifinger_view.page import document_of
from trifinger_view.page_server import PageServer
from trifinger_view.to_browser import Numbers, message
from viewing import Viewing
from websockets.sync.client import ClientConnection, connect


@pytest.fixture
def authentication() -> Iterator[Authentication]:
    authentication = Authentication(port=0)
    yield authentication
    authentication.close()


@pytest.fixture
def server(authentication: Authentication) -> Iterator[PageServer]:
    server = PageServer(authentication, document_of("test"))
    server.put("state", message("state", number=0))
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
        max_size=None,
        compression=None,
        ping_interval=None,
        max_queue=max_queue,
    )


def send(browser: ClientConnection, do: str, **asked: Any) -> None:
    browser.send(json.dumps({"do": do, **asked}))


def messages_of(browser: ClientConnection) -> Iterator[dict[str, Any]]:
    """Yields the texts of the messages that a browser gets."""
    for data in browser:
        assert isinstance(data, bytes)
        size = int.from_bytes(data[:4], "little")
        yield json.loads(data[4 : 4 + size])


def wait_for(browser: ClientConnection, kind: str, **fields: Any) -> dict[str, Any]:
    for found in messages_of(browser):
        if found["kind"] == kind and all(found[name] == fields[name] for name in fields):
            return found
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
    policy = headers["Content-Security-Policy"]
    assert "frame-ancestors 'none'" in policy
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    with browse(authentication) as browser:
        wait_for(browser, "state")


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


def test_messages_of_a_browser_are_done_in_order_and_its_end_comes_last(
    server: PageServer, authentication: Authentication
) -> None:
    done: queue.SimpleQueue[Any] = queue.SimpleQueue()
    server.on_message = lambda browser, asked: done.put((browser, asked["number"]))
    server.on_gone = lambda browser: done.put((browser, "gone"))
    with browse(authentication) as browser:
        for number in range(100):
            send(browser, "anything", number=number)
    found = [done.get() for _ in range(101)]
    assert [what for _, what in found] == [*range(100), "gone"]
    assert len({browser for browser, _ in found}) == 1


def test_a_message_for_one_browser_is_sent_to_no_other(
    server: PageServer, authentication: Authentication
) -> None:
    with browse(authentication) as first:
        wait_for(first, "state")
        (number,) = server.browsers
        with browse(authentication) as second:
            wait_for(second, "state")
            server.put("seat", message("seat", of=number), number)
            server.put("seat", message("seat", of=-1), -1)  # which there is not
            server.put("curves", message("curves"))
            assert wait_for(first, "seat")["of"] == number
            assert next(messages_of(second))["kind"] == "curves"


@pytest.mark.parametrize(
    "data",
    [
        *(b"", b"\xc1", b"\x80", "text", "[]", "1", "{}", '{"do": 1}', "[" * 4000, b"\xff" * 9),
        *('{"do": "drag", "point": NaN}', '{"do": "drag", "point": [-Infinity]}'),
        json.dumps({"do": "x" * 5000}),
    ],
)
def test_fault_68_a_message_that_makes_no_sense_ends_that_connection_alone(
    server: PageServer, authentication: Authentication, data: bytes | str
) -> None:
    asked: list[Any] = []
    server.on_message = lambda *what: asked.append(what)
    with browse(authentication) as browser, browse(authentication) as other:
        wait_for(browser, "state")
        wait_for(other, "state")
        with contextlib.suppress(websockets.exceptions.ConnectionClosed):
            browser.send(data)
        with contextlib.suppress(websockets.exceptions.ConnectionClosed):
            for _ in browser:  # until the server closes it
                pass
        server.put("state", message("state", number=1))
        wait_for(other, "state", number=1)
    assert asked == []


@pytest.mark.usefixtures("server")
def test_fault_68_connections_are_bounded(authentication: Authentication) -> None:
    with contextlib.ExitStack() as browsers:
        for _ in range(authentication_module.MAX_BROWSERS):
            wait_for(browsers.enter_context(browse(authentication)), "state")
        with pytest.raises(websockets.exceptions.InvalidStatus) as refused:
            browsers.enter_context(browse(authentication))
        assert refused.value.response.status_code == 503


@pytest.mark.slow
def test_fault_68_a_slow_browser_loses_frames_alone(
    server: PageServer, authentication: Authentication
) -> None:
    """One browser reads nothing while much more is sent than buffers hold; another sees it all."""
    frames, numbers = 100, Numbers()
    numbers.add_file(bytes(240_000))
    with browse(authentication, max_queue=1) as slow, browse(authentication) as quick:
        wait_for(slow, "state")
        wait_for(quick, "state")
        for number in range(frames):
            server.put("frame", message("frame", numbers, number=number))
            wait_for(quick, "frame", number=number)
        seen = []
        for found in messages_of(slow):
            seen.append(found["number"])
            if seen[-1] == frames - 1:
                break
    assert len(seen) < frames / 2  # buffers hold a few megabytes
    assert seen == sorted(seen)
