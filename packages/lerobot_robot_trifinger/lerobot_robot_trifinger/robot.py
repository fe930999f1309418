# SPDX-License-Identifier: BSD-3-Clause
"""A robot behind a back-end of TriFinger, for LeRobot."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import Any

import numpy as np
import trifinger
from lerobot.cameras import Camera, CameraConfig, make_cameras_from_configs
from lerobot.robots import Robot
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError
from trifinger.cameras import Cameras
from trifinger.errors import CameraLost, Error, InvalidArgument

from lerobot_robot_trifinger.camera import TrifingerCamera
from lerobot_robot_trifinger.config_trifinger import TrifingerCameraConfig, TrifingerRobotConfig
from lerobot_robot_trifinger.numbers import check_fields, fields_of, names_of, numbers_of


class TrifingerRobot(Robot):
    """Observations are the newest ones; an action stays until the next one."""

    config_class = TrifingerRobotConfig
    name = "trifinger"

    def __init__(self, config: TrifingerRobotConfig) -> None:
        super().__init__(config)
        self.config = config
        if config.fps < 1 or config.burst < 1:
            raise InvalidArgument(
                f"fps is {config.fps} and burst is {config.burst}; both must be at least 1"
            )
        if not config.first_images >= 0:
            raise InvalidArgument(f"first_images is {config.first_images}, must be at least 0")
        self.cameras: dict[str, Camera] = make_cameras_from_configs(
            {name: self._named(name, camera) for name, camera in config.cameras.items()}
        )
        """The cameras by name. LeRobot counts them for the threads that write images."""
        # Those whose images are in the session of the robot.
        self._own_cameras = {
            name: camera
            for name, camera in self.cameras.items()
            if isinstance(camera, TrifingerCamera) and camera.config.robot == config.robot
        }
        self._robot: trifinger.Frontend | None = None
        self._seen: trifinger.Frontend | None = None
        self._session_cameras: Cameras | None = None
        self._feeder: _Feeder | None = None

    @property
    def observation_features(self) -> dict[str, Any]:
        """What get_observation returns: `float` for a number, (height, width, 3) for an image."""
        numbers: dict[str, Any] = dict.fromkeys(names_of(self.config.observation_fields), float)
        return numbers | {
            name: (camera.height, camera.width, 3) for name, camera in self.cameras.items()
        }

    @property
    def action_features(self) -> dict[str, Any]:
        """What send_action takes."""
        return dict.fromkeys(names_of(self.config.action_fields), float)

    @property
    def is_connected(self) -> bool:
        """True from connect() to disconnect()."""
        return self._robot is not None

    @property
    def is_calibrated(self) -> bool:
        """True: the back-end has calibrated the robot before it runs."""
        return True

    def connect(self, calibrate: bool = True) -> None:  # noqa: ARG002
        """Takes control of the robot, which holds its pose.

        Returns when the first step has an observation and each camera has sent an image. Raises
        what `trifinger.connect` raises; InvalidArgument if the robot has other fields or cameras
        than the configuration says; CameraLost if a camera has sent no image in `first_images`.
        """
        if self.is_connected:
            raise DeviceAlreadyConnectedError(f"{self} is connected already")
        robot = trifinger.connect(self.config.robot)
        try:
            check_fields(
                "observation_fields", self.config.observation_fields, robot.observation_dtype
            )
            check_fields("action_fields", self.config.action_fields, robot.action_dtype)
            self._seen = trifinger.observe(self.config.robot)
            first = robot.latest_observation()
            action = robot.new_action()
            if "position" in self.config.action_fields and "position" in (first.dtype.names or ()):
                action = robot.new_action(position=first["position"])
            if self._own_cameras:
                self._session_cameras = Cameras(self._seen)
                for own in self._own_cameras.values():
                    own.attach(self._seen, self._session_cameras)
            for camera in self.cameras.values():
                if not camera.is_connected:
                    camera.connect()
            if robot.session_info().is_real_time:
                self._feeder = _Feeder(robot, action, self.config.burst)
                # Until then there is no step that could be read.
                robot.wait_until_time_index(0)
            else:
                robot.wait_until_time_index(robot.append_desired_action(action))
            self._wait_for_images(robot, action)
            self._robot = robot
        except BaseException:
            if self._feeder is not None:
                self._feeder.stop()
            self._disconnect_cameras()
            if self._seen is not None:
                self._seen.close()
            self._feeder = self._seen = self._session_cameras = None
            robot.close()
            raise

    def calibrate(self) -> None:
        """Does nothing: see `is_calibrated`."""

    def configure(self) -> None:
        """Does nothing: the back-end has the configuration."""

    def get_observation(self) -> dict[str, Any]:
        """The newest observation, and of each camera the newest good image.

        Raises RobotStopped if the robot has stopped.
        """
        robot, seen = self._connected()
        if robot.fault() is not None:
            seen.get_observation(seen.current_time_index() + 1)  # raises with the reason
        observation: dict[str, Any] = numbers_of(
            seen.latest_observation(), self.config.observation_fields
        )
        self._look(seen)
        for name, camera in self.cameras.items():
            own = self._own_cameras.get(name)
            observation[name] = camera.read_latest() if own is None else own.image
        return observation

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Lets the robot do `action` until the next one comes; returns what it was asked for.

        What is applied in the end is in the robot's log: the safety chain may change it.
        Raises InvalidArgument for other numbers than `action_features` says; RobotStopped.
        """
        robot, _ = self._connected()
        wanted = robot.new_action(**fields_of(action, self.config.action_fields))
        if self._feeder is not None:
            self._feeder.replace(wanted)
        else:
            self._do(robot, wanted)
        return numbers_of(wanted, self.config.action_fields)

    def disconnect(self) -> None:
        """Ends the session: the back-end brings the robot to rest."""
        robot, seen = self._connected()
        self._robot = self._seen = self._session_cameras = None
        try:
            if self._feeder is not None:
                self._feeder.stop()
            if robot.fault() is None:
                robot.finish()
        finally:
            self._feeder = None
            self._disconnect_cameras()
            seen.close()
            robot.close()

    def _do(self, robot: trifinger.Frontend, action: trifinger.Action) -> None:
        """Without real time: lets the robot do an action for as long as a frame lasts."""
        steps = max(1, round(1 / (self.config.fps * robot.session_info().period)))
        actions = np.repeat(np.array([action]), steps)
        robot.wait_until_time_index(robot.append_desired_actions(actions) + 1)

    def _wait_for_images(self, robot: trifinger.Frontend, action: trifinger.Action) -> None:
        """Waits for the first image of each camera; without real time the robot does `action`."""
        if self._seen is None:
            return
        period = robot.session_info().period
        last = self._seen.current_time_index() + round(self.config.first_images / period)
        while missing := self._look(self._seen):
            step = self._seen.current_time_index()
            if step >= last:
                raise CameraLost(
                    f"no image of {' and '.join(missing)} has come in "
                    f"{self.config.first_images:g} s (first_images)"
                )
            if self._feeder is None:
                self._do(robot, action)
            else:
                robot.wait_until_time_index(step + 1)

    def _look(self, seen: trifinger.Frontend) -> list[str]:
        """Shows the newest images to all cameras of the robot. Returns those that have none."""
        images = None
        if self._session_cameras is not None:
            images = self._session_cameras.get_latest_at(seen.current_time_index())
        return [name for name, camera in self._own_cameras.items() if not camera.look(images)]

    def _named(self, name: str, camera: CameraConfig) -> CameraConfig:
        """The configuration of a camera, which usually belongs to this robot and has its name."""
        if not isinstance(camera, TrifingerCameraConfig):
            return camera
        return replace(
            camera, robot=camera.robot or self.config.robot, camera=camera.camera or name
        )

    def _disconnect_cameras(self) -> None:
        for camera in self.cameras.values():
            if camera.is_connected:
                camera.disconnect()

    def _connected(self) -> tuple[trifinger.Frontend, trifinger.Frontend]:
        if self._robot is None or self._seen is None:
            raise DeviceNotConnectedError(f"{self} is not connected: call connect() first")
        return self._robot, self._seen


class _Feeder:
    """A thread that appends the present action again and again, in real time."""

    def __init__(self, robot: trifinger.Frontend, action: trifinger.Action, burst: int) -> None:
        self._robot = robot
        self._action = action
        self._burst = burst
        self._error: Error | None = None
        self._is_stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="trifinger feeder", daemon=True)
        self._thread.start()

    def replace(self, action: trifinger.Action) -> None:
        """Changes the action. Raises what has ended the thread."""
        if self._error is not None:
            raise self._error
        self._action = action

    def stop(self) -> None:
        """Ends the thread."""
        self._is_stopping.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            while not self._is_stopping.is_set():
                actions = np.repeat(np.array([self._action]), self._burst)
                last = self._robot.append_desired_actions(actions)
                # When the first of them acts, there is time for the next ones.
                self._robot.wait_until_time_index(last - self._burst + 1)
        except Error as error:
            self._error = error
