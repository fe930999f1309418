# SPDX-License-Identifier: BSD-3-Clause
"""What a wheel gives to somebody who has neither the sources nor a compiler: `./run wheel`."""

import fcntl
import json
import os
import re
import shlex
import shutil
import sys
import sysconfig
import tomllib
import venv
from pathlib import Path

import pytest
from conftest import BUILD, output_of
from link_into_venv import PROJECTS
from make_wheel import make_wheel, make_wheels_of_packages
from manual_pages import COMPILED, PACKAGE, Command
from packaging.requirements import Requirement
from spdx_tools.spdx.parser.parse_anything import parse_file
from spdx_tools.spdx.validation.document_validator import validate_full_spdx_document

pytestmark = pytest.mark.slow

SOURCES = Path(__file__).parents[2]
PROJECT = tomllib.loads((SOURCES / "pyproject.toml").read_text())["project"]
VERSION = PROJECT["version"]
PROGRAMS = SOURCES / "packages" / "trifinger_compat" / "tests" / "programs"
PACKAGES = Path(sysconfig.get_path("purelib"))


def pip(*arguments: str | Path) -> None:
    """Runs pip without a network: what it needs is here already."""
    output_of(sys.executable, "-m", "pip", "--disable-pip-version-check", *arguments)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel of this tree, compiled as the release build was, so that ccache has all objects."""
    same = re.findall(
        r"^(CMAKE_CXX_COMPILER(?:_LAUNCHER)?|TRIFINGER_WARNINGS_AS_ERRORS):\w+=(.+)$",
        (BUILD / "CMakeCache.txt").read_text(),
        re.MULTILINE,
    )
    with (tmp_path_factory.getbasetemp().parent / "wheel.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # another worker may be building there
        return make_wheel(tmp_path_factory.mktemp("wheel"), dict(same))


class Installation:
    """An environment with the wheel, and with links to the packages that the wheel needs."""

    def __init__(self, folder: Path, wheel: Path) -> None:
        venv.create(folder)
        self.folder = folder
        self.scripts = folder / "bin"
        self.sessions = folder / "sessions"
        self.sessions.mkdir()
        (self.packages,) = folder.glob("lib/python*/site-packages")
        self.install(wheel)
        self.link("mujoco", "numpy", "numpy.libs")

    def install(self, wheel: Path) -> None:
        """Installs a wheel, without the packages that it needs."""
        pip("--python", self.scripts / "python", "install", "--no-index", "--no-deps", wheel)

    def link(self, *names: str) -> None:
        """Makes packages available that are installed here."""
        for name in names:
            (self.packages / name).symlink_to(PACKAGES / name)

    def run(self, *command: str | Path, succeeds: bool = True) -> str:
        """Runs a command in the activated environment and returns what it said."""
        environment = {
            "PATH": f"{self.scripts}:/usr/bin:/bin",
            "LC_ALL": "C.UTF-8",
            "TRIFINGER_SESSION_DIR": str(self.sessions),
            "XDG_CACHE_HOME": str(self.folder / "cache"),
            "MUJOCO_GL": "egl",
        }
        return output_of(*command, env=environment, cwd=self.folder, succeeds=succeeds)


@pytest.fixture(scope="module")
def installation(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Installation:
    return Installation(tmp_path_factory.mktemp("environment"), wheel)


def libraries_of(installation: Installation) -> list[Path]:
    """The libraries of others that are in the wheel."""
    return list((installation.packages / "trifinger.libs").iterdir())


def test_names_no_folder_of_the_machine_that_built_it(installation: Installation) -> None:
    folders = [str(folder).encode() for folder in (SOURCES, BUILD, PACKAGES)]
    files = [path for path in (installation.packages / "trifinger").rglob("*") if path.is_file()]
    assert files
    assert [path for path in files if any(folder in path.read_bytes() for folder in folders)] == []


def test_holds_the_package_alone(installation: Installation) -> None:
    sources = SOURCES / "python" / "trifinger"
    for file in sources.rglob("*.*"):
        if file.suffix != ".pyc":
            assert (installation.packages / "trifinger" / file.relative_to(sources)).is_file()
    assert {path.name for path in installation.packages.iterdir()} == {
        *("trifinger", "trifinger_launcher", "trifinger.libs", f"trifinger-{VERSION}.dist-info"),
        *("mujoco", "numpy", "numpy.libs"),
    }
    shared = {path.parent for path in (installation.folder / "share").rglob("*.*")}
    assert shared == {installation.folder / "share/man/man1"}


def test_has_a_manual_page_of_every_command(installation: Installation) -> None:
    command = Command.parsed(("trifinger",), "", "", installation.run("trifinger", "--help"))
    headings = (*COMPILED, f"{PACKAGE}trifinger")
    names = [f"trifinger-{name}" for each in headings for name in command.lists[each]]
    pages = {path.stem for path in (installation.folder / "share/man/man1").iterdir()}
    assert len(names) > 30
    assert {"trifinger", "trifinger-log-info", "trifinger-log-plot", *names} <= pages


@pytest.mark.skipif(shutil.which("man") is None, reason="there is no `man`")
def test_man_finds_the_pages_of_an_active_environment(installation: Installation) -> None:
    found = installation.run("man", "--where", "trifinger-log-info")
    assert found == f"{installation.folder}/share/man/man1/trifinger-log-info.1\n"


def test_names_all_libraries_inside_it_in_its_bill_of_materials(installation: Installation) -> None:
    (path,) = installation.packages.glob("trifinger-*.dist-info/sboms/trifinger.spdx.json")
    document = parse_file(str(path))
    assert validate_full_spdx_document(document) == []
    libraries = {f"trifinger.libs/{path.name}" for path in libraries_of(installation)}
    assert {each.file_name for each in document.packages if each.checksums} == libraries
    compiled_in = {"Eigen", "CLI11", "JSON for Modern C++", "eiquadprog", "nanobind", "robin-map"}
    bundled = {"fmt", "yaml-cpp", "LZ4", "Zstandard", "libdeflate"}
    assert {each.name for each in document.packages} == {
        *("trifinger", "numpy", "mujoco-core"),
        *compiled_in,
        *bundled,
    }


def test_says_for_which_systems_it_is(wheel: Path) -> None:
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    assert re.fullmatch(
        rf"trifinger-{VERSION}-{python}-{python}-manylinux_2_34_\w+\.whl", wheel.name
    )


@pytest.mark.parametrize(
    "file",
    [
        *("_trifinger*.so", "trifinger", "trifinger-endurance"),
        *("trifinger-manipulate", "trifinger-run-policy"),
    ],
)
def test_brings_all_libraries_but_mujoco(installation: Installation, file: str) -> None:
    (binary,) = (installation.packages / "trifinger").glob(file)
    found = dict(re.findall(r"(\S+) => (.*) \(", installation.run("ldd", binary)))
    assert found
    mujoco = [path for name, path in found.items() if name.startswith("libmujoco")]
    assert [Path(path).parent.name for path in mujoco] == ["mujoco"]
    assert os.path.normpath(mujoco[0]).startswith(f"{installation.packages}/mujoco/")
    others = {
        name for name, path in found.items() if path not in mujoco and "/trifinger" not in path
    }
    # The standard of such wheels says that every Linux has these libraries.
    assert {name.partition(".")[0] for name in others} <= {
        *("libc", "libdl", "libgcc_s", "libm", "libpthread", "librt", "libstdc++"),
    }


def test_has_the_licences_of_what_is_inside(installation: Installation) -> None:
    names = {re.split(r"-[0-9a-f]{8}\.", path.name)[0] for path in libraries_of(installation)}
    assert names == {"libdeflate", "libfmt", "liblz4", "libyaml-cpp", "libzstd"}
    licences = installation.packages / "trifinger" / "licences"
    for name in (*names, "nanobind", "libcli11", "libeigen3", "nlohmann-json3", "eiquadprog"):
        assert any((licences / name).iterdir())


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


def test_program_starts_without_importing_the_package(installation: Installation) -> None:
    """Importing it would take most of the time of a short command."""
    script = installation.scripts / "trifinger"
    imported = installation.run("python", "-X", "importtime", script, "--version")
    assert "importlib.util" in imported
    assert "numpy" not in imported
    assert f"trifinger {VERSION}\n" in imported


@pytest.mark.parametrize(
    "command", ["demo", "train", "sweep", "evaluate", "film", "log plot", "log export"]
)
def test_program_finds_the_commands_of_the_package(
    installation: Installation, command: str
) -> None:
    usage = installation.run("trifinger", *command.split(), "--help")
    assert usage.startswith(f"Usage: trifinger {command}")


def assert_asks_for(told: str, missing: str, packages: list[str]) -> None:
    """Requires a command for a shell that installs some packages."""
    verb = "is" if missing.isidentifier() else "are"
    command = told.partition(f": {missing} {verb} missing: pip install ")[2].splitlines()[0]
    assert [*map(Requirement, shlex.split(command))] == [*map(Requirement, packages)]


@pytest.mark.parametrize(
    ("command", "missing", "extra"),
    [
        (
            "train reach",
            "gymnasium, stable_baselines3, rsl_rl, torch, tensorboard, tqdm and moviepy",
            "learning",
        ),
        ("evaluate reach.policy", "gymnasium", "learning"),
        ("film logs", "matplotlib, OpenGL and av", "film"),
        ("log plot logs", "matplotlib", "plot"),
        ("log export logs --format parquet", "pyarrow", "export"),
    ],
)
def test_commands_say_what_they_lack(
    installation: Installation, command: str, missing: str, extra: str
) -> None:
    robot = "import trifinger\nrobot = trifinger.simulate(record='logs')\n"
    if not (installation.folder / "logs").exists():
        installation.run("python", "-c", f"{robot}robot.append_desired_action(robot.new_action())")
    refusal = installation.run("trifinger", *command.split(), succeeds=False)
    assert_asks_for(refusal, missing, PROJECT["optional-dependencies"][extra])


def test_demo_runs_without_what_draws_it(installation: Installation) -> None:
    told = installation.run("trifinger", "demo", "--non-real-time")
    assert re.search(r"cube lifted by +20\.\d cm", told)
    assert_asks_for(told, "matplotlib", PROJECT["optional-dependencies"]["demo"])


@pytest.fixture(scope="module")
def packages(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Installation:
    """An environment with the wheels of the package and of those beside it."""
    folder = tmp_path_factory.mktemp("packages")
    make_wheels_of_packages(folder)
    environment = Installation(folder / "environment", wheel)
    for path in folder.glob("trifinger_*.whl"):
        environment.install(path)
    environment.link("scipy", "scipy.libs", "cv2", "opencv_python_headless.libs", "yaml", "_yaml")
    environment.link("gymnasium", "cloudpickle", "farama_notifications", "typing_extensions.py")
    environment.link("websockets")
    return environment


def test_each_package_has_a_wheel_with_its_modules_alone(packages: Installation) -> None:
    metadata = {
        path.name: (path / "RECORD").read_text()
        for path in packages.packages.glob("trifinger_*.dist-info")
    }
    assert len(metadata) == len([path for path in PROJECTS if "/trifinger_" in str(path)])
    assert [name for name, files in metadata.items() if "tests/" in files] == []


@pytest.mark.parametrize(
    "command",
    [
        name.removeprefix("trifinger-").replace("calibrate-", "calibrate ")
        for path in PROJECTS[1:]
        for name in tomllib.loads(path.read_text())["project"].get("scripts", {})
        if name.startswith("trifinger-")
    ],
)
def test_program_finds_the_commands_of_packages(packages: Installation, command: str) -> None:
    usage = packages.run("trifinger", *command.split(), "--help")
    assert usage.startswith(f"Usage: trifinger {command}")


@pytest.mark.parametrize(
    ("command", "missing", "folder", "extra"),
    [
        ("export lerobot l -o s", "pandas, pyarrow, av and PIL", "trifinger_data_sets", "lerobot"),
        ("export minari l -o s-v0", "minari and h5py", "trifinger_data_sets", "minari"),
        ("view sim", "PIL", "trifinger_view", None),
    ],
)
def test_commands_of_packages_say_what_they_lack(
    packages: Installation, command: str, missing: str, folder: str, extra: str | None
) -> None:
    project = tomllib.loads((SOURCES / "packages" / folder / "pyproject.toml").read_text())
    required = project["project"]
    names = required["optional-dependencies"][extra] if extra else required["dependencies"]
    assert_asks_for(packages.run("trifinger", *command.split(), succeeds=False), missing, names)


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("gym_environment.py", r"reward -.* after 300 steps\n"),
        ("pushing.py", r"pushed -0\.0\d+\n"),
        ("force_control.py", r"above \S+\naside \S+\naway \S+\n"),
    ],
)
def test_programs_for_the_original_run_with_the_wheel_of_compat(
    packages: Installation, program: str, said: str
) -> None:
    assert re.fullmatch(said, packages.run("python", PROGRAMS / program, "sim"))


def test_a_back_end_an_evaluation_and_a_log_reader_run_with_the_wheel_of_compat(
    packages: Installation,
) -> None:
    goal = {"position": [0.05, 0.0, 0.0825], "orientation": [0, 0, 0, 1]}
    (packages.folder / "goal.json").write_text(json.dumps({"difficulty": 3, "goal": goal}))
    logs = "--render-images --robot-logfile robot_data.dat --camera-logfile camera_data.dat"
    backend = f"pybullet_backend --name wheel -a 200 {logs}"
    evaluation = f"python {PROGRAMS / 'evaluate_policy.py'} real goal.json -"
    script = f"""
        mkfifo told
        {backend} > told & backend=$!
        exec 3< told
        read -r line <&3  # the robot is ready
        TRIFINGER_COMPAT_ROBOT=wheel {evaluation}
        wait $backend
        python {PROGRAMS / "read_log.py"} .
    """
    told = packages.run("bash", "-e", "-c", script)
    assert re.search(r"steps .* \(540, 540, 3\) True True\n", told)


def test_the_check_and_what_stands_in_for_other_packages_come_with_compat(
    packages: Installation,
) -> None:
    program = PROGRAMS / "pushing.py"
    assert "0 do not work" in packages.run("trifinger", "compat-check", program)
    modules = (
        "pybullet, rrc_2022_datasets.utils, trifinger_rl_datasets, ament_index_python.packages"
    )
    packages.run("python", "-c", f"import {modules}")
    for name in ("trifinger_backend", "trifinger_data_backend", "trifinger_robot_backend"):
        assert packages.run(name, "--help").startswith(f"Usage: {name} ")
