# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger view`."""

import argparse
import contextlib
import getpass
import os
import socket
import sys
import time
import webbrowser
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from trifinger import extras
from trifinger._trifinger import observe, running_robot
from trifinger.commands.command_line import (
    ArgumentParser,
    ended_by_signals,
    names_of_robots,
    run,
    say,
)
from trifinger.errors import InvalidArgument, RobotStopped, SessionNotFound
from trifinger.log.plot.panels import GROUPS
from trifinger.niceness import be_nice

from trifinger_view import PAGE
from trifinger_view.authentication import GLANCE, LOOPBACK, Authentication
from trifinger_view.commands.options import add_frames
from trifinger_view.logged import LoggedRun
from trifinger_view.page_controller import PageController, pullable
from trifinger_view.to_browser import Document

RATE = 40.0  # of pictures [Hz]
IDLE_RATE = 5.0  # without a browser
TOKEN_VARIABLE = "TRIFINGER_VIEW_TOKEN"  # noqa: S105 (the name of a variable)


@dataclass(frozen=True)
class PageOptions:
    """How to serve a page."""

    authentication: Authentication
    opens_browser: bool
    is_plain: bool  # without shadows
    training: Path | None  # the folder of one on the robot


def is_log(text: str) -> bool:
    """Whether a word on the command line is a log, and not the name of a robot."""
    return text.endswith(".mcap") or os.sep in text or (text != "" and Path(text).is_dir())


def show(
    page_title: str,
    options: PageOptions,
    begin: Callable[..., Callable[[bool], None]],
    controller: PageController | None = None,
    note: str = "",
    document: Document | None = None,
    rate: float = RATE,
) -> None:
    """Serves a page until Ctrl-C. `begin` makes the page and returns what renews it.

    `note` is a sentence for the terminal, `document` another page than that of a robot or a log,
    and `rate` how often the page is renewed while somebody looks [Hz].
    """
    from trifinger_view.page import Page, document_of
    from trifinger_view.page_server import PageServer

    authentication = options.authentication
    controls = controller is not None and controller.with_guide
    if controller is None:  # the thread of a guide would inherit this
        be_nice()
    robot = page_title if controls else ""
    is_fleet = document is not None
    document = document or document_of(page_title, robot=robot, is_plain=options.is_plain)
    with contextlib.closing(authentication):
        server = PageServer(authentication, document)
        page = Page(server)
        renew = begin(page)
        print_address(authentication, controls=controls, note=note, is_fleet=is_fleet)
        if options.opens_browser:
            webbrowser.open(authentication.url)
        following = time.monotonic()
        try:
            while True:
                is_watched = bool(server.browsers)
                renew(is_watched)
                following += 1.0 / min(rate, RATE if is_watched else IDLE_RATE)
                pause = following - time.monotonic()
                if pause > 0:
                    time.sleep(pause)
                else:  # the machine is busy: leave pictures out
                    following = time.monotonic()
        finally:
            server.stop()


def print_address(
    authentication: Authentication,
    *,
    controls: bool = False,
    note: str = "",
    is_fleet: bool = False,
) -> None:
    """Says how to open the page, and what its end does to a robot that it controls or not."""
    robots, do = ("the robots", "do") if is_fleet else ("the robot", "does")
    say(f"Open {authentication.url}")
    if not authentication.is_local:
        does = "moves" if controls else "sees"
        say(
            f"Who has this address {does} {robots}; it crosses the network unencrypted.",
            file=sys.stderr,
        )
    elif os.environ.get("SSH_CONNECTION"):
        words = os.environ["SSH_CONNECTION"].split()
        host = words[2] if len(words) == 4 else socket.gethostname()
        say(
            "From the machine that you came from, first:\n"
            f"  ssh -L {authentication.port}:{LOOPBACK}:{authentication.port} "
            f"{getpass.getuser()}@{host}"
        )
    if note:
        say(note)
    end = "the session of the robot ends with it" if controls else f"{robots} {do} not notice"
    say(f"Ctrl-C ends the page; {end}.", flush=True)


def show_robot(name: str, options: PageOptions, controller: PageController | None = None) -> None:
    """Shows a running robot, or the next one that runs.

    With a controller, the page can steer it.
    """
    from trifinger_view.control_panel import ControlPanel, add_stop
    from trifinger_view.glance import Glance
    from trifinger_view.live import LiveRun
    from trifinger_view.page import Page
    from trifinger_view.words import facts_of, lines_of_training

    live, glance = LiveRun(name), Glance()
    options.authentication.sockets.add(GLANCE)
    if controller is not None and controller.with_guide:
        add_stop(options.authentication, name)

    def begin(page: Page) -> Callable[[bool], None]:
        shown: dict[str, object] = {"session": None, "lines": None}
        page.begin(None, name or "TriFinger")
        page.show_state(live.lines)
        panel = None if controller is None else ControlPanel(page.server, controller)

        def renew(is_watched: bool) -> None:
            is_due = glance.is_due()
            is_seen = is_watched or (is_due and page.server.is_glanced_at)
            live.look(with_images=is_seen)
            if live.session_id != shown["session"]:
                shown["session"] = live.session_id
                if live.info is not None:
                    page.begin(live.scene, live.info.name, facts_of(live.info))
                if panel is not None:
                    panel.begin(live)
            if panel is not None:
                panel.renew(live)
            if live.frame is not None:
                page.show(live.frame)
                if is_seen and not is_watched:
                    page.show_images(live.frame.images)
            if is_due:
                lines = live.lines + lines_of_training(options.training)
                page.server.put("glance", glance.message(live, lines))
            if live.lines is not shown["lines"]:
                shown["lines"] = live.lines
                page.show_state(live.lines + lines_of_training(options.training))
                if live.frame is not None and is_watched:
                    page.show_images(live.frame.images)
                groups = GROUPS.get(live.info.type, ()) if live.info is not None else ()
                page.show_curves(live.window, groups)

        return renew

    show(name or "TriFinger", options, begin, controller, note_of_missing(name))


def note_of_missing(name: str) -> str:
    """Says that the page waits for the robot `name`, or for any, if none runs; otherwise empty."""
    running = names_of_robots()
    if name in running or (running and not name):
        return ""
    others = f"; there is {' and '.join(running)}" if running else ""
    start = f"'trifinger run {name or 'sim'}' starts it"
    return f"No robot{f' {name!r}' if name else ''} runs{others}. The page waits for it; {start}."


def steer_robot(
    name: str, options: PageOptions, *, with_guide: bool, frames: Sequence[str] = ()
) -> None:
    """Shows a robot with a panel that steers it, or that pulls at it in simulation."""
    if not with_guide:
        require_hand(name)
    controller = PageController(name, with_guide=with_guide, frames=frames)
    with ended_by_signals(), contextlib.closing(controller):
        with contextlib.suppress(SessionNotFound, RobotStopped):  # the page says so and waits
            controller.connect()
        show_robot(name, options, controller)


def require_hand(name: str) -> None:
    """Raises InvalidArgument if a robot runs that no hand can ever pull.

    A robot that does not run yet may be another one later; then the page says what it can.
    """
    with contextlib.suppress(SessionNotFound, RobotStopped):
        if not pullable(observe(name)):
            raise InvalidArgument(
                f"robot '{name}' cannot be pulled: --hand is for simulations that 'trifinger run' "
                f"runs. 'trifinger view {name}' shows it"
            )


def show_fleet(words: Sequence[str], arguments: argparse.Namespace) -> None:
    """Shows the robots whose pages have these addresses, or without any those of this machine."""
    from trifinger_view.fleet import Fleet, LocalRobots, addresses_of, fleet_document
    from trifinger_view.page import Page

    addresses = addresses_of(words)
    title = "Robots" if addresses else f"Robots of {socket.gethostname()}"
    with contextlib.ExitStack() as stack:

        def begin(page: Page) -> Callable[[bool], None]:
            page.server.kinds = ()  # each robot has kinds of its own
            if addresses:
                stack.enter_context(contextlib.closing(Fleet(page.server, addresses)))
                return lambda _: None
            robots = LocalRobots(page.server)
            return lambda _: robots.renew()

        document = fleet_document(title, is_plain=arguments.plain)
        show(title, page_options(arguments), begin, document=document, rate=1.0)


def show_log(run: LoggedRun, options: PageOptions) -> None:
    """Shows a log with a time line."""
    from trifinger_view.log_page import LogPage
    from trifinger_view.page import Page

    def begin(page: Page) -> Callable[[bool], None]:
        return LogPage(page, run).renew

    show(f"{run.session.name}, {run.log.files[0].name}", options, begin)


def write_log(arguments: argparse.Namespace) -> None:
    """Writes a log into one file for a browser."""
    from trifinger_view.html_file import write_html

    run = LoggedRun(arguments.what, arguments.robot, arguments.session)
    written = write_html(
        run, arguments.output, begin=arguments.from_, end=arguments.to, rate=arguments.rate
    )
    say(written)


def require_no_file_options(arguments: argparse.Namespace, what: str) -> None:
    """Raises InvalidArgument if options are given that only a file has."""
    for option, value in (
        ("--from", arguments.from_),
        ("--to", arguments.to),
        ("--rate", arguments.rate),
    ):
        if value is not None:
            raise InvalidArgument(f"{option} is for a file of a log: it needs {what}")


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(
        prog="trifinger view",
        description="Show a running robot or a log in a browser, on this machine alone.",
        epilog="Example:\n"
        "  trifinger view                     the robot that runs\n"
        "  trifinger view sim                 the robot 'sim', and its next sessions\n"
        "  trifinger view sim --control       the same, and the page steers the robot\n"
        "  trifinger view --fleet             all robots of this machine, at a glance\n"
        "  trifinger view logs                the newest log in a folder, with a time line\n"
        "  trifinger view logs -o run.html    a file that any browser shows, without this program",
    )
    parser.add_argument(
        "what",
        nargs="?",
        default="",
        metavar="NAME|LOG",
        help="a robot, or a log: a file or a folder; default: the only robot that runs",
    )
    parser.add_argument("--robot", metavar="NAME", default="", help="needed if a log has several")
    parser.add_argument(
        "--session",
        type=int,
        metavar="N|ID",
        help="of a log: number or id, as `trifinger log info` shows them; default: the newest",
    )
    parser.add_argument(
        "--control",
        action="store_true",
        help="control the robot NAME from the page; its safety checks apply as always",
    )
    add_frames(parser)
    parser.add_argument(
        "--hand",
        action="store_true",
        help="pull at tips and objects of the simulation NAME, whoever controls it",
    )
    parser.add_argument(
        "--training",
        type=Path,
        metavar="FOLDER",
        help="say how a training on the robot goes: the folder of `trifinger learn`",
    )
    parser.add_argument(
        "--plain",
        action="store_true",
        help="draw without shadows, for a browser without a graphics card",
    )
    parser.add_argument(
        "--fleet",
        nargs="*",
        metavar="ADDRESS|@FILE",
        help="many robots: addresses that `trifinger view` has printed, or a file with one in each "
        "line; default: all robots of this machine",
    )
    file = parser.add_argument_group("a file of a log")
    file.add_argument("-o", "--output", type=Path, metavar="FILE", help="write a page into a file")
    file.add_argument(
        "--from", dest="from_", type=float, metavar="SECONDS", help="begin, since the first step"
    )
    file.add_argument("--to", type=float, metavar="SECONDS", help="end, since the first step")
    file.add_argument("--rate", type=float, metavar="HZ", help="pictures per second; default: 30")
    add_server_options(parser)
    return parser.parse_args(words)


def add_server_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options that say who can see the page."""
    server = parser.add_argument_group("who can see the page")
    server.add_argument(
        "--host",
        default=LOOPBACK,
        metavar="ADDRESS",
        help=f"address to listen at; default: {LOOPBACK}, which only this machine reaches",
    )
    server.add_argument(
        "--port", type=int, metavar="PORT", help="default: the first free one from 8080"
    )
    server.add_argument(
        "--token",
        default=os.environ.get(TOKEN_VARIABLE, ""),
        help=f"secret part of the address; default: ${TOKEN_VARIABLE}, or chosen by chance",
    )
    server.add_argument("--no-browser", action="store_true", help="only print the address")


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger view`."""
    arguments = parse(words)
    return run(lambda: show_or_write(arguments))


def show_or_write(arguments: argparse.Namespace) -> None:
    """Shows a robot or a log, or writes a log into a file, as the arguments say."""
    steers = arguments.control or arguments.hand
    if arguments.fleet is not None:
        if steers or arguments.what or arguments.training or arguments.output:
            raise InvalidArgument("--fleet only shows, and takes addresses and no robot or log")
        require_no_file_options(arguments, "a log and -o")
        extras.require(*PAGE)
        show_fleet(arguments.fleet, arguments)
        return
    if arguments.frame and not arguments.control:
        raise InvalidArgument("--frame says what --control moves; it needs --control")
    if steers and is_log(arguments.what):
        option = "--control" if arguments.control else "--hand"
        raise InvalidArgument(
            f"{option} needs the name of a robot that runs: trifinger view sim {option}"
        )
    if steers or (not arguments.what and len(names_of_robots()) > 1):
        arguments.what = arguments.what or running_robot()
    if is_log(arguments.what):
        if arguments.output is not None:
            write_log(arguments)
            return
        require_no_file_options(arguments, "--output")
        extras.require(*PAGE)
        logged = LoggedRun(arguments.what, arguments.robot, arguments.session)
        show_log(logged, page_options(arguments))
        return
    if arguments.output is not None:
        raise InvalidArgument(
            f"-o needs a log: the path of a file, or of a folder with a '{os.sep}'"
        )
    require_no_file_options(arguments, "a log and -o")
    extras.require(*PAGE)
    if steers:
        steer_robot(
            arguments.what,
            page_options(arguments),
            with_guide=arguments.control,
            frames=arguments.frame,
        )
    else:
        show_robot(arguments.what, page_options(arguments))


def page_options(arguments: argparse.Namespace) -> PageOptions:
    """What the command line says about the page. Its socket listens from now on."""
    authentication = Authentication(arguments.host, arguments.port, arguments.token)
    return PageOptions(
        authentication, wants_browser(arguments), arguments.plain, arguments.training
    )


def wants_browser(arguments: argparse.Namespace) -> bool:
    """Whether to open a browser: on a screen of this machine, unless told otherwise."""
    has_screen = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return has_screen and not arguments.no_browser and not os.environ.get("SSH_CONNECTION")
