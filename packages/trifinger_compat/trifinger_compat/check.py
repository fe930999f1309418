# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger compat-check`: what of somebody's program works here."""

import ast
import builtins
import importlib
import inspect
import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from trifinger.commands.command_line import ArgumentParser, add_json, say, say_json
from trifinger.text import printable

from trifinger_compat import bullet, opencv
from trifinger_compat.bullet_names import CONSTANTS, FUNCTIONS
from trifinger_compat.generation import chosen, why_sizes_differ
from trifinger_compat.handles import VIEWS, no_such_call, not_installed
from trifinger_compat.scopes import (
    Handle,
    Scopes,
    Thing,
    imported_by,
    loaded_by,
)
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
# What programs import beside the original, and how to get it where it is not installed.
_COMPANIONS = {
    "gym": "pip install gym==0.26.2, or import gymnasium in its place",
    "pinocchio": "pip install pin; kinematics are in robot_properties_fingers",
    "pybullet_data": "pip install pybullet",
    "pybullet_utils": "pip install pybullet",
    "trifinger_cameras_ros": "",
}
_FILES = {
    "robot_properties_fingers": "use simfinger.finger_urdf_path, or get_urdf_base_path() of "
    "robot_properties_fingers",
    "data": "use trifinger_simulation.get_data_dir()",
}
# How a program finds the folder of a package.
_FILES_BEGIN = ("__file__", "__path__", "files(", "resource_filename")
# Calls of PyBullet that are served for the robot, and those that are served for an object.
_OF_ROBOT = {"getJointStates"}
_OF_OBJECTS = bullet.SERVED.keys() & {
    *("applyExternalForce", "applyExternalTorque", "changeDynamics"),
    *("getBasePositionAndOrientation", "resetBasePositionAndOrientation"),
    *("getBaseVelocity", "resetBaseVelocity"),
}
_DICE = "trifinger_simulation.tasks.rearrange_dice"


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
        return printable(f"{self.file}:{self.line}: {self.name} {self.verdict}{why}")


class _Names(Scopes):
    """Collects where a program uses names of the original's packages, in the order it runs."""

    def __init__(
        self, file: Path, tree: ast.Module, imports: frozenset[str], has_files: bool
    ) -> None:
        super().__init__(tree)
        self._has_files = has_files
        self._file = file
        self._imports = imports
        self._caught: list[type[BaseException]] = []
        self._is_judging = True
        self._missing = 0
        self._cameras: list[tuple[int, int]] = []
        self._names: set[str] = set()
        self.findings: list[Finding] = []

    def judge(self) -> list[Finding]:
        """What was found, without repetition."""
        self.run()
        if self._names >= {f"{_DICE}.generate_goal_mask", f"{_DICE}.evaluate_state"}:
            for line, size in self._cameras:
                if size != chosen().image_size:
                    why = f"its cameras have {size} pixels; {why_sizes_differ(size)}"
                    self._add(line, f"{_DICE}.evaluate_state", MISSING, why, ValueError)
        return sorted(set(self.findings))

    def visit_Import(self, node: ast.Import) -> None:
        """`import trifinger_simulation.camera as camera`."""
        for alias in node.names:
            top = alias.name.partition(".")[0]
            name = alias.asname or top
            if _is_ours(top) or top == "pybullet":
                self.bind(name, Thing(alias.name if alias.asname else top))
                self._judge(node.lineno, alias.name, ModuleNotFoundError)
            else:
                self.bind(name, None)
                self._judge_companion(node.lineno, top)

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        """`from trifinger_simulation.tasks import move_cube`."""
        module = node.module or ""
        top = module.partition(".")[0]
        is_ours = not node.level and (_is_ours(top) or top == "pybullet")
        if not node.level and not is_ours:
            self._judge_companion(node.lineno, top)
        for alias in node.names:
            if alias.name == "*":
                if is_ours:
                    self._judge(node.lineno, module, ImportError)
                    for name in _public(module):
                        self.bind(name, Thing(f"{module}.{name}", is_from_star=True))
                continue
            self.bind(
                alias.asname or alias.name, Thing(f"{module}.{alias.name}") if is_ours else None
            )
            if is_ours:
                error = ImportError if _is_module(module) else ModuleNotFoundError
                self._judge(node.lineno, f"{module}.{alias.name}", error)

    def visit_If(self, node: ast.If) -> None:
        """What is under TYPE_CHECKING does not run."""
        test = node.test.attr if isinstance(node.test, ast.Attribute) else node.test
        name = test.id if isinstance(test, ast.Name) else test
        if name != "TYPE_CHECKING":
            self.generic_visit(node)
            return
        self._is_judging = False
        for each in node.body:
            self.visit(each)
        self._is_judging = True
        for each in node.orelse:
            self.visit(each)

    def visit_Try(self, node: ast.Try) -> None:
        """What is caught does not end the program; and without an error no handler runs."""
        before = self._missing
        with self._catching(node.handlers):
            for each in node.body:
                self.visit(each)
        has_failed = self._missing > before or not _is_only_ours(node.body)
        kept = self.kept()
        for handler in node.handlers:
            if has_failed:
                self.visit(handler)
        if self._missing == before:
            self.restore(kept)
        for each in (*node.orelse, *node.finalbody):
            self.visit(each)

    @contextmanager
    def _catching(self, handlers: Sequence[ast.ExceptHandler]) -> Iterator[None]:
        count = len(self._caught)
        self._caught += [error for handler in handlers for error in _errors(handler.type)]
        yield
        del self._caught[count:]

    def visit_Name(self, node: ast.Name) -> None:
        """`sample_goal`, which was imported by a star."""
        thing = self.known(node)
        if isinstance(thing, Thing) and thing.is_from_star and isinstance(node.ctx, ast.Load):
            self._judge(node.lineno, thing.name, AttributeError)

    def visit_Attribute(self, node: ast.Attribute) -> None:
        """`move_cube.sample_goal`, or `finger.finger_id` of an object."""
        if self._judge_file(node):
            return
        thing = self.known(node)
        if isinstance(thing, Thing):
            self._judge(node.lineno, thing.name, AttributeError)
            return
        if node.attr in _MEMBERS:
            symbol = _MEMBERS[node.attr]
            self._add(node.lineno, symbol.name, symbol.verdict, symbol.note)
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        """`SimFinger("trifingerpro", time_step=0.0005)`."""
        if self._judge_file(node):
            return
        thing = self.known(node.func)
        name = thing.name if isinstance(thing, Thing) else ""
        if name.startswith("pybullet."):
            self._judge_call_of_bullet(name.partition(".")[2], node)
            for each in (*node.args, *node.keywords):
                self.visit(each)
            return
        if name:
            found, _, is_whole = _find(name)
            if is_whole and (why := _mismatch(found, node)):
                self._add(node.lineno, f"{name}()", MISSING, why, TypeError)
            for argument, value in _arguments(found, node):
                if why := _refusal(argument, value):
                    self._add(node.lineno, f"{name}({argument}=)", MISSING, why, Exception)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        """`Path(trifinger_simulation.__file__).parent / "data"`."""
        if not self._judge_file(node):
            self.generic_visit(node)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """`f"{folder}/data"`."""
        if not self._judge_file(node):
            self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        """The names of calibrations say how many pixels their images have."""
        if isinstance(node.value, str):
            text = node.value.replace("{id}", "0")
            if found := re.search(r"\d_cropped(_and_downsampled)?", text):
                self._cameras.append((node.lineno, 270 if found[1] else 540))

    def _judge_file(self, node: ast.expr) -> bool:
        """Judges a path in the folder of a package; False if it is not one, or is there."""
        text = self.text(node) if self._has_files else None
        if text is None or text.package is None:
            return False
        path, folder = Path(text.value), Path(text.package)
        if not path.is_relative_to(folder) or _exists(path):
            return False
        inside = path.relative_to(folder)
        hint = next((hint for part, hint in _FILES.items() if part in inside.parts), "")
        why = f"there is no such file; {hint}" if hint else "there is no such file"
        self._add(node.lineno, f"{folder.name}/{inside}", MISSING, why, OSError)
        return True

    def _judge_companion(self, line: int, module: str) -> None:
        if module in _COMPANIONS and find_spec(module) is None:
            hint = _COMPANIONS[module]
            why = f"it is not installed; {hint}" if hint else "there is nothing like it"
            self._add(line, module, MISSING, why, ModuleNotFoundError)

    def _judge(self, line: int, name: str, error: type[Exception]) -> None:
        self._names.add(name)
        if name.partition(".")[0] == "pybullet":
            if name != "pybullet":  # what is used of it counts
                self._add(line, name, *_judge_call(name.partition(".")[2], ()), error)
            return
        verdict, why = _judge(name)
        if verdict != MISSING and error is AttributeError and (module := self._not_loaded(name)):
            verdict, why = MISSING, f"a program must import {module} to use it"
        self._add(line, name, verdict, why, error)

    def _not_loaded(self, name: str) -> str:
        """The module in a name that nothing in the program loads; empty if there is none."""
        parts = name.split(".")
        for end in range(2, len(parts) + 1):
            module = ".".join(parts[:end])
            if module in self._imports or not _is_module(module):
                continue
            if module not in loaded_by(self._imports):
                return module
        return ""

    def _judge_call_of_bullet(self, call: str, node: ast.Call) -> None:
        values = [*node.args, *(each.value for each in node.keywords)]
        kinds = [kind for value in values if isinstance(kind := self.known(value), Handle)]
        verdict, why = _judge_call(call, kinds)
        if call == "changeDynamics" and kinds:
            known = {"bodyUniqueId", "linkIndex", "mass", "physicsClientId"}
            if len(node.args) > 3 or {each.arg for each in node.keywords} - known:
                verdict, why = MISSING, _text(no_such_call(call))
        self._add(node.lineno, f"pybullet.{call}", verdict, why, NotImplementedError)

    def _add(
        self, line: int, name: str, verdict: str, why: str, error: type[Exception] = Exception
    ) -> None:
        if not self._is_judging:
            return
        if verdict == MISSING:
            self._missing += 1
            if any(issubclass(error, caught) for caught in self._caught):
                verdict, why = DIFFERS, f"the program catches the error: {why}"
        self.findings.append(Finding(self._file, line, name, verdict, why))


def _is_ours(package: str) -> bool:
    return package in PACKAGES


def _exists(path: Path) -> bool:
    """Whether there is such a file; no program has one whose name the system refuses."""
    try:
        return path.exists()
    except OSError:
        return False


def _is_module(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except ImportError:  # what is before it is no package
        return False


def _is_only_ours(body: Sequence[ast.stmt]) -> bool:
    """True for nothing but imports of packages that are here: they raise no error."""
    names = [
        alias.name if isinstance(each, ast.Import) else (each.module or "")
        for each in body
        if isinstance(each, ast.Import | ast.ImportFrom)
        for alias in each.names
    ]
    tops = {name.partition(".")[0] for name in names}
    is_all = all(isinstance(each, ast.Import | ast.ImportFrom) for each in body)
    return is_all and all(_is_ours(top) or top == "pybullet" for top in tops)


def _errors(node: ast.expr | None) -> list[type[BaseException]]:
    """The errors that a handler names."""
    if node is None:
        return [BaseException]
    names = node.elts if isinstance(node, ast.Tuple) else [node]
    found = [getattr(builtins, getattr(each, "id", ""), None) for each in names]
    return [each for each in found if isinstance(each, type)]


def _public(module: str) -> list[str]:
    """What a star imports."""
    with suppress(ImportError):
        found = importlib.import_module(module)
        return getattr(found, "__all__", [each for each in vars(found) if each[0] != "_"])
    return []


@cache
def _has_bullet() -> bool:
    return bullet.find_installed() is not None


def _text(error: Exception) -> str:
    return str(error).partition(": ")[2]


def _judge_call(name: str, kinds: Sequence[Handle]) -> tuple[str, str]:
    """What becomes of a name of PyBullet that gets ids of these kinds, and why."""
    if name in CONSTANTS or name == "error":
        return SAME, ""
    if name not in FUNCTIONS:
        has_name = _has_bullet() and hasattr(importlib.import_module("pybullet"), name)
        return (SAME, "") if has_name else (MISSING, "PyBullet has no such name")
    if name in VIEWS:
        return DIFFERS, "it leaves a simulation alone: views belong to `trifinger view`"
    bodies = {kind.kind for kind in kinds} - {"client"}
    is_refused = name in bullet.SERVED and (
        (name in _OF_OBJECTS and "robot" in bodies) or (name in _OF_ROBOT and "object" in bodies)
    )
    if is_refused:
        return MISSING, f"it takes {'an object' if name in _OF_OBJECTS else 'the robot'} alone"
    if name not in bullet.SERVED:
        if kinds:
            return MISSING, _text(no_such_call(name))
        if not _has_bullet():
            return MISSING, _text(not_installed(name))
    return SAME, ""


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
    thing, why, _ = _find(name)
    if why:
        return MISSING, why
    module, attribute = (getattr(thing, each, "") for each in ("__module__", "__qualname__"))
    if f"{module}.{attribute}" in opencv.USERS and opencv.is_missing():
        return MISSING, opencv.MISSING
    symbol = _BY_PATH.get(name) or _refused().get(id(thing))
    return (symbol.verdict, symbol.note) if symbol else (SAME, "")


def _find(name: str) -> tuple[object, str, bool]:
    """What a name with dots stands for, or why it stands for nothing, and whether that is all.

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
        for place, attribute in enumerate(parts[end:], end + 1):
            if not hasattr(thing, attribute):
                return None, f"{module} has no '{attribute}' here", False
            thing = getattr(thing, attribute)
            is_value = not isinstance(thing, type) and not hasattr(thing, "__name__")
            if is_value or id(thing) in _refused():
                return thing, "", place == len(parts)
        return thing, "", True
    return None, "there is no such module", False


def _mismatch(thing: Any, call: ast.Call) -> str:
    """Why a call does not fit what is called; empty if it does, or cannot be known."""
    starred = any(isinstance(value, ast.Starred) for value in call.args)
    if starred or any(each.arg is None for each in call.keywords) or id(thing) in _refused():
        return ""
    if not (inspect.isclass(thing) or inspect.isroutine(thing)):
        return ""
    try:
        signature = inspect.signature(thing)
    except (TypeError, ValueError):
        return ""
    try:
        signature.bind(*call.args, **{str(each.arg): each.value for each in call.keywords})
    except TypeError as error:
        return str(error)
    return ""


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


def check_text(text: str, file: Path, others: frozenset[str] = frozenset()) -> list[Finding]:
    """All names of the original in a program; raises SyntaxError.

    `others` are modules that other files of the program import.
    """
    tree = ast.parse(text, str(file))
    if not any(name in text for name in (*PACKAGES, *_COMPANIONS, "pybullet", *_MEMBERS)):
        return []  # most files of a folder are about something else
    has_files = any(word in text for word in _FILES_BEGIN)
    return _Names(file, tree, imported_by(tree) | others, has_files).judge()


def programs(path: Path) -> Iterator[Path]:
    """The file, or all Python files below a folder."""
    if path.is_file():
        yield path
        return
    yield from sorted(each for each in path.rglob("*.py") if ".git" not in each.parts)


def _imports_of(files: Sequence[Path]) -> frozenset[str]:
    """The modules that any of these files imports."""
    imports: frozenset[str] = frozenset()
    for file in files:
        with suppress(SyntaxError, UnicodeDecodeError):
            imports |= imported_by(ast.parse(file.read_text()))
    return imports


def report(path: Path, show_all: bool, as_json: bool = False) -> int:
    """Prints what of the programs in `path` works; returns the exit status."""
    files = list(programs(path))
    if not files:
        say(f"trifinger compat-check: {path} has no Python files", file=sys.stderr)
        return 2
    counts: Counter[str] = Counter()
    shown: list[Finding | str] = []
    imports = _imports_of(files)
    for file in files:
        try:
            findings = check_text(file.read_text(), file, imports)
        except (SyntaxError, UnicodeDecodeError) as error:
            shown.append(printable(f"{file}: cannot be read as Python 3: {error}"))
            counts["unreadable"] += 1
            continue
        for finding in findings:
            counts[finding.verdict] += 1
            if show_all or finding.verdict != SAME:
                shown.append(finding)
    status = 1 if counts[MISSING] or counts["unreadable"] else 0
    if as_json:
        places = [
            asdict(one) | {"file": str(one.file)} for one in shown if not isinstance(one, str)
        ]
        unreadable = [one for one in shown if isinstance(one, str)]
        say_json({"files": len(files), "places": places, "unreadable": unreadable})
        return status
    for one in shown:
        say(one)
    total = counts[SAME] + counts[DIFFERS] + counts[MISSING]
    say(
        f"{len(files)} files, {total} places that use the original: {counts[SAME]} work as they "
        f"are, {counts[DIFFERS]} work with a difference, {counts[MISSING]} do not work."
    )
    say(f"PyBullet is {'installed' if _has_bullet() else 'not installed'}.")
    say(f"Not judged: members of objects, except {' and '.join(sorted(_MEMBERS))}.")
    if counts["unreadable"]:
        say(f"{counts['unreadable']} files could not be read.")
    return status


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger compat-check`."""
    parser = ArgumentParser(
        prog="trifinger compat-check",
        description="Say what of programs for the original stack works here, and why not.",
        epilog="Programs are read, never run. Exit status: 0 if everything works, 1 if something "
        "does not, 2 if there is nothing to read. docs/coming_from_the_original.md explains it.\n"
        "Example:\n  trifinger compat-check my_program.py",
    )
    parser.add_argument("path", type=Path, metavar="PATH", help="a program, or a folder of them")
    parser.add_argument("--all", action="store_true", help="show also what works as it is")
    add_json(parser)
    arguments = parser.parse_args(words)
    if not arguments.path.exists():
        say(f"trifinger compat-check: there is no {arguments.path}", file=sys.stderr)
        return 2
    return report(arguments.path, arguments.all, arguments.json)


if __name__ == "__main__":
    sys.exit(main())
