# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger bridge`."""

import argparse
import asyncio
import os
import secrets
import signal
import sys
import threading
from collections.abc import Coroutine, Sequence

from trifinger.commands.command_line import ArgumentParser, add_robot, run, say
from trifinger.errors import InvalidArgument

from trifinger_view.bridges.dds import DdsNode
from trifinger_view.bridges.foxglove import LOOPBACK, FoxgloveOptions, FoxgloveServer
from trifinger_view.bridges.ros2 import NODE, Node, Ros2Bridge, Ros2Options, namespace_of
from trifinger_view.bridges.zenoh_node import ROUTER, ZenohNode

EXAMPLES = """Example:
  trifinger bridge foxglove sim       then open ws://localhost:8765 in Foxglove
  trifinger bridge ros2 sim           then 'ros2 topic list' on this machine"""


def add_rates(parser: ArgumentParser) -> None:
    """Adds the robot, and how much of it is shown."""
    options = FoxgloveOptions()
    add_robot(parser, waits=True)
    parser.add_argument(
        "--rate",
        type=float,
        default=options.rate,
        metavar="HZ",
        help="steps, and elements of each companion, per second of the robot's time; 0: all; "
        f"default: {options.rate:g}",
    )
    parser.add_argument(
        "--viewer-rate",
        type=float,
        default=options.viewer_rate,
        metavar="HZ",
        help=f"poses of links and joints per second; 0: none; default: {options.viewer_rate:g}",
    )
    parser.add_argument(
        "--jpeg-quality",
        type=int,
        default=options.jpeg_quality,
        metavar="1..100",
        help=f"of images; default: {options.jpeg_quality}",
    )


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(
        prog="trifinger bridge",
        description="Show a running robot in other programs, live. The robot notices nothing.",
        epilog=EXAMPLES,
    )
    bridges = parser.add_subparsers(dest="bridge", required=True, metavar="PROGRAM")
    foxglove = bridges.add_parser(
        "foxglove",
        help="serve all series to Foxglove",
        description="Serve all series, poses and images of a robot to Foxglove.",
    )
    add_rates(foxglove)
    add_foxglove_options(foxglove)
    ros2 = bridges.add_parser(
        "ros2",
        help="publish all series as a node of ROS 2, without ROS installed",
        description="Publish all series, poses and images of a robot as a node of ROS 2. ROS need "
        "not be installed here.",
    )
    add_rates(ros2)
    add_ros2_options(ros2)
    return parser.parse_args(words)


def add_foxglove_options(foxglove: argparse.ArgumentParser) -> None:
    """Adds where to listen, and who may connect."""
    options = FoxgloveOptions()
    foxglove.add_argument(
        "--host",
        default=options.host,
        help="address to listen at; others than this machine's own need a token, which is made "
        f"and printed; default: {options.host}",
    )
    foxglove.add_argument(
        "--port", type=int, default=options.port, help=f"0: any; default: {options.port}"
    )
    foxglove.add_argument(
        "--token", default="", help="clients connect to ws://HOST:PORT/?token=TOKEN"
    )
    foxglove.add_argument(
        "--origin",
        action="append",
        default=[],
        metavar="URL",
        help="a web site that may connect besides Foxglove's; may be given several times",
    )


def add_ros2_options(ros2: argparse.ArgumentParser) -> None:
    """Adds the middleware, and the node's place in its network."""
    ros2.add_argument(
        "--rmw",
        choices=("dds", "zenoh"),
        default="dds",
        help="the middleware: dds for rmw_cyclonedds and others, zenoh for rmw_zenoh; default: dds",
    )
    ros2.add_argument(
        "--domain",
        type=int,
        metavar="N",
        help="default: $ROS_DOMAIN_ID, or 0",
    )
    ros2.add_argument(
        "--namespace",
        metavar="/NAME",
        help="of node and topics; '/' for none; default: the robot's name",
    )
    ros2.add_argument(
        "--network",
        action="store_true",
        help="dds: meet programs of other machines, too, as $CYCLONEDDS_URI says. Everybody there "
        "sees the robot",
    )
    ros2.add_argument(
        "--router",
        metavar="ENDPOINT",
        help=f"zenoh: the router to connect to; default: {ROUTER}",
    )


def until_signal(work: Coroutine[None, None, None]) -> None:
    """Runs `work` until it ends, or until Ctrl-C or a request to terminate."""

    async def main() -> None:
        task = asyncio.ensure_future(work)
        loop = asyncio.get_running_loop()
        for one in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(one, task.cancel)
        try:
            await task
        except asyncio.CancelledError:
            return

    asyncio.run(main())


def report(text: str) -> None:
    """Prints a sentence about robot or clients."""
    say(text, file=sys.stderr, flush=True)


def serve_foxglove(arguments: argparse.Namespace) -> None:
    """`trifinger bridge foxglove`."""
    token = arguments.token
    if arguments.host not in LOOPBACK and not token:
        token = secrets.token_urlsafe(16)
    server = FoxgloveServer(
        arguments.robot,
        FoxgloveOptions(
            host=arguments.host,
            port=arguments.port,
            token=token,
            origins=tuple(arguments.origin),
            rate=arguments.rate,
            viewer_rate=arguments.viewer_rate,
            jpeg_quality=arguments.jpeg_quality,
        ),
        report,
    )

    def ready() -> None:
        say(f"Serves {arguments.robot} at {server.url}", flush=True)
        say("In Foxglove: Open connection, Foxglove WebSocket, and this address.", flush=True)
        if arguments.host not in LOOPBACK:
            report(
                "Everybody who knows this address sees the robot. The connection is not encrypted: "
                "for networks of others, use SSH (docs/bridges.md)."
            )

    until_signal(server.serve(ready))


def node_of(arguments: argparse.Namespace, namespace: str) -> Node:
    """The node on the middleware that the options chose; raises Error."""
    domain = arguments.domain
    if domain is None:
        text = os.environ.get("ROS_DOMAIN_ID") or "0"
        if not text.isdecimal():
            raise InvalidArgument(f"ROS_DOMAIN_ID is {text!r}; it must be a number")
        domain = int(text)
    if arguments.rmw == "dds":
        if arguments.router:
            raise InvalidArgument("--router is for --rmw zenoh")
        return DdsNode(namespace, domain, arguments.network)
    if arguments.network:
        raise InvalidArgument("--network is for --rmw dds; for zenoh, name a router: --router")
    return ZenohNode(namespace, domain, arguments.router or ROUTER)


def publish_ros2(arguments: argparse.Namespace) -> None:
    """`trifinger bridge ros2`."""
    namespace = namespace_of(arguments.robot, arguments.namespace)
    bridge = Ros2Bridge(
        arguments.robot,
        node_of(arguments, namespace),
        Ros2Options(
            namespace=namespace,
            rate=arguments.rate,
            viewer_rate=arguments.viewer_rate,
            jpeg_quality=arguments.jpeg_quality,
        ),
        report,
    )
    stop = threading.Event()
    for one in (signal.SIGINT, signal.SIGTERM):
        signal.signal(one, lambda *_: stop.set())
    where = namespace.rstrip("/")
    say(f"Publishes {arguments.robot} as the node {where}/{NODE}.", flush=True)
    if arguments.network:
        report("Everybody in this network sees the robot: DDS has no password.")
    bridge.run(stop)


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger bridge`."""
    arguments = parse(words)
    work = {"foxglove": serve_foxglove, "ros2": publish_ros2}[arguments.bridge]
    return run(lambda: work(arguments))
