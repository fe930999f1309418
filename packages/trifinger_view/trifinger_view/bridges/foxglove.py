# SPDX-License-Identifier: BSD-3-Clause
"""Serves a running robot to Foxglove and to everything that speaks its protocol.

The messages are those of a log (docs/log_format.md), byte for byte. docs/bridges.md says how to
look at them and who may.
"""

from __future__ import annotations

import asyncio
import hmac
import json
import math
import re
import socket
import struct
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import TYPE_CHECKING

from trifinger import extras
from trifinger._trifinger import LiveChannel, LiveMessage, LiveMessages
from trifinger.errors import Error, InvalidArgument

from trifinger_view import web_server

if TYPE_CHECKING:
    from websockets.asyncio.server import Server, ServerConnection
    from websockets.http11 import Request, Response

PROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
"""Names of the protocol, the newest first. What is used here is the same in both."""
ORIGINS = ("https://app.foxglove.dev", "file://")
"""Web sites that may connect from a browser: Foxglove's page and its desktop program."""
LOOPBACK = ("127.0.0.1", "localhost", "::1")

MAX_CLIENTS = 16
MAX_WAITING = 8 << 20
"""Messages that wait for one client may have this size together [bytes]."""
MAX_ANSWERS = 2000
"""Answers that wait for a client before it is sent away."""
MAX_INCOMING = 1 << 18
"""Size of a message of a client [bytes]."""
POLL_PERIOD = 0.02
"""Time between two looks at the robot [s]."""
REPORT_PERIOD = 1.0
"""Time between two sentences about lost messages, or about clients that were refused [s]."""

Report = Callable[[str], None]
"""Takes a sentence for people."""


@dataclass(frozen=True)
class FoxgloveOptions:
    """How a robot is served to Foxglove."""

    host: str = "127.0.0.1"
    """Address to listen at. Others than this machine's own need a token."""
    port: int = 8765
    """0: any free port."""
    token: str = ""
    """Clients must connect to ws://HOST:PORT/?token=TOKEN. Empty: no token."""
    origins: Sequence[str] = ()
    """Web sites that may connect besides Foxglove's, for example http://localhost:8080."""
    rate: float = 100.0
    """Steps, and elements of each companion, per second of the robot's time; 0: all."""
    viewer_rate: float = 30.0
    """Poses of links per second of the robot's time; 0: none."""
    jpeg_quality: int = 80
    """Quality of images, 1 to 100."""
    max_waiting: int = MAX_WAITING
    """Messages that wait for one client may have this size together [bytes]."""


class FoxgloveServer:
    """Serves one robot, and the robots that follow under its name, to any number of clients.

    The server only observes: the robot notices nothing, whatever clients do. A client that is too
    slow loses the oldest messages. It is told how many, and others are not affected.
    """

    def __init__(
        self, robot: str, options: FoxgloveOptions | None = None, report: Report = print
    ) -> None:
        """Prepares to serve `robot`, which need not run yet.

        Raises InvalidArgument for a wrong option, Error if a package is missing. `report` gets
        sentences about robot and clients.
        """
        extras.require("trifinger-view", "websockets")
        self.options = options or FoxgloveOptions()
        if self.options.host not in LOOPBACK and not self.options.token:
            raise InvalidArgument(
                f"everybody who reaches {self.options.host} could connect: give a token"
            )
        self.robot = robot
        self.lost = 0
        """Messages that were lost between robot and server."""
        self._report = report
        self._live = LiveMessages(
            robot,
            rate=self.options.rate,
            viewer_rate=self.options.viewer_rate,
            jpeg_quality=self.options.jpeg_quality,
        )
        self._channels: dict[int, LiveChannel] = {}  # those that are advertised
        self._known = 0
        self._newest: dict[int, dict[int, tuple[int, bytes]]] = {}  # by channel and part
        self._clients: set[Client] = set()
        self._refused = 0  # clients that were not told of
        self._refused_at = -math.inf
        self._session_id = str(time.time_ns())
        self._server: Server | None = None

    @property
    def url(self) -> str:
        """Where clients connect, with the token. Only while the server runs."""
        if self._server is None:
            raise Error("the server does not run")
        host = self.options.host
        port = next(iter(self._server.sockets)).getsockname()[1]
        query = f"/?token={self.options.token}" if self.options.token else ""
        return f"ws://{f'[{host}]' if ':' in host else host}:{port}{query}"

    @property
    def clients(self) -> Sequence[Client]:
        """The clients that are connected."""
        return tuple(self._clients)

    async def serve(self, ready: Callable[[], None] = lambda: None) -> None:
        """Serves until the task is cancelled. Calls `ready` when clients can connect.

        Raises Error if the address cannot be used.
        """
        from websockets.typing import Subprotocol

        async with web_server.serve(
            self._serve_client,
            listen(self.options.host, self.options.port),
            self._check,
            subprotocols=[Subprotocol(name) for name in PROTOCOLS],
            compression=None,
            close_timeout=1,
            max_size=MAX_INCOMING,
            max_queue=16,
        ) as self._server:
            ready()
            while True:
                self._pump()
                await asyncio.sleep(POLL_PERIOD)

    # --- who may connect ---

    def _check(self, connection: ServerConnection, request: Request) -> Response | None:
        """Refuses clients that may not connect, with a sentence."""
        reason = self._reason_against(request)
        if reason is None:
            return None
        status, sentence = reason
        self._report_refusal(sentence)
        return connection.respond(status, f"{sentence}\n")

    def _report_refusal(self, sentence: str) -> None:
        """Tells of a client that was refused, or counts it if another was told of just now."""
        now = time.monotonic()
        if now < self._refused_at + REPORT_PERIOD:
            self._refused += 1
            return
        more = f"; so were {self._refused} others before it" if self._refused else ""
        self._refused, self._refused_at = 0, now
        self._report(f"a client was refused: {sentence}{more}")

    def _reason_against(self, request: Request) -> tuple[HTTPStatus, str] | None:
        origins = request.headers.get_all("Origin")
        if any(one not in (*ORIGINS, *self.options.origins) for one in origins):
            return HTTPStatus.FORBIDDEN, (
                f"the web site {shown(origins[0])} may not connect; "
                "the option --origin allows a site"
            )
        if self.options.host in LOOPBACK:
            # A page of somebody else can make a name of its own mean this machine.
            host = host_of(request.headers.get("Host", ""))
            if host not in LOOPBACK:
                return HTTPStatus.FORBIDDEN, (
                    f"{shown(host)} is not a name of this machine; use localhost"
                )
        if self.options.token:
            given = web_server.query_of(request.path).get("token", [""])[0]
            if not hmac.compare_digest(given.encode(errors="replace"), self.options.token.encode()):
                return HTTPStatus.FORBIDDEN, "the token is missing or wrong; use ?token=TOKEN"
        if len(self._clients) >= MAX_CLIENTS:
            return HTTPStatus.SERVICE_UNAVAILABLE, f"there are {MAX_CLIENTS} clients already"
        return None

    # --- clients ---

    async def _serve_client(self, connection: ServerConnection) -> None:
        from websockets.exceptions import ConnectionClosed

        client = Client(connection, self.options.max_waiting, self._answer)
        client.answer(
            {
                "op": "serverInfo",
                "name": f"TriFinger: {self.robot}",
                "capabilities": [],
                "metadata": {"robot": self.robot},
                "sessionId": self._session_id,
            }
        )
        client.answer(advertisement(self._channels))
        self._clients.add(client)
        try:
            await client.serve()
        except ConnectionClosed:
            pass
        finally:
            self._clients.discard(client)
            self._want_images()
            self._report_losses(client)

    def _answer(self, client: Client, message: Mapping[str, object]) -> None:
        """Does what a client asks for; raises InvalidArgument with a sentence for the client."""
        op = message.get("op")
        if op == "subscribe":
            for one in entries(message, "subscriptions"):
                if not isinstance(one, dict):
                    raise InvalidArgument("a subscription is an object with id and channelId")
                number, channel = integer(one, "id"), integer(one, "channelId")
                if channel not in self._channels:
                    raise InvalidArgument(f"there is no channel {channel}")
                client.subscribe(number, channel)
                for log_time, data in self._newest.get(channel, {}).values():
                    client.send(channel, log_time, data)
        elif op == "unsubscribe":
            for each in entries(message, "subscriptionIds"):
                client.unsubscribe(each)
        else:
            raise InvalidArgument(f"this server has no operation {shown(str(op))}")
        self._want_images()

    def _want_images(self) -> None:
        images = {number for number, one in self._channels.items() if one.is_image}
        self._live.want_images(any(client.wants(images) for client in self._clients))

    # --- messages ---

    def _pump(self) -> None:
        """Takes what is new and hands it to the clients."""
        batch = self._live.take()
        self.lost += batch.lost
        self._declare()
        for message in batch.messages:
            self._send(message)
        for event in batch.events:
            self._report(f"{event.source}: {event.text}")
        for client in self._clients:
            self._report_losses(client, REPORT_PERIOD)

    def _declare(self) -> None:
        channels = self._live.channels
        new = dict(enumerate(channels[self._known :], start=self._known))
        if not new:
            return
        self._known = len(channels)
        topics = {one.topic for one in new.values()}
        old = [number for number, one in self._channels.items() if one.topic in topics]
        for number in old:
            del self._channels[number]
            self._newest.pop(number, None)
        self._channels |= new
        for client in self._clients:
            if old:
                client.answer({"op": "unadvertise", "channelIds": old})
                client.forget(old)
            client.answer(advertisement(new))

    def _send(self, message: LiveMessage) -> None:
        data = message.data
        self._newest.setdefault(message.channel, {})[message.part] = (message.log_time, data)
        for client in self._clients:
            client.send(message.channel, message.log_time, data)

    def _report_losses(self, client: Client, period: float = 0.0) -> None:
        lost = client.take_losses(period)
        if lost:
            self._report(f"{client.name} is too slow: {lost} messages to it were lost")


@dataclass(eq=False)
class Client:
    """One client of a server, with what waits to be sent to it."""

    connection: ServerConnection
    max_waiting: int
    answer_to: Callable[[Client, Mapping[str, object]], None]
    """Does what the client asks for."""
    lost: int = 0
    """Messages that were lost because the client was too slow."""

    answers: deque[str] = field(default_factory=deque)
    """What is sent next."""
    waiting: deque[bytes] = field(default_factory=deque)
    """Messages that are sent after the answers."""
    size: int = 0
    """Size of `waiting` [bytes]."""

    _channels: dict[int, int] = field(default_factory=dict)  # by subscription
    _subscriptions: dict[int, int] = field(default_factory=dict)  # by channel
    _wake: asyncio.Event = field(default_factory=asyncio.Event)
    _told: int = 0
    _told_at: float = 0.0

    @property
    def name(self) -> str:
        """Address of the client, for people."""
        address = self.connection.remote_address
        return f"client {address[0]}:{address[1]}" if address else "a client"

    async def serve(self) -> None:
        """Serves the client until it leaves."""
        sender = asyncio.create_task(self._send_waiting())
        try:
            async for text in self.connection:
                self._take(text)
                # One client that asks for much does not keep the others waiting.
                await asyncio.sleep(0)
        finally:
            sender.cancel()
            await asyncio.gather(sender, return_exceptions=True)

    def subscribe(self, subscription: int, channel: int) -> None:
        """Begins a subscription; raises InvalidArgument if there is one with this number."""
        if subscription in self._channels:
            raise InvalidArgument(f"there is a subscription {subscription} already")
        if channel in self._subscriptions:
            raise InvalidArgument(f"there is a subscription to channel {channel} already")
        self._channels[subscription] = channel
        self._subscriptions[channel] = subscription

    def unsubscribe(self, subscription: object) -> None:
        """Ends a subscription; raises InvalidArgument if there is none."""
        if not isinstance(subscription, int) or subscription not in self._channels:
            raise InvalidArgument(f"there is no subscription {shown(str(subscription))}")
        del self._subscriptions[self._channels.pop(subscription)]

    def forget(self, channels: Sequence[int]) -> None:
        """Ends the subscriptions to these channels."""
        for channel in channels:
            if channel in self._subscriptions:
                del self._channels[self._subscriptions.pop(channel)]

    def wants(self, channels: set[int]) -> bool:
        """True if the client has subscribed to one of these channels."""
        return not channels.isdisjoint(self._subscriptions)

    def send(self, channel: int, log_time: int, data: bytes) -> None:
        """Sends a message if the client wants it. The oldest ones are lost if there is no room."""
        subscription = self._subscriptions.get(channel)
        if subscription is None:
            return
        frame = struct.pack("<BIQ", 1, subscription, log_time) + data
        while self.waiting and self.size + len(frame) > self.max_waiting:
            self.size -= len(self.waiting.popleft())
            self.lost += 1
        self.waiting.append(frame)
        self.size += len(frame)
        self._wake.set()

    def answer(self, message: Mapping[str, object]) -> None:
        """Sends an answer, before all messages that wait. No answer is lost."""
        self.answers.append(json.dumps(message))
        self._wake.set()
        if len(self.answers) > MAX_ANSWERS:
            self.connection.transport.abort()

    def take_losses(self, period: float) -> int:
        """Tells the client of lost messages; returns how many are new, at most once per period."""
        count = self.lost - self._told
        now = time.monotonic()
        if count == 0 or now < self._told_at + period:
            return 0
        self._told = self.lost
        self._told_at = now
        self.answer(warning(f"This client is too slow: {count} messages were lost.", level=1))
        return count

    def _take(self, text: str | bytes) -> None:
        try:
            if isinstance(text, bytes):
                raise InvalidArgument("this server takes no data")
            try:
                message = json.loads(text)
            except (ValueError, RecursionError):
                raise InvalidArgument("a message is not JSON") from None
            if not isinstance(message, dict):
                raise InvalidArgument("a message is an object with an op")
            self.answer_to(self, message)
        except InvalidArgument as error:
            self.answer(warning(f"{error}.", level=2))

    async def _send_waiting(self) -> None:
        from websockets.exceptions import ConnectionClosed

        try:
            while True:
                await self._wake.wait()
                self._wake.clear()
                while self.answers or self.waiting:
                    if self.answers:
                        await self.connection.send(self.answers.popleft())
                        continue
                    frame = self.waiting.popleft()
                    self.size -= len(frame)
                    await self.connection.send(frame)
        except ConnectionClosed:
            return


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens at an address; raises Error with what to do."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family)
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or error
        raise Error(
            f"cannot listen at {host}, port {port}: {reason}; "
            "--host and --port choose another address"
        ) from None


def advertisement(channels: Mapping[int, LiveChannel]) -> dict[str, object]:
    """The message that tells clients of channels."""
    return {
        "op": "advertise",
        "channels": [
            {
                "id": number,
                "topic": one.topic,
                "encoding": "cdr",
                "schemaName": one.type,
                "schemaEncoding": "ros2msg",
                "schema": one.definition,
            }
            for number, one in channels.items()
        ],
    }


def warning(text: str, level: int) -> dict[str, object]:
    """The message with a sentence for the user of a client; level 1: warning, 2: error."""
    return {"op": "status", "level": level, "message": text}


def entries(message: Mapping[str, object], key: str) -> list[object]:
    """A list in a message of a client."""
    value = message.get(key)
    if not isinstance(value, list):
        raise InvalidArgument(f"{key} is not a list")
    return value


def integer(message: Mapping[str, object], key: str) -> int:
    """A number of 32 bits in a message of a client."""
    value = message.get(key)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 1 << 32:
        raise InvalidArgument(f"{key} is not a number of 32 bits")
    return value


def host_of(text: str) -> str:
    """The name in a header "Host", without its port."""
    found = re.fullmatch(r"\[([^\]]*)\](:\d+)?|([^:]*)(:\d+)?", text.strip())
    return (found[1] or found[3] or "").lower() if found else ""


def shown(text: str) -> str:
    """A text of a client, short and without control characters."""
    return repr(text[:100])
