# SPDX-License-Identifier: BSD-3-Clause
"""Writes the docstrings of Python: the comments of headers, in Python's words.

A file of bindings/ that names `docs::Pose::position` gets the comment of the field `position` of
`Pose`, and `docs::Pose::Pose` that of the class. bindings/docstrings.cpp has these texts, so that
another text compiles this file alone.
"""

import re
import subprocess
import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from clang import cindex

ROOT = Path(__file__).resolve().parent.parent
OF_PACKAGES = sorted(ROOT.glob("packages/*/bindings"))
# Folders with headers whose comments are docstrings.
HEADERS = (ROOT / "include", ROOT / "src", *OF_PACKAGES)
BINDINGS = ROOT / "bindings"
NAMES_FILE = BINDINGS / "docstrings.hpp"
TEXTS_FILE = BINDINGS / "docstrings.cpp"
USE = re.compile(r"\bdocs::(\w+(?:::\w+)*)")
WIDTH = 92

# What has another name in Python.
NAMES = {
    "FormatError": "Error",
    "SystemError": "OSError",
    "false": "False",
    "kForever": "None",
    "kNone": "None",
    "nullopt": "None",
    "nullptr": "None",
    "throw": "raise",
    "throws": "raises",
    "true": "True",
}

HAVE_MEMBERS = {
    cindex.CursorKind.NAMESPACE,
    cindex.CursorKind.CLASS_DECL,
    cindex.CursorKind.CLASS_TEMPLATE,
    cindex.CursorKind.STRUCT_DECL,
    cindex.CursorKind.ENUM_DECL,
}

BEGIN = """// SPDX-License-Identifier: BSD-3-Clause
// Comments of headers, for Python. tools/write_docstrings.py writes this file.
{}

// clang-format off
// NOLINTBEGIN(readability-identifier-naming): the names are those of the declarations.
namespace trifinger::bindings::docs {{
"""
END = """
}  // namespace trifinger::bindings::docs
// NOLINTEND(readability-identifier-naming)
"""


def to_python(comment: str) -> str:
    """Returns the docstring for the C++ comment `comment`."""
    lines = [re.sub(r"^\s*///<? ?", "", line).rstrip() for line in comment.splitlines()]
    text = re.sub(
        r"\s*@throws (.*?)\.?(?=\s*@throws |\n\n|$)", raises, "\n".join(lines), flags=re.S
    )
    return "\n\n".join(map(paragraph_of_python, text.strip().split("\n\n")))


def raises(throws: re.Match[str]) -> str:
    """Returns the paragraph of Python about the errors that C++ throws."""
    return f"\n\nRaises {throws[1]}."


def paragraph_of_python(text: str) -> str:
    """Returns the paragraph `text` in the words of Python; equations and code keep their lines."""
    text = re.sub(r"\b(?:std|log|mcap|control|guiding|learning)::(?=\w)", "", text)
    text = re.sub(r"(?<!changes\s)\b[Nn]othing(?=\s(?:if|while|before|outside))", "None", text)
    text = re.sub(r"\b\w+\b", lambda word: NAMES.get(word[0], word[0]), text)
    text = re.sub(r"\bk([A-Z][a-z]\w*)\b", enumerator, text).replace("::", ".")
    if text.startswith("    "):
        return text
    return textwrap.fill(text, WIDTH, break_on_hyphens=False)


def enumerator(name: re.Match[str]) -> str:
    """Returns Python's name for the enumerator `name` of C++: TOO_FAR for kTooFar."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name[1]).upper()


def documented(roots: Sequence[Path] = HEADERS) -> Iterator[tuple[str, str]]:
    """Yields the full name and the comment of each declaration in the headers below `roots`."""
    headers = sorted(
        path.relative_to(root).as_posix() for root in roots for path in root.rglob("*.hpp")
    )
    program = "".join(f"#include <{header}>\n" for header in headers)
    eigen = output_of("pkg-config", "--cflags", "eigen3").split()
    # The wheel of libclang has no headers of its own; vectors of Eigen would need them.
    compiler = ["-isystem", output_of("c++", "-print-file-name=include").strip()]
    folders = [f"-I{root}" for root in roots]
    flags = ["-std=c++20", "-DEIGEN_DONT_VECTORIZE", *folders, *compiler, *eigen]
    unit = cindex.Index.create().parse(
        "all.cpp",
        flags,
        [("all.cpp", program)],
        cindex.TranslationUnit.PARSE_SKIP_FUNCTION_BODIES,
    )

    def walk(parent: cindex.Cursor, place: str) -> Iterator[tuple[str, str]]:
        for cursor in parent.get_children():
            file = cursor.location.file
            if file is None or not file.name.startswith(tuple(map(str, roots))):
                continue
            name = f"{place}::{cursor.spelling}"
            if cursor.raw_comment:
                yield name, cursor.raw_comment
            if cursor.kind in HAVE_MEMBERS:
                yield from walk(cursor, name)

    yield from walk(unit.cursor, "")


def output_of(*command: str) -> str:
    """Returns what a program prints."""
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def used() -> dict[str, str]:
    """Returns the names that bindings use, each with a file that does."""
    folders = (BINDINGS, *OF_PACKAGES)
    sources = [path for folder in folders for path in sorted(folder.rglob("*.[ch]pp"))]
    return {
        name: path.relative_to(ROOT).as_posix()
        for path in sources
        if path != TEXTS_FILE
        for name in USE.findall(path.read_text())
    }


def declaration_of(name: str, comments: Iterable[str]) -> list[str]:
    """Returns which of the full names `comments` the short `name` may mean."""
    scope, _, last = name.rpartition("::")
    # A constructor has no name of its own: docs::Pose::Pose is the class.
    short = scope if scope.rpartition("::")[2] == last else name
    full = f"::trifinger::{short}"
    inside = re.compile(rf"::trifinger::[a-z]\w*::{short}")
    return [full] if full in comments else [each for each in comments if inside.fullmatch(each)]


def docstrings() -> dict[Path, str]:
    """Returns the files that declare and define the docstrings, with their content."""
    comments: dict[str, str] = {}
    for name, comment in documented():
        comments.setdefault(name, comment)
    names: dict[str, str] = {}
    texts: dict[str, str] = {}
    problems = []
    for name, file in sorted(used().items()):
        found = declaration_of(name, comments)
        if len(found) != 1:
            what = "may be " + " or ".join(found) if found else "has no comment in a public header"
            problems.append(f"{file}: docs::{name} {what}")
            continue
        scope, _, last = name.rpartition("::")
        text = to_python(comments[found[0]])
        names[scope] = names.get(scope, "") + f"extern const char* const {last};\n"
        texts[scope] = texts.get(scope, "") + f'const char* const {last} = R"({text})";\n'
    if problems:
        sys.exit("\n".join(problems))
    return {
        NAMES_FILE: file_of("#pragma once", names),
        TEXTS_FILE: file_of('#include "docstrings.hpp"', texts),
    }


def file_of(first: str, scopes: dict[str, str]) -> str:
    """Returns a file that begins with the line `first` and has these lines in these scopes."""
    text = BEGIN.format(first)
    for scope, lines in scopes.items():
        text += f"\nnamespace {scope} {{\n{lines}}}\n" if scope else "\n" + lines
    return text + END


if __name__ == "__main__":
    for path, text in docstrings().items():
        path.write_text(text)
