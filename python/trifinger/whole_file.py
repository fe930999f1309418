# SPDX-License-Identifier: BSD-3-Clause
"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path

_LONGEST = 255  # bytes of a name


@contextlib.contextmanager
def whole_file(path: str | os.PathLike[str], *, replace: bool = True) -> Iterator[Path]:
    """Yields a path beside `path`; the file that the block makes there becomes `path` at its end.

    Both have the same ending, by which many writers choose their format. After an error or Ctrl-C
    nothing is left of it, and an older `path` is as it was; it keeps its mode. A kill leaves a file
    whose name begins with a dot. A device, such as /dev/stdout, is written as it is.

    Without `replace` an older file stays, and FileExistsError is raised.
    """
    target = Path(path).resolve() if replace else Path(path)
    if replace and target.exists() and not target.is_file():
        yield target
        return
    part = _part_of(target)
    try:
        mode = target.stat().st_mode & 0o777 if replace and target.exists() else None
        if mode is not None:  # whoever may not read the file may not read the part, either
            part.touch(0o600, exist_ok=False)
        yield part
        synchronise_file(part)
        if mode is not None:
            with contextlib.suppress(OSError):  # a file system without modes
                part.chmod(mode)
        if replace:
            _replace(part, target)
        else:
            _put(part, target)
        synchronise_folder(target.parent)
    finally:
        part.unlink(missing_ok=True)


def replace_file(path: str | os.PathLike[str], content: bytes) -> None:
    """Writes a file whole, in the place of one that is there."""
    with whole_file(path) as part:
        part.write_bytes(content)


def _part_of(target: Path) -> Path:
    """A name beside a file that nothing has."""
    ending = target.suffix if len(os.fsencode(target.suffix)) < 32 else ""  # of no format
    after = f".{secrets.token_hex(4)}.part{ending}"
    before = os.fsencode(f".{target.stem}")[: _LONGEST - len(os.fsencode(after))]
    return target.with_name(before.decode(errors="ignore") + after)


def _replace(part: Path, target: Path) -> None:
    """Puts a file in the place of another one."""
    try:
        part.replace(target)
    except OSError as error:
        if error.errno != errno.EBUSY:
            raise
        # The file alone is mounted there, as containers do it: no other can take its place.
        shutil.copyfile(part, target)
        synchronise_file(target)


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


def synchronise_file(path: Path) -> None:
    """Waits until a file is on the disk; raises OSError if it cannot be there."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def synchronise_folder(folder: Path) -> None:
    """Waits until the names in a folder are on the disk, where that can be asked for."""
    # Some file systems cannot do this, and some folders may not be read.
    with contextlib.suppress(OSError):
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
