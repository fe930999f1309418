# SPDX-License-Identifier: BSD-3-Clause
"""The reference of C++: a page for each public header, whose comments Doxygen reads."""

import re
from pathlib import Path

from tracked_files import ROOT, public_header, tracked_files

from .pages import ORPHAN, Pages, list_of, name_of

FILE = re.compile(r'(<compound refid="(\w+)" kind="file"><name>)[^<]*')
LOCATION = re.compile(r'<location file="([^"]+)"/>\s*</compounddef>')
PRIVATE = re.compile(r'<sectiondef kind="private-[\w-]+">.*?</sectiondef>', re.DOTALL)
GROUP = re.compile(
    r'<sectiondef kind="user-defined">\s*<header>[^<]*</header>'
    r"(\s*<description>.*?</description>)?",
    re.DOTALL,
)
LAYER = re.compile(r"^\| `(\w+)` \| (.*?) \|", re.MULTILINE)


def pages() -> Pages:
    """Returns a page for each public header, and the lists of the layers."""
    headers: dict[str, list[tuple[str, Path]]] = {}
    for path in tracked_files(".hpp"):
        if header := public_header(path):
            headers.setdefault(header.partition("/")[0], []).append((header, path))
    result: Pages = {}
    layers: list[str] = []
    for layer, what in LAYER.findall((ROOT / "ARCHITECTURE.md").read_text()):
        if layer not in headers:
            continue
        names = {path.name: name_of(path) for _, path in headers[layer]}
        result |= {name_of(path): page(header, path) for header, path in headers[layer]}
        layers.append(f"## `{layer}`\n\n{what}.\n\n{list_of(names)}")
    text = "A header has a page; a folder of headers is a [layer](/architecture.md#layers)."
    result["reference/cpp/index"] = "\n\n".join(["# C++", text, *layers])
    return result


def page(header: str, path: Path) -> str:
    """Returns the page of a header."""
    include = f'```cpp\n#include "trifinger/{header}"\n```'
    return f"{ORPHAN}# {header}\n\n{include}\n\n```{{doxygenfile}} {path}\n```\n"


def tidy(xml: Path) -> None:
    """Changes what Doxygen wrote into what Breathe can show header by header.

    Files are named by their paths, because several headers share a name. Private members go. So do
    titles of groups in namespaces, which Breathe would show for every header of the namespace.
    """

    def with_path(entry: re.Match[str]) -> str:
        location = LOCATION.search((xml / f"{entry[2]}.xml").read_text())
        return f"{entry[1]}{location[1]}" if location else entry[0]

    for path in sorted(xml.glob("*.xml")):
        written = path.read_text()
        text = PRIVATE.sub("", written)
        if path.name.startswith("namespace"):
            text = GROUP.sub(r'<sectiondef kind="func">', text)
        if path.name == "index.xml":
            text = FILE.sub(with_path, text)
        if text != written:
            path.write_text(text)
