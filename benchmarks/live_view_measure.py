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

import msgspec.msgpack
import numpy as np
import trifinger
import viser
from chromium import open_browser
from rows import Row
from trifinger_view.authentication import Authentication, page_server
from trifinger_view.commands import view as command
from trifinger_view.live import LiveRun
from trifinger_view.page import Page, help_slow_browsers
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

VIEWERS = 3
WINDOWS = 5  # measured in turn with and without viewers, which take seconds to start
COMMAND = "import sys; from trifinger_view.commands.view import main; sys.exit(main())"
SCENE_SIZE = 100_000  # bytes that a connection has got once it has the robot
STAMP = "trifinger-stamp"
# Notes the stamp of each picture and when the browser was ready to draw the next one [ms].
PROBE = f"""() => {{
  window.pictures = [];
  let before = "";
  const look = () => {{
    const stamp = document.getElementById("{STAMP}")?.textContent ?? "";
    if (stamp !== before) {{
      before = stamp;
      const now = performance.timeOrigin + performance.now();
      window.pictures.push([Number(stamp), now]);
    }}
    requestAnimationFrame(look);
  }};
  look();
}}"""
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1, 0, 0, 0],
    "position": [0, 0, 1],
    "look_at": [0, 0, 0],
    "up_direction": [0, 0, 1],
    "fov": 1.0,
    "image_height": 100,
    "image_width": 100,
    "near": 0.1,
    "far": 9.0,
}


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
                subprotocols=[f"viser-v{viser.__version__}"],  # type: ignore[list-item]
                max_size=None,
                compression=None,
            )
            browser.send(msgspec.msgpack.encode(CAMERA))

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
            "the same with light and shadows, which need a graphics card",
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

    Light and shadows take a processor seconds for each picture, so a quick look takes few.
    """
    settling, seconds, pictures_at_least = (0, 0.5, 3) if is_quick else (10, 10.0, 6)
    authentication = Authentication(port=0)
    help_slow_browsers(authentication, is_plain=is_plain)
    page = Page(page_server(authentication, name), name, is_plain=is_plain)
    stamp = page.server.gui.add_html("", order=-1.0)
    live = LiveRun(name)
    robot = trifinger.observe(name)
    is_over = threading.Event()

    def serve() -> None:
        session, following = None, time.monotonic()
        while not is_over.is_set():
            live.look()
            if live.session_id != session:
                session = live.session_id
                page.begin(live.scene)
            if live.frame is not None:
                with page.server.atomic():
                    page.show(live.frame)
                    measured = robot.get_status(live.frame.time_index).time  # [ns]
                    stamp.content = f'<span id="{STAMP}">{measured}</span>'
            following = max(following + 1.0 / command.RATE, time.monotonic())
            time.sleep(max(following - time.monotonic(), 0.0))

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        with open_browser() as browser:
            tab = browser.new_page(viewport={"width": 480, "height": 320})
            tab.goto(authentication.url, timeout=0)
            tab.wait_for_selector(f"#{STAMP}", state="attached", timeout=0)
            tab.wait_for_timeout(1000 * settling)  # textures, and the scene fades in
            tab.evaluate(PROBE)
            tab.wait_for_timeout(1000 * seconds)
            has_enough = f"() => window.pictures.length >= {pictures_at_least}"
            tab.wait_for_function(has_enough, timeout=0)
            pictures = np.array(tab.evaluate("() => window.pictures")[1:])
        offset = time.time() - time.monotonic()  # the browser knows only the time of day
        ages = 1e3 * (pictures[:, 1] * 1e-3 - offset - pictures[:, 0] * 1e-9)
        rate = float((len(pictures) - 1) / (pictures[-1, 1] - pictures[0, 1]) * 1e3)
    finally:
        is_over.set()
        thread.join()
        page.server.stop()
        authentication.close()
    return ages, rate
