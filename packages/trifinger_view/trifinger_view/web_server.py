# SPDX-License-Identifier: BSD-3-Clause
"""Serves websockets and pages so that other clients cannot use up what their users need.

Whoever reaches the address of a server can open connections, and need not say a word. Here all of
them together take few files. One that came later takes the place of the oldest that has not yet
shown that it may be here. So other clients keep nobody out: a request that has arrived is read
before its connection can be the oldest.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import sys
from collections.abc import AsyncIterator, Callable
from http import HTTPStatus
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

from trifinger.errors import InvalidArgument

if TYPE_CHECKING:
    from websockets.asyncio.server import Server, ServerConnection
    from websockets.http11 import Request, Response

MAX_UNAUTHENTICATED = 64
"""Connections whose requests were not yet accepted."""
BATCH = 8
"""Connections that are taken at once. It takes a few batches to read a request."""
QUEUE = 1024
"""Connections that the kernel keeps until they are taken."""
CLOSE_TIMEOUT = 1.0  # [s]; after it connections are cut
HANDSHAKE_TIMEOUT = 10.0
"""Time that a connection has for its request [s]."""
MAX_FIELDS = 8
"""Fields in the query of an address."""

Check = Callable[["ServerConnection", "Request"], "Response | None"]
"""Answers a request; None if its websocket may open. It may raise InvalidArgument."""


@contextlib.asynccontextmanager
async def serve(
    handler: Callable[[ServerConnection], Any],
    listener: socket.socket,
    check: Check,
    **options: Any,
) -> AsyncIterator[Server]:
    """Runs a server of the package websockets at `listener` as long as the context lasts.

    Who gets a websocket, or an answer with a status below 400, counts as authenticated, also where
    a server asks for no token. `options` are those of websockets. What other clients send, however
    malformed, is answered and never printed.
    """
    import websockets.asyncio.server

    unauthenticated: dict[ServerConnection, None] = {}  # the oldest one first

    class Connection(websockets.asyncio.server.ServerConnection):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            super().connection_made(transport)
            if len(unauthenticated) >= MAX_UNAUTHENTICATED:
                oldest = next(iter(unauthenticated))
                del unauthenticated[oldest]
                oldest.transport.abort()
            unauthenticated[self] = None

        def connection_lost(self, exc: Exception | None) -> None:
            unauthenticated.pop(self, None)
            super().connection_lost(exc)

    def process_request(connection: ServerConnection, request: Request) -> Response | None:
        try:
            return check(connection, request)
        except InvalidArgument as error:
            return connection.respond(HTTPStatus.BAD_REQUEST, f"{error}\n")

    def process_response(
        connection: ServerConnection,
        request: Request,  # noqa: ARG001 (websockets calls it so)
        response: Response,
    ) -> None:
        if response.status_code < HTTPStatus.BAD_REQUEST:
            unauthenticated.pop(connection, None)

    asyncio.get_running_loop().set_exception_handler(_Unhandled(listener))
    async with websockets.asyncio.server.serve(
        handler,
        sock=listener,
        backlog=BATCH,
        create_connection=Connection,
        process_request=process_request,
        process_response=process_response,
        open_timeout=HANDSHAKE_TIMEOUT,
        server_header=None,
        logger=quiet_logger(),
        **options,
    ) as server:
        # asyncio has only one number for the batch and for the queue.
        listener.listen(QUEUE)
        try:
            yield server
        finally:  # websockets would wait for those that neither say nor read anything
            asyncio.get_running_loop().call_later(CLOSE_TIMEOUT, _cut, server)


def _cut(server: Server) -> None:
    for connection in [*server.handlers]:
        connection.transport.abort()


def query_of(path: str) -> dict[str, list[str]]:
    """The fields in the query of a request's address; raises InvalidArgument."""
    try:
        return parse_qs(urlsplit(path).query, max_num_fields=MAX_FIELDS)
    except ValueError:
        raise InvalidArgument(
            f"the address of a request must be valid, with at most {MAX_FIELDS} fields"
        ) from None


class _Unhandled:
    """Says once that no connection can be taken, which asyncio says with a traceback each time."""

    def __init__(self, listener: socket.socket) -> None:
        self._listener = listener
        self._is_said = False

    def __call__(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        message = context["message"]
        if message == "socket.accept() out of system resource":
            if not self._is_said:
                self._is_said = True
                reason = context["exception"].strerror
                sys.stderr.write(f"trifinger: a connection could not be taken: {reason}\n")
        # asyncio then tries again a second later, even if the server has ended.
        elif self._listener.fileno() >= 0 or "_start_serving" not in message:
            loop.default_exception_handler(context)


def quiet_logger() -> logging.Logger:
    """A logger for what others at a connection do, which is nothing for a terminal."""
    logger = logging.getLogger("trifinger_view.web_server")
    logger.propagate = False
    logger.setLevel(logging.CRITICAL + 1)
    return logger
