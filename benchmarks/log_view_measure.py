# SPDX-License-Identifier: BSD-3-Clause
"""How long `trifinger view LOG` needs until it can show a moment of an hour, and its memory."""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
import trifinger
from chromium import open_browser
from rows import Row

if TYPE_CHECKING:
    from playwright.sync_api import Browser

HOUR = 3_600_000  # steps

COMMAND = "import sys; from trifinger_view.commands.view import main; sys.exit(main())"
TRIANGLES = 5000  # that have been drawn when the robot can be seen
COUNT_TRIANGLES = """
window.triangles = 0;
const draw = WebGL2RenderingContext.prototype.drawElements;
WebGL2RenderingContext.prototype.drawElements = function (...words) {
  window.triangles += words[1] / 3;
  return draw.apply(this, words);
};
"""
# Each prints when it is done, and its largest memory [KB].
FIRST_PICTURE = """
import resource, sys
from trifinger_view.logged import LoggedRun
run = LoggedRun(sys.argv[1])
frame = run.frame_at(float(sys.argv[2]) * run.end)
run.scene.poses(frame.position, frame.objects)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, flush=True)
"""
READ_ALL = """
import resource, sys, trifinger
rows = trifinger.Log(sys.argv[1]).session().read()
assert len(rows.observations)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, flush=True)
"""


def record(folder: str, steps: int) -> None:
    """Records a simulated robot that moves to another pose twice a second."""
    home = np.array([0.0, 0.9, -1.7] * 3)
    random = np.random.default_rng(1)
    simulation = trifinger.Simulation()
    with simulation.record(folder), simulation.connect() as robot:
        for start in range(0, steps, 500):
            actions = np.repeat(robot.new_action(), min(500, steps - start))
            actions["position"] = home + random.uniform(-0.25, 0.25, 9)
            robot.append_desired_actions(actions)
            robot.wait_until_time_index(start + len(actions) - 1)
        robot.finish()


def timed(program: str, *words: str) -> tuple[float, float]:
    """Seconds until a program has printed its line, and its largest memory [MB]."""
    begin = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", program, *words], check=True, capture_output=True, text=True
    )
    return time.perf_counter() - begin, int(done.stdout) / 1024


def in_browser(browser: Browser, folder: str) -> float:
    """Seconds from the start of `trifinger view` until an open browser has drawn the robot."""
    begin = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, "-c", COMMAND, folder, "--plain", "--no-browser"],
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        url = process.stdout.readline().split()[1] if process.stdout else ""
        tab = browser.new_page(viewport={"width": 480, "height": 320})
        tab.add_init_script(COUNT_TRIANGLES)
        tab.goto(url, timeout=0)
        tab.wait_for_function(f"() => window.triangles > {TRIANGLES}", timeout=0)
        tab.evaluate("() => new Promise(requestAnimationFrame)")
        seconds = time.perf_counter() - begin
        tab.close()
        process.kill()
    return seconds


def measure(rounds: Iterable[int], is_quick: bool) -> list[Row]:
    """Opens a log of an hour at random times, and reads it whole, in turn."""
    places = np.random.default_rng(2)
    first, drawn, whole = [], [], []
    with tempfile.TemporaryDirectory() as folder, open_browser() as browser:
        record(folder, HOUR // 60 if is_quick else HOUR)
        for _ in rounds:
            first.append(timed(FIRST_PICTURE, folder, str(places.uniform())))
            drawn.append(in_browser(browser, folder))
            whole.append(timed(READ_ALL, folder))
    seconds = [one for one, _ in first]
    memory, memory_whole = max(size for _, size in first), max(size for _, size in whole)
    reference = statistics.median(one for one, _ in whole)
    ratio = statistics.median(seconds) / reference
    what = "a minute" if is_quick else "an hour"
    return [
        Row.of(
            f"view: first picture of a log of {what}, new process",
            seconds,
            "s",
            reference="reading it into NumPy, new process",
            reference_value=reference,
            ratio=ratio,
            reach="<= 3 s",
            holds=statistics.median(seconds) <= 3.0,
            remark=f"at most {memory:.0f} MB of memory; {memory_whole:.0f} MB for reading it whole",
        ),
        Row.of(
            f"view: the same of a log of {what} until a browser has drawn it",
            drawn,
            "s",
            reference="reading it into NumPy, new process",
            reference_value=reference,
            ratio=statistics.median(drawn) / reference,
            reach="<= 3 s",
            holds=statistics.median(drawn) <= 3.0,
            remark="`--plain`; an open Chromium without a graphics card, on the same processors",
        ),
    ]
