# SPDX-License-Identifier: BSD-3-Clause
"""What the cameras of a robot saw, from a log.

cameras = LoggedCameras(trifinger.Log("run.mcap").session("sim"))
images = cameras.get_latest_at(1000)        # like those of a robot, see trifinger.cameras
rgb = images["camera60"]                    # uint8[height, width, 3]
for images in cameras:                      # all of them
    images.frame("camera60").exposure
"""

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trifinger import _trifinger
from trifinger._trifinger import LoggedSession
from trifinger.cameras import COMPANION, Images
from trifinger.errors import InvalidArgument, NotInLog
from trifinger.progress import shown

COLUMNS = (
    "file",
    "camera",
    "time_index",
    "capture_index",
    "time",
    "exposure",
    "number",
    "state",
)
"""Columns of images.csv. The time is that of the middle of the exposure (UTC)."""


class LoggedImages(Images):
    """One image of each camera, of one time, in a log. `images["camera60"]` is RGB.

    What reads an image raises CameraLost if there was no good one of this camera, and NotInLog if
    it was not recorded.
    """

    def __init__(
        self,
        element: Any,
        index: int,
        log: _trifinger.LoggedCameras,
        cameras: "LoggedCameras | None" = None,
    ) -> None:
        super().__init__(element, None)
        self.index = index
        """Number of the element of the companion "cameras"."""
        self._log = log
        self._cameras = cameras

    def __reduce__(self) -> tuple[Any, ...]:
        return LoggedCameras.at, (self._cameras, self.index)

    def time_of(self, camera: str) -> np.datetime64:
        """Middle of the exposure of a camera's image, by the wall clock (UTC)."""
        times = self._log.times(self.index)
        return np.datetime64(times[self._number(camera)], "ns")

    def has(self, camera: str) -> bool:
        """True if the log has the image of this camera."""
        return self.frame(camera).state == "good" and self._log.has(
            self.index, self._number(camera)
        )

    def recorded(self, camera: str) -> tuple[str, bytes]:
        """The image as it is in the log: "jpeg" and a file, or a format and its pixels."""
        self._require_good(camera)
        return self._log.recorded(self.index, self._number(camera))

    def file(self, camera: str) -> tuple[str, bytes]:
        """The image as a file: its ending and its bytes.

        It is the JPEG that was recorded, or a PNG of what was recorded raw. A Bayer mosaic becomes
        a grey PNG, from which it can be read again.
        """
        self._require_good(camera)
        return self._log.file(self.index, self._number(camera))

    def __getitem__(self, camera: str) -> NDArray[np.uint8]:
        """The image in RGB."""
        self._require_good(camera)
        return self._log.rgb(self.index, self._number(camera))

    def raw(self, camera: str) -> NDArray[np.uint8]:
        """The image in the format of the camera; bit for bit if it was recorded raw."""
        self._require_good(camera)
        return self._log.pixels(self.index, self._number(camera))

    def _number(self, camera: str) -> int:
        if camera not in self.names:
            raise InvalidArgument.of_name("camera", camera, self.names)
        return self.names.index(camera)


class LoggedCameras:
    """The images of a session in a log, in the order of their arrival.

    Raises:
        InvalidArgument: if the log has no cameras of this robot
    """

    def __init__(self, session: LoggedSession) -> None:
        self._session = session
        self._log = _trifinger.LoggedCameras(session)
        self.companion = session.companion(COMPANION)
        """The companion with what is known of each image."""
        self.calibration = self._log.calibration
        """The text of the calibration."""
        self.names = tuple(self._log.names)
        """The names of the cameras, in the order of their images."""

    def __reduce__(self) -> tuple[Any, ...]:
        return LoggedCameras, (self._session,)

    def __len__(self) -> int:
        first, end = self._log.range()
        return end - first

    def __iter__(self) -> Iterator[LoggedImages]:
        for index in range(*self._log.range()):
            try:
                yield self.at(index)
            except NotInLog:  # in a gap
                continue

    def at(self, index: int) -> LoggedImages:
        """Returns the images of an element of the companion. Raises NotInLog."""
        return LoggedImages(self.companion.get_observation(index), index, self._log, self)

    def get_latest_at(self, t: int) -> LoggedImages | None:
        """Returns the newest images that had arrived at the robot's step `t`; None if none had."""
        index = self._log.index_at(t)
        return None if index is None else self.at(index)


def save_images(
    session: LoggedSession, folder: Path, first: int | None = None, last: int | None = None
) -> int:
    """Writes each image of the steps from `first` to before `last` as a file; returns their number.

    The images of camera60 are in the subfolder "camera60". The names of those that belong together
    end in the same time, so the folder is a source of images itself. "images.csv" has a line for
    each image, also for those that are missing.
    """
    cameras = LoggedCameras(session)
    for name in cameras.names:
        (folder / name).mkdir(parents=True, exist_ok=True)
    count = 0
    with (folder / "images.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        for images in shown(cameras, f"images of '{session.name}'", len(cameras)):
            stamp = images.element["stamp"]
            arrival = int(stamp["arrival_index"])
            if (first is not None and arrival < first) or (last is not None and arrival >= last):
                continue
            time = max(int(images.time_of(name).astype(np.int64)) for name in images.names)
            for name in images.names:
                frame = images.frame(name)
                written = ""
                if images.has(name):
                    ending, data = images.file(name)
                    written = f"{name}/{images.index:06d}_{time}{ending}"
                    (folder / written).write_bytes(data)
                    count += 1
                table.writerow(
                    [
                        written,
                        name,
                        arrival,
                        int(stamp["capture_index"]),
                        np.datetime_as_string(images.time_of(name), unit="ns"),
                        frame.exposure,
                        frame.number,
                        frame.state if written or frame.state != "good" else "not recorded",
                    ]
                )
    return count
