# SPDX-License-Identifier: BSD-3-Clause
"""Every name of the table is there, and the table has every name of the ranked list."""

import importlib
import runpy
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from trifinger_compat.symbols import OTHERS, PACKAGES, RANKED, SYMBOLS, Symbol

ROOT = Path(__file__).parents[3]
OURS = [symbol for symbol in SYMBOLS if symbol.path.partition(".")[0].partition(":")[0] in PACKAGES]


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
    assert len(OTHERS) >= 20


@pytest.mark.parametrize("symbol", OURS, ids=lambda symbol: symbol.name)
def test_each_name_is_there(symbol: Symbol) -> None:
    found = find(symbol.path)
    assert found is not None or symbol.name == "CO.cameras[].image"


def test_only_names_of_data_sets_belong_to_other_packages() -> None:
    others = [symbol for symbol in SYMBOLS if symbol not in OURS]
    assert {symbol.path.partition(".")[0].partition(":")[0] for symbol in others} == {
        "trifinger_rl_datasets",
        "rrc_2022_datasets",
    }
    assert all(symbol.note for symbol in others)


def test_whatever_differs_says_how() -> None:
    assert all(symbol.note for symbol in SYMBOLS if symbol.verdict != "works")


def test_the_page_has_the_table() -> None:
    writer = runpy.run_path(str(ROOT / "tools" / "write_compat_table.py"))
    text = writer["PAGE"].read_text()
    if writer["page"](text) != text:
        pytest.fail("the table has changed: python tools/write_compat_table.py")
