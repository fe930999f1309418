# SPDX-License-Identifier: BSD-3-Clause
import shlex
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
import trifinger
from trifinger import extras

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]


def test_knows_the_extras_of_the_package() -> None:
    for_others = {"all", "test", "lint", "wheel"}
    assert set(extras.MODULES) == set(PROJECT["optional-dependencies"]) - for_others


def test_all_has_every_extra_for_users() -> None:
    (everything,) = PROJECT["optional-dependencies"]["all"]
    assert everything == f"trifinger[{','.join(extras.MODULES)}]"


@pytest.mark.parametrize("extra", extras.MODULES)
def test_nothing_is_missing_where_all_is_installed(extra: str) -> None:
    extras.require(extra)


def test_names_what_is_missing_and_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    required = [f'{each}; extra == "film"' for each in PROJECT["optional-dependencies"]["film"]]
    monkeypatch.setattr(metadata, "requires", lambda _: ["numpy>=2", 'x; extra == "y"', *required])
    for module in ("av", "OpenGL"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(trifinger.Error) as missing:
        extras.require("film")
    install = shlex.join(PROJECT["optional-dependencies"]["film"])
    assert str(missing.value) == f"OpenGL and av are missing: pip install {install}"
    with pytest.raises(trifinger.Error, match=r"^av is missing: pip install "):
        extras.require("film", "av")
    extras.require("film", "matplotlib")


@pytest.mark.parametrize(
    ("extra", "installs"), [("trifinger-view", "a==1 b==2"), ("trifinger-view[ros2]", "c==3")]
)
def test_says_how_to_get_what_another_package_of_the_project_needs(
    extra: str, installs: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    required = {"trifinger-view": ["a==1", "b==2", 'c==3; extra == "ros2"', 'd; extra == "x"']}
    monkeypatch.setattr(metadata, "requires", required.__getitem__)
    with pytest.raises(trifinger.Error) as missing:
        extras.require(extra, "no_such_module")
    assert str(missing.value) == f"no_such_module is missing: pip install {installs}"
