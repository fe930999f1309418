# SPDX-License-Identifier: BSD-3-Clause
"""Installs what is missing: packages of Debian, and a virtual environment in .venv."""

import os
import platform
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Collection, Iterable

from link_into_venv import PROJECTS

from .steps import ROOT, StepFailed, Steps

OF_DEVELOPERS = ("test", "wheel", "lint")  # extras of Python packages
VENV = ROOT / ".venv"
PROGRAMS = f"{VENV}/bin"
PYTHON = f"{PROGRAMS}/python"
LOCK = ROOT / "requirements.lock"
PINS = VENV / "pins"  # what has been installed there

# Needed besides git and python3.
DEBIAN_PACKAGES = (
    *("g++", "cmake", "ninja-build", "ccache", "python3-dev", "python3-venv"),
    *("libeigen3-dev", "libyaml-cpp-dev", "libfmt-dev", "libcli11-dev"),
    *("libzstd-dev", "liblz4-dev", "libdeflate-dev", "pkgconf", "nlohmann-json3-dev"),
    *("libgtest-dev", "libgmock-dev", "librapidcheck-dev", "libbenchmark-dev"),
    *("clang", "libclang-rt-dev"),  # the builds dev and fuzz
    *("libegl1", "libgl1-mesa-dri", "libopengl0"),  # pictures without a screen
    *("libturbojpeg0", "libaravis-0.8-0"),  # images in logs; industrial cameras
    "chromium",  # the browser in which the page of `trifinger view` is tested
    *("man-db", "mandoc", "gnupg"),  # manual pages, signatures
    "rt-tests",  # cyclictest, with which lateness is compared
    *("slurm-wlm", "munge"),  # the queue of a shared robot
    *("qemu-system-x86", "busybox", "can-utils"),  # the virtual machine of tests with CAN
)


def setup(without: Collection[str] = ()) -> None:
    """Installs what is missing, which takes no time if nothing is.

    Args:
        without: extras of Python packages that are not needed

    Raises:
        StepFailed: if a package cannot be installed
    """
    steps = Steps("setup")
    install_debian_packages(steps, DEBIAN_PACKAGES)
    if shutil.which("ccache"):  # the build folders share objects, and comments change none
        os.environ["CMAKE_CXX_COMPILER_LAUNCHER"] = "ccache"
        os.environ["CCACHE_BASEDIR"] = str(ROOT)
        # Without these, ccache keeps nothing that is compiled with precompiled headers.
        os.environ["CCACHE_SLOPPINESS"] = "pch_defines,time_macros"
    _make_virtual_environment(steps, python_packages(without))
    _link_package(steps)


def fetch_robots(*options: str) -> None:
    """Fetches the robots of others for tests, if they are missing and pip can reach them."""
    step = Steps("setup").check("robots of others", [PYTHON, "tools/fetch_robots.py", *options])
    if missing := step.last_line("not fetched"):
        print(f"    {missing}")


def _is_installed(package: str) -> bool:
    query = ["dpkg-query", "-W", "-f", "${Status}", package]
    answer = subprocess.run(query, capture_output=True, text=True)
    return answer.stdout.endswith("ok installed")


def install_debian_packages(steps: Steps, packages: Iterable[str]) -> None:
    """Installs those of `packages` that are missing, through sudo if need be."""
    missing = [package for package in packages if not _is_installed(package)]
    if not missing:
        return
    install = ["apt-get", "install", "--yes", "--no-install-recommends", *missing]
    as_root = []
    if os.geteuid() != 0:
        if not shutil.which("sudo"):
            print("As root, run:", *install, file=sys.stderr)
            raise StepFailed
        print("Installing with sudo:", *missing, flush=True)
        subprocess.run(["sudo", "-v"], check=True)  # asks for the password
        as_root = ["sudo", "DEBIAN_FRONTEND=noninteractive"]
    os.environ["DEBIAN_FRONTEND"] = "noninteractive"
    steps.run("package lists", [*as_root, "apt-get", "update"])
    steps.run(f"{len(missing)} system packages", [*as_root, *install])


def locked_versions() -> dict[str, str]:
    """Returns the version of each package in requirements.lock, by its name in lower case."""
    lines = (line.partition("==") for line in LOCK.read_text().splitlines() if "==" in line)
    return {name.lower().replace("_", "-"): version for name, _, version in lines}


def python_packages(without: Collection[str] = ()) -> list[str]:
    """Returns what any pyproject.toml requires of others, in the versions of requirements.lock.

    Args:
        without: extras whose packages are left out, unless others need them
    """
    groups: list[list[str]] = []
    own = set()
    for path in PROJECTS:
        pyproject = tomllib.loads(path.read_text())
        project = pyproject["project"]
        own.add(project["name"])
        groups += [
            pyproject["build-system"]["requires"],
            project["dependencies"],
            *(
                packages
                for extra, packages in project.get("optional-dependencies", {}).items()
                if extra not in without
            ),
        ]
    names = {re.split(r"[\[<>=~!; ]", package)[0] for group in groups for package in group}
    versions = locked_versions()
    # LeRobot gets an environment of its own.
    return sorted(f"{name}=={versions[name]}" for name in names - own if name in versions)


def _make_virtual_environment(steps: Steps, packages: Collection[str]) -> None:
    # A virtual environment contains absolute paths, so one that was moved or copied is made again.
    place = f"{ROOT} Python {platform.python_version()}"
    installed = PINS.read_text().splitlines() if PINS.exists() else []
    if installed[:1] != [place]:
        steps.run("virtual environment", ["python3", "-m", "venv", "--clear", str(VENV)])
        installed = []
    if not set(packages) <= set(installed[1:]):
        # Python compiles a module when it is first imported, so pip need not compile all of them.
        pip = [PYTHON, "-m", "pip", "install", "--disable-pip-version-check", "--no-compile"]
        steps.run("Python packages", [*pip, "--constraint", str(LOCK), *packages])
        PINS.unlink(missing_ok=True)  # hard links to the old file keep the old content
        PINS.write_text("\n".join([place, *packages, ""]))


def _link_package(steps: Steps) -> None:
    """Lets .venv use the package in build/release, and all others, as if they were installed."""
    launcher = VENV / "bin" / "trifinger"
    tool = ROOT / "tools" / "link_into_venv.py"
    sources = [tool, *PROJECTS, *(ROOT / "python" / "scripts").iterdir()]
    if not launcher.exists() or launcher.stat().st_mtime < max(
        source.stat().st_mtime for source in sources
    ):
        steps.run("link to the package", [PYTHON, str(tool), "build/release/python"])
