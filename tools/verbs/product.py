# SPDX-License-Identifier: BSD-3-Clause
"""Builds what users get and runs it: demo, examples, wheel, benchmarks, evaluations."""

import os
import sys
from typing import NoReturn

from .build import build, uses
from .setup import OF_DEVELOPERS, PROGRAMS, PYTHON, setup
from .steps import ROOT, Steps


def become(*command: str, **variables: str) -> NoReturn:
    """Replaces this program by a command."""
    sys.stdout.flush()
    os.chdir(ROOT)
    os.execve(command[0], command, {**os.environ, **variables})


def demo(*arguments: str) -> NoReturn:
    """Lifts a cube."""
    setup(without=OF_DEVELOPERS)
    build("release", "trifinger_program", "trifinger_manipulate", "trifinger_python")
    become(f"{PROGRAMS}/trifinger", "demo", *arguments)


def examples(*names: str) -> NoReturn:
    """Runs the examples in both languages."""
    setup()
    build("release", "apps/all", "bindings/all", "examples/all")
    become(PYTHON, "tools/run_examples.py", "build/release/examples", *names)


def wheel() -> None:
    """Makes a wheel, and those of packages/, and says how to install them."""
    setup()
    build("release", "apps/all", "bindings/all")  # Their helps become manual pages.
    # This option is that of build/release, so that ccache has all objects.
    option = "TRIFINGER_WARNINGS_AS_ERRORS=ON"
    step = Steps("release").run(
        "wheel", [PYTHON, "tools/make_wheel.py", "build/wheels", PYTHON, option]
    )
    path = step.last_line()
    print(f"    {path}, {(ROOT / path).stat().st_size / 2**20:.1f} MiB")
    print(f"To install it with all that the demo needs: pip install '{path}[demo]'")
    print(f"To install everything: pip install '{path}[all]' build/wheels/trifinger_*.whl")


def bench(*measures: str) -> NoReturn:
    """Measures speed and latency."""
    setup()
    build("release", "apps/all", "bindings/all", "benchmarks/all")
    become(PYTHON, "benchmarks/run_benchmarks.py", *measures, **uses("release"))


EVALUATIONS = {
    "algorithms": "evaluation/compare_algorithms.py",
    "benchmark": "evaluation/benchmark.py",
    "challenge": "evaluation/challenge.py",
    "cliffs": "evaluation/cliffs.py",
    "control": "evaluation/skills.py",
    "environments": "evaluation/evaluate_environments.py",
    "identify": "evaluation/identify.py",
    "learn-on-robot": "evaluation/learn_on_robot.py",
    "learning": "evaluation/learning.py",
    "lift": "evaluation/move_cube.py",
    "push": "evaluation/move_cube.py",
    "robots": "evaluation/compare_robots.py",
    "skills": "evaluation/skills.py",
    "training": "evaluation/trainings.py",
    "teach": "build/release/evaluation/evaluate_teach",
    "tracking": "evaluation/tracking.py",
    "vision": "evaluation/skills.py",
}
JUDGED = ("evaluation/cliffs.py", "evaluation/skills.py")  # of the trials of run_trial
NAMED = (*JUDGED, "evaluation/move_cube.py")  # These serve several experiments.


def evaluate(experiment: str, *arguments: str) -> NoReturn:
    """Repeats the experiment whose results are in docs/results."""
    setup()
    program = EVALUATIONS[experiment]
    if program in JUDGED:
        build("release", "run_trial")
    if program in NAMED:
        arguments = (experiment, *arguments)
    if program.endswith(".py"):
        build("release", "bindings/all")
        become(PYTHON, program, *arguments, **uses("release"))
    build("release", program.rpartition("/")[2])
    become(program, *arguments)
