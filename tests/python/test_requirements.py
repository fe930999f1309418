# SPDX-License-Identifier: BSD-3-Clause
"""The project is on no index: nothing lets pip look there for a package by one of its names."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
PROJECTS = [ROOT / "pyproject.toml", *ROOT.glob("packages/*/pyproject.toml")]
OWN = {tomllib.loads(path.read_text())["project"]["name"].replace("_", "-") for path in PROJECTS}
ELSEWHERE = {"mujoco-warp", "warp-lang", "lerobot", "setuptools"}  # in environments of their own
# What tells people, or pip itself, to install something.
TEXTS = [
    *(ROOT / name for name in ("README.md", "apps/shared/external_command.cpp")),
    *(path for path in (ROOT / "docs").rglob("*") if path.suffix in (".md", ".ipynb")),
    *(path for path in (ROOT / "packages").rglob("*") if path.suffix in (".md", ".py")),
    *(path for path in (ROOT / "python").rglob("*.py")),
    *(ROOT / "tests" / "packages").glob("*.sh"),
    *(ROOT / "tools").rglob("*.py"),
]


def words_of(text: str) -> set[str]:
    """What follows `pip install` in a text, word by word."""
    lines = re.findall(r"pip install\b([^\n`#;&]*)", text)
    return {word.strip("'\"") for line in lines for word in line.split()}


def is_own(word: str) -> bool:
    found = re.match(r"[\w.-]+", word)
    return found is not None and found[0].replace("_", "-") in OWN and "/" not in word


def test_own_names_are_recognised() -> None:
    assert {"trifinger", "trifinger-compat", "lerobot-robot-trifinger"} <= OWN
    words = words_of("`pip install --find-links F 'trifinger[demo]'` and pip install ./trifinger .")
    assert {word for word in words if is_own(word)} == {"trifinger[demo]"}


@pytest.mark.parametrize("path", PROJECTS, ids=lambda path: path.parent.name)
def test_no_package_requires_another_one_of_the_project(path: Path) -> None:
    project = tomllib.loads(path.read_text())["project"]
    required = [*project["dependencies"]]
    for extra in project.get("optional-dependencies", {}).values():
        required += extra
    # An extra may have other extras of the same package, which pip has by then.
    names = {Requirement(each).name for each in required} - {project["name"]}
    assert [name for name in names if is_own(name)] == []


def locked() -> dict[str, str]:
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    pairs = (line.split("==") for line in lines if not line.startswith("#"))
    return {name.lower().replace("_", "-"): version for name, version in pairs}


@pytest.mark.parametrize("path", PROJECTS, ids=lambda path: path.parent.name)
def test_the_locked_versions_are_in_the_ranges_that_others_may_use(path: Path) -> None:
    pyproject = tomllib.loads(path.read_text())
    required = [*pyproject["project"]["dependencies"], *pyproject["build-system"]["requires"]]
    for extra in pyproject["project"].get("optional-dependencies", {}).values():
        required += extra
    versions = locked()
    for requirement in map(Requirement, required):
        if is_own(requirement.name) or requirement.name in ELSEWHERE:
            continue
        assert requirement.specifier.contains(versions[requirement.name]), str(requirement)


@pytest.mark.parametrize("path", PROJECTS, ids=lambda path: path.parent.name)
def test_no_package_takes_the_place_of_an_installed_opencv(path: Path) -> None:
    required = tomllib.loads(path.read_text())["project"]["dependencies"]
    assert [each for each in required if "opencv" in each] == []


def test_nobody_is_told_to_install_the_project_by_its_name() -> None:
    told = {
        f"{path.relative_to(ROOT)}: {word}"
        for path in TEXTS
        for word in words_of(path.read_text())
        if is_own(word)
    }
    assert told == set()


def test_a_package_is_installed_where_the_sources_were_built(tmp_path: Path) -> None:
    """After `./run demo` pip knows no `trifinger`; without an index it cannot ask for it."""
    sources = tmp_path / "sources"
    subprocess.run(["cp", "-r", str(ROOT / "packages/trifinger_compat"), str(sources)], check=True)
    words = ["install", "--dry-run", "--no-index", "--no-build-isolation", "--quiet", str(sources)]
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", *words]
    done = subprocess.run(pip, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "module",
    [
        path.parent.name if path.stem == "__init__" else path.stem
        for package in (ROOT / "packages").iterdir()
        for path in (*package.glob("*.py"), *package.glob("*/__init__.py"))
    ],
)
def test_a_package_without_trifinger_says_where_to_get_it(module: str) -> None:
    folders = [
        *(ROOT / "packages").iterdir(),
        ROOT / "packages" / "lerobot_robot_trifinger" / "tests" / "lerobot_stand_in",
    ]
    # None: nobody finds it, wherever it is installed.
    code = f"import sys; sys.modules['trifinger'] = None; import {module}"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={"PYTHONPATH": ":".join(map(str, folders))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    said = done.stderr.splitlines()[-1]
    assert said.startswith("ModuleNotFoundError: ")
    assert "needs the package `trifinger`" in said
    assert "docs/installing.md" in said
