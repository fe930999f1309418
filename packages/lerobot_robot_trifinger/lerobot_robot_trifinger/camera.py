# SPDX-License-Identifier: BSD-3-Clause
"""A camera of a robot behind a back-end of TriFinger, for LeRobot."""

from __future__ import annotations

import contextlib
import time
from typing import Any

import numpy as np
import trifinger
from lerobot.cameras import Camera
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError
from numpy.typing import NDArray
from trifinger.cameras import COMPANION, Cameras, Images
from trifinger.errors import HistoryLost, InvalidArgument

from lerobot_robot_trifinger.config_trifinger import TrifingerCameraConfig


class TrifingerCamera(Camera):
    """Images of a robot's session: it only observes, so who controls the robot is free.

    Cameras of one TrifingerRobot look at the same moment, when the robot's observation is taken.
    """

    config_class = TrifingerCameraConfig

    def __init__(self, config: TrifingerCameraConfig) -> None:
        super().__init__(config)
        self.config = config
        self._seen: trifinger.Frontend | None = None
        self._cameras: Cameras | None = None
        self._is_own = False  # connect() has made them
        self._image: NDArray[np.uint8] | None = None
        self._step = -1  # at which the image was taken
        self._number = -1  # of the image
        self._read = -1  # number of the image that async_read returned last

    def __str__(self) -> str:
        return f"{self.config.camera} of {self.config.robot}"

    @property
    def is_connected(self) -> bool:
        """True from connect() to disconnect(), or as long as its robot is connected."""
        return self._seen is not None

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        """The robots that run here and have cameras."""
        ending = f".{COMPANION}"
        return [
            {"type": "trifinger", "robot": session.name.removesuffix(ending), "id": session.name}
            for session in trifinger.list_sessions()
            if session.is_companion and session.name.endswith(ending) and session.backend_is_alive
        ]

    def connect(self, warmup: bool = True) -> None:
        """Attaches to the robot of the configuration.

        Args:
            warmup: waits for the first image, as long as `first_image` says

        Raises:
            InvalidArgument: if the robot has no such camera, or images of another size
            TimeoutError: if no image came
        """
        if self.is_connected:
            raise DeviceAlreadyConnectedError(f"{self} is connected already")
        seen = trifinger.observe(self.config.robot)
        try:
            self.attach(seen, Cameras(seen))
            self._is_own = True
            if warmup:
                self._wait(after=-1, timeout=self.config.first_image)
        except BaseException:
            self.detach()
            seen.close()
            raise

    def disconnect(self) -> None:
        """Detaches from the robot."""
        seen = self._connected()[0]
        is_own = self._is_own
        self.detach()
        if is_own:
            seen.close()

    def attach(self, seen: trifinger.Frontend, cameras: Cameras) -> None:
        """Looks through the handles of a robot, until detach()."""
        self._seen, self._cameras = seen, cameras

    def detach(self) -> None:
        """Forgets handles and image."""
        self._seen = self._cameras = self._image = None
        self._step = self._number = self._read = -1
        self._is_own = False

    def look(self, images: Images | None) -> bool:
        """Keeps the image if it is good. False if there never was one.

        Raises InvalidArgument for an image of another size than the configuration says.
        """
        if images is not None:
            frame = images.frame(self.config.camera)
            # An image that was overwritten while it was read: a newer one comes soon.
            with contextlib.suppress(HistoryLost):
                if frame.state == "good" and frame.number != self._number:
                    self._image = images[self.config.camera]
                    self._number = frame.number
                    self._step = int(images.element["stamp"]["capture_index"])
        if self._image is None:
            return False
        size = (self.config.height, self.config.width)
        if self._image.shape != (*size, 3):
            raise InvalidArgument(
                f"the images of {self} have the shape {self._image.shape}; its configuration "
                f"says height {size[0]} and width {size[1]}"
            )
        return True

    @property
    def image(self) -> NDArray[np.uint8]:
        """What look() has kept. Nobody changes this array: LeRobot's threads may still read it.

        Raises RuntimeError before the first image.
        """
        if self._image is None:
            raise RuntimeError(f"no image of {self} has come yet")
        return self._image

    def read(self) -> NDArray[np.uint8]:
        """The next image, for which it waits as long as `first_image` says."""
        self._look_now()
        return self._wait(after=self._number, timeout=self.config.first_image)

    def async_read(self, timeout_ms: float = 200) -> NDArray[np.uint8]:
        """The newest image that this function has not returned yet, for which it may wait.

        Raises TimeoutError if none came.
        """
        return self._wait(after=self._read, timeout=timeout_ms / 1000)

    def read_latest(self, max_age_ms: int = 500) -> NDArray[np.uint8]:
        """The newest image, at once.

        Raises TimeoutError if it is older than `max_age_ms` of the robot's time; RuntimeError
        before the first image.
        """
        seen = self._look_now()
        image = self.image
        age = (seen.current_time_index() - self._step) * seen.session_info().period
        if age > max_age_ms / 1000:
            raise TimeoutError(
                f"the newest image of {self} is {1000 * age:.0f} ms old, more than {max_age_ms} ms"
            )
        return image

    def _look_now(self) -> trifinger.Frontend:
        seen, cameras = self._connected()
        step = seen.current_time_index()
        self.look(cameras.get_latest_at(step) if step >= 0 else None)
        return seen

    def _wait(self, after: int, timeout: float) -> NDArray[np.uint8]:
        """Waits for an image with a number above `after`, in real time [s]."""
        end = time.monotonic() + timeout
        while True:
            seen = self._look_now()
            if self._image is not None and self._number > after:
                self._read = self._number
                return self._image
            left = end - time.monotonic()
            if left <= 0:
                raise TimeoutError(f"no new image of {self} has come in {1000 * timeout:.0f} ms")
            with contextlib.suppress(trifinger.TimedOut):
                seen.wait_until_time_index(seen.current_time_index() + 1, timeout=left)

    def _connected(self) -> tuple[trifinger.Frontend, Cameras]:
        if self._seen is None or self._cameras is None:
            raise DeviceNotConnectedError(f"{self} is not connected: call connect() first")
        return self._seen, self._cameras
