# SPDX-License-Identifier: BSD-3-Clause
"""What viewers of a running robot cost it, and how old the picture in a browser is."""

import contextlib
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import trifinger
from chromium import open_browser
from rows import Row
from trifinger_view.authentication import Authentication
from trifinger_view.commands import view as command
from trifinger_view.live import LiveRun
from trifinger_view.page import Page, document_of
from trifinger_view.page_server import PageServer
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

VIEWERS = 3
WINDOWS = 5  # measured in turn with and without viewers, which take seconds to start
COMMAND = "import sys; from trifinger_view.commands.view import main; sys.exit(main())"
SCENE_SIZE = 100_000  # bytes that a connection has got once it has the robot
# Notes the step of each picture and when the browser was ready to draw the next one [ms].
PROBE = """() => {
  const {scene} = window.trifingerPage, draw = scene.draw.bind(scene);
  let drawn = "", before = "";
  window.pictures = [];
  scene.draw = () => { draw(); drawn = document.body.dataset.step; };
  const look = () => {
    if (drawn !== before) {
      before = drawn;
      window.pictures.push([Number(drawn), performance.timeOrigin + performance.now()]);
    }
    requestAnimationFrame(look);
  };
  look();
}"""


@contextlib.contextmanager
def viewers(name: str) -> Iterator[list[int]]:
    """Runs `trifinger view` three times, each with a connection that reads all that it gets.

    Yields how many bytes each has got so far.
    """
    sizes = [0] * VIEWERS
    with contextlib.ExitStack() as stack:
        for number in range(VIEWERS):
            process = stack.enter_context(
                subprocess.Popen(
                    [sys.executable, "-c", COMMAND, name, "--no-browser"],
                    stdout=subprocess.PIPE,
                    text=True,
                )
            )
            stack.callback(process.kill)
            url = process.stdout.readline().split()[1] if process.stdout else ""
            host, _, token = url.removeprefix("http://").partition("/?token=")
            port = host.rpartition(":")[2]
            browser = connect(
                f"ws://{host}",
                origin=f"http://{host}",  # type: ignore[arg-type]
                additional_headers={"Cookie": f"trifinger_view_{port}={token}"},
                max_size=None,
                compression=None,
            )

            def read(browser: Any = browser, number: int = number) -> None:
                with contextlib.suppress(ConnectionClosed):
                    for message in browser:
                        sizes[number] += len(message)

            threading.Thread(target=read, daemon=True).start()
            # While the robot waits for its user, nothing comes after the scene.
            while sizes[number] < SCENE_SIZE:
                time.sleep(0.01)
        yield sizes


def lateness_row(name: str, rounds: Iterator[int], window: Callable[[], float]) -> Row:
    """How late a robot is with three viewers and without; `window` measures once [us]."""
    watched: list[float] = []
    alone: list[float] = []
    ratios = []
    for _ in rounds:
        with viewers(name):
            watched += [window() for _ in range(WINDOWS)]
        alone += [window() for _ in range(WINDOWS)]
        medians = [statistics.median(one[-WINDOWS:]) for one in (watched, alone)]
        ratios.append(medians[0] / medians[1])
    ratio = statistics.median(ratios)
    return Row.of(
        "1 kHz: lateness with three viewers, p99 of windows",
        watched,
        "us",
        reach="<= 1.2x",
        holds=ratio <= 1.2,
        reference="without viewers",
        reference_value=statistics.median(alone),
        ratio=ratio,
        remark="Three times `trifinger view`, each with a connection that reads all; drawing is "
        "left out, because a browser runs elsewhere or beside everything else",
    )


def picture_rows(name: str, *, is_quick: bool) -> list[Row]:
    """How old a state is when a browser has drawn it, and how many it draws in a second."""
    ages, rate = pictures_of(name, is_plain=True, is_quick=is_quick)
    age = float(np.quantile(ages, 0.95))
    _, lit = pictures_of(name, is_plain=False, is_quick=is_quick)
    remark = "Chromium without a graphics card, 480 x 320 pixels, on the same processors"
    return [
        Row(
            "from a state to its picture in a browser, p95",
            age,
            float(ages.min()),
            float(ages.max()),
            "ms",
            reach="<= 100 ms",
            holds=bool(age <= 100.0),
            remark=f"`--plain`; {remark}",
        ),
        Row(
            "pictures of a running robot in a browser",
            rate,
            rate,
            rate,
            "/s",
            reach=">= 30 /s",
            holds=bool(rate >= 30.0),
            remark=f"`--plain`; {remark}",
        ),
        Row(
            "the same with shadows, which need a graphics card",
            lit,
            lit,
            lit,
            "/s",
            reach="",
            holds=True,
            remark=remark,
        ),
    ]


def pictures_of(name: str, *, is_plain: bool, is_quick: bool) -> tuple[Any, float]:
    """Ages of the pictures that a browser draws [ms], and how many it draws in a second.

    Shadows take a processor long for each picture, so a quick look takes few.
    """
    seconds, pictures_at_least = (0.5, 3) if is_quick else (10.0, 6)
    authentication = Authentication(port=0)
    server = PageServer(authentication, document_of(name, is_plain=is_plain))
    page = Page(server)
    live = LiveRun(name)
    robot = trifinger.observe(name)
    measured: dict[int, int] = {}  # times of the steps that were sent [ns]
    is_over = threading.Event()

    def serve() -> None:
        session, following = None, time.monotonic()
        while not is_over.is_set():
            live.look()
            if live.session_id != session:
                session = live.session_id
                page.begin(live.scene, name)
            if live.frame is not None and live.frame.time_index >= 0:
                step = live.frame.time_index
                measured[step] = int(robot.get_status(step).time)
                page.show(live.frame)
            following = max(following + 1.0 / command.RATE, time.monotonic())
            time.sleep(max(following - time.monotonic(), 0.0))

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        with open_browser() as browser:
            tab = browser.new_page(viewport={"width": 480, "height": 320})
            tab.goto(authentication.url, timeout=0)
            tab.wait_for_selector("body[data-step]", timeout=0)
            if not is_plain:  # a browser without a graphics card leaves them out by itself
                tab.locator("#shadows").check()
            tab.evaluate(PROBE)
            tab.wait_for_timeout(1000 * seconds)
            while tab.evaluate("() => window.pictures.length") < pictures_at_least:
                tab.wait_for_timeout(100)
            pictures = np.array(tab.evaluate("() => window.pictures")[1:])
        offset = time.time() - time.monotonic()  # the browser knows only the time of day
        stamps = np.array([measured[int(step)] for step in pictures[:, 0]])
        ages = 1e3 * (pictures[:, 1] * 1e-3 - offset - stamps * 1e-9)
        rate = float((len(pictures) - 1) / (pictures[-1, 1] - pictures[0, 1]) * 1e3)
    finally:
        is_over.set()
        thread.join()
        server.stop()
        authentication.close()
    return ages, rate
