# SPDX-License-Identifier: BSD-3-Clause
"""Parts of `./run soak` on other machines, and with packages of others."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import aarch64
from make_release import VARIABLES, builder, pythons

from .build import build, uses
from .setup import PYTHON, install_debian_packages
from .steps import ROOT, NotRun, Step, Steps

STEPS = Steps("soak")
LEROBOT_PYTHON = "3.12"  # the oldest that it runs with
# Tests of bindings and of programs for the original, of which the most depends on versions.
TESTS_WITH_OLDEST = (
    *("test_described_structs.py", "test_elements.py", "test_errors.py", "test_frontend.py"),
    *("test_grasping.py", "test_hand.py", "test_mappings.py", "test_planning.py"),
    "test_simulation.py",
)
TESTS_OF_COMPAT_WITH_OLDEST = (
    *("test_data_set_packages.py", "test_kinematics.py", "test_logs.py", "test_platform.py"),
    *("test_symbols.py", "test_tasks_of_the_original.py"),
)


def project_of(folder: str = ".") -> dict[str, Any]:
    """The content of a pyproject.toml."""
    return tomllib.loads((ROOT / folder / "pyproject.toml").read_text())


@contextmanager
def environment(name: str, python: Path, packages: Sequence[str]) -> Iterator[Path]:
    """An environment with these packages in build/, which is removed at the end.

    Raises:
        NotRun: if they cannot be had here
    """
    folder = ROOT / "build" / name
    shutil.rmtree(folder, ignore_errors=True)
    try:
        STEPS.run(f"an environment for {name}", [str(python), "-m", "venv", str(folder)])
        install = [*pip(folder), "install", "--progress-bar=off", *packages]
        done = subprocess.run(install, capture_output=True, text=True)
        if done.returncode != 0:
            raise NotRun(f"pip gives {name} nothing: {done.stderr.strip().rpartition(chr(10))[2]}")
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def pip(folder: Path) -> list[str]:
    """The command pip of an environment."""
    return [str(folder / "bin" / "python"), "-m", "pip", "--disable-pip-version-check"]


def lerobot() -> Step:
    """Records, replays, teleoperates, trains and lets a policy act with LeRobot itself.

    Raises:
        NotRun: if this machine lacks something
    """
    python = pythons().get(LEROBOT_PYTHON)
    if python is None:
        raise NotRun(f"this machine has no Python {LEROBOT_PYTHON}, which LeRobot needs")
    if shutil.disk_usage(ROOT).free < 12e9:
        raise NotRun(f"{ROOT} has less than 12 GB of room, which LeRobot's PyTorch needs")
    with environment("lerobot", python, project_of()["dependency-groups"]["lerobot"]) as folder:
        wheels = folder / "wheels"
        tool = [PYTHON, "tools/make_wheel.py", str(wheels), str(builder(LEROBOT_PYTHON, python))]
        STEPS.run("our wheel for it", [*tool, *(f"{k}={value}" for k, value in VARIABLES.items())])
        sources = folder / "sources"  # setuptools leaves files in them
        shutil.copytree(ROOT / "packages" / "lerobot_robot_trifinger", sources)
        ours = [*map(str, wheels.glob("trifinger-*.whl")), str(sources)]
        STEPS.run("ours beside it", [*pip(folder), "install", "--progress-bar=off", *ours])
        use = [str(folder / "bin" / "python"), "tests/packages/use_lerobot.py"]
        return STEPS.check("record, replay, teleoperate, train, let a policy act", use)


def cluster() -> Step:
    """Tests sweeps with Ray and with Weights & Biases.

    Raises:
        NotRun: if pip cannot have them
    """
    build("release")
    group = project_of()["dependency-groups"]["cluster"]
    with environment("cluster", Path(sys.executable), group) as folder:
        (site,) = folder.glob("lib/python*/site-packages")
        variables = uses("release")
        variables["PYTHONPATH"] += f":{site}"
        tests = [PYTHON, "-m", "pytest", "-q", "tests/python/test_sweep.py"]
        tests += ["-m", "slow", "-k", "ray or weights"]
        return STEPS.check("sweeps", tests, **variables)


def warp() -> Step:
    """Tests simulations that MuJoCo Warp moves on its CPU device.

    Raises:
        NotRun: if pip cannot have it
    """
    build("release")
    with environment(
        "warp", Path(sys.executable), project_of()["dependency-groups"]["warp"]
    ) as folder:
        (site,) = folder.glob("lib/python*/site-packages")
        variables = uses("release")
        variables["PYTHONPATH"] += f":{site}"
        tests = [PYTHON, "-m", "pytest", "-q", "-s", "packages/trifinger_gpu", "-m", "slow"]
        # Warp keeps what it compiles, 40 s of a processor, for the next run.
        cache = str(ROOT / "build" / "warp_cache")
        return STEPS.check("MuJoCo Warp", tests, **variables, WARP_CACHE_PATH=cache)


def oldest() -> tuple[Step, Step]:
    """Runs tests, and the evaluation of trifinger_rl_datasets itself, with the lowest versions.

    Raises:
        NotRun: if pip cannot have them
    """
    build("release")
    ours = project_of()
    requirements = [
        *ours["project"]["dependencies"],
        *project_of("packages/trifinger_compat")["project"]["dependencies"],
    ]
    lowest = [one.replace(">=", "==") for one in requirements]
    tools = [
        one
        for one in ours["project"]["optional-dependencies"]["test"]
        if re.match(r"(pytest|hypothesis)\b", one)
    ]
    group = ours["dependency-groups"]["oldest"]
    (evaluation,) = (one for one in group if one.startswith("trifinger-rl-datasets"))
    packages = [*lowest, *tools, *(one for one in group if one != evaluation)]
    with environment("oldest", Path(sys.executable), packages) as folder:
        # It demands the original, for which ours stands, and another package of OpenCV.
        STEPS.run("trifinger_rl_datasets", [*pip(folder), "install", "--no-deps", evaluation])
        python = str(folder / "bin" / "python")
        # Behind what is installed, as if it were: what is one file gives way to a package.
        (site,) = folder.glob("lib/python*/site-packages")
        compat = ROOT / "packages" / "trifinger_compat"
        (site / "trifinger_compat.pth").write_text(f"{compat}\n")
        tests = [
            *(str(ROOT / "tests" / "python" / name) for name in TESTS_WITH_OLDEST),
            *(str(compat / "tests" / name) for name in TESTS_OF_COMPAT_WITH_OLDEST),
        ]
        versions = " and ".join(one for one in sorted(set(lowest)) if "==" in one)
        tested = STEPS.check("tests", [python, "-m", "pytest", "-q", *tests], **uses("release"))
        print(f"    with {versions}: {tested.last_line(' passed| failed')}")
        use = [python, "tests/packages/use_oldest.py"]
        return tested, STEPS.check("its own evaluation", use, **uses("release"))


def bare_debians() -> Iterable[Step]:
    """Runs what the README says on a bare Debian 12 and a bare Debian 13.

    Raises:
        NotRun: if somebody else than root asks for it
    """
    if os.geteuid() != 0:
        raise NotRun("a bare Debian needs root")
    install_debian_packages(STEPS, ("debootstrap",))
    # The clone belongs to whoever called, and not to root.
    script = (
        "git config --global --add safe.directory '*' && git clone --quiet /packages ~/trifinger"
        " && cd ~/trifinger && ./run demo && ./run test"
    )
    for suite in ("bookworm", "trixie"):
        bare = ["tools/on_bare_debian", suite, str(ROOT), "bash", "-c", script]
        yield STEPS.check(f"demo and tests on a bare {suite}", bare)


# Layers whose tests say whether a processor orders and computes as they need it.
LAYERS_ON_ARM = ("base", "ipc", "core", "joint", "log")
# To others, a process in qemu has qemu's name, and goes on where its first thread has returned.
NOT_EMULATED = (r"^ipc\.DescribeProcess$", r"^ipc\.ProcessIdentity$")


def other_processor() -> Iterable[Step]:
    """Makes the files for 64-bit ARM, and lets qemu run tests and wheel."""
    install_debian_packages(STEPS, aarch64.TOOLS)
    build("release")  # Helps of its programs become manual pages.
    files = ROOT / "build" / "packages-aarch64"
    yield STEPS.check("wheel and packages", [PYTHON, "tools/aarch64.py", str(files)])
    build("aarch64", *(f"tests/{layer}/all" for layer in LAYERS_ON_ARM))
    chosen = f"^({'|'.join(LAYERS_ON_ARM)})"
    tests = ["ctest", "--preset", "aarch64", "-L", chosen, "-E", "|".join(NOT_EMULATED)]
    yield STEPS.check(f"C++ tests of {', '.join(LAYERS_ON_ARM)}", tests)
    use = [PYTHON, "tests/packages/use_aarch64.py", str(files)]
    yield STEPS.check("the wheel computes the same", use, **uses("release"))
