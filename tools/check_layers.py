# SPDX-License-Identifier: BSD-3-Clause
"""Checks that layers include only layers below them, and use their own namespaces.

A layer is a directory: include/trifinger/LAYER, src/LAYER and tests/LAYER, in the root or in a
package. Programs of packages are part of `apps`, and their bindings part of `bindings`. The table
of layers in ARCHITECTURE.md says which layers each one is directly above. A layer may also include
all layers further down. Only packages and `evaluation` include a layer of a package, and only the
tests of packages and the judges of skills include `evaluation`. Tests may open any namespace.

Public headers are those that docs/stability.md names, those that examples and templates of robots
include, and what these include. No other header may be in include/trifinger.
"""

import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from tracked_files import ROOT, in_room, public_header, tracked_files

TABLE = "ARCHITECTURE.md"
ROW = re.compile(r"^\| `(\w+)` \|.*\|([^|]*)\|$", re.MULTILINE)
# These layers share the namespace `trifinger`; each other layer has one of its own name in it.
SHARED = {"base", "realtime", "core", "joint", "model", "sim"}
# Layers of packages, which only packages and the folder above all layers may include.
OF_PACKAGES = {folder.name for folder in ROOT.glob("packages/*/src/*")}
ABOVE_ALL = "evaluation"
BENEATH = ("::detail", "::docs")  # docs has the texts that tools/write_docstrings.py writes
NAMESPACE = re.compile(r"^\s*(?:inline\s+)?namespace\s+(trifinger[\w:]*)")
INCLUDE = re.compile(r'^\s*#\s*include\s*["<](trifinger/)?((\w+)/[\w/]+\.hpp)[">]')
PUBLIC = "include/trifinger"
PROMISES = "docs/stability.md"
PROMISED = re.compile(r"`trifinger/(\w+/\w+\.hpp)`")


def read_table(text: str) -> dict[str, tuple[str, ...]]:
    """Returns each layer of the table of layers with the layers directly below it."""
    _, _, section = text.partition("| layer |")
    table, _, _ = section.partition("\n\n")
    return {layer: tuple(re.findall(r"`(\w+)`", below)) for layer, below in ROW.findall(table)}


DIRECTLY_BELOW = read_table((ROOT / TABLE).read_text())


def allowed_layers(layer: str) -> set[str]:
    """Returns the layers that a file of `layer` may include: its own and all below it."""
    return {layer}.union(*(allowed_layers(below) for below in DIRECTLY_BELOW[layer]))


def layer_of(path: Path) -> str | None:
    """Returns the layer of the file, or ABOVE_ALL; None if it may include all of the core."""
    match in_room(path).parts:
        case ("src", _, "skills", _, "judge.cpp"):
            return ABOVE_ALL  # Into which it is compiled; it only lies beside what it judges.
        case (folder, *_) if folder == ABOVE_ALL:
            return ABOVE_ALL
        case ("include", "trifinger", layer, _, *_) | ("src", layer, _, *_):
            return layer
        case ("tests", layer, _, *_) if layer in DIRECTLY_BELOW:
            return layer
        case (("apps" | "bindings") as layer, _, *_):
            return layer
        case (folder, *_) if path.parts[0] == "packages" and folder != "tests":
            return "apps"
    return None


def violations(path: Path, lines: Iterable[str]) -> Iterator[str]:
    """Yields one sentence for each include and namespace in a file that its layer forbids."""
    layer = layer_of(path)
    if layer == ABOVE_ALL:
        return
    if layer is not None and layer not in DIRECTLY_BELOW:
        yield f"{path}: the layer '{layer}' is not in the table of {TABLE}."
        return
    allowed = set(DIRECTLY_BELOW) if layer is None else allowed_layers(layer)
    if path.parts[0] != "packages":
        allowed -= OF_PACKAGES
    elif "tests" in path.parts:
        allowed.add(ABOVE_ALL)
    own = "trifinger" if layer in SHARED else f"trifinger::{layer}"
    namespaces = {own, *(own + beneath for beneath in BENEATH)}
    for number, line in enumerate(lines, start=1):
        included = INCLUDE.match(line)
        if included and included[3] in (*DIRECTLY_BELOW, ABOVE_ALL) and included[3] not in allowed:
            yield (
                f"{path}:{number}: '{layer or path.parts[0]}' may not include '{included[3]}', "
                f"only {', '.join(name for name in DIRECTLY_BELOW if name in allowed)}."
            )
        opened = NAMESPACE.match(line) if layer is not None else None
        if opened and "tests" not in path.parts and opened[1] not in namespaces:
            yield (
                f"{path}:{number}: '{layer}' may not open the namespace '{opened[1]}', "
                f"only '{own}' and '{own}::detail'."
            )


def includes(text: str) -> dict[str, bool]:
    """Returns each header with a layer that is included, and whether it is public."""
    found = filter(None, map(INCLUDE.match, text.splitlines()))
    return {match[2]: match[1] is not None for match in found if match[3] in DIRECTLY_BELOW}


def mistakes_of_public_headers(needed: Iterable[str], texts: dict[str, str]) -> Iterator[str]:
    """Yields one sentence for each public header that is missing, private or needed by nobody.

    Args:
        needed: LAYER/x.hpp for each one that programs of users include
        texts: what is in each public header, by the same names
    """
    needed = set(needed)
    known: set[str] = set()
    while missing := needed - known:
        for header in sorted(missing):
            known.add(header)
            if header not in texts:
                yield f"{PUBLIC}/{header}: does not exist, and programs of users include it."
                continue
            for included, is_public in includes(texts[header]).items():
                if is_public:
                    needed.add(included)
                else:
                    yield f"{PUBLIC}/{header}: includes '{included}', which is not public."
    for header in sorted(texts.keys() - known):
        yield f"{PUBLIC}/{header}: no program of a user includes it. Move it to src/{header}."


def mistakes_of_table(table: dict[str, tuple[str, ...]], layers: set[str]) -> Iterator[str]:
    """Yields one sentence for each row without files, and for each that is above a later one."""
    above: list[str] = []
    for layer, below in table.items():
        if layer not in layers:
            yield f"{TABLE}: the layer '{layer}' has no files."
        for name in below:
            if name not in above:
                yield f"{TABLE}: '{layer}' is directly above '{name}', which has no row before."
        above.append(layer)


def main() -> int:
    """Checks the tables and all tracked C++ files and returns the exit status."""
    paths = tracked_files(".hpp", ".cpp")
    layers = {layer for layer in map(layer_of, paths) if layer not in (None, ABOVE_ALL)}
    found = list(mistakes_of_table(DIRECTLY_BELOW, layers))
    texts = {name: (ROOT / path).read_text() for path in paths if (name := public_header(path))}
    users = [path for path in paths if path.parts[0] in ("examples", "config")]
    needed = {
        *PROMISED.findall((ROOT / PROMISES).read_text()),
        *(header for path in users for header in includes((ROOT / path).read_text())),
    }
    found += mistakes_of_public_headers(needed, texts)
    # Which layers a file may include is known only of a table without mistakes.
    found = found or [
        sentence
        for path in paths
        for sentence in violations(path, (ROOT / path).read_text().splitlines())
    ]
    print("\n".join(found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
