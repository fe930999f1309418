# SPDX-License-Identifier: BSD-3-Clause
"""What names of a program stand for, as far as that can be told without running it."""

import ast
import importlib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TypeAlias

from trifinger_compat.symbols import PACKAGES

# Members of objects that are ids, and of what: a simulation, its robot, or an object.
HANDLE_MEMBERS = {
    "_pybullet_client_id": "client",
    "finger_id": "robot",
    "_object_id": "object",
    "block": "object",
    "block_id": "object",
}
_ONLY_OF_CUBES = ("block", "block_id")  # words that have other meanings, too


@dataclass(frozen=True)
class Thing:
    """A name with dots of a package of the original, or of PyBullet."""

    name: str
    is_from_star: bool = False


@dataclass(frozen=True)
class Handle:
    """An id of a simulation."""

    kind: str


@dataclass(frozen=True)
class Text:
    """A text, or a path in the folder of a package."""

    value: str
    package: str | None = None


Known: TypeAlias = Thing | Handle | Text | None


@dataclass
class _Scope:
    names: dict[str, Known]
    is_class: bool = False


class Scopes(ast.NodeVisitor):
    """Visits a program in the order in which it runs: bodies of functions after their module."""

    def __init__(self, tree: ast.Module) -> None:
        self._tree = tree
        self._stack = [_Scope({})]
        self._later: list[tuple[ast.FunctionDef | ast.AsyncFunctionDef, list[_Scope]]] = []
        self._attributes = dict(_attributes(tree))

    def run(self) -> None:
        """Visits everything."""
        for each in self._tree.body:
            self.visit(each)
        while self._later:
            node, stack = self._later.pop(0)
            self._stack = [*stack, _Scope(dict.fromkeys(_locals(node)))]
            for each in node.body:
                self.visit(each)

    def bind(self, name: str, value: Known) -> None:
        """Lets a name stand for something, or for nothing that is known."""
        self._stack[-1].names[name] = value

    def kept(self) -> list[dict[str, Known]]:
        """All names of now, for `restore`."""
        return [dict(scope.names) for scope in self._stack]

    def restore(self, kept: Sequence[dict[str, Known]]) -> None:
        """Names stand for what they stood for."""
        for scope, names in zip(self._stack, kept, strict=True):
            scope.names.clear()
            scope.names.update(names)

    def known(self, node: ast.expr) -> Known:
        """What an expression stands for."""
        if isinstance(node, ast.Name):
            return self._lookup(node.id)
        if isinstance(node, ast.Attribute):
            before = self.known(node.value)
            if isinstance(before, Thing):
                return Thing(f"{before.name}.{node.attr}")
            kind = _kind(node) or self._attributes.get(node.attr)
            return Handle(kind) if kind else None
        return None

    def _lookup(self, name: str) -> Known:
        for scope in reversed(self._stack):
            # A function does not see the names of the class around it.
            if name in scope.names and not (scope.is_class and scope is not self._stack[-1]):
                return scope.names[name]
        return None

    def text(self, node: ast.expr | None) -> Text | None:
        """The text or path that an expression makes, up to what is not known."""
        match node:
            case ast.Constant(value=str() as value):
                return Text(value)
            case ast.Name():
                thing = self._lookup(node.id)
                return thing if isinstance(thing, Text) else None
            case ast.Attribute(attr="__file__"):
                return self._file_of(node.value)
            case ast.Attribute(attr="parent"):
                return _parent(self.text(node.value))
            case ast.Subscript(value=ast.Attribute(attr="__path__") as paths):
                return _parent(self._file_of(paths.value))
            case ast.Subscript(
                value=ast.Attribute(attr="parents") as paths, slice=ast.Constant(value=int() as up)
            ):
                text = self.text(paths.value)
                for _ in range(up + 1):
                    text = _parent(text)
                return text
            case ast.BinOp(op=ast.Div() | ast.Add()):
                return self._joined([node.left, node.right], isinstance(node.op, ast.Div))
            case ast.JoinedStr():
                return self._joined(
                    [v.value if isinstance(v, ast.FormattedValue) else v for v in node.values],
                    False,
                )
            case ast.Call():
                return self._text_of_call(node)
        return None

    def _text_of_call(self, node: ast.Call) -> Text | None:
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        of = node.func.value if isinstance(node.func, ast.Attribute) else None
        match name:
            case "dirname":
                return _parent(self.text(node.args[0])) if node.args else None
            case "join" if node.args:
                return self._joined(node.args, True)
            case "joinpath" if of is not None:
                return self._joined([of, *node.args], True)
            case "resolve" | "absolute" | "as_posix" if of is not None and not node.args:
                return self.text(of)
            case "Path" | "PurePath" if node.args:
                return self._joined(node.args, True)
            case "str" | "abspath" | "realpath" | "fspath" | "normpath" if len(node.args) == 1:
                return self.text(node.args[0])
            case "files" if len(node.args) == 1:
                return _folder(self.text(node.args[0]))
            case "resource_filename" if len(node.args) == 2:
                return _plus(_folder(self.text(node.args[0])), self.text(node.args[1]), True)
        return None

    def _joined(self, parts: Sequence[ast.expr], is_path: bool) -> Text | None:
        """The parts in a row; without those that come after one that is not known."""
        whole = self.text(parts[0])
        for part in parts[1:]:
            text = self.text(part)
            if text is None:
                # A text may go on within a name: only folders are known.
                return (
                    whole
                    if is_path or whole is None
                    else _parent(Text(whole.value + "x", whole.package))
                )
            whole = _plus(whole, text, is_path)
        return whole

    def _file_of(self, node: ast.expr) -> Text | None:
        thing = self.known(node)
        if not isinstance(thing, Thing) or thing.name.partition(".")[0] not in PACKAGES:
            return None
        with suppress(ImportError):
            module = importlib.import_module(thing.name)
            top = importlib.import_module(thing.name.partition(".")[0])
            if module.__file__ and top.__file__ and hasattr(top, "__path__"):
                return Text(module.__file__, str(Path(top.__file__).parent))
        return None

    # What binds names.

    def visit_Assign(self, node: ast.Assign) -> None:
        """`finger = platform.simfinger`."""
        self.visit(node.value)
        for target in node.targets:
            self._bind_target(target, node.value)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        """`finger: SimFinger = platform.simfinger`."""
        self.visit(node.annotation)
        if node.value is not None:
            self.visit(node.value)
            self._bind_target(node.target, node.value)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        """`path += "/data"`."""
        self.visit(node.value)
        self._bind_target(node.target)

    def visit_NamedExpr(self, node: ast.NamedExpr) -> None:
        """`(finger := platform.simfinger)`."""
        self.visit(node.value)
        self._bind_target(node.target, node.value)

    def visit_Delete(self, node: ast.Delete) -> None:
        """`del platform`."""
        for target in node.targets:
            self._bind_target(target)

    def visit_For(self, node: ast.For | ast.AsyncFor) -> None:
        """`for camera in cameras`."""
        self.visit(node.iter)
        self._bind_target(node.target)
        for each in (*node.body, *node.orelse):
            self.visit(each)

    visit_AsyncFor = visit_For

    def visit_withitem(self, node: ast.withitem) -> None:
        """`with open(name) as file`."""
        self.visit(node.context_expr)
        if node.optional_vars is not None:
            self._bind_target(node.optional_vars)

    def visit_ExceptHandler(self, node: ast.ExceptHandler) -> None:
        """`except ValueError as error`."""
        if node.type is not None:
            self.visit(node.type)
        if node.name is not None:
            self.bind(node.name, None)
        for each in node.body:
            self.visit(each)

    def visit_MatchAs(self, node: ast.MatchAs) -> None:
        """`case [x, y] as point`."""
        if node.name is not None:
            self.bind(node.name, None)
        self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef | ast.AsyncFunctionDef) -> None:
        """Its body runs when the module is there."""
        for each in (*node.decorator_list, node.args, *filter(None, [node.returns])):
            self.visit(each)
        self.bind(node.name, None)
        self._later.append((node, list(self._stack)))

    visit_AsyncFunctionDef = visit_FunctionDef

    def visit_Lambda(self, node: ast.Lambda) -> None:
        """`lambda camera: camera.get_image()`."""
        self.visit(node.args)
        self._stack.append(_Scope(dict.fromkeys(_parameters(node.args))))
        self.visit(node.body)
        self._stack.pop()

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        """Its body runs at once, with names of its own."""
        for each in (*node.decorator_list, *node.bases, *node.keywords):
            self.visit(each)
        self.bind(node.name, None)
        self._stack.append(_Scope({}, is_class=True))
        for statement in node.body:
            self.visit(statement)
        self._stack.pop()

    def visit_ListComp(self, node: ast.ListComp | ast.SetComp | ast.GeneratorExp) -> None:
        """`[camera.get_image() for camera in cameras]`."""
        self._visit_comprehension(node.generators, node.elt)

    visit_SetComp = visit_ListComp
    visit_GeneratorExp = visit_ListComp

    def visit_DictComp(self, node: ast.DictComp) -> None:
        """`{camera: camera.get_image() for camera in cameras}`."""
        self._visit_comprehension(node.generators, node.key, node.value)

    def _visit_comprehension(
        self, generators: Sequence[ast.comprehension], *values: ast.expr
    ) -> None:
        self._stack.append(_Scope({}))
        for each in generators:
            self.visit(each.iter)
            self._bind_target(each.target)
            for condition in each.ifs:
                self.visit(condition)
        for value in values:
            self.visit(value)
        self._stack.pop()

    def _bind_target(self, target: ast.expr, value: ast.expr | None = None) -> None:
        if isinstance(target, ast.Name):
            known = None if value is None else (self.known(value) or self.text(value))
            self.bind(target.id, known)
            return
        for each in ast.walk(target):
            if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store | ast.Del):
                self.bind(each.id, None)
            elif isinstance(each, ast.Attribute | ast.Subscript):
                self.visit(each.value)


def _kind(node: ast.Attribute) -> str | None:
    """Of what an attribute is the id."""
    owner = getattr(node.value, "attr", getattr(node.value, "id", ""))
    if node.attr in _ONLY_OF_CUBES and not owner.endswith("cube"):
        return None
    return HANDLE_MEMBERS.get(node.attr)


def _attributes(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Attributes that programs give to their own objects: `self.client = .._pybullet_client_id`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Attribute):
            kind = _kind(node.value)
            for target in node.targets:
                if kind and isinstance(target, ast.Attribute):
                    yield target.attr, kind


def _parameters(arguments: ast.arguments) -> list[str]:
    every = (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)
    return [each.arg for each in (*every, arguments.vararg, arguments.kwarg) if each is not None]


def _locals(function: ast.FunctionDef | ast.AsyncFunctionDef) -> set[str]:
    """Names of its own that a function has, from its first line on."""
    names = set(_parameters(function.args))
    others: set[str] = set()
    pending: list[ast.AST] = list(function.body)
    while pending:
        node = pending.pop()
        if isinstance(node, ast.Global | ast.Nonlocal):
            others |= set(node.names)
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names.add(node.name)
            continue
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names |= {alias.asname or alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, ast.ListComp | ast.SetComp | ast.GeneratorExp | ast.DictComp):
            continue  # its names are its own
        pending += ast.iter_child_nodes(node)
    return names - others


def _parent(text: Text | None) -> Text | None:
    return None if text is None else Text(str(Path(text.value).parent), text.package)


def _plus(before: Text | None, after: Text | None, is_path: bool) -> Text | None:
    if before is None or after is None:
        return before
    value = str(Path(before.value, after.value)) if is_path else before.value + after.value
    return Text(value, before.package or after.package)


def _folder(package: Text | None) -> Text | None:
    """The folder of a package of the original."""
    if package is None or package.value.partition(".")[0] not in PACKAGES:
        return None
    spec = find_spec(package.value)
    if spec is None or spec.origin is None or not spec.submodule_search_locations:
        return None
    folder = str(Path(spec.origin).parent)
    return Text(folder, folder)


def imported_by(tree: ast.Module, at_once: bool = False) -> frozenset[str]:
    """The modules of the original that a program imports, without those that they import.

    With `at_once`, those that it does not leave to a function.
    """
    modules: set[str] = set()
    pending: list[ast.AST] = [tree]
    while pending:
        node = pending.pop()
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            modules.add(node.module)
            modules |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif not (at_once and isinstance(node, ast.FunctionDef)):
            pending += ast.iter_child_nodes(node)
    parts = {
        name.rsplit(".", count)[0]
        for name in modules
        for count in range(name.count(".") + 1)
        if name.partition(".")[0] in (*PACKAGES, "trifinger_compat")
    }
    return frozenset(parts)


@cache
def loaded_by(modules: frozenset[str]) -> frozenset[str]:
    """The modules that are loaded if these are imported, by the text of the packages."""
    loaded: set[str] = set()
    pending = set(modules)
    while pending:
        name = pending.pop()
        if name not in loaded and (imports := _imports_of(name)) is not None:
            loaded.add(name)
            pending |= imports
    return frozenset(loaded)


@cache
def _imports_of(module: str) -> frozenset[str] | None:
    """What a module imports; None if there is no such module."""
    try:
        spec = find_spec(module)
    except ImportError:  # what is before it is no package
        return None
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        return None
    return imported_by(ast.parse(Path(spec.origin).read_text()), at_once=True)
