# SPDX-License-Identifier: BSD-3-Clause
"""Front-ends of robots in other processes, and back-ends that a program starts."""

import copy
import os
import pickle
import select
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import robot_fingers
import robot_fingers.programs
import robot_interfaces
import trifinger
import trifinger_cameras
import trifinger_simulation
import yaml
from backend import new_name, other_robot, running, started
from robot_interfaces.py_trifinger_types import Action, Observation
from trifinger.log import original
from trifinger_cameras import tricamera
from trifinger_compat import robot_data
from trifinger_object_tracking import py_object_tracker, py_tricamera_types
from trifinger_simulation import SimFinger
from trifinger_simulation.camera import load_camera_parameters
from trifinger_simulation.real_finger import RealFinger

HOME = [0, 0.9, -1.7] * 3


@pytest.fixture
def frontend(monkeypatch: pytest.MonkeyPatch) -> Any:
    with running() as name:
        monkeypatch.setenv(robot_data.VARIABLE, name)
        yield robot_fingers.TriFingerPlatformWithObjectFrontend()


def wait_for_recorder(temporary: Path) -> None:
    """Returns when the log of trifinger_data_backend has begun in the folder of temporary files.

    A robot of few actions may end before the recorder, another process, has seen it.
    """
    while not any(temporary.glob("tmp*/*.mcap")):
        time.sleep(0.01)


def test_a_front_end_has_the_rules_of_the_original(frontend: Any) -> None:
    action = frontend.Action(position=HOME)
    for expected in range(200):
        t = frontend.append_desired_action(action)
        assert t == expected
        observation = frontend.get_robot_observation(t)
    assert type(observation) is Observation
    assert observation.position == pytest.approx(HOME, abs=0.3)
    assert np.all((observation.tip_force >= 0) & (observation.tip_force <= 1))
    assert frontend.get_current_timeindex() >= t
    desired, applied = frontend.get_desired_action(t), frontend.get_applied_action(t)
    assert desired.position == pytest.approx(HOME)
    assert np.isnan(desired.position_kp).all()
    assert applied.position_kp == pytest.approx([15, 15, 9] * 3)
    assert applied.position_kd == pytest.approx([0.5, 1, 0.5] * 3)
    assert frontend.get_robot_status(t).error_status == 0
    assert frontend.get_timestamp_ms(t) > frontend.get_timestamp_ms(0) > 1.6e12
    frontend.wait_until_timeindex(t)
    frontend.wait_until_time_index(t)
    with pytest.raises(ValueError, match="negative"):
        frontend.get_robot_observation(-1)


def test_a_simulated_back_end_has_the_limits_of_the_simulator(frontend: Any) -> None:
    wide = [-0.9, 1.7, -2.9] * 3  # beyond the soft limits of the real robot
    # Gains of the simulator, some beyond what the real robot takes.
    action = Action(position=wide, position_kp=[60, 60, 60] * 3, position_kd=[0.5, 1, 0.5] * 3)
    simulated = SimFinger("trifingerpro")
    simulated.reset_finger_positions_and_velocities(HOME)
    for _ in range(100):
        t = frontend.append_desired_action(action)
        simulated.append_desired_action(action)
        frontend.get_robot_observation(t + 1)
    applied, expected = frontend.get_applied_action(t), simulated.get_applied_action(t)
    for name in ("torque", "position", "position_kp", "position_kd"):
        assert getattr(applied, name) == pytest.approx(getattr(expected, name), abs=1e-3), name
    assert applied.position == pytest.approx(wide)


def test_a_simulated_finger_has_the_gains_of_the_simulator() -> None:
    data = robot_interfaces.finger.SingleProcessData()
    backend = robot_fingers.pybullet_drivers.create_single_finger_backend(data, False, False)
    frontend = robot_interfaces.finger.Frontend(data)
    action = robot_interfaces.finger.Action(position=[0, -0.7, -1.5])
    applied = frontend.get_applied_action(frontend.append_desired_action(action))
    assert applied.position_kp == pytest.approx([10, 10, 10])
    assert applied.position_kd == pytest.approx([0.1, 0.3, 0.001])
    backend.request_shutdown()


def test_poses_come_ten_times_per_second_and_90_steps_late(frontend: Any) -> None:
    changes, last = [], None
    for _ in range(300):
        t = frontend.append_desired_action(frontend.Action(position=HOME))
        stamp = frontend.get_camera_observation(t).object_pose.timestamp
        if stamp != last:
            changes.append(t)
        last = stamp
    assert changes == [0, 90, 190, 290]
    pose = frontend.get_camera_observation(t).filtered_object_pose
    assert pose.position == pytest.approx([0, 0, 0.0325], abs=1e-3)
    assert np.abs(pose.orientation) == pytest.approx([0, 0, 0, 1], abs=1e-3)


@pytest.mark.usefixtures("frontend")
def test_a_robot_that_runs_stands_for_a_simulated_finger() -> None:
    finger = RealFinger("trifingerpro", "0")
    assert finger.number_of_fingers == 3
    goal = [0.1, 1.0, -1.6] * 3
    assert finger.reset_finger(goal, 300).position == pytest.approx(goal, abs=0.1)
    t = finger.append_desired_action(finger.Action(position=goal))
    assert finger.get_observation(t).position.shape == (9,)
    with pytest.raises(ValueError, match="Invalid finger type"):
        RealFinger("nothing")


@pytest.mark.slow
def test_images_and_poses_of_a_robot_are_numbered(monkeypatch: pytest.MonkeyPatch) -> None:
    with running("--render-images") as name:
        monkeypatch.setenv(robot_data.VARIABLE, name)
        robot = robot_fingers.TriFingerPlatformFrontend()
        for _ in range(130):
            robot.get_robot_observation(robot.append_desired_action(robot.Action(position=HOME)))
        data = tricamera.MultiProcessData("tricamera", False)
        frontend = py_tricamera_types.Frontend(data)
        newest = frontend.get_current_timeindex()
        seen = frontend.get_observation(newest)
        assert [each.image.shape for each in seen.cameras] == [(540, 540)] * 3
        assert seen.object_pose.position == pytest.approx([0, 0, 0.0325], abs=1e-3)
        assert frontend.get_timestamp_ms(newest) > 1.6e12
        assert frontend.get_latest_observation().cameras[0].timestamp >= seen.cameras[0].timestamp
        require_figures(frontend.get_sensor_info())


def require_figures(info: Any) -> None:
    assert type(info) is tricamera.TriCameraInfo
    parameters = load_camera_parameters(
        trifinger_simulation.get_data_dir() / "camera_params", "camera{id}_cropped.yml"
    )
    for camera, expected in zip(info.camera, parameters, strict=True):
        assert type(camera) is trifinger_cameras.camera.CameraInfo
        assert (camera.image_width, camera.image_height) == (540, 540)
        assert camera.frame_rate_fps == pytest.approx(10)
        assert camera.camera_matrix == pytest.approx(expected.camera_matrix)
        assert camera.distortion_coefficients == pytest.approx(
            expected.distortion_coefficients, abs=1e-9
        )
        assert camera.tf_world_to_camera == pytest.approx(expected.tf_world_to_camera, abs=1e-9)


def test_a_program_takes_images_of_its_robot_and_keeps_them(tmp_path: Path) -> None:
    data = robot_interfaces.trifinger.SingleProcessData()
    robot = robot_fingers.pybullet_drivers.create_trifinger_backend(data, False, False)
    frontend = robot_interfaces.trifinger.Frontend(data)
    frontend.get_observation(frontend.append_desired_action(Action(position=HOME)))
    images = tricamera.SingleProcessData(history_size=100)
    backend = tricamera.Backend(tricamera.PyBulletTriCameraDriver(data), images)
    logger = tricamera.Logger(images, 3)
    logger.start()
    seen = tricamera.Frontend(images).get_observation(2)
    require_figures(tricamera.Frontend(images).get_sensor_info())
    backend.shutdown()
    robot.request_shutdown()
    assert [each.image.shape for each in seen.cameras] == [(540, 540)] * 3
    assert not hasattr(seen, "object_pose")
    assert py_object_tracker.ObjectPose().confidence == 1.0
    logger.stop_and_save(tmp_path / "camera_data.dat")
    logger.stop_and_save_hdf5(tmp_path / "camera_data.hdf5")
    for name in ("camera_data.dat", "camera_data.hdf5"):
        log = tricamera.LogReader(tmp_path / name)
        assert 1 <= len(log.data) <= 3
        assert np.array_equal(log.data[0].cameras[2].image.shape, (540, 540))


def test_images_and_poses_of_a_program_are_kept_for_their_reader(tmp_path: Path) -> None:
    path = tmp_path / "camera_data.dat"
    with own_robot(objects=robot_fingers.programs.CUBE) as data:
        images = tricamera.SingleProcessData()
        driver = py_tricamera_types.PyBulletTriCameraObjectTrackerDriver(None, data)
        backend = py_tricamera_types.Backend(driver, images)
        loggers = [tricamera.Logger(images, 2), py_tricamera_types.Logger(images, 2)]
        readers = [tricamera.LogReader, py_tricamera_types.LogReader]
        for logger in loggers:
            logger.start()
        tricamera.Frontend(images).get_observation(2)
        backend.shutdown()
    for logger, reader in zip(loggers, readers, strict=True):
        logger.stop_and_save(path)
        kept = reader(path).data
        assert 1 <= len(kept) <= 2
        assert hasattr(kept[0], "object_pose") == logger.has_object
    assert kept[0].object_pose.position == pytest.approx([0, 0, 0.0325], abs=1e-3)


@contextmanager
def own_robot(**overrides: object) -> Iterator[Any]:
    """The data of a simulated robot of this program, after its first step."""
    data = robot_interfaces.trifinger.SingleProcessData()
    robot = robot_data.RobotBackend(data, "trifinger_pro", overrides, real_time=False)
    frontend = robot_interfaces.trifinger.Frontend(data)
    frontend.get_observation(frontend.append_desired_action(Action(position=HOME)))
    yield data
    robot.request_shutdown()


def test_cameras_that_fail_say_so_to_all_who_wait(tmp_path: Path) -> None:
    with own_robot(objects="[]") as data:
        images = tricamera.SingleProcessData()
        logger = py_tricamera_types.Logger(images, 2)
        logger.start()
        driver = py_tricamera_types.PyBulletTriCameraObjectTrackerDriver(None, data)
        backend = py_tricamera_types.Backend(driver, images)
        frontend = py_tricamera_types.Frontend(images)
        for wait in (frontend.get_latest_observation, lambda: frontend.get_observation(3)):
            with pytest.raises(RuntimeError, match="no more images come: the robot has no object"):
                wait()
        with pytest.raises(RuntimeError, match=r"logger of images ended after 0: .* no object"):
            logger.stop_and_save(tmp_path / "camera_data.dat")
        assert not (tmp_path / "camera_data.dat").exists()
        backend.shutdown()


def test_a_logger_of_cameras_that_never_began_can_be_stopped(tmp_path: Path) -> None:
    logger = tricamera.Logger(tricamera.SingleProcessData(), 2)
    logger.start()
    logger.stop_and_save(tmp_path / "camera_data.dat")
    assert tricamera.LogReader(tmp_path / "camera_data.dat").data == []


@pytest.mark.slow
def test_images_of_a_robot_without_an_object_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "camera_data.dat"
    with running("--render-images", "--object", "none") as name:
        monkeypatch.setenv(robot_data.VARIABLE, name)
        data = tricamera.MultiProcessData("tricamera", False)
        logger, wrong = tricamera.Logger(data, 1), py_tricamera_types.Logger(data, 1)
        logger.start()
        wrong.start()
        robot = robot_fingers.TriFingerPlatformFrontend()
        for _ in range(130):
            robot.get_robot_observation(robot.append_desired_action(robot.Action(position=HOME)))
        tricamera.Frontend(data).get_observation(0)
        logger.stop_and_save(path)
        assert len(tricamera.LogReader(path).data) == 1
        with pytest.raises(RuntimeError, match="does not know where an object is"):
            wrong.stop_and_save(path)


@pytest.mark.slow
@pytest.mark.usefixtures("frontend")
def test_the_first_name_gives_poses_too() -> None:
    old = robot_fingers.TriFingerPlatformFrontend()
    t = old.append_desired_action(old.Action())
    assert old.get_camera_observation(t).object_pose.position.shape == (3,)


@pytest.mark.slow
@pytest.mark.parametrize(("limit", "status"), [(1000, 0), (1000000, 20)])
def test_the_original_programs_for_data_and_robot_work_together(
    limit: int, status: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, log, ready = new_name(), tmp_path / "robot_data.dat", tmp_path / "ready"
    monkeypatch.setenv(robot_data.VARIABLE, name)
    words = ["--name", name, "--cameras", "-a", str(limit)]
    own = {"TMPDIR": str(tmp_path)}
    data = started("trifinger_data_backend", *words, "--robot-logfile", log, variables=own)
    robot = started(
        "trifinger_robot_backend",
        *(*words, "--config", "trifinger_pro", "--fail-on-incomplete-run"),
        *("--ready-indicator", ready),
    )
    with data, robot:
        assert data.stdout is not None
        assert robot.stdout is not None
        assert data.stdout.readline() == "The robot is ready.\n"
        assert robot.stdout.readline() == "The robot is ready.\n"
        assert ready.is_file()
        wait_for_recorder(tmp_path)
        frontend = robot_fingers.TriFingerPlatformFrontend()
        # The robot repeats this action by itself.
        frontend.append_desired_action(frontend.Action(position=HOME))
        if status != 0:
            frontend.wait_until_timeindex(500)
            robot.terminate()
        assert robot.wait() == status
        assert data.wait() == 0
    read = robot_interfaces.trifinger.BinaryLogReader(log).data
    assert [entry.timeindex for entry in read] == list(range(len(read)))
    assert len(read) >= min(500, limit)


@pytest.mark.slow
def test_a_late_action_is_repeated_whatever_the_configuration_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, config = new_name(), tmp_path / "mine.yml"
    # As in the configurations of real robots.
    text = (Path(__file__).parents[3] / "config" / "trifinger_edu.yml").read_text()
    config.write_text(text.replace("policy: repeat", "policy: stop"))
    monkeypatch.setenv(robot_data.VARIABLE, name)
    with started("trifinger_backend", "--name", name, "--config", config) as robot:
        assert robot.stdout is not None
        assert robot.stdout.readline() == "The robot is ready.\n"
        frontend = robot_fingers.TriFingerPlatformFrontend()
        frontend.append_desired_action(frontend.Action(position=HOME))
        frontend.wait_until_timeindex(300)
        assert frontend.get_robot_status(299).action_repetitions > 100
        robot.terminate()
        robot.wait()


@pytest.mark.parametrize(
    ("program", "words"),
    [("pybullet_backend", ["--cameras"]), ("trifinger_backend", ["--config", "trifinger_pro"])],
)
def test_a_log_of_cameras_needs_cameras(program: str, words: list[str], tmp_path: Path) -> None:
    name, log = new_name(), tmp_path / "camera_data.dat"
    more = ("--name", name, "-a", "60", "--camera-logfile", log)
    with started(program, *words, *more, stderr=subprocess.PIPE) as refused:
        said, errors = refused.communicate()
        assert (refused.returncode, said) == (2, "")
        assert "the robot has no cameras; give --render-images to pybullet_backend" in errors


@pytest.mark.slow
def test_the_data_of_a_robot_without_cameras_has_no_log_of_cameras(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, log = new_name(), tmp_path / "camera_data.dat"
    monkeypatch.setenv(robot_data.VARIABLE, name)
    words = ("trifinger_data_backend", "--name", name, "--camera-logfile", log)
    own = {"TMPDIR": str(tmp_path)}
    with (
        started(*words, stderr=subprocess.PIPE, variables=own) as data,
        started("pybullet_backend", "--name", name, "-a", "20") as robot,
    ):
        assert robot.stdout is not None
        assert robot.stdout.readline() == "The robot is ready.\n"
        wait_for_recorder(tmp_path)
        frontend = robot_fingers.TriFingerPlatformFrontend()
        for _ in range(20):
            frontend.get_robot_observation(frontend.append_desired_action(frontend.Action()))
        assert robot.wait() == 0
        assert f"{log} is not written: the robot has no cameras" in data.communicate()[1]
        assert data.returncode == 1


def test_without_a_robot_there_are_no_logs(tmp_path: Path) -> None:
    words = ["--name", new_name(), "--robot-logfile", tmp_path / "robot_data.dat"]
    with started("trifinger_data_backend", *words) as data:
        assert data.stdout is not None
        data.stdout.readline()
        data.terminate()
        assert data.wait() == 1
    assert not any(tmp_path.glob("*.dat"))


def test_without_a_robot_a_front_end_says_how_to_get_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(robot_data.VARIABLE, "nobody-runs-this")
    with pytest.raises(RuntimeError, match="trifinger run"):
        robot_fingers.TriFingerPlatformFrontend()


def test_a_robot_of_another_type_is_never_controlled(monkeypatch: pytest.MonkeyPatch) -> None:
    with other_robot("dclaw") as name, monkeypatch.context() as patch:
        claw = next(info for info in trifinger.list_sessions() if info.name == name)
        patch.setattr(trifinger, "list_sessions", lambda: [claw])  # the only one that runs
        assert robot_data.session_name("trifinger") == "trifinger"
        patch.setenv(robot_data.VARIABLE, name)
        with pytest.raises(RuntimeError, match=f"'{name}' is of the type 'dclaw', must be 'trif"):
            robot_fingers.TriFingerPlatformFrontend()
        data = robot_interfaces.trifinger.MultiProcessData(name, True)
        for read in (lambda: data.robot, data.controlled):
            with pytest.raises(RuntimeError, match="of the type 'dclaw'"):
                read()
        now = next(info for info in trifinger.list_sessions() if info.name == name)
        assert (now.controller_pid, now.session_id) == (None, claw.session_id)


@pytest.mark.slow
def test_a_back_end_leaves_another_robot_of_its_name_alone() -> None:
    with running() as name:
        data = robot_interfaces.trifinger.MultiProcessData(name, True)
        with pytest.raises(RuntimeError, match=f"'{name}' runs already; .* `trifinger stop"):
            robot_fingers.pybullet_drivers.create_trifinger_backend(data, False, False)
        with started("pybullet_backend", "--name", name) as second:
            assert second.stdout is not None
            assert second.stdout.read() == ""
            assert second.wait() == 1
        assert data.is_available()


@pytest.mark.slow
def test_a_back_end_waits_for_the_robot_that_it_started() -> None:
    class Late(robot_interfaces.trifinger.MultiProcessData):  # type: ignore[name-defined,misc]
        """Another process starts a robot of this name after the first look."""

        looks = 0

        def is_available(self, process: int | None = None) -> bool:
            self.looks += 1
            return self.looks > 1 and bool(super().is_available(process))

    ended = pytest.raises(RuntimeError, match=r"the back-end '.*' ended with the status")
    with running() as name, ended:
        robot_fingers.pybullet_drivers.create_trifinger_backend(Late(name, True), False, False)


def test_whoever_interrupts_the_start_of_a_back_end_leaves_no_robot_behind() -> None:
    class Interrupted(robot_interfaces.trifinger.MultiProcessData):  # type: ignore[name-defined,misc]
        """Ctrl-C comes while the program waits for the robot."""

        process: int | None = None

        def is_available(self, process: int | None = None) -> bool:
            self.process = process
            if process is not None:
                raise KeyboardInterrupt
            return False

    data = Interrupted(new_name(), True)
    with pytest.raises(KeyboardInterrupt):
        robot_fingers.pybullet_drivers.create_trifinger_backend(data, False, False, 1.0, 20)
    assert data.process is not None
    assert not Path(f"/proc/{data.process}").exists()
    assert data.name not in [info.name for info in trifinger.list_sessions()]


def children_of(process: int) -> list[int]:
    text = Path(f"/proc/{process}/task/{process}/children").read_text()
    return [
        child
        for child in map(int, text.split())
        if b"--with-process" in Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
    ]


def wait_for_end(process: int) -> None:
    """Waits until a process has ended, also one that is not our child."""
    with suppress(ProcessLookupError):  # it has ended already
        descriptor = os.pidfd_open(process)
        try:
            select.select([descriptor], [], [])
        finally:
            os.close(descriptor)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_during_the_start_leaves_no_robot_behind(number: int) -> None:
    with started("pybullet_backend", "--name", new_name(), stderr=subprocess.DEVNULL) as process:
        while not (children := children_of(process.pid)):
            time.sleep(0.001)
        process.send_signal(number)
        process.communicate()
    # A child that is just being made ends a moment later than its parent.
    for child in children:
        wait_for_end(child)


def test_a_robot_ends_with_the_program_that_has_started_it() -> None:
    name = new_name()
    with started("pybullet_backend", "--name", name) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "The robot is ready.\n"
        process.kill()
    while name in [info.name for info in trifinger.list_sessions()]:
        time.sleep(0.01)


@pytest.mark.slow
def test_a_limit_of_actions_is_known_whatever_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = new_name()
    monkeypatch.setenv(robot_data.VARIABLE, name)
    monkeypatch.setenv("XDG_RUNTIME_DIR", "/run/user/1000")
    own = {"XDG_RUNTIME_DIR": str(tmp_path), "TMPDIR": str(tmp_path)}
    with started("pybullet_backend", "--name", name, "-a", "20", variables=own) as robot:
        assert robot.stdout is not None
        assert robot.stdout.readline() == "The robot is ready.\n"
        frontend = robot_fingers.TriFingerPlatformFrontend()
        for _ in range(20):
            frontend.append_desired_action(frontend.Action(position=HOME))
        frontend.get_robot_observation(20)
        # The front-end has ended the session itself: the back-end would take one action more.
        with pytest.raises(RuntimeError, match="Maximum number of actions reached"):
            frontend.append_desired_action(frontend.Action())
        assert robot.wait() == 0


@pytest.mark.slow
def test_a_log_that_could_not_be_written_is_refused_at_once(tmp_path: Path) -> None:
    for log in (tmp_path / "none" / "robot_data.dat", tmp_path):
        words = ["--name", new_name(), "-a", "20", "--robot-logfile", log]
        for program in ("pybullet_backend", "trifinger_data_backend"):
            with started(program, *words, stderr=subprocess.PIPE) as refused:
                said, errors = refused.communicate()
                assert (refused.returncode, said) == (2, "")
                assert f"the log {log} cannot be written: " in errors


@pytest.mark.slow
def test_a_run_whose_log_cannot_be_written_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, folder, temporary = new_name(), tmp_path / "logs", tmp_path / "temporary"
    folder.mkdir()
    temporary.mkdir()
    monkeypatch.setenv(robot_data.VARIABLE, name)
    words = ["--name", name, "-a", "20", "--robot-logfile", folder / "robot_data.dat"]
    own = {"TMPDIR": str(temporary)}
    with started("pybullet_backend", *words, stderr=subprocess.PIPE, variables=own) as robot:
        assert robot.stdout is not None
        assert robot.stdout.readline() == "The robot is ready.\n"
        folder.rmdir()
        frontend = robot_fingers.TriFingerPlatformFrontend()
        for _ in range(20):
            frontend.get_robot_observation(frontend.append_desired_action(frontend.Action()))
        errors = robot.communicate()[1]
        assert robot.returncode == 1
    (kept,) = temporary.iterdir()
    assert f"kept in {kept}; `trifinger log export {kept} --format original" in errors
    (path,) = original.export(trifinger.Log(kept).session(name), tmp_path)
    assert len(robot_interfaces.trifinger.BinaryLogReader(path).data) == 20


def test_the_one_robot_of_the_type_is_found_among_others(monkeypatch: pytest.MonkeyPatch) -> None:
    with other_robot("dclaw") as claw, running() as name:
        names = {claw, name}
        sessions = [info for info in trifinger.list_sessions() if info.name in names]
        with monkeypatch.context() as patch:
            patch.setattr(trifinger, "list_sessions", lambda: sessions)
            assert robot_data.session_name("trifinger") == name
            assert robot_data.session_name("finger") == "finger"


def test_a_robot_by_its_name_is_that_of_the_configuration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    robot = robot_fingers.Robot.create_by_name("fingerone")
    assert "'fingerone' is simulated: TRIFINGER_COMPAT_CONFIG" in capfd.readouterr().err
    robot.backend.request_shutdown()
    config = tmp_path / "mine.yml"
    config.write_text(
        "extends: finger_one.yml\nname: mine\nfingers:\n"
        "  {height: 0.34, initial_position: [0, 0.1, -0.2], soft_tips: true}\n"
    )
    monkeypatch.setenv("TRIFINGER_COMPAT_CONFIG", str(config))
    robot = robot_fingers.Robot.create_by_name("fingerone")
    assert "simulated" not in capfd.readouterr().err
    t = robot.frontend.append_desired_action(robot.Action())
    assert robot.frontend.get_observation(t).position == pytest.approx([0, 0.1, -0.2], abs=1e-3)
    robot.backend.request_shutdown()
    with pytest.raises(ValueError, match="Invalid robot 'five'"):
        robot_fingers.Robot.create_by_name("five")


def test_a_robot_of_a_program_takes_so_many_actions_and_no_more() -> None:
    data = robot_interfaces.trifinger.SingleProcessData()
    backend = robot_fingers.pybullet_drivers.create_trifinger_backend(
        data, real_time_mode=False, visualize=False, max_number_of_actions=20
    )
    frontend = robot_interfaces.trifinger.Frontend(data)
    backend.initialize()
    for _ in range(20):
        t = frontend.append_desired_action(Action(position=HOME))
        frontend.get_observation(t)
    assert frontend.get_observation(20).position.shape == (9,)
    assert backend.wait_until_terminated() == 2
    assert backend.get_termination_reason() == 2
    with pytest.raises(RuntimeError, match="Maximum number of actions"):
        frontend.append_desired_action(Action())
    assert data.observation.count_appended_elements() == 21
    assert data.desired_action.newest_timeindex() == 19


def test_a_series_has_the_names_of_the_original() -> None:
    data = robot_interfaces.finger.SingleProcessData()
    backend = robot_fingers.pybullet_drivers.create_single_finger_backend(data, False, False)
    frontend = robot_interfaces.finger.Frontend(data)
    for _ in range(5):
        t = frontend.append_desired_action(robot_interfaces.finger.Action())
        frontend.get_observation(t)
    frontend.wait_until_time_index(t)
    series = data.observation
    assert series.oldest_timeindex() == 0
    assert series.newest_timeindex() >= 4
    assert series.get(3).position.shape == (3,)
    assert series[0].position == pytest.approx([0, -0.7, -1.5], abs=1e-6)
    assert series.wait_for_timeindex(3, 1.0)
    assert not series.wait_for_timeindex(100, 0.01)
    assert not series.is_empty()
    series.tag(2)
    assert series.tagged_timeindex() == 2
    assert series.has_changed_since_tag()
    assert series.timestamp_s(2) == pytest.approx(series.timestamp_ms(2) / 1000)
    with pytest.raises(RuntimeError, match="back-end"):
        series.append(None)
    backend.request_shutdown()
    assert backend.wait_until_terminated() == 1
    assert not backend.is_running()


def test_a_logger_writes_what_a_reader_reads(tmp_path: Path) -> None:
    data = robot_interfaces.trifinger.SingleProcessData()
    backend = robot_fingers.pybullet_drivers.create_trifinger_backend(data, False, False)
    logger = robot_interfaces.trifinger.Logger(data, 1000)
    frontend = robot_interfaces.trifinger.Frontend(data)
    logger.start()
    expected = []
    for i in range(30):
        t = frontend.append_desired_action(Action(torque=[0.01 * i] * 9))
        expected.append(frontend.get_observation(t).position)
    frontend.get_observation(30)
    path = tmp_path / "robot_data.dat"
    logger.stop_and_save(path, logger.Format.BINARY)
    log = robot_interfaces.trifinger.BinaryLogReader(path)
    assert [entry.timeindex for entry in log.data] == list(range(30))
    for entry, position in zip(log.data, expected, strict=True):
        assert np.array_equal(entry.observation.position, position)
    assert log.data[3].desired_action.torque == pytest.approx([0.03] * 9)
    assert log.data[3].status.error_status == 0
    for log_format in (logger.Format.CSV, logger.Format.CSV_GZIP):
        logger.stop_and_save(tmp_path / "log.csv", log_format)
    logger.save_current_robot_data(tmp_path / "now.csv", 5, 10)
    lines = (tmp_path / "now.csv").read_text().splitlines()
    assert len(lines) == 6
    names = lines[0].split(" ")
    assert names[:5] == [
        "#time_index",
        "timestamp",
        "status_action_repetitions",
        "status_error_status",
        "observation_position_0",
    ]
    assert len(names) == 4 + 30 + 72
    assert names[34] == "applied_action_torque_0"
    backend.request_shutdown()


def test_a_logger_writes_a_session_that_has_ended(tmp_path: Path) -> None:
    data = robot_interfaces.trifinger.SingleProcessData()
    backend = robot_fingers.pybullet_drivers.create_trifinger_backend(
        data, False, False, max_number_of_actions=20
    )
    logger = robot_interfaces.trifinger.Logger(data)
    frontend = robot_interfaces.trifinger.Frontend(data)
    for _ in range(20):
        frontend.get_observation(frontend.append_desired_action(Action(position=HOME)))
    backend.wait_until_terminated()
    path = tmp_path / "robot_data.dat"
    logger.save_current_robot_data_binary(path)
    log = robot_interfaces.trifinger.BinaryLogReader(path)
    assert [entry.timeindex for entry in log.data] == list(range(20))


def test_a_logger_writes_a_history_that_is_full_in_real_time(tmp_path: Path) -> None:
    data = robot_interfaces.trifinger.SingleProcessData()
    backend = robot_data.RobotBackend(data, "trifinger_pro", {"backend.history": 50})
    logger = robot_interfaces.trifinger.Logger(data)
    frontend = robot_interfaces.trifinger.Frontend(data)
    frontend.append_desired_action(Action(position=HOME))  # the robot repeats it
    frontend.wait_until_timeindex(200)
    path = tmp_path / "robot_data.dat"
    for _ in range(50):
        logger.save_current_robot_data_binary(path)
        steps = [entry.timeindex for entry in robot_interfaces.trifinger.BinaryLogReader(path).data]
        assert steps == list(range(steps[0], steps[-1] + 1))
    backend.request_shutdown()


def test_actions_have_exactly_so_many_numbers() -> None:
    action = Action(torque=np.arange(9, dtype=np.float32), position=[1] * 9)
    assert action.torque.dtype == np.float64
    action.torque[2] = 7
    assert action.torque[2] == 7
    action.position = range(9)
    assert list(action.position) == list(range(9))
    assert np.isnan(action.position_kp).all()
    for copied in (copy.deepcopy(action), pickle.loads(pickle.dumps(action))):
        assert type(copied) is Action
        assert np.array_equal(copied.torque, action.torque)
        assert copied.torque is not action.torque
    for wrong in ([0] * 8, 0.0, np.zeros((9, 1))):
        with pytest.raises(TypeError):
            Action(torque=wrong)
    with pytest.raises(TypeError):
        action.position = [0] * 10
    assert robot_interfaces.solo_eight.Action().torque.shape == (8,)
    assert robot_interfaces.one_joint.Observation().position.shape == (1,)
    assert not hasattr(robot_interfaces.two_joint.Observation(), "tip_force")


def test_a_status_keeps_its_first_error() -> None:
    status = robot_interfaces.Status()
    assert not status.get_error_message()
    status.set_error(status.ErrorStatus.DRIVER_ERROR, "x" * 100)
    status.set_error(status.ErrorStatus.BACKEND_ERROR, "later")
    again = pickle.loads(pickle.dumps(status))
    assert again.error_status == 1
    assert again.get_error_message() == "x" * 62 + "~"
    reasons = robot_interfaces.RobotBackendTerminationReason
    assert [int(reason) for reason in reasons] == [0, 1, 2, -1, -2, -3]


@pytest.mark.parametrize(
    ("fault_code", "error"),
    # Clean ends, faults of the back-end, the driver's own, and one of the back-end that came later.
    [(0, 0), (5, 0), (16, 2), (20, 2), (21, 1), (22, 1), (23, 2)],
)
def test_a_fault_of_the_driver_is_its_own(fault_code: int, error: int) -> None:
    status = robot_data.to_status({"fault_code": fault_code, "action_repeats": 3})
    assert (status.error_status, status.action_repetitions) == (error, 3)
    assert original.error_status_of(np.array([0, fault_code])).tolist() == [0, error]


def test_ways_of_least_jerk_end_before_the_end() -> None:
    way = list(robot_fingers.utils.min_jerk_trajectory([0, 1], [1, 3], 4))
    assert len(way) == 4
    assert way[0] == pytest.approx([0, 1])
    assert way[2] == pytest.approx([0.5, 2])
    with pytest.raises(ValueError, match="at least 1"):
        robot_fingers.utils.min_jerk_trajectory([0], [1], 0)


CONFIGURATION = """\
# A robot of three fingers.
can_ports: ["can0", "can1", "can2", "can3", "can4", "can5"]
max_current_A: 2.0
has_endstop: true
calibration:
    endstop_search_torques_Nm: [-0.22, -0.22, 0.2,
        -0.22, -0.22, 0.2, -0.22, -0.22, 0.2]
    move_steps: 500
move_to_position_tolerance_rad: 0.05
safety_kd: [0.09, 0.09, 0.05]
position_control_gains:
    kp: [15, 15, 9]
    kd: [0.5, 1, 0.5]
hard_position_limits_lower: [-0.33, 0.0, -2.7]
hard_position_limits_upper: [1.0, 1.57, 0.0]
soft_position_limits_lower: [-.inf, -.inf, -.inf]
soft_position_limits_upper: [.inf, .inf, .inf]
home_offset_rad: [0.1, 0.2, 0.3]
initial_position_rad: [0, 0.9, -1.7]
shutdown_trajectory:
    - target_position_rad: [0, 0.9, -2.0]
      move_steps: 3000
    - target_position_rad: [0, 1.3, -2.4]
      move_steps: 500
"""


# A configuration as a person writes it, and as PyYAML writes what it has read.
STYLES: dict[str, Callable[[str], str]] = {
    "written": str,
    "blocks": lambda text: str(yaml.dump(yaml.safe_load(text), default_flow_style=False)),
    "brackets": lambda text: str(yaml.dump(yaml.safe_load(text), default_flow_style=True)),
}


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("name", ["TriFingerConfig", "FingerConfig", "SoloEightConfig"])
def test_configurations_of_the_original_are_read(
    name: str, style: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "robot.yml"
    path.write_text(STYLES[style](CONFIGURATION))
    config = getattr(robot_fingers, name).load_config(path)
    assert config.can_ports == [f"can{i}" for i in range(6)]
    assert (config.max_current_A, config.has_endstop) == (2.0, True)
    assert config.calibration.endstop_search_torques_Nm == [-0.22, -0.22, 0.2] * 3
    assert config.calibration.move_steps == 500
    assert config.move_to_position_tolerance_rad == 0.05
    assert config.safety_kd == [0.09, 0.09, 0.05]
    assert config.position_control_gains.kp == [15, 15, 9]
    assert config.position_control_gains.kd == [0.5, 1, 0.5]
    assert config.soft_position_limits_lower == [-np.inf] * 3
    assert config.soft_position_limits_upper == [np.inf] * 3
    assert config.home_offset_rad == [0.1, 0.2, 0.3]
    assert config.initial_position_rad == [0, 0.9, -1.7]
    steps = [(one.target_position_rad, one.move_steps) for one in config.shutdown_trajectory]
    assert steps == [([0, 0.9, -2.0], 3000), ([0, 1.3, -2.4], 500)]
    assert config.is_within_hard_position_limits([0, 0.9, -1.7])
    assert not config.is_within_hard_position_limits([0, 1.6, -1.7])
    config.print()
    assert "move_to_position_tolerance_rad: 0.05\n" in capsys.readouterr().out
    with pytest.raises(NotImplementedError, match="coming_from_the_original"):
        robot_fingers.create_trifinger_backend(
            robot_interfaces.trifinger.SingleProcessData(), str(path)
        )
    path.write_text("calibration: [")
    for wrong in (path, tmp_path / "missing.yml"):
        with pytest.raises(RuntimeError, match="cannot read the configuration"):
            robot_fingers.TriFingerConfig.load_config(wrong)
