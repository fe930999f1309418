# SPDX-License-Identifier: BSD-3-Clause
from pathlib import Path

import pytest
import run_clang_tidy


@pytest.fixture
def entry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Returns an entry of a compile database. Its file includes a header, and that another one."""
    monkeypatch.setattr(run_clang_tidy, "ROOT", tmp_path)
    run_clang_tidy.direct_includes.cache_clear()
    include = tmp_path / "include" / "trifinger"
    include.mkdir(parents=True)
    (include / "far.hpp").write_text("// nothing\n")
    (include / "near.hpp").write_text('#include "trifinger/far.hpp"\n')
    (include / "other.hpp").write_text("// nobody includes this\n")
    source = tmp_path / "a.cpp"
    source.write_text('#include "trifinger/near.hpp"\n')
    return {"file": str(source), "command": f"c++ -I{tmp_path}/include -c a.cpp"}


def fingerprint(entry: dict[str, str], common: bytes = b"version") -> str:
    run_clang_tidy.direct_includes.cache_clear()
    return run_clang_tidy.fingerprint(entry, common)


def test_a_file_in_which_nothing_changed_keeps_its_fingerprint(entry: dict[str, str]) -> None:
    before = fingerprint(entry)
    Path(entry["file"]).with_name("include").joinpath("trifinger/other.hpp").write_text("// new")
    assert fingerprint(entry) == before


@pytest.mark.parametrize(
    "file", ["a.cpp", "include/trifinger/near.hpp", "include/trifinger/far.hpp"]
)
def test_a_change_in_the_file_or_its_headers_is_seen(entry: dict[str, str], file: str) -> None:
    before = fingerprint(entry)
    with (Path(entry["file"]).parent / file).open("a") as changed:
        changed.write("int x;\n")
    assert fingerprint(entry) != before


def test_a_header_in_another_folder_of_the_command_is_seen(
    entry: dict[str, str], tmp_path: Path
) -> None:
    (tmp_path / "apps").mkdir()
    header = tmp_path / "apps" / "options.hpp"
    header.write_text("// nothing\n")
    Path(entry["file"]).write_text('#include "options.hpp"\n')
    entry["command"] += f" -I{tmp_path}/apps"
    before = fingerprint(entry)
    header.write_text("// new\n")
    assert fingerprint(entry) != before


def test_another_command_or_configuration_is_seen(entry: dict[str, str]) -> None:
    before = fingerprint(entry)
    assert fingerprint(entry, b"other version") != before
    assert fingerprint(entry | {"command": "c++ -O2 -c a.cpp"}) != before


def test_files_that_are_compiled_together_belong_to_their_unit(entry: dict[str, str]) -> None:
    unit = Path(entry["file"]).parent / "unity_0_cxx.cxx"
    unit.write_text(f'#include "{entry["file"]}"\n')
    assert run_clang_tidy.sources_of({"file": str(unit)}) == [entry["file"]]
    assert run_clang_tidy.sources_of(entry) == [entry["file"]]
    before = fingerprint({"file": str(unit), "command": "c++"})
    Path(entry["file"]).write_text("// new\n")
    assert fingerprint({"file": str(unit), "command": "c++"}) != before
