# SPDX-License-Identifier: BSD-3-Clause
"""Tests of tools/can_machine.py that need no machine."""

import shutil
import subprocess
import sys
from pathlib import Path

import can_machine
import pytest
from can_machine import NotPossibleHere, cpio_entry, failures, in_order, libraries_of


def module(*needs: str) -> bytes:
    return b"\x7fELF\0license=GPL\0depends=" + ",".join(needs).encode() + b"\0name=x\0"


def test_modules_come_after_all_that_they_need_and_once() -> None:
    modules = {"a": module("b", "c"), "b": module("d"), "c": module("d"), "d": module()}
    order = in_order(["a", "c"], modules)
    assert sorted(order) == ["a", "b", "c", "d"]
    for name, needs in {"a": "bc", "b": "d", "c": "d"}.items():
        assert all(order.index(need) < order.index(name) for need in needs)


def test_a_kernel_without_a_module_is_named() -> None:
    with pytest.raises(NotPossibleHere, match="has no module 'vcan' for CAN"):
        in_order(["can"], {"can": module("vcan")})


@pytest.mark.skipif(not shutil.which("busybox"), reason="busybox unpacks the archive")
def test_archives_are_those_of_cpio(tmp_path: Path) -> None:
    contents = {"/a/empty": b"", "/a/text": b"12345", "/a/long name.bin": bytes(range(256)) * 20}
    archive = cpio_entry("/a", 0o040755)
    archive += b"".join(cpio_entry(name, 0o100755, data) for name, data in contents.items())
    archive += cpio_entry("TRAILER!!!", 0)
    subprocess.run(["busybox", "cpio", "-i"], cwd=tmp_path, input=archive, check=True)
    found = {f"/a/{file.name}": file.read_bytes() for file in (tmp_path / "a").iterdir()}
    assert found == contents


def test_libraries_are_those_that_the_loader_names() -> None:
    names = [library.name for library in libraries_of(Path(sys.executable).resolve())]
    assert any(name.startswith("libc.") for name in names)
    assert any(name.startswith("ld-linux") for name in names)
    assert all(library.is_file() for library in libraries_of(Path(sys.executable).resolve()))


def test_tests_that_failed_were_skipped_or_left_nothing_are_failures(tmp_path: Path) -> None:
    (tmp_path / "exit_codes").write_text("good 0\nbad 1\nlost 0\n")
    (tmp_path / "good.xml").write_text(
        '<testsuites><testcase classname="A" name="a"/>'
        '<testcase classname="A" name="s"><skipped/></testcase></testsuites>'
    )
    (tmp_path / "bad.xml").write_text(
        '<testsuites><testcase classname="B" name="b"><failure/></testcase></testsuites>'
    )
    found = "\n".join(failures(tmp_path))
    for words in ("bad ended with exit code 1", "lost left no results", "B.b failed", "A.s was"):
        assert words in found
    assert "A.a" not in found


def test_another_processor_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(can_machine.platform, "machine", lambda: "aarch64")
    with pytest.raises(NotPossibleHere, match="for aarch64"):
        can_machine.fetch_kernel()


def test_a_program_that_is_missing_is_named() -> None:
    with pytest.raises(NotPossibleHere, match="the program no-such-program is not installed"):
        can_machine.find_program("no-such-program")
