# SPDX-License-Identifier: BSD-3-Clause
"""A node of ROS 2 on DDS, with Cyclone DDS's Python package."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from trifinger import extras
from trifinger.errors import Error

from trifinger_view.bridges.message_types import Field, MessageType, dds_name
from trifinger_view.bridges.ros2 import NODE, Publisher, Topic

if TYPE_CHECKING:
    from cyclonedds.core import Qos
    from cyclonedds.idl import IdlStruct
    from cyclonedds.pub import DataWriter

LOOPBACK = """<CycloneDDS><Domain Id="any">
<General>
<Interfaces><NetworkInterface name="lo"/></Interfaces>
<AllowMulticast>false</AllowMulticast>
</General>
<Discovery>
<ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>100</MaxAutoParticipantIndex>
<Peers><Peer address="localhost"/></Peers>
</Discovery>
</Domain></CycloneDDS>"""
"""Configuration of Cyclone DDS with which only programs of this machine meet."""

GID_SIZE = 16


def idl_type(message: MessageType) -> type[IdlStruct]:
    """The type of Cyclone DDS for a message."""
    from cyclonedds.idl import make_idl_struct, types

    scalars: Mapping[str, object] = {
        "bool": bool,
        "byte": types.byte,
        "char": types.uint8,
        "string": str,
        **{
            name: getattr(types, name)
            for name in (
                *("int8", "int16", "int32", "int64", "float32"),
                *("uint8", "uint16", "uint32", "uint64", "float64"),
            )
        },
    }
    made: dict[str, object] = {}

    def type_of(field: Field) -> object:
        one = struct_of(field.type) if field.is_nested else scalars[field.type]
        if field.size is None:
            return one
        return types.array[one, field.size] if field.size else types.sequence[one]  # type: ignore[misc]

    def struct_of(name: str) -> object:
        if name not in made:
            made[name] = make_idl_struct(
                name.rpartition("/")[2],
                dds_name(name),
                {field.name: type_of(field) for field in message.types[name]},
                dataclassify=False,
            )
        return made[name]

    struct: type[IdlStruct] = struct_of(message.name)  # type: ignore[assignment]
    return struct


class DdsNode:
    """A node of ROS 2 on DDS.

    It is seen by programs of this machine only, unless `network` is true. Then the configuration in
    $CYCLONEDDS_URI counts, or Cyclone DDS's own.
    """

    def __init__(self, namespace: str, domain: int = 0, network: bool = False) -> None:
        """Begins a node; raises Error if a package is missing or the domain cannot be entered."""
        extras.require("trifinger-view[ros2]", "cyclonedds")
        from cyclonedds.core import DDSException, Policy, Qos
        from cyclonedds.domain import Domain, DomainParticipant

        if not 0 <= domain <= 232:
            raise Error(f"the domain is {domain}; ROS 2 has the domains 0 to 232")
        qos = Qos(Policy.Userdata(data=b"enclave=/;"))
        try:
            config = os.environ.get("CYCLONEDDS_URI") if network else LOOPBACK
            self._domain = Domain(domain, config)
            self._participant = DomainParticipant(domain, qos=qos)
        except DDSException as error:
            raise Error(f"cannot enter the domain {domain} of DDS: {error}") from None
        self._namespace = namespace
        self._writers: dict[str, DataWriter[IdlStruct]] = {}
        self._graph = self._writer(
            Topic("ros_discovery_info", GRAPH_TYPE, is_latched=True, depth=1),
            "ros_discovery_info",
        )
        self._publish_graph()

    def advertise(self, topic: Topic) -> Publisher:
        """Begins a topic."""
        writer = self._writer(topic, f"rt{topic.name}")
        self._writers[topic.name] = writer
        self._publish_graph()
        return DdsPublisher(writer, lambda: self._withdraw(topic.name))

    def close(self) -> None:
        """Ends the node."""
        del self._graph, self._participant, self._domain

    def _withdraw(self, name: str) -> None:
        del self._writers[name]
        self._publish_graph()

    def _writer(self, topic: Topic, name: str) -> DataWriter[IdlStruct]:
        from cyclonedds.pub import DataWriter
        from cyclonedds.topic import Topic as DdsTopic

        dds_topic = DdsTopic(self._participant, name, idl_type(topic.type))
        return DataWriter(self._participant, dds_topic, qos_of(topic))

    def _publish_graph(self) -> None:
        """Tells other nodes which node the topics belong to."""
        gids = [writer.guid.bytes for writer in self._writers.values()]
        info = graph_message(self._participant.guid.bytes, self._namespace, NODE, gids)
        write(self._graph, info, None)


class DdsPublisher:
    """Publishes messages of one topic on DDS."""

    def __init__(self, writer: DataWriter[IdlStruct], withdraw: Callable[[], None]) -> None:
        """`withdraw` tells others that the topic has ended."""
        self._writer: DataWriter[IdlStruct] | None = writer
        self._withdraw = withdraw

    def publish(self, data: bytes, log_time: int) -> bool:
        """Publishes a message; False if subscribers are so late that there is no room."""
        return self._writer is not None and write(self._writer, data, log_time)

    def has_subscribers(self) -> bool:
        """True if somebody listens."""
        return self._writer is not None and bool(self._writer.get_matched_subscriptions())

    def close(self) -> None:
        """Ends the topic."""
        self._withdraw()
        self._writer = None


def qos_of(topic: Topic) -> Qos:
    """The quality of service with which a topic is published."""
    from cyclonedds.core import Policy, Qos

    durability = Policy.Durability
    return Qos(
        Policy.Reliability.Reliable(max_blocking_time=0),
        durability.TransientLocal if topic.is_latched else durability.Volatile,
        Policy.History.KeepLast(topic.depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(data=f"typehash={topic.type.hash};".encode()),
    )


def write(writer: DataWriter[IdlStruct], data: bytes, log_time: int | None) -> bool:
    """Writes a message that is in CDR already; False if there is no room for it."""
    from cyclonedds.core import DDSException

    sample = object.__new__(writer.data_type)
    sample.serialize = lambda **_: data  # type: ignore[method-assign]
    try:
        writer.write(sample, log_time)
    except DDSException as error:
        if error.code != DDSException.DDS_RETCODE_TIMEOUT:
            raise
        return False
    return True


# ---- which node has which topics ----

GRAPH_TYPE = MessageType(
    "rmw_dds_common/msg/ParticipantEntitiesInfo",
    {
        "rmw_dds_common/msg/ParticipantEntitiesInfo": (
            Field("gid", "rmw_dds_common/msg/Gid"),
            Field("node_entities_info_seq", "rmw_dds_common/msg/NodeEntitiesInfo", 0),
        ),
        "rmw_dds_common/msg/NodeEntitiesInfo": (
            Field("node_namespace", "string"),
            Field("node_name", "string"),
            Field("reader_gid_seq", "rmw_dds_common/msg/Gid", 0),
            Field("writer_gid_seq", "rmw_dds_common/msg/Gid", 0),
        ),
        "rmw_dds_common/msg/Gid": (Field("data", "uint8", GID_SIZE),),
    },
)
"""The type of the topic on which nodes say what they have (since ROS 2 Iron)."""


def graph_message(participant: bytes, namespace: str, node: str, writers: list[bytes]) -> bytes:
    """What a participant with one node tells others, in CDR."""
    message = bytearray(b"\x00\x01\x00\x00")

    def add_number(number: int) -> None:
        message.extend(bytes(-len(message) % 4))
        message.extend(number.to_bytes(4, "little"))

    def add_text(text: str) -> None:
        add_number(len(text.encode()) + 1)
        message.extend(text.encode() + b"\0")

    message.extend(participant)
    add_number(1)
    add_text(namespace)
    add_text(node)
    add_number(0)
    add_number(len(writers))
    for writer in writers:
        message.extend(writer)
    return bytes(message)
