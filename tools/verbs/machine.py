# SPDX-License-Identifier: BSD-3-Clause
"""Tests SocketCAN and control groups in a virtual machine: tools/can_machine.py."""

import contextlib

import can_machine

from .build import build
from .counting import RESULTS, Count
from .setup import PYTHON, setup
from .steps import NotRun, Step, StepFailed, Steps

TARGETS = ("trifinger_program", "can_test", "machine_test")
STEPS = Steps("can_machine")
FOLDER = RESULTS / "can_machine"


class Machine:
    """The machine, which uses one processor and may run beside something else."""

    def __init__(self) -> None:
        """Starts nothing yet."""
        self._step: Step | None = None

    def begin(self) -> None:
        """Starts the machine. If that is not possible, `test` says why."""
        with contextlib.suppress(NotRun, StepFailed):
            self._begin()

    def test(self, count: Count) -> bool:
        """Waits for the tests in the machine, which may run already, and says whether they passed.

        Raises:
            NotRun: if there is no such machine here
        """
        step = self._begin()
        STEPS.end(step)
        count.add_files(FOLDER)
        return step.succeeded

    def _begin(self) -> Step:
        if self._step is None:
            build("release", *TARGETS)
            try:
                can_machine.fetch_kernel()
            except can_machine.NotPossibleHere as reason:
                raise NotRun(str(reason)) from None
            command = [PYTHON, "tools/can_machine.py", str(FOLDER)]
            self._step = STEPS.begin("robot and emulator in a machine", command)
        return self._step


def machine() -> int:
    """Runs only these tests."""
    setup()
    try:
        return 0 if Machine().test(Count()) else 1
    except NotRun as reason:
        print(f"The tests were not run: {reason}.")
        return 1
