# SPDX-License-Identifier: BSD-3-Clause
"""Who may use a page.

`Authentication` owns the only socket of a page. Each request passes its checks:

- the name in the address must be one of this machine, so no other site can point its name here;
- a websocket must come from a page of this server, so no other site can use a browser here;
- every request needs the token, so no other user of this machine or of the network gets in.
"""

from __future__ import annotations

import hmac
import ipaddress
import json
import secrets
import socket
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

from trifinger.errors import Error, InvalidArgument

from trifinger_view import web_server

LOOPBACK = "127.0.0.1"
FIRST_PORT = 8080
PORTS = 20  # ports that are tried if none was chosen
MAX_BROWSERS = 16  # connections at the same time
SEND_BUFFER = 256 * 1024  # of a connection, in the kernel [bytes]
SHORTEST_TOKEN = 16  # [characters]
ACTION_HEADER = "X-TriFinger"
ACTIONS = "/actions"  # the websocket over which a page asks for actions
GLANCE = "/glance"  # the websocket over which a page of many robots looks at this one
Reply = tuple[int, str, dict[str, str]]
"""Status, text and headers of an answer; an empty text with the status 200 stands for the page."""
UNKNOWN = "This page needs the whole address that `trifinger view` has printed, with its token.\n"
FOREIGN = "The address of this page must be one of the machine it is served by.\n"
NOTHING = "There is nothing here.\n"


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
        if token and (len(token) < SHORTEST_TOKEN or not is_plain(token)):
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
        self.count_browsers: Callable[[], int] = lambda: 0
        """How many browsers are connected."""
        self._actions: dict[str, Callable[[], tuple[int, str]]] = {}
        self.sockets = {"/"}
        """Paths at which websockets may open."""
        self._lines = 0  # websockets that are open at ACTIONS

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
        self.sockets.add(ACTIONS)

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
                status, text = action() if action else (404, NOTHING)
                answer = {"number": number, "status": status, "text": text}
                await connection.send(json.dumps(answer))
        except ConnectionClosed:
            pass
        finally:
            self._lines -= 1

    def reply(self, path: str, headers: Any) -> Reply | None:
        """Answers a request; None for a websocket that may open."""
        is_websocket = bool(headers.get_all("Upgrade")) or any(
            "upgrade" in value.lower() for value in headers.get_all("Connection")
        )
        if not is_websocket and self.admits(path, headers):
            cookie = f"{self.cookie}={self.token}; Path=/; HttpOnly; SameSite=Lax; Max-Age=31536000"
            return 303, "", {"Location": "/", "Set-Cookie": cookie}
        refusal = self.refusal(path, headers, is_websocket)
        if refusal is not None:
            return *refusal, {}
        if is_websocket:
            return None
        done = self.answer(path, headers)
        if done is not None:
            return *done, {}
        if "?" in path:  # a token that stays in the address could be seen
            return 303, "", {"Location": "/"}
        return (200, "", {}) if path == "/" else (404, NOTHING, {})

    def close(self) -> None:
        """Stops listening."""
        self.socket.close()

    def refusal(self, path: str, headers: Any, is_websocket: bool) -> tuple[int, str] | None:
        """Says why a request must not pass: status and sentence; None if it may.

        `headers` has `get_all(name)`. A header that comes twice is refused.
        """
        host = _only(headers, "Host")
        if host is None or not self._is_own(host):
            return 403, FOREIGN
        if is_websocket:
            if _only(headers, "Origin") != f"http://{host}":
                return 403, "Only a page of this server may connect to it.\n"
            if path not in self.sockets:
                return 404, NOTHING
        tokens = _cookies(headers, self.cookie)
        if path == GLANCE:  # a program has no cookies, and may come through a tunnel
            tokens = [str(_only(headers, "Authorization")).removeprefix("Bearer ")]
        if not self._is_known(tokens):
            return 403, UNKNOWN
        count = self._lines if path == ACTIONS else self.count_browsers()
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


def is_plain(text: str, others: str = "-_") -> bool:
    """Whether a text has only letters, digits and these other signs."""
    return text.isascii() and all(one.isalnum() or one in others for one in text)
