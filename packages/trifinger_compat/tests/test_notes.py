# SPDX-License-Identifier: BSD-3-Clause
"""Notes of back-ends: who believes them, and what else may lie in their place."""

import os
import stat
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from trifinger_compat import notes

NAME = "mine"


@pytest.fixture
def child() -> Iterator[int]:
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE) as process:
        yield process.pid


@pytest.fixture
def place(session_folder: Path) -> Path:
    """Where the note lies."""
    notes.write(NAME, 0)
    (path,) = session_folder.iterdir()
    notes.remove(NAME)
    assert not path.exists()
    return path


def test_a_note_is_in_the_folder_of_the_sessions_and_for_all(place: Path, child: int) -> None:
    assert notes.max_actions(NAME, child) == 0
    notes.write(NAME, 20)
    assert notes.max_actions(NAME, child) == 20
    assert stat.S_IMODE(place.stat().st_mode) == 0o644
    assert list(place.parent.iterdir()) == [place]
    notes.remove(NAME)
    assert notes.max_actions(NAME, child) == 0
    notes.remove(NAME)


def test_a_note_of_another_process_does_not_count(place: Path, child: int) -> None:
    notes.write(NAME, 20)
    assert notes.max_actions(NAME, os.getpid()) == 0  # not a child of this process
    text = f"{child} 20\n"
    place.write_text(text)
    notes.remove(NAME)
    assert place.read_text() == text
    if os.getuid() == 0:
        place.write_text(f"{os.getpid()} 20\n")
        os.chown(place, 12345, -1)
        assert notes.max_actions(NAME, child) == 0


@pytest.mark.parametrize(
    "text", ["", "7", "[]", "a b", "{me} 2 3", "{me} -1", "{me} " + "9" * 9999]
)
def test_what_is_no_note_does_not_count(text: str, place: Path, child: int) -> None:
    place.write_text(text.replace("{me}", str(os.getpid())) + "\n")
    assert notes.max_actions(NAME, child) == 0
    place.write_bytes(b"\xff\0")
    assert notes.max_actions(NAME, child) == 0


def test_no_link_is_followed(place: Path, child: int, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.write_text(f"{os.getpid()} 20\n")
    place.symlink_to(other)
    assert notes.max_actions(NAME, child) == 0
    notes.write(NAME, 30)
    assert other.read_text().endswith(" 20\n")
    assert notes.max_actions(NAME, child) == 30
    place.unlink()
    os.mkfifo(place)  # nobody waits for a writer
    assert notes.max_actions(NAME, child) == 0
