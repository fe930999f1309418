# SPDX-License-Identifier: BSD-3-Clause
"""A trial of a sweep that ends itself as `kill -9` does, when it is run for the first time.

    killed_trial.py MARKER COUNT OPTIONS...

MARKER is a file that it makes; the kill comes in the COUNTth step of the training's environment.
"""

import os
import signal
import sys
from pathlib import Path

from trifinger.commands.sweep import main
from trifinger.environments import Environment


def kill_once(marker: Path, count: int) -> None:
    """Lets a step of an environment kill this process, unless the marker exists."""
    step, calls = Environment.step, 0

    def counted(self, action):
        nonlocal calls
        calls += 1
        if calls == count and not marker.exists():
            marker.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return step(self, action)

    Environment.step = counted


if __name__ == "__main__":
    kill_once(Path(sys.argv[1]), int(sys.argv[2]))
    sys.exit(main(sys.argv[3:]))
