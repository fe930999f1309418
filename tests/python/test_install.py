# SPDX-License-Identifier: BSD-3-Clause
"""The files of `cmake --install`, moved elsewhere and used without the build folder."""

import re
import shutil
import sysconfig
import tomllib
from pathlib import Path

import pytest
import trifinger
from conftest import BUILD, StartProgram, output_of
from trifinger.commands import plot

SOURCES = Path(__file__).parents[2]
CONSUMERS = SOURCES / "tests" / "consumer"
VERSION = tomllib.loads((SOURCES / "pyproject.toml").read_text())["project"]["version"]
# No search path of this test may lead what was installed back to where it was built.
ENVIRONMENT = {"PATH": "/usr/bin:/bin", "LC_ALL": "C.UTF-8"}


def run(
    *command: str | Path,
    succeeds: bool = True,
    cwd: Path | None = None,
    path: str = ENVIRONMENT["PATH"],
) -> str:
    """Runs a command and returns what it said."""
    return output_of(*command, env=ENVIRONMENT | {"PATH": path}, cwd=cwd, succeeds=succeeds)


@pytest.fixture(scope="module")
def first_prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the installation before it was moved."""
    return tmp_path_factory.mktemp("install") / "first"


@pytest.fixture(scope="module")
def prefix(first_prefix: Path) -> Path:
    """The folder to which the installation was moved."""
    run("cmake", "--install", BUILD, "--prefix", first_prefix)
    return first_prefix.rename(first_prefix.with_name("moved here"))


def test_names_no_folder_of_the_machine_that_built_it(prefix: Path, first_prefix: Path) -> None:
    packages = Path(sysconfig.get_path("purelib"))
    folders = [str(folder).encode() for folder in (SOURCES, BUILD, packages, first_prefix)]
    files = [path for path in prefix.rglob("*") if path.is_file()]
    assert files
    assert [path for path in files if any(folder in path.read_bytes() for folder in folders)] == []
    assert [path for path in prefix.rglob("*") if path.is_symlink()] == []


def test_holds_nothing_of_the_python_package(prefix: Path) -> None:
    assert {path.name for path in prefix.iterdir()} == {"bin", "include", "lib", "share"}
    assert list(prefix.rglob("_trifinger*.so")) == []


def test_program_uses_the_mujoco_that_was_installed_with_it(prefix: Path) -> None:
    libraries = run("ldd", prefix / "bin" / "trifinger")
    mujoco = re.search(r"libmujoco\S* => (.*) \(", libraries)
    assert mujoco, libraries
    assert Path(mujoco[1]).resolve().parent == prefix / "lib" / "trifinger"


def test_program_says_its_version(prefix: Path) -> None:
    assert run(prefix / "bin" / "trifinger", "--version") == f"trifinger {VERSION}\n"


def test_program_exports_the_model(prefix: Path) -> None:
    mjcf = run(prefix / "bin" / "trifinger", "model", "export", "--format", "mjcf")
    assert mjcf.startswith("<mujoco")


def test_program_knows_the_configurations_that_were_installed_with_it(prefix: Path) -> None:
    refusal = run(prefix / "bin" / "trifinger", "run", "nonsense", succeeds=False)
    for file in (SOURCES / "config").glob("*.yml"):
        assert (prefix / "share" / "trifinger" / "config" / file.name).is_file()
        assert file.stem in refusal


def test_program_is_not_mistaken_for_what_has_its_name_in_the_working_directory(
    prefix: Path, tmp_path: Path
) -> None:
    (tmp_path / "trifinger").mkdir()
    path = f"{prefix / 'bin'}:{ENVIRONMENT['PATH']}"
    refusal = run("trifinger", "run", "nonsense", succeeds=False, cwd=tmp_path, path=path)
    assert "trifinger_pro" in refusal


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="there is no systemd here")
def test_service_is_one_that_systemd_accepts(prefix: Path, tmp_path: Path) -> None:
    units = tmp_path / "units"
    shutil.copytree(prefix / "lib" / "systemd" / "system", units)
    # An administrator who installed the program elsewhere changes its path like this.
    changes = units / "trifinger@sim.service.d"
    changes.mkdir()
    program = prefix / "bin" / "trifinger"
    (changes / "program.conf").write_text(f'[Service]\nExecStart=\nExecStart="{program}" run %i\n')
    verdict = run(
        "env", f"SYSTEMD_UNIT_PATH={units}:", "systemd-analyze", "verify", "trifinger@sim.service"
    )
    assert "trifinger" not in verdict  # systemd may complain about other units


def test_service_never_starts_a_robot_again_by_itself(prefix: Path) -> None:
    unit = (prefix / "lib" / "systemd" / "system" / "trifinger@.service").read_text()
    for setting in ("Restart=no", "KillSignal=SIGTERM", "LimitRTPRIO=99", "LimitMEMLOCK=infinity"):
        assert f"\n{setting}\n" in unit
    assert "RestrictRealtime" not in unit
    for file in ("99-trifinger.conf", "99-trifinger.rules"):
        assert (prefix / "share" / "trifinger" / "system" / file).is_file()


def test_public_headers_do_not_include_mujoco(prefix: Path) -> None:
    headers = list((prefix / "include").rglob("*.hpp"))
    assert headers
    assert [path for path in headers if re.search(r"#\s*include.*mujoco", path.read_text())] == []


def build_consumer(source: Path, build: Path, prefix: Path, *options: str) -> Path:
    """Builds a project of somebody who uses the package and returns the program."""
    run(
        "cmake", "-G", "Ninja", "-S", source, "-B", build, f"-DCMAKE_PREFIX_PATH={prefix}", *options
    )
    run("cmake", "--build", build)
    return build / "consumer"


def without(*packages: str) -> list[str]:
    """Returns the options of CMake for somebody who does not have these packages."""
    return [f"-DCMAKE_DISABLE_FIND_PACKAGE_{name}=ON" for name in packages]


@pytest.mark.slow
def test_others_build_a_robot_of_their_own_on_the_core_alone(prefix: Path, tmp_path: Path) -> None:
    options = without("yaml-cpp", "Eigen3", "MuJoCo", "PkgConfig")
    program = build_consumer(CONSUMERS / "core", tmp_path, prefix, *options)
    assert run(program) == "at step 100 the wheel is at 0.200 rad\n"
    assert re.search("mujoco|zstd|lz4|deflate", run("ldd", program)) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("layer", "missing"), [("mcap", ["yaml-cpp", "Eigen3", "MuJoCo"]), ("log", ["MuJoCo"])]
)
def test_others_write_and_read_files_without_simulation(
    prefix: Path, tmp_path: Path, layer: str, missing: list[str]
) -> None:
    options = [*without(*missing), f"-DLAYER={layer}"]
    program = build_consumer(CONSUMERS / "files", tmp_path, prefix, *options)
    assert run(program, tmp_path / "file.mcap") == "1 message of 5 bytes\n"
    assert "mujoco" not in run("ldd", program)


@pytest.mark.slow
def test_others_build_programs_that_simulate(prefix: Path, tmp_path: Path) -> None:
    program = build_consumer(CONSUMERS / "sim", tmp_path, prefix)
    assert run(program) == "at step 100 the cube is 0.032 m above the table\n"


@pytest.mark.slow
def test_others_build_controllers_without_simulation(prefix: Path, tmp_path: Path) -> None:
    program = build_consumer(CONSUMERS / "control", tmp_path, prefix, *without("Eiquadprog"))
    assert run(program) == "each of two tips presses with 1.30 N\n"


@pytest.mark.slow
def test_others_begin_a_robot_of_their_own_with_a_project_that_works(
    prefix: Path, tmp_path: Path, start_program: StartProgram
) -> None:
    trifinger_program = prefix / "bin" / "trifinger"
    said = run(trifinger_program, "new", "robot", "two_axes", "-o", tmp_path)
    assert f"{tmp_path}/two_axes/ has a robot with a driver in one file, two_axes.hpp" in said
    project = tmp_path / "two_axes"
    assert {path.name for path in project.iterdir()} == {
        *("CMakeLists.txt", "README.md", "main.cpp"),
        *("two_axes.hpp", "two_axes.yml", "two_axes_test.cpp"),
    }
    texts = [path.read_text() for path in project.iterdir()]
    assert not any(re.search(r"my_robot|MyRobot|SPDX|@|tests/", text) for text in texts)

    # As its README says, with warnings as errors.
    build = project / "build"
    warnings = "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Werror"
    run(
        *("cmake", "-G", "Ninja", "-S", project, "-B", build, warnings),
        f"-DCMAKE_PREFIX_PATH={prefix}",
    )
    run("cmake", "--build", build)
    run("ctest", "--test-dir", build, "--output-on-failure")

    # This machine may be busy with other tests.
    configuration = project / "two_axes.yml"
    configuration.write_text(re.sub(r"(max_\w+s): \d+", r"\1: 1000000", configuration.read_text()))
    robot = start_program(str(configuration), program=[str(build / "two_axes")])
    robot.wait_for("two_axes runs")
    words = ["record", "two_axes", "-o", str(tmp_path / "logs"), "--until-end"]
    recorder = start_program(*words, program=[str(trifinger_program)])
    recorder.wait_for("records into")
    assert "two_axes" in output_of(trifinger_program, "status", "two_axes", "--once")
    with trifinger.connect("two_axes") as user:
        for _ in range(100):
            t = user.append_desired_action(user.new_action(position=[0.5, -0.5]))
        assert user.get_applied_action(t).position.tolist() == [0.5, -0.5]
        user.finish()
    output_of(trifinger_program, "stop", "two_axes")
    assert robot.process.wait() == 0
    assert recorder.process.wait() == 0
    session = trifinger.Log(tmp_path / "logs").session("two_axes")
    assert session.type == "two_axes"
    assert plot.main([str(tmp_path / "logs"), "-o", str(tmp_path / "run.png")]) == 0
    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")
    assert session.steps is not None
    assert session.steps >= 100


@pytest.mark.parametrize(
    ("asked", "answer"),
    [
        ("99.0", f"version: {VERSION}"),
        ("COMPONENTS gripper", "there is no layer 'gripper', only base, ipc,"),
    ],
)
def test_package_says_why_it_is_not_what_was_asked_for(
    prefix: Path, tmp_path: Path, asked: str, answer: str
) -> None:
    (tmp_path / "CMakeLists.txt").write_text(
        f"""cmake_minimum_required(VERSION 3.25)
        project(consumer LANGUAGES NONE)
        find_package(trifinger {asked} REQUIRED)
        """
    )
    refusal = run(
        "cmake",
        "-G",
        "Ninja",
        "-S",
        tmp_path,
        "-B",
        tmp_path,
        f"-DCMAKE_PREFIX_PATH={prefix}",
        succeeds=False,
    )
    assert answer in " ".join(refusal.split())
