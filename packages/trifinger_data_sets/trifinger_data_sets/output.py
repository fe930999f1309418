# SPDX-License-Identifier: BSD-3-Clause
"""Folders that appear whole or not at all."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from trifinger.errors import InvalidArgument
from trifinger.whole_file import synchronise_file, synchronise_folder


@contextlib.contextmanager
def whole_folder(path: Path, *, force: bool = False) -> Iterator[Path]:
    """Yields a temporary folder beside `path`, which becomes `path` at the end of the block.

    After an error or Ctrl-C nothing is left of it, and an older `path` is as it was. A kill
    leaves a folder whose name begins with a dot. Raises InvalidArgument if `path` exists and not
    `force`.
    """
    if path.exists() and not force:
        raise InvalidArgument(f"{path} is there already; --force replaces it")
    path.parent.mkdir(parents=True, exist_ok=True)
    part = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent))
    try:
        yield part
        part.chmod(0o777 & ~_mask())
        for file in part.rglob("*"):
            if file.is_file():
                synchronise_file(file)
        old = None
        if path.exists():
            old = part.with_suffix(".old")
            path.rename(old)
        part.rename(path)
        synchronise_folder(path.parent)
        if old is not None:
            shutil.rmtree(old)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _mask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
