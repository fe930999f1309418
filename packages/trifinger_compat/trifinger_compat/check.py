# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger compat-check`: what of somebody's program works here."""

import argparse
import ast
import importlib
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from trifinger_compat.handles import SERVED, no_such_call
from trifinger_compat.symbols import (
    DIFFERS,
    MISSING,
    PACKAGES,
    SAME,
    SYMBOLS,
)

_BY_PATH = {symbol.path.rstrip(":").replace(":", "."): symbol for symbol in SYMBOLS}
# Members of instances that say enough by their names.
_MEMBERS = {
    symbol.path.rpartition(".")[2]: symbol
    for symbol in SYMBOLS
    if symbol.verdict != SAME and symbol.path.count(".") and ":SimFinger." in symbol.path
}


@dataclass(frozen=True, order=True)
class Finding:
    """A name in a program, and what becomes of it."""

    file: Path
    line: int
    name: str
    verdict: str
    why: str

    def __str__(self) -> str:
        why = f": {self.why}" if self.why else ""
        return f"{self.file}:{self.line}: {self.name} {self.verdict}{why}"


class _Names(ast.NodeVisitor):
    """Collects where a program uses names of the original's packages."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._known: dict[str, str] = {}
        self.findings: list[Finding] = []

    def visit_Import(self, node: ast.Import) -> None:
        """`import trifinger_simulation.camera as camera`."""
        for alias in node.names:
            top = alias.name.partition(".")[0]
            if _is_ours(top) or top == "pybullet":
                self._known[alias.asname or top] = alias.name if alias.asname else top
                self._judge(node.lineno, alias.name)

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        """`from trifinger_simulation.tasks import move_cube`."""
        module = node.module or ""
        top = module.partition(".")[0]
        if node.level or not (_is_ours(top) or top == "pybullet"):
            return
        for alias in node.names:
            if alias.name == "*":
                self._judge(node.lineno, module)
                continue
            self._known[alias.asname or alias.name] = f"{module}.{alias.name}"
            self._judge(node.lineno, f"{module}.{alias.name}")

    def visit_Attribute(self, node: ast.Attribute) -> None:
        """`move_cube.sample_goal`, or `finger.finger_id` of an object."""
        name = self._dotted(node)
        if name is not None:
            self._judge(node.lineno, name)
            return
        if node.attr in _MEMBERS:
            symbol = _MEMBERS[node.attr]
            self._add(node.lineno, symbol.name, symbol.verdict, symbol.note)
        self.generic_visit(node)

    def _dotted(self, node: ast.expr) -> str | None:
        """The whole name of an attribute of something that was imported."""
        if isinstance(node, ast.Name):
            return self._known.get(node.id)
        if isinstance(node, ast.Attribute):
            before = self._dotted(node.value)
            return None if before is None else f"{before}.{node.attr}"
        return None

    def _judge(self, line: int, name: str) -> None:
        if name == "pybullet":
            return  # what is used of it counts
        verdict, why = _judge_call(name) if name.startswith("pybullet.") else _judge(name)
        self._add(line, name, verdict, why)

    def _add(self, line: int, name: str, verdict: str, why: str) -> None:
        self.findings.append(Finding(self._file, line, name, verdict, why))


def _is_ours(package: str) -> bool:
    return package in PACKAGES


def _judge_call(name: str) -> tuple[str, str]:
    """What becomes of a name of PyBullet, and why."""
    call = name.partition(".")[2]
    if call.isupper():
        return SAME, ""
    if call in SERVED:
        return DIFFERS, f"if PyBullet is not installed; else {SERVED[call]}"
    return MISSING, str(no_such_call(call)).partition(": ")[2]


def _judge(name: str) -> tuple[str, str]:
    """What becomes of a name with dots, and why."""
    if name in _BY_PATH:
        symbol = _BY_PATH[name]
        return symbol.verdict, symbol.note
    parts = name.split(".")
    for end in range(len(parts), 0, -1):
        module = ".".join(parts[:end])
        try:
            if find_spec(module) is None:
                continue
        except (ImportError, ValueError):
            continue
        thing: object = importlib.import_module(module)
        for attribute in parts[end:]:
            if not hasattr(thing, attribute):
                return MISSING, f"{module} has no '{attribute}' here"
            thing = getattr(thing, attribute)
            if not isinstance(thing, type) and not hasattr(thing, "__name__"):
                break  # what a value has is not known without running the program
        return SAME, ""
    return MISSING, "there is no such module"


def check_text(text: str, file: Path) -> list[Finding]:
    """All names of the original in a program; raises SyntaxError."""
    names = _Names(file)
    names.visit(ast.parse(text, str(file)))
    return sorted(set(names.findings))


def programs(path: Path) -> Iterator[Path]:
    """The file, or all Python files below a folder."""
    if path.is_file():
        yield path
        return
    yield from sorted(each for each in path.rglob("*.py") if ".git" not in each.parts)


def report(path: Path, show_all: bool) -> int:
    """Prints what of the programs in `path` works; returns the exit status."""
    files = list(programs(path))
    if not files:
        print(f"trifinger compat-check: {path} has no Python files", file=sys.stderr)
        return 2
    counts: Counter[str] = Counter()
    for file in files:
        try:
            findings = check_text(file.read_text(), file)
        except (SyntaxError, UnicodeDecodeError) as error:
            print(f"{file}: cannot be read as Python 3: {error}")
            counts["unreadable"] += 1
            continue
        for finding in findings:
            counts[finding.verdict] += 1
            if show_all or finding.verdict != SAME:
                print(finding)
    total = counts[SAME] + counts[DIFFERS] + counts[MISSING]
    print(
        f"{len(files)} files, {total} places that use the original: {counts[SAME]} work as they "
        f"are, {counts[DIFFERS]} work with a difference, {counts[MISSING]} do not work."
    )
    if counts["unreadable"]:
        print(f"{counts['unreadable']} files could not be read.")
    return 1 if counts[MISSING] or counts["unreadable"] else 0


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger compat-check`."""
    parser = argparse.ArgumentParser(
        prog="trifinger compat-check",
        description="Say what of programs for the original stack works here, and why not.",
        epilog="Programs are read, never run. Exit status: 0 if everything works, 1 if something "
        "does not, 2 if there is nothing to read. docs/coming_from_the_original.md explains it.",
    )
    parser.add_argument("path", type=Path, metavar="PATH", help="a program, or a folder of them")
    parser.add_argument("--all", action="store_true", help="show also what works as it is")
    arguments = parser.parse_args(words)
    if not arguments.path.exists():
        print(f"trifinger compat-check: there is no {arguments.path}", file=sys.stderr)
        return 2
    return report(arguments.path, arguments.all)


if __name__ == "__main__":
    sys.exit(main())
