# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger view` in a process of its own."""

import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator

import pytest

# A busy machine, or a browser without a graphics card, can be silent for seconds.
PATIENTLY = "page_controller.TIMEOUT = 60.0"
VIEW = """
import sys, threading, time
from trifinger_view import page_controller
{before}
from trifinger_view.commands.view import main
sys.exit(main())
"""


class Viewing:
    """A running `trifinger view`, which has a page."""

    def __init__(self, *words: str, before: str = "") -> None:
        program = VIEW.format(before=f"{PATIENTLY}\n{before}")
        self.process = subprocess.Popen(
            [sys.executable, "-c", program, "--port", "0", *words, "--no-browser", "--plain"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        address = re.match(r"Open (http://127\.0\.0\.1:(\d+)/\?token=(.*))", line)
        assert address, line + self.process.stdout.read()
        self.url = address[1]
        self.port = int(address[2])
        self.token = address[3]
        self.cookie = f"trifinger_view_{self.port}"
        self.said = ""
        """What it has printed after the address."""
        while "Ctrl-C" not in line:
            line = self.process.stdout.readline()
            self.said += line

    def end(self) -> tuple[int, str]:
        """Presses Ctrl-C; returns the exit status and the rest of the output."""
        self.process.send_signal(signal.SIGINT)
        output, _ = self.process.communicate()
        return self.process.returncode, output


StartView = Callable[..., Viewing]


@pytest.fixture
def start_view() -> Iterator[StartView]:
    """Starts `trifinger view` with these words, after the code `before` in its process."""
    started: list[Viewing] = []

    def start(*words: str, before: str = "") -> Viewing:
        started.append(Viewing(*words, before=before))
        return started[-1]

    yield start
    for viewing in started:
        with viewing.process:
            viewing.process.kill()
