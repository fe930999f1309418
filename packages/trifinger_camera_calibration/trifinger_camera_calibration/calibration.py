# SPDX-License-Identifier: BSD-3-Clause
"""Calibrates cameras from images of a board."""

import dataclasses
import re
from collections import Counter
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from trifinger._trifinger import CameraCalibration
from trifinger.errors import Error, InvalidArgument
from trifinger.poses import pose

from trifinger_camera_calibration import findings
from trifinger_camera_calibration.adjustment import (
    NO_TURNTABLE,
    Adjustment,
    Fit,
    Turntable,
)
from trifinger_camera_calibration.board import Board, Matrix
from trifinger_camera_calibration.detection import View, look_at_all
from trifinger_camera_calibration.geometry import about_z
from trifinger_camera_calibration.images import ImageSet, Kind, Placement, pixels_of, read
from trifinger_camera_calibration.result import (
    Result,
    calibration_of,
    measure_flatness,
    measure_scale,
    uncertainty_of,
)
from trifinger_camera_calibration.start import Guess, first_lens, require_names

WRONG = 1.0  # a calibration that leaves more unexplained is none [pixel]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options:
    """How to calibrate."""

    pixels: str | None = None
    """Pixel format of the cameras; by default what the images look like."""
    lenses: CameraCalibration | None = None
    """Has the lenses if only the poses of the cameras are wanted."""
    expected: CameraCalibration | None = None
    """An earlier calibration of the same cameras."""
    turntable: bool = False
    """Whether all other images are of the original stack's board on its turntable."""
    step: float = np.radians(10)
    """Angle from one image on the turntable to the next [rad]."""
    zero: float = 0.0
    """Direction of the board's x axis in the first image on the turntable [rad]."""


def board_on_turntable(board: Board, zero: float) -> Matrix:
    """Where the board of the original stack is on its turntable, at the first image.

    The board is tilted by 22 degrees and stands on a plate; all lengths are those of its drawing.
    The drawing counts from the lower left corner of the pattern, with y up along the board.
    """
    tilt = np.radians(22)
    plate, thickness = 0.00435, 0.0045
    left, bottom = 0.0047, 0.0378  # from the edges of the board to the pattern
    edge = 0.16054 - thickness * np.sin(tilt) - plate * np.tan(tilt)  # from the axis
    x = 0.105 - left
    y = edge * np.cos(tilt) - bottom
    z = thickness + edge * np.sin(tilt) + plate / np.cos(tilt)
    along, up = np.array([1.0, 0, 0]), np.array([0, np.cos(tilt), np.sin(tilt)])
    out = np.cross(along, up)
    upper_left = -x * along + (board.size[1] - y) * up + z * out
    turned = pose(about_z(zero), np.zeros(3))
    return np.asarray(turned @ pose(np.stack([along, -up, -out], axis=1), upper_left))


def turntables(board: Board, placements: list[Placement], options: Options) -> list[Turntable]:
    """The turntable, turning one way and the other."""
    names = [each.name for each in placements if each.kind is Kind.FREE]
    if len(names) < len(placements) and any(each.kind is Kind.MARK for each in placements):
        raise InvalidArgument(
            "the axis of the turntable is that of the world, so no image may show the board at "
            "the mark"
        )
    numbers = [re.search(r"(\d+)$", name) for name in names]
    steps = [int(number[1]) if number else i for i, number in enumerate(numbers)]
    first = min(steps, default=0)
    return [
        Turntable(
            board_on_turntable(board, options.zero),
            {
                name: sign * options.step * (step - first)
                for name, step in zip(names, steps, strict=True)
            },
        )
        for sign in (1, -1)
    ]


def used_views(views: list[View]) -> list[View]:
    """The views with enough corners; raises Error if there are none."""
    good = [view for view in views if view.is_used]
    if not good:
        reason, count = Counter(view.reason for view in views).most_common(1)[0]
        where = next(view for view in views if view.reason == reason)
        raise Error(
            f"no image shows the board; {count} of {len(views)} are like "
            f"{where.camera}/{where.path.name}, which {reason}"
        )
    return good


def placements_of(views: list[View]) -> list[Placement]:
    """The places of the board in views."""
    return [Placement.of_name(name) for name in dict.fromkeys(view.name for view in views)]


def known_lenses(calibration: CameraCalibration, cameras: list[str]) -> Matrix:
    """Lenses from a calibration; raises InvalidArgument if one is missing."""
    by_name = {camera.name: camera.lens for camera in calibration.cameras}
    if missing := [name for name in cameras if name not in by_name]:
        raise InvalidArgument(f"there is no lens of {findings.listed(missing)}")
    lenses = [by_name[name] for name in cameras]
    return np.array([[*one.focal_length, *one.principal_point, *one.distortion] for one in lenses])


def fit_robustly(
    board: Board, cameras: list[str], views: list[View], options: Options
) -> tuple[Adjustment, Fit]:
    """Fits everything so that single wrong images do no harm."""
    placements = placements_of(views)
    tables = turntables(board, placements, options) if options.turntable else [NO_TURNTABLE]
    if options.lenses:
        lenses = known_lenses(options.lenses, cameras)
    else:
        lenses = np.array([first_lens(camera, views, board) for camera in cameras])
    guesses = []
    for table in tables:
        adjustment = Adjustment(board, cameras, placements, views, table)
        start = Guess(adjustment, lenses).state()
        misses = np.linalg.norm(adjustment.pixels - adjustment.predict(start), axis=1)
        guesses.append((float(np.median(misses)), adjustment, start))
    _, adjustment, start = min(guesses, key=lambda guess: guess[0])
    free = adjustment.free_numbers(lenses=options.lenses is None)
    return adjustment, adjustment.fit(start, free, robust=1.0)


def without_outliers(
    adjustment: Adjustment, fit: Fit, lenses: bool
) -> tuple[Fit, NDArray[np.bool_]]:
    """Fits again without corners that are far off, until none is."""
    free = adjustment.free_numbers(lenses=lenses)
    used = np.ones(len(adjustment.pixels), bool)
    for _ in range(3):
        lengths = np.linalg.norm(fit.residuals, axis=1)
        limit = max(0.3, 5 * float(np.median(lengths[used])))
        good = lengths < limit
        if (good == used).all() and _:
            break
        used = good
        fit = adjustment.fit(fit.state, free, used)
    return fit, used


def calibrate(
    images: ImageSet,
    board: Board,
    options: Options | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Result:
    """Calibrates the cameras that took images of a board.

    Raises Error if the images do not suffice. What is wrong with the result otherwise is in its
    `problems`.
    """
    options = options or Options()
    require_names(images, has_lenses=options.lenses is not None, turns=options.turntable)
    if options.lenses:
        known_lenses(options.lenses, images.cameras)
    say(f"looking for the board in {sum(map(len, images.paths.values()))} images")
    views = look_at_all(images, board)
    formats = {
        name: options.pixels or pixels_of([read(path) for path in list(paths.values())[:5]])
        for name, paths in images.paths.items()
    }
    return calibrate_views(views, board, formats, options, say)


def calibrate_views(
    views: list[View],
    board: Board,
    formats: dict[str, str],
    options: Options | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Result:
    """Calibrates the cameras whose pixel formats are given from what their images show."""
    options = options or Options()
    good = used_views(views)
    cameras = list(formats)
    lenses = options.lenses is None
    say(f"fitting {sum(len(view.numbers) for view in good)} corners in {len(good)} images")
    adjustment, fit = fit_robustly(board, cameras, good, options)
    remarks = []
    odd = findings.outliers(adjustment, fit)
    problems = []
    if len(odd) > max(3, len(good) // 4):
        problems.append(
            f"{len(odd)} of {len(good)} images do not fit to the others: images of one name must "
            "be of one instant, the board must be flat, and cameras must not move"
        )
    elif odd:
        sentences, left_out = findings.explain_outliers(adjustment, fit.state, odd)
        remarks += [f"{sentence}; they were left out" for sentence in sentences]
        good = [view for i, view in enumerate(good) if i not in left_out]
        adjustment, fit = fit_robustly(board, cameras, good, options)
    fit, used = without_outliers(adjustment, fit, lenses)

    serials = {one.name: one.serial for one in (options.expected or CameraCalibration([])).cameras}
    rms = float(np.sqrt(np.mean(np.sum(fit.residuals[used] ** 2, axis=1))))
    result = Result(
        board=board,
        views=views,
        adjustment=adjustment,
        fit=fit,
        used=used,
        calibration=calibration_of(adjustment, fit, formats, serials, rms),
        uncertainty={name: uncertainty_of(fit, i) for i, name in enumerate(cameras)},
        flatness=measure_flatness(board, fit.state, cameras, adjustment.placements, good),
        problems=problems,
        remarks=remarks,
    )
    judge(result, options, lenses)
    return result


def judge(result: Result, options: Options, lenses: bool) -> None:
    """Fills in what is wrong with a result and what could be better."""
    if result.rms > WRONG:
        result.problems.append(
            f"corners miss by {result.rms:.1f} pixels, where 0.1 is usual: is the board flat, of "
            "the size that was said, and were images of one name taken at one instant?"
        )
    if sentence := findings.wrong_places(result.calibration, options.expected):
        result.problems.append(sentence)
    result.scale, ratio = measure_scale(result.adjustment, result.fit, result.used, lenses)
    result.problems += findings.bad_size(result.board, result.scale, ratio)
    result.advice += findings.advise(result)
    result.remarks += findings.remarks_on(result)
    left = np.count_nonzero(~result.used)
    if left:
        result.remarks.append(f"{left} of {len(result.used)} corners were far off and left out")
    if options.expected:
        result.remarks += findings.moved_since(result.calibration, options.expected)
