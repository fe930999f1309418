# SPDX-License-Identifier: BSD-3-Clause
"""Fetches the robots of others with which robots from files are tested.

    python tools/fetch_robots.py [--all]

The models are parts of Python packages, which nothing here needs otherwise. pip fetches a package
without those that it depends on, and its models alone go to build/robots. `./run test` fetches the
small package, with the Shadow Hand; `./run soak` fetches all. Tests of robots that are missing are
skipped, so a machine without network has nothing to fear.
"""

import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "robots"


@dataclass(frozen=True)
class Source:
    """A package with models: its name in pyproject.toml, and what of it is needed."""

    package: str
    parts: tuple[str, ...]  # beginnings of the names of files
    is_small: bool


SOURCES = (
    Source(
        "gymnasium-robotics",
        (
            *("gymnasium_robotics/envs/assets/hand/", "gymnasium_robotics/envs/assets/stls/hand/"),
            "gymnasium_robotics/envs/assets/textures/",
        ),
        is_small=True,  # 26 MB
    ),
    Source(
        "robosuite",
        (
            *("robosuite/models/assets/robots/panda/", "robosuite/models/assets/robots/ur5e/"),
            "robosuite/models/assets/grippers/jaco_three_finger_gripper.xml",
            "robosuite/models/assets/grippers/meshes/jaco_three_finger_gripper/",
        ),
        is_small=False,  # 157 MB
    ),
)


def requirement(package: str) -> str:
    """Returns the package with its version, as pyproject.toml pins it."""
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text())
    pins: list[str] = pyproject["dependency-groups"]["robots"]
    return next(pin for pin in pins if pin.startswith(f"{package}=="))


def is_there(source: Source) -> bool:
    """Says whether the models of this version have been fetched."""
    mark = FOLDER / f"{source.package}.txt"
    return mark.exists() and mark.read_text() == requirement(source.package)


def fetch(source: Source) -> None:
    """Fetches the package and unpacks its models, or says that it cannot."""
    pin = requirement(source.package)
    with tempfile.TemporaryDirectory() as folder:
        words = ["download", "--disable-pip-version-check", "--no-deps", "--dest", folder, pin]
        if subprocess.run([sys.executable, "-m", "pip", *words], check=False).returncode != 0:
            print(f"not fetched: {pin}; tests of its robots are skipped")
            return
        (wheel,) = Path(folder).glob("*.whl")
        with zipfile.ZipFile(wheel) as files:
            names = [name for name in files.namelist() if name.startswith(source.parts)]
            files.extractall(FOLDER, names)
    (FOLDER / f"{source.package}.txt").write_text(pin)


def main(words: Sequence[str]) -> int:
    """Fetches what is missing."""
    if unknown := [word for word in words if word != "--all"]:
        print(f"fetch_robots.py: {unknown[0]} is not known, --all is", file=sys.stderr)
        return 2
    for source in SOURCES:
        if (source.is_small or "--all" in words) and not is_there(source):
            fetch(source)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
