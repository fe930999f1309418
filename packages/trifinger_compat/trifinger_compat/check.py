# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger compat-check`: what of somebody's program works here."""

import argparse
import ast
import importlib
import inspect
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from trifinger_compat.handles import SERVED, no_such_call
from trifinger_compat.symbols import (
    DIFFERS,
    MISSING,
    PACKAGES,
    REFUSED,
    SAME,
    SYMBOLS,
    Symbol,
)
from trifinger_compat.world import whole_milliseconds

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

    def visit_Call(self, node: ast.Call) -> None:
        """`SimFinger("trifingerpro", time_step=0.0005)`."""
        name = self._dotted(node.func)
        if name is not None and _is_ours(name.partition(".")[0]):
            for argument, value in _arguments(_find(name)[0], node):
                if why := _refusal(argument, value):
                    self._add(node.lineno, f"{name}({argument}=)", MISSING, why)
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


@cache
def _refused() -> dict[int, Symbol]:
    """The names that refuse, by what they stand for: that may have other names, too."""
    things = {}
    for symbol in REFUSED:
        module, _, name = symbol.path.partition(":")
        package, _, rest = module.partition(".")
        with suppress(ImportError):  # an installed data set package may lack what it needs
            owner = importlib.import_module(package)
            things[id(getattr(getattr(owner, rest) if rest else owner, name))] = symbol
    return things


def _judge(name: str) -> tuple[str, str]:
    """What becomes of a name with dots, and why."""
    if name in _BY_PATH:
        symbol = _BY_PATH[name]
        return symbol.verdict, symbol.note
    thing, lacks = _find(name)
    if lacks:
        return MISSING, lacks
    if id(thing) in _refused():
        symbol = _refused()[id(thing)]
        return symbol.verdict, symbol.note
    return SAME, ""


def _find(name: str) -> tuple[object, str]:
    """What a name with dots stands for, or why it stands for nothing.

    It is only the beginning of the name if that says enough: if it is a value, whose members are
    not known without running the program, or if it refuses.
    """
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
                return None, f"{module} has no '{attribute}' here"
            thing = getattr(thing, attribute)
            is_value = not isinstance(thing, type) and not hasattr(thing, "__name__")
            if is_value or id(thing) in _refused():
                break
        return thing, ""
    return None, "there is no such module"


def _arguments(thing: Any, call: ast.Call) -> Iterator[tuple[str, ast.expr]]:
    """The arguments of a call by their names, as far as the program shows them."""
    has_names = inspect.isclass(thing) or inspect.isfunction(thing)
    if has_names and not any(isinstance(value, ast.Starred) for value in call.args):
        yield from zip(inspect.signature(thing).parameters, call.args, strict=False)
    yield from ((each.arg, each.value) for each in call.keywords if each.arg is not None)


def _refusal(argument: str, node: ast.expr) -> str:
    """Why an argument is refused; empty if it is taken, or not known without running."""
    try:
        value = ast.literal_eval(node)
    except ValueError:
        return ""
    if argument == "robot_position_offset" and value not in ((0, 0, 0), [0, 0, 0]):
        return "the robot cannot be moved against its table; move the objects the other way"
    if argument == "use_real_robot" and value:
        return "use trifinger.environments for a real robot: `trifinger/Reach` with a `robot`"
    if argument in ("time_step", "time_step_s") and isinstance(value, float):
        try:
            whole_milliseconds(value)
        except ValueError as error:
            return str(error)
    return ""


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
    print(f"Not judged: members of objects, except {' and '.join(sorted(_MEMBERS))}.")
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
