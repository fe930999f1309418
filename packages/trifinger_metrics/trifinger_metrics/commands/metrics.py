# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger metrics`."""

import argparse
import shutil
import signal
import sys
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from trifinger import list_sessions, running_robot
from trifinger.commands.command_line import ArgumentParser, run, say
from trifinger.errors import Error
from trifinger.extras import require
from trifinger.niceness import be_nice

HOST, PORT = "127.0.0.1", 9477
ABOUT = """Serve the state of robots, recorders, cameras and jobs to Prometheus. The robots notice
nothing."""
EXAMPLES = """Example:
  trifinger metrics                   then 'curl http://127.0.0.1:9477/metrics'"""


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(prog="trifinger metrics", description=ABOUT, epilog=EXAMPLES)
    add = parser.add_argument
    robots = "robots; default: all of this machine, also those that start later"
    add("names", nargs="*", metavar="NAME", help=robots)
    add("--host", default=HOST, help=f"address to listen at; 0.0.0.0: all; default: {HOST}")
    add("--port", type=int, default=PORT, help=f"0: any; default: {PORT}")
    logs = "a folder with logs, besides those of running recorders; default: the usual one"
    jobs = "a folder with the folders of jobs, of which the reports are counted"
    for name, text in (("--logs", logs), ("--jobs", jobs)):
        text += "; may be given several times"
        add(name, type=Path, action="append", default=[], metavar="FOLDER", help=text)
    files = "write a dashboard for Grafana and alert rules for Prometheus there, and end"
    add("--write-files", type=Path, metavar="FOLDER", help=files)
    return parser.parse_args(words)


def write_files(folder: Path) -> None:
    """Copies the dashboard and the alert rules."""
    folder.mkdir(parents=True, exist_ok=True)
    with resources.as_file(resources.files("trifinger_metrics") / "for_prometheus") as source:
        for path in sorted(source.iterdir()):
            say(shutil.copyfile(path, folder / path.name))


def serve(arguments: argparse.Namespace) -> None:
    """Serves until Ctrl-C or a request to terminate; raises Error."""
    require("trifinger-metrics", "prometheus_client")
    from prometheus_client import CollectorRegistry, start_http_server

    from trifinger_metrics.collector import Collector
    from trifinger_metrics.files import default_log_folder

    known = {info.name for info in list_sessions() if not info.is_companion}
    for name in arguments.names:
        if name not in known:  # one whose back-end has died is known
            running_robot(name)  # raises what is wrong
    logs = arguments.logs or [default_log_folder()]
    registry = CollectorRegistry()
    registry.register(Collector(arguments.names, logs, arguments.jobs, report))
    ends = {signal.SIGINT, signal.SIGTERM}
    signal.pthread_sigmask(signal.SIG_BLOCK, ends)  # for the threads of the server, too
    be_nice()
    try:
        server, _ = start_http_server(arguments.port, arguments.host, registry)
    except (OSError, OverflowError) as error:
        why = error.strerror if isinstance(error, OSError) else "it must be 0 to 65535"
        place = f"{arguments.host}, port {arguments.port}"
        raise Error(f"cannot listen at {place}: {why}; --port and --host choose another") from None
    say(f"Serves http://{arguments.host}:{server.server_port}/metrics", flush=True)
    signal.sigwait(ends)
    server.shutdown()


def report(sentence: str) -> None:
    """Prints what could not be read."""
    say(sentence, file=sys.stderr, flush=True)


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger metrics`."""
    arguments = parse(words)
    if arguments.write_files is not None:
        return run(lambda: write_files(arguments.write_files))
    return run(lambda: serve(arguments))
