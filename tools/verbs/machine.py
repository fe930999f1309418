# SPDX-License-Identifier: BSD-3-Clause
"""Tests SocketCAN and control groups in a virtual machine: tools/can_machine.py."""

import can_machine

from .build import build
from .counting import RESULTS, Count
from .setup import PYTHON, setup
from .steps import NotRun, Steps

TARGETS = ("trifinger_program", "can_test", "machine_test")


def test_in_machine(count: Count) -> bool:
    """Runs the tests in the machine and says whether they passed.

    Raises:
        NotRun: if there is no such machine here
    """
    build("release", *TARGETS)
    try:
        can_machine.fetch_kernel()
    except can_machine.NotPossibleHere as reason:
        raise NotRun(str(reason)) from None
    folder = RESULTS / "can_machine"
    command = [PYTHON, "tools/can_machine.py", str(folder)]
    step = Steps("can_machine").check("robot and emulator in a machine", command)
    count.add_files(folder)
    return step.succeeded


def machine() -> int:
    """Runs only these tests."""
    setup()
    try:
        return 0 if test_in_machine(Count()) else 1
    except NotRun as reason:
        print(f"The tests were not run: {reason}.")
        return 1
