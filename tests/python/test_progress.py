# SPDX-License-Identifier: BSD-3-Clause
import contextlib
import os
import pty
import subprocess
import sys

from trifinger.progress import shown

PROGRAM = """
from trifinger import progress
progress.EVERY = 0.0
for _ in progress.shown("abcd", "film.mp4", 4):
    pass
"""


def test_a_terminal_shows_how_far_it_is_and_is_clean_at_the_end() -> None:
    ours, theirs = pty.openpty()
    subprocess.run([sys.executable, "-c", PROGRAM], stderr=theirs, check=True)
    os.close(theirs)
    text = ""
    with contextlib.suppress(OSError):  # the other side is closed
        while part := os.read(ours, 4096):
            text += part.decode()
    os.close(ours)
    assert [f"film.mp4  {share:3d} %" in text for share in (0, 25, 50, 75)] == [True] * 4
    assert text.endswith("\r\x1b[K")


def test_a_file_gets_nothing() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, check=True)
    assert done.stdout + done.stderr == b""


def test_gives_what_it_is_given() -> None:
    assert list(shown(range(3), "what", 0)) == [0, 1, 2]
