# SPDX-License-Identifier: BSD-3-Clause
"""Every command works as it is typed first: without an option.

The commands are those that the programs list in their help, and the scripts of the packages, so a
new one is tested without an edit here. Where none is missing, a command does what it says;
otherwise a sentence says what is missing.
"""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import pytest
from conftest import PROGRAM, StartProgram
from link_into_venv import scripts, write_scripts

LISTED = re.compile(r"^ {2,4}([a-z][a-z-]*) {2,}\S", re.MULTILINE)
SKILL = re.compile(r"^  (\w+) +.*\(trifinger run (\w+)\)$", re.MULTILINE)
GOES_ON = {
    "demo": "shall lift the cube",
    "metrics": "Serves http://",
    "view": "Open http://",
    "pybullet_backend": "The robot is ready.",
    "trifinger_data_backend": "The robot is ready.",
}
"""Commands that do not end by themselves, or not soon, and what they print when they run."""

PACKAGES = sorted((Path(__file__).parents[2] / "packages").glob("*/pyproject.toml"))
# The programs of the Python package are beside the interpreter.
ENVIRONMENT = {
    **os.environ,
    "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    "PYTHONPATH": os.pathsep.join(str(path.parent) for path in PACKAGES),
    "PYTHONUNBUFFERED": "1",
}


@cache
def help_of(*words: str) -> str:
    """What a command says about itself."""
    return subprocess.run(
        [PROGRAM, *words, "--help"], env=ENVIRONMENT, capture_output=True, text=True, check=False
    ).stdout


def commands(*above: str) -> Iterator[tuple[str, ...]]:
    """Yields all commands below one that list no others."""
    below = [verb for verb in listed(*above) if is_command(*above, verb)]
    if not below:
        yield above
    for verb in below:
        yield from commands(*above, verb)


def listed(*above: str) -> list[str]:
    """The words that begin a line of a command's help."""
    return list(dict.fromkeys(LISTED.findall(help_of(*above))))


def is_command(*words: str) -> bool:
    """True if the last word is a command, not the name of something that the others take."""
    usage = re.search(r"^usage: (.*)", help_of(*words), re.MULTILINE | re.IGNORECASE)
    return usage is not None and usage[1].split()[: len(words) + 1] == ["trifinger", *words]


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the programs of all packages, as an installation makes them."""
    folder = tmp_path_factory.mktemp("programs")
    write_scripts(folder)
    return folder


def modules() -> list[str]:
    """What `python -m` runs of the packages."""
    return [
        ".".join(path.relative_to(project.parent).with_suffix("").parts).removesuffix(".__main__")
        for project in PACKAGES
        for path in sorted(project.parent.rglob("*.py"))
        if "tests" not in path.parts and '__name__ == "__main__"' in path.read_text()
    ]


# Only the help of programs in C++ is asked for while the tests are collected: it comes at once.
IS_BUILT = Path(PROGRAM).exists()
VERBS = listed() if IS_BUILT else []
SKILLS = SKILL.findall(help_of("manipulate")) if IS_BUILT else []
"""Each task of `trifinger manipulate` and a robot for it."""
SCRIPTS = [name for name in scripts() if not name.startswith("trifinger-")]
"""The programs of packages that are no commands of `trifinger`."""
MODULES = modules()
EXAMPLES = {
    "list": ("list",),
    "log": ("log", "info"),
    "manipulate": ("manipulate",),
    "export": ("export", "lerobot"),
}


def run_bare(command: Sequence[str], folder: Path, ready: str | None) -> tuple[int | None, str]:
    """Runs a command in an empty folder, in which no robot runs.

    Returns its exit status, None if it said that it is ready and was ended, and what it printed.
    """
    folder.mkdir()
    with subprocess.Popen(
        command,
        cwd=folder,
        env={
            **ENVIRONMENT,
            "HOME": str(folder),
            "BROWSER": "true",
            "TRIFINGER_SESSION_DIR": os.environ["TRIFINGER_SESSION_DIR"],
            "TRIFINGER_LOG_DIR": os.environ["TRIFINGER_LOG_DIR"],
        },
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as process:
        assert process.stdout is not None
        text, is_ready = "", False
        try:
            for line in process.stdout:
                text += line
                if ready is not None and ready in line:
                    is_ready = True
                    process.terminate()
                    process.wait()
                    break
            return None if is_ready else process.wait(), text
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def require_good(name: str, command: Sequence[str], folder: Path) -> None:
    """Runs a bare command, which works or says what it needs."""
    status, text = run_bare(command, folder, GOES_ON.get(name))
    said = f"{name}: status {status}\n{text}"
    assert status in (None, 0, 1, 2, 3), said
    assert "Traceback" not in text, said
    if status:
        # A sentence; a wrong use comes with the way to the usage.
        assert re.search(r"\w+ \w+ \w+", text), said
        if re.search(r"required|usage", text):
            assert re.search(r"--help|^usage: ", text, re.MULTILINE), said


@pytest.mark.slow
@pytest.mark.parametrize("verb", VERBS)
def test_every_bare_command_works_or_says_what_it_needs(tmp_path: Path, verb: str) -> None:
    found = list(commands(verb))
    assert is_command(verb)
    if verb in EXAMPLES:
        assert EXAMPLES[verb] in found
    for words in found:
        require_good(" ".join(words), [PROGRAM, *words], tmp_path / "-".join(words))


def test_the_commands_are_found() -> None:
    assert EXAMPLES.keys() <= set(VERBS)
    assert "compat-check" in VERBS
    assert "trifinger_robot_backend" in SCRIPTS
    assert {"trifinger_simulation.tasks", "robot_fingers.programs"} <= set(MODULES)


@pytest.mark.parametrize("name", SCRIPTS)
def test_every_bare_program_of_the_packages_works_or_says_what_it_needs(
    tmp_path: Path, programs: Path, name: str
) -> None:
    require_good(name, [str(programs / name)], tmp_path / name)


@pytest.mark.parametrize("name", MODULES)
def test_every_bare_module_of_the_packages_works_or_says_what_it_needs(
    tmp_path: Path, name: str
) -> None:
    require_good(name, [sys.executable, "-m", name], tmp_path / name)


def test_every_task_names_its_robot() -> None:
    tasks = help_of("manipulate").partition("Tasks:\n")[2].partition("\n\n")[0]
    assert [task for task, _ in SKILLS] == re.findall(r"^  (\w+) ", tasks, re.MULTILINE)


@pytest.mark.slow
@pytest.mark.parametrize(("task", "robot"), SKILLS, ids=[task for task, _ in SKILLS])
def test_every_bare_skill_does_what_it_says(
    start_program: StartProgram, tmp_path: Path, task: str, robot: str
) -> None:
    running = start_program("run", robot, "--name", "sim", "--non-real-time")
    running.wait_for("waits for a user")
    done = subprocess.run(
        [PROGRAM, "manipulate", task], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    output = tmp_path / "manipulate_output"
    report = json.loads((output / "report.json").read_text())
    assert report["is_done"]
    assert report["task"] == task
    assert (output / "trace.csv").read_text().count("\n") > 100
    assert "fault" not in running.end()[1]
