# SPDX-License-Identifier: BSD-3-Clause
"""The reference of faults: a section for each row of tests/faults/faults.toml, with its tests."""

from collections.abc import Iterable

from fault_matrix import LIST, Fault, FaultTest, all_tests, read_faults
from tracked_files import ROOT

HEAD = """\
# Faults

What can go wrong, what is promised then, and the tests that show it.
[When the robot has stopped](/howto/robot_stopped.md) says what to do. In a program, a fault is a
value with a code, a step and a cause: [C++](/reference/cpp/core/fault.md),
[Python](/reference/python/trifinger.session_info.md).

"""


def page() -> str:
    """Returns the page of all faults."""
    faults = read_faults((ROOT / LIST).read_text(), all_tests())
    return HEAD + "\n".join(map(section, faults))


def section(fault: Fault) -> str:
    """Returns the section of a fault."""
    promise = fault.guarantee or fault.later
    tests = "".join(f"- {link(test)}\n" for test in fault.tests)
    title = f"<summary>{count(fault.tests)}</summary>"
    shown = f"<details>{title}\n\n{tests}\n</details>\n" if tests else ""
    return f"(fault-{fault.row:02})=\n## {fault.row:02} {fault.fault}\n\n{promise}\n\n{shown}"


def link(test: FaultTest) -> str:
    """Returns a link to the file of a test."""
    return f"[{test.sentence}](/source/{test.file}.md)"


def count(tests: Iterable[FaultTest]) -> str:
    """Returns how many tests there are, in words."""
    number = len(list(tests))
    return f"{number} test{'s' * (number > 1)}"
