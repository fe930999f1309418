# SPDX-License-Identifier: BSD-3-Clause
"""What `./run check` says when something stable breaks, on small examples that were made up."""

import ast
from pathlib import Path

import pytest
import stability
from mcap.writer import Writer
from stability import (
    breaks,
    commands,
    cpp,
    entries_of,
    is_wider,
    log_entries,
    mistakes_of_deprecated,
    python_breaks,
    python_record,
    text_of,
    verdict,
)

CHANGELOG = "## [Unreleased]\n\n## [0.3.1] - 2026-11-30\n"


def declarations(folder: Path, text: str) -> stability.Entries:
    """The declarations in a header with this text."""
    (folder / "robot.hpp").write_text(f"#pragma once\n{text}\n")
    return cpp(folder)


def record(**modules: str) -> str:
    """The record of Python modules with these texts."""
    return python_record({name: ast.parse(text).body for name, text in modules.items()})


# ---- records ----


def test_a_text_gives_back_what_it_was_made_of() -> None:
    same = {"boundary": "true  true or false", "platform": ""}
    entries = {"sim": same, "throw": same | {"fingers.height": "0.6  0.2 to 0.6 m"}}
    for shared in (False, True):
        assert entries_of(text_of(entries, shared=shared)) == entries
    assert text_of(entries, shared=True).count("boundary") == 1


def test_the_record_in_the_repository_is_whole() -> None:
    for kind in stability.KINDS:
        assert len(entries_of((stability.RECORD / f"{kind}.txt").read_text())) > 20, kind
    assert "class Log" in (stability.RECORD / "python.txt").read_text()


@pytest.mark.parametrize(
    ("old", "new", "content"),
    [
        ("0.2 to 0.6 m", "0.2 to 0.6 m", True),
        ("0.2 to 0.6 m", "0.1 to 1e+01 m", True),
        ("0.2 to 0.6 m", "0.3 to 0.6 m", False),
        ("0.2 to 0.6 m", "0.2 to 0.5 m", False),
        ("0.2 to 0.6 m", "200 to 600 mm", False),
        ("0.2 to 0.6 m", "0 to 600 mm", False),
        ("'edu' or 'pro'", "'edu', 'pro' or 'one'", True),
        ("'edu', 'pro' or 'one'", "'edu' or 'pro'", False),
        ("require|try", "require|try|off", True),
        ("require|try|off", "require|off", False),
        ("[NAME]", "[NAME] [STEP]", True),
        ("[NAME]", "[NAME] STEP", False),
        ("a text", "a whole number", False),
    ],
)
def test_more_is_allowed_and_less_is_a_break(old: str, new: str, content: bool) -> None:
    assert is_wider(old, new) == content


# ---- what breaks is named ----


def test_a_key_that_changes_is_named() -> None:
    same = {"fingers.soft_tips": "true  true or false", "joints.damping": "0.001  0 to 1 Nms/rad"}
    old = {
        "sim": same | {"fingers.height": "0.283  0.2 to 0.6 m"},
        "catch": same,
        "throw": {},
    }
    now = {"added": "1  0 to 2", "joints.damping": "0.001  0 to 0.5 Nms/rad"}
    new = {"sim": now | {"fingers.height": "0.3  0.2 to 0.6 m"}, "catch": now}
    assert list(breaks(old, new)) == [
        "throw is gone",
        "sim, catch: fingers.soft_tips is gone; it was true  true or false",
        "sim, catch: joints.damping was 0.001  0 to 1 Nms/rad, now it is 0.001  0 to 0.5 Nms/rad",
        "sim: fingers.height was 0.283  0.2 to 0.6 m, now it is 0.3  0.2 to 0.6 m",
    ]
    assert list(breaks(new, new)) == []


def test_a_field_of_a_log_that_changes_is_named() -> None:
    old = {"trifinger_msgs/Action": {"torque": "float64[9] # [Nm]", "mode": "uint8"}}
    new = {"trifinger_msgs/Action": {"torque": "float64[9] # [mNm]"}}
    assert list(breaks(old, new)) == [
        "trifinger_msgs/Action: torque was float64[9] # [Nm], now it is float64[9] # [mNm]",
        "trifinger_msgs/Action: mode is gone; it was uint8",
    ]


def test_the_message_types_of_a_log_are_compared(tmp_path: Path) -> None:
    def logged(fields: str, **metadata: str) -> stability.Entries:
        path = tmp_path / "log.mcap"
        with path.open("wb") as file:
            writer = Writer(file)
            writer.start()
            inner = f"{'=' * 80}\nMSG: trifinger_msgs/Action\n{fields}"
            text = f"int64 time_index\nAction action\n{inner}".encode()
            schema = writer.register_schema("trifinger_msgs/msg/Step", "ros2msg", text)
            writer.register_channel("/sim/step", "cdr", schema, metadata)
            writer.add_metadata("trifinger.log", {"format_version": "1", "host": "here"})
            writer.finish()
        return log_entries(path)

    old = logged("float64[9] torque # [Nm]\n", session="sim", role="step")
    assert list(breaks(old, old)) == []
    assert old["record trifinger.log"] == {"format_version": "1", "host": ""}
    changed = logged("float32[9] torque # [Nm]\nuint8 added\n", session="sim")
    assert list(breaks(old, changed)) == [
        "metadata of /sim/step: role is gone",
        "trifinger_msgs/Action: torque was float64[9] # [Nm], now it is float32[9] # [Nm]",
    ]


HELP = """Usage: trifinger{words} [OPTIONS] {arguments}

Does something.

Options:
  -h, --help                  Print this help
{options}
Commands:
  read                        Print elements
{more}
Python package trifinger-view:
  view                        Young
  teach                       Stable, though in a package

Example:
  trifinger read sim
"""


def helps(arguments: str = "[NAME]", options: str = "", more: str = "") -> stability.Entries:
    """The commands of a program with one command, whose help has these words."""

    def help_of(words: list[str]) -> str:
        if words[-1] != "read":
            of_program = more if words == ["trifinger"] else ""
            text = HELP.format(words="", arguments="", options="", more=of_program)
            return text if words == ["trifinger"] else text.partition("Commands:")[0]
        text = HELP.format(words=" read", arguments=arguments, options=options, more="")
        return text.partition("Commands:")[0]

    return commands(help_of)


OPTIONS = """  -o, --output FILE           The file; default: out.csv
  --scheduling require|try|off
                              Whether priority is required; default: try, and go on
  --robot NAME                The robot; default: the only one that runs
"""


def test_an_option_that_changes_is_named() -> None:
    old = helps(options=OPTIONS)
    assert set(old) == {"trifinger", "trifinger read", "trifinger teach"}
    assert old["trifinger read"] == {
        "arguments": "[NAME]",
        "-h": "",
        "--help": "",
        "-o": "FILE  default out.csv",
        "--output": "FILE  default out.csv",
        "--scheduling": "require|try|off  default try",
        "--robot": "NAME",
    }
    added = helps("[NAME] [STEP]", OPTIONS + "  --csv                       Print a table\n")
    assert list(breaks(old, added)) == []
    changed = OPTIONS.replace("-o, ", "").replace("default: try", "default: off")
    assert list(
        breaks(old, helps("NAME", changed.replace("  --robot NAME ", "  --to NAME    ")))
    ) == [
        "trifinger read: arguments was [NAME], now it is NAME",
        "trifinger read: -o is gone; it was FILE  default out.csv",
        "trifinger read: --scheduling was require|try|off  default try, "
        "now it is require|try|off  default off",
        "trifinger read: --robot is gone; it was NAME",
    ]


def test_a_command_that_vanishes_is_named() -> None:
    old = helps(more="  stop                        Ends it\n")
    assert list(breaks(old, helps())) == ["trifinger stop is gone"]


HEADER = """
namespace trifinger {
namespace detail { struct Hidden {}; }
struct Options { double height{0.3}; bool control = true; };
enum class Mode { kOff, kOn };
class Robot {
 public:
  explicit Robot(int id, Options options = {});
  double torque(int joint) const;
 private:
  int id_;
};
}
"""


def test_a_declaration_that_changes_is_named(tmp_path: Path) -> None:
    old = declarations(tmp_path, HEADER)
    assert old["trifinger::Robot"] == {
        "Robot(int)": "",
        "Robot(int, Options)": "",
        "torque(int) const": "double",
    }
    added = HEADER.replace("bool control = true;", "bool control = true; int more{};")
    added = added.replace("int id_;", "long id_;").replace("struct Hidden {};", "")
    added = added.replace("torque(int joint)", "torque(int axis, bool is_applied = false)")
    assert list(breaks(old, declarations(tmp_path, added))) == []
    changed = HEADER.replace("height{0.3}", "height{0.4}").replace("kOff, kOn", "kOn, kOff")
    changed = changed.replace("Options options = {}", "Options options")
    changed = changed.replace("double torque(int joint)", "float torque(long joint)")
    assert list(breaks(old, declarations(tmp_path, changed))) == [
        "trifinger::Options: height was double{0.3}, now it is double{0.4}",
        "trifinger::Mode: kOff was 0, now it is 1",
        "trifinger::Mode: kOn was 1, now it is 0",
        "trifinger::Robot: Robot(int) is gone",
        "trifinger::Robot: torque(int) const is gone; it was double",
    ]


def test_a_header_that_does_not_compile_is_no_record(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="unknown type name 'Unknown'"):
        declarations(tmp_path, "Unknown value;")


MODULE = '''
"""A text."""
from trifinger._trifinger import Log as Log, secret
import os
LIMIT = 3
_private = 1
class Robot:
    """More."""
    name: str
    def __init__(self, name: str, period: float = 0.001) -> None:
        self.name = name
    @property
    def steps(self) -> int:
        return 1
    def read(self, first: int = 0) -> str:
        return ""
    def _own(self) -> None: ...
def connect(name: str, timeout: float = 5.0) -> Robot:
    return Robot(name)
'''
CORE = "class Log:\n    def session(self, name: str = '') -> object: ...\nclass Unseen: ...\n"


def arm(module: str = MODULE, core: str = CORE) -> str:
    """The record of a package `trifinger`."""
    return record(**{"trifinger": module, "trifinger._trifinger": core})


def test_a_stub_that_changes_is_named() -> None:
    old = arm()
    assert "_private" not in old
    assert "secret" not in old
    assert list(python_breaks(old, old)) == []
    added = MODULE.replace("period: float = 0.001", "period: float = 0.001, *, quick: bool = False")
    assert list(python_breaks(old, arm(added + "def more() -> None: ...\n", CORE[:-18]))) == []
    unseen = CORE.replace("class Unseen: ...", "def unseen() -> int: ...")
    assert list(python_breaks(arm(MODULE, unseen), arm(MODULE, unseen.replace("int", "str")))) == []
    changed = MODULE.replace("-> int", "-> float").replace("timeout: float = 5.0", "timeout: float")
    changed = changed.replace("period: float = 0.001", "period: float = 0.002")
    changed = changed.replace("def read(self, first", "def read(self, begin")
    changed = changed.replace("LIMIT = 3\n", "")
    assert sorted(python_breaks(old, arm(changed, CORE.replace("def session", "def open")))) == [
        "trifinger.LIMIT: public object was removed",
        "trifinger.Log.session: public object was removed",
        "trifinger.Robot.__init__: parameter default was changed (period) from 0.001 to 0.002",
        "trifinger.Robot.read: parameter was removed (first)",
        "trifinger.Robot.steps: was int, now it is float",
        "trifinger.connect: parameter is now required (timeout)",
    ]


def test_a_name_that_is_no_longer_exported_is_named() -> None:
    assert list(python_breaks(arm(), arm(MODULE.replace("Log as Log, ", "")))) == [
        "trifinger.Log: public object was removed"
    ]
    assert list(python_breaks(arm(), record(arm=MODULE))) == ["trifinger is gone"]


# ---- versions ----


@pytest.mark.parametrize(
    ("version", "released", "allowed"),
    [
        ("0.1.0", "0.1.0", False),
        ("0.1.9", "0.1.0", False),
        ("0.2.0", "0.1.9", True),
        ("0.1.5", "0.2.0", False),
        ("1.0.0", "0.9.0", True),
        ("1.9.0", "1.0.0", False),
        ("2.0.0", "1.9.3", True),
    ],
)
def test_a_version_allows_breaks_or_not(version: str, released: str, allowed: bool) -> None:
    assert stability.may_break(version, released) == allowed


def test_a_break_fails_until_the_version_allows_it() -> None:
    found = ["commands: trifinger stop is gone"]
    assert verdict(found, "0.3.2", "0.3.1", CHANGELOG) == (
        "commands: trifinger stop is gone: undo it, or make version 0.4.0",
        1,
    )
    said, status = verdict(found, "0.4.0", "0.3.1", CHANGELOG)
    assert status == 0
    assert said.splitlines()[0] == found[0]
    assert said.endswith("1 breaks since 0.3.1, which 0.4.0 may have: the CHANGELOG names them")
    assert verdict([], "0.3.2", "0.3.1", CHANGELOG) == ("", 0)
    assert verdict(found, "1.3.0", "1.2.0", "## [1.2.0] - x")[0].endswith("make version 2.0.0")


def test_before_the_first_release_the_record_may_be_written_again() -> None:
    said, status = verdict(["log: x is gone"], "0.1.0", "0.1.0", "## [Unreleased]")
    assert status == 1
    assert said.endswith("as nothing is released yet, run tools/stability.py --write")


# ---- what is deprecated ----

PYTHON = '@deprecated(\n    "stop is deprecated and goes with version {}: "\n    "call finish"\n)'
CPP = '[[deprecated("stop is deprecated and goes with version {}: call finish")]]'
OPTION = 'say("--to is deprecated and goes with version {}: say --output", file=sys.stderr)'
NAMED = "- `stop` is deprecated\n- `--to` is deprecated\n"


@pytest.mark.parametrize("text", [PYTHON, CPP, OPTION])
def test_what_is_deprecated_says_until_when_and_what_to_do(text: str) -> None:
    def mistakes(end: str, version: str, changelog: str = NAMED) -> list[str]:
        return mistakes_of_deprecated({"file": text.format(end)}, changelog, version)

    name = "--to" if text == OPTION else "stop"
    assert mistakes("0.4", "0.3.1") == []
    assert mistakes("2.0", "1.3.1") == []
    assert mistakes("0.4", "0.4.0") == [
        f"file: {name} goes with version 0.4, this is 0.4.0: remove it"
    ]
    assert mistakes("1.4", "1.3.0") == [f"file: {name} goes with 1.4; only 2.0.0 may break"]
    assert mistakes("0.4", "0.3.1", "") == [
        f"file: CHANGELOG.md does not say '`{name}` is deprecated'"
    ]


@pytest.mark.parametrize(
    "text",
    [
        '@deprecated("use finish")',
        "[[deprecated]] void stop();",
        'say("--to is deprecated")',
        '[[deprecated("stop is deprecated and goes with version 0.4")]]',
    ],
)
def test_what_is_deprecated_without_end_or_remedy_is_refused(text: str) -> None:
    assert mistakes_of_deprecated({"file": text}, NAMED, "0.3.0") == [
        "file: say 'NAME is deprecated and goes with version X.Y: REMEDY'"
    ]
