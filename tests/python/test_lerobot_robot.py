# SPDX-License-Identifier: BSD-3-Clause
"""The package lerobot_robot_trifinger, with a stand-in for LeRobot written from its interface."""

import importlib
import subprocess
import sys
from collections.abc import Iterator
from email.parser import Parser
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trifinger
from conftest import PATIENT, StartProgram
from trifinger.errors import InvalidArgument

pytestmark = pytest.mark.release

SOURCES = Path(__file__).parents[2]
STAND_IN = Path(__file__).with_name("lerobot_stand_in")
NAME = "lerobot_robot_trifinger"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which the package's wheel is installed."""
    folder = tmp_path_factory.mktemp("wheel")
    sources = folder / "sources"
    copied = ["cp", "-r", str(SOURCES / "packages" / NAME), str(sources)]
    subprocess.run(copied, check=True)
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    build = ["wheel", "--no-build-isolation", "--no-deps", "-w", str(folder), str(sources)]
    subprocess.run([*pip, *build], check=True)
    (wheel,) = folder.glob("*.whl")
    target = folder / "installed"
    subprocess.run([*pip, "install", "--no-deps", "--target", str(target), str(wheel)], check=True)
    return target


def device_of(kind: str, config: Any) -> Any:
    """The device of a configuration, looked for where LeRobot looks."""
    cls = type(config)
    wanted = cls.__name__.removesuffix("Config")
    parent = cls.__module__.rpartition(".")[0]
    places = (parent, f"{parent}.{wanted.lower()}", cls.__module__.replace("config_", ""))
    for place in places:
        try:
            found = getattr(importlib.import_module(place), wanted, None)
        except ImportError:
            continue
        if found is not None:
            return found(config)
    raise AssertionError(f"LeRobot would not find {wanted} for the {kind}")


@pytest.fixture
def plugin(installed: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The package, found and imported as LeRobot does."""
    monkeypatch.syspath_prepend(str(STAND_IN))
    monkeypatch.syspath_prepend(str(installed))
    names = {one.name for one in metadata.distributions(path=[str(installed)])}
    (name,) = (one for one in names if one.startswith("lerobot_robot_"))
    yield importlib.import_module(name)
    for module in [one for one in sys.modules if one.split(".")[0] in ("lerobot", NAME)]:
        del sys.modules[module]


def configured(base: str, kind: str, **options: Any) -> Any:
    module = importlib.import_module(f"lerobot.{base}s")
    return getattr(module, f"{base.capitalize()}Config").known[kind](**options)


def test_the_name_in_the_wheel_keeps_its_underscores(installed: Path) -> None:
    (file,) = installed.glob("*.dist-info/METADATA")
    assert Parser().parsestr(file.read_text())["Name"] == NAME


def start_stepped(start_program: StartProgram, name: str, *settings: str) -> None:
    robot = start_program("run", "sim", "--name", name, "--non-real-time", *settings)
    robot.wait_for("waits for a user")


@pytest.mark.usefixtures("plugin")
def test_the_robot_does_what_it_is_sent_for_one_frame(start_program: StartProgram) -> None:
    start_stepped(start_program, "stepped")
    config = configured("robot", "trifinger", robot="stepped", fps=50)
    robot = device_of("robot", config)
    names = [f"position[{i}]" for i in range(9)]
    assert list(robot.action_features) == names
    assert set(robot.action_features.values()) == {float}
    assert list(robot.observation_features)[:9] == names
    assert not robot.is_connected
    with robot, trifinger.observe("stepped") as seen:
        assert robot.is_connected
        assert robot.is_calibrated
        first = robot.get_observation()
        assert list(first) == list(robot.observation_features)
        goal = {name: first[name] + 0.1 for name in names}
        for number in range(1, 26):
            assert robot.send_action(goal) == pytest.approx(goal)
            assert seen.current_time_index() == 1 + 20 * number
        last = robot.get_observation()
        assert all(abs(last[name] - goal[name]) < 0.05 for name in names)
        desired = seen.get_desired_actions(1, 500)["position"]
        np.testing.assert_array_equal(desired, np.tile(list(goal.values()), (499, 1)))
    assert not robot.is_connected


@pytest.mark.usefixtures("plugin")
def test_in_real_time_an_action_stays_until_the_next_one(start_program: StartProgram) -> None:
    running = start_program("run", "sim", "--name", "timed", *PATIENT)
    running.wait_for("waits for a user")
    robot = device_of("robot", configured("robot", "trifinger", robot="timed"))
    robot.connect()
    with trifinger.observe("timed") as seen:
        first = robot.get_observation()
        goal = {name: first[name] + 0.05 for name in robot.action_features}
        sent = seen.current_time_index()
        robot.send_action(goal)
        seen.wait_until_time_index(sent + 500)
        desired = seen.get_desired_actions(sent, sent + 500)["position"]
        is_new = (desired == np.array(list(goal.values()))).all(axis=1)
        assert is_new[-1]
        assert (np.diff(is_new.astype(int)) >= 0).all(), "once it acts, it stays"
        old = np.array([first[name] for name in goal])
        assert (np.abs(desired[~is_new] - old) < 0.02).all(), "before, the robot holds its pose"
    robot.disconnect()


@pytest.mark.usefixtures("plugin")
def test_the_leader_is_what_another_robot_measures(start_program: StartProgram) -> None:
    start_stepped(start_program, "led")
    with trifinger.connect("led") as hand:
        y = hand.latest_observation()
        hand.wait_until_time_index(hand.append_desired_action(hand.new_action(position=y.position)))
        leader = device_of(
            "teleoperator", configured("teleoperator", "trifinger_leader", robot="led")
        )
        with leader:
            measured = hand.latest_observation().position
            np.testing.assert_array_equal(list(leader.get_action().values()), measured)
            assert list(leader.get_action()) == list(leader.action_features)
            assert leader.feedback_features == {}


@pytest.mark.usefixtures("plugin")
def test_misuse_is_refused_with_the_names(start_program: StartProgram) -> None:
    from lerobot.utils.errors import (  # type: ignore[import-not-found]
        DeviceAlreadyConnectedError,
        DeviceNotConnectedError,
    )

    start_stepped(start_program, "stepped")
    robot = device_of("robot", configured("robot", "trifinger", robot="stepped"))
    for call in (robot.get_observation, robot.disconnect, lambda: robot.send_action({})):
        with pytest.raises(DeviceNotConnectedError, match="call connect"):
            call()
    wrong = configured("robot", "trifinger", robot="stepped", action_fields={"position": 6})
    with pytest.raises(InvalidArgument, match="'position' of 6 numbers; it has torque of 9"):
        device_of("robot", wrong).connect()
    with robot:
        with pytest.raises(DeviceAlreadyConnectedError):
            robot.connect()
        with pytest.raises(InvalidArgument, match=r"lacks \['position\[8\]'\]"):
            robot.send_action({f"position[{i}]": 0.0 for i in range(8)})


@pytest.mark.usefixtures("plugin")
def test_a_robot_that_has_stopped_says_why(start_program: StartProgram) -> None:
    start_stepped(start_program, "stepped")
    robot = device_of("robot", configured("robot", "trifinger", robot="stepped"))
    robot.connect()
    observation = robot.get_observation()
    action = {name: observation[name] for name in robot.action_features}
    stopping = start_program("stop", "stepped")
    stopping.process.communicate()
    with pytest.raises(trifinger.Error, match="stop"):
        robot.send_action(action)
    with pytest.raises(trifinger.Error, match="stop"):
        robot.get_observation()
    robot.disconnect()
