# SPDX-License-Identifier: BSD-3-Clause
"""Compares what docs/stability.md promises with the record of the last release.

    tools/stability.py            names what broke since then
    tools/stability.py --write    records the present state, for a release

The record is text in tests/stability. Names that were added never fail. What broke fails unless
the version in pyproject.toml allows it. What is deprecated must name its end and its remedy.
"""

import ast
import os
import re
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import starmap, zip_longest
from pathlib import Path

import griffe
from clang import cindex
from mcap.reader import make_reader
from tracked_files import ROOT, tracked_files
from website.programs import Help, run_help
from website.python_reference import INTERNAL, STUB, modules
from write_docstrings import HAVE_MEMBERS, output_of
from write_reference import keys, keys_of

RECORD = ROOT / "tests" / "stability"
PROGRAM = str(ROOT / ".venv/bin/trifinger")  # finds those of build/release
# An entry has a name and what is promised of it; entries are in scopes such as classes.
Entries = dict[str, dict[str, str]]


# ---- records as text: a line for each scope, below it a line for each of its entries ----


def text_of(entries: Entries, *, shared: bool = False) -> str:
    """Returns the text of a record. Scopes may share entries that they all have: `sim, throw`."""
    scopes: dict[str, list[str]] = {}
    for scope, its_entries in entries.items():
        for name, value in its_entries.items():
            line = f"  {name}  {value}".rstrip()
            scopes.setdefault(line if shared else f"{scope}\n{line}", []).append(scope)
    lines: dict[str, list[str]] = {}
    for line, names in scopes.items():
        lines.setdefault(", ".join(names), []).append(line.rpartition("\n")[2])
    return "".join("\n".join([names, *of_them]) + "\n" for names, of_them in lines.items())


def entries_of(text: str) -> Entries:
    """Returns the entries in the text of a record."""
    entries: Entries = {}
    scopes: list[str] = []
    for line in text.splitlines():
        if line.startswith("  "):
            name, _, value = line[2:].partition("  ")
            for scope in scopes:
                entries.setdefault(scope, {})[name] = value
        else:
            scopes = line.split(", ")
    return entries


def breaks(old: Entries, new: Entries) -> Iterator[str]:
    """Yields a sentence for everything in `old` that `new` lacks or promises otherwise."""
    found: dict[str, list[str]] = {}  # scopes by what is the same in all of them
    for scope, entries in old.items():
        if scope not in new:
            yield f"{scope} is gone"
            continue
        for name, value in entries.items():
            now = new[scope].get(name)
            if now is None:
                said = f"{name} is gone" + (f"; it was {value}" if value else "")
                found.setdefault(said, []).append(scope)
            elif not all(starmap(is_wider, parts(value, now))):
                said = f"{name} was {value or 'plain'}, now it is {now or 'plain'}"
                found.setdefault(said, []).append(scope)
    yield from (f"{', '.join(scopes)}: {said}" for said, scopes in found.items())


def parts(old: str, new: str) -> Iterable[tuple[str, str]]:
    """Returns the parts of two values, which two spaces separate."""
    return zip_longest(old.split("  "), new.split("  "), fillvalue="")


RANGE = re.compile(r"([-+.e\d]+) to ([-+.e\d]+)(.*)")


def is_wider(old: str, new: str) -> bool:
    """Returns whether whoever relies on `old` is content with `new`: the same, or more of it."""
    was, now = RANGE.fullmatch(old), RANGE.fullmatch(new)
    if was and now:
        lower, upper = float(now[1]) <= float(was[1]), float(now[2]) >= float(was[2])
        return lower and upper and was[3] == now[3]
    choices = [
        {*re.findall(r"'[^']*'", each)} or {*re.split(r"(?<=\w)\|(?=\w)", each)}
        for each in (old, new)
    ]
    return choices[0] <= choices[1] or new.startswith(f"{old} [")  # one more optional argument


# ---- Python: public modules as stubs, which griffe compares ----


def python_record(known: Mapping[str, list[ast.stmt]]) -> str:
    """Returns stubs of modules without private names, docstrings and what functions do."""
    text = ""
    for name, body in sorted(known.items()):
        stub = ast.unparse(ast.Module(list(public(body)), []))
        stub = re.sub(r"(?m):\n +\.\.\.$", ": ...", re.sub(r"\n\n+", "\n", stub))
        text += (
            f"# {name}\n" + re.sub(r"(?m)^( {4})+", lambda at: " " * (len(at[0]) // 4), stub) + "\n"
        )
    return text


PRIVATE = r"_(?!_\w+__$)"  # names for us alone, but not __init__


def public(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Yields what others may use of the body of a module or class."""
    ellipsis: ast.stmt = ast.Expr(ast.Constant(...))
    assigned = " ".join(ast.unparse(node) for node in body if isinstance(node, ast.Assign))
    exported = re.findall(r"'(\w+)'", assigned) if "__all__" in assigned else []
    for node in body:
        match node:
            case ast.ClassDef(name=name) | ast.FunctionDef(name=name) if re.match(PRIVATE, name):
                pass
            case ast.ClassDef():
                node.body = list(public(node.body)) or [ellipsis]
                yield node
            case ast.FunctionDef(decorator_list=[ast.Name("property"), *_]):
                kind = node.returns or ast.Name("object")
                yield ast.AnnAssign(ast.Name(node.name), kind, simple=1)
            case ast.FunctionDef(decorator_list=[ast.Attribute(attr="setter"), *_]):
                pass
            case ast.FunctionDef():
                for argument in ast.walk(node.args):
                    if isinstance(argument, ast.arg):
                        argument.annotation = None
                node.body = [ellipsis]
                yield node
            case ast.Assign(targets=[ast.Name(name)]) | ast.AnnAssign(target=ast.Name(name)):
                if name == "__all__" or not name.startswith("_"):
                    yield node
            case ast.ImportFrom():
                names = [each.name for each in node.names if each.name in (each.asname, *exported)]
                node.names = [ast.alias(name, name) for name in names]
                if names:
                    yield node


STABLE = re.compile(r"trifinger(\.|$)|trifinger_view\.(motion|teaching)\b")


def python() -> str:
    """Returns the record of the modules in Python that are not young."""
    known = {name: module.body for name, module in modules().items() if STABLE.match(name)}
    return python_record({n: known[n] for n in known if n == STUB or not INTERNAL.match(n)})


class Exported(griffe.Extension):
    """Makes what a module imports public: the record has no other imports."""

    def on_alias_instance(self, *, alias: griffe.Alias, **_others: object) -> None:
        """Marks an imported name."""
        alias.public = True


def python_breaks(old: str, new: str) -> Iterator[str]:
    """Yields a sentence for everything that broke between two records of Python."""
    types = [dict(types_of(text)) for text in (old, new)]
    for name, kind in types[0].items():
        if (now := types[1].get(name, kind)) != kind:
            yield f"{name}: was {kind}, now it is {now}"
    with tempfile.TemporaryDirectory() as folder:
        packages = []
        for text, place in ((old, Path(folder, "old")), (new, Path(folder, "new"))):
            for name, body in sections(text):
                path = place.joinpath(*name.split("."), "__init__.pyi")
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(body)
                for above in path.parents[1 : len(name.split("."))]:
                    (above / "__init__.pyi").touch()
            packages.append(place)
        for package in sorted(path.name for path in packages[0].iterdir()):
            if not (packages[1] / package).exists():
                yield f"{package} is gone"
                continue
            load = partial(griffe.load, package, extensions=griffe.load_extensions(Exported))
            loaded = (load(search_paths=[place]) for place in packages)
            yield from map(sentence_of, griffe.find_breaking_changes(*loaded))


def sections(text: str) -> Iterator[tuple[str, str]]:
    """Yields name and body of each module in a record."""
    for module in re.split(r"^# (?=[\w.]+$)", text, flags=re.MULTILINE)[1:]:
        name, _, body = module.partition("\n")
        yield name, body


def types_of(text: str) -> Iterator[tuple[str, str]]:
    """Yields the type of each attribute, and what each function returns."""

    def walk(body: Iterable[ast.stmt], place: str) -> Iterator[tuple[str, str]]:
        for node in body:
            match node:
                case ast.ClassDef():
                    yield from walk(node.body, f"{place}.{node.name}")
                case ast.FunctionDef(name=name, returns=ast.expr() as kind):
                    yield f"{place}.{name}", ast.unparse(kind)
                case ast.AnnAssign(target=ast.Name(name), annotation=kind):
                    yield f"{place}.{name}", ast.unparse(kind)

    exported = set(re.findall(r"\b(\w+) as \1\b", text))
    for module, body in sections(text):
        for name, kind in walk(ast.parse(body).body, module):
            short = name.removeprefix(f"{STUB}.")
            if short == name or short.partition(".")[0] in exported:
                yield name.replace(STUB, "trifinger"), kind


def sentence_of(breakage: griffe.Breakage) -> str:
    """Returns a sentence about something that griffe has found."""
    found = breakage.as_dict()
    shown = [getattr(found[key], "name", None) or found[key] for key in ("old_value", "new_value")]
    named = breakage.kind.name.startswith("PARAMETER")
    about = f" ({shown[0] or shown[1]})" if named else ""
    if breakage.kind.name == "PARAMETER_CHANGED_DEFAULT":
        about += f" from {found['old_value'].default} to {found['new_value'].default}"
    path = found["object_path"].replace(STUB, "trifinger")
    return f"{path}: {breakage.kind.value[:1].lower()}{breakage.kind.value[1:]}{about}"


# ---- C++: the declarations of public headers ----


def cpp(folder: Path = ROOT / "include") -> Entries:
    """Returns the public declarations in the headers of a folder, by class and namespace.

    Raises:
        SystemExit: if a header does not compile
    """
    headers = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.hpp"))
    flags = ["-std=c++20", "-DEIGEN_DONT_VECTORIZE", f"-I{folder}"]
    flags += ["-isystem", output_of("c++", "-print-file-name=include").strip()]
    flags += output_of("pkg-config", "--cflags", "eigen3").split()
    program = "".join(f"#include <{header}>\n" for header in headers)
    unit = cindex.Index.create().parse(
        *("all.cpp", flags, [("all.cpp", program)]),
        cindex.TranslationUnit.PARSE_SKIP_FUNCTION_BODIES,
    )
    if errors := [each for each in unit.diagnostics if each.severity >= cindex.Diagnostic.Error]:
        sys.exit("\n".join(map(str, errors)))
    entries: Entries = {}

    def walk(parent: cindex.Cursor, scope: str) -> None:
        for cursor in parent.get_children():
            file = cursor.location.file
            is_ours = file is not None and file.name.startswith(str(folder))
            is_private = cursor.access_specifier == cindex.AccessSpecifier.PRIVATE
            if not is_ours or is_private or cursor.spelling in ("detail", ""):
                continue
            for name, value in declared(cursor):
                entries.setdefault(scope, {})[name] = value
            if cursor.kind in HAVE_MEMBERS:  # what is only declared here has none
                walk(cursor, f"{scope}::{cursor.spelling}".removeprefix("::"))

    walk(unit.cursor, "")
    return entries


Kind = cindex.CursorKind
FUNCTIONS = {Kind.FUNCTION_DECL, Kind.CXX_METHOD, Kind.CONSTRUCTOR, Kind.CONVERSION_FUNCTION}
FUNCTIONS |= {Kind.FUNCTION_TEMPLATE}
WHOLE = {Kind.VAR_DECL, Kind.TYPE_ALIAS_DECL, Kind.TYPE_ALIAS_TEMPLATE_DECL, Kind.CONCEPT_DECL}
WHOLE |= {Kind.FIELD_DECL}


def declared(cursor: cindex.Cursor) -> Iterator[tuple[str, str]]:
    """Yields name and meaning of a declaration; a function with each number of its arguments."""
    name = cursor.spelling
    tokens = [token.spelling for token in cursor.get_tokens()]
    if cursor.kind in FUNCTIONS:
        given = [each for each in cursor.get_children() if each.kind == Kind.PARM_DECL]
        needed = sum("=" not in [token.spelling for token in each.get_tokens()] for each in given)
        result = "" if cursor.kind == Kind.CONSTRUCTOR else cursor.result_type.spelling
        if "sizeof..." in result:  # an array whose elements are counted by the compiler
            result = "auto"
        result = "static " * cursor.is_static_method() + result
        for count in range(needed, len(given) + 1):
            arguments = ", ".join(each.type.spelling for each in given[:count])
            yield f"{name}({arguments})" + " const" * cursor.is_const_method(), result
    elif cursor.kind in HAVE_MEMBERS - {Kind.NAMESPACE} and cursor.is_definition():
        bases = [each for each in cursor.get_children() if each.kind == Kind.CXX_BASE_SPECIFIER]
        yield name, " : ".join(["type", *(each.type.spelling for each in bases)])
    elif cursor.kind == Kind.ENUM_CONSTANT_DECL:
        yield name, str(cursor.enum_value)
    elif cursor.kind in WHOLE:
        tokens.remove(name)  # the entry has it
        words = " ".join(token for token in tokens if token not in ("using", ";"))
        yield name, re.sub(r" ?(::|[<>,(){}\[\].]) ?", r"\1", words)


# ---- commands and their options ----

LIST = re.compile(r"^([A-Z][^\n]*):\n((?:  .*\n)+)", re.MULTILINE)
# Commands of packages are young, but not these two; so are those of packages in C++.
STABLE_OF_PACKAGES = {"teach", "motion"}
YOUNG = {"manipulate", "job", "endurance"}


def commands(help_of: Help = run_help) -> Entries:
    """Returns the options of every command that is not young."""
    entries: Entries = {}
    waiting = [["trifinger"]]
    while waiting:
        words = waiting.pop(0)
        text = re.sub(r"\n {30}", "  ", help_of(words))
        usage = text.partition("\n")[0].partition("[OPTIONS]")[2].strip()
        its_entries = entries[" ".join(words)] = {"arguments": usage}
        for title, body in LIST.findall(text):
            lines = [line for line in body.splitlines() if line[2] != " "]
            if title == "Options":
                its_entries |= {name: value for line in lines for name, value in options(line)}
            elif title.startswith(("Commands", "Programs of their own", "Python package")):
                names = {line.split()[0] for line in lines} - YOUNG
                if "package trifinger-" in title:
                    names &= STABLE_OF_PACKAGES
                waiting += [[*words, name] for name in sorted(names)]
    return entries


def options(line: str) -> Iterator[tuple[str, str]]:
    """Yields the names in a line about an option, with what it takes and its default."""
    shown, _, meaning = line.strip().partition("  ")
    names, _, takes = shown.replace(", -", ",-").partition(" ")
    default = re.search(r"default: (\S+?)(?=[;,.]?$|[;,] )", meaning)
    value = takes + (f"  default {default[1]}" if default else "")
    yield from ((name, value) for name in names.split(","))


# ---- configurations, and logs ----


def configurations() -> Entries:
    """Returns every key of each configuration: its value, and what is allowed."""
    found = {"a whole configuration": dict(rows(keys(PROGRAM)))}
    for path in sorted((ROOT / "config").glob("*.yml")):
        found[path.stem] = dict(rows(keys_of(PROGRAM, path)))
    return found


def rows(found: Iterable[tuple[str, str, str]]) -> Iterator[tuple[str, str]]:
    """Yields keys with what is promised of them, without folders of this machine."""
    for key, value, allowed in found:
        yield key, f"{re.sub(r'/.*/', '', value)}  {allowed}"


def log() -> Entries:
    """Returns the message types, metadata and topics of a log that is written now."""
    import trifinger  # the tests of these tools do without it

    with tempfile.TemporaryDirectory() as folder:
        os.environ["TRIFINGER_SESSION_DIR"] = folder
        with trifinger.simulate("sim", record=folder) as robot:
            for _ in range(10):
                robot.get_observation(robot.append_desired_action(robot.new_action()))
            robot.finish()
        (path,) = Path(folder).glob("*.mcap")
        return log_entries(path)


def log_entries(path: Path) -> Entries:
    """Returns the message types, metadata and topics of a log."""
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None  # noqa: S101, the writer closed the file
        entries: Entries = {"topics": {}}
        for channel in summary.channels.values():
            schema = summary.schemas[channel.schema_id]
            entries["topics"][channel.topic] = schema.name
            entries[f"metadata of {channel.topic}"] = dict.fromkeys(channel.metadata, "")
            texts = re.split(r"^=+\nMSG: (.*)\n", schema.data.decode(), flags=re.MULTILINE)
            for name, text in zip([schema.name, *texts[1::2]], texts[::2], strict=True):
                fields = (line.split(maxsplit=2) for line in text.splitlines() if line)
                entries[name] = {f[1]: " ".join([f[0], *f[2:]]) for f in fields if f[0] != "#"}
        for record in reader.iter_metadata():
            its_entries = entries[f"record {record.name}"] = dict.fromkeys(record.metadata, "")
            if version := record.metadata.get("format_version"):
                its_entries["format_version"] = version
        return entries


# ---- what is deprecated, and versions ----

MARK = re.compile(r"\[\[deprecated|@deprecated\b|\bis deprecated\b")
LAW = re.compile(r"([^\s\"]+) is deprecated and goes with version (\d+\.\d+): \w[^\"]{5,}")
PRODUCT = ("apps", "bindings", "include", "packages", "python", "src")


def mistakes_of_deprecated(texts: Mapping[str, str], changelog: str, version: str) -> list[str]:
    """Returns a sentence for each deprecated name in sources whose end or remedy is not right."""
    found = {}  # in order; a mark and its text may be found both
    for path, source in texts.items():
        text = re.sub(r"\"\s*f?\"", "", source)  # literals that continue each other
        for mark in MARK.finditer(text):
            law = LAW.search(text, max(0, mark.start() - 100), mark.end() + 300)
            if law is None:
                found[f"{path}: say 'NAME is deprecated and goes with version X.Y: REMEDY'"] = 1
                continue
            name, end = law[1], law[2]
            if numbers(end) <= numbers(version)[:2]:
                found[f"{path}: {name} goes with version {end}, this is {version}: remove it"] = 1
            elif not may_break(f"{end}.0", version):
                found[f"{path}: {name} goes with {end}; only {next_of(version)} may break"] = 1
            if f"`{name}` is deprecated" not in changelog:
                found[f"{path}: CHANGELOG.md does not say '`{name}` is deprecated'"] = 1
    return list(found)


def numbers(version: str) -> tuple[int, ...]:
    """Returns the numbers of a version, which can be compared."""
    return tuple(map(int, version.split(".")))


def may_break(version: str, released: str) -> bool:
    """Returns whether `version` may break what `released` had: a new MAJOR, before 1.0 a MINOR."""
    count = 2 if numbers(released)[0] == 0 else 1
    return numbers(version)[:count] > numbers(released)[:count]


def next_of(released: str) -> str:
    """Returns the first version that may break what `released` had."""
    major, minor, _ = numbers(released)
    return f"0.{minor + 1}.0" if major == 0 else f"{major + 1}.0.0"


def verdict(found: list[str], version: str, released: str, changelog: str) -> tuple[str, int]:
    """Returns what to say about what broke since a release, and the exit status."""
    if may_break(version, released):
        end = f"{len(found)} breaks since {released}, which {version} may have: the CHANGELOG names"
        return "\n".join([*found, f"{end} them"]), 0
    remedy = f"undo it, or make version {next_of(released)}"
    if f"## [{released}]" not in changelog:
        remedy = "undo it, or, as nothing is released yet, run tools/stability.py --write"
    return "\n".join(f"{each}: {remedy}" for each in found), int(bool(found))


# ---- the program ----

KINDS: dict[str, Callable[[], Entries]] = {
    "cpp": cpp,
    "commands": commands,
    "configurations": configurations,
    "log": log,
}


def since_release(new: Mapping[str, str]) -> Iterator[str]:
    """Yields a sentence for everything that broke between the record and present ones."""
    for kind, text in new.items():
        old = (RECORD / f"{kind}.txt").read_text()
        entries = entries_of(old), entries_of(text)
        differ = python_breaks(old, text) if kind == "python" else breaks(*entries)
        yield from (f"{kind}: {each}" for each in differ)


def main(*options: str) -> int:
    """Compares with the record, or writes it, and returns the exit status."""
    version: str = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    changelog = (ROOT / "CHANGELOG.md").read_text()
    new = {kind: text_of(make(), shared=make is configurations) for kind, make in KINDS.items()}
    new["python"] = python()
    found = list(since_release(new))
    if "--write" in options:
        for kind, text in (new | {"version": version + "\n"}).items():
            (RECORD / f"{kind}.txt").write_text(text)
        print(*found, f"recorded version {version} in {RECORD.relative_to(ROOT)}", sep="\n")
        return 0
    released = (RECORD / "version.txt").read_text().strip()
    said, status = verdict(found, version, released, changelog)
    sources = {
        str(path): (ROOT / path).read_text()
        for path in tracked_files(".py", ".pyi", ".hpp", ".cpp")
        if path.parts[0] in PRODUCT and "tests" not in path.parts
    }
    mistakes = mistakes_of_deprecated(sources, changelog, version)
    print(*filter(None, [said, *mistakes]), sep="\n")
    return 1 if mistakes else status


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
