# SPDX-License-Identifier: BSD-3-Clause
"""The robot with its cameras, live and in logs."""

from pathlib import Path
from typing import Any

import numpy as np
import robot_interfaces
from robot_interfaces.py_generic import Status
from robot_interfaces.py_trifinger_types import Action as _Action
from trifinger.errors import SessionNotFound
from trifinger_cameras import py_tricamera_types
from trifinger_compat.camera_series import RobotCameras
from trifinger_compat.types import ActionLike
from trifinger_object_tracking import py_tricamera_types as py_tricamera_object_types


class TriFingerPlatformFrontend:
    """Controls the robot that runs as "trifinger" and reads what it and its cameras measure.

    Until 2021 this also gave the pose of the object. It does so here if the robot knows one.
    """

    Action = _Action
    _needs_object = False

    def __init__(self) -> None:
        """Raises RuntimeError if no robot runs."""
        self._data = robot_interfaces.trifinger.MultiProcessData("trifinger", False)
        self._frontend = robot_interfaces.trifinger.Frontend(self._data)
        self._cameras_of: Any = None
        self._cameras: RobotCameras | None = None

    def append_desired_action(self, desired_action: ActionLike) -> int:
        """Appends an action and returns the step at which it will act; RuntimeError at the end."""
        return self._frontend.append_desired_action(desired_action)

    def get_robot_observation(self, t: int) -> Any:
        """Measurements of step `t`; waits for them. ValueError if they were overwritten."""
        return self._frontend.get_observation(t)

    def get_camera_observation(self, t: int) -> Any:
        """The newest that had come from the cameras at step `t`; waits for that step."""
        robot = self._data.robot
        if self._cameras is None or self._cameras_of is not robot:
            self._cameras = self._look(robot)
            self._cameras_of = robot
        return self._cameras.at(t)

    def _look(self, robot: Any) -> RobotCameras:
        if self._needs_object:
            return RobotCameras(robot, has_object=True)
        try:
            return RobotCameras(robot, has_object=True)
        except (RuntimeError, SessionNotFound):
            return RobotCameras(robot, has_object=False)

    def get_desired_action(self, t: int) -> Any:
        """The action that was asked for in step `t`; waits for it."""
        return self._frontend.get_desired_action(t)

    def get_applied_action(self, t: int) -> Any:
        """The action that acted in step `t`; waits for it."""
        return self._frontend.get_applied_action(t)

    def get_robot_status(self, t: int) -> Status:
        """The status of step `t`; waits for it."""
        return self._frontend.get_status(t)

    def get_timestamp_ms(self, t: int) -> float:
        """When step `t` was measured, since 1970 [ms]; waits for it."""
        return self._frontend.get_timestamp_ms(t)

    def wait_until_timeindex(self, t: int) -> None:
        """Waits until step `t` was measured."""
        self._frontend.wait_until_timeindex(t)

    wait_until_time_index = wait_until_timeindex

    def get_current_timeindex(self) -> int:
        """The newest step; waits for the first one."""
        return self._frontend.get_current_timeindex()


class TriFingerPlatformWithObjectFrontend(TriFingerPlatformFrontend):
    """The same with the pose of the object, which the robot must know."""

    _needs_object = True


class TriFingerPlatformLog:
    """A run in the files of the robot and of its cameras.

    Until 2021 this also gave the pose of the object. It does so here if the log has poses.
    """

    _readers: tuple[Any, ...] = (
        py_tricamera_types.LogReader,
        py_tricamera_object_types.LogReader,
    )

    def __init__(self, robot_log_file: str | Path, camera_log_file: str | Path) -> None:
        """Raises RuntimeError for a log that is empty, damaged or has gaps."""
        self._robot = robot_interfaces.trifinger.BinaryLogReader(robot_log_file)
        self._camera = self._read_camera_log(camera_log_file)
        entries = self._robot.data
        if not entries:
            raise RuntimeError(f"the log {robot_log_file} is empty")
        indices = np.array([entry.timeindex for entry in entries])
        if np.any(np.diff(indices) != 1):
            raise RuntimeError(f"steps are missing in the log {robot_log_file}")
        self._first = int(indices[0])
        stamps = np.array([entry.timestamp * 1000 for entry in entries])
        # Of each robot step the images that were the newest then.
        newest = np.searchsorted(np.array(self._camera.timestamps), stamps, side="right") - 1
        self._map: list[int] = newest.tolist()

    def _read_camera_log(self, path: str | Path) -> Any:
        errors = []
        for reader in self._readers:
            try:
                return reader(path)
            except RuntimeError as error:
                errors.append(error)
        raise errors[0]

    def _entry(self, t: int) -> Any:
        if not self._first <= t <= self.get_last_timeindex():
            raise IndexError(
                f"the log has the steps {self._first} to {self.get_last_timeindex()}, not {t}"
            )
        return self._robot.data[t - self._first]

    def get_first_timeindex(self) -> int:
        """The first step of the log."""
        return self._first

    def get_last_timeindex(self) -> int:
        """The last step of the log."""
        return self._first + len(self._robot.data) - 1

    def get_robot_observation(self, t: int) -> Any:
        """Measurements of step `t`; IndexError if the log does not have it."""
        return self._entry(t).observation

    def get_camera_observation(self, t: int) -> Any:
        """The newest that had come from the cameras at step `t`; IndexError if there was none."""
        self._entry(t)
        index = self._map[t - self._first]
        if index < 0:
            raise IndexError(f"step {t} is before the first image")
        return self._camera.data[index]

    def get_desired_action(self, t: int) -> Any:
        """The action that was asked for in step `t`."""
        return self._entry(t).desired_action

    def get_applied_action(self, t: int) -> Any:
        """The action that acted in step `t`."""
        return self._entry(t).applied_action

    def get_robot_status(self, t: int) -> Status:
        """The status of step `t`."""
        status: Status = self._entry(t).status
        return status

    def get_timestamp_ms(self, t: int) -> float:
        """When step `t` was measured, since 1970 [ms]."""
        return float(self._entry(t).timestamp * 1000)

    def get_robot_log(self) -> Any:
        """The reader of the robot's file."""
        return self._robot

    def get_camera_log(self) -> Any:
        """The reader of the cameras' file."""
        return self._camera

    def get_map_robot_to_camera_index(self) -> list[int]:
        """Of each robot step the number of the images that were the newest then; -1: none yet."""
        return self._map


class TriFingerPlatformWithObjectLog(TriFingerPlatformLog):
    """The same with the pose of the object, which the log must have."""

    _readers = (py_tricamera_object_types.LogReader,)
