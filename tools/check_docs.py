# SPDX-License-Identifier: BSD-3-Clause
"""Checks that every path in the documentation exists.

Paths are the targets of links, and words in backticks that begin like a path of this repository.
Paths with words in capitals (`src/LAYER`) are placeholders and are not checked.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

from tracked_files import ROOT, tracked_files

LINK = re.compile(r"\]\(([^)\s#]+)[^)]*\)")
CODE = re.compile(r"`([\w./-]+)`")
PLACEHOLDER = re.compile(r"(^|/)[A-Z_]+(/|$)")


def named_paths(text: str, top_level: set[str]) -> Iterator[tuple[int, str]]:
    """Yields the line number and the path for every path named in a Markdown text.

    A word in backticks is a path if it begins with a `top_level` entry of the repository.
    """
    in_code_block = False
    for number, line in enumerate(text.splitlines(), start=1):
        if line.lstrip().startswith("```"):
            in_code_block = not in_code_block
        if in_code_block:
            continue
        for target in LINK.findall(line):
            if not re.match(r"\w+:", target):
                yield number, target
        for word in CODE.findall(line):
            first, slash, _ = word.removeprefix("./").partition("/")
            is_path = (slash and first in top_level) or word.endswith(".md")
            if is_path and not PLACEHOLDER.search(word):
                yield number, word


def missing_paths(document: Path, root: Path, top_level: set[str]) -> Iterator[str]:
    """Yields one sentence for every path in `document` that does not exist."""
    folder = (root / document).parent
    for number, path in named_paths((root / document).read_text(), top_level):
        if not (folder / path).exists() and not (root / path).exists():
            yield f"{document}:{number}: '{path}' does not exist."


def main() -> int:
    """Checks all tracked documents and returns the exit status."""
    top_level = {path.parts[0] for path in tracked_files()}
    found = [
        sentence
        for document in tracked_files(".md")
        for sentence in missing_paths(document, ROOT, top_level)
    ]
    print("\n".join(found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
