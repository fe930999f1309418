# SPDX-License-Identifier: BSD-3-Clause
"""Tests of manual pages: what they make of a help, and that `man` takes those of all commands."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from manual_pages import Words, pages

PROGRAM = Path(sys.executable).with_name("trifinger")
HELPS = {
    "trifinger": """\
Usage: trifinger [OPTIONS] COMMAND

Starts robots.

Options:
  -h, --help                  Print this help

Commands:
  run                         Start the back-end of a robot

Python package trifinger:
  demo                        Lift a cube

Not installed, 'pip install ./packages/trifinger_view' in the sources of TriFinger adds them:
  view                        Show a robot

Example:
  trifinger run sim           in a terminal
""",
    "trifinger run": """\
Usage: trifinger run [OPTIONS] ROBOT

Start the back-end of a robot. Its 'log' has
.dots, ^hats and back\\slashes.

Arguments:
  ROBOT                       A name, as
                              in sim

Options:
  -h, --help                  Print this help
  --scheduling require|try|off
                              Whether; default: try
  --set KEY=VALUE             Change it, as 'trifinger demo' does

Two kinds:
  one  with
       more
After 'trifinger' ended.
Example:
  trifinger run sim --set a=1
  trifinger run fake
""",
    "trifinger demo": """\
Usage: trifinger demo [OPTIONS]

Lift.

Options:
  -h, --help                  Print this help
""",
}
RUN = r""".TH TRIFINGER\-RUN 1 1970-01-02 "TriFinger 0.1.0" "User Commands"
.nh
.ad l
.SH NAME
trifinger\-run \- start the back\-end of a robot
.SH SYNOPSIS
\fBtrifinger run [\fR\fIOPTIONS\fR\fB] \fR\fIROBOT\fR
.SH DESCRIPTION
Start the back\-end of a robot. Its \(aqlog\(aq has .dots, \(hahats and
back\eslashes.
.SH ARGUMENTS
.TP
\fIROBOT\fR
A name, as in sim
.SH OPTIONS
.TP
\fB\-h, \-\-help\fR
Print this help
.TP
\fB\-\-scheduling require|try|off\fR
Whether; default: try
.TP
\fB\-\-set \fR\fIKEY\fR\fB=\fR\fIVALUE\fR
Change it, as \(aqtrifinger demo\(aq does
.SH NOTES
Two kinds:
.RS
.nf
one  with
     more
.fi
.RE
.PP
After \(aqtrifinger\(aq ended.
.SH EXIT STATUS
"""


def help_of(words: Words) -> str:
    return HELPS[" ".join(words)]


def test_a_help_becomes_a_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    page = pages(("", "trifinger"), help_of)["trifinger-run.1"]
    assert page.startswith(RUN.replace("0.1.0", page.split('"TriFinger ')[1].split('"')[0]))
    assert page.endswith(
        ".SH EXAMPLES\n.RS\n.nf\ntrifinger run sim \\-\\-set a=1\ntrifinger run fake\n.fi\n.RE\n"
        ".SH SEE ALSO\n.BR trifinger (1),\n.BR trifinger\\-demo (1)\n"
    )


@pytest.mark.parametrize(
    ("packages", "names"),
    [
        (("",), {"trifinger.1", "trifinger-run.1"}),
        (("", "trifinger"), {"trifinger.1", "trifinger-run.1", "trifinger-demo.1"}),
        (("trifinger",), {"trifinger-demo.1"}),
    ],
)
def test_only_what_is_installed_has_pages(packages: tuple[str, ...], names: set[str]) -> None:
    found = pages(packages, help_of)
    assert set(found) == names
    if "trifinger.1" in found:
        assert ("demo" in found["trifinger.1"]) == ("trifinger-demo.1" in names)


def test_a_line_that_begins_with_a_dot_is_no_request() -> None:
    text = HELPS["trifinger demo"].replace("Lift.", ".TH evil")
    found = pages(("", "trifinger"), lambda words: text if words[-1] == "demo" else help_of(words))
    assert "\n\\&.TH evil\n" in found["trifinger-demo.1"]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The pages of all commands of the release build that are compiled."""
    if subprocess.run([PROGRAM, "--version"], capture_output=True, check=False).returncode:
        pytest.skip("nothing is built: ./run build release")
    folder = tmp_path_factory.mktemp("man1")
    for name, text in pages().items():
        (folder / name).write_text(text)
    return sorted(folder.iterdir())


def test_every_compiled_command_has_all_parts_of_a_page(written: list[Path]) -> None:
    assert {"trifinger", "trifinger-job-run", "trifinger-manipulate"} <= {
        path.stem for path in written
    }
    for path in written:
        titles = [line[4:] for line in path.read_text().splitlines() if line.startswith(".SH ")]
        assert titles[:3] == ["NAME", "SYNOPSIS", "DESCRIPTION"], path
        assert {"OPTIONS", "EXIT STATUS", "SEE ALSO"} <= set(titles), path


@pytest.mark.parametrize(
    "command",
    [
        ["mandoc", "-Tlint", "-Wwarning"],
        ["man", "--warnings", "--local-file", "-Tutf8", "--ditroff"],
    ],
    ids=["mandoc", "man"],
)
def test_no_program_warns_of_a_page(written: list[Path], command: list[str]) -> None:
    if shutil.which(command[0]) is None:
        pytest.skip(f"there is no `{command[0]}`")
    for path in written:
        done = subprocess.run([*command, path], capture_output=True, text=True, check=False)
        assert done.stderr == ""
        assert done.returncode == 0, done.stdout
