# SPDX-License-Identifier: BSD-3-Clause
"""The package lerobot_robot_trifinger, with a stand-in for LeRobot written from its interface."""

import importlib
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from email.parser import Parser
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trifinger
from conftest import PATIENT, StartProgram
from trifinger.cameras import Cameras
from trifinger.errors import CameraLost, InvalidArgument

SOURCES = Path(__file__).parents[3]
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


@pytest.mark.slow
def test_the_name_in_the_wheel_keeps_its_underscores(installed: Path) -> None:
    (file,) = installed.glob("*.dist-info/METADATA")
    assert Parser().parsestr(file.read_text())["Name"] == NAME


def start_stepped(start_program: StartProgram, name: str, *settings: str) -> None:
    robot = start_program("run", "sim", "--name", name, "--non-real-time", *settings)
    robot.wait_for("waits for a user")


@pytest.mark.slow
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
        new = np.array(list(goal.values()))
        acts = sent
        while (seen.get_desired_action(acts)["position"] != new).any():
            acts += 1
        desired = seen.get_desired_actions(sent, acts + 300)["position"]
        is_new = (desired == new).all(axis=1)
        assert (is_new == (np.arange(sent, acts + 300) >= acts)).all(), "once it acts, it stays"
        old = np.array([first[name] for name in goal])
        assert (np.abs(desired[~is_new] - old) < 0.02).all(), "before, the robot holds its pose"
    robot.disconnect()


@pytest.mark.slow
def test_in_real_time_connect_waits_for_the_first_step(
    start_program: StartProgram, plugin: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    start_program("run", "sim", "--name", "new", *PATIENT).wait_for("waits for a user")
    robot = device_of("robot", configured("robot", "trifinger", robot="new"))
    feeder = importlib.import_module(f"{plugin.__name__}.robot")._Feeder
    supply, may_begin = feeder._run, threading.Event()

    def begin_late(self: Any) -> None:
        may_begin.wait()
        supply(self)

    monkeypatch.setattr(feeder, "_run", begin_late)
    with ThreadPoolExecutor() as threads, trifinger.observe("new") as seen:
        try:
            connecting = threads.submit(robot.connect)
            with pytest.raises(TimeoutError):
                connecting.result(timeout=1)
        finally:
            may_begin.set()
        connecting.result()
        assert seen.current_time_index() >= 0
        assert list(robot.get_observation()) == list(robot.observation_features)
    robot.disconnect()


LATE = 100  # first step with an image of cameras that begin late


def begin_late(monkeypatch: pytest.MonkeyPatch) -> None:
    """Real cameras may send their first image after the robot's first step."""
    get_latest_at = Cameras.get_latest_at
    monkeypatch.setattr(
        Cameras,
        "get_latest_at",
        lambda cameras, t: None if t < LATE else get_latest_at(cameras, t),
    )


def start_seeing(start_program: StartProgram, *options: str) -> None:
    size = ("--set", "cameras.size=54", "--set", "cameras.rate=10")
    running = start_program("run", "sim_cameras", "--name", "seeing", *options, *size)
    running.wait_for("waits for a user")


def cameras(names: tuple[str, ...], **options: Any) -> dict[str, Any]:
    config = importlib.import_module("lerobot.cameras").CameraConfig.known["trifinger"]
    return {name: config(**{"width": 54, "height": 54, **options}) for name in names}


@pytest.mark.usefixtures("plugin")
def test_the_first_observation_has_an_image_of_each_camera(
    start_program: StartProgram, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin_late(monkeypatch)
    start_seeing(start_program, "--non-real-time")
    names = ("camera60", "camera300")
    options: dict[str, Any] = {"robot": "seeing", "cameras": cameras(names)}
    robot = device_of("robot", configured("robot", "trifinger", **options))
    assert tuple(robot.cameras) == names
    with robot:
        assert all(camera.is_connected for camera in robot.cameras.values())
        first = robot.get_observation()
        assert list(first) == list(robot.observation_features)
        assert all(first[name].shape == robot.observation_features[name] for name in names)
        action = {name: first[name] for name in robot.action_features}
        for _ in range(10):
            robot.send_action(action)
        last = robot.get_observation()
        assert all((last[name] is not first[name]) for name in names), "newer images have come"
        for name, camera in robot.cameras.items():  # what programs may read of a camera
            last = robot.get_observation()
            assert (camera.height, camera.width, 3) == last[name].shape
            np.testing.assert_array_equal(camera.read_latest(), last[name])
            np.testing.assert_array_equal(camera.async_read(), last[name])
            with pytest.raises(TimeoutError, match=r"no new image of camera\d+ of seeing"):
                camera.async_read(timeout_ms=1)
            for _ in range(20):  # 0.7 s; the newest image is at most 0.1 s old
                robot.send_action(action)
            camera.read_latest()
            with pytest.raises(TimeoutError, match="old, more than 0 ms"):
                camera.read_latest(max_age_ms=0)
    assert not any(camera.is_connected for camera in robot.cameras.values())
    hasty = device_of("robot", configured("robot", "trifinger", first_images=0.05, **options))
    with pytest.raises(CameraLost, match=r"of camera60 and camera300 has come in 0\.05 s"):
        hasty.connect()
    assert not hasty.is_connected
    options["cameras"] = cameras(("camera60",), width=108)
    wrong = device_of("robot", configured("robot", "trifinger", **options))
    with pytest.raises(InvalidArgument, match="images of camera60 of seeing have the shape"):
        wrong.connect()


def test_a_camera_works_alone_beside_a_robot_that_somebody_controls(
    plugin: Any, start_program: StartProgram
) -> None:
    from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

    start_seeing(start_program, *PATIENT)
    (found,) = plugin.TrifingerCamera.find_cameras()
    assert (found["type"], found["robot"]) == ("trifinger", "seeing")
    config = cameras(("any",), robot=found["robot"], camera="camera60")["any"]
    camera = plugin.TrifingerCamera(config)
    with pytest.raises(DeviceNotConnectedError, match="call connect"):
        camera.read()
    robot = device_of("robot", configured("robot", "trifinger", robot="seeing"))
    with robot:  # from now on there are steps
        camera.connect()
        with pytest.raises(DeviceAlreadyConnectedError):
            camera.connect()
        first = camera.read()
        assert first.shape == (54, 54, 3)
        assert camera.read() is not first, "the next one"
        camera.disconnect()
    assert not camera.is_connected


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
    from lerobot.utils.errors import (
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
