# SPDX-License-Identifier: BSD-3-Clause
"""Names, paths and texts that no program expects work, or an error names them."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trifinger
from conftest import PROGRAM
from trifinger import policy_file

pytestmark = pytest.mark.bindings

# Paths are bytes; these are no text in any encoding.
ODD = b"a\xff\xfe b\n\xc3"


@pytest.fixture
def odd_folder(tmp_path: Path) -> Path:
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/" + ODD))
    folder.mkdir()
    return folder


def record(folder: Path | bytes | str) -> tuple[trifinger.Recorder, int]:
    simulation = trifinger.Simulation()
    with simulation.record(folder) as recorder, simulation.connect() as robot:
        robot.get_observation(robot.append_desired_action(robot.new_action()))
        robot.finish()
        return recorder, robot.session_info().steps


@pytest.mark.parametrize("kind", [Path, os.fspath, os.fsencode])
def test_fault_75_a_log_has_any_path(odd_folder: Path, kind: Callable[[Path], Path]) -> None:
    recorder, steps = record(kind(odd_folder))
    (file,) = odd_folder.glob("*.mcap")
    assert recorder.file == file
    for path in (kind(odd_folder), kind(file), [kind(file)]):
        log = trifinger.Log(path)
        assert log.files == [file]
        assert log.session().steps == steps
    with trifinger.replay(kind(file)) as robot:
        assert robot.latest_observation() is not None


def test_fault_75_what_is_wrong_with_a_log_names_its_path(odd_folder: Path) -> None:
    missing = odd_folder / "missing.mcap"
    with pytest.raises(FileNotFoundError) as not_found:
        trifinger.Log(missing)
    # The text can be printed: it has no lone surrogates, which no terminal accepts.
    assert r"a\xff\xfe b" in str(not_found.value).encode().decode()
    empty = odd_folder / "empty.mcap"
    empty.touch()
    with pytest.raises(trifinger.Error, match=r"(?s)\\xff\\xfe .*empty\.mcap is empty$"):
        trifinger.Log(empty)
    recorder, _ = record(odd_folder / "logs")
    assert recorder.file is not None
    content = bytearray(recorder.file.read_bytes())
    content[len(content) // 2] ^= 1
    recorder.file.write_bytes(content)
    damage = trifinger.Log(recorder.file).damage
    assert {each.file for each in damage} == {recorder.file}


@pytest.mark.parametrize(
    ("path", "error"),
    [
        ("a\0b", trifinger.InvalidArgument),
        (b"a\0b", trifinger.InvalidArgument),
        ("\ud800", UnicodeEncodeError),
        (7, TypeError),
        (None, TypeError),
    ],
)
def test_fault_75_what_is_no_path_is_a_typed_error(path: object, error: type[Exception]) -> None:
    for use in (trifinger.Log, trifinger.Policy, trifinger.Simulation().record, trifinger.replay):
        with pytest.raises(error):
            use(path)  # type: ignore[operator]


def test_fault_75_a_policy_has_any_path_and_only_utf8_in_it(odd_folder: Path) -> None:
    path = odd_folder / "a.policy"
    layers = [(np.ones((2, 3)), np.zeros(2), "tanh")]
    policy_file.write(path, layers, metadata={"robot": "ä"})
    policy = trifinger.Policy(path)
    policy.save(os.fsencode(odd_folder / "b.policy"))
    assert trifinger.Policy(odd_folder / "b.policy").metadata == {"robot": "ä"}
    with pytest.raises(trifinger.InvalidArgument, match="not UTF-8"):
        policy_file.write(path, layers, metadata={"robot": "\udcff"})
    with pytest.raises(FileNotFoundError, match=r"\\xff"):
        trifinger.Policy(odd_folder / "c.policy")
    content = path.read_bytes()
    for old, new in (("ä".encode(), b"\xff\xfe"), (b"tanh", b"t\xffnh"), (b"robot", b"\xff")):
        path.write_bytes(content.replace(old, new))
        with pytest.raises(trifinger.PolicyFileError, match=r"(?s)\\xff.*a\.policy"):
            trifinger.Policy(path)


SESSION = """
import sys, trifinger
assert trifinger.list_sessions() == []
try:
    trifinger.connect("robot")
except trifinger.SessionNotFound as error:
    print(str(error))
with trifinger.run_fake("robot"), trifinger.connect("robot") as robot:
    robot.get_observation(robot.append_desired_action(robot.new_action()))
    assert [session.name for session in trifinger.list_sessions()][0] == "robot"
    try:
        trifinger.run_fake("robot")
    except trifinger.RobotOwned as error:
        print(str(error))
"""


def test_fault_75_a_session_folder_has_any_path(odd_folder: Path) -> None:
    environment = os.environ | {"TRIFINGER_SESSION_DIR": os.fspath(odd_folder)}
    subprocess.run(
        [sys.executable, "-c", SESSION], env=environment, check=True, capture_output=True
    )


def test_fault_75_a_name_that_looks_like_an_option_is_refused() -> None:
    with pytest.raises(trifinger.InvalidArgument, match=r"'-x' cannot name a robot: .* begin with"):
        trifinger.run_fake("-x")


@pytest.mark.without_sanitizer  # this test needs the program
def test_fault_75_programs_take_any_path_and_no_name_that_looks_like_an_option(
    odd_folder: Path, tmp_path: Path
) -> None:
    def run(*arguments: str | Path, expect: int = 0) -> str:
        result = subprocess.run([PROGRAM, *arguments], capture_output=True, check=False)
        assert result.returncode == expect, result.stdout + result.stderr
        return (result.stdout + result.stderr).decode(errors="replace")

    recorder, steps = record(odd_folder)
    assert recorder.file is not None
    assert json.loads(run("log", "info", "--json", recorder.file))["sessions"][0]["steps"] == steps
    assert "whole" in run("log", "check", recorder.file)
    assert "'-x' cannot name a robot" in run("run", "fake", "--name=-x", expect=2)

    empty = tmp_path / "empty.mcap"
    empty.touch()
    for command in ("info", "check", "recover", "cut"):
        output = ("-o", tmp_path / "out.mcap") if command in ("recover", "cut") else ()
        assert run("log", command, empty, *output, expect=1).endswith(f"{empty} is empty\n")
        assert not (tmp_path / "out.mcap").exists()


MANY = """
import resource, sys, trifinger
_, most = resource.getrlimit(resource.RLIMIT_NOFILE)
resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
overrides = {"backend.history": 16}
robots = []
for i in range(int(sys.argv[1])):
    robots.append(trifinger.simulate("sim", overrides))
    if i % 100 == 0 and len(open("/proc/self/maps").readlines()) > 60_000:
        break
for robot in robots:
    robot.get_observation(robot.append_desired_action(robot.new_action()))
    assert robot.get_status(0) is not None
print(len(robots))
"""

SCARCE = """
import resource, trifinger
resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))
robots = []
try:
    while True:
        robots.append(trifinger.simulate())
except OSError as error:
    print(error)
robots[0].get_observation(robots[0].append_desired_action(robots[0].new_action()))
"""


@pytest.mark.slow
@pytest.mark.without_sanitizer  # a sanitizer has mappings of its own
def test_fault_75_hundreds_of_simulations_are_in_one_process() -> None:
    result = subprocess.run(
        [sys.executable, "-c", MANY, "500"], capture_output=True, text=True, check=False
    )
    assert (result.returncode, result.stdout) == (0, "500\n"), result.stderr


def test_fault_75_a_limit_of_open_files_is_named_with_its_remedy() -> None:
    result = subprocess.run(
        [sys.executable, "-c", SCARCE], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    assert "Too many open files; 'ulimit -n' shows how many this process may open" in result.stdout
