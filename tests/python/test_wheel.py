# SPDX-License-Identifier: BSD-3-Clause
"""What `pip install .` gives to somebody who has neither the sources nor the build folder."""

import fcntl
import os
import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
from pathlib import Path

import pytest
from conftest import BUILD

pytestmark = pytest.mark.release

SOURCES = Path(__file__).parents[2]
VERSION = tomllib.loads((SOURCES / "pyproject.toml").read_text())["project"]["version"]
PACKAGES = Path(sysconfig.get_path("purelib"))


def pip(*arguments: str | Path) -> None:
    """Runs pip without a network: what it needs is here already."""
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", *arguments]
    # What was compiled in another build folder is found by paths that are relative to this one.
    environment = {**os.environ, "CCACHE_BASEDIR": str(SOURCES)}
    done = subprocess.run(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment,
        check=False,
    )
    assert done.returncode == 0, done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel of this tree, compiled as the release build was, so that ccache has all objects."""
    folder = tmp_path_factory.mktemp("wheel")
    same = re.findall(
        r"^(CMAKE_CXX_COMPILER(?:_LAUNCHER)?"
        r"|TRIFINGER_(?:WARNINGS_AS_ERRORS|JOIN_FILES)):\w+=(.+)$",
        (BUILD / "CMakeCache.txt").read_text(),
        re.MULTILINE,
    )
    with (tmp_path_factory.getbasetemp().parent / "wheel.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # as another worker may build there
        pip(
            *("wheel", "--no-build-isolation", "--no-deps", "--wheel-dir", folder),
            *(f"--config-settings=cmake.define.{name}={value}" for name, value in same),
            SOURCES,
        )
    (wheel,) = folder.glob("*.whl")
    return wheel


class Installation:
    """An environment with the wheel, and with links to the packages that the wheel needs."""

    def __init__(self, folder: Path, wheel: Path) -> None:
        venv.create(folder)
        self.folder = folder
        self.scripts = folder / "bin"
        (self.packages,) = folder.glob("lib/python*/site-packages")
        pip("--python", self.scripts / "python", "install", "--no-index", "--no-deps", wheel)
        for name in ("mujoco", "numpy", "numpy.libs"):
            (self.packages / name).symlink_to(PACKAGES / name)

    def run(self, *command: str | Path, succeeds: bool = True) -> str:
        """Runs a command in the activated environment and returns what it said."""
        done = subprocess.run(
            command,
            cwd=self.folder,
            env={"PATH": f"{self.scripts}:/usr/bin:/bin", "LC_ALL": "C.UTF-8"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        assert (done.returncode == 0) == succeeds, f"{command}\n{done.stdout}"
        return done.stdout


@pytest.fixture(scope="module")
def installation(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Installation:
    return Installation(tmp_path_factory.mktemp("environment"), wheel)


def test_names_no_folder_of_the_machine_that_built_it(installation: Installation) -> None:
    folders = [str(folder).encode() for folder in (SOURCES, BUILD, PACKAGES)]
    files = [path for path in (installation.packages / "trifinger").rglob("*") if path.is_file()]
    assert files
    assert [path for path in files if any(folder in path.read_bytes() for folder in folders)] == []


def test_holds_the_package_alone(installation: Installation) -> None:
    files = {path.name for path in (installation.packages / "trifinger").iterdir()}
    for file in (SOURCES / "python" / "trifinger").glob("*.py*"):
        assert file.name in files
    assert {path.name for path in installation.packages.iterdir()} == {
        *("trifinger", f"trifinger-{VERSION}.dist-info"),
        *("mujoco", "numpy", "numpy.libs"),
    }
    assert not (installation.folder / "share").exists()


@pytest.mark.parametrize("file", ["_trifinger*.so", "trifinger"])
def test_uses_the_mujoco_beside_it(installation: Installation, file: str) -> None:
    (binary,) = (installation.packages / "trifinger").glob(file)
    libraries = installation.run("ldd", binary)
    mujoco = re.search(r"libmujoco\S* => (.*) \(", libraries)
    assert mujoco, libraries
    assert mujoco[1].startswith(f"{installation.packages}/trifinger/../mujoco/")


def test_module_simulates(installation: Installation) -> None:
    program = """
import trifinger
robot = trifinger.simulate("trifinger_pro")
y = robot.latest_observation()
t = robot.append_desired_action(robot.new_action(position=y.position))
print(trifinger.__version__, t, robot.get_observation(t).position.shape)
"""
    assert installation.run("python", "-c", program) == f"{VERSION} 0 (9,)\n"


def test_program_says_its_version(installation: Installation) -> None:
    assert installation.run("trifinger", "--version") == f"trifinger {VERSION}\n"


def test_program_knows_the_configurations_of_the_package(installation: Installation) -> None:
    refusal = installation.run("trifinger", "run", "nonsense", succeeds=False)
    for file in (SOURCES / "config").glob("*.yml"):
        assert file.stem in refusal


@pytest.mark.parametrize("command", ["demo", "train", "evaluate"])
def test_program_finds_the_commands_of_the_package(
    installation: Installation, command: str
) -> None:
    usage = installation.run("trifinger", command, "--help")
    assert usage.startswith(f"usage: trifinger {command}")


def test_training_says_what_it_lacks(installation: Installation) -> None:
    refusal = installation.run("trifinger", "train", "reach", succeeds=False)
    assert re.match(r"trifinger: gymnasium, .* are missing: pip install gymnasium==", refusal)
