# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger bridge`."""

import argparse
import asyncio
import secrets
import signal
import sys
from collections.abc import Coroutine, Sequence

from trifinger.bridges.foxglove import LOOPBACK, FoxgloveOptions, FoxgloveServer
from trifinger.commands.command_line import run

EXAMPLES = """Examples:
  trifinger bridge foxglove sim       then open ws://localhost:8765 in Foxglove
  trifinger bridge ros2 sim           then 'ros2 topic list' on this machine"""


def add_rates(parser: argparse.ArgumentParser) -> None:
    """Adds the robot, and how much of it is shown."""
    options = FoxgloveOptions()
    parser.add_argument("name", nargs="?", default="sim", help="the robot; default: sim")
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
    parser = argparse.ArgumentParser(
        prog="trifinger bridge",
        description="Show a running robot in other programs, live. The robot notices nothing.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    bridges = parser.add_subparsers(dest="bridge", required=True, metavar="PROGRAM")
    options = FoxgloveOptions()
    foxglove = bridges.add_parser(
        "foxglove",
        help="serve all series to Foxglove",
        description="Serve all series, poses and images of a robot to Foxglove.",
    )
    add_rates(foxglove)
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
    return parser.parse_args(words)


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


def tell(text: str) -> None:
    """Prints a sentence about robot or clients."""
    print(text, file=sys.stderr, flush=True)


def serve_foxglove(arguments: argparse.Namespace) -> None:
    """`trifinger bridge foxglove`."""
    token = arguments.token
    if arguments.host not in LOOPBACK and not token:
        token = secrets.token_urlsafe(16)
    server = FoxgloveServer(
        arguments.name,
        FoxgloveOptions(
            host=arguments.host,
            port=arguments.port,
            token=token,
            origins=tuple(arguments.origin),
            rate=arguments.rate,
            viewer_rate=arguments.viewer_rate,
            jpeg_quality=arguments.jpeg_quality,
        ),
        tell,
    )

    def ready() -> None:
        print(f"Serves {arguments.name} at {server.url}", flush=True)
        print("In Foxglove: Open connection, Foxglove WebSocket, and this address.", flush=True)
        if arguments.host not in LOOPBACK:
            tell(
                "Everybody who knows this address sees the robot. The connection is not encrypted: "
                "for networks of others, use SSH (docs/bridges.md)."
            )

    until_signal(server.serve(ready))


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger bridge`."""
    arguments = parse(words)
    return run(lambda: serve_foxglove(arguments))
