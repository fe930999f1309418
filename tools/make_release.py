# SPDX-License-Identifier: BSD-3-Clause
"""Makes all files of a release from these sources: `./run release`.

    tools/make_release.py FOLDER

These are a wheel for Python 3.11 and one for all later ones, the wheels of packages/, the packages
of Debian, the sources, bills of materials, notes from the CHANGELOG, and checksums. The same commit
gives the same bytes in every folder, on the same system. pyproject.toml has the version.
"""

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from zipfile import ZipFile

from make_wheel import ROOT, make_wheel, make_wheels_of_packages, reproducible

# From 3.12 on, a wheel is for all later ones, too: wheel.py-api in pyproject.toml.
VERSIONS_OF_PYTHON = ("3.11", "3.12", "3.13", "3.14")
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
VERSION: str = PYPROJECT["project"]["version"]
# As in build/release, so that ccache has all objects.
VARIABLES = {"TRIFINGER_WARNINGS_AS_ERRORS": "ON"}


def run(*command: str | Path, **variables: str) -> None:
    """Runs a command in the folder of the sources; raises CalledProcessError if it fails."""
    environment = {**os.environ, **reproducible(), **variables}
    subprocess.run([str(word) for word in command], check=True, cwd=ROOT, env=environment)


def pythons() -> dict[str, Path]:
    """Returns the Pythons of this machine, on the PATH and of pyenv."""
    found = {}
    for version in VERSIONS_OF_PYTHON:
        pyenv = sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python{version}"))
        on_path = shutil.which(f"python{version}")
        for python in [*pyenv, *([Path(on_path)] if on_path else [])]:
            # pyenv's PATH has programs that only say that they are not chosen.
            command: list[str | Path] = [python, "-c", "import ensurepip"]
            if subprocess.run(command, capture_output=True).returncode == 0:
                found[version] = python
                break
    return found


def builder(version: str, python: Path) -> Path:
    """Returns this Python with the packages that building a wheel needs, in an environment."""
    if sys.version_info[:2] == tuple(map(int, version.split("."))):
        return Path(sys.executable)  # .venv has them
    environment = ROOT / "build" / f"python{version}"
    if not (environment / "bin" / "pip").exists():
        run(python, "-m", "venv", environment)
    pip: list[str | Path] = [
        environment / "bin" / "python",
        "-m",
        "pip",
        "--disable-pip-version-check",
        "--quiet",
    ]
    requires: list[str] = PYPROJECT["build-system"]["requires"]
    run(*pip, "install", *requires)
    return environment / "bin" / "python"


def make_wheels(folder: Path) -> None:
    """Makes the wheels of the package, and of the packages beside it."""
    found = pythons()
    later = [version for version in found if version != "3.11"]
    for version in [one for one in ("3.11", *later[:1]) if one in found]:
        print(f"wheel for Python {version}", flush=True)
        make_wheel(folder, VARIABLES, str(builder(version, found[version])))
    for project in sorted((ROOT / "packages").glob("*/pyproject.toml")):
        own = tomllib.loads(project.read_text())["project"]
        if own["version"] != VERSION:
            sys.exit(f"{project}: the version is {own['version']}, but that of all is {VERSION}")
    make_wheels_of_packages(folder)


def make_debian_packages(folder: Path, preset: str = "package", **variables: str) -> None:
    """Makes the packages of Debian with CPack; `variables` are for that."""
    build = ROOT / "build" / preset
    shutil.rmtree(build / "_CPack_Packages", ignore_errors=True)
    for old in build.glob("*.deb"):
        old.unlink()
    run("cmake", "--preset", preset)
    run("cmake", "--build", "--preset", preset)
    run("cpack", "--config", build / "CPackConfig.cmake", "-B", build, **variables)
    for package in build.glob("*.deb"):
        shutil.move(package, folder / package.name)


def put_bills_beside(folder: Path) -> None:
    """Copies the bill of materials of each wheel and package out of it: FILE.spdx.json."""
    for wheel in folder.glob("*.whl"):
        with ZipFile(wheel) as archive:
            (name,) = (name for name in archive.namelist() if name.endswith(".spdx.json"))
            wheel.with_name(f"{wheel.name}.spdx.json").write_bytes(archive.read(name))
    for package in folder.glob("*.deb"):
        unpack = ["dpkg-deb", "--fsys-tarfile", str(package)]
        files = subprocess.run(unpack, check=True, capture_output=True).stdout
        name = package.name.partition("_")[0]
        path = f"./usr/share/doc/{name}/{name}.spdx.json"
        take = ["tar", "--extract", "--to-stdout", path]
        bill = subprocess.run(take, input=files, check=True, capture_output=True).stdout
        package.with_name(f"{package.name}.spdx.json").write_bytes(bill)


def make_source_archive(folder: Path) -> None:
    """Packs the sources of the commit."""
    name = f"trifinger-{VERSION}"
    archive = ["git", "archive", "--format=tar.gz", f"--prefix={name}/"]
    run(*archive, f"--output={folder / name}.tar.gz", "HEAD")


def notes(changelog: str, version: str) -> str:
    """Returns what the CHANGELOG says of a version; before it is released, what is unreleased."""
    sections = dict(
        re.findall(r"^## \[([^\]]+)\][^\n]*\n(.*?)(?=^## |\Z)", changelog, re.MULTILINE | re.DOTALL)
    )
    if version in sections:
        return f"# TriFinger {version}\n\n{sections[version].strip()}\n"
    return f"# TriFinger {version}, not released yet\n\n{sections['Unreleased'].strip()}\n"


def checksums(folder: Path) -> str:
    """Returns the checksum of each file, as `sha256sum --check` reads it."""
    files = sorted(path for path in folder.iterdir() if path.is_file())
    return "".join(
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files
    )


def make_release(folder: Path) -> None:
    """Makes a folder with all files of a release."""
    os.umask(0o022)  # packages keep the modes of files
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    make_wheels(folder)
    make_debian_packages(folder)
    put_bills_beside(folder)
    make_source_archive(folder)
    (folder / "NOTES.md").write_text(notes((ROOT / "CHANGELOG.md").read_text(), VERSION))
    (folder / "SHA256SUMS").write_text(checksums(folder))


if __name__ == "__main__":
    make_release(Path(sys.argv[1]).resolve())
