# SPDX-License-Identifier: BSD-3-Clause
"""What a client of Foxglove's protocol gets, and what it cannot do."""

import asyncio
import itertools
import json
import socket
import struct
import sys
import time
from collections import defaultdict
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import foxglove as foxglove_sdk
import numpy as np
import pytest
import trifinger
from conftest import StartChild, StartProgram
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from trifinger_view.bridges import foxglove
from trifinger_view.bridges.foxglove import FoxgloveOptions, FoxgloveServer
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

PROTOCOL: Any = ["foxglove.sdk.v1"]
ONE_BEFORE: Any = ["foxglove.websocket.v1"]
UNKNOWN: Any = ["chat"]
BRIDGE = (
    sys.executable,
    "-c",
    "import sys; from trifinger_view.commands.bridge import main; sys.exit(main())",
)


@asynccontextmanager
async def serving(
    robot: str, tell: Callable[[str], None] = lambda _: None, **options: Any
) -> AsyncIterator[FoxgloveServer]:
    """A server in this process, which can be reached when this begins."""
    server = FoxgloveServer(robot, FoxgloveOptions(port=0, **options), tell)
    ready = asyncio.Event()
    task = asyncio.create_task(server.serve(ready.set))
    waiting = asyncio.create_task(ready.wait())
    await asyncio.wait([task, waiting], return_when=asyncio.FIRST_COMPLETED)
    if task.done():
        waiting.cancel()
        task.result()
    try:
        yield server
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


WRONG_SUBSCRIPTION = '{"op": "subscribe", "subscriptions": [{"id": 1}]}'


class Viewer:
    """A client that was written from the description of the protocol."""

    def __init__(self, connection: ClientConnection) -> None:
        self.connection = connection
        self.info: dict[str, Any] = {}
        self.channels: dict[int, dict[str, Any]] = {}
        self.subscribed: dict[int, str] = {}
        self.messages: dict[str, list[tuple[int, bytes]]] = defaultdict(list)
        self.statuses: list[dict[str, Any]] = []
        self.numbers = itertools.count(1000)

    def topics(self) -> dict[str, int]:
        return {channel["topic"]: number for number, channel in self.channels.items()}

    async def receive(self) -> None:
        frame = await self.connection.recv()
        if isinstance(frame, bytes):
            kind, subscription, log_time = struct.unpack_from("<BIQ", frame)
            assert kind == 1
            self.messages[self.subscribed[subscription]].append((log_time, frame[13:]))
            return
        message = json.loads(frame)
        match message["op"]:
            case "serverInfo":
                self.info = message
            case "advertise":
                self.channels |= {one["id"]: one for one in message["channels"]}
            case "unadvertise":
                for number in message["channelIds"]:
                    del self.channels[number]
            case "status":
                self.statuses.append(message)
            case other:
                raise AssertionError(other)

    async def receive_until(self, is_enough: Callable[[], bool]) -> None:
        while not is_enough():
            await self.receive()

    async def subscribe(self, *topics: str) -> None:
        await self.receive_until(lambda: set(topics) <= set(self.topics()))
        asked = []
        for topic in topics:
            number = next(self.numbers)
            self.subscribed[number] = topic
            asked.append({"id": number, "channelId": self.topics()[topic]})
        await self.ask(op="subscribe", subscriptions=asked)
        # A server does not confirm a subscription, but it answers what is wrong, in turn.
        await self.error_after(WRONG_SUBSCRIPTION)

    async def ask(self, **message: object) -> None:
        await self.connection.send(json.dumps(message))

    async def error_after(self, *frames: str | bytes) -> str:
        """The sentence with which the server answers."""
        self.statuses.clear()
        for frame in frames:
            await self.connection.send(frame)
        await self.receive_until(lambda: bool(self.statuses))
        assert self.statuses[0]["level"] == 2
        return str(self.statuses[0]["message"])


@asynccontextmanager
async def viewing(url: str, **options: Any) -> AsyncIterator[Viewer]:
    async with connect(
        url, subprotocols=PROTOCOL, max_size=None, compression=None, **options
    ) as connection:
        viewer = Viewer(connection)
        await viewer.receive_until(lambda: bool(viewer.info and viewer.channels))
        yield viewer


def narrow(client: foxglove.Client) -> None:
    """Makes the kernel's buffer for a client small, so that it fills soon."""
    server_socket = client.connection.transport.get_extra_info("socket")
    server_socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)


def steps_of(robot: trifinger.Frontend, setpoints: Iterable[float]) -> None:
    for setpoint in setpoints:
        t = robot.append_desired_action(robot.new_action(setpoint=setpoint))
        robot.get_status(t)  # what is written last: now the step is whole, and can be shown


def decoded(viewer: Viewer, topic: str) -> list[Any]:
    """The messages of a topic, read by the official reader of ROS 2's messages in MCAP."""
    channel = viewer.channels[viewer.topics()[topic]]
    assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
    schema = Schema(
        id=1,
        name=channel["schemaName"],
        encoding=channel["schemaEncoding"],
        data=channel["schema"].encode(),
    )
    decode = DecoderFactory().decoder_for("cdr", schema)
    assert decode is not None
    return [decode(data) for _, data in viewer.messages[topic]]


def messages_of_log(path: Path) -> dict[str, set[bytes]]:
    found: dict[str, set[bytes]] = defaultdict(set)
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            found[channel.topic].add(message.data)
    return found


async def in_thread(work: Callable[[], object]) -> None:
    await asyncio.to_thread(work)


def test_a_client_gets_the_messages_that_the_log_has(
    tmp_path: Path, start_program: StartProgram
) -> None:
    program = start_program("run", "sim", "--non-real-time", "--record", str(tmp_path / "log"))
    program.wait_for("waits for a user")

    async def main() -> Viewer:
        async with serving("sim", rate=0, viewer_rate=8) as server, viewing(server.url) as viewer:
            topics = ("/sim/step", "/sim/object", "/sim/tf", "/sim/joint_states", "/sim/end")
            still = ("/sim/robot_description", "/sim/tf_static")
            await viewer.subscribe(*topics, *still, "/events")

            def work() -> None:
                with trifinger.connect("sim") as robot:
                    for _ in range(300):
                        robot.wait_until_time_index(
                            robot.append_desired_action(robot.new_action(torque=[0.01] * 9))
                        )
                    robot.finish()

            await asyncio.gather(
                in_thread(work),
                viewer.receive_until(
                    lambda: any("finished" in one.msg for one in decoded(viewer, "/events"))
                ),
            )
            return viewer

    viewer = asyncio.run(main())
    program.end()
    (path,) = (tmp_path / "log").glob("*.mcap")
    logged = messages_of_log(path)
    assert viewer.info["name"] == "TriFinger: sim"
    steps = decoded(viewer, "/sim/step")
    assert [step.time_index for step in steps] == list(range(300))
    for topic in ("/sim/step", "/sim/object", "/sim/end"):
        assert {data for _, data in viewer.messages[topic]} <= logged[topic], topic
    assert {data for _, data in viewer.messages["/sim/tf"]} >= logged["/sim/tf"]
    assert viewer.messages["/sim/robot_description"][0][1] in logged["/sim/robot_description"]
    assert len(decoded(viewer, "/sim/tf_static")[0].transforms) > 1
    assert len(viewer.messages["/sim/end"]) == 1


def test_a_client_that_comes_later_gets_the_newest_of_each_topic(start_fake: StartChild) -> None:
    start_fake("robot", sensor_period=1)

    async def main() -> None:
        with trifinger.connect("robot") as robot:
            steps_of(robot, [1.0, 2.0, 3.0])
            async with serving("robot", rate=0) as server:
                async with viewing(server.url) as first:
                    await first.subscribe("/robot/step")
                    await first.receive_until(lambda: bool(first.messages["/robot/step"]))
                async with viewing(server.url) as second:
                    await second.subscribe("/robot/step", "/robot/sensor")
                    await second.receive_until(lambda: len(second.messages) == 2)
                    (step,) = decoded(second, "/robot/step")
                    assert step.time_index == 2
                    assert step.desired_action.setpoint == 3.0

    asyncio.run(main())


def test_each_message_is_like_that_of_the_official_server(start_fake: StartChild) -> None:
    """Against the server of the package foxglove-sdk."""
    start_fake("robot")

    async def told_by(url: str, publish: Callable[[], None]) -> tuple[Any, Any, Any, Any]:
        async with viewing(url) as viewer:
            await viewer.subscribe("/robot/step")
            publish()
            await viewer.receive_until(lambda: bool(viewer.messages["/robot/step"]))
            channel = viewer.channels[viewer.topics()["/robot/step"]]
            await viewer.error_after(WRONG_SUBSCRIPTION)
            status = viewer.statuses[0]
            return viewer.info, channel, viewer.messages["/robot/step"], status

    async def main() -> None:
        async with serving("robot", rate=0) as server:
            with trifinger.connect("robot") as robot:
                ours = await told_by(server.url, lambda: steps_of(robot, [3.0]))
        _, channel, messages, _ = ours
        official = foxglove_sdk.start_server(port=0)
        schema = foxglove_sdk.Schema(
            name=channel["schemaName"],
            encoding=channel["schemaEncoding"],
            data=channel["schema"].encode(),
        )
        publisher = foxglove_sdk.Channel("/robot/step", schema=schema, message_encoding="cdr")

        def publish() -> None:
            while not publisher.has_sinks():
                time.sleep(0)
            publisher.log(messages[0][1], log_time=messages[0][0])

        theirs = await told_by(f"ws://127.0.0.1:{official.port}", publish)
        official.stop()
        assert set(ours[0]) == set(theirs[0])
        assert {**ours[1], "id": 0} == {**theirs[1], "id": 0}
        assert ours[2] == theirs[2]
        assert set(ours[3]) == set(theirs[3])

    asyncio.run(main())


def test_the_next_session_is_followed(start_fake: StartChild) -> None:
    async def main() -> None:
        async with serving("robot", rate=0) as server, viewing(server.url) as viewer:
            await viewer.subscribe("/events")
            numbers = set()
            for setpoint in (1.0, 2.0):
                child = start_fake("robot")
                if not viewer.messages["/robot/step"]:
                    await viewer.subscribe("/robot/step")
                with trifinger.connect("robot") as robot:
                    steps_of(robot, [setpoint])
                    await viewer.receive_until(
                        lambda wanted=setpoint: any(
                            step.desired_action.setpoint == wanted
                            for step in decoded(viewer, "/robot/step")
                        )
                    )
                numbers.add(viewer.topics()["/robot/step"])
                child.kill()
            assert len(numbers) == 1

    asyncio.run(main())


@pytest.mark.parametrize(
    ("frame", "sentence"),
    [
        (b"\x01\x00\x00", "takes no data"),
        ("{", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("[]", "an object with an op"),
        ('{"op": "advertise"}', "no operation 'advertise'"),
        ('{"op": "subscribe"}', "subscriptions is not a list"),
        ('{"op": "subscribe", "subscriptions": [3]}', "id and channelId"),
        ('{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 0}]}', "32 bits"),
        ('{"op": "subscribe", "subscriptions": [{"id": true, "channelId": 0}]}', "32 bits"),
        ('{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 99}]}', "no channel 99"),
        ('{"op": "unsubscribe", "subscriptionIds": [5]}', "no subscription '5'"),
        ('{"op": "unsubscribe", "subscriptionIds": [[5]]}', "no subscription"),
    ],
)
def test_fault_68_a_client_that_talks_nonsense_is_told_so_and_others_go_on(
    frame: str | bytes, sentence: str, start_fake: StartChild
) -> None:
    start_fake("robot")

    async def main() -> None:
        async with (
            serving("robot", rate=0) as server,
            viewing(server.url) as good,
            viewing(server.url) as bad,
        ):
            await good.subscribe("/robot/step")
            assert sentence in await bad.error_after(frame)
            with trifinger.connect("robot") as robot:
                steps_of(robot, [1.0])
                await good.receive_until(lambda: bool(good.messages["/robot/step"]))

    asyncio.run(main())


def test_fault_68_a_client_that_does_not_read_loses_messages_alone(
    start_fake: StartChild,
) -> None:
    """The robot and the other client notice nothing, and memory stays bounded."""
    start_fake("robot", history=4096)
    told: list[str] = []
    bound = 1 << 16
    burst = 100  # fits into the bound

    def client_of(server: FoxgloveServer, viewer: Viewer) -> foxglove.Client:
        address = viewer.connection.local_address
        (found,) = [one for one in server.clients if one.connection.remote_address == address]
        return found

    async def main() -> None:
        async with (
            serving("robot", told.append, rate=0, max_waiting=bound) as server,
            viewing(server.url) as good,
            viewing(server.url, max_queue=1) as slow,
        ):
            await good.subscribe("/robot/step")
            await slow.subscribe("/robot/step")
            client = client_of(server, slow)
            narrow(client)
            # From now on the slow client does not read, and buffers fill up.
            slow.connection.transport.pause_reading()
            expected = 0
            with trifinger.connect("robot") as robot:
                actions = np.stack([robot.new_action()] * burst)
                while client.lost == 0:
                    robot.append_desired_actions(actions)
                    expected += burst
                    await good.receive_until(
                        lambda wanted=expected: len(good.messages["/robot/step"]) >= wanted
                    )
                    assert client.size <= bound
            assert [step.time_index for step in decoded(good, "/robot/step")] == list(
                range(expected)
            )
            slow.connection.transport.abort()

    asyncio.run(main())
    assert any("too slow" in sentence for sentence in told)


def test_fault_68_a_slow_client_gets_the_newest_and_is_told_what_it_lost() -> None:
    class Connection:
        remote_address = ("127.0.0.1", 1)

    client = foxglove.Client(Connection(), 100, lambda *_: None)  # type: ignore[arg-type]
    client.subscribe(7, 3)
    for log_time in range(50):
        client.send(3, log_time, bytes(20))
    times = [struct.unpack_from("<BIQ", frame)[2] for frame in client.waiting]
    assert times == [47, 48, 49]
    assert client.lost == 47
    assert client.take_losses(1.0) == 47
    assert "47 messages were lost" in client.answers[-1]
    assert client.take_losses(0.0) == 0
    client.send(3, 50, bytes(1000))  # larger than all that may wait: it is still sent
    assert [struct.unpack_from("<BIQ", frame)[2] for frame in client.waiting] == [50]


@pytest.mark.slow
def test_fault_68_a_client_that_asks_and_does_not_read_is_sent_away(
    start_fake: StartChild,
) -> None:
    start_fake("robot")

    async def main() -> None:
        async with serving("robot") as server, viewing(server.url, max_queue=1) as bad:
            narrow(server.clients[0])
            bad.connection.transport.pause_reading()

            async def flood() -> None:
                while True:
                    await bad.connection.send("{")

            task = asyncio.create_task(flood())
            while server.clients:
                await asyncio.sleep(0)
            bad.connection.transport.abort()
            with pytest.raises(ConnectionClosed):
                await task

    asyncio.run(main())


# ---- who may connect ----


def status_of(error: pytest.ExceptionInfo[InvalidStatus]) -> tuple[int, str]:
    response = error.value.response
    return response.status_code, (response.body or b"").decode()


@pytest.mark.parametrize("origin", ["https://app.foxglove.dev", "file://", "http://mine:8080"])
def test_foxglove_and_sites_of_the_user_may_connect(origin: Any) -> None:
    async def main() -> None:
        async with (
            serving("robot", origins=("http://mine:8080",)) as server,
            viewing(server.url, origin=origin) as viewer,
        ):
            assert viewer.channels

    asyncio.run(main())


@pytest.mark.parametrize("origin", ["https://evil.example", "null", "http://localhost:8765"])
def test_fault_68_other_web_sites_may_not_connect(origin: Any) -> None:
    async def main() -> None:
        async with serving("robot") as server:
            with pytest.raises(InvalidStatus) as error:
                async with viewing(server.url, origin=origin):
                    pass
            status, text = status_of(error)
            assert status == 403
            assert f"the web site '{origin}' may not connect" in text

    asyncio.run(main())


def test_fault_68_a_name_of_others_that_means_this_machine_is_refused() -> None:
    async def main() -> None:
        async with serving("robot") as server:
            port = int(server.url.rpartition(":")[2])
            with pytest.raises(InvalidStatus) as error:
                async with viewing(f"ws://evil.example:{port}", host="127.0.0.1", port=port):
                    pass
            assert status_of(error)[0] == 403
            assert "not a name of this machine" in status_of(error)[1]

    asyncio.run(main())


def test_another_address_needs_a_token() -> None:
    with pytest.raises(trifinger.InvalidArgument, match="give a token"):
        FoxgloveServer("robot", FoxgloveOptions(host="0.0.0.0"))  # noqa: S104

    async def main() -> None:
        async with serving("robot", host="0.0.0.0", token="seven") as server:  # noqa: S104, S106
            assert server.url.endswith("/?token=seven")
            address = server.url.replace("0.0.0.0", "127.0.0.1").partition("/?")[0]  # noqa: S104
            async with viewing(f"{address}/?token=seven"):
                pass
            for wrong in ("", "/?token=", "/?token=Seven", "/?token=%ff", "/seven"):
                with pytest.raises(InvalidStatus) as error:
                    async with viewing(address + wrong):
                        pass
                assert "the token is missing or wrong" in status_of(error)[1]

    asyncio.run(main())


def test_a_number_of_clients_is_enough() -> None:
    async def main() -> None:
        async with serving("robot") as server:

            async def fill(left: int) -> None:
                async with viewing(server.url):
                    if left > 1:
                        await fill(left - 1)
                        return
                    with pytest.raises(InvalidStatus) as error:
                        async with viewing(server.url):
                            pass
                    assert status_of(error)[0] == 503

            await fill(foxglove.MAX_CLIENTS)

    asyncio.run(main())


def test_the_protocol_before_is_spoken_and_others_are_refused() -> None:
    async def main() -> None:
        async with serving("robot") as server:
            async with connect(server.url, subprotocols=ONE_BEFORE) as connection:
                assert connection.subprotocol == ONE_BEFORE[0]
            with pytest.raises(InvalidStatus) as error:
                async with connect(server.url, subprotocols=UNKNOWN):
                    pass
            assert status_of(error)[0] == 400

    asyncio.run(main())


# ---- the command ----


def test_the_command_says_where_to_connect_and_ends_cleanly(
    start_fake: StartChild, start_program: StartProgram
) -> None:
    start_fake("robot")
    bridge = start_program("foxglove", "robot", "--port", "0", program=BRIDGE)
    line = bridge.wait_for("Serves robot at ")
    url = line.split()[-1]
    assert url.startswith("ws://127.0.0.1:")

    async def main() -> None:
        async with viewing(url) as viewer:
            await viewer.subscribe("/robot/step")
            with trifinger.connect("robot") as robot:
                steps_of(robot, [1.0])
                await viewer.receive_until(lambda: bool(viewer.messages["/robot/step"]))

    asyncio.run(main())
    status, _ = bridge.end()
    assert status == 0


def test_the_command_says_why_it_cannot_listen(start_program: StartProgram) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        bridge = start_program("foxglove", "sim", "--port", str(port), program=BRIDGE)
        bridge.wait_for(f"port {port}")
        assert bridge.process.wait() == 1
