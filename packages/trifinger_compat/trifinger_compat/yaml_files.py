# SPDX-License-Identifier: BSD-3-Clause
"""The part of YAML that the original's files use, so that no package is needed to read them.

These are keys with values, keys with indented keys, lists in brackets or with dashes, numbers,
words, comments, and OpenCV's types.
"""

import re
from typing import Any

_Lines = list[tuple[int, str]]  # indentation and text of each


def read(text: str) -> dict[str, Any]:
    """The content of a file; raises ValueError where it is not understood."""
    lines = _lines(text)
    content, rest = _block(lines, lines[0][0] if lines else 0)
    if rest or not isinstance(content, dict):
        raise ValueError(f"'{(rest or lines)[0][1]}' is not understood")
    return content


def _lines(text: str) -> _Lines:
    text = re.sub(r"(?m)(^|\s)#.*$", "", text)
    # Lists in brackets may be long.
    text = re.sub(r"\[[^\]]*\]", lambda match: re.sub(r"\s+", " ", match[0]), text)
    return [
        (len(line) - len(line.lstrip()), line.strip())
        for line in text.splitlines()
        if line.strip() and not re.match(r"%|---|\.\.\.", line)
    ]


def _block(lines: _Lines, indent: int) -> tuple[Any, _Lines]:
    """What begins with the first line, and the lines after it."""
    if lines and lines[0][1].startswith("- "):
        return _items(lines, indent)
    content: dict[str, Any] = {}
    while lines and lines[0][0] == indent:
        match = re.fullmatch(r"([\w-]+):(?:\s+(.*))?", lines[0][1])
        if match is None:
            break
        key, value, lines = match[1], match[2] or "", lines[1:]
        if value and not value.startswith("!!"):
            content[key] = _value(value)
        elif lines and (lines[0][0] > indent or lines[0][1].startswith("- ")):
            content[key], lines = _block(lines, lines[0][0])
        else:
            content[key] = ""
    return content, lines


def _items(lines: _Lines, indent: int) -> tuple[list[Any], _Lines]:
    items = []
    while lines and lines[0][0] == indent and lines[0][1].startswith("- "):
        text = lines[0][1][2:].lstrip()
        # What comes after the dash is indented by the dash.
        inner = indent + len(lines[0][1]) - len(text)
        lines = lines[1:]
        if re.match(r"[\w-]+:(\s|$)", text):
            item, lines = _block([(inner, text), *lines], inner)
        else:
            item = _value(text)
        items.append(item)
    return items, lines


def _value(text: str) -> Any:
    if text.startswith("["):
        if not text.endswith("]"):
            raise ValueError(f"'{text}' has no end")
        return [_value(word) for word in re.split(r"[\s,]+", text.strip("[] ")) if word]
    for convert in (int, float):
        try:
            return convert(re.sub(r"^([+-]?)\.(inf|nan)$", r"\1\2", text, flags=re.IGNORECASE))
        except ValueError:
            continue
    return {"true": True, "false": False}.get(text.lower(), text.strip("\"'"))
