# SPDX-License-Identifier: BSD-3-Clause
"""The reference of Python, from the type stub and the sources, without importing anything.

Each public module has a page with the public names that it defines or imports for its users
(`from x import y as y`).
"""

import ast
import inspect
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from tracked_files import ROOT, tracked_files

from .pages import ORPHAN, Pages, list_of

# The folders that users' programs import our modules from.
FOLDERS = (
    *("python", "packages/trifinger_camera_calibration", "packages/trifinger_data_sets"),
    "packages/trifinger_view",
)
STUB = "trifinger._trifinger"
# Modules of the program and of its pages, which nobody imports.
INTERNAL = re.compile(
    r"trifinger\w*\.(_|commands|extras|element_text|placement|arrays|progress)"
    r"|trifinger_view(?!\.(bridges|motion|teaching|teleoperation))|trifinger_launcher"
)
SECTION = re.compile(
    r"^(Args|Raises|Returns|Yields|Attributes):\n((?:    .*\n?|\n)+)", re.MULTILINE
)

Node = ast.ClassDef | ast.FunctionDef | ast.AnnAssign | ast.Assign


@dataclass(frozen=True)
class Definition:
    """A definition and what is said about it."""

    node: Node
    text: str


class Module:
    """A module that was read."""

    def __init__(self, folder: str, path: Path) -> None:
        """Reads a file below one of the folders."""
        parts = path.relative_to(folder).with_suffix("").parts
        self.name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        self.body = ast.parse((ROOT / path).read_text()).body
        self.text = ast.get_docstring(ast.Module(self.body, [])) or ""


def modules() -> dict[str, Module]:
    """Returns all modules by their names; the type stub stands for the module in C++."""
    read = [
        Module(folder, path)
        for path in tracked_files(".py", ".pyi")
        for folder in FOLDERS
        if path.is_relative_to(folder) and "tests" not in path.parts
    ]
    return {module.name: module for module in read}


def pages(known: dict[str, Module]) -> Pages:
    """Returns a page for each public module that has public names."""
    result: Pages = {}
    links = {}
    for name, module in sorted(known.items()):
        names = list(public_names(module, known))
        if names and not INTERNAL.match(name):
            links[name] = f"reference/python/{name}"
            result[links[name]] = page(module, names)
    text = (
        "Docstrings are the comments of the C++ headers, wherever both languages have the function."
    )
    result["reference/python/index"] = f"# Python\n\n{text}\n\n{list_of(links)}\n"
    return result


def page(module: Module, names: Iterable[tuple[str, list[Definition]]]) -> str:
    """Returns the page of a module."""
    head = f"{ORPHAN}# `{module.name}`\n\n```{{py:module}} {module.name}\n```"
    text = f"{head}\n\n{markdown(module.text)}\n\n"
    return text + "\n".join(directive(name, found, 7, module.name) for name, found in names)


def public_names(
    module: Module, known: dict[str, Module]
) -> Iterator[tuple[str, list[Definition]]]:
    """Yields the public names of a module, each with its definitions: overloads have several."""
    for node in module.body:
        if isinstance(node, ast.ImportFrom) and node.module in known:
            for alias in node.names:
                if alias.asname == alias.name:
                    yield alias.name, definitions(known[node.module].body, alias.name)
    yield from public_members(module.body)


def public_members(body: list[ast.stmt]) -> Iterator[tuple[str, list[Definition]]]:
    """Yields the public definitions in the body of a module that have a text."""
    for name, found in members(body):
        if any(definition.text for definition in found):
            yield name, found


def members(body: list[ast.stmt]) -> Iterator[tuple[str, list[Definition]]]:
    """Yields the public definitions in the body of a module or a class."""
    names = dict.fromkeys(map(name_of, body))
    for name in names:
        if name and not name.startswith("_"):
            yield name, definitions(body, name)


def name_of(node: ast.stmt) -> str:
    """Returns what a statement defines; nothing if it is no definition."""
    if isinstance(node, ast.ClassDef | ast.FunctionDef):
        return node.name
    target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
    return target.id if isinstance(target, ast.Name) else ""


def definitions(body: list[ast.stmt], name: str) -> list[Definition]:
    """Returns the definitions of `name`; overloads and properties have several."""
    kinds = (ast.ClassDef, ast.FunctionDef, ast.AnnAssign, ast.Assign)
    return [
        Definition(node, docstring(node, [*body[number + 1 :], ast.Pass()][0]))
        for number, node in enumerate(body)
        if isinstance(node, kinds) and name_of(node) == name
    ]


def docstring(node: Node, following: ast.stmt) -> str:
    """Returns the text of a definition; that of an attribute follows it."""
    if isinstance(node, ast.ClassDef | ast.FunctionDef):
        return ast.get_docstring(node) or ""
    if isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant):
        return inspect.cleandoc(str(following.value.value))
    return ""


def directive(
    name: str, found: list[Definition], depth: int, module: str = "", *, in_class: bool = False
) -> str:
    """Returns the directives that describe a name, with its members inside."""
    text = ""
    for number, definition in enumerate(found):
        node = definition.node
        kind, signature, options = described(node, in_class=in_class)
        options += [":no-index:"] * (number > 0) + [f":module: {module}"] * (not in_class)
        content = markdown(definition.text)
        if isinstance(node, ast.ClassDef):
            for member, its_definitions in members(node.body):
                content += "\n\n" + directive(member, its_definitions, depth - 1, in_class=True)
        fence = "`" * depth
        head = "\n".join([f"{fence}{{py:{kind}}} {name}{signature}", *options])
        text += f"{head}\n\n{content}\n{fence}\n\n"
    return text


def described(node: Node, *, in_class: bool) -> tuple[str, str, list[str]]:
    """Returns the kind of a definition for Sphinx, its signature and its options."""
    if isinstance(node, ast.ClassDef):
        is_error = node.name in ("Error",) or any("Error" in ast.unparse(b) for b in node.bases)
        made = definitions(node.body, "__init__") or definitions(node.body, "__new__")
        signature = arguments(made[0].node, in_class=True) if made else ""
        return ("exception" if is_error else "class"), signature, []
    if isinstance(node, ast.AnnAssign):
        return ("attribute" if in_class else "data"), "", [f":type: {ast.unparse(node.annotation)}"]
    if isinstance(node, ast.Assign):
        value = ast.unparse(node.value)
        short = [f":value: {value}"] if len(value) < 60 else []
        return ("attribute" if in_class else "data"), "", short
    decorators = {ast.unparse(decorator).rpartition(".")[2] for decorator in node.decorator_list}
    if decorators & {"property", "cached_property", "setter"}:
        return "property", "", [f":type: {ast.unparse(node.returns)}"] if node.returns else []
    is_static = "staticmethod" in decorators
    options = [f":{each}:" for each in ("staticmethod", "classmethod") if each in decorators]
    signature = arguments(node, in_class=in_class and not is_static)
    return ("method" if in_class else "function"), signature, options


def arguments(node: Node, *, in_class: bool) -> str:
    """Returns the arguments of a function and what it returns, without `self`."""
    if not isinstance(node, ast.FunctionDef):
        return ""
    given = node.args
    positional = [*given.posonlyargs, *given.args]
    if in_class and positional:
        given = ast.arguments(
            [argument for argument in given.posonlyargs if argument is not positional[0]],
            [argument for argument in given.args if argument is not positional[0]],
            *(given.vararg, given.kwonlyargs, given.kw_defaults, given.kwarg, given.defaults),
        )
    returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    return f"({ast.unparse(given)})" + ("" if node.name == "__init__" else returns)


def markdown(text: str) -> str:
    """Returns a docstring as Markdown: its sections become lists."""

    def listed(section: re.Match[str]) -> str:
        entries = re.split(r"\n(?=\S)", inspect.cleandoc(section[2]))
        lines = (re.sub(r"^(\*{0,2}\w[\w.]*): ", r"`\1`: ", each) for each in entries)
        return f"**{section[1]}**\n\n" + "".join(f"- {indented(line)}\n" for line in lines)

    return SECTION.sub(listed, text + "\n").strip()


def indented(entry: str) -> str:
    """Returns the text of a list entry on one line."""
    return " ".join(line.strip() for line in entry.splitlines())
