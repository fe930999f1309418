# SPDX-License-Identifier: BSD-3-Clause
"""The grammar of all commands, in C++ and Python: docs/decisions/command_line.md."""

import json
import os
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest
from conftest import BUILD, PROGRAM, StartChild
from link_into_venv import write_scripts

SECTION = re.compile(r"^([A-Z][^\n]*):\n((?:  .*\n)+)", re.MULTILINE)


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the programs of all packages, as an installation makes them."""
    folder = tmp_path_factory.mktemp("programs")
    write_scripts(folder)
    return folder


def call(programs: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    path = f"{programs}:{BUILD / 'apps'}:{os.environ['PATH']}"
    return subprocess.run(
        [PROGRAM, *words],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PATH": path},
    )


@cache
def help_of(programs: Path, *words: str) -> str:
    done = call(programs, *words, "--help")
    assert done.returncode == 0, done.stderr
    return done.stdout


def commands_in(text: str) -> list[str]:
    """The commands that a help lists."""
    headings = ("Commands", "Programs of their own", "Python package ")
    return [
        line.split()[0]
        for heading, body in SECTION.findall(text)
        if heading.startswith(headings)
        for line in body.splitlines()
        if line[2] != " "
    ]


def all_commands(programs: Path) -> dict[tuple[str, ...], str]:
    """Every command that has no others below it, with its help."""
    found = {}
    waiting: list[tuple[str, ...]] = [()]
    while waiting:
        words = waiting.pop()
        text = help_of(programs, *words)
        below = [(*words, verb) for verb in commands_in(text)]
        found |= {} if below else {words: text}
        waiting += below
    return found


# ---- help and errors ----


def test_help_has_the_same_form_for_every_command(programs: Path) -> None:
    commands = all_commands(programs)
    assert len(commands) > 50
    for words, text in commands.items():
        name = " ".join(("trifinger", *words))
        usage, empty, about, *_ = text.splitlines()
        assert re.match(rf"Usage: {name} \[OPTIONS\]( |$)", usage), usage
        assert empty == ""
        assert re.match(r"[A-Z].*", about), (name, about)
        assert "\nOptions:\n  -h, --help                  Print this help\n" in text, name
        assert re.search(rf"^  {name}\b", text, re.MULTILINE), f"{name} has no example"
        assert [line for line in text.splitlines() if len(line) > 100] == []
        order = [part for part in ("Arguments:", "Options:", "Commands:") if f"\n{part}\n" in text]
        assert sorted(order, key=text.index) == order, name


def test_what_is_not_an_option_is_refused_in_one_sentence(programs: Path) -> None:
    for words in all_commands(programs):
        name = " ".join(("trifinger", *words))
        done = call(programs, *words, "--strange")
        assert done.returncode == 2, (name, done.stdout)
        assert done.stdout == ""
        assert re.fullmatch(rf"{name}: .*; '{name} --help' tells more\n", done.stderr), done.stderr


def test_a_command_names_the_running_robot_in_one_way(programs: Path) -> None:
    running = "Name of the running robot; default: the only one that runs"
    found = {}
    for words, text in all_commands(programs).items():
        flat = re.sub(r"\n {30}", " ", text)
        first = bool(re.search(r"^  NAME +.*; default: the only one that runs", flat, re.MULTILINE))
        option = bool(re.search(rf"^  --(robot|on) NAME +{running}", flat, re.MULTILINE))
        assert not (first and option), words
        if first or option:
            found[words] = first
    assert {words for words, first in found.items() if first} >= {
        *(("status",), ("read",), ("record",), ("stop",), ("recover",), ("look",), ("track",)),
        *(("endurance",), ("teach",), ("teleop",), ("job", "restore"), ("bridge", "ros2")),
    }
    assert {words for words, first in found.items() if not first} == {
        *(("manipulate",), ("run-policy",), ("job", "run"), ("motion", "play"), ("log", "replay")),
        ("learn",),
    }


def test_output_has_one_name(programs: Path) -> None:
    for words, text in all_commands(programs).items():
        assert not re.search(r"^  (-o, --(?!output)|--(output|out) )", text, re.MULTILINE), words


# ---- the robot ----

OF_A_ROBOT = (
    *("status", "read", "stop", "recover", "look", "track", "record", "endurance", "teleop"),
    *("teach -o {file}", "job restore", "manipulate lift", "job run -- true"),
    *("motion play {file}", "bridge ros2", "view --control", "learn reach"),
)


@pytest.mark.parametrize("words", OF_A_ROBOT)
def test_a_robot_is_never_guessed(
    programs: Path, start_fake: StartChild, tmp_path: Path, words: str
) -> None:
    command = words.format(file=tmp_path / "file").split()
    none = call(programs, *command)
    assert none.returncode == 1
    assert "no robot runs on this machine; 'trifinger run sim' starts" in none.stderr
    start_fake("left")
    start_fake("right")
    several = call(programs, *command)
    assert several.returncode == 2
    assert "several robots run on this machine, name one of them: left, right" in several.stderr


def test_the_only_robot_that_runs_need_not_be_named(programs: Path, start_fake: StartChild) -> None:
    start_fake("left")
    assert json.loads(call(programs, "status", "--json").stdout)["name"] == "left"
    assert "left holding" in call(programs, "read", "--series", "holding").stdout
    assert call(programs, "recover").stdout.startswith("left: there is nothing to recover from")


@pytest.mark.parametrize(
    "words",
    [
        *("status lift", "read lift", "stop lift", "recover lift", "look lift", "track lift"),
        *(
            "endurance lift",
            "teleop lift",
            "teach lift -o {file}",
            "job restore lift --ready-timeout 100ms",
        ),
        *(
            "manipulate lift --robot lift",
            "motion play {file} --robot lift",
            "learn reach --robot lift",
        ),
        "log rescue lift",
    ],
)
def test_a_name_that_does_not_run_is_said_at_once(
    programs: Path, start_fake: StartChild, tmp_path: Path, words: str
) -> None:
    start_fake("left")
    done = call(programs, *words.format(file=tmp_path / "file").split())
    assert done.returncode not in (0, 2)
    said = done.stdout + done.stderr  # a job reports on standard output
    assert "robot 'lift'" in said
    assert "running: left" in said
    assert "perhaps 'left' is meant" in said


# ---- JSON ----


@pytest.mark.parametrize(
    ("words", "key"),
    [
        ("list", "sessions"),
        ("status left", "loop"),
        ("doctor", "findings"),
        ("config sim", "keys"),
        ("model info", "joints"),
        ("cameras --list", "devices"),
        ("compat-check {folder}", "places"),
    ],
)
def test_a_report_for_programs_is_one_object(
    programs: Path, start_fake: StartChild, tmp_path: Path, words: str, key: str
) -> None:
    start_fake("left")
    (tmp_path / "program.py").write_text("import robot_interfaces\n")
    command = words.format(folder=tmp_path).split()
    done = call(programs, *command, "--json")
    assert key in json.loads(done.stdout)
    assert done.returncode == call(programs, *command).returncode


# ---- completion ----

COMPLETIONS = [
    ("sta", {"status"}),
    ("status ", {"left"}),
    ("status left --js", {"--json"}),
    ("manipulate dr", {"draw"}),
    ("manipulate lift --robot ", {"left"}),
    ("run trifinger_pro", {"trifinger_pro"}),
    ("read left --series st", {"status", "stopping"}),
    ("log re", {"recover", "rescue", "replay"}),
    ("motion pl", {"plot", "play"}),
    ("motion play file --robot ", {"left"}),
    ("view ", {"left"}),
    ("calibrate col", {"colours"}),
    ("completion ", {"bash", "zsh", "fish"}),
    ("train rea", {"reach"}),
]


def complete_in_bash(line: str) -> list[str]:
    return [
        "bash",
        "--norc",
        "-c",
        'source <(trifinger completion bash); COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); '
        "COMP_TYPE=9; _trifinger; printf '%s\\n' \"${COMPREPLY[@]}\"",
        *("bash", "trifinger", *line.split(" ")),
    ]


def complete_in_fish(line: str) -> list[str]:
    script = "trifinger completion fish | source; complete -C $argv[1] | string split -f1 \\t"
    return ["fish", "--no-config", "-c", script, f"trifinger {line}"]


def complete_in_zsh(line: str) -> list[str]:
    script = (
        "compdef() { [[ $2 == trifinger ]] && is_registered=1; }; "
        "compadd() { shift; print -l -- ${(P)1}; }; source <(trifinger completion zsh); "
        '[[ -n $is_registered ]] || exit 1; words=("$@"); CURRENT=$#; _trifinger'
    )
    return ["zsh", "-f", "-c", script, "zsh", "trifinger", *line.split(" ")]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_completes_commands_options_tasks_and_robots(
    programs: Path, start_fake: StartChild, shell: str
) -> None:
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    start_fake("left")
    words_of = {"bash": complete_in_bash, "zsh": complete_in_zsh, "fish": complete_in_fish}[shell]
    path = f"{programs}:{BUILD / 'apps'}:{os.environ['PATH']}"
    for line, expected in COMPLETIONS:
        done = subprocess.run(
            words_of(line),
            capture_output=True,
            text=True,
            check=True,
            env=os.environ | {"PATH": path},
        )
        last = line.rpartition(" ")[2]
        found = {word for word in done.stdout.split() if word.startswith(last)}
        assert found >= expected, (line, done.stdout, done.stderr)
        if shell == "bash":  # it leaves out what does not begin like that
            assert found == set(done.stdout.split())


# ---- settings of a task ----


def test_the_help_of_a_task_shows_every_setting_with_its_default(programs: Path) -> None:
    for task in ("lift", "throw", "draw"):
        text = re.sub(r"\n {30}", " ", help_of(programs, "manipulate", task))
        shown = re.findall(r"^  ([a-z_0-9.]+) +.*default: ", text, re.MULTILINE)
        assert len(shown) == len(set(shown))
    lift = re.sub(r"\n {30}", " ", help_of(programs, "manipulate", "lift"))
    assert re.search(r"^  lift\.height +Height of the lift \[m\], .*\(default: 0\.2\)$", lift, re.M)
    assert re.search(r"^  lift\.hold_time +default: 15$", lift, re.MULTILINE)
    unknown = call(programs, "manipulate", "lft", "--help")
    assert unknown.returncode == 2
    assert "perhaps 'lift'" in unknown.stderr
