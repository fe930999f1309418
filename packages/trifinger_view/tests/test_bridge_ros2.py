# SPDX-License-Identifier: BSD-3-Clause
"""What programs of ROS 2 get, on DDS and on Zenoh, without ROS.

The subscribers are processes of their own with types of their own.
"""

import atexit
import base64
import json
import os
import re
import signal
import socket
import struct
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest
import trifinger
from conftest import Child, StartChild, StartProgram, free_port
from cyclonedds import idl
from cyclonedds.idl import make_idl_struct
from ros2_pyterfaces.core import all_msgs
from ros2_pyterfaces.core.description import hash_rihs01
from test_processes import step
from trifinger import _trifinger
from trifinger_view.bridges import dds, message_types, ros2, zenoh_node
from trifinger_view.bridges.message_types import Field, MessageType, dds_name, parse
from trifinger_view.bridges.ros2 import Node, Ros2Bridge, Ros2Options, Topic, namespace_of

BRIDGE = (
    sys.executable,
    "-c",
    "import sys; from trifinger_view.commands.bridge import main; sys.exit(main())",
)


def own_domain() -> tuple[int, socket.socket]:
    """A domain of DDS in which no other tests are that run at the same time; the next one as well.

    Both are this process's as long as the socket lives.
    """
    for domain in range(10, 100, 2):
        holder = socket.socket(socket.AF_UNIX)
        try:
            # The name is no file. Like the loopback interface, it is known in this network alone.
            holder.bind(f"\0trifinger-tests-domain-{domain}")
        except OSError:
            holder.close()
        else:
            return domain, holder
    raise AssertionError("there is no domain left")


DOMAIN, HOLDER = own_domain()
atexit.register(HOLDER.close)

DDS_SUBSCRIBER = f"""
import json, sys, time
from dataclasses import dataclass, fields
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float64, int32, int64, sequence, uint8, uint32, uint64
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32

@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str

@dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]

@dataclass
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    data: str

@dataclass
class Log(IdlStruct, typename="rcl_interfaces::msg::dds_::Log_"):
    stamp: Time
    level: uint8
    name: str
    msg: str
    file: str
    function: str
    line: uint32

@dataclass
class Action(IdlStruct, typename="trifinger_msgs::msg::dds_::FakeAction_"):
    setpoint: float64

@dataclass
class Observation(IdlStruct, typename="trifinger_msgs::msg::dds_::FakeObservation_"):
    setpoint: float64
    applied_actions: int64

@dataclass
class Status(IdlStruct, typename="trifinger_msgs::msg::dds_::Status_"):
    time: int64
    tick: int64
    lateness: int64
    measurement_age: int64
    flags: uint32
    skipped_ticks: uint32
    action_repeats: uint32
    discarded_actions: uint32
    rejected_actions: uint32
    lost_frames: uint32
    fault_code: int32
    fault_detail: int32

@dataclass
class Step(IdlStruct, typename="trifinger_msgs::msg::dds_::FakeStep_"):
    session_id: uint64
    time_index: int64
    status: Status
    observation: Observation
    applied_action: Action
    desired_action: Action

@dataclass
class Gid(IdlStruct, typename="rmw_dds_common::msg::dds_::Gid_"):
    data: array[uint8, 16]

@dataclass
class NodeInfo(IdlStruct, typename="rmw_dds_common::msg::dds_::NodeEntitiesInfo_"):
    node_namespace: str
    node_name: str
    reader_gid_seq: sequence[Gid]
    writer_gid_seq: sequence[Gid]

@dataclass
class Graph(IdlStruct, typename="rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"):
    gid: Gid
    node_entities_info_seq: sequence[NodeInfo]

domain = int(sys.argv[1])
configured = Domain(domain, {dds.LOOPBACK!r})
participant = DomainParticipant(domain)
reliable = Policy.Reliability.Reliable(duration(seconds=1))
readers = {{}}
for name, kind, is_latched in json.loads(sys.argv[2]):
    durability = Policy.Durability.TransientLocal if is_latched else Policy.Durability.Volatile
    topic = Topic(participant, name, globals()[kind])
    qos = Qos(reliable, durability, Policy.History.KeepLast(1000))
    readers[name] = DataReader(participant, topic, qos)

def plain(value):
    if isinstance(value, IdlStruct):
        return {{each.name: plain(getattr(value, each.name)) for each in fields(value)}}
    return [plain(each) for each in value] if isinstance(value, (list, tuple, bytes)) else value

print("ready", flush=True)
while True:
    for name, reader in readers.items():
        for sample in reader.take(100):
            if isinstance(sample, IdlStruct):
                told = {{"topic": name, "message": plain(sample)}}
                told["time"] = sample.sample_info.source_timestamp
                print(json.dumps(told), flush=True)
    time.sleep(0.01)
"""

ZENOH_SUBSCRIBER = """
import base64, json, sys, threading
import zenoh, zenoh.ext

endpoint, topics, tokens = sys.argv[1], json.loads(sys.argv[2]), sys.argv[3]
config = zenoh.Config()
config.insert_json5("listen/endpoints", json.dumps([endpoint]))
config.insert_json5("scouting/multicast/enabled", "false")
config.insert_json5("timestamping/enabled", "true")
session = zenoh.open(config)

telling = threading.Lock()

def tell(**words):
    with telling:  # Zenoh calls from several threads
        print(json.dumps(words), flush=True)

def on_sample(sample):
    attachment = sample.attachment
    tell(
        key=str(sample.key_expr),
        data=base64.b64encode(sample.payload.to_bytes()).decode(),
        attachment=base64.b64encode(attachment.to_bytes()).decode() if attachment else None,
    )

def on_token(sample):
    tell(token=str(sample.key_expr), is_there=sample.kind == zenoh.SampleKind.PUT)

print("ready", flush=True)
kept = []
for key, is_latched in topics:
    if is_latched:
        history = zenoh.ext.HistoryConfig(detect_late_publishers=True)
        kept.append(zenoh.ext.declare_advanced_subscriber(session, key, on_sample, history=history))
    else:
        kept.append(session.declare_subscriber(key, on_sample))
kept.append(session.liveliness().declare_subscriber(tokens, on_token, history=True))
sys.stdin.read()
session.close()
"""


@contextmanager
def bridging(robot: str, node: Node, **options: Any) -> Iterator[Ros2Bridge]:
    """A bridge in a thread of this process."""
    bridge = Ros2Bridge(robot, node, Ros2Options(**options), lambda _: None)
    stop = threading.Event()
    thread = threading.Thread(target=bridge.run, args=(stop,))
    thread.start()
    try:
        yield bridge
    finally:
        stop.set()
        thread.join()


@contextmanager
def stepping(robot: trifinger.Frontend, setpoint: float) -> Iterator[None]:
    """Does one step after the other in a thread."""
    done = threading.Event()

    def work() -> None:
        while not done.is_set():
            step(robot, setpoint)

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def lines_of(child: Child) -> Iterator[dict[str, Any]]:
    """What a subscriber tells. It ends with the process."""
    while line := child.read_line():
        yield json.loads(line)


def until(child: Child, is_enough: Callable[[dict[str, Any]], object]) -> list[dict[str, Any]]:
    seen = []
    for told in lines_of(child):
        seen.append(told)
        if is_enough(told):
            return seen
    raise AssertionError(f"the subscriber has ended: {child.finish()}")


# ---- types ----


def channels_of(robot: str) -> dict[str, _trifinger.LiveChannel]:
    live = _trifinger.LiveMessages(robot)
    while not live.is_running:
        live.take()
    return {channel.topic: channel for channel in live.channels}


STANDARD = {
    "sensor_msgs/msg/JointState": all_msgs.JointState,
    "std_msgs/msg/String": all_msgs.String,
    "rcl_interfaces/msg/Log": all_msgs.Log,
    "geometry_msgs/msg/TransformStamped": all_msgs.TransformStamped,
}


def test_hashes_are_those_of_ros_2(start_program: StartProgram) -> None:
    """Against the definitions and the hashes of the package ros2-pyterfaces."""
    start_program("run", "sim", "--non-real-time").wait_for("waits for a user")
    seen = set()
    for channel in channels_of("sim").values():
        message_type = parse(channel.type, channel.definition)
        for name in (message_type.name, *message_type.used):
            if name in STANDARD:
                assert message_type.part(name).hash == hash_rihs01(STANDARD[name])
                seen.add(name)
    assert seen == set(STANDARD)


def test_a_definition_is_read_with_all_that_it_uses() -> None:
    separator = "=" * 80
    definition = (
        "# a comment\nbyte DEBUG=10\nuint8 kind # [m]\nstd_msgs/Header[] headers\n"
        f"float64[9] k\nOwn own\n{separator}\nMSG: std_msgs/Header\n"
        f"builtin_interfaces/Time stamp\nstring frame_id\n{separator}\n"
        f"MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n{separator}\n"
        "MSG: mine/Own\nbool yes\n"
    )
    read = parse("mine/msg/Whole", definition)
    assert read.fields == (
        Field("kind", "uint8"),
        Field("headers", "std_msgs/msg/Header", 0),
        Field("k", "float64", 9),
        Field("own", "mine/msg/Own"),
    )
    assert read.used == [
        "builtin_interfaces/msg/Time",
        "mine/msg/Own",
        "std_msgs/msg/Header",
    ]
    assert dds_name("sensor_msgs/msg/JointState") == "sensor_msgs::msg::dds_::JointState_"


@pytest.mark.parametrize(
    "definition", ["float64[<=3] x\n", "x\n", "Unknown x\n", "float64 x y\n", "string<=5 x\n"]
)
def test_a_definition_that_is_not_understood_is_an_error(definition: str) -> None:
    with pytest.raises(trifinger.InvalidArgument, match="mine/msg/Whole"):
        parse("mine/msg/Whole", definition)


# ---- names ----


class Collected:
    """A node that keeps what is published."""

    def __init__(self) -> None:
        self.topics: dict[str, Topic] = {}
        self.messages: dict[str, list[tuple[int, bytes]]] = {}
        self.listened: set[str] = set()
        self.is_open = True

    def advertise(self, topic: Topic) -> Any:
        node, kept = self, self.messages.setdefault(topic.name, [])
        self.topics[topic.name] = topic

        class Kept:
            def publish(self, data: bytes, log_time: int) -> bool:
                kept.append((log_time, data))
                return True

            def has_subscribers(self) -> bool:
                return topic.name in node.listened

            def close(self) -> None:
                del node.topics[topic.name]

        return Kept()

    def close(self) -> None:
        assert not self.topics
        self.is_open = False


def test_topics_have_the_names_that_ros_2_expects(start_program: StartProgram) -> None:
    start_program("run", "sim", "--non-real-time").wait_for("waits for a user")
    for namespace, prefix in ((None, "/sim"), ("/", ""), ("/lab/one", "/lab/one")):
        node = Collected()
        bridge = Ros2Bridge("sim", node, Ros2Options(namespace=namespace), lambda _: None)
        while "/tf" not in node.topics:
            bridge.pump()
        latched = {name for name, topic in node.topics.items() if topic.is_latched}
        assert latched == {"/rosout", "/tf_static", f"{prefix}/robot_description"}
        assert set(node.topics) - latched == {
            "/tf",
            *(
                f"{prefix}/{name}"
                for name in ("step", "end", "object", "hand", "experience", "joint_states")
            ),
        }
        bridge.close()
        assert not node.is_open


def test_each_image_has_the_parameters_of_its_camera_beside_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stamp = "int32 sec\nuint32 nanosec\n"
    header = bytes((0, 1, 0, 0))

    class Live:
        wanted: ClassVar[list[bool]] = []
        channels: ClassVar[list[Any]] = [
            SimpleNamespace(
                topic=f"/sim/camera60/{name}",
                type=f"sensor_msgs/msg/{kind}",
                definition=stamp,
                is_latched=is_latched,
                is_image=not is_latched,
            )
            for name, kind, is_latched in (
                ("camera_info", "CameraInfo", True),
                ("image", "CompressedImage", False),
            )
        ]

        def __init__(self, *_: object, **__: object) -> None:
            self.left = [(0, b"informed"), (1, b"image__1more"), (1, b"image__2")]

        def take(self) -> Any:
            messages = [
                SimpleNamespace(channel=channel, log_time=7, part=0, data=header + data)
                for channel, data in self.left
            ]
            self.left.clear()
            return SimpleNamespace(messages=messages, events=[], lost=0)

        def want_images(self, wanted: bool) -> None:
            self.wanted.append(wanted)

    monkeypatch.setattr(ros2, "LiveMessages", Live)
    node = Collected()
    node.listened.add("/sim/camera60/image/compressed")
    bridge = Ros2Bridge("sim", node, report=lambda _: None)
    bridge.pump()
    infos = [data for _, data in node.messages["/sim/camera60/camera_info"]]
    assert infos == [header + b"informed", header + b"image__1", header + b"image__2"]
    assert len(node.messages["/sim/camera60/image/compressed"]) == 2
    assert Live.wanted == [True]
    assert not any(topic.is_latched for topic in node.topics.values())


def test_a_name_that_ros_2_does_not_allow_is_refused() -> None:
    assert namespace_of("sim", None) == "/sim"
    for robot, namespace in (("my-robot", None), ("sim", "sim"), ("sim", "/sim/"), ("7", None)):
        with pytest.raises(trifinger.InvalidArgument, match="--namespace"):
            namespace_of(robot, namespace)


# ---- DDS ----


@pytest.mark.slow
def test_a_subscriber_on_dds_gets_the_values_of_the_robot(
    start_fake: StartChild, start_python: StartChild
) -> None:
    start_fake("robot")
    topics = [("rt/robot/step", "Step", False), ("rt/rosout", "Log", True)]
    subscriber = start_python(DDS_SUBSCRIBER, str(DOMAIN), json.dumps(topics))
    setpoints = np.random.default_rng(3).normal(size=200).tolist()
    with (
        bridging("robot", dds.DdsNode("/robot", DOMAIN), rate=0) as bridge,
        trifinger.connect("robot") as robot,
    ):
        # Messages count from the moment on when both have found each other.
        while not any(
            publisher.has_subscribers()
            for number, publisher in list(bridge._publishers.items())
            if bridge._topics[number].name == "/robot/step"
        ):
            threading.Event().wait(0.001)
        told = []
        for setpoint in setpoints:
            # Only the newest messages are kept for a subscriber, which may be slow.
            t = step(robot, setpoint)
            told += until(subscriber, lambda one, t=t: one["message"].get("time_index") == t)
        robot.finish()
        events = until(subscriber, lambda one: "finished" in one["message"].get("msg", ""))
    steps = [one["message"] for one in told if one["topic"] == "rt/robot/step"]
    assert [one["desired_action"]["setpoint"] for one in steps] == setpoints
    assert [one["time_index"] for one in steps] == list(range(200))
    assert [one["observation"]["applied_actions"] for one in steps] == list(range(200))
    assert all(one["time"] > 0 for one in told)
    assert events[-1]["message"]["name"] == "robot"


def wait_for_subscribers(bridge: Ros2Bridge, topic: str, count: int) -> None:
    def number() -> int:
        for one, publisher in list(bridge._publishers.items()):
            if bridge._topics[one].name == topic:
                return len(publisher._writer.get_matched_subscriptions())  # type: ignore[attr-defined]
        return 0

    while number() < count:
        threading.Event().wait(0.001)


@pytest.mark.slow
def test_fault_68_a_subscriber_on_dds_that_stands_still_delays_nobody(
    start_fake: StartChild, start_python: StartChild
) -> None:
    start_fake("robot", history=4096)
    domain = DOMAIN + 1
    topics = json.dumps([("rt/robot/step", "Step", False)])
    good, stuck = (start_python(DDS_SUBSCRIBER, str(domain), topics) for _ in range(2))
    with (
        bridging("robot", dds.DdsNode("/robot", domain), rate=0) as bridge,
        trifinger.connect("robot") as robot,
    ):
        wait_for_subscribers(bridge, "/robot/step", 2)
        os.kill(stuck.pid, signal.SIGSTOP)
        seen: list[int] = []
        for burst in range(100):
            robot.append_desired_actions(np.stack([robot.new_action()] * 20))
            last = 20 * (burst + 1) - 1
            for told in lines_of(good):
                seen.append(told["message"]["time_index"])
                if seen[-1] == last:
                    break
        os.kill(stuck.pid, signal.SIGCONT)
        # DDS gives up who was silent for 10 s, and finds him again: what came before is lost.
        with stepping(robot, 7.0):
            newest = until(stuck, lambda one: one["message"]["desired_action"]["setpoint"] == 7.0)
    assert seen == sorted(seen)
    assert newest[-1]["message"]["time_index"] >= 2000


def test_a_subscriber_on_dds_that_comes_later_gets_what_is_latched(
    start_program: StartProgram, start_python: StartChild
) -> None:
    start_program("run", "sim", "--non-real-time").wait_for("waits for a user")
    topics = [
        ("rt/sim/robot_description", "String", True),
        ("ros_discovery_info", "Graph", True),
    ]
    with bridging("sim", dds.DdsNode("/sim", DOMAIN)) as bridge:
        while len(bridge.topics) < 10:
            threading.Event().wait(0.001)
        subscriber = start_python(DDS_SUBSCRIBER, str(DOMAIN), json.dumps(topics))
        seen: dict[str, Any] = {}
        until(
            subscriber,
            lambda one: seen.update({one["topic"]: one["message"]}) or len(seen) == 2,
        )
    assert "<robot name=" in seen["rt/sim/robot_description"]["data"]
    (node,) = seen["ros_discovery_info"]["node_entities_info_seq"]
    assert (node["node_namespace"], node["node_name"]) == ("/sim", "trifinger_bridge")
    assert len(node["writer_gid_seq"]) == 10


def test_types_of_dds_have_the_bytes_of_our_messages(
    start_fake: StartChild, monkeypatch: pytest.MonkeyPatch
) -> None:
    def with_constructor(*words: Any, dataclassify: bool) -> Any:
        assert not dataclassify
        return make_idl_struct(*words)

    monkeypatch.setattr(idl, "make_idl_struct", with_constructor)
    start_fake("robot", sensor_period=1)
    live = _trifinger.LiveMessages("robot", rate=0)
    with trifinger.connect("robot") as robot:
        while not live.is_running:
            live.take()
        for setpoint in (1.0, 2.5):
            step(robot, setpoint)
        messages = []
        while len(messages) < 4:
            messages += live.take().messages
    for message in messages:
        channel = live.channels[message.channel]
        struct_type: Any = dds.idl_type(parse(channel.type, channel.definition))
        read = struct_type.deserialize(message.data)
        assert read.serialize()[: len(message.data)] == message.data, channel.topic


def test_a_domain_that_dds_does_not_have_is_refused() -> None:
    with pytest.raises(trifinger.Error, match="0 to 232"):
        dds.DdsNode("/sim", 233)


# ---- Zenoh ----


@pytest.mark.slow
def test_a_subscriber_on_zenoh_gets_the_values_of_the_robot(
    start_fake: StartChild, start_python: StartChild
) -> None:
    start_fake("robot")
    channel = channels_of("robot")["/robot/step"]
    step_type = parse(channel.type, channel.definition)
    key = f"5/robot/step/trifinger_msgs::msg::dds_::FakeStep_/{step_type.hash}"
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    subscriber = start_python(
        ZENOH_SUBSCRIBER, endpoint, json.dumps([(key, False)]), "@ros2_lv/5/**"
    )
    setpoints = np.random.default_rng(4).normal(size=200).tolist()
    with (
        bridging("robot", zenoh_node.ZenohNode("/robot", 5, endpoint), rate=0) as bridge,
        trifinger.connect("robot") as robot,
    ):
        tokens = [
            one["token"] for one in until(subscriber, lambda one: "%step/" in one.get("token", ""))
        ]
        while not any(
            publisher.has_subscribers()
            for number, publisher in list(bridge._publishers.items())
            if bridge._topics[number].name == "/robot/step"
        ):
            threading.Event().wait(0.001)
        live = _trifinger.LiveMessages("robot", rate=0)
        while not live.is_running:
            live.take()
        samples: list[dict[str, Any]] = []
        for setpoint in setpoints:
            step(robot, setpoint)
            samples.append(until(subscriber, lambda one: "key" in one)[-1])
        expected = [
            one.data
            for one in live.take().messages
            if live.channels[one.channel].topic == "/robot/step"
        ]
    assert {one["key"] for one in samples} == {key}
    assert [base64.b64decode(one["data"]) for one in samples] == expected
    for count, one in enumerate(samples, start=1):
        sequence, log_time, size = struct.unpack_from("<qqB", base64.b64decode(one["attachment"]))
        assert (sequence, size) == (count, 16)
        assert log_time > 0
        assert len(base64.b64decode(one["attachment"])) == 33
    node_token = re.compile(r"@ros2_lv/5/[0-9a-f]+/0/0/NN/%/%robot/trifinger_bridge")
    topic_token = re.compile(
        r"@ros2_lv/5/[0-9a-f]+/0/\d+/MP/%/%robot/trifinger_bridge/%robot%step/"
        rf"trifinger_msgs::msg::dds_::FakeStep_/{step_type.hash}/::,10:,:,:,,"
    )
    assert any(node_token.fullmatch(token) for token in tokens)
    assert any(topic_token.fullmatch(token) for token in tokens)
    gone = until(subscriber, lambda one: one.get("is_there") is False)
    assert "@ros2_lv/5/" in gone[-1]["token"]


def test_a_subscriber_on_zenoh_that_comes_later_gets_what_is_latched(
    start_program: StartProgram, start_python: StartChild
) -> None:
    start_program("run", "sim", "--non-real-time").wait_for("waits for a user")
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    key = "0/sim/robot_description/std_msgs::msg::dds_::String_/*"
    with bridging("sim", zenoh_node.ZenohNode("/sim", 0, endpoint)) as bridge:
        while "/sim/robot_description" not in {topic.name for topic in bridge.topics}:
            threading.Event().wait(0.001)
        subscriber = start_python(
            ZENOH_SUBSCRIBER, endpoint, json.dumps([(key, True)]), "@ros2_lv/0/**"
        )
        told = until(subscriber, lambda one: "key" in one)
    assert hash_rihs01(all_msgs.String) in told[-1]["key"]


def test_a_router_that_is_no_address_is_an_error() -> None:
    with pytest.raises(trifinger.Error, match="nonsense"):
        zenoh_node.ZenohNode("/sim", 0, "nonsense")


def test_qualities_of_service_are_written_as_rmw_zenoh_does() -> None:
    kind = MessageType("a/msg/A", {"a/msg/A": ()})
    assert zenoh_node.qos_text(Topic("/a", kind)) == "::,10:,:,:,,"
    assert zenoh_node.qos_text(Topic("/a", kind, is_latched=True, depth=1)) == ":1:,1:,:,:,,"


def test_types_are_numbered_as_rep_2016_does() -> None:
    assert message_types.type_id(Field("x", "float64")) == 11
    assert message_types.type_id(Field("x", "float64", 3)) == 59
    assert message_types.type_id(Field("x", "float64", 0)) == 155
    assert message_types.type_id(Field("x", "std_msgs/msg/Header")) == 1


# ---- the command ----


def test_the_command_publishes_and_ends_cleanly(
    start_fake: StartChild, start_program: StartProgram, start_python: StartChild
) -> None:
    start_fake("robot")
    subscriber = start_python(
        DDS_SUBSCRIBER, str(DOMAIN), json.dumps([("rt/lab/step", "Step", False)])
    )
    bridge = start_program(
        *("ros2", "robot", "--domain", str(DOMAIN), "--rate", "0", "--namespace", "/lab"),
        program=BRIDGE,
    )
    bridge.wait_for("node /lab/trifinger_bridge")
    with trifinger.connect("robot") as robot, stepping(robot, 4.5):
        told = until(subscriber, lambda _: True)
    assert told[0]["message"]["desired_action"]["setpoint"] == 4.5
    assert bridge.end()[0] == 0


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--rmw", "zenoh", "--network"], "--network is for --rmw dds"),
        (["--router", "tcp/localhost:1"], "--router is for --rmw zenoh"),
        (["--domain", "300"], "0 to 232"),
        (["--namespace", "sim"], "cannot be a namespace"),
        (["--rate", "-1"], "must be 0 or more"),
    ],
)
def test_the_command_refuses_what_makes_no_sense(
    words: list[str], sentence: str, start_program: StartProgram
) -> None:
    bridge = start_program("ros2", "sim", *words, program=BRIDGE)
    bridge.wait_for(sentence)
    assert bridge.process.wait() != 0
