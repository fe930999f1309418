# SPDX-License-Identifier: BSD-3-Clause
"""The page of many robots: a card for each, with its state, a picture and its last fault.

It reads what `trifinger view` tells of each robot, on whatever machine that is, or observes the
robots of this machine. It asks nothing of a robot, and sends nothing to its page.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import json
import socket
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

from trifinger.commands.command_line import names_of_robots
from trifinger.errors import Error, InvalidArgument

from trifinger_view.authentication import FIRST_PORT, FOREIGN, GLANCE, NOTHING, UNKNOWN, is_plain
from trifinger_view.glance import Glance
from trifinger_view.live import LiveRun
from trifinger_view.page import Page
from trifinger_view.page_server import PageServer, finite, refuse
from trifinger_view.to_browser import Document, Numbers, document, message
from trifinger_view.web_server import quiet_logger
from trifinger_view.words import facts_of

if TYPE_CHECKING:
    from websockets.typing import Origin

SILENCE = 10.0  # after which a connection is given up [s]
FIRST_PAUSE, LONGEST_PAUSE = 1.0, 30.0  # before a robot that was not reached is tried again [s]
LARGEST_MESSAGE = 64 * 1024 * 1024  # of a robot, whose meshes are in one [bytes]
STRANGER = "what answers there is no 'trifinger view' of this version"
MEANINGS = {
    UNKNOWN: "it does not know this token: without --token, each start of 'trifinger view' chooses "
    "another one",
    FOREIGN: "its machine has another name: give the address that 'trifinger view' has printed",
    NOTHING: "its page shows no running robot",
}


@dataclass(frozen=True)
class Address:
    """Where the page of a robot is."""

    host: str
    """Name or number of the machine, and the port."""
    token: str

    @classmethod
    def of(cls, text: str) -> Address:
        """Reads an address as `trifinger view` prints it; raises InvalidArgument."""
        shown = text.partition("?")[0]  # without the token
        try:
            parts = urlsplit(text if "://" in text else f"http://{text}")
            name, port = parts.hostname or "", parts.port or FIRST_PORT
        except ValueError as error:
            raise InvalidArgument(f"'{shown}' is no address of a page: {error}") from error
        token = parse_qs(parts.query).get("token", [""])[0]
        if parts.scheme != "http" or not is_plain(name, "-_.:") or not name or "@" in parts.netloc:
            raise InvalidArgument(f"'{shown}' is no address of a page, such as http://HOST:PORT/")
        if not token or not is_plain(token):
            raise InvalidArgument(
                f"the address '{shown}' needs the token that 'trifinger view' has printed: "
                "http://HOST:PORT/?token=TOKEN"
            )
        return cls(f"[{name}]:{port}" if ":" in name else f"{name}:{port}", token)


def addresses_of(words: Sequence[str]) -> list[Address]:
    """The addresses on a command line. @FILE stands for those in the lines of a file.

    Raises InvalidArgument if one is wrong or comes twice, and OSError if a file cannot be read.
    """
    texts: list[str] = []
    for word in words:
        lines = [word]
        if word.startswith("@"):
            lines = Path(word[1:]).read_text(encoding="utf-8", errors="replace").splitlines()
            lines = [line.strip() for line in lines]
            lines = [line for line in lines if line and not line.startswith("#")]
            if not lines:
                raise InvalidArgument(f"there is no address in {word[1:]}")
        texts += lines
    found: dict[str, Address] = {}
    for address in map(Address.of, texts):
        if address.host in found:
            raise InvalidArgument(f"the address of {address.host} is there twice")
        found[address.host] = address
    return list(found.values())


def fleet_document(title: str, *, is_plain: bool) -> Document:
    """What the server of the page serves."""
    scripts = ("scene.js", "page.js", "fleet.js")
    return document(scripts, page_name="fleet", TITLE=title, PARTS="plain" if is_plain else "")


class Card:
    """What browsers are told of one robot."""

    def __init__(self, server: PageServer, number: int, host: str, models: set[str]) -> None:
        """`models` are those that browsers have already got, of all cards."""
        self._server, self._number, self._host, self._models = server, number, host, models
        self._reason: str | None = None

    def tell(self, reason: str, *, link: str = "") -> None:
        """Tells why there is no connection; an empty reason if there is one."""
        if reason != self._reason:
            self._reason = reason
            since = time.strftime("%a %H:%M:%S")
            self._put("host", {"host": self._host, "link": link, "reason": reason, "since": since})

    def take(self, data: Any) -> None:
        """Passes on a message about the robot; raises ValueError if it makes no sense."""
        try:
            size = int.from_bytes(data[:4], "little")
            told = json.loads(data[4 : 4 + size], parse_constant=refuse, parse_float=finite)
            content, kind = data[4 + size :], told["kind"]
            if kind == "session":  # robots often have the same meshes
                told["model"] = model = hashlib.sha256(content).hexdigest()
                if model not in self._models:
                    self._models.add(model)
                    self._server.put(f"model {model}", _message("model", content, {"model": model}))
                content = b""
            elif kind == "images":  # one is enough for a card
                told["images"] = told["images"][:1]
                content = content[: max((sum(place) for _, place in told["images"]), default=0)]
            if kind in ("session", "glance", "frame", "images"):
                self._put(kind, told, content)
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            raise ValueError(STRANGER) from error

    def _put(self, kind: str, told: dict[str, Any], content: bytes = b"") -> None:
        told = {**told, "robot": self._number}
        self._server.put(f"{kind} {self._number}", _message(kind, content, told))


def _message(kind: str, content: bytes, told: dict[str, Any]) -> bytes:
    numbers = Numbers()
    numbers.add_file(content)
    return message(numbers=numbers, **{**told, "kind": kind})


class Fleet:
    """Watches the pages of robots, in a thread of its own, until `close`."""

    def __init__(self, server: PageServer, addresses: Sequence[Address]) -> None:
        models: set[str] = set()
        self._cards = [
            (Card(server, number, address.host, models), address)
            for number, address in enumerate(addresses)
        ]
        self._loop = asyncio.new_event_loop()
        self._is_over = asyncio.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Ends the connections."""
        self._loop.call_soon_threadsafe(self._is_over.set)
        self._thread.join()

    def _run(self) -> None:
        async def work() -> None:
            tasks = [asyncio.ensure_future(_watch(*each)) for each in self._cards]
            await self._is_over.wait()
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

        with contextlib.closing(self._loop):
            self._loop.run_until_complete(work())


async def _watch(card: Card, address: Address) -> None:
    """Passes on what the page of a robot tells, whenever it can be reached."""
    from websockets.asyncio.client import connect
    from websockets.exceptions import WebSocketException

    url, pause = f"http://{address.host}", FIRST_PAUSE
    origin: Origin = url  # type: ignore[assignment]  # a text
    card.tell("no answer yet", link=f"{url}/")
    while True:
        try:
            async with connect(
                f"ws://{address.host}{GLANCE}",
                origin=origin,
                additional_headers={"Authorization": f"Bearer {address.token}"},
                compression=None,
                proxy=None,
                open_timeout=SILENCE,
                ping_interval=None,
                close_timeout=1.0,
                max_size=LARGEST_MESSAGE,
                logger=quiet_logger(),
            ) as connection:
                while True:
                    async with asyncio.timeout(SILENCE):
                        data = await connection.recv()
                    card.take(data)
                    card.tell("", link=f"{url}/")
                    pause = FIRST_PAUSE
        except (OSError, ValueError, WebSocketException) as error:
            card.tell(reason_of(error), link=f"{url}/")
        await asyncio.sleep(pause)
        pause = min(2 * pause, LONGEST_PAUSE)


def reason_of(error: Exception) -> str:
    """Why a robot cannot be seen, in words."""
    from websockets.exceptions import ConnectionClosed, InvalidStatus

    if isinstance(error, InvalidStatus):
        text = bytes(error.response.body or b"").decode(errors="replace")
        is_full = error.response.status_code == 503
        return MEANINGS.get(text, text.strip()[:200] if is_full else STRANGER)
    if isinstance(error, ConnectionClosed):
        return "its page has ended"
    if isinstance(error, TimeoutError):
        return f"nothing was heard of it for {SILENCE:g} s"
    if isinstance(error, socket.gaierror):
        return "there is no machine of this name"
    if "Connect call failed" in str(error):
        return "nothing listens at this port: 'trifinger view' on its machine does"
    return (error.strerror or str(error)) if isinstance(error, OSError) else STRANGER


class LocalRobots:
    """The robots of this machine, each from the moment on when it was seen to run."""

    def __init__(self, server: PageServer) -> None:
        self._server = server
        self._models: set[str] = set()
        self._robots: dict[str, Callable[[], None]] = {}
        server.put("none", message("none", text="no robot runs; this page shows each that does"))

    def renew(self) -> None:
        """Looks at all of them."""
        with contextlib.suppress(Error):
            for name in names_of_robots():
                if name not in self._robots:
                    self._robots[name] = self._follow(name)
        for renew in self._robots.values():
            renew()

    def _follow(self, name: str) -> Callable[[], None]:
        card = Card(self._server, len(self._robots), "this machine", self._models)
        live, glance = LiveRun(name), Glance()
        page = Page(self._server, lambda _, data: card.take(data))
        session: int | None = None
        card.tell("")

        def renew() -> None:
            nonlocal session
            live.look()
            if live.session_id != session and live.info is not None:
                session = live.session_id
                page.begin(live.scene, name, facts_of(live.info))
            if live.frame is not None:
                page.show(live.frame)
                page.show_images(dict([*live.frame.images.items()][:1]))
            card.take(glance.message(live, live.lines))

        return renew
