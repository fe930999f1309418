# SPDX-License-Identifier: BSD-3-Clause
"""What a calibration has found, how sure it is, and what to do better."""

import dataclasses
import datetime

import numpy as np
from numpy.typing import NDArray
from trifinger._trifinger import Camera, CameraCalibration, Lens
from trifinger.poses import inverse, pose

from trifinger_camera_calibration.adjustment import (
    BOARD,
    CAMERA,
    LENS,
    SCALE,
    Adjustment,
    Fit,
    State,
    numbers_of_flat,
    numbers_of_free,
    root_mean_square,
)
from trifinger_camera_calibration.board import Board, Matrix
from trifinger_camera_calibration.detection import View
from trifinger_camera_calibration.geometry import rotations, vector_of
from trifinger_camera_calibration.images import Kind, Placement
from trifinger_camera_calibration.start import board_in_camera


@dataclasses.dataclass(frozen=True)
class Uncertainty:
    """Standard deviations of what was found for a camera."""

    focal_length: float
    """[pixel]"""
    principal_point: float
    """[pixel]"""
    position: float
    """[m]"""
    angle: float
    """[rad]"""


@dataclasses.dataclass(frozen=True)
class Flatness:
    """How a board lay that is said to lie flat."""

    name: str
    x: float
    """Where its middle was [m]."""
    y: float
    height: float
    """How much too high its middle was [m]."""
    tilt: float
    """[rad]"""


@dataclasses.dataclass
class Result:
    """A calibration and all that is known about it."""

    board: Board
    views: list[View]
    """All images, also those that were not used."""
    adjustment: Adjustment
    fit: Fit
    used: NDArray[np.bool_]
    """Which corners were used."""
    calibration: CameraCalibration
    uncertainty: dict[str, Uncertainty]
    flatness: list[Flatness]
    scale: tuple[float, float] | None = None
    """Size of the squares relative to what was said, and its standard deviation, if measured."""
    problems: list[str] = dataclasses.field(default_factory=list)
    """Why the calibration must not be used."""
    advice: list[str] = dataclasses.field(default_factory=list)
    """What to do better."""
    remarks: list[str] = dataclasses.field(default_factory=list)

    @property
    def rms(self) -> float:
        """Root mean square of the residuals of all corners that were used [pixel]."""
        return root_mean_square(self.fit.residuals[self.used])

    def residuals_of(self, camera: str) -> tuple[Matrix, Matrix]:
        """Pixels and residuals of all corners that one camera saw and that were used."""
        adjustment = self.adjustment
        own = (adjustment.camera == adjustment.cameras.index(camera)) & self.used
        return adjustment.pixels[own], self.fit.residuals[own]


def state_of(calibration: CameraCalibration, places: int) -> State:
    """The state with the cameras of a calibration."""
    cameras = np.zeros((len(calibration.cameras), CAMERA))
    for numbers, camera in zip(cameras, calibration.cameras, strict=True):
        lens = camera.lens
        numbers[:LENS] = [*lens.focal_length, *lens.principal_point, *lens.distortion]
        from_world = inverse(camera.pose)
        numbers[9:12], numbers[12:] = vector_of(from_world[:3, :3]), from_world[:3, 3]
    return State(cameras, np.zeros((places, BOARD)), np.array([1.0, 1, 0, 0, 0, 0, 0, 0, 0]))


def place_boards(
    board: Board, state: State, cameras: list[str], places: list[Placement], views: list[View]
) -> tuple[Adjustment, Fit]:
    """Finds where boards were, with cameras that are known and stay as they are."""
    adjustment = Adjustment(board, cameras, places, views)
    start = State(state.cameras, np.zeros((len(places), BOARD)), state.shared.copy())
    for place, placement in enumerate(places):
        if placement.kind is Kind.MARK:
            continue
        best = np.inf
        for view in views:
            if view.name != placement.name:
                continue
            camera = cameras.index(view.camera)
            seen = board_in_camera(view, state.cameras[camera, :LENS], board)
            found = inverse(state.camera_from_world(camera)) @ seen
            tried = State(start.cameras, start.boards.copy(), start.shared)
            if placement.kind is Kind.FLAT:
                tried.boards[place] = numbers_of_flat(found, board)
            else:
                tried.boards[place] = numbers_of_free(found)
            errors = (adjustment.pixels - adjustment.predict(tried))[adjustment.place == place]
            miss = float(np.median(np.linalg.norm(errors, axis=1)))
            if miss < best:
                best, start.boards[place] = miss, tried.boards[place]
    free = adjustment.free_numbers(lenses=False, cameras=False)
    if not free.any():
        errors = adjustment.pixels - adjustment.predict(start)
        return adjustment, Fit(start, errors, np.zeros((len(free), len(free))))
    return adjustment, adjustment.fit(start, free, robust=2.0, steps=20)


def measure_flatness(
    board: Board, state: State, cameras: list[str], places: list[Placement], views: list[View]
) -> list[Flatness]:
    """How boards lay that are said to lie flat, if nothing is believed but the cameras."""
    flat = [place for place in places if place.is_flat]
    if not flat:
        return []
    loose = [dataclasses.replace(place, kind=Kind.FREE) for place in flat]
    names = {place.name for place in flat}
    own = [view for view in views if view.name in names]
    adjustment, fit = place_boards(board, state, cameras, loose, own)
    found = []
    for i, place in enumerate(flat):
        at = adjustment.pose_of_board(fit.state, i)
        middle = at[:3, :3] @ board.middle + at[:3, 3]
        height = float(middle[2]) - place.height - board.thickness
        tilt = float(np.arccos(np.clip(-at[2, 2], -1, 1)))
        found.append(Flatness(place.name, float(middle[0]), float(middle[1]), height, tilt))
    return found


def plane_through(flatness: list[Flatness]) -> tuple[float, float]:
    """Height at the origin [m] and tilt [rad] of the plane through boards on the table."""
    if len(flatness) < 3:
        heights = [each.height for each in flatness]
        return float(np.mean(heights)), float(np.mean([each.tilt for each in flatness]))
    points = np.array([(1, each.x, each.y) for each in flatness])
    (height, *slope), *_ = np.linalg.lstsq(
        points, np.array([each.height for each in flatness]), rcond=None
    )
    return float(height), float(np.arctan(np.hypot(*slope)))


def uncertainty_of(fit: Fit, camera: int) -> Uncertainty:
    """How uncertain the numbers of a camera are."""
    own = slice(CAMERA * camera, CAMERA * (camera + 1))
    covariance = fit.covariance[own, own]
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0))
    numbers = fit.state.cameras[camera]

    def position(numbers: Matrix) -> Matrix:
        return inverse(pose(rotations(numbers[9:12]), numbers[12:]))[:3, 3]

    slopes = np.zeros((3, CAMERA))
    for i in range(LENS, CAMERA):
        step = np.zeros(CAMERA)
        step[i] = 1e-6
        slopes[:, i] = (position(numbers + step) - position(numbers - step)) / 2e-6
    return Uncertainty(
        focal_length=float(deviations[:2].max()),
        principal_point=float(deviations[2:4].max()),
        position=float(np.sqrt(np.trace(slopes @ covariance @ slopes.T))),
        angle=float(np.linalg.norm(deviations[9:12])),
    )


def calibration_of(
    adjustment: Adjustment,
    fit: Fit,
    pixels: dict[str, str],
    serials: dict[str, str],
    residual: float,
) -> CameraCalibration:
    """The calibration that was found, as it is written to a file."""
    cameras = []
    for i, name in enumerate(adjustment.cameras):
        numbers = fit.state.cameras[i]
        lens = Lens(numbers[:2], numbers[2:4], numbers[4:9])
        width, height = (int(side) for side in adjustment.sizes[i])
        placed = inverse(fit.state.camera_from_world(i))
        cameras.append(
            Camera(name, width, height, pixels[name], lens, placed, serials.get(name, "any"))
        )
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    return CameraCalibration(cameras, now, residual)


def measure_scale(
    adjustment: Adjustment, fit: Fit, used: NDArray[np.bool_], lenses: bool
) -> tuple[tuple[float, float] | None, tuple[float, float]]:
    """The size of the squares, if heights tell it, and how much longer they are along y than x.

    Each with its standard deviation.
    """
    heights = {place.height for place in adjustment.placements if place.is_flat}
    both = len(heights) > 1
    free = adjustment.free_numbers(lenses=lenses, scale=(both, True))
    again = adjustment.fit(fit.state, free, used)
    at = len(fit.state.vector()) - len(fit.state.shared)
    variance = again.covariance[at : at + 2, at : at + 2]
    x, y = again.state.shared[SCALE]
    ratio = float(y / x), float(np.sqrt(variance[0, 0] + variance[1, 1] - 2 * variance[0, 1]))
    if not both:
        return None, ratio
    mean = float((x + y) / 2)
    return (mean, float(np.sqrt(variance.sum()) / 2)), ratio
