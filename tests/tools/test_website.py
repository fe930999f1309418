# SPDX-License-Identifier: BSD-3-Clause
"""Tests of what writes the sources of the documentation site."""

import ast
import base64
import io
import json
from pathlib import Path

import pytest
from PIL import Image
from rows import Row
from website import cpp_reference, faults, figures, pages, pictures, programs, python_reference
from website.contents import CONTENTS


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("docs/logs.md", "logs"),
        ("docs/decisions/hand.md", "decisions/hand"),
        ("README.md", "readme"),
        ("benchmarks/README.md", "benchmarks"),
        ("include/trifinger/core/frontend.hpp", "reference/cpp/core/frontend"),
        (
            "packages/trifinger_skills/include/trifinger/manipulation/skill.hpp",
            "reference/cpp/manipulation/skill",
        ),
        ("config/sim.yml", "source/config/sim.yml"),
        ("config/skills", "source/config/skills/index"),
    ],
)
def test_a_file_has_a_page(path: str, name: str) -> None:
    assert pages.name_of(Path(path)) == name


def test_links_lead_to_pages_of_the_site() -> None:
    linked: set[Path] = set()
    text = "[a](../ARCHITECTURE.md#layers), [b](https://mcap.dev), [c](#here), `[](const int x)`"
    shown = pages.with_links_of_the_site(text, Path("docs/logs.md"), linked)
    assert shown == text.replace("../ARCHITECTURE.md", "/architecture.md")
    assert linked == {Path("ARCHITECTURE.md")}


def test_a_search_finds_a_page_by_words_that_it_does_not_have() -> None:
    page = pages.with_entries("<!-- x -->\n# Cameras\n\ntext\n", ["webcam", "gym.make"])
    keywords = "---\nmyst:\n  html_meta:\n    keywords: gym, make, webcam\n---\n"
    index = "# Cameras\n\n```{index} ! webcam, ! gym.make\n```\n\ntext\n"
    assert page == f"{keywords}<!-- x -->\n{index}"


def test_every_page_is_in_the_side_bar() -> None:
    shown = {
        name.partition("</")[2].rstrip(">") or name for each in CONTENTS.values() for name in each
    }
    for document in pages.documents():
        name = pages.name_of(document)
        assert name in shown | {"index"} or f"{Path(name).parent}/index" in shown, name


def test_a_docstring_becomes_markdown() -> None:
    text = "Does it.\n\nRaises:\n    StepFailed: if it\n        failed\n    OSError: else\n"
    expected = "Does it.\n\n**Raises**\n\n- `StepFailed`: if it failed\n- `OSError`: else"
    assert python_reference.markdown(text) == expected


def test_a_method_is_described_without_self() -> None:
    source = "def f(self, x: int, *, y: str = 'z') -> bool:\n    '''Says it.'''\n"
    ((name, found),) = python_reference.members(ast.parse(source).body)
    shown = python_reference.directive(name, found, 5, in_class=True)
    assert "{py:method} f(x: int, *, y: str='z') -> bool\n" in shown
    assert "Says it." in shown


def test_every_public_name_of_the_package_has_an_entry() -> None:
    page = python_reference.pages(python_reference.modules())["reference/python/trifinger"]
    for name in ("Frontend", "connect", "RobotStopped", "Fault", "Status", "Log"):
        assert f"}} {name}" in page, name


def test_programs_show_the_commands_below_them() -> None:
    helps = {
        "trifinger": "T\nCommands:\n  log         Logs\n              and more\n  run         R\n\n"
        "Programs of their own:\n  job   J\n",
        "trifinger log": "L\nCommands:\n  info        Info\n\nExample:\n  log info x\n",
        "trifinger log info": "I\n",
        "trifinger run": "R\n",
        "trifinger job": "J\n",
        "./run": "R\n",
    }
    found = programs.pages(lambda words: helps[" ".join(words)])
    assert "## `trifinger log info`\n\n```text\nI\n" in found["reference/programs/log"]
    names = ("log", "run", "job", "run_verbs", "index")
    assert set(found) == {f"reference/programs/{name}" for name in names}


def test_every_fault_and_every_header_has_its_place() -> None:
    assert "## 07 An action asks for far too much torque" in faults.page()
    headers = cpp_reference.pages()
    assert (
        "{doxygenfile} include/trifinger/core/backend.hpp" in headers["reference/cpp/core/backend"]
    )


def test_figures_of_others_are_compared_with_measures_of_ours(tmp_path: Path) -> None:
    machine, rows = figures.measured()
    page = figures.page(tmp_path)
    assert machine in page
    for row in rows:
        assert f"| {row.measure} | {row.figure()} |" in page
    by_name = {row.measure: row for row in rows}
    for other in figures.others():
        ours = by_name[other.measure]
        assert ours.unit == other.unit, other.what


@pytest.mark.parametrize(("unit", "times"), [("steps/s", 4.0), ("ns", 0.25)])
def test_a_rate_is_better_if_it_is_large_and_a_time_if_it_is_small(unit: str, times: float) -> None:
    other = figures.Other("a loop", "another", 10.0, unit, "our loop", "their paper")
    ours = Row.of("our loop", [40.0], unit, reach="", holds=True)
    assert other.times_better(ours) == times


def test_the_same_figures_give_the_same_plots(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        figures.page(tmp_path / folder)
    plots = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert {"ratios.svg", "others.svg", "skills.svg"} <= set(plots)
    for name in plots:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_results_say_how_often_an_experiment_succeeded() -> None:
    text = (
        "# R\n\n| what | succeed |\n|---|---|\n| `a` | 3 of 4 |\n| b | 0.3 kg |\n\n| c | 1 of 1 |\n"
    )
    assert [*figures.successes(text)] == [figures.Success("a", 3, 4)]
    assert [*figures.successes("| seed | distance |\n|---|---|\n| 3 of 4 | 2 |\n")] == []


def test_pictures_of_notebooks_are_kept_small() -> None:
    written = io.BytesIO()
    Image.new("RGB", (2000, 100), "red").save(written, "png")
    picture = base64.b64encode(written.getvalue()).decode()
    notebook = {"cells": [{"outputs": [{"data": {"image/png": picture}}]}, {"source": "x"}]}
    kept = json.loads(pictures.with_smaller_pictures(json.dumps(notebook)))
    small = base64.b64decode(kept["cells"][0]["outputs"][0]["data"]["image/png"])
    with Image.open(io.BytesIO(small)) as image:
        assert image.size == (900, 45)
    assert kept["cells"][1] == {"source": "x"}
