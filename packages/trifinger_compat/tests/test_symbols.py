# SPDX-License-Identifier: BSD-3-Clause
"""Every name of the table is there, and the table has every name of the ranked list."""

import ast
import importlib
import re
import runpy
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tested_names import TESTED
from trifinger_compat.symbols import OTHERS, RANKED, SYMBOLS, Symbol

ROOT = Path(__file__).parents[3]


# Names that a test has by another one, from its parameters or its file.
SHORT_NAMES = {
    "test_ranges_have_their_figures": (
        *("robot_torque", "robot_position", "robot_velocity"),
        *("object_position", "object_orientation"),
    ),
    "test_a_camera_log_is_read_and_written_as_the_sheet_describes_it": ("LogReader",),
    "test_actions_have_exactly_so_many_numbers": ("trifinger",),
}


@cache
def instance(path: str) -> Any:
    """An object of a class, for members that only objects have."""
    import trifinger_simulation as simulation
    from trifinger_object_tracking.py_tricamera_types import LogReader
    from trifinger_simulation.tasks.move_cube import Pose

    makers: dict[str, Callable[[], Any]] = {
        "trifinger_simulation:TriFingerPlatform": simulation.TriFingerPlatform,
        "trifinger_simulation:SimFinger": lambda: simulation.SimFinger("trifingerpro"),
        "trifinger_simulation:Observation": simulation.Observation,
        "trifinger_simulation:Action": lambda: simulation.Action(np.zeros(9), np.zeros(9)),
        "trifinger_simulation:CameraObservation": simulation.CameraObservation,
        "trifinger_simulation:TriCameraObservation": simulation.TriCameraObservation,
        "trifinger_simulation:TriCameraObjectObservation": simulation.TriCameraObjectObservation,
        "trifinger_simulation.camera:CameraArray": lambda: simulation.camera.CameraArray(()),
        "trifinger_simulation.tasks.move_cube:Pose": Pose,
        "trifinger_object_tracking.py_tricamera_types:LogReader": LogReader,
    }
    return makers[path]() if path in makers else None


def find(path: str) -> Any:
    """What a path of the table names; raises AttributeError or ModuleNotFoundError."""
    module, _, attributes = path.partition(":")
    # The modules `camera` and `tricamera` are also attributes of their package.
    package, _, name = module.partition(".")
    try:
        thing: Any = importlib.import_module(module)
    except ModuleNotFoundError:
        thing = getattr(importlib.import_module(package), name)
    where = module + ":"
    for attribute in filter(None, attributes.split(".")):
        where += attribute
        if not hasattr(thing, attribute):
            known = instance(where.rpartition(attribute)[0].rstrip("."))
            thing = thing if known is None else known
        thing = getattr(thing, attribute)
        where += "."
    return thing


def test_the_table_has_the_160_ranked_names_and_the_other_38_and_no_name_twice() -> None:
    assert len(RANKED) == 160
    names = [symbol.name for symbol in SYMBOLS]
    assert len(names) == len(set(names))
    sites = [symbol.sites for symbol in RANKED]
    assert sites == sorted(sites, reverse=True)
    assert sum(sites) == pytest.approx(0.92 * 3402, rel=0.01)
    assert len(OTHERS) == 38


@pytest.mark.parametrize("symbol", SYMBOLS, ids=lambda symbol: symbol.name)
def test_each_name_is_there(symbol: Symbol) -> None:
    found = find(symbol.path)
    assert found is not None or symbol.name == "CO.cameras[].image"


@cache
def text_of_tests(file: str) -> dict[str, str]:
    """The text of each test of a file."""
    text = Path(__file__).with_name(file).read_text()
    return {
        node.name: ast.get_source_segment(text, node) or ""
        for node in ast.parse(text).body
        if isinstance(node, ast.FunctionDef)
    }


@pytest.mark.parametrize("symbol", SYMBOLS, ids=lambda symbol: symbol.name)
def test_each_name_has_a_test_of_its_behaviour(symbol: Symbol) -> None:
    file, _, test = TESTED[symbol.name].partition("::")
    text = text_of_tests(file)[test]
    assert "assert" in text or "pytest.raises" in text
    # What the name ends with is in the test itself, unless the test has a short name for it.
    name = re.split(r"[.:]", symbol.path.rstrip(":"))[-1]
    if name not in SHORT_NAMES.get(test, ()):
        assert re.search(rf"\b{name}\b", text)


def test_the_table_of_tests_has_no_other_names() -> None:
    assert sorted(TESTED) == sorted(symbol.name for symbol in SYMBOLS)


def test_whatever_differs_says_how() -> None:
    assert all(symbol.note for symbol in SYMBOLS if symbol.verdict != "works")


def test_the_page_has_the_table() -> None:
    writer = runpy.run_path(str(ROOT / "tools" / "write_compat_table.py"))
    text = writer["PAGE"].read_text()
    if writer["page"](text) != text:
        pytest.fail("the table has changed: python tools/write_compat_table.py")
