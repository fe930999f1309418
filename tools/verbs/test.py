# SPDX-License-Identifier: BSD-3-Clause
"""Runs the tests that tell a newcomer that all works here, in minutes; check.py has the others."""

import contextlib
import shutil
import time
from collections.abc import Callable, Iterator, Sequence

from .build import build, jobs, uses
from .counting import RESULTS, Count, slowest_tests
from .lint import lint
from .setup import PYTHON, fetch_robots, setup
from .steps import ROOT, NotRun, Step, StepFailed, Steps, duration

Stage = tuple[str, Callable[[Count], bool]]


def run_stages(stages: Sequence[Stage]) -> int:
    """Runs all stages, also after one failed, prints a summary, and returns the exit status."""
    begin = time.monotonic()
    setup()
    fetch_robots()
    count = Count()
    summary = []
    all_passed = True
    for title, stage in stages:
        print(title)
        stage_begin = time.monotonic()
        failed_before = count.failed
        verdict = "ok    "
        try:
            passed = stage(count)
        except StepFailed:
            passed = False
        except NotRun as reason:
            passed = True
            verdict = "not run"
            print(f"  not run: {reason}")
        if not passed:
            verdict = "FAILED"
            if count.failed == failed_before:
                count.failed += 1  # for example, when something does not compile
        all_passed &= passed
        summary.append(f"  {title:40} {verdict:7} {duration(time.monotonic() - stage_begin)}")
    print("\nslowest tests", *slowest_tests(), sep="\n")
    print("\nsummary", *summary, sep="\n")
    if Steps.failures:
        print("", *Steps.failures, sep="\n")
    print(f"{count.passed} passed, {count.failed} failed in {duration(time.monotonic() - begin)}")
    return 0 if all_passed else 1


# The layers that rest on what differs between machines: kernels, processors, disks, clocks.
QUICK_LAYERS = ("ipc", "realtime", "core", "log", "sim")


def test() -> int:
    """Checks sources, then runs the quick tests of what users get."""
    shutil.rmtree(RESULTS, ignore_errors=True)
    return run_stages([("lint", lint), ("tests of what users get", quick_tests)])


def quick_tests(count: Count) -> bool:
    """Runs the C++ tests of some layers, and the quick Python tests, in the release build."""
    programs = [f"{layer}_test" for layer in QUICK_LAYERS]
    build("release", "apps/all", "bindings/all", "tests/python/all", *programs)
    labels = f"^({'|'.join(QUICK_LAYERS)})(_without_sanitizer)?$"
    ctest = ["ctest", "--preset", "release", "-L", labels]
    with cpp_tests(count, "quick", f"C++ tests of {', '.join(QUICK_LAYERS)}", *ctest) as step:
        passed = python_tests(count, "quick", "release", "-m", "not slow")
    return passed and step.succeeded


def layers() -> list[str]:
    """Returns the layers that have tests in C++."""
    files = [*ROOT.glob("tests/*/CMakeLists.txt"), *ROOT.glob("packages/*/tests/*/CMakeLists.txt")]
    return sorted({file.parent.name for file in files} - {"machine", "python"})


def test_layers(*names: str) -> int:
    """Runs the C++ tests of some layers under AddressSanitizer and UBSan, for the one who edits."""
    setup()
    build("dev", *(f"tests/{name}/all" for name in names))
    ctest = ["ctest", "--preset", "dev", "-L", f"^({'|'.join(names)})(_.*)?$"]
    with cpp_tests(Count(), "dev", "C++ tests", *ctest) as step:
        pass
    return 0 if step.succeeded else 1


def python_tests(count: Count, group: str, preset: str, *arguments: str, **variables: str) -> bool:
    """Runs the Python tests that `arguments` of pytest select, and says whether they passed.

    Each process makes the fixtures of a file again, so few files should be split between processes.
    Two modes of pytest do that, worksteal and loadfile. worksteal goes on when a process has
    crashed or its watchdog, faulthandler_timeout, has ended it; loadfile may wait for ever. If all
    processes hang, pytest is interrupted after an hour, reports what has failed so far, and is
    killed a minute later.
    """
    limit = ["timeout", "--foreground", "--signal=INT", "--kill-after=1m", "60m"]
    results = f"--junitxml={RESULTS / group / 'python.xml'}"
    pytest = [PYTHON, "-m", "pytest", "-n", str(jobs()), "--dist", "worksteal", results]
    command = [*limit, *pytest, *arguments, "tests/python", "packages"]
    return count.pytest(
        Steps(group), "Python tests", command, **uses(preset), **variables
    ).succeeded


@contextlib.contextmanager
def cpp_tests(count: Count, group: str, label: str, *command: str) -> Iterator[Step]:
    """Runs ctest beside the block, because it uses one processor and often only waits.

    At the end of the block it waits for ctest and adds the numbers of its tests.
    """
    steps = Steps(group)
    step = count.begin_ctest(steps, label, command)
    try:
        yield step
    finally:
        count.end_ctest(steps, step)
