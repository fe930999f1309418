# SPDX-License-Identifier: BSD-3-Clause
"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def whole_file(path: str | os.PathLike[str], *, replace: bool = True) -> Iterator[Path]:
    """Yields a path beside `path`; the file that the block makes there becomes `path` at its end.

    Both have the same ending, by which many writers choose their format. After an error or Ctrl-C
    nothing is left of it, and an older `path` is as it was. A kill leaves a file whose name begins
    with a dot. A device, such as /dev/stdout, is written as it is.

    Without `replace` an older file stays, and FileExistsError is raised.
    """
    target = Path(path).resolve() if replace else Path(path)
    if replace and target.exists() and not target.is_file():
        yield target
        return
    part = target.with_name(f".{target.stem}.{secrets.token_hex(4)}.part{target.suffix}")
    try:
        yield part
        synchronise(part)
        if replace:
            part.replace(target)
        else:
            _put(part, target)
        synchronise(target.parent)
    finally:
        part.unlink(missing_ok=True)


def _put(part: Path, target: Path) -> None:
    """Gives a file its name if nothing has it."""
    try:
        os.link(part, target)  # unlike a rename, this never replaces a file
    except FileExistsError:
        raise
    except OSError:  # a file system without links
        if os.path.lexists(target):
            raise FileExistsError(target) from None
        part.replace(target)


def synchronise(path: Path) -> None:
    """Waits until a file or folder is on the disk."""
    number = os.open(path, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):  # some file systems cannot do this for folders
            os.fsync(number)
    finally:
        os.close(number)
