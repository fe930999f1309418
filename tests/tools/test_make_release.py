# SPDX-License-Identifier: BSD-3-Clause
"""Tests of ./run release: its notes, its checksums, and where versions are written."""

import os
import re
import shutil
import subprocess
import tempfile
import tomllib
from pathlib import Path
from zipfile import ZipFile

import pytest
from make_release import VERSION, checksums, notes, put_bills_beside
from make_wheel import reproducible
from verbs import release
from verbs.steps import StepFailed

ROOT = Path(__file__).parents[2]
CHANGELOG = """\
# Changelog

## [Unreleased]

- It flies.

## [0.2.0] - 2026-12-01

### Added

- It swims.

## [0.1.0] - 2026-11-01

- It walks.
"""


def test_notes_are_the_section_of_the_version() -> None:
    assert notes(CHANGELOG, "0.2.0") == "# TriFinger 0.2.0\n\n### Added\n\n- It swims.\n"
    assert notes(CHANGELOG, "0.1.0") == "# TriFinger 0.1.0\n\n- It walks.\n"


def test_notes_of_a_version_without_a_section_say_that_it_is_not_released() -> None:
    assert notes(CHANGELOG, "0.3.0") == "# TriFinger 0.3.0, not released yet\n\n- It flies.\n"


def test_checksums_are_what_sha256sum_reads(tmp_path: Path) -> None:
    (tmp_path / "b").write_text("second")
    (tmp_path / "a").write_text("first")
    (tmp_path / "SHA256SUMS").write_text(checksums(tmp_path))
    check = ["sha256sum", "--check", "--strict", "SHA256SUMS"]
    run = subprocess.run(check, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert run.stdout == "a: OK\nb: OK\n"
    (tmp_path / "a").write_text("changed")
    assert subprocess.run(check, cwd=tmp_path, capture_output=True, check=False).returncode == 1


@pytest.mark.skipif(shutil.which("gpg") is None, reason="there is no `gpg`")
def test_a_release_is_signed_and_checked_as_the_page_says(tmp_path: Path) -> None:
    page = (ROOT / "docs/howto/check_a_release.md").read_text()
    check, sign = re.findall(r"^```bash .*\n((?:.*\n)*?)```$", page, re.MULTILINE)
    (tmp_path / "a.whl").write_text("bytes")
    (tmp_path / "SHA256SUMS").write_text(checksums(tmp_path))

    def run(commands: str, home: str) -> int:
        words = ["bash", "-e", "-c", commands]
        variables = {**os.environ, "GNUPGHOME": home}
        return subprocess.run(words, cwd=tmp_path, env=variables, check=False).returncode

    # The paths of sockets must be short.
    with tempfile.TemporaryDirectory() as maintainer, tempfile.TemporaryDirectory() as user:
        key = "gpg --batch --passphrase '' --quick-generate-key test@trifinger.example"
        try:
            assert run(key, maintainer) == 0
            assert run(sign, maintainer) == 0
            assert run(check, user) == 0
            (tmp_path / "a.whl").write_text("other bytes")
            assert run(check, user) != 0
            (tmp_path / "SHA256SUMS").write_text(checksums(tmp_path))
            assert run(check, user) != 0
        finally:
            for home in (maintainer, user):
                run("gpgconf --kill all", home)


def test_all_distributions_have_one_version() -> None:
    for project in (ROOT / "packages").glob("*/pyproject.toml"):
        assert tomllib.loads(project.read_text())["project"]["version"] == VERSION


def test_the_citation_names_the_version() -> None:
    citation = (ROOT / "CITATION.cff").read_text()
    assert re.findall(r"^version: (.+)$", citation, re.MULTILINE) == [VERSION]


def test_bills_of_materials_lie_beside_what_they_describe(tmp_path: Path) -> None:
    with ZipFile(tmp_path / "a-1-py3-none-any.whl", "w") as wheel:
        wheel.writestr("a-1.dist-info/sboms/a.spdx.json", "of the wheel")
    package = tmp_path / "package"
    (package / "DEBIAN").mkdir(parents=True)
    fields = "Package: a\nVersion: 1\nArchitecture: all\nMaintainer: m <m@a.example>\n"
    (package / "DEBIAN/control").write_text(f"{fields}Description: d\n")
    (package / "usr/share/doc/a").mkdir(parents=True)
    (package / "usr/share/doc/a/a.spdx.json").write_text("of the package")
    build = ["dpkg-deb", "--build", package, tmp_path / "a_1_all.deb"]
    subprocess.run(build, capture_output=True, check=True)
    put_bills_beside(tmp_path)
    assert (tmp_path / "a-1-py3-none-any.whl.spdx.json").read_text() == "of the wheel"
    assert (tmp_path / "a_1_all.deb.spdx.json").read_text() == "of the package"


def test_builds_take_their_time_from_the_commit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    git = ["git", "-C", ROOT, "log", "-1", "--format=%ct"]
    commit = subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()
    assert reproducible()["SOURCE_DATE_EPOCH"] == commit


def test_only_a_commit_is_released(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(release, "ROOT", tmp_path)
    subprocess.run(["git", "init", "--quiet", tmp_path], check=True)
    release.require_clean_tree()
    (tmp_path / "new").touch()
    with pytest.raises(StepFailed):
        release.require_clean_tree()
    assert "commit or remove these changes first:\n?? new\n" in capsys.readouterr().err


def test_lists_of_files_that_administrators_change_name_what_is_installed() -> None:
    """CPack does not notice a wrong name."""
    conffiles = (ROOT / "system" / "debian" / "conffiles").read_text().split()
    installed = re.findall(
        r"install\(FILES system/(\S+) DESTINATION (/etc\S+)",
        (ROOT / "cmake" / "TrifingerPackages.cmake").read_text(),
    )
    assert conffiles == [f"{folder}/{name}" for name, folder in installed]
