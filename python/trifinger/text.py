# SPDX-License-Identifier: BSD-3-Clause
"""Texts of others as they may be printed, with the rules of src/base/printable.hpp."""

import re

MAX_PRINTED = 1000
"""Number of characters of a text that `printable` keeps."""

# Control characters, marks of the direction of writing, separators of lines, lone surrogates.
_DANGEROUS = "\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff"
_IN_A_LINE = re.compile(f"[{_DANGEROUS}\t\n]")
_IN_LINES = re.compile(f"[{_DANGEROUS}]")


def printable(text: str, most: int = MAX_PRINTED) -> str:
    r"""A text of others, such as a name in a file, as it may be printed.

    A terminal obeys control characters, and some characters turn the order of others around. They
    are shown like "\x1b" and "\u202e", and bytes that are no UTF-8 like "\xff". The middle of a
    text with more than `most` characters is left out, and its length is said.
    """
    return _IN_A_LINE.sub(_shown, _shortened(text, most))


def printable_lines(text: str, most: int = 4 * MAX_PRINTED) -> str:
    """The same for a text of several lines, such as an error: ends of lines and tabs remain."""
    return _IN_LINES.sub(_shown, _shortened(text, most))


def _shortened(text: str, most: int) -> str:
    if len(text) <= most:
        return text
    end = most // 4  # it often says what to do
    return f"{text[: most - end]}… ({len(text):,} characters) …{text[len(text) - end :]}"


def _shown(found: re.Match[str]) -> str:
    character = found[0]
    if character in "\n\t\r":
        return repr(character)[1:-1]
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:  # a byte that is no UTF-8
        code -= 0xDC00
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def natural_order(name: str) -> list[tuple[int, str]]:
    """A key that sorts numbers in names by their value: camera60 before camera180."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]
