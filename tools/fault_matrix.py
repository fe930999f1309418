# SPDX-License-Identifier: BSD-3-Clause
"""Checks that every fault this system survives has a test, and makes the page docs/faults.md.

The name of a test says which row of tests/faults/faults.toml it belongs to: fault_07_... in C++,
test_fault_07_... in Python. Its result is in the JUnit files that `./run test` writes to
build/results. A test that runs in several builds fails if it fails in one of them.
"""

import argparse
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

from tracked_files import ROOT, tracked_files

LIST = Path("tests/faults/faults.toml")
PAGE = Path("docs/faults.md")
RESULTS = Path("build/results")

TEST = re.compile(
    r"^(?:TYPED_)?TEST(?:_[FP])?\(\s*(?P<suite>\w+),\s*(?P<name>fault_(?P<row>\d\d)_\w+)\)"
    r"|^(?:async )?def (?P<function>test_fault_(?P<python_row>\d\d)_\w+)\(",
    re.MULTILINE,
)

FAILED = "failed"
PASSED = "passed"
NOT_RUN = "not run"

HEADER = """\
<!-- SPDX-License-Identifier: BSD-3-Clause -->
<!-- Made by tools/fault_matrix.py of tests/faults/faults.toml and the tests; do not edit. -->
# Faults

What can go wrong, what is promised then, and the tests that show it: they have the row in their
names, as in `fault_07_`.

| | fault | what is promised | tests |
|---|---|---|---|
"""


@dataclass(frozen=True)
class FaultTest:
    """A test in the sources."""

    row: int
    file: Path
    suite: str  # the suite in C++, the name of the module in Python
    name: str

    @property
    def sentence(self) -> str:
        """Suite and name in words, such as 'Ring: never shows a torn element'."""
        words = re.sub(r"^(test_)?fault_\d\d_", "", self.name)
        words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|_", " ", words)
        return f"{self.suite.removeprefix('test_')}: {words.lower()}"

    def is_result(self, test_class: str, name: str) -> bool:
        """Whether a test case of a JUnit file is this test, with any parameters."""
        if self.file.suffix == ".py":
            return test_class.endswith(f".{self.suite}") and name.partition("[")[0] == self.name
        # Parameters and types stand before and after suite and name.
        return {self.suite, self.name} <= set(re.findall(r"\w+", f"{test_class}.{name}"))


@dataclass
class Fault:
    """A row of the table."""

    row: int
    fault: str
    guarantee: str = ""
    later: str = ""
    tests: list[FaultTest] = field(default_factory=list)


def read_faults(text: str, tests: Iterable[FaultTest]) -> list[Fault]:
    """Returns the rows in their order, each with its tests."""
    rows = {int(number): Fault(int(number), **row) for number, row in tomllib.loads(text).items()}
    for test in tests:
        rows.setdefault(test.row, Fault(test.row, "")).tests.append(test)
    return [rows[number] for number in sorted(rows)]


def order_problems(text: str) -> Iterator[str]:
    """Yields one sentence if the rows of the list are not 1, 2, 3 and so on, in this order."""
    for expected, number in enumerate(tomllib.loads(text), 1):
        if int(number) != expected:
            yield f"{LIST}: row {expected:02} should be where row {number} is."
            return


def find_tests(file: Path, text: str) -> Iterator[FaultTest]:
    """Yields the tests of faults in a source file."""
    for match in TEST.finditer(text):
        row = int(match["row"] or match["python_row"])
        yield FaultTest(row, file, match["suite"] or file.stem, match["function"] or match["name"])


def all_tests() -> list[FaultTest]:
    """Returns the tests of faults, also those of packages."""
    return [
        test
        for file in tracked_files(".cpp", ".hpp", ".py")
        if "tests" in file.parts
        for test in find_tests(file, (ROOT / file).read_text())
    ]


def results_in(xml: str) -> Iterator[tuple[str, str, str]]:
    """Yields class, name and result of each test case of a JUnit file about a fault."""
    for case in ElementTree.fromstring(xml).iter("testcase"):  # noqa: S314  (these files are our own)
        name = case.get("name", "")
        if "fault_" not in name:
            continue
        if case.find("failure") is not None or case.find("error") is not None:
            result = FAILED
        elif case.find("skipped") is not None or case.get("status") == "notrun":
            result = NOT_RUN
        else:
            result = PASSED
        yield case.get("classname", ""), name, result


def worst(results: Sequence[str]) -> str:
    """The result of a test in several builds: failed if any failed, else passed if any passed."""
    return next((result for result in (FAILED, PASSED) if result in results), NOT_RUN)


def page(faults: Iterable[Fault]) -> str:
    """Returns the text of docs/faults.md."""
    lines = []
    for fault in faults:
        links = (f"[{test.sentence}](../{test.file})" for test in fault.tests)
        promise = fault.guarantee or f"({fault.later})"
        lines.append(f"| {fault.row:02} | {fault.fault} | {promise} | {'<br>'.join(links)} |\n")
    return HEADER + "".join(lines)


def problems(faults: Iterable[Fault], result_of: dict[FaultTest, str]) -> Iterator[str]:
    """Yields one sentence for each row without a test or text, and for each failed test."""
    for fault in faults:
        name = f"{LIST}: row {fault.row:02}"
        if not fault.fault:
            yield f"{name} does not exist, but {fault.tests[0].file} has a test of it."
        elif bool(fault.guarantee) == bool(fault.later):
            yield f"{name} must say either what is promised or why it comes later."
        elif fault.guarantee and not fault.tests:
            yield f"{name} has no test: {fault.fault}."
        elif fault.later and fault.tests:
            yield f"{name} has a test in {fault.tests[0].file}, but says '{fault.later}'."
        for test in fault.tests:
            if result_of[test] == FAILED:
                yield f"{test.file}: {test.suite}.{test.name} failed."


def main() -> int:
    """Checks results and page, or writes the page, and returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help=f"write {PAGE} instead of checking it")
    parser.add_argument("results", type=Path, nargs="?", default=ROOT / RESULTS)
    arguments = parser.parse_args()

    tests = all_tests()
    rows = (ROOT / LIST).read_text()
    faults = read_faults(rows, tests)
    if arguments.write:
        (ROOT / PAGE).write_text(page(faults))
        return 0

    cases = [
        case
        for file in sorted(arguments.results.rglob("*.xml"))
        for case in results_in(file.read_text())
    ]
    results_of = {
        test: [result for *names, result in cases if test.is_result(*names)] for test in tests
    }
    result_of = {test: worst(results) for test, results in results_of.items()}
    found = [*order_problems(rows), *problems(faults, result_of)]
    # A skipped test has a result. A test without one was never built, or its suite has crashed.
    found += [
        f"{test.file}: {test.suite}.{test.name} has no result in {arguments.results}."
        for test, results in results_of.items()
        if not results
    ]
    # A machine may be unable to run a test.
    for test, result in result_of.items():
        if result == NOT_RUN:
            print(f"not run on this machine: {test.file}: {test.suite}.{test.name}")
    print("\n".join(found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
