# SPDX-License-Identifier: BSD-3-Clause
"""Checks format, names, types, layers and documents."""

from tracked_files import tracked_files

from .build import LARGE_PAGES, configure, jobs
from .counting import Count
from .setup import PROGRAMS, PYTHON
from .steps import Step, Steps


def lint(count: Count) -> bool:
    """Runs all checks but clang-tidy, also after one failed, and says whether all passed."""
    steps = Steps("lint")
    typed = ["python/trifinger", "python/trifinger_launcher", "packages", "tools", "evaluation"]
    mypy = steps.begin("mypy", [PYTHON, "-m", "mypy", *typed])
    clang_format = [f"{PROGRAMS}/clang-format", "--dry-run", "-Werror"]
    tests = [PYTHON, "-m", "pytest"]  # the package, which conftest.py imports, may not be built
    checks = [
        steps.check("clang-format", [*clang_format, *map(str, tracked_files(".hpp", ".cpp"))]),
        steps.check("ruff check", [PYTHON, "-m", "ruff", "check"]),
        steps.check("ruff format", [PYTHON, "-m", "ruff", "format", "--check"]),
        steps.check("layers", [PYTHON, "tools/check_layers.py"]),
        steps.check("paths in documents", [PYTHON, "tools/check_docs.py"]),
        steps.check("licence lines", [PYTHON, "tools/check_licence.py"]),
        count.pytest(steps, "tests of these tools", [*tests, "--noconftest", "tests/tools"]),
    ]
    steps.end(mypy)
    return all(step.succeeded for step in [*checks, mypy])


def clang_tidy(steps: Steps, *mode: str) -> Step:
    """Runs clang-tidy over files that are new or changed; `mode` may be `tests` or `analyser`.

    Raises:
        StepFailed: if CMake cannot list the files
    """
    configure("lint")
    tool = [PYTHON, "tools/run_clang_tidy.py", "build/lint", str(jobs()), *mode]
    step = steps.check(" ".join(["clang-tidy", *mode]), tool, **LARGE_PAGES)
    print(f"    {step.last_line()}")
    return step
