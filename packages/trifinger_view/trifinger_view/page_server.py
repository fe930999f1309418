# SPDX-License-Identifier: BSD-3-Clause
"""The server of a page: each browser gets the newest of what it is told, and is heard.

The only socket is that of `Authentication`, and each request passes its checks. A browser that is
slow loses frames alone: of each kind of message the newest one is kept, and a browser gets the next
one when its connection has taken the one before. What browsers ask for is done in order by a thread
of its own, so that nothing holds up the thread of the connections, which also serves the stop.
"""

from __future__ import annotations

import asyncio
import contextlib
import http
import itertools
import json
import math
import queue
import sys
import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from trifinger import extras
from trifinger.commands.command_line import say

from trifinger_view import PAGE, web_server
from trifinger_view.authentication import ACTIONS, GLANCE, Authentication, is_plain
from trifinger_view.to_browser import Document

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

ASK_PERIOD = 0.25  # between two questions for a sign of life [s]
KINDS = ("session", "line", "state", "control", "seat", "frame", "targets", "images", "curves")
"""Kinds of messages, in the order in which a browser gets them."""
GLANCE_KINDS = ("session", "glance", "frame", "images")
"""What a page of many robots gets of one, each newest one once in a GLANCE_PERIOD."""
GLANCE_PERIOD = 1.0  # [s]
SILENCE = 20.0  # after which a connection is given up [s]
ON_THE_WAY = 32 * 1024  # sent before the browser must have answered [bytes]
LARGEST_MESSAGE = 4096  # of a browser [bytes]
MAX_WAITING = 1000  # messages of browsers; more are not done
NONSENSE = 1003  # the code with which websockets end after data that cannot be accepted


class PageServer:
    """Serves a page in threads of its own until `stop`. Any thread may call any function."""

    def __init__(self, authentication: Authentication, document: Document) -> None:
        """Starts to serve a document.

        Raises:
            Error: if what a page needs is missing
        """
        extras.require(*PAGE)
        self.on_message: Callable[[int, dict[str, Any]], None] = lambda *_: None
        """Does what a browser asks for; in the thread of all that."""
        self.on_gone: Callable[[int], None] = lambda _: None
        """Told after the last message of a browser; in the same thread."""
        self.on_heard: Callable[[int], None] = lambda _: None
        """Told of signs of life of each browser, four times a second. It must not wait."""
        self.kinds: Sequence[str] = KINDS
        """Kinds of messages, in the order in which a browser gets them; if empty, the oldest one
        is the first."""
        self._authentication, self._document = authentication, document
        self._newest: dict[int | None, dict[str, tuple[int, bytes]]] = {None: {}}
        self._changed: dict[int, asyncio.Event] = {}
        self._glances: set[int] = set()
        self._lock = threading.Lock()  # of all three
        self._counts = itertools.count()
        self._work: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        authentication.count_browsers = lambda: len(self._changed)
        self._loop = asyncio.new_event_loop()
        self._is_over = asyncio.Event()
        self._threads = [threading.Thread(target=one) for one in (self._run, self._do_work)]
        for thread in self._threads:
            thread.daemon = True
            thread.start()

    @property
    def browsers(self) -> list[int]:
        """The browsers that are connected, by numbers that no other one ever has."""
        return [one for one in list(self._changed) if one not in self._glances]

    @property
    def is_glanced_at(self) -> bool:
        """Whether a page of many robots looks at this one."""
        return bool(self._glances)

    def put(self, message_kind: str, message: bytes, browser: int | None = None) -> None:
        """Sends a message to a browser, or to all and to those that come later.

        It replaces the one of this kind before.
        """
        with self._lock:
            if browser not in self._newest:
                return  # it has gone
            self._newest[browser][message_kind] = (next(self._counts), message)
        with contextlib.suppress(RuntimeError):  # the server has ended
            self._loop.call_soon_threadsafe(self._wake, browser)

    def stop(self) -> None:
        """Ends the connections and the threads, but not what a browser has asked for and hangs."""
        self._loop.call_soon_threadsafe(self._is_over.set)
        self._work.put(None)
        self._threads[0].join()

    def _wake(self, browser: int | None) -> None:
        for one, changed in self._changed.items():
            if browser in (None, one):
                changed.set()

    def _run(self) -> None:
        async def serve() -> None:
            async with web_server.serve(
                self._serve_one,
                self._authentication.socket,
                self._answer,
                max_size=LARGEST_MESSAGE,
                compression=None,
            ):
                await self._is_over.wait()

        with contextlib.closing(self._loop):
            self._loop.run_until_complete(serve())

    def _do_work(self) -> None:
        while (act := self._work.get()) is not None:
            try:
                act()
            except Exception as error:  # whatever was asked for, what comes next is done
                say(f"trifinger view: what a browser asked for failed: {error}", file=sys.stderr)

    async def _serve_one(self, connection: ServerConnection) -> None:
        request = connection.request
        if request is not None and request.path == ACTIONS:
            await self._authentication.serve_actions(connection)
            return
        browser = next(self._counts)
        with self._lock:
            self._newest[browser] = {}
            self._changed[browser] = asyncio.Event()
            if request is not None and request.path == GLANCE:
                self._glances.add(browser)
        tasks = [
            asyncio.ensure_future(one)
            for one in (
                self._send(connection, browser),
                self._listen(connection, browser),
                self._ask(connection, browser),
            )
        ]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)  # however a connection ends
            with self._lock:
                del self._newest[browser], self._changed[browser]
                self._glances.discard(browser)
            self._work.put(lambda: self.on_gone(browser))

    async def _send(self, connection: ServerConnection, browser: int) -> None:
        sent: dict[str, int] = {}
        unanswered = 0
        is_glance = browser in self._glances
        while True:
            self._changed[browser].clear()
            kinds = GLANCE_KINDS if is_glance else self.kinds
            while (found := self._next(browser, sent, kinds)) is not None:
                await connection.send(found)
                unanswered += len(found)
                if unanswered > ON_THE_WAY:  # a tunnel takes much more than the browser has got
                    await (await connection.ping())
                    unanswered = 0
            await asyncio.sleep(GLANCE_PERIOD * is_glance)
            await self._changed[browser].wait()

    def _next(self, browser: int, sent: dict[str, int], kinds: Sequence[str]) -> bytes | None:
        """The first message that a browser has not yet got; it is noted as sent."""
        with self._lock:
            known = self._newest[None] | self._newest[browser]
        for kind in kinds or sorted(known, key=lambda one: known[one][0]):
            number, message = known.get(kind, (-1, b""))
            if number > sent.get(kind, -1):
                sent[kind] = number
                return message
        return None

    async def _listen(self, connection: ServerConnection, browser: int) -> None:
        async for data in connection:
            try:
                if browser in self._glances:
                    raise ValueError("a glance asks for nothing")
                message = json.loads(data, parse_constant=refuse, parse_float=finite)
                if not isinstance(message, dict) or not isinstance(message.get("do"), str):
                    raise ValueError("no message of a page")
            except (ValueError, RecursionError):
                await connection.close(NONSENSE)
                return
            if self._work.qsize() < MAX_WAITING:
                self._work.put(lambda message=message: self.on_message(browser, message))  # type: ignore[misc]

    async def _ask(self, connection: ServerConnection, browser: int) -> None:
        while True:
            try:
                async with asyncio.timeout(SILENCE):  # a ping may find no room, either
                    await (await connection.ping())
            except TimeoutError:
                connection.transport.abort()
                return
            self.on_heard(browser)
            await asyncio.sleep(ASK_PERIOD)

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answers a request: with a refusal, the page, or None for a websocket that may open."""
        reply = self._authentication.reply(request.path, request.headers)
        if reply is None:
            return None
        status, text, headers = reply
        if status == http.HTTPStatus.OK and not text:
            text, headers = self._document.text, {"Content-Type": "text/html; charset=utf-8"}
        response = connection.respond(http.HTTPStatus(status), text)
        host = request.headers.get_all("Host")
        own = f" ws://{host[0]}" if len(host) == 1 and is_plain(host[0], "-_.:[]") else ""
        for name, value in {
            **headers,
            "Content-Security-Policy": f"{self._document.policy}; connect-src 'self'{own}; "
            "frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
            "X-Frame-Options": "DENY",
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Cache-Control": "no-store",
        }.items():
            response.headers.pop(name, None)
            response.headers[name] = value
        return response


def finite(text: str) -> float:
    """Reads a number of a message; raises ValueError if it is infinite."""
    number = float(text)
    return number if math.isfinite(number) else refuse(text)


def refuse(name: str) -> NoReturn:
    """Raises ValueError for "NaN" or "Infinity" in a message."""
    raise ValueError(f"{name} is no number")
