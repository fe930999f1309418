# SPDX-License-Identifier: BSD-3-Clause
"""What cameras and trackers saw, live and in logs, by the original's names and rules."""

import re
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import trifinger
from trifinger.cameras import Cameras
from trifinger.errors import CameraLost, HistoryLost, InvalidArgument
from trifinger.log.original import CameraEntry, read_camera_log
from trifinger_simulation.trifinger_platform import (
    ObjectPose,
    TriCameraObjectObservation,
    TriCameraObservation,
)

from trifinger_compat import camera_files, camera_hdf5
from trifinger_compat.camera_info import TriCameraInfo, info_of
from trifinger_compat.clock import SINCE_1970
from trifinger_compat.robot_data import session_name
from trifinger_compat.types import Array

WAIT = 0.002  # between two looks for something that has not come yet [s]


def to_pose(numbers: Array) -> ObjectPose:
    """The pose of x, y, z, quaternion x, y, z, w, confidence."""
    pose = ObjectPose()
    pose.position = np.array(numbers[:3])
    pose.orientation = np.array(numbers[3:7])
    pose.confidence = float(numbers[7])
    return pose


def from_pose(pose: ObjectPose) -> Array:
    """The inverse of to_pose()."""
    return np.array([*pose.position, *pose.orientation, pose.confidence])


class RobotCameras:
    """What a running robot knows from its cameras, at the robot's steps."""

    def __init__(self, robot: trifinger.Frontend, *, has_object: bool) -> None:
        """A robot without cameras gives observations without images."""
        self._robot = robot
        self._has_object = has_object
        self._cameras = self._find_cameras()
        self._objects: trifinger.Frontend | None = None
        self._object_name = ""
        if has_object:
            try:
                self._objects = robot.companion("object")
            except trifinger.SessionNotFound as error:
                raise RuntimeError(
                    f"the robot '{robot.session_info().name}' does not know where an object is: "
                    "its configuration has none"
                ) from error
            names = self._objects.observation_dtype.names or ()
            self._object_name = next(name for name in names if name != "stamp")

    def _find_cameras(self) -> Cameras | None:
        try:
            return Cameras(self._robot)
        except (InvalidArgument, trifinger.SessionNotFound):
            return None

    def at(self, t: int) -> Any:
        """The newest observation that had arrived at step `t`; waits for it."""
        images = self._images_at(t)
        observation: Any
        if self._objects is not None:
            element = _wait_for(self._objects, t)
            observation = TriCameraObjectObservation()
            pose = self._pose_of(element)
            observation.object_pose = pose
            observation.filtered_object_pose = self._pose_of(element)
            seconds = pose.timestamp
        else:
            observation = TriCameraObservation()
            seconds = 0.0
        for number, each in enumerate(observation.cameras):
            each.timestamp = seconds
            if images is None:
                continue
            name = images.names[number]
            each.timestamp = images.frame(name).time + SINCE_1970
            try:
                each.image = images.raw(name)
            except (CameraLost, HistoryLost):
                each.image = None
        return observation

    def _images_at(self, t: int) -> Any:
        if self._cameras is None:
            return None
        _wait_for(self._cameras.companion, t)
        return self._cameras.get_latest_at(t)

    def _pose_of(self, element: Any) -> ObjectPose:
        pose = ObjectPose()
        found = element[self._object_name]
        w, x, y, z = found["orientation"]
        pose.position = np.array(found["position"])
        pose.orientation = np.array([x, y, z, w])
        pose.timestamp = float(element["stamp"]["capture_time"]) * 1e-9 + SINCE_1970
        return pose


def _wait_for(companion: trifinger.Frontend, t: int) -> Any:
    """The newest element at step `t`; waits for the first one, then raises if `t` is older."""
    element = companion.get_latest_at(t)
    while element is None:
        if companion.range("observation")[1] > 0:
            raise ValueError(f"nothing was seen yet at step {t}")
        time.sleep(WAIT)
        element = companion.get_latest_at(t)
    return element


class TriCameraFrontend:
    """Reads the images of a running robot by their own numbers."""

    has_object = False

    def __init__(self, camera_data: Any) -> None:
        self._data = camera_data

    def get_latest_observation(self) -> Any:
        """The newest images; waits for the first ones."""
        return self._data.element(self.get_current_timeindex(), self.has_object)[1]

    def get_observation(self, t: int) -> Any:
        """The images number `t`; waits for them. ValueError if they are lost."""
        return self._data.element(t, self.has_object)[1]

    def get_timestamp_ms(self, t: int) -> float:
        """When images number `t` arrived, since 1970 [ms]; waits for them."""
        stamp: float = self._data.element(t, self.has_object)[0]
        return stamp

    def get_current_timeindex(self) -> int:
        """The number of the newest images; waits for the first ones."""
        newest: int = self._data.newest()
        return newest

    def get_sensor_info(self) -> TriCameraInfo:
        """What is known about the cameras."""
        info: TriCameraInfo = self._data.info()
        return info


class LogReaderBase:
    """Reads a log of three cameras; `data` is a list of observations, `timestamps` in ms."""

    has_object = False

    def __init__(self, filename: str | Path | None = None) -> None:
        """Raises RuntimeError if there is no such log."""
        self.data: list[Any] = []
        self.timestamps: list[float] = []
        if filename is not None:
            self.read_file(filename)

    def read_file(self, filename: str | Path) -> None:
        """Reads a file in place of what was read before; raises RuntimeError."""
        self.data, self.timestamps = [], []
        for entry in self._entries(filename):
            self.timestamps.append(entry.stamp)
            self.data.append(self._observation(entry))

    def _entries(self, filename: str | Path) -> Iterable[CameraEntry]:
        if not camera_hdf5.is_hdf5(filename):
            return read_camera_log(filename, has_object=self.has_object)
        if self.has_object:
            raise RuntimeError(
                f"{filename} is HDF5, which has no poses; read it with "
                "trifinger_cameras.tricamera.LogReader"
            )
        return camera_hdf5.read(filename)

    def _observation(self, entry: CameraEntry) -> Any:
        observation: Any = (
            TriCameraObjectObservation() if self.has_object else TriCameraObservation()
        )
        for each, image, seconds in zip(
            observation.cameras, entry.images, entry.times, strict=True
        ):
            each.image, each.timestamp = image, seconds
        if self.has_object:
            observation.object_pose = to_pose(entry.poses[0])
            observation.filtered_object_pose = to_pose(entry.poses[1])
        return observation


def to_entry(stamp: float, observation: Any, *, has_object: bool) -> CameraEntry:
    """The element of a log for an observation that arrived at `stamp` [ms], with poses or not."""
    poses = []
    if has_object:
        poses = [from_pose(observation.object_pose), from_pose(observation.filtered_object_pose)]
    cameras = observation.cameras
    return CameraEntry(
        stamp, [each.image for each in cameras], [each.timestamp for each in cameras], poses
    )


class RunningCameras:
    """The cameras of a running robot, numbered as its companion numbers its elements."""

    def __init__(
        self,
        shared_memory_id_prefix: str = "tricamera",
        is_master: bool = False,
        history_size: int = 1000,
    ) -> None:
        del shared_memory_id_prefix, is_master  # the robot has one set of cameras
        self.history_size = history_size
        self._robot = trifinger.observe(session_name("trifinger"))
        self._cameras = Cameras(self._robot)
        self._companion = self._cameras.companion
        self._robot_cameras: dict[bool, RobotCameras] = {}  # with and without objects

    def range(self) -> tuple[int, int]:
        """The first number that can be read, and the one after the newest."""
        return self._companion.range("observation")

    def has(self, t: int) -> bool:
        """True if images number `t` have come."""
        return self.range()[1] > t

    def newest(self) -> int:
        """The number of the newest images; waits for the first ones."""
        while (end := self.range()[1]) == 0:
            time.sleep(WAIT)
        return end - 1

    def element(self, t: int, has_object: bool) -> tuple[float, Any]:
        """Time of arrival [ms] and observation number `t`."""
        try:
            element = self._companion.get_observation(t)
        except HistoryLost as error:
            raise ValueError(str(error)) from error
        step = int(element["stamp"]["arrival_index"])
        if has_object not in self._robot_cameras:
            self._robot_cameras[has_object] = RobotCameras(self._robot, has_object=has_object)
        stamp = float(element["stamp"]["arrival_time"]) * 1e-9 + SINCE_1970
        return stamp * 1000, self._robot_cameras[has_object].at(max(step, 0))

    def info(self) -> TriCameraInfo:
        """What calibration says of the cameras, and their rate."""
        calibration = camera_files.calibration(self._cameras.calibration)
        configuration = self._robot.documents()["configuration.yml"]
        rate = re.search(r"^cameras:\n(?:  .*\n)*?  rate: (\S+)$", configuration, re.MULTILINE)
        return info_of(calibration, float(rate[1]) if rate is not None else 0.0)
