# SPDX-License-Identifier: BSD-3-Clause
"""A training that ends itself as `kill -9` does, for a process of its own."""

import importlib
import os
import signal
from pathlib import Path

from trifinger.training import PLAN, Plan, Training


def run(folder: Path, plan: str, module: str, name: str, count: int) -> None:
    """Begins or resumes a training in a folder, and is killed at the nth call of a function."""
    holder = importlib.import_module(module)
    *classes, name = name.split(".")
    for one in classes:
        holder = getattr(holder, one)
    called, calls = getattr(holder, name), 0

    def count_calls(*words, **more):
        nonlocal calls
        calls += 1
        if calls == count:
            os.kill(os.getpid(), signal.SIGKILL)
        return called(*words, **more)

    setattr(holder, name, count_calls)
    if (folder / PLAN).exists():
        training = Training.resume(folder)
    else:
        training = Training(Plan.from_json(plan), folder)
    training.run()
