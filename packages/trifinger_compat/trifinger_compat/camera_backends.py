# SPDX-License-Identifier: BSD-3-Clause
"""Cameras that a program runs itself, and loggers of images.

Cameras of a robot belong to its own processes here: `trifinger cameras` and `trifinger track`.
What a program can run itself are the cameras of a simulated robot.
"""

import threading
import time
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
import trifinger
from trifinger.errors import Error
from trifinger.log.original import CameraEntry, write_camera_log
from trifinger_simulation.trifinger_platform import (
    ObjectPose,
    TriCameraObjectObservation,
    TriCameraObservation,
)

from trifinger_compat import camera_files, camera_hdf5, camera_series
from trifinger_compat.camera_info import TriCameraInfo, info_of
from trifinger_compat.keeper import Keeper
from trifinger_compat.robot_data import BaseData
from trifinger_compat.types import wxyz

RATE = 10  # images of each camera per second [Hz]


class SingleProcessCameras:
    """The series of cameras of this process."""

    def __init__(self, history_size: int = 1000, what: str = "images") -> None:
        self.history_size, self._what = history_size, what
        self._elements: deque[tuple[float, Any]] = deque(maxlen=history_size)
        self._changed = threading.Condition()
        self._count = 0
        self._info: TriCameraInfo | None = None
        self._error: BaseException | None = None

    def append(self, observation: Any) -> None:
        """Adds an observation that comes now."""
        with self._changed:
            self._elements.append((time.time() * 1000, observation))
            self._count += 1
            self._changed.notify_all()

    def fail(self, error: BaseException) -> None:
        """Says that no more will come, and why: whoever waits gets an error."""
        with self._changed:
            self._error = error
            self._changed.notify_all()

    def has(self, t: int) -> bool:
        """True if observation number `t` has come; RuntimeError if it will not come."""
        with self._changed:
            if self._count <= t and self._error is not None:
                self._wait_for(t)
            return self._count > t

    def newest(self) -> int:
        """The number of the newest observation; waits for the first one.

        Raises RuntimeError if none will come.
        """
        with self._changed:
            self._wait_for(0)
            return self._count - 1

    def _wait_for(self, t: int) -> None:
        self._changed.wait_for(lambda: self._count > t or self._error is not None)
        if self._count <= t:
            raise RuntimeError(f"no more {self._what} come: {self._error}") from self._error

    def range(self) -> tuple[int, int]:
        """The first number that can be read, and the one after the newest."""
        with self._changed:
            return self._count - len(self._elements), self._count

    def element(self, t: int, has_object: bool = False) -> tuple[float, Any]:
        """Time of arrival [ms] and observation number `t`; waits for it.

        Raises RuntimeError if it will not come, ValueError if it was overwritten.
        """
        del has_object
        with self._changed:
            self._wait_for(t)
            oldest = self._count - len(self._elements)
            if t < oldest:
                raise ValueError(f"observation {t} was overwritten; the oldest one is {oldest}")
            return self._elements[t - oldest]

    def info(self) -> TriCameraInfo:
        """What is known about the cameras; waits for them."""
        with self._changed:
            self._changed.wait_for(lambda: self._info is not None or self._error is not None)
            if self._info is None:
                raise RuntimeError(f"no cameras come: {self._error}") from self._error
            return self._info

    def tell(self, info: TriCameraInfo) -> None:
        """Says what is known about the cameras."""
        with self._changed:
            self._info = info
            self._changed.notify_all()


class _RealDriver:
    """Real cameras; a program cannot open them itself."""

    def __init__(self, *_: Any, **__: Any) -> None:
        raise NotImplementedError(
            "cameras run beside their robot here: `trifinger run ROBOT` starts them, as its "
            "configuration says (docs/cameras.md); read them with a Frontend"
        )


class TriCameraDriver(_RealDriver):
    """Three real cameras."""


class TriCameraObjectTrackerDriver(_RealDriver):
    """Three real cameras and the tracker of the object."""


class PyBulletTriCameraDriver:
    """The cameras of a simulated robot that runs in a back-end. It needs no PyBullet."""

    has_object = False

    def __init__(self, robot_data: BaseData, render_images: bool = True) -> None:
        self._data = robot_data
        self._render = render_images
        self._renderer: trifinger.CameraRenderer | None = None
        self._objects: trifinger.Frontend | None = None
        self._object = ""

    def get_observation(self) -> Any:
        """What the cameras see now; None while nobody knows yet where the object is."""
        robot = self._data.robot
        observation: Any = (
            TriCameraObjectObservation() if self.has_object else TriCameraObservation()
        )
        joints = robot.latest_observation()["position"]
        pose = self._find_object(robot)
        now = time.time()
        for each in observation.cameras:
            each.timestamp = now
        if self.has_object:
            if pose is None:
                return None
            observation.object_pose, observation.filtered_object_pose = pose, pose
        if self._render:
            for each, image in zip(observation.cameras, self._images(joints, pose), strict=True):
                each.image = image
        return observation

    def get_sensor_info(self) -> TriCameraInfo:
        """What is known about the cameras, which are those of the robot's model."""
        return info_of(camera_files.figures(), RATE)

    def _find_object(self, robot: trifinger.Frontend) -> ObjectPose | None:
        if self._objects is None:
            try:
                self._objects = robot.companion("object")
            except trifinger.SessionNotFound as error:
                if not self.has_object:
                    return None
                raise Error("the robot has no object; its configuration needs one") from error
            names = self._objects.observation_dtype.names or ()
            self._object = next(name for name in names if name != "stamp")
        end = self._objects.range("observation")[1]
        if end == 0:
            return None
        found = self._objects.get_observation(end - 1)[self._object]
        pose = ObjectPose()
        w, x, y, z = found["orientation"]
        pose.position = np.array(found["position"])
        pose.orientation = np.array([x, y, z, w])
        pose.timestamp = time.time()
        return pose

    def _images(self, joints: Any, pose: ObjectPose | None) -> list[Any]:
        if self._renderer is None:
            objects: list[dict[str, object]] = []
            if pose is not None:
                objects = [{"name": "cube", "type": "cube"}]
            self._renderer = trifinger.CameraRenderer("trifinger_pro", {"objects": objects})
        parts = [np.asarray(joints, dtype=float)]
        if pose is not None:
            parts += [pose.position, wxyz(pose.orientation)]
        return list(self._renderer.render(np.concatenate(parts), 0))


class PyBulletTriCameraObjectTrackerDriver(PyBulletTriCameraDriver):
    """The same with the pose of the object."""

    has_object = True

    def __init__(
        self, tracked_object: Any, robot_data: BaseData, render_images: bool = True
    ) -> None:
        del tracked_object  # the robot knows its object
        super().__init__(robot_data, render_images)


class CameraBackend:
    """Takes images with a driver, ten times per second, in a thread of its own."""

    def __init__(self, driver: Any, camera_data: SingleProcessCameras) -> None:
        """The images are for this process; those of a running robot are for all."""
        if not isinstance(camera_data, SingleProcessCameras):
            raise NotImplementedError(
                "cameras for several processes belong to the configuration of the robot "
                "(docs/cameras.md); give SingleProcessData for cameras of this process"
            )
        self._driver, self._data = driver, camera_data
        self._is_ending = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._data.tell(self._driver.get_sensor_info())
            while True:
                if (observation := self._driver.get_observation()) is not None:
                    self._data.append(observation)
                if self._is_ending.wait(1 / RATE):
                    return
        except Exception as error:  # those who wait for images get it
            self._data.fail(error)

    def shutdown(self) -> None:
        """Ends the thread."""
        self._is_ending.set()
        self._thread.join()


class CameraLogger(Keeper):
    """Keeps images from start() on, up to a number of them, in memory."""

    has_object = False

    def __init__(self, camera_data: Any, buffer_limit: int) -> None:
        super().__init__()
        self._data, self._limit = camera_data, buffer_limit
        self._elements: list[tuple[float, Any]] = []

    def start(self) -> None:
        """Begins to keep images."""
        self._begin()

    def _keep(self) -> None:
        t = max(0, self._data.range()[1] - 1)
        while len(self._elements) < self._limit:
            # What is there when the end is asked for is kept.
            is_ending = self._is_ending.wait(0.02)
            while len(self._elements) < self._limit and self._data.has(t):
                self._elements.append(self._data.element(t, self.has_object))
                t += 1
            if is_ending:
                return

    def stop(self) -> None:
        """Keeps no more."""
        self._end()

    def reset(self) -> None:
        """Forgets all images and keeps no more."""
        self.stop()
        self._elements = []

    def stop_and_save(self, filename: str | Path) -> None:
        """Stops, and writes what was kept; raises RuntimeError if images could not be kept."""
        entries = self._stopped()
        write_camera_log(filename, len(entries), entries)

    def stop_and_save_hdf5(self, filename: str | Path) -> None:
        """The same as HDF5, without poses. Needs h5py."""
        camera_hdf5.write(filename, self._stopped(), camera_files.NAMES)

    def _stopped(self) -> list[CameraEntry]:
        self.stop()
        if self._error is not None:
            raise RuntimeError(
                f"the logger of images ended after {len(self._elements)}: {self._error}"
            ) from self._error
        return [
            camera_series.to_entry(stamp, observation, has_object=self.has_object)
            for stamp, observation in self._elements
        ]


class CameraObjectLogger(CameraLogger):
    """The same with the poses of the object."""

    has_object = True
