# SPDX-License-Identifier: BSD-3-Clause
"""Runs the long versions of the tests: a night on two processors, beside compiling."""

import re
import subprocess
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager

from .build import build, uses
from .check import (
    run_fuzzers,
    test_release,
    test_with_address_sanitizer,
    test_with_thread_sanitizer,
)
from .counting import Count
from .environments import bare_debians, cluster, lerobot, oldest, other_processor, warp
from .lint import clang_tidy
from .setup import PYTHON, fetch_robots, setup
from .steps import NotRun, Step, StepFailed, Steps
from .test import quick_tests

STEPS = Steps("soak")


def soak(parts: Sequence[str]) -> int:
    """Runs these parts, or all, also after one failed."""
    setup()
    fetch_robots("--all")
    passed = []
    for part in parts or PARTS:
        print(part)
        try:
            passed.append(PARTS[part]())
        except NotRun as reason:
            print(f"  not run: {reason}")
        except StepFailed:
            passed.append(False)
    return 0 if all(passed) else 1


def all_true(results: Iterable[bool]) -> bool:
    """Says whether all results are true; takes all of them, also after one that is not."""
    return all(list(results))


def print_figures(step: Step) -> bool:
    """Prints the figures of a step, without the usual lines of test programs; says if it passed."""
    usual = re.compile(r"^(\[|Running main|Note: |$)")
    figures = [line for line in step.output.splitlines() if not usual.match(line)]
    print(*(f"    {line}" for line in figures[-40:]), sep="\n")
    return step.succeeded


def long_tests(preset: str, programs: str, tests: str) -> bool:
    """Runs the long versions of the tests that match, in programs that begin with their layer."""

    def run(program: str) -> bool:
        path = f"build/{preset}/tests/{program.split('_')[0]}/{program}_test"
        command = ["timeout", "--foreground", "1h", path, "--gtest_brief=1"]
        label = f"{preset}: {program}, {tests}"
        return print_figures(
            STEPS.check(label, [*command, f"--gtest_filter={tests}"], TRIFINGER_SOAK="1")
        )

    return all_true(run(program) for program in programs.split())


def python_soak(part: str, *options: str) -> bool:
    """Runs a part of benchmarks/soak.py."""
    command = [PYTHON, "benchmarks/soak.py", part, *options]
    return print_figures(STEPS.check(part, command, **uses("release")))


def kills() -> bool:
    """Kills any process at any instant: expects 0 hangs and 0 lost steps."""
    build("release")
    return all(
        [python_soak("kills"), long_tests("release", "core core_kill_at_instruction log", "*Kill*")]
    )


def tests() -> bool:
    """Runs all other tests of faults: 10^8 reads of a ring, 10^7 wakes, 10^7 hostile actions."""
    build("release")
    programs = "ipc realtime can core mcap mcap_damage log log_damage config joint sim"
    return long_tests("release", programs, "*fault_*:*UnderHostileActions*-*Kill*:*HostileQueue*")


@contextmanager
def busy_processes(number: int) -> Iterator[None]:
    """Keeps `number` processes busy beside the block."""
    busy = [subprocess.Popen([PYTHON, "-c", "while True: pass"]) for _ in range(number)]
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


def busy() -> bool:
    """Runs the tests in their builds three times beside four busy processes.

    No test may ask for a quick machine.
    """
    stages = [quick_tests, test_release, test_with_address_sanitizer, test_with_thread_sanitizer]
    with busy_processes(4):
        return all_true(stage(Count()) for _ in range(3) for stage in stages)


def fuzz() -> bool:
    """Feeds hostile bytes to the reader of logs and, under AddressSanitizer, to a session."""
    fuzzer = STEPS.check("fuzzers", run_fuzzers(seconds=300))
    build("dev", "tests/core/all", "tests/sim/all")
    return (
        long_tests("dev", "core sim", "*HostileQueue*:*Tampered*:*fault_29_*") and fuzzer.succeeded
    )


def analyser() -> bool:
    """Runs clang's analyser, and clang-tidy over the tests: too long for `./run lint`."""
    steps = [clang_tidy(STEPS, mode) for mode in ("tests", "analyser")]
    return all(step.succeeded for step in steps)


def robots() -> bool:
    """Runs each robot of others as `trifinger new robot` writes it, and says which move."""
    build("release")
    command = [PYTHON, "benchmarks/survey_robots.py"]
    return print_figures(STEPS.check("robots", command, **uses("release")))


def memory() -> bool:
    """Runs a robot with recorder and controller for half an hour: its memory must not grow."""
    build("release")
    return python_soak("memory")


def endurance() -> bool:
    """Drives emulated robots for 10^8 steps of simulated time with faults: nothing needs an
    operator.
    """
    build("release")
    return python_soak("endurance") and long_tests("release", "endurance_drive", "*")


def endurance_in_real_time() -> bool:
    """Drives an emulated robot for an hour in real time, while processes are killed."""
    build("release")
    return python_soak("endurance-real-time", "--minutes", "60")


def learn() -> bool:
    """A robot learns by itself: 500 kills of its processes, then two hours and, in simulated time,
    a day with faults.
    """
    build("release")
    command = [PYTHON, "-m", "pytest", "-q", "tests/python/test_learn.py", "-k", "killed"]
    variables = {**uses("release"), "TRIFINGER_SOAK": "1"}
    command += ["-m", "slow", "-o", "faulthandler_timeout=3600"]  # kills take ten minutes
    killed = print_figures(STEPS.check("learn", command, **variables))
    held = python_soak("learning", "--minutes", "120")
    return python_soak("learning", "--minutes", "1440", "--simulated") and held and killed


def lerobot_itself() -> bool:
    """Records with images, replays, teleoperates, trains and lets a policy act with LeRobot."""
    return print_figures(lerobot())


def sweeps() -> bool:
    """Sweeps with Ray, and shows curves with Weights & Biases."""
    return print_figures(cluster())


def physics_of_warp() -> bool:
    """Compares simulations that MuJoCo Warp moves with MuJoCo's, and trains in them."""
    return print_figures(warp())


def lowest_versions() -> bool:
    """Tests with exactly the lowest versions that our packages allow."""
    return all_true(print_figures(step) for step in oldest())


def systems() -> bool:
    """Runs demo and tests on a bare Debian 12 and a bare Debian 13."""
    return all_true(step.succeeded for step in bare_debians())


def arm() -> bool:
    """Compiles for 64-bit ARM, and runs tests and wheel in an emulator."""
    return all_true(print_figures(step) for step in other_processor())


PARTS: dict[str, Callable[[], bool]] = {
    "analyser": analyser,
    "kills": kills,
    "tests": tests,
    "busy": busy,
    "fuzz": fuzz,
    "robots": robots,
    "learn": learn,
    "memory": memory,
    "lerobot": lerobot_itself,
    "cluster": sweeps,
    "warp": physics_of_warp,
    "oldest": lowest_versions,
    "systems": systems,
    "aarch64": arm,
    "endurance": endurance,
    "endurance-real-time": endurance_in_real_time,
}
