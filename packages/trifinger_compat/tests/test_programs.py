# SPDX-License-Identifier: BSD-3-Clause
"""Programs of the kinds that exist, in simulation and on a back-end in another process."""

import ast
import importlib.util
import inspect
import json
import os
import pkgutil
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import gymnasium
import pytest
from backend import PACKAGES as FOLDER, environment, running
from trifinger_compat import check
from trifinger_compat.robot_data import VARIABLE
from trifinger_compat.symbols import PACKAGES, SAME

PROGRAMS = Path(__file__).parent / "programs"
pytestmark = pytest.mark.slow


def said(program: str, *words: str | Path, **variables: str) -> str:
    command = [sys.executable, str(PROGRAMS / program), *map(str, words)]
    done = subprocess.run(
        command,
        env=environment(**variables),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def said_by_both(program: str, *words: str | Path) -> tuple[str, str]:
    """What a program says in simulation, and with a robot in another process."""
    simulated = said(program, "sim", *words)
    with running() as robot:
        return simulated, said(program, "real", *words, **{VARIABLE: robot})


def test_a_gym_environment_around_the_platform() -> None:
    for text in said_by_both("gym_environment.py"):
        assert text.startswith("reward -")
        assert text.endswith("after 300 steps")


def test_a_program_that_uses_gym(tmp_path: Path) -> None:
    if importlib.util.find_spec("gym") is None:
        make_gym(tmp_path)
    path = os.pathsep.join([environment()["PYTHONPATH"], str(tmp_path)])
    assert said("with_gym.py", PYTHONPATH=path).startswith("worked with 0.26")


def make_gym(folder: Path) -> None:
    """Makes a package of the interface of Gym 0.26: a copy of Gymnasium with classes of its own."""
    source = Path(gymnasium.__file__).parent
    for path in source.rglob("*.py"):
        text = path.read_text().replace("gymnasium", "gym")
        copy = folder / "gym" / path.relative_to(source)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(text)
    top = folder / "gym" / "__init__.py"
    # At the top of Gym there is no registry.
    top.write_text(f'{top.read_text()}\ndel registry\n__version__ = "0.26.2"\n')


def test_the_check_and_the_programs_run_in_a_checkout() -> None:
    def run(*words: str) -> "subprocess.CompletedProcess[str]":
        command = [sys.executable, "-W", "error", "-m", *words]
        return subprocess.run(
            command, env=environment(), capture_output=True, text=True, check=False
        )

    checked = run("trifinger_compat.check", str(PROGRAMS / "pushing.py"))
    assert (checked.returncode, checked.stderr) == (0, "")
    helped = run("robot_fingers.programs", "pybullet_backend", "--help")
    assert (helped.returncode, helped.stderr) == (0, "")
    assert "--render-images" in helped.stdout
    wrong = run("robot_fingers.programs", "nothing")
    assert wrong.returncode == 2
    assert "trifinger_data_backend" in wrong.stderr


def test_pushing_with_inverse_kinematics() -> None:
    for text in said_by_both("pushing.py"):
        assert -0.04 < float(text.removeprefix("pushed ")) < -0.01


def test_a_state_machine_with_force_control() -> None:
    for text in said_by_both("force_control.py"):
        states = dict(line.split() for line in text.splitlines())
        assert list(states) == ["above", "aside", "away"]
        assert all(float(error) < 0.01 for error in states.values()), text


def test_an_evaluation_script_with_a_goal_file(tmp_path: Path) -> None:
    goal = tmp_path / "goal.json"
    pose = {"position": [0.05, 0.0, 0.0825], "orientation": [0, 0, 0, 1]}
    goal.write_text(json.dumps({"difficulty": 3, "goal": pose}))
    simulated, real = said_by_both("evaluate_policy.py", goal, tmp_path / "log.p")
    assert json.loads(simulated)["reward"] == pytest.approx(json.loads(real)["reward"], abs=0.5)
    assert (tmp_path / "log.p").stat().st_size > 0


def test_a_log_reader(tmp_path: Path) -> None:
    goal = {"position": [0.05, 0.0, 0.0825], "orientation": [0, 0, 0, 1]}
    (tmp_path / "goal.json").write_text(json.dumps({"difficulty": 3, "goal": goal}))
    robot, camera = tmp_path / "robot_data.dat", tmp_path / "camera_data.dat"
    words = ["-a", "200", "--render-images", "--robot-logfile", robot, "--camera-logfile", camera]
    with running(*words, ends=True) as name:
        evaluated = said(
            "evaluate_policy.py", "real", tmp_path / "goal.json", "-", **{VARIABLE: name}
        )
    text = said("read_log.py", tmp_path)
    seen, rest = text.split(" steps ")
    reward = float(rest.split()[0])
    assert text.endswith("(540, 540, 3) True True")
    assert int(seen) > 50
    assert reward == pytest.approx(json.loads(evaluated)["reward"] / 200, abs=0.01)


def test_the_check_says_that_these_programs_work(capsys: pytest.CaptureFixture[str]) -> None:
    for program in PROGRAMS.glob("*.py"):
        lacks_gym = program.name == "with_gym.py" and importlib.util.find_spec("gym") is None
        assert check.main([str(program)]) == lacks_gym
        assert f"{int(lacks_gym)} do not work" in capsys.readouterr().out


def test_the_check_says_what_does_not_work_and_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "theirs.py"
    program.write_text(
        "import pybullet as p\n"
        "from trifinger_simulation import TriFingerPlatform, nothing\n"
        "from trifinger_simulation.tasks import move_cube as mc\n"
        "platform = TriFingerPlatform()\n"
        "p.resetDebugVisualizerCamera(1, 2)\n"
        "p.loadURDF('x')\n"
        "p.GUI\n"
        "mc.sample_goal(1)\n"
        "mc.sample_gaol(1)\n"
        "print(platform.simfinger.finger_id)\n"
    )
    monkeypatch.setattr(check, "_has_bullet", lambda: False)
    assert check.main([str(program)]) == 1
    said = capsys.readouterr().out
    assert "theirs.py:2: trifinger_simulation.nothing does not work" in said
    assert "theirs.py:5: pybullet.resetDebugVisualizerCamera works, differs: it leaves" in said
    assert "theirs.py:6: pybullet.loadURDF does not work: PyBullet is not installed; " in said
    assert "theirs.py:7: pybullet.GUI" not in said
    assert "theirs.py:9: trifinger_simulation.tasks.move_cube.sample_gaol does not work" in said
    assert "theirs.py:10: SF.finger_id works, differs" in said
    assert "sample_goal works" not in said
    assert "\nPyBullet is not installed.\n" in said
    assert check.main([str(program), "--all"]) == 1
    assert "theirs.py:8: trifinger_simulation.tasks.move_cube.sample_goal works\n" in (
        capsys.readouterr().out
    )
    monkeypatch.setattr(check, "_has_bullet", lambda: True)
    assert check.main([str(program)]) == 1
    said = capsys.readouterr().out
    assert "pybullet.loadURDF" not in said
    assert "\nPyBullet is installed.\n" in said


def test_the_check_sees_arguments_that_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    program = tmp_path / "theirs.py"
    program.write_text(
        "from trifinger_simulation import SimFinger, TriFingerPlatform\n"
        "import trifinger_simulation as ts\n"
        "SimFinger('trifingerpro', 0.0005)\n"
        "ts.TriFingerPlatform(time_step_s=0.0015)\n"
        "ts.sim_finger.SimFinger('trifingerpro', robot_position_offset=(0, 0, 0.1))\n"
        "SimFinger('trifingerpro', 0.004, robot_position_offset=[0, 0, 0])\n"
        "SimFinger(*words, 0.0005)\n"
        "TriFingerPlatform(time_step_s=step)\n"
    )
    assert check.main([str(program)]) == 1
    said = capsys.readouterr().out.splitlines()
    found = [line.partition("theirs.py:")[2].partition(": ")[0] for line in said[:-3]]
    assert [name.partition(" ")[0] for name in found] == ["3", "4", "5"]
    assert "SimFinger(time_step=) does not work: the time step is 0.0005 s" in said[0]
    assert "TriFingerPlatform(time_step_s=) does not work: the time step is 0.0015" in said[1]
    assert "SimFinger(robot_position_offset=) does not work: the robot cannot be" in said[2]
    assert said[-1] == "Not judged: members of objects, except _pybullet_client_id and finger_id."


def raises_at_once(thing: Any) -> bool:
    """True for a function or class that can only raise NotImplementedError."""
    function = thing.__init__ if isinstance(thing, type) else thing
    if not inspect.isfunction(function) or str(FOLDER) not in function.__code__.co_filename:
        return False
    (node,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
    assert isinstance(node, ast.FunctionDef)
    first = next((each for each in node.body if not isinstance(each, ast.Expr)), None)
    return isinstance(first, ast.Raise) and "NotImplementedError" in ast.unparse(first)


@pytest.mark.filterwarnings("ignore::FutureWarning")
def test_the_check_knows_all_that_can_only_raise() -> None:
    modules = [importlib.import_module(package) for package in PACKAGES]
    for package in list(modules):
        walked = pkgutil.walk_packages(getattr(package, "__path__", []), f"{package.__name__}.")
        names = [found.name for found in walked if not found.name.endswith("__main__")]
        modules += map(importlib.import_module, names)
    refused = {
        f"{module.__name__}.{name}"
        for module in modules
        for name, thing in vars(module).items()
        if not name.startswith("_") and raises_at_once(thing)
    }
    assert {name.rpartition(".")[2] for name in refused} >= {
        *("import_mesh", "TriCameraDriver", "PylonDriver", "OpenCVDriver", "CubeDetector"),
        *("TriCameraObjectTrackerDriver", "create_solo_eight_backend", "TriFingerDatasetEnv"),
    }
    judged = {
        finding.name: finding.verdict
        for name in refused
        for finding in check.check_text(f"import {name.partition('.')[0]}\n{name}()", Path())
        if finding.name == name
    }
    assert judged.keys() == refused
    assert [name for name, verdict in judged.items() if verdict == SAME] == []


def test_the_check_needs_something_to_read(tmp_path: Path) -> None:
    assert check.main([str(tmp_path)]) == 2
    assert check.main([str(tmp_path / "none.py")]) == 2
    broken = tmp_path / "old.py"
    broken.write_text("print 'python 2'\n")
    assert check.main([str(broken)]) == 1
