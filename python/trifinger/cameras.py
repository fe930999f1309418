# SPDX-License-Identifier: BSD-3-Clause
"""What the cameras of a robot see.

    with trifinger.observe("sim") as robot:
        cameras = Cameras(robot)
        images = cameras.get_latest_at(robot.current_time_index())
        rgb = images["camera60"]            # uint8[height, width, 3]
        age = now - images.frame("camera60").time

A camera without a good image raises CameraLost, so an old image never stands for a new one.
`LiveCameras` works without a robot that moves, for trackers and calibrations.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trifinger import _trifinger
from trifinger._trifinger import Frontend, Payload, to_rgb as to_rgb
from trifinger.errors import CameraLost, HistoryLost, InvalidArgument

COMPANION = "cameras"
DOCUMENT = "cameras.yml"
STATES = ("none", "good", "damaged", "lost")
_SENTENCES = {
    "none": "no image of {} has come: it is late or was lost",
    "damaged": "the image of {} is damaged",
    "lost": "{} is not there: unplugged, or without power",
}


@dataclass(frozen=True)
class Frame:
    """What is known about one image."""

    number: int
    """Counted by the camera from 0; -1 before its first image."""
    time: float
    """Middle of the exposure, on the monotonic clock [s]."""
    exposure: float
    """[s]"""
    missed: int
    """Images of this camera that did not arrive whole since its process was started."""
    state: str
    """ "good", or why there is no image: "none" (late or lost), "damaged", "lost" (unplugged)."""


class Images:
    """One image of each camera, of one time. `images["camera60"]` is RGB."""

    def __init__(self, element: Any, payload: Payload | None) -> None:
        self.element = element
        """The element of the companion, with its stamp."""
        self._payload = payload

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the cameras, in their order."""
        names = self.element.dtype.names
        return tuple(name for name in names if name not in ("stamp", "payload"))

    @property
    def time(self) -> float:
        """When they were taken: the mean of the good ones, on the monotonic clock [s]."""
        return float(self.element["stamp"]["capture_time"]) * 1e-9

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __getitem__(self, camera: str) -> NDArray[np.uint8]:
        """The image in RGB, a copy that is whole.

        Raises:
            CameraLost: if there is no good image of this camera
            HistoryLost: if it has been overwritten by newer ones
        """
        payload = self._good(camera)
        image = payload.array()[camera]
        rgb = to_rgb(image, "rgb8" if image.ndim == 3 else self._mosaic)
        if not payload.is_valid():
            raise HistoryLost(f"the image of {camera} was overwritten while it was read")
        return rgb

    def raw(self, camera: str) -> NDArray[np.uint8]:
        """The image as the camera delivers it, such as a Bayer mosaic: a copy that is whole.

        Raises:
            CameraLost: if there is no good image of this camera
            HistoryLost: if it has been overwritten by newer ones
        """
        payload = self._good(camera)
        image: NDArray[np.uint8] = payload.array()[camera].copy()
        if not payload.is_valid():
            raise HistoryLost(f"the image of {camera} was overwritten while it was read")
        return image

    def frame(self, camera: str) -> Frame:
        """What is known about the image of a camera."""
        if camera not in self.names:
            raise InvalidArgument.of_name("camera", camera, self.names)
        info = self.element[camera]
        return Frame(
            number=int(info["number"]),
            time=float(info["time"]) * 1e-9,
            exposure=float(info["exposure"]) * 1e-9,
            missed=int(info["missed"]),
            state=STATES[int(info["state"])],
        )

    _mosaic = "bayer_rggb8"

    def _require_good(self, camera: str) -> None:
        state = self.frame(camera).state
        if state != "good":
            raise CameraLost(_SENTENCES[state].format(camera))

    def _good(self, camera: str) -> Payload:
        self._require_good(camera)
        if self._payload is None:
            raise HistoryLost(f"the image of {camera} was overwritten by newer ones")
        return self._payload


class Cameras:
    """The cameras of a robot, read by its steps: the answer for a step never changes.

    Raises:
        InvalidArgument: if the robot has no cameras
    """

    def __init__(self, robot: Frontend) -> None:
        self.calibration = calibration_of(robot)
        """The text of the calibration, as `trifinger calibrate cameras` writes it."""
        self.companion = robot.companion(COMPANION)
        """The companion of the robot with the elements."""
        self._images = _images_class(self.calibration)

    def get_latest_at(self, t: int, timeout: float | None = None) -> Images | None:
        """Returns the newest images that had arrived at step `t`; waits for that step.

        Returns None if none had. The pixels can be read for some 16 further images.
        """
        element = self.companion.get_latest_at(t, timeout)
        return None if element is None else self._of(element)

    def latest(self) -> Images | None:
        """Returns the newest images, also after the end. None if none has arrived."""
        _, end = self.companion.range("observation")
        return self._of(self.companion.get_observation(end - 1)) if end > 0 else None

    def _of(self, element: Any) -> Images:
        if element["payload"]["memory"] == 0:
            return self._images(element, None)
        try:
            return self._images(element, self.companion.payload(element))
        except HistoryLost:  # only who asks for the pixels need know
            return self._images(element, None)


class LiveCameras:
    """What the process of a robot's cameras sees, also while the robot holds its pose.

    Nobody promises here that an answer can be repeated; controllers read `Cameras`.
    """

    def __init__(self, robot: str, calibration: str) -> None:
        self._live = _trifinger.LiveCameras(robot, calibration)
        self._images = _images_class(calibration)

    def next(self, timeout: float | None = None) -> Images | None:
        """Returns the newest images if they are others than at the last call; waits for them.

        Returns None if none have come within `timeout` [s].
        """
        found = self._live.next(timeout)
        return None if found is None else self._images(*found)


def calibration_of(robot: Frontend) -> str:
    """Returns the calibration of the cameras of a robot's session, as text.

    Raises:
        InvalidArgument: if the robot has no cameras
    """
    documents = robot.documents()
    if DOCUMENT not in documents:
        name = robot.session_info().name
        raise InvalidArgument(
            f"robot '{name}' has no cameras; its configuration needs a section 'cameras'"
        )
    return documents[DOCUMENT]


class _GreyImages(Images):
    _mosaic = "mono8"


def _images_class(calibration: str) -> type[Images]:
    # Brightness and mosaics have the same shape; all cameras of a robot are of one kind.
    return _GreyImages if "pixels: mono8" in calibration else Images
