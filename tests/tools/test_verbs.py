# SPDX-License-Identifier: BSD-3-Clause
"""Tests of ./run: what its steps print and keep, what it counts, and how it ends."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from verbs import counting, machine as machines, steps, test as stages
from verbs.counting import Count
from verbs.main import VERBS
from verbs.steps import NotRun, StepFailed, Steps

ROOT = Path(__file__).parents[2]
PYTHON = sys.executable


@pytest.fixture(autouse=True)
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Logs and results go to a temporary folder."""
    monkeypatch.setattr(steps, "ROOT", tmp_path)
    monkeypatch.setattr(steps, "LOGS", tmp_path / "build" / "logs")
    monkeypatch.setattr(counting, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(Steps, "failures", [])


def run(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run([ROOT / "run", *arguments], capture_output=True, text=True, check=False)


def test_a_step_prints_one_line_and_keeps_its_output(capsys: pytest.CaptureFixture[str]) -> None:
    step = Steps("group").run("some step", ["echo", "words"])
    (line,) = capsys.readouterr().out.splitlines()
    assert line.split()[:3] == ["some", "step", "ok"]
    assert step.log.name == "group-some-step.log"
    assert step.log.read_text() == "words\n"


def test_a_step_that_fails_shows_its_end_and_its_reasons(
    capsys: pytest.CaptureFixture[str],
) -> None:
    script = "print('\\n'.join(map(str, range(100)))); print('a.cpp:1:1: error: no'); exit(3)"
    with pytest.raises(StepFailed):
        Steps("g").run("s", [PYTHON, "-c", script])
    shown = capsys.readouterr().out
    assert "FAILED" in shown
    assert "| 99" in shown
    assert "| 9\n" not in shown
    assert Steps.failures == ["g, s: build/logs/g-s.log", "  a.cpp:1:1: error: no"]


def test_where_a_process_crashed_is_among_the_reasons() -> None:
    script = (
        "print('words', 'Timeout (0:05:00)!', '  File \"a.py\", line 3 in f', sep='\\n'); exit(1)"
    )
    Steps("g").check("s", [PYTHON, "-c", script])
    assert Steps.failures[1:] == ["  | Timeout (0:05:00)!", '  |   File "a.py", line 3 in f']


def test_a_stage_that_cannot_run_here_is_neither_passed_nor_failed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def not_run(_: Count) -> bool:
        raise NotRun("there is no kernel")

    monkeypatch.setattr(stages, "setup", lambda: None)
    monkeypatch.setattr(stages, "fetch_robots", lambda: None)
    assert stages.run_stages([("first", lambda _: True), ("SocketCAN", not_run)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "  not run: there is no kernel" in lines
    (line,) = (line for line in lines if "not run " in line)
    assert line.split()[:1] == ["SocketCAN"]


def test_the_machine_that_began_beside_another_stage_is_not_started_again(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(machines, "FOLDER", tmp_path)  # that of a real run has results
    monkeypatch.setattr(machines, "build", lambda *_: None)
    monkeypatch.setattr(machines.can_machine, "fetch_kernel", lambda: None)
    monkeypatch.setattr(machines, "PYTHON", "echo")
    machine = machines.Machine()
    machine.begin()
    assert capsys.readouterr().out == ""
    assert len(Steps.running) == 1
    assert machine.test(Count())
    assert Steps.running == []
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["robot", "0"]


def test_why_there_is_no_machine_is_said_by_its_own_stage(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_kernel() -> None:
        raise machines.can_machine.NotPossibleHere("there is no kernel")

    monkeypatch.setattr(machines, "build", lambda *_: None)
    monkeypatch.setattr(machines.can_machine, "fetch_kernel", no_kernel)
    machine = machines.Machine()
    machine.begin()
    with pytest.raises(NotRun, match="there is no kernel"):
        machine.test(Count())


def test_cpp_tests_run_beside_others_and_are_counted_when_these_end() -> None:
    count = Count()
    line = "100% tests passed, 0 tests failed out of 3"
    with stages.cpp_tests(count, "g", "s", "echo", line) as step:
        assert Steps.running == [step]
        assert count.passed == 0
    assert step.succeeded
    assert count.passed == 3


def test_a_stage_that_fails_does_not_keep_others_from_running(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def does_not_compile(_: Count) -> bool:
        raise StepFailed

    monkeypatch.setattr(stages, "setup", lambda: None)
    monkeypatch.setattr(stages, "fetch_robots", lambda: None)
    assert stages.run_stages([("first", does_not_compile), ("second", lambda _: True)]) == 1
    summary = capsys.readouterr().out.partition("summary\n")[2].splitlines()
    assert [line.split()[1] for line in summary[:2]] == ["FAILED", "ok"]
    assert summary[2].startswith("0 passed, 1 failed")


def test_variables_reach_the_command() -> None:
    assert Steps("g").run("s", ["sh", "-c", "echo $WORD"], WORD="tree").last_line() == "tree"


def test_steps_beside_others_end_with_all_their_processes(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    all_steps = Steps("g")
    # The shell and its child both keep the pipe open.
    step = all_steps.begin("s", ["bash", "-c", f"exec 3>{pipe}; sleep 1000 & wait"])
    with pipe.open() as reader:
        Steps.stop()
        assert reader.read() == ""  # the end of the pipe: nobody holds it any more
    all_steps.end(step)
    assert not step.succeeded


def test_counts_what_pytest_says(capsys: pytest.CaptureFixture[str]) -> None:
    count = Count()
    line = "=== 2 failed, 30 passed, 1 skipped, 4 errors in 1.50s ==="
    count.pytest(Steps("g"), "s", ["echo", line])
    assert (count.passed, count.failed) == (30, 6)
    assert line in capsys.readouterr().out


def test_counts_the_tests_of_processes_and_those_that_left_no_result(tmp_path: Path) -> None:
    folder = tmp_path / "results" / "dev"
    folder.mkdir(parents=True)
    older = '<testsuites tests="100" failures="0" disabled="0"/>'
    (folder / "older.xml").write_text(older)  # not of this run, so it does not count
    count = Count()
    all_steps = Steps("dev")
    # Two processes failed: b, and one that crashed without leaving a file.
    line = "33% tests passed, 2 tests failed out of 3"
    step = count.begin_ctest(all_steps, "s", ["echo", line])
    counts = {"a": (10, 0, 1), "b": (5, 2, 0)}  # tests, failures, disabled
    for name, (tests, failures, disabled) in counts.items():
        suites = f'<testsuites tests="{tests}" failures="{failures}" disabled="{disabled}"/>'
        (folder / f"{name}.xml").write_text(suites)
    (folder / "python.xml").write_text('<testsuites name="pytest tests"/>')
    count.end_ctest(all_steps, step)
    assert (count.passed, count.failed) == (9 + 3, 2 + 1)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["tset"], "there is no verb 'tset'; did you mean 'test'?"),
        (["test", "cor"], "there is no layer 'cor'; did you mean 'core'?"),
        (["build", "relese"], "there is no preset 'relese'; did you mean 'release'?"),
        (
            ["evaluate", "x"],
            "there is no experiment 'x'; there are algorithms, benchmark, challenge, cliffs",
        ),
        (["soak", "kils"], "there is no part 'kils'; did you mean 'kills'?"),
        (["evaluate"], "evaluate: missing a required argument: 'experiment'"),
        (["clean", "dev"], "clean: too many positional arguments"),
    ],
)
def test_wrong_use_is_answered_before_anything_happens(arguments: list[str], sentence: str) -> None:
    done = run(*arguments)
    assert done.returncode == 2
    assert f"./run: {sentence}" in done.stderr


@pytest.mark.parametrize("arguments", [[], ["help"], ["--help"], ["-h"], ["test", "--help"]])
def test_help_names_all_verbs(arguments: list[str]) -> None:
    done = run(*arguments)
    assert done.returncode == 0
    lines = [line.split()[0] for line in done.stdout.splitlines() if line[:3].strip()]
    assert set(VERBS) <= {*lines, "help"}


def test_an_old_python_is_told_which_one_is_needed() -> None:
    script = (
        "import sys; sys.version_info = (3, 9, 2); sys.version = '3.9.2 (old)'\n"
        f"exec(compile(open({str(ROOT / 'run')!r}).read(), 'run', 'exec'))"
    )
    done = subprocess.run(
        [PYTHON, "-c", script, "test"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "Python 3.11 or later is needed, python3 is 3.9.2" in done.stderr


ELSEWHERE = "on Windows use WSL 2, on macOS a virtual machine or a container"


@pytest.mark.parametrize("system", ["darwin", "win32"])
@pytest.mark.parametrize("file", ["run", "python/trifinger/__init__.py"])
def test_another_system_is_told_where_it_works(file: str, system: str) -> None:
    script = (
        f"import sys; sys.platform = {system!r}\n"
        f"exec(compile(open({str(ROOT / file)!r}).read(), {file!r}, 'exec'))"
    )
    done = subprocess.run([PYTHON, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    said = done.stderr.splitlines()[-1]
    assert said.endswith(f"needs Linux; {ELSEWHERE}")
    assert ("Traceback" in done.stderr) == (file != "run")  # an import can only raise


@pytest.mark.parametrize("system", ["Darwin", "Windows"])
def test_a_build_on_another_system_is_told_where_it_works(tmp_path: Path, system: str) -> None:
    words = ["cmake", "-G", "Ninja", "-S", str(ROOT), "-B", str(tmp_path)]
    words.append(f"-DCMAKE_SYSTEM_NAME={system}")
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert f"TriFinger needs Linux; {ELSEWHERE}" in " ".join(done.stderr.split())


def test_an_activated_terminal_finds_programs_and_package() -> None:
    # Python reads this file of paths, and leaves out a folder that is not built yet.
    packages = "python -c 'import sysconfig; print(sysconfig.get_path(\"purelib\"))'"
    found = f"command -v trifinger; cat $({packages})/trifinger.pth"
    done = subprocess.run(
        ["bash", "-e", "-c", f"source .venv/bin/activate; {found}"],
        cwd=ROOT,
        env={"PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=True,
    )
    program, package, *others = done.stdout.splitlines()
    assert Path(program).samefile(ROOT / ".venv" / "bin" / "trifinger")
    assert package == str(ROOT / "build/release/python")
    modules = {module.name for folder in others for module in Path(folder).iterdir()}
    assert {"trifinger_view", "trifinger_data_sets", "trifinger_camera_calibration"} <= modules


@pytest.mark.parametrize("comes_early", [False, True])
def test_sigterm_ends_what_runs(tmp_path: Path, *, comes_early: bool) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    # It may come before the program knows that the command has started.
    early = """
import os, signal, subprocess
class Popen(subprocess.Popen):
    def __init__(self, *arguments, **named):
        super().__init__(*arguments, **named)
        os.close(os.open(arguments[0][2].split(">")[1], os.O_RDONLY))  # it has begun
        os.kill(os.getpid(), signal.SIGTERM)
steps.subprocess.Popen = Popen
"""
    script = f"""
import sys
sys.path.insert(0, {str(ROOT / "tools")!r})
from pathlib import Path
from verbs import main, steps
steps.LOGS = Path({str(tmp_path)!r})
command = ["sh", "-c", "exec sleep 1000 >{pipe}"]
{early if comes_early else ""}
main.VERBS["test"] = lambda: steps.Steps("g").run("s", command) and 0
sys.exit(main.main(["test"]))
"""
    with subprocess.Popen([PYTHON, "-c", script]) as program:
        with pipe.open() as reader:
            if not comes_early:
                program.send_signal(signal.SIGTERM)
            assert reader.read() == ""  # the command has ended
        assert program.wait() == 128 + signal.SIGTERM
