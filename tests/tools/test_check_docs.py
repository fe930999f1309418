# SPDX-License-Identifier: BSD-3-Clause
from pathlib import Path

from check_docs import missing_paths

TOP_LEVEL = {"src", "docs", "README.md"}


def found(root: Path, text: str) -> list[str]:
    (root / "docs").mkdir()
    (root / "docs" / "page.md").write_text(text)
    return list(missing_paths(Path("docs/page.md"), root, TOP_LEVEL))


def test_names_the_place_of_a_path_that_does_not_exist(tmp_path: Path) -> None:
    assert found(tmp_path, "# Title\nSee `src/core/series.cpp`.") == [
        "docs/page.md:2: 'src/core/series.cpp' does not exist."
    ]


def test_follows_links_from_the_folder_of_the_document(tmp_path: Path) -> None:
    assert found(tmp_path, "[here](page.md#title), [gone](other.md)") == [
        "docs/page.md:1: 'other.md' does not exist."
    ]


def test_follows_paths_in_backticks_from_the_root_too(tmp_path: Path) -> None:
    assert found(tmp_path, "`docs/page.md` and `page.md`") == []


def test_leaves_out_what_is_no_path_of_the_repository(tmp_path: Path) -> None:
    text = "[web](https://example.org/x.md) `1/2` `src/LAYER` `build/logs` `series`"
    assert found(tmp_path, text) == []


def test_leaves_out_code_blocks(tmp_path: Path) -> None:
    assert found(tmp_path, "```\n`src/none.cpp`\n```\n") == []
