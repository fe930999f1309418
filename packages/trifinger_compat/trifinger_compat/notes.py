# SPDX-License-Identifier: BSD-3-Clause
"""What a back-end tells front-ends in other processes, beside its session.

A note is a small file in the folder of the sessions: the process that has started the back-end, and
how many actions it takes. It goes when the back-end ends. One that was left by another process does
not count.
"""

import os
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

from trifinger.session_info import session_folder

_LARGEST = 64  # bytes of a note


def _path(name: str) -> Path:
    return session_folder() / f"trifinger-compat.{name}.note"


def write(name: str, max_actions: int) -> None:
    """Notes how many actions the sessions of this name take, for all users."""
    path = _path(name)
    # Anybody may write into the folder: this name cannot be guessed, and no link is followed.
    number, name_of_part = tempfile.mkstemp(prefix=f"{path.name}.", dir=path.parent)
    part = Path(name_of_part)
    try:
        os.write(number, f"{os.getpid()} {max_actions}\n".encode())
        os.fchmod(number, 0o644)
        part.replace(path)
    finally:
        os.close(number)
        part.unlink(missing_ok=True)


def remove(name: str) -> None:
    """Removes the note of this process."""
    with suppress(OSError, ValueError):  # there is none, or another thread removes it, too
        if _read(name)[0] == os.getpid():
            _path(name).unlink()


def max_actions(name: str, back_end: int) -> int:
    """How many actions the session of this back-end, a process, takes; 0: any number."""
    try:
        process, limit = _read(name)
        return limit if process == _parent(back_end) and limit > 0 else 0
    except (OSError, ValueError):
        return 0


def _read(name: str) -> tuple[int, int]:
    """Process and limit of a note; raises OSError or ValueError if it is none of its process."""
    number = os.open(_path(name), os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        status = os.fstat(number)
        text = os.read(number, _LARGEST) if stat.S_ISREG(status.st_mode) else b""
    finally:
        os.close(number)
    process, limit = map(int, text.split())
    if not text.endswith(b"\n") or status.st_uid != Path(f"/proc/{process}").stat().st_uid:
        raise ValueError(f"the note of '{name}' is not one of its process")
    return process, limit


def _parent(process: int) -> int:
    # The name of the program, in brackets, may have brackets and spaces itself.
    fields = Path(f"/proc/{process}/stat").read_text(errors="replace").rpartition(")")[2].split()
    return int(fields[1])
