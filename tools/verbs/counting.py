# SPDX-License-Identifier: BSD-3-Clause
"""Counts tests while their steps run."""

import re
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

from .steps import ROOT, Command, Step, Steps

RESULTS = ROOT / "build" / "results"  # GROUP/*.xml: the result of every test


class Count:
    """How many tests have passed and failed."""

    def __init__(self) -> None:
        """Begins at zero."""
        self.passed = 0
        self.failed = 0

    def pytest(self, steps: Steps, label: str, command: Command, **variables: str) -> Step:
        """Runs pytest as a step, prints its last line and adds its numbers."""
        step = steps.check(label, command, **variables)
        line = step.last_line(r"^=+ .*(passed|failed|error).* in [0-9.]+s")
        for number, word in re.findall(r"(\d+) (passed|failed|error)", line):
            self._add(**{"passed" if word == "passed" else "failed": int(number)})
        if line:
            print(f"    {line}")
        return step

    def begin_ctest(self, steps: Steps, label: str, command: Command) -> Step:
        """Starts ctest as a step beside others; a hang ends after half an hour.

        Older results of these steps go, because all that are there are counted in the end.
        """
        folder = RESULTS / steps.group
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        limit = ["timeout", "--foreground", "--kill-after=1m", "30m"]
        variables = {"GTEST_BRIEF": "1", "TRIFINGER_TEST_RESULTS": str(folder)}
        return steps.begin(label, [*limit, *command], **variables)

    def end_ctest(self, steps: Steps, step: Step) -> None:
        """Waits for ctest and adds the numbers of its tests.

        ctest counts processes. The number of tests comes from the files that the processes write.
        """
        steps.end(step)
        line = step.last_line("% tests passed, ")
        numbers = re.search(r"(\d+) tests failed out of (\d+)", line)
        failed_processes, processes = map(int, numbers.groups()) if numbers else (0, 0)
        suites = _suites(RESULTS / steps.group)
        tests, failed = _numbers(suites)
        # A process without a file counts as one test; it has failed if it crashed.
        tests += processes - len(suites)
        failed += failed_processes - sum(int(suite.attrib["failures"]) > 0 for suite in suites)
        self._add(passed=tests - failed, failed=failed)
        print(f"    {tests} tests in {processes} processes, {failed} failed")

    def add_files(self, folder: Path) -> None:
        """Adds the numbers of the tests whose results are in `folder`."""
        tests, failed = _numbers(_suites(folder))
        self._add(passed=tests - failed, failed=failed)
        print(f"    {tests} tests, {failed} failed")

    def _add(self, passed: int = 0, failed: int = 0) -> None:
        self.passed += passed
        self.failed += failed


def slowest_tests(number: int = 20) -> list[str]:
    """Returns a line for each of the slowest tests of the last run, the slowest one first."""
    tests = [
        (
            float(case.attrib["time"]),
            f"{file.parent.name}: {case.attrib['classname']}.{case.attrib['name']}",
        )
        for file in RESULTS.glob("*/*.xml")
        for case in ET.parse(file).getroot().iter("testcase")  # noqa: S314, our own files
    ]
    return [f"  {seconds:6.1f} s  {name}" for seconds, name in sorted(tests, reverse=True)[:number]]


def _suites(folder: Path) -> list[ET.Element]:
    """Returns what programs with GoogleTest have left in a folder; pytest's files differ."""
    roots = [ET.parse(file).getroot() for file in folder.glob("*.xml")]  # noqa: S314, our own files
    return [root for root in roots if "disabled" in root.attrib]


def _numbers(suites: list[ET.Element]) -> tuple[int, int]:
    """Returns how many tests have run, and how many have failed."""
    tests = sum(int(suite.attrib["tests"]) - int(suite.attrib["disabled"]) for suite in suites)
    return tests, sum(int(suite.attrib["failures"]) for suite in suites)
