# SPDX-License-Identifier: BSD-3-Clause
"""The verbs of ./run."""

import contextlib
import difflib
import inspect
import os
import shutil
import signal
import sys
from collections.abc import Callable, Iterable
from types import FrameType

from . import product
from .build import build, jobs, presets
from .check import check
from .counting import Count
from .docs import docs
from .lint import clang_tidy, lint
from .machine import machine
from .release import release
from .setup import setup
from .soak import PARTS, soak
from .steps import ROOT, StepFailed, Steps
from .test import layers, test, test_layers

HELP = f"""\
usage: ./run VERB [ARGUMENT ...]

  demo             lift a cube with a simulated TriFinger at 1 kHz; arguments go to the demo
  examples [NAME]  run all examples in C++ and Python, or those that begin with NAME, such as 05
  test             the tests that tell that all works here, in minutes
  test LAYER ...   the C++ tests of layers such as core, under AddressSanitizer
  check            what test leaves out: clang-tidy, sanitizers, pages, browsers, trainings, wheels
  setup            install missing system packages and Python packages
  build [PRESET]   compile into build/PRESET: {", ".join(presets())}; dev if none is given
  wheel            make a Python wheel in build/wheels that needs no compiler
  release          make wheels, packages of Debian, sources and checksums in build/packages, from a
                   clean tree; --check makes them twice and tries them on a bare Debian
  lint             check format, names, types, layers and documents
  docs             build the documentation site into build/docs/html and test it
  bench [MEASURE]  measure speed and latency and compare with references; --help lists the measures
  evaluate WHAT    write docs/results; control, environments: lift, slide and push cubes;
                   skills: throw, turn, draw and so on; cliffs: what each skill stands;
                   challenge: its tasks, by its costs; benchmark: our policies in it;
                   identify: find out what drawn robots are like;
                   learning, push, lift, training: train policies;
                   tracking: find the cube in images;
                   robots: print a table of TriFinger and D'Claw
  soak [PART ...]  the long versions of the tests, a night: {", ".join(PARTS)}
  machine          SocketCAN with a robot in a virtual machine; ./run check does this, too
  clean            remove all builds; the Python packages stay

Each verb first installs what it needs. The full output of every step is in build/logs.
"""


class WrongUse(Exception):
    """The arguments make no sense; the text says which and what would."""


def check_names(what: str, names: Iterable[str], known: Iterable[str]) -> None:
    """Raises WrongUse unless all `names` are `known`."""
    for name in names:
        if name not in known:
            close = difflib.get_close_matches(name, list(known), 1)
            hint = f"did you mean '{close[0]}'?" if close else f"there are {', '.join(known)}"
            raise WrongUse(f"there is no {what} '{name}'; {hint}")


def check_arguments(verb: str, arguments: list[str]) -> None:
    """Raises WrongUse unless the verb takes these arguments."""
    try:
        inspect.signature(VERBS[verb]).bind(*arguments)
    except TypeError as error:
        raise WrongUse(f"{verb}: {error}") from None


def build_verb(preset: str = "dev", *targets: str) -> None:
    """Compiles a preset, or some of its targets."""
    check_names("preset", [preset], presets())
    setup()
    build(preset, *targets)


def test_verb(*names: str) -> int:
    """Runs the quick tests, or those of some layers."""
    check_names("layer", names, layers())
    return test_layers(*names) if names else test()


def lint_verb() -> int:
    """Runs all checks."""
    setup()
    passed = [lint(Count()), clang_tidy(Steps("lint")).succeeded]
    return 0 if all(passed) else 1


def evaluate_verb(experiment: str, *arguments: str) -> None:
    """Repeats an experiment."""
    check_names("experiment", [experiment], product.EVALUATIONS)
    product.evaluate(experiment, *arguments)


def soak_verb(*parts: str) -> int:
    """Runs parts of the soak, or all."""
    check_names("part", parts, PARTS)
    return soak(parts)


def release_verb(*options: str) -> int:
    """Makes all files of a release."""
    check_names("option", options, ["--check"])
    return release(*options)


def clean() -> None:
    """Removes all builds."""
    shutil.rmtree(ROOT / "build", ignore_errors=True)


def print_help() -> None:
    """Prints what the verbs do."""
    print(HELP, end="")


VERBS: dict[str, Callable[..., int | None]] = {
    "demo": product.demo,
    "examples": product.examples,
    "test": test_verb,
    "check": check,
    "setup": setup,
    "build": build_verb,
    "wheel": product.wheel,
    "release": release_verb,
    "lint": lint_verb,
    "bench": product.bench,
    "docs": docs,
    "evaluate": evaluate_verb,
    "soak": soak_verb,
    "machine": machine,
    "clean": clean,
    "help": print_help,
}
WITH_OWN_HELP = ("demo", "bench")


def main(arguments: list[str]) -> int:
    """Runs a verb and returns the exit status."""
    verb, *rest = arguments or ["help"]
    asks_for_help = {"-h", "--help"}
    if verb in asks_for_help or (verb not in WITH_OWN_HELP and asks_for_help & set(rest[:1])):
        verb, rest = "help", []

    def end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        sys.exit(128 + number)

    signal.signal(signal.SIGTERM, end)
    os.environ["CMAKE_BUILD_PARALLEL_LEVEL"] = str(jobs())
    os.environ["CTEST_PARALLEL_LEVEL"] = str(jobs() + 1)  # one more, because some tests only wait
    os.environ.setdefault("MUJOCO_GL", "egl")  # the default of MuJoCo needs a screen
    try:
        check_names("verb", [verb], VERBS)
        check_arguments(verb, rest)
        return VERBS[verb](*rest) or 0
    except WrongUse as error:
        print(f"./run: {error}\n./run --help lists the verbs.", file=sys.stderr)
        return 2
    except StepFailed:
        return 1
    except KeyboardInterrupt:
        # The step got Ctrl-C, too, and cleans up. A second Ctrl-C ends it.
        with contextlib.suppress(KeyboardInterrupt):
            Steps.wait()
        return 128 + signal.SIGINT
    finally:
        Steps.stop()
