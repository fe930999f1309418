# SPDX-License-Identifier: BSD-3-Clause
"""What a back-end tells front-ends in other processes, beside its session.

A note is a small file that belongs to a session's name. It goes when its back-end ends; one whose
process has died does not count.
"""

import json
import os
import tempfile
from contextlib import suppress
from pathlib import Path

_FOLDER = Path(os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir())


def _path(name: str) -> Path:
    return _FOLDER / f"trifinger-compat-{os.getuid()}-{name}.json"


def write(name: str, max_actions: int) -> None:
    """Notes how many actions the sessions of this name take; 0: any number."""
    note = {"pid": os.getpid(), "max_number_of_actions": max_actions}
    part = _path(name).with_suffix(f".{os.getpid()}")
    part.write_text(json.dumps(note))
    part.replace(_path(name))


def remove(name: str) -> None:
    """Removes the note of this process."""
    with suppress(OSError, ValueError, KeyError):  # another thread removes it, too
        if json.loads(_path(name).read_text())["pid"] == os.getpid():
            _path(name).unlink()


def max_actions(name: str) -> int:
    """How many actions the session takes; 0: any number."""
    path = _path(name)
    try:
        note = json.loads(path.read_text())
        os.kill(note["pid"], 0)
    except (OSError, ValueError, KeyError):
        return 0
    return int(note["max_number_of_actions"])
