# SPDX-License-Identifier: BSD-3-Clause
"""Tests of bills of materials: what they say, and that they leave nothing out."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import bill_of_materials
import pytest
from bill_of_materials import PARTS, ROOT, bill, compiled_in, part_of
from spdx_tools.spdx.model import Document
from spdx_tools.spdx.parser.parse_anything import parse_file
from spdx_tools.spdx.validation.document_validator import validate_full_spdx_document

BUILD = ROOT / "build/release"
# What every Linux has, as the standard of wheels says.
SYSTEM = ("libc.", "libm.", "libgcc_s.", "libstdc++.", "ld-linux")


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """What a wheel has, unpacked."""
    folder = tmp_path / "files"
    for name in ("trifinger/_trifinger.so", "trifinger.libs/liblz4-0123abcd.so.1.9.4"):
        path = folder / name
        path.parent.mkdir(parents=True)
        path.write_text("bytes")
    return folder


def read(text: str, folder: Path) -> Document:
    """The bill as the library of SPDX reads it; it finds no fault with it."""
    path = folder / "bill.spdx.json"
    path.write_text(text)
    document = parse_file(str(path))
    assert validate_full_spdx_document(document) == []
    return document


def test_says_what_a_wheel_has_and_needs(files: Path, tmp_path: Path) -> None:
    needs = ["numpy>=1.26", "mujoco-core==4.0.0", 'torch>=2; extra == "learning"']
    document = read(bill("trifinger", files, requirements=needs), tmp_path)
    found = {each.name: each for each in document.packages}
    assert list(found) == ["trifinger", "numpy", "mujoco-core", "LZ4"]
    assert str(found["trifinger"].license_declared) == "BSD-3-Clause"
    purls = {name: each.external_references[0].locator for name, each in found.items()}
    assert purls["numpy"] == "pkg:pypi/numpy"
    assert purls["mujoco-core"] == "pkg:pypi/mujoco-core@4.0.0"
    assert purls["LZ4"].startswith("pkg:deb/debian/liblz4-dev@1.")
    assert found["LZ4"].file_name == "trifinger.libs/liblz4-0123abcd.so.1.9.4"
    assert {each.relationship_type.name for each in document.relationships} == {
        *("DESCRIBES", "DEPENDS_ON", "CONTAINS"),
    }


def test_the_same_commit_gives_the_same_bytes(files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    text = bill("trifinger", files)
    assert bill("trifinger", files) == text
    assert json.loads(text)["creationInfo"]["created"] == "1970-01-02T00:00:00Z"


def test_a_library_that_nobody_has_listed_is_an_error(files: Path) -> None:
    (files / "trifinger.libs/libnew-0123abcd.so.1").touch()
    with pytest.raises(LookupError, match=r"libnew-0123abcd\.so\.1 is not in PARTS"):
        bill("trifinger", files)


def test_headers_that_nobody_has_listed_are_an_error(
    files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bill_of_materials, "compiled_in", lambda *_: ["deb/debian/libnew-dev"])
    with pytest.raises(LookupError, match="deb/debian/libnew-dev is not in PARTS"):
        bill("trifinger", files, BUILD)


def test_what_is_compiled_in_is_told_apart_from_libraries(
    files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sources = ["deb/debian/libeigen3-dev", "deb/debian/liblz4-dev", "deb/debian/libzstd-dev"]
    monkeypatch.setattr(bill_of_materials, "compiled_in", lambda *_: sources)
    document = read(bill("trifinger", files, BUILD), tmp_path)
    relations = {
        each.related_spdx_element_id: each.relationship_type.name for each in document.relationships
    }
    assert relations["SPDXRef-deb-debian-libeigen3-dev"] == "STATIC_LINK"
    assert relations["SPDXRef-deb-debian-liblz4-dev"] == "CONTAINS"
    assert relations["SPDXRef-deb-debian-libzstd-dev"] == "DYNAMIC_LINK"


def test_every_header_of_others_that_is_compiled_in_has_an_owner_in_the_list() -> None:
    found = compiled_in(BUILD, ("src/", "apps/", "bindings/", "packages/"))
    assert {"deb/debian/libeigen3-dev", "pypi/nanobind", "pypi/eiquadprog"} <= set(found)
    assert [each for each in found if not part_of(each)] == []


@pytest.mark.skipif(shutil.which("readelf") is None, reason="there is no `readelf`")
def test_every_library_that_is_linked_is_in_the_list() -> None:
    files = [*BUILD.glob("apps/trifinger*"), *BUILD.glob("python/trifinger/_trifinger*.so")]
    for file in filter(Path.is_file, files):
        read_elf = ["readelf", "--dynamic", str(file)]
        told = subprocess.run(read_elf, capture_output=True, text=True, check=True).stdout
        needed = re.findall(r"\(NEEDED\).*\[(.+)\]", told)
        assert needed
        for library in needed:
            assert library.startswith(SYSTEM) or part_of(library) in PARTS


def test_a_header_that_no_package_has_is_an_error(
    files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bill_of_materials, "compiled_in", lambda *_: ["/opt/x/include/boost.hpp"])
    with pytest.raises(LookupError, match=r"/opt/x/include/boost\.hpp is not in PARTS"):
        bill("trifinger", files, BUILD)
