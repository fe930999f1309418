# SPDX-License-Identifier: BSD-3-Clause
from pathlib import Path

import pytest
from check_layers import (
    DIRECTLY_BELOW,
    allowed_layers,
    layer_of,
    mistakes_of_public_headers,
    mistakes_of_table,
    read_table,
    violations,
)


def found(path: str, *lines: str) -> list[str]:
    return list(violations(Path(path), lines))


TABLE = """
| layer | what it is | directly above |
|---|---|---|
| `base` | errors | |
| `sim` | robots, as in `joint` | `base` |

| `other` | table | `base` |
"""


def test_reads_the_table() -> None:
    assert read_table(TABLE) == {"base": (), "sim": ("base",)}


def test_a_row_names_rows_above_it_and_has_files() -> None:
    table = {"base": (), "core": ("ipc",), "ipc": ("base",)}
    assert list(mistakes_of_table(table, {"base", "core"})) == [
        "ARCHITECTURE.md: 'core' is directly above 'ipc', which has no row before.",
        "ARCHITECTURE.md: the layer 'ipc' has no files.",
    ]


def test_public_headers_are_those_that_users_need() -> None:
    texts = {
        "core/frontend.hpp": '#include "trifinger/core/session.hpp"\n#include <span>\n',
        "core/session.hpp": '#include "ipc/ring.hpp"\n',
        "log/copy.hpp": "",
    }
    assert list(mistakes_of_public_headers(["core/frontend.hpp", "log/log.hpp"], texts)) == [
        "include/trifinger/log/log.hpp: does not exist, and programs of users include it.",
        "include/trifinger/core/session.hpp: includes 'ipc/ring.hpp', which is not public.",
        "include/trifinger/log/copy.hpp: no program of a user includes it. "
        "Move it to src/log/copy.hpp.",
    ]


def test_a_header_that_is_not_public_is_of_its_layer_too() -> None:
    assert found("src/ipc/x.cpp", '#include "core/log_folder.hpp"') == [
        "src/ipc/x.cpp:1: 'ipc' may not include 'core', only base, ipc."
    ]
    assert found("src/ipc/x.cpp", '#include "base/latest.hpp"', '#include "parts/x.hpp"') == []


def test_names_the_place_and_what_is_allowed() -> None:
    assert found(
        "src/core/series.cpp", "#include <span>", '#include "trifinger/sim/driver.hpp"'
    ) == ["src/core/series.cpp:2: 'core' may not include 'sim', only base, ipc, realtime, core."]


@pytest.mark.parametrize("layer", DIRECTLY_BELOW)
def test_a_layer_includes_itself_and_what_lies_below(layer: str) -> None:
    lines = [f'#include "trifinger/{below}/x.hpp"' for below in allowed_layers(layer)]
    assert found(f"packages/trifinger_x/include/trifinger/{layer}/x.hpp", *lines) == []


JUDGE = "packages/trifinger_skills/src/manipulation/skills/lift/judge.cpp"


@pytest.mark.parametrize("path", ["packages/trifinger_x/part/x.cpp", "evaluation/x.cpp", JUDGE])
def test_packages_and_the_evaluation_include_a_layer_of_a_package(path: str) -> None:
    assert found(path, '#include "trifinger/manipulation/skill.hpp"') == []


@pytest.mark.parametrize("path", ["apps/robot/run.cpp", "examples/1_loop.cpp", "benchmarks/x.cpp"])
def test_nothing_else_includes_a_layer_of_a_package(path: str) -> None:
    assert found(path, '#include "trifinger/manipulation/skill.hpp"')


@pytest.mark.parametrize("path", ["packages/trifinger_x/tests/manipulation/x_test.cpp", JUDGE])
def test_tests_of_packages_and_judges_include_the_evaluation(path: str) -> None:
    assert found(path, '#include "evaluation/skill_trial.hpp"') == []


@pytest.mark.parametrize("path", ["src/sim/x.cpp", "packages/trifinger_x/src/sim/x.cpp"])
def test_no_layer_includes_the_evaluation(path: str) -> None:
    assert found(path, '#include "evaluation/skill_trial.hpp"')


@pytest.mark.parametrize("layer", DIRECTLY_BELOW)
def test_no_two_layers_include_each_other(layer: str) -> None:
    assert not any(layer in allowed_layers(below) for below in allowed_layers(layer) - {layer})


@pytest.mark.parametrize(("layer", "sibling"), [("mcap", "realtime"), ("joint", "model")])
def test_siblings_do_not_include_each_other(layer: str, sibling: str) -> None:
    assert found(f"tests/{layer}/x_test.cpp", f"#include <trifinger/{sibling}/x.hpp>")
    assert found(f"tests/{sibling}/x_test.cpp", f"#include <trifinger/{layer}/x.hpp>")


def test_a_directory_without_a_place_in_the_table_is_an_error() -> None:
    assert found("src/utils/x.cpp") == [
        "src/utils/x.cpp: the layer 'utils' is not in the table of ARCHITECTURE.md."
    ]


@pytest.mark.parametrize(
    ("path", "layer"),
    [
        ("include/trifinger/ipc/process.hpp", "ipc"),
        ("src/ipc/futex.hpp", "ipc"),
        ("src/ipc/detail/futex.cpp", "ipc"),
        ("tests/ipc/futex_test.cpp", "ipc"),
        ("apps/robot/run.cpp", "apps"),
        ("packages/trifinger_x/include/trifinger/ipc/x.hpp", "ipc"),
        ("packages/trifinger_x/src/ipc/parts/x.cpp", "ipc"),
        ("packages/trifinger_x/tests/ipc/x_test.cpp", "ipc"),
        ("bindings/module.cpp", "bindings"),
        ("packages/trifinger_x/part/x.cpp", "apps"),
        ("packages/trifinger_x/bindings/x.cpp", "bindings"),
    ],
)
def test_the_directory_is_the_layer(path: str, layer: str) -> None:
    assert layer_of(Path(path)) == layer


@pytest.mark.parametrize("path", ["examples/1_loop.cpp", "tests/support/guard.hpp"])
def test_what_is_no_layer_may_include_all_of_the_core(path: str) -> None:
    assert found(path, '#include "trifinger/sim/driver.hpp"') == []


@pytest.mark.parametrize(
    ("path", "namespace"),
    [
        ("include/trifinger/core/x.hpp", "trifinger"),
        ("src/core/x.cpp", "trifinger::detail"),
        ("src/log/x.cpp", "trifinger::log"),
        ("src/log/read/x.cpp", "trifinger::log::detail"),
        ("bindings/log/x.cpp", "trifinger::bindings"),
        ("tests/core/x_test.cpp", "trifinger::test"),
    ],
)
def test_a_layer_has_a_namespace(path: str, namespace: str) -> None:
    assert found(path, f"namespace {namespace} {{") == []


@pytest.mark.parametrize("namespace", ["trifinger", "trifinger::logs", "trifinger::log::read"])
def test_another_namespace_is_named_with_the_right_ones(namespace: str) -> None:
    assert found("src/log/x.cpp", "", f"namespace {namespace} {{") == [
        f"src/log/x.cpp:2: 'log' may not open the namespace '{namespace}', "
        "only 'trifinger::log' and 'trifinger::log::detail'."
    ]


@pytest.mark.parametrize("namespace", ["trifinger::core", "trifinger::layout"])
def test_layers_of_every_program_share_a_namespace(namespace: str) -> None:
    assert found("include/trifinger/core/x.hpp", f"namespace {namespace} {{")
