# SPDX-License-Identifier: BSD-3-Clause
"""What others wrote is printed so that no terminal obeys it, and never at length."""

import argparse
import os
import struct
import subprocess
import sys
import unicodedata
from importlib import import_module
from pathlib import Path

import pytest
import trifinger
from conftest import PROGRAM
from hypothesis import given, strategies
from link_into_venv import scripts
from mcap.writer import Writer
from strange_log import copy_changed
from trifinger.commands.command_line import say
from trifinger.text import MAX_PRINTED, printable, printable_lines
from trifinger_compat import check

TITLE = "\x1b]0;evil\x07"  # sets the title of a terminal
HOSTILE = f"{TITLE}\x1b[2J\x9b31m\u202e"
TURNING = {"LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"}  # order of writing
HUGE = f"{TITLE}{'x' * 300_000}"


def assert_harmless(output: str) -> None:
    for character in "\x1b\x07\x9b\u202e":
        assert character not in output, output[:2000]
    assert len(output) < 20 * MAX_PRINTED


def words_of(*words: str | Path) -> str:
    """All that a program prints, whether it succeeds or not."""
    done = subprocess.run([*map(str, words)], capture_output=True, check=False)
    assert done.returncode >= 0
    output = (done.stdout + done.stderr).decode()
    assert "Traceback" not in output
    return output


def python_of(command: str, *words: str | Path) -> str:
    """All that a command prints that is written in Python."""
    module, _, _ = scripts()[f"trifinger-{command}"].partition(":")[2].rpartition(".")
    script = f"import sys; from {module} import main; sys.exit(main())"
    return words_of(sys.executable, "-c", script, *words)


# ---- the function ----


@given(strategies.text(strategies.characters(), max_size=60))
def test_fault_78_a_printable_text_is_one_line_and_obeyed_by_nobody(text: str) -> None:
    shown = printable(text)
    kinds = {unicodedata.category(one) for one in shown}
    assert not kinds & {"Cc", "Cs", "Zl", "Zp"}
    assert {unicodedata.bidirectional(one) for one in shown}.isdisjoint(TURNING)
    assert printable(shown) == shown
    assert printable_lines(text).count("\n") == text.count("\n")


BYTES = strategies.binary(min_size=1, max_size=60).filter(lambda one: not set(one) & set(b"\0/"))


@given(BYTES)
def test_fault_78_cpp_and_python_print_texts_alike(name: bytes) -> None:
    path = Path("/missing") / os.fsdecode(name)
    with pytest.raises(OSError, match="missing") as raised:
        trifinger.Log(path)
    assert f"open {printable_lines(str(path))}: " in str(raised.value)


def test_fault_78_errors_and_lines_are_shortened_and_say_so(
    capsys: pytest.CaptureFixture[str],
) -> None:
    error = str(trifinger.InvalidArgument(f"{HUGE} is wrong: do this"))
    assert_harmless(error)
    assert f"… ({len(HUGE) + 18:,} characters) …" in error
    assert error.endswith(" is wrong: do this")
    say(HUGE, HOSTILE)
    assert_harmless(capsys.readouterr().out)


# ---- an untrusted log ----


def with_event(data: bytes, text: str) -> bytes:
    """An event (CDR) with another text."""
    encoded = text.encode() + b"\0"
    # After 4 bytes: time (8), level (1), then the name, which is aligned.
    (length,) = struct.unpack_from("<I", data, 16)
    end = (20 + length + 3) // 4 * 4
    content = data[:end] + struct.pack("<I", len(encoded)) + encoded
    content += bytes(-len(content) % 4)
    empty = struct.pack("<I", 1) + b"\0\0\0\0"
    return content + empty + empty + bytes(4)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    simulation = trifinger.Simulation()
    folder = tmp_path / "recording"
    with simulation.record(folder), simulation.connect() as robot:
        for _ in range(5):
            robot.get_observation(robot.append_desired_action(robot.new_action()))
        robot.finish()
    (file,) = folder.glob("*.mcap")
    return file


@pytest.mark.slow
@pytest.mark.parametrize("text", [HOSTILE, HUGE], ids=["hostile", "huge"])
def test_fault_78_no_text_of_a_log_reaches_the_terminal_as_it_is(
    log: Path, tmp_path: Path, text: str
) -> None:
    strange = tmp_path / "strange.mcap"
    keys = ("log/created", "log/host", "log/kernel", "log/trifinger_version", "log/precision")
    keys += ("session/host", "session/type", "end/fault_text")
    texts = {f"trifinger.{key}": text for key in keys}

    def change(topic: str, data: bytes) -> bytes:
        return with_event(data, text) if topic == "/events" else data

    copy_changed(log, strange, texts, change)
    output = words_of(PROGRAM, "log", "info", "--events", strange)
    assert "\\x1b]0;evil\\x07" in output
    assert_harmless(output.replace("\\x1b", ""))
    assert len(output) < 30 * MAX_PRINTED
    for words in ("check", "recover", "info"):
        assert_harmless(words_of(PROGRAM, "log", words, strange))
    assert_harmless(python_of("view", strange, "-o", tmp_path / "page.html"))
    assert_harmless(python_of("log-plot", strange, "-o", tmp_path / "plot.html"))
    assert_harmless(python_of("log-export", strange, "--to", tmp_path / "missing/x.csv"))
    assert_harmless(python_of("export", "lerobot", strange, "-o", tmp_path / "set"))
    run = trifinger.Log(strange).session()
    assert_harmless(printable_lines(run.fault_text))


@pytest.mark.parametrize("text", [HOSTILE, HUGE], ids=["hostile", "huge"])
def test_fault_78_a_file_of_other_programs_is_printed_harmlessly(tmp_path: Path, text: str) -> None:
    path = tmp_path / "other.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile=text, library=text)
        schema = writer.register_schema(text, "ros2msg", b"")
        writer.register_channel(text, "cdr", schema)
        writer.finish()
    assert_harmless(words_of(PROGRAM, "log", "info", path))
    assert_harmless(words_of(PROGRAM, "log", "check", path))
    assert_harmless(python_of("view", path, "-o", tmp_path / "page.html"))


# ---- names of files, and values in them ----


@pytest.mark.parametrize("text", [HOSTILE, HUGE], ids=["hostile", "huge"])
def test_fault_78_a_value_in_a_file_is_shown_harmlessly(tmp_path: Path, text: str) -> None:
    quoted = "".join(f"\\u{ord(one):04x}" if not one.isprintable() else one for one in text)
    for line in (f'robot: "{quoted}"', f'"{quoted}": 1'):
        path = tmp_path / "robot.yml"
        path.write_text(line)
        output = words_of(PROGRAM, "config", path)
        assert_harmless(output)
        with pytest.raises(trifinger.Error) as raised:
            trifinger.Simulation(str(path))
        assert_harmless(str(raised.value))


def test_fault_78_names_of_files_are_shown_harmlessly(tmp_path: Path) -> None:
    folder = tmp_path / f"a{HOSTILE}"
    folder.mkdir()
    for command in ("info", "check", "recover"):
        assert_harmless(words_of(PROGRAM, "log", command, folder))
        assert_harmless(words_of(PROGRAM, "log", command, folder / "x.mcap"))
    assert_harmless(words_of(PROGRAM, "run", folder / "x.yml"))
    images = folder / "images" / HOSTILE
    images.mkdir(parents=True)
    (images / f"{HOSTILE}.png").write_bytes(b"no image")
    assert_harmless(python_of("calibrate-cameras", "--images", folder / "images"))
    sets = ("--set", "cameras.source=folder", "--set", f"cameras.folder={folder / 'images'}")
    assert_harmless(words_of(PROGRAM, "cameras", "sim_cameras", *sets))
    with pytest.raises(OSError, match="evil") as raised:
        trifinger.Log(folder / "x.mcap")
    assert_harmless(str(raised.value))


# ---- words of the command line, such as the files of a folder for `*` ----

COMMANDS = [target.removeprefix("trifinger_launcher:") for target in scripts().values()]
TASKS = [
    "trifinger_simulation.tasks.__main__.main",
    *(
        f"trifinger_simulation.tasks.{task}.__main__.main"
        for task in ("move_cube", "move_cube_on_trajectory", "rearrange_dice")
    ),
]


@pytest.mark.parametrize("command", COMMANDS + TASKS)
def test_fault_78_every_command_shows_its_words_harmlessly(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(
        argparse.ArgumentParser, "parse_args", lambda parser, *_: parser.error(f"{HUGE}{HOSTILE}")
    )
    module, _, function = command.replace(":", ".").rpartition(".")
    with pytest.raises(SystemExit):
        getattr(import_module(module), function)()
    output = capsys.readouterr().err
    assert ": \\x1b]0;evil\\x07" in output
    assert_harmless(output)


def test_fault_78_words_that_a_command_does_not_know_are_shown_harmlessly() -> None:
    assert_harmless(python_of("film", "log", HOSTILE, f"--{HOSTILE}"))
    assert_harmless(python_of("bridge", "foxglove", "robot", HOSTILE))  # a command of a command


# ---- untrusted programs ----


def test_fault_78_compat_check_shows_programs_harmlessly(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / HOSTILE
    folder.mkdir()
    path = f"{HOSTILE}\n{'x' * 5000}"
    (folder / f"{TITLE}.py").write_text(
        "import os, trifinger_simulation\n"
        f"os.path.join(os.path.dirname(trifinger_simulation.__file__), {path!r})"
    )
    (folder / "broken.py").write_text("import trifinger_simulation \u202e")
    assert check.main([str(folder), "--all"]) == 1
    output = capsys.readouterr().out
    assert_harmless(output)
    assert "does not work" in output
    assert "cannot be read" in output
    for missing in (folder / "empty", folder / "missing"):
        if missing.name == "empty":
            missing.mkdir()
        assert check.main([str(missing)]) == 2
        assert_harmless(capsys.readouterr().err)
