# SPDX-License-Identifier: BSD-3-Clause
"""Writes the table of names into docs/coming_from_the_original.md, from the list that
`trifinger compat-check` and the tests use.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "coming_from_the_original.md"
BEGIN = "<!-- names: written by tools/write_compat_table.py -->\n"
END = "<!-- end of names -->\n"


def table() -> str:
    """A line for each name, those that are used most first."""
    sys.path.insert(0, str(ROOT / "packages" / "trifinger_compat"))
    from trifinger_compat.symbols import SYMBOLS

    lines = ["| name | used | where it is | here |", "|---|---|---|---|"]
    for symbol in SYMBOLS:
        verdict = symbol.verdict + (f": {symbol.note}" if symbol.note else "")
        path = symbol.path.rstrip(":").replace(":", ".")
        lines.append(f"| {symbol.name} | {symbol.sites} | `{path}` | {verdict} |")
    return "\n".join(lines) + "\n"


def page(text: str) -> str:
    """The text of the page with the table of now."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return before + BEGIN + table() + END + after


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text()))
