# SPDX-License-Identifier: BSD-3-Clause
"""Checks that layers include only layers below them.

A layer is a directory: include/trifinger/LAYER, src/LAYER and tests/LAYER.
"""

import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from tracked_files import ROOT, tracked_files

# Each layer and the layers directly below it. A layer may also include all layers further down.
DIRECTLY_BELOW = {
    "base": (),
    "ipc": ("base",),
    "realtime": ("ipc",),
    "config": ("base",),
    "core": ("realtime",),
    "mcap": ("ipc",),
    "log": ("core", "mcap"),
    "joint": ("core", "config"),
    "model": ("base",),
    "control": ("model",),
    "sim": ("joint", "model"),
    "learning": ("sim",),
    "manipulation": ("control", "sim"),
    "apps": ("manipulation", "learning", "log"),
    "bindings": ("control", "learning", "log"),
}

INCLUDE = re.compile(r'^\s*#\s*include\s*["<]trifinger/(\w+)/')


def allowed_layers(layer: str) -> set[str]:
    """Returns the layers that a file of `layer` may include: its own and all below it."""
    return {layer}.union(*(allowed_layers(below) for below in DIRECTLY_BELOW[layer]))


def layer_of(path: Path) -> str | None:
    """Returns the layer that the file belongs to; None if the file may include anything."""
    match path.parts:
        case ("include", "trifinger", layer, _, *_) | ("src", layer, _, *_):
            return layer
        case ("tests", layer, _, *_) if layer in DIRECTLY_BELOW:
            return layer
        case (("apps" | "bindings") as layer, _, *_):
            return layer
    return None


def violations(path: Path, lines: Iterable[str]) -> Iterator[str]:
    """Yields one sentence for each include in the file at `path` that its layer forbids."""
    layer = layer_of(path)
    if layer is None:
        return
    if layer not in DIRECTLY_BELOW:
        yield f"{path}: the layer '{layer}' is not in the table of tools/check_layers.py."
        return
    allowed = allowed_layers(layer)
    for number, line in enumerate(lines, start=1):
        included = INCLUDE.match(line)
        if included and included[1] not in allowed:
            yield (
                f"{path}:{number}: '{layer}' may not include '{included[1]}', "
                f"only {', '.join(name for name in DIRECTLY_BELOW if name in allowed)}."
            )


def main() -> int:
    """Checks all tracked C++ files and returns the exit status."""
    found = [
        sentence
        for path in tracked_files(".hpp", ".cpp")
        for sentence in violations(path, (ROOT / path).read_text().splitlines())
    ]
    print("\n".join(found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
