# SPDX-License-Identifier: BSD-3-Clause
"""Publishes a running robot as a node of ROS 2 would, without ROS installed.

The messages are those of a log (docs/log_format.md), byte for byte. docs/bridges.md lists topics
and qualities of service.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from threading import Event
from typing import Protocol

from trifinger._trifinger import LiveChannel, LiveMessage, LiveMessages
from trifinger.errors import InvalidArgument

from trifinger_view.bridges.message_types import MessageType, parse

NODE = "trifinger_bridge"
GLOBAL_TOPICS = {"tf": "/tf", "tf_static": "/tf_static"}
"""Topics that all robots share; their frames have the robot's name."""
POLL_PERIOD = 0.02
"""Time between two looks at the robot [s]."""
SLOW_PERIOD = 0.5
"""Time between two looks at who listens, and between two sentences about lost messages [s]."""

Report = Callable[[str], None]
"""Takes a sentence for people."""


@dataclass(frozen=True)
class Ros2Options:
    """How a robot is shown to ROS 2."""

    namespace: str | None = None
    """Namespace of node and topics; None: that of the robot, "/sim"; "/": none."""
    rate: float = 100.0
    """Steps, and elements of each companion, per second of the robot's time; 0: all."""
    viewer_rate: float = 30.0
    """Poses of links per second of the robot's time; 0: none."""
    jpeg_quality: int = 80
    """Quality of images, 1 to 100."""


@dataclass(frozen=True)
class Topic:
    """A topic of ROS 2. It is reliable and keeps the last `depth` messages."""

    name: str
    type: MessageType
    is_latched: bool = False
    """Who subscribes later gets what was kept ("transient local")."""
    depth: int = 10


class Publisher(Protocol):
    """Publishes messages of one topic. It never waits."""

    def publish(self, data: bytes, log_time: int) -> bool:
        """Publishes a message in CDR of this time since 1970 [ns]; False if it was lost."""

    def has_subscribers(self) -> bool:
        """True if somebody listens."""

    def close(self) -> None:
        """Ends the topic."""


class Node(Protocol):
    """A node of ROS 2 with its publishers, on some middleware."""

    def advertise(self, topic: Topic) -> Publisher:
        """Begins a topic."""

    def close(self) -> None:
        """Ends the node. Its publishers were closed."""


class Ros2Bridge:
    """Publishes one robot, and the robots that follow under its name, on a node.

    The bridge only observes: the robot notices nothing, whatever subscribers do.
    """

    def __init__(
        self, robot: str, node: Node, options: Ros2Options | None = None, report: Report = print
    ) -> None:
        """Prepares to publish `robot`, which need not run yet; raises InvalidArgument.

        The bridge closes the node. `report` gets sentences about the robot.
        """
        self.robot = robot
        self.options = options or Ros2Options()
        self.namespace = namespace_of(robot, self.options.namespace)
        self.lost = 0
        """Messages that were lost between robot and subscribers."""
        self._node = node
        self._report = report
        self._live = LiveMessages(
            robot,
            rate=self.options.rate,
            viewer_rate=self.options.viewer_rate,
            jpeg_quality=self.options.jpeg_quality,
        )
        self._known = 0
        self._topics: dict[int, Topic] = {}
        self._publishers: dict[int, Publisher] = {}
        self._camera_infos: dict[str, bytes] = {}  # by topic
        self._told = 0
        self._next_slow_look = 0.0

    @property
    def topics(self) -> Sequence[Topic]:
        """The topics that are published now."""
        return tuple(self._topics[number] for number in self._publishers)

    def run(self, stop: Event) -> None:
        """Publishes in the calling thread until `stop` is set. Then it ends the node."""
        try:
            while not stop.wait(POLL_PERIOD):
                self.pump()
        finally:
            self.close()

    def pump(self) -> None:
        """Publishes what is new. `run` calls this."""
        batch = self._live.take()
        self._declare(self._live.channels)
        lost = batch.lost
        for message in batch.messages:
            lost += 0 if self._publish(message) else 1
        self.lost += lost
        for event in batch.events:
            self._report(f"{event.source}: {event.text}")
        self._look_slowly()

    def close(self) -> None:
        """Ends all topics and the node."""
        for publisher in self._publishers.values():
            publisher.close()
        self._publishers.clear()
        self._node.close()

    def _declare(self, channels: Sequence[LiveChannel]) -> None:
        for number, channel in enumerate(channels[self._known :], start=self._known):
            topic = self._topic_of(channel)
            for other, old in self._topics.items():
                if old.name == topic.name and other in self._publishers:
                    self._publishers.pop(other).close()
            self._topics[number] = topic
            self._publishers[number] = self._node.advertise(topic)
        self._known = len(channels)

    def _topic_of(self, channel: LiveChannel) -> Topic:
        message_type = parse(channel.type, channel.definition)
        if channel.topic == "/events":
            return Topic("/rosout", message_type, is_latched=True, depth=1000)
        name = channel.topic.removeprefix(f"/{self.robot}/")
        if name in GLOBAL_TOPICS:
            # The frames of the robot and those of its cameras are messages of their own.
            depth = 10 if channel.is_latched else 100
            return Topic(GLOBAL_TOPICS[name], message_type, channel.is_latched, depth)
        if channel.is_image and channel.type.endswith("/CompressedImage"):
            name += "/compressed"
        # Who looks at images expects the camera's parameters beside each image.
        is_info = channel.type.endswith("/CameraInfo")
        is_latched = channel.is_latched and not is_info
        full = f"{self.namespace.rstrip('/')}/{name}"
        return Topic(full, message_type, is_latched, 1 if is_latched else 10)

    def _publish(self, message: LiveMessage) -> bool:
        data = message.data
        publisher = self._publishers.get(message.channel)
        if publisher is None:
            return True
        channel = self._live.channels[message.channel]
        if channel.type.endswith("/CameraInfo"):
            self._camera_infos[channel.topic] = data
        elif channel.is_image:
            self._publish_camera_info(channel.topic, data, message.log_time)
        return publisher.publish(data, message.log_time)

    def _publish_camera_info(self, topic: str, image: bytes, log_time: int) -> None:
        info_topic = topic.removesuffix("image") + "camera_info"
        info = self._camera_infos.get(info_topic)
        for number, publisher in self._publishers.items():
            if info is not None and self._live.channels[number].topic == info_topic:
                # Both begin with the header of CDR and the stamp, eight bytes.
                publisher.publish(info[:4] + image[4:12] + info[12:], log_time)

    def _look_slowly(self) -> None:
        now = time.monotonic()
        if now < self._next_slow_look:
            return
        self._next_slow_look = now + SLOW_PERIOD
        channels = self._live.channels
        self._live.want_images(
            any(
                publisher.has_subscribers()
                for number, publisher in self._publishers.items()
                if channels[number].is_image
            )
        )
        if self.lost > self._told:
            self._report(
                f"{self.lost - self._told} messages were lost: the robot is faster than this "
                "bridge, or a subscriber is too slow"
            )
            self._told = self.lost


def namespace_of(robot: str, namespace: str | None) -> str:
    """The namespace of a robot's topics; raises InvalidArgument if ROS 2 does not allow it."""
    name = f"/{robot}" if namespace is None else namespace
    if not re.fullmatch(r"/|(/[A-Za-z_]\w*)+", name, re.ASCII):
        raise InvalidArgument(
            f"{name!r} cannot be a namespace of ROS 2, which looks like /sim or /lab/sim; "
            "--namespace sets another"
        )
    return name
