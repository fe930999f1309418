# SPDX-License-Identifier: BSD-3-Clause
"""Fetches the robots of others with which robots from files are tested.

    python tools/fetch_robots.py [--all]

The models are parts of Python packages, which nothing here needs otherwise. pip fetches a package
without those that it depends on, and its models alone go to build/robots. `./run test` fetches the
small package, with the Shadow Hand; `./run soak` fetches all, which benchmarks/survey_robots.py
looks at. Tests of robots that are missing are skipped, so a machine without network has nothing to
fear.
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
        ("gymnasium_robotics/envs/",),
        is_small=True,  # 26 MB
    ),
    Source(
        "robosuite",
        tuple(
            f"robosuite/models/assets/{part}/"
            for part in ("robots", "grippers", "bases", "bullet_data")
        ),
        is_small=False,  # 157 MB
    ),
    Source("airo-models", ("airo_models/",), is_small=False),  # 13 MB
    Source("dexterity", ("dexterity/models/vendor/",), is_small=False),  # 9 MB
    Source(
        "dm-control",
        (
            *("dm_control/suite/", "dm_control/locomotion/walkers/assets/"),
            *("dm_control/locomotion/soccer/assets/", "dm_control/third_party/"),
        ),
        is_small=False,  # 56 MB
    ),
    Source(
        "example-robot-data",
        ("cmeel.prefix/share/example-robot-data/robots/",),
        is_small=False,  # 131 MB
    ),
)


def requirement(package: str) -> str:
    """Returns the package with its version, as pyproject.toml pins it."""
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text())
    pins: list[str] = pyproject["dependency-groups"]["robots"]
    return next(pin for pin in pins if pin.startswith(f"{package}=="))


def mark_of(source: Source) -> str:
    """Returns what stands beside the models: their version, and which of them there are."""
    return "\n".join([requirement(source.package), *source.parts])


def is_there(source: Source) -> bool:
    """Says whether the models of this version have been fetched."""
    mark = FOLDER / f"{source.package}.txt"
    return mark.exists() and mark.read_text() == mark_of(source)


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
            names = [
                name
                for name in files.namelist()
                if name.startswith(source.parts) and not name.endswith(".py")
            ]
            files.extractall(FOLDER, names)
    (FOLDER / f"{source.package}.txt").write_text(mark_of(source))


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
