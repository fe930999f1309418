# SPDX-License-Identifier: BSD-3-Clause
"""The web server of a page, and who may use it.

viser alone listens on all interfaces, asks nobody who they are, and lets any client open a public
tunnel. Here `Authentication` owns the only socket. Each request passes its checks before viser sees
it:

- the name in the address must be one of this machine, so no other site can point its name here;
- a websocket must come from a page of this server, so no other site can use a browser here;
- every request needs the token, so no other user of this machine or of the network gets in;
- of the messages of a browser, only those that the page needs reach viser.

A browser that is slow loses frames alone: viser keeps the newest value of each thing for it, and
`Authentication` bounds what lies in buffers of the connection.
"""

from __future__ import annotations

import contextlib
import gzip
import hmac
import http
import ipaddress
import json
import math
import secrets
import socket
import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from trifinger import extras
from trifinger.errors import Error, InvalidArgument

from trifinger_view import PAGE, web_server

if TYPE_CHECKING:
    import viser

LOOPBACK = "127.0.0.1"
FIRST_PORT = 8080
PORTS = 20  # ports that are tried if none was chosen
MAX_BROWSERS = 16  # connections at the same time
LARGEST_MESSAGE = 64 * 1024  # of a browser [bytes]
LONGEST_TEXT = 1000  # of a value that a browser sends [characters]
MAX_NUMBERS = 100  # in such a value
SEND_BUFFER = 256 * 1024  # of a connection, in the kernel [bytes]
SHORTEST_TOKEN = 16  # [characters]
ACTION_HEADER = "X-TriFinger"
ACTIONS = "/actions"  # the websocket over which a page asks for actions
UNKNOWN = "This page needs the whole address that `trifinger view` has printed, with its token.\n"


class Authentication:
    """The socket of a page and the checks of its requests. Its methods are for any thread."""

    def __init__(self, host: str = LOOPBACK, port: int | None = None, token: str = "") -> None:
        """Listens at `host` and `port`; without a port, at the first free one from 8080.

        `token` is what a browser must know: at least 16 letters, digits, "-" or "_". Without it,
        one is chosen by chance.

        Raises:
            InvalidArgument: if the token is too short or has other characters
            Error: if nothing can listen there
        """
        if token and (len(token) < SHORTEST_TOKEN or not _is_plain(token)):
            raise InvalidArgument(
                f"the token must have at least {SHORTEST_TOKEN} letters, digits, '-' or '_'"
            )
        self.token = token or secrets.token_urlsafe(24)
        self.host = host
        self.socket = _listen(host, port)
        self.port = int(self.socket.getsockname()[1])
        """The port at which it listens."""
        self._names = {"localhost", host.lower(), socket.gethostname().lower()}
        self._names.add(socket.getfqdn().lower())
        self._count_browsers: Callable[[], int] = lambda: 0
        self._actions: dict[str, Callable[[], tuple[int, str]]] = {}
        self._lines = 0  # websockets that are open at ACTIONS
        self._part = b""

    @property
    def cookie(self) -> str:
        """Name of the cookie with the token. Cookies of a machine are shared by its ports."""
        return f"trifinger_view_{self.port}"

    @property
    def is_local(self) -> bool:
        """Whether it listens only to programs of this machine."""
        return bool(ipaddress.ip_address(self.socket.getsockname()[0]).is_loopback)

    @property
    def url(self) -> str:
        """The address for a browser, with the token."""
        host = self.host
        if host in ("0.0.0.0", "::"):  # noqa: S104 (compared, not bound)
            host = socket.gethostname()
        if ":" in host:
            host = f"[{host}]"
        return f"http://{host}:{self.port}/?token={self.token}"

    def offer(self, path: str, action: Callable[[], tuple[int, str]]) -> None:
        """Does something when a script of the page asks for `path`; before the server starts.

        The action returns the status of the answer and its text. It must not wait: all requests
        share its thread. The request needs what every request needs, and the header X-TriFinger
        with the word "stop", which no page of another site can send.

        A page can also ask over a websocket at ACTIONS, which it opens in advance. An action then
        needs no new connection, which other clients could delay.
        """
        self._actions[path] = action

    def add_to_page(self, part: str) -> None:
        """Adds a piece of HTML to the page, beside what viser shows; before the server starts."""
        self._part += part.encode()

    def answer(self, path: str, headers: Any) -> tuple[int, str] | None:
        """Does the action at a path and returns its answer; None if there is none."""
        action = self._actions.get(path)
        if action is None:
            return None
        host = _only(headers, "Host")
        origins = headers.get_all("Origin")
        if (
            _only(headers, ACTION_HEADER) != "stop"
            or (origins and origins != [f"http://{host}"])
            or headers.get_all("Sec-Fetch-Site") not in ([], ["same-origin"])
        ):
            return 403, "Only a page of this server may ask for this.\n"
        return action()

    async def serve_actions(self, connection: Any) -> None:
        """Does what a page asks for over its websocket at ACTIONS: a number and a path.

        The answer is a JSON object with the number, a status and a text.
        """
        from websockets.exceptions import ConnectionClosed

        self._lines += 1
        try:
            async for message in connection:
                number, _, path = str(message).partition(" ")
                action = self._actions.get(path)
                status, text = action() if action else (404, "There is nothing here.\n")
                answer = {"number": number, "status": status, "text": text}
                await connection.send(json.dumps(answer))
        except ConnectionClosed:
            pass
        finally:
            self._lines -= 1

    def with_parts(self, answer: Any) -> Any:
        """Adds the pieces of `add_to_page` to an answer, if that is the page."""
        kind = answer.headers.get("Content-Type", "")
        if not self._part or answer.status_code != 200 or not kind.startswith("text/html"):
            return answer
        is_packed = answer.headers.get("Content-Encoding") == "gzip"
        page = gzip.decompress(answer.body) if is_packed else bytes(answer.body)
        before, end, after = page.rpartition(b"</body>")
        answer.body = before + self._part + end + after
        for name, value in (("Content-Encoding", "identity"), ("Content-Length", len(answer.body))):
            del answer.headers[name]
            answer.headers[name] = str(value)
        return answer

    def close(self) -> None:
        """Stops listening."""
        self.socket.close()

    def refusal(self, path: str, headers: Any, is_websocket: bool) -> tuple[int, str] | None:
        """Says why a request must not pass: status and sentence; None if it may.

        `headers` has `get_all(name)`. A header that comes twice is refused.
        """
        host = _only(headers, "Host")
        if host is None or not self._is_own(host):
            return 403, "The address of this page must be one of the machine it is served by.\n"
        if is_websocket:
            if _only(headers, "Origin") != f"http://{host}":
                return 403, "Only a page of this server may connect to it.\n"
            if path != "/" and not (path == ACTIONS and self._actions):
                return 404, "There is nothing here.\n"
        if not self._is_known(_cookies(headers, self.cookie)):
            return 403, UNKNOWN
        count = self._lines if path == ACTIONS else self._count_browsers()
        if is_websocket and count >= MAX_BROWSERS:
            return 503, f"There are {MAX_BROWSERS} connections already; close another page.\n"
        return None

    def admits(self, path: str, headers: Any) -> bool:
        """Whether a request for the first page has the right token in its address."""
        host = _only(headers, "Host")
        if host is None or not self._is_own(host) or path.partition("?")[0] != "/":
            return False
        return self._is_known(web_server.query_of(path).get("token", []))

    def _is_own(self, host: str) -> bool:
        """Whether a Host header names this machine. Names of others can point at any address."""
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        if name in self._names:
            return True
        try:
            address = ipaddress.ip_address(name)
        except ValueError:
            return False
        return address.is_loopback or not self.is_local

    def _is_known(self, tokens: list[str]) -> bool:
        given = tokens[0] if len(tokens) == 1 else ""
        return hmac.compare_digest(given.encode(errors="replace"), self.token.encode())


def page_server(
    authentication: Authentication, label: str, messages: frozenset[str] | None = None
) -> Any:
    """Starts viser's server at an authenticated socket, in threads of its own.

    `messages` are the names of viser's messages that a browser may send; the default is enough to
    look at a page and to use its panels. Returns a viser.ViserServer whose share tunnel is closed
    for good.

    Raises:
        Error: if viser is missing
    """
    extras.require(*PAGE)
    import rich

    rich.reconfigure(quiet=True)  # viser prints an address that does not work, and its end
    return _server_class()(
        authentication, label, OBSERVER_MESSAGES if messages is None else messages
    )


OBSERVER_MESSAGES = frozenset({"ViewerCameraMessage", "GuiUpdateMessage", "GuiButtonHoldMessage"})
"""Messages with which a browser looks at a page and uses its panels."""
CONTROL_MESSAGES = OBSERVER_MESSAGES | {
    "SceneNodeClickMessage",
    "SceneNodeDragMessage",
    "ScenePointerMessage",
    "TransformControlsUpdateMessage",
    "TransformControlsDragStartMessage",
    "TransformControlsDragEndMessage",
}
"""The same and those with which it moves things in the scene."""


def _server_class() -> Callable[[Authentication, str, frozenset[str]], viser.ViserServer]:
    """The class of servers that ask for authentication. It is made here because viser may not be
    installed.
    """
    import viser
    import websockets.asyncio.server
    from viser import _messages, infra
    from websockets.exceptions import ConnectionClosedError

    class Nothing(infra.Message):
        """A message that nobody handles, in place of one that was refused."""

        def redundancy_key(self) -> str:
            return "Nothing"

    class AuthenticatedServer(viser.ViserServer):
        def __init__(
            self, authentication: Authentication, label: str, messages: frozenset[str]
        ) -> None:
            class Messages(infra.Message):
                """Reads the messages of browsers for viser."""

                @classmethod
                def deserialize(cls, message: bytes) -> infra.Message:
                    try:
                        decoded = _messages.Message.deserialize(message)
                    except Exception as error:
                        raise ConnectionClosedError(None, None) from error
                    name = type(decoded).__name__
                    if name not in messages or not _is_sane(decoded):
                        return Nothing()
                    return decoded

            class WebsockServer(infra.WebsockServer):
                def __init__(self, **options: Any) -> None:
                    super().__init__(**(options | {"message_class": Messages, "verbose": False}))

            # viser offers no place for a socket or for checks. Its server has called both of
            # these once its constructor returns.
            serve = websockets.asyncio.server.serve
            with (
                _REPLACING,
                _replaced(
                    websockets.asyncio.server, "serve", _authenticated(authentication, serve)
                ),
                _replaced(infra, "WebsockServer", WebsockServer),
            ):
                super().__init__(
                    host=authentication.host, port=authentication.port, label=label, verbose=False
                )
            authentication._count_browsers = lambda: len(self._websock_server._live_connections)

        def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002
            raise Error("a page is never shared through a tunnel of others")

    return AuthenticatedServer


def _authenticated(authentication: Authentication, listen: Any) -> Any:
    """The function `serve` of websockets, but at the socket of an `Authentication` and with its
    checks.
    """

    def serve(handler: Any, _host: str, _port: int, **options: Any) -> Any:
        own = {
            "max_size": LARGEST_MESSAGE,
            "max_queue": 16,
        }
        check = checked(options.pop("process_request"))
        return web_server.serve(
            route(handler), authentication.socket, check, listen, **(options | own)
        )

    def route(handler: Any) -> Any:
        async def serve_one(connection: Any) -> None:
            is_line = connection.request.path == ACTIONS
            await (authentication.serve_actions if is_line else handler)(connection)

        return serve_one

    def checked(files: Any) -> Any:
        def process(connection: Any, request: Any) -> Any:
            return _answer(authentication, files, connection, request)

        return process

    return serve


_REPLACING = threading.Lock()


@contextlib.contextmanager
def _replaced(owner: Any, name: str, value: Any) -> Iterator[None]:
    before = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, before)


def _answer(authentication: Authentication, files: Any, connection: Any, request: Any) -> Any:
    """Answers a request: with a refusal, a file of viser, or None for a websocket that may open."""
    is_websocket = any(
        "upgrade" in value.lower() for value in request.headers.get_all("Connection")
    )
    is_websocket = is_websocket or bool(request.headers.get_all("Upgrade"))
    if not is_websocket and authentication.admits(request.path, request.headers):
        answer = connection.respond(http.HTTPStatus.SEE_OTHER, "")
        answer.headers["Location"] = "/"
        answer.headers["Set-Cookie"] = (
            f"{authentication.cookie}={authentication.token}; Path=/; HttpOnly; SameSite=Lax; "
            "Max-Age=31536000"
        )
        return _guarded(answer, request)
    refusal = authentication.refusal(request.path, request.headers, is_websocket)
    if refusal is not None:
        return _guarded(connection.respond(http.HTTPStatus(refusal[0]), refusal[1]), request)
    if is_websocket:
        return None
    done = authentication.answer(request.path, request.headers)
    if done is not None:
        return _guarded(connection.respond(http.HTTPStatus(done[0]), done[1]), request)
    if "?" in request.path:  # the client obeys some words there, such as another server's address
        answer = connection.respond(http.HTTPStatus.SEE_OTHER, "")
        answer.headers["Location"] = "/"
        return _guarded(answer, request)
    return _guarded(authentication.with_parts(files(connection, request)), request)


def _guarded(answer: Any, request: Any) -> Any:
    """Adds what tells a browser to load nothing from elsewhere and to show this page nowhere."""
    host = request.headers.get_all("Host")
    own = f" ws://{host[0]}" if len(host) == 1 and _is_plain(host[0], "-_.:[]") else ""
    for name, value in {
        "Content-Security-Policy": "default-src 'none'; script-src 'self' 'unsafe-inline' "
        "'unsafe-eval' 'wasm-unsafe-eval' blob:; worker-src 'self' blob:; style-src 'self' "
        "'unsafe-inline' blob:; img-src 'self' data: blob:; font-src 'self' data: blob:; "
        f"connect-src 'self' data: blob:{own}; frame-ancestors 'none'; base-uri 'none'; "
        "form-action 'none'",
        "X-Frame-Options": "DENY",
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cache-Control": "no-store",
    }.items():
        answer.headers[name] = value
    return answer


def _is_sane(message: Any) -> bool:
    """Whether a message has only finite numbers and short texts, and changes only values.

    A browser that changed anything else of a panel, such as its words, would do so for all.
    """
    updates = getattr(message, "updates", None)
    if updates is not None and (not isinstance(updates, dict) or set(updates) != {"value"}):
        return False
    fields = vars(message).values()
    # viser makes a tuple of a point or of a turn; a list has another count of numbers.
    return all(_is_sane_value(value) and not isinstance(value, list) for value in fields)


def _is_sane_value(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, str):
        return len(value) <= LONGEST_TEXT
    if isinstance(value, dict):
        value = [*value.keys(), *value.values()]
    if isinstance(value, list | tuple):
        return len(value) <= MAX_NUMBERS and all(_is_sane_value(one) for one in value)
    return value is None or isinstance(value, bool | int)


def _listen(host: str, port: int | None) -> socket.socket:
    ports = range(FIRST_PORT, FIRST_PORT + PORTS) if port is None else [port]
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except OSError as error:
        raise Error(f"'{host}' is no address of this machine: {error.strerror}") from error
    family, _, _, _, address = found[0]
    for each in ports:
        listener = socket.socket(family, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        # Connections inherit this: it bounds how old the frames of a slow browser can be.
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        try:
            listener.bind((address[0], each, *address[2:]))
            listener.listen(MAX_BROWSERS)
        except (OSError, OverflowError) as error:
            listener.close()
            if each == ports[-1]:
                raise Error(
                    f"nothing can listen at {host}, port {each}: {error}; choose another with "
                    "--host and --port"
                ) from error
        else:
            return listener
    raise AssertionError("there is at least one port")


def _only(headers: Any, name: str) -> str | None:
    """The value of a header that comes once."""
    values = headers.get_all(name)
    return str(values[0]) if len(values) == 1 else None


def _cookies(headers: Any, name: str) -> list[str]:
    values = []
    for header in headers.get_all("Cookie"):
        for part in str(header).split(";"):
            key, _, value = part.strip().partition("=")
            if key == name:
                values.append(value)
    return values


def _is_plain(text: str, others: str = "-_") -> bool:
    return text.isascii() and all(one.isalnum() or one in others for one in text)
