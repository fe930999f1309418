# SPDX-License-Identifier: BSD-3-Clause
"""Checks a calibration with new images of a board: do the cameras still stand where they stood?"""

import dataclasses
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from trifinger._trifinger import Camera, CameraCalibration
from trifinger.errors import Error, InvalidArgument
from trifinger.poses import inverse

from trifinger_camera_calibration import findings
from trifinger_camera_calibration.adjustment import (
    CAMERA,
    LENS,
    Adjustment,
    State,
    root_mean_square,
)
from trifinger_camera_calibration.board import Board
from trifinger_camera_calibration.calibration import placements_of, used_views
from trifinger_camera_calibration.detection import View, look_at_all
from trifinger_camera_calibration.geometry import angle_between
from trifinger_camera_calibration.images import ImageSet, Kind, read
from trifinger_camera_calibration.result import (
    Flatness,
    measure_flatness,
    place_boards,
    plane_through,
    state_of,
)

WORN = 0.5  # what a calibration may leave unexplained in new images [pixel]


@dataclasses.dataclass
class Check:
    """How well a calibration explains new images."""

    images: int
    residuals: dict[str, float]
    """Of each camera: root mean square [pixel]."""
    flatness: list[Flatness]
    problems: list[str] = dataclasses.field(default_factory=list)

    def lines(self) -> list[str]:
        """What was found, in sentences."""
        lines = [
            f"{camera}: corners miss by {miss:.2f} pixels"
            for camera, miss in self.residuals.items()
        ]
        if self.flatness:
            height, tilt = plane_through(self.flatness)
            lines.append(
                f"the table is at z = {height * 1e3:+.1f} mm, tilted by {np.degrees(tilt):.2f} "
                "degrees"
            )
        return lines


def require_known(seen: Iterable[str], calibration: CameraCalibration) -> None:
    """Raises InvalidArgument if a calibration does not know one of the cameras."""
    cameras = [camera.name for camera in calibration.cameras]
    if strange := [name for name in seen if name not in cameras]:
        raise InvalidArgument(
            f"the calibration does not know {findings.listed(strange)}; it has "
            f"{findings.listed(cameras)}"
        )


def require_size(path: Path, size: tuple[int, int], camera: Camera) -> None:
    """Raises InvalidArgument if an image is not of the size that a camera was calibrated with."""
    if size != (camera.width, camera.height):
        raise InvalidArgument(
            f"{path} has {size[0]} x {size[1]} pixels, the calibration of {camera.name} is of "
            f"{camera.width} x {camera.height}"
        )


def not_comparable() -> Error:
    """The error if no place of the board is seen by two cameras."""
    return Error("no two images of one name show the board, so cameras cannot be compared")


def check(images: ImageSet, board: Board, calibration: CameraCalibration) -> Check:
    """Checks a calibration; what is wrong is in `problems`."""
    # Looking takes minutes, and names and sizes of images tell this at once.
    require_known(images.cameras, calibration)
    counts = Counter(name for paths in images.paths.values() for name in paths)
    if max(counts.values()) < 2:
        raise not_comparable()
    for camera in calibration.cameras:
        for path in list(images.paths.get(camera.name, {}).values())[:1]:
            height, width = read(path).shape[:2]
            require_size(path, (width, height), camera)
    return check_views(look_at_all(images, board), board, calibration)


def check_views(all_views: list[View], board: Board, calibration: CameraCalibration) -> Check:
    """Checks a calibration with what images show."""
    cameras = [camera.name for camera in calibration.cameras]
    require_known(dict.fromkeys(view.camera for view in all_views), calibration)
    views = used_views(all_views)
    for view in views:
        require_size(view.path, view.size, calibration.cameras[cameras.index(view.camera)])
    # The mark and the table are what is checked, so they are not believed.
    said = placements_of(views)
    places = [dataclasses.replace(place, kind=Kind.FREE) for place in said]
    if all(sum(view.name == place.name for view in views) < 2 for place in places):
        raise not_comparable()
    state = state_of(calibration, len(places))
    adjustment, fit = place_boards(board, state, cameras, places, views)
    residuals = {
        name: root_mean_square(fit.residuals[adjustment.camera == i])
        for i, name in enumerate(cameras)
        if (adjustment.camera == i).any()
    }
    flatness = measure_flatness(board, state, cameras, said, views)
    found = Check(len(views), residuals, flatness)
    if max(residuals.values()) > max(WORN, 3 * calibration.residual):
        found.problems.append(what_moved(adjustment, fit.state))
    if flatness:
        height, tilt = plane_through(flatness)
        if abs(height) > 0.001 or tilt > np.radians(0.3):
            found.problems.append(
                f"the table lies {abs(height) * 1e3:.1f} mm {'above' if height > 0 else 'below'} "
                f"z = 0 of the calibration and is tilted by {np.degrees(tilt):.1f} degrees"
            )
    return found


def what_moved(adjustment: Adjustment, state: State) -> str:
    """A sentence about the camera that must have moved to explain the images."""
    cameras = range(len(adjustment.cameras))
    fits = []
    for camera in cameras:
        free = adjustment.free_numbers(lenses=False, cameras=False)
        free[CAMERA * camera + LENS : CAMERA * (camera + 1)] = True
        fits.append(adjustment.fit(state, free, robust=2.0))
    best = min(cameras, key=lambda camera: fits[camera].rms)
    others = [fits[camera].rms for camera in cameras if camera != best]
    if fits[best].rms > WORN or min(others) < 2 * fits[best].rms:
        return (
            "the cameras do not agree about the board: at least one has moved or has changed its "
            "lens; calibrate them again"
        )
    before, after = (inverse(each.camera_from_world(best)) for each in (state, fits[best].state))
    move = np.linalg.norm(after[:3, 3] - before[:3, 3])
    turn = np.degrees(angle_between(before[:3, :3], after[:3, :3]))
    return (
        f"{adjustment.cameras[best]} has moved by {move * 1e3:.1f} mm and {turn:.2f} degrees since "
        "its calibration; calibrate the cameras again"
    )
