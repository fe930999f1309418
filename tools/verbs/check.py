# SPDX-License-Identifier: BSD-3-Clause
"""Runs what `./run test` leaves out: each test in the build that says most about it."""

import platform
import shutil
import subprocess
from pathlib import Path

from .build import build, jobs
from .counting import Count
from .docs import build_site, look_at_site
from .lint import clang_tidy
from .machine import Machine
from .setup import PYTHON
from .steps import NotRun, Steps
from .test import cpp_tests, python_tests, run_stages


def check() -> int:
    """Runs all stages, also after one failed, and prints a summary."""
    machine = Machine()
    return run_stages(
        [
            ("clang-tidy", tidy),
            ("AddressSanitizer and UBSan", test_with_address_sanitizer),
            ("ThreadSanitizer, a fuzzer beside it", test_with_thread_sanitizer),
            ("slow tests of what users get", test_release),
            ("documentation site", lambda count: test_site(count, machine)),
            ("SocketCAN on a real-time kernel", machine.test),
            ("the safety chain for GPUs", compile_for_gpus),
            ("results of skills are of their judges", test_results),
            ("every fault has its test", test_every_fault),
            ("what is stable has not broken", test_stability),
        ]
    )


def tidy(count: Count) -> bool:  # noqa: ARG001
    """Runs the part of lint that takes long."""
    return clang_tidy(Steps("lint")).succeeded


def test_with_address_sanitizer(count: Count) -> bool:
    """Runs all C++ tests, and the Python tests of the bindings."""
    build("dev", "tests/all", "bindings/all")
    # The sanitizer keeps its shadow memory of large blocks and does not map it again for each.
    options = f"clear_shadow_mmap_threshold={2**30}"
    ctest = ["env", f"ASAN_OPTIONS={options}", "ctest", "--preset", "dev", "-LE", "examples"]
    # Python itself is not instrumented and frees little at its end, so only the C++ tests look for
    # leaks. libstdc++ must be loaded before the runtime looks for the functions that it wraps.
    # --capture=sys keeps pytest from hiding the runtime's reports.
    variables = {
        "LD_PRELOAD": " ".join(preloaded_libraries()),
        "ASAN_OPTIONS": f"{options}:detect_leaks=0",
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "PYTHONMALLOC": "malloc",
    }
    selected = ["-m", "bindings and not without_sanitizer", "--capture=sys"]
    with cpp_tests(count, "dev", "C++ tests", *ctest) as step:
        passed = python_tests(count, "dev", "dev", *selected, **variables)
    return passed and step.succeeded


def preloaded_libraries() -> list[str]:
    """Returns the libraries that Python loads first, to run under AddressSanitizer."""
    folder = answer("clang++", "--print-runtime-dir")
    return [
        f"{folder}/libclang_rt.asan-{platform.machine()}.so",
        answer("g++", "-print-file-name=libstdc++.so"),
    ]


def answer(*command: str) -> str:
    """Returns the line that a command prints."""
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


# Layers with threads of their own; the preset "tsan" has their labels.
THREADED = ("ipc", "realtime", "can", "dynamixel", "core")


def test_with_thread_sanitizer(count: Count) -> bool:
    """Runs the C++ tests of the layers up to core, with a fuzzer beside them."""
    fuzzer_steps = Steps("fuzz")
    fuzzer = fuzzer_steps.begin("fuzzers of what is foreign", run_fuzzers(seconds=10))
    try:
        build("tsan", *(f"tests/{layer}/all" for layer in THREADED))
        ctest = [*fixed_addresses(), "ctest", "--preset", "tsan"]
        with cpp_tests(count, "tsan", f"C++ tests of {', '.join(THREADED)}", *ctest) as step:
            pass
    finally:
        fuzzer_steps.end(fuzzer)
    return step.succeeded and fuzzer.succeeded


def fixed_addresses() -> list[str]:
    """Returns how to begin a command that runs under ThreadSanitizer.

    The runtime of g++ 12 and clang 14 finds no room for its shadow memory if addresses have more
    than 28 random bits.
    """
    bits = Path("/proc/sys/vm/mmap_rnd_bits")
    return ["setarch", "-R"] if bits.exists() and int(bits.read_text()) > 28 else []


def run_fuzzers(seconds: int) -> list[str]:
    """Returns the command that builds the fuzzers and runs each for `seconds`, on one processor.

    Each corpus is kept, and the next run starts with it.
    """
    folder = "build/fuzz"
    script = f"""
        cmake --preset fuzz
        cmake --build --preset fuzz --parallel 1
        run() {{  # NAME PROGRAM LONGEST_INPUT
            mkdir -p {folder}/$1/corpus {folder}/$1/seeds
            {folder}/tests/$2 -max_total_time={seconds} -max_len=$3 -rss_limit_mb=2048 -timeout=10 \
                -artifact_prefix={folder}/$1/ {folder}/$1/corpus {folder}/$1/seeds
        }}
        {folder}/tests/mcap/fuzzer_seeds {folder}/reader/seeds
        run reader mcap/reader_fuzzer 20000
        run motor_board can/motor_board_fuzzer 600
        run dynamixel_packet dynamixel/dynamixel_packet_fuzzer 5000
        mkdir -p {folder}/onnx/seeds && cp tests/onnx/*.onnx {folder}/onnx/seeds
        run onnx onnx/onnx_fuzzer 20000
    """
    return ["bash", "-e", "-c", script]


def test_release(count: Count) -> bool:
    """Runs the slow Python tests, the examples, and C++ tests that a sanitizer hinders."""
    folders = ["apps", "bindings", "examples", "benchmarks", "tests/python"]
    targets = ["tests_without_sanitizer", "evaluate_teach"]
    build("release", *(f"{folder}/all" for folder in folders), *targets)
    ctest = ["ctest", "--preset", "release", "-L", "^examples$|_without_sanitizer$"]
    with cpp_tests(count, "release", "C++ tests that need no sanitizer", *ctest) as step:
        # Two on each processor: most of them wait for robots that run in real time.
        passed = python_tests(count, "release", "release", "-m", "slow", f"-n{2 * jobs()}")
    return passed and step.succeeded


def test_site(count: Count, machine: Machine) -> bool:
    """Builds the site, with pictures of the pages that the release build has run.

    Site and machine use one processor each, so the machine starts beside the site.
    """
    machine.begin()
    build_site()
    return look_at_site(count)


def test_every_fault(count: Count) -> bool:  # noqa: ARG001
    """Compares the results with the fault matrix."""
    step = Steps("faults").check("fault matrix", [PYTHON, "tools/fault_matrix.py"])
    for line in step.output.splitlines():
        if line.startswith("not run"):
            print(f"    {line}")
    return step.succeeded


def compile_for_gpus(count: Count) -> bool:  # noqa: ARG001
    """Compiles the safety chain to PTX.

    Raises:
        NotRun: if the compiler is missing
    """
    if shutil.which("clang++") is None:
        raise NotRun("clang++ is missing: apt install clang")
    tool = [PYTHON, "packages/trifinger_gpu/tools/write_ptx.py", "build/gpu/safety.ptx"]
    return Steps("gpu").check("PTX of the safety chain", tool).succeeded


def test_results(count: Count) -> bool:  # noqa: ARG001
    """Asks whether the pages of skills are older than what judges them."""
    build("release", "run_trial")
    pages = [PYTHON, "evaluation/skills.py", "check"]
    return Steps("results").check("pages of skills", pages).succeeded


def test_stability(count: Count) -> bool:  # noqa: ARG001
    """Compares what is stable with the record of the last release; names what broke."""
    build("release", "apps/all", "bindings/all")
    step = Steps("stability").check("the last release", [PYTHON, "tools/stability.py"])
    if step.succeeded:
        for line in filter(None, step.output.splitlines()):  # breaks that the version allows
            print(f"    {line}")
    return step.succeeded
