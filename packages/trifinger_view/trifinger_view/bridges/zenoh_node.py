# SPDX-License-Identifier: BSD-3-Clause
"""A node of ROS 2 on Zenoh, as rmw_zenoh makes it, with Zenoh's Python package."""

from __future__ import annotations

import hashlib
import json
import struct
from typing import TYPE_CHECKING

from trifinger import extras
from trifinger.errors import Error

from trifinger_view.bridges.message_types import dds_name
from trifinger_view.bridges.ros2 import NODE, Publisher, Topic

if TYPE_CHECKING:
    import zenoh
    import zenoh.ext

ROUTER = "tcp/localhost:7447"
"""Where rmw_zenoh's router listens."""
NODE_ID = 0


class ZenohNode:
    """A node of ROS 2 on Zenoh. It listens nowhere but on this machine, and connects to a router.

    Without a router it tries again until there is one.
    """

    def __init__(self, namespace: str, domain: int = 0, router: str = ROUTER) -> None:
        """Begins a node; raises Error if a package is missing or the address is none."""
        extras.require("trifinger-view[ros2]", "zenoh")
        import zenoh

        config = zenoh.Config()
        settings: dict[str, object] = {
            "mode": "peer",
            "connect/endpoints": [router],
            "connect/timeout_ms": -1,  # tries without end, beside everything else
            "connect/exit_on_failure": False,
            "connect/retry": {"period_init_ms": 250, "period_max_ms": 2000},
            "listen/endpoints": ["tcp/127.0.0.1:0"],
            "scouting/multicast/enabled": False,
            # Without timestamps nothing is kept for subscribers that come later.
            "timestamping/enabled": True,
        }
        try:
            for key, value in settings.items():
                config.insert_json5(key, json.dumps(value))
            self._session = zenoh.open(config)
        except zenoh.ZError as error:
            raise Error(f"cannot begin a session of Zenoh with {router}: {error}") from None
        self._domain = domain
        self._namespace = namespace
        self._entities = NODE_ID
        self._token = self._session.liveliness().declare_token(self._node_key("NN", NODE_ID))

    def advertise(self, topic: Topic) -> Publisher:
        """Begins a topic."""
        import zenoh
        import zenoh.ext

        self._entities += 1
        name, type_hash = dds_name(topic.type.name), topic.type.hash
        key = f"{self._domain}/{topic.name.strip('/')}/{name}/{type_hash}"
        # Subscribers that are too slow lose messages; the bridge does not wait for them.
        drop = zenoh.CongestionControl.DROP
        publisher: zenoh.Publisher | zenoh.ext.AdvancedPublisher
        if topic.is_latched:
            publisher = zenoh.ext.declare_advanced_publisher(
                self._session,
                key,
                congestion_control=drop,
                cache=zenoh.ext.CacheConfig(max_samples=topic.depth),
                publisher_detection=True,
            )
        else:
            publisher = self._session.declare_publisher(key, congestion_control=drop)
        token_key = "/".join(
            (
                self._node_key("MP", self._entities),
                mangled(topic.name),
                name,
                type_hash,
                qos_text(topic),
            )
        )
        token = self._session.liveliness().declare_token(token_key)
        return ZenohPublisher(publisher, token, gid_of(token_key))

    def close(self) -> None:
        """Ends the node."""
        self._token.undeclare()
        self._session.close()

    def _node_key(self, kind: str, entity: int) -> str:
        zid = self._session.info.zid()
        return "/".join(
            (
                f"@ros2_lv/{self._domain}/{zid}/{NODE_ID}/{entity}/{kind}",
                "%",  # enclave
                mangled(self._namespace),
                NODE,
            )
        )


class ZenohPublisher:
    """Publishes messages of one topic on Zenoh."""

    def __init__(
        self,
        publisher: zenoh.Publisher | zenoh.ext.AdvancedPublisher,
        token: zenoh.LivelinessToken,
        gid: bytes,
    ) -> None:
        """`token` tells others of the topic."""
        self._publisher = publisher
        self._token = token
        self._gid = gid
        self._count = 0

    def publish(self, data: bytes, log_time: int) -> bool:
        """Publishes a message."""
        self._count += 1
        self._publisher.put(data, attachment=attachment(self._count, log_time, self._gid))
        return True

    def has_subscribers(self) -> bool:
        """True if somebody listens."""
        # Zenoh does not know it of a publisher that keeps messages.
        status = getattr(self._publisher, "matching_status", None)
        return status is None or bool(status.matching)

    def close(self) -> None:
        """Ends the topic."""
        self._token.undeclare()
        self._publisher.undeclare()  # type: ignore[no-untyped-call]


def mangled(name: str) -> str:
    """A name with slashes as one part of a key."""
    return name.replace("/", "%") or "%"


def qos_text(topic: Topic) -> str:
    """The quality of service of a topic; what is usual stays empty."""
    return f":{'1' if topic.is_latched else ''}:,{topic.depth}:,:,:,,"


def gid_of(token: str) -> bytes:
    """The id of a publisher, 16 bytes."""
    return hashlib.blake2b(token.encode(), digest_size=16).digest()


def attachment(sequence: int, log_time: int, gid: bytes) -> bytes:
    """What rmw_zenoh expects beside each message: number, time since 1970 [ns], publisher."""
    return struct.pack("<qqB", sequence, log_time, len(gid)) + gid
