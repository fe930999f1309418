# SPDX-License-Identifier: BSD-3-Clause
"""Finds what is wrong with a calibration or its images, and says it in sentences."""

import dataclasses
import itertools
import re
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from trifinger._trifinger import CameraCalibration

from trifinger_camera_calibration.adjustment import Adjustment, Fit, State, root_mean_square
from trifinger_camera_calibration.board import Board, Matrix
from trifinger_camera_calibration.detection import View
from trifinger_camera_calibration.geometry import angle_between
from trifinger_camera_calibration.images import Placement
from trifinger_camera_calibration.result import Result, place_boards

REGIONS = (
    ("upper left corner", "upper edge", "upper right corner"),
    ("left edge", "middle", "right edge"),
    ("lower left corner", "lower edge", "lower right corner"),
)
GOOD_VIEWS = 12
FAR_OFF = 3.0  # a view that is off by more does not belong to the others [pixel]


def listed(names: Sequence[str]) -> str:
    """Names as in "a, b and c"."""
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


# Views that do not fit.


def outliers(adjustment: Adjustment, fit: Fit) -> list[int]:
    """The views that do not fit to the others."""
    misses = np.array(
        [
            np.median(np.linalg.norm(fit.residuals[adjustment.view == i], axis=1))
            for i in range(len(adjustment.views))
        ]
    )
    limit = max(FAR_OFF, 8 * float(np.median(misses)))
    return [int(i) for i in np.flatnonzero(misses > limit)]


def explain_outliers(
    adjustment: Adjustment, state: State, odd: Sequence[int]
) -> tuple[list[str], set[int]]:
    """Says of each place with views that do not fit what happened, and which views to leave out."""
    sentences = []
    left_out: set[int] = set()
    for name in dict.fromkeys(adjustment.views[i].name for i in odd):
        own = [i for i, view in enumerate(adjustment.views) if view.name == name]
        views = [adjustment.views[i] for i in own]
        placement = next(each for each in adjustment.placements if each.name == name)
        order = exchanged(adjustment.board, state, adjustment.cameras, placement, views)
        left_out.update(own)
        if order:
            pairs = [f"that of {one} shows what {other} sees" for one, other in order.items()]
            sentences.append(f"the images '{name}' are exchanged: {listed(pairs)}")
        else:
            sentences.append(
                f"the images '{name}' of {listed([view.camera for view in views])} do not fit "
                "together: the board moved between them, or they are not of one instant"
            )
    return sentences, left_out


def exchanged(
    board: Board, state: State, cameras: list[str], placement: Placement, views: list[View]
) -> dict[str, str]:
    """Which camera took the image that is said to be of another one; empty if none."""
    if adjustment_misses(board, state, cameras, placement, views) < FAR_OFF / 2:
        return {}
    best, order = FAR_OFF / 2, {}
    for names in itertools.permutations(cameras, len(views)):
        tried = [
            dataclasses.replace(view, camera=name) for view, name in zip(views, names, strict=True)
        ]
        miss = adjustment_misses(board, state, cameras, placement, tried)
        if miss < best:
            said = [view.camera for view in views]
            best, order = miss, {a: b for a, b in zip(said, names, strict=True) if a != b}
    return order


def adjustment_misses(
    board: Board, state: State, cameras: list[str], placement: Placement, views: list[View]
) -> float:
    """How far off corners are if views are of one place of the board [pixel]."""
    _, fit = place_boards(board, state, cameras, [placement], views)
    return root_mean_square(fit.residuals)


# Cameras that are exchanged as a whole.


def wrong_places(found: CameraCalibration, expected: CameraCalibration | None) -> str:
    """A sentence if cameras stand where others should; empty if not."""
    if expected and {one.name for one in expected.cameras} == {one.name for one in found.cameras}:
        return exchanged_since(found, expected)
    return exchanged_by_name(found)


def swapped_pairs(names: list[str], order: Sequence[int]) -> str:
    """Which camera stands where which should: "camera60 and camera180 are exchanged"."""
    if sum(i != j for i, j in enumerate(order)) == 2:
        return listed([names[i] for i, j in enumerate(order) if i != j]) + " are exchanged"
    moved = [f"{names[i]} for {names[j]}" for i, j in enumerate(order) if i != j]
    return f"cameras are mistaken: {listed(moved)}"


def exchanged_since(found: CameraCalibration, expected: CameraCalibration) -> str:
    """A sentence if cameras have changed their places since an earlier calibration."""
    before = {camera.name: camera.pose[:3, 3] for camera in expected.cameras}
    names = [camera.name for camera in found.cameras]
    places = [camera.pose[:3, 3] for camera in found.cameras]
    orders = list(itertools.permutations(range(len(names))))

    def distance(order: Sequence[int]) -> float:
        distances = [np.linalg.norm(places[i] - before[names[j]]) for i, j in enumerate(order)]
        return float(np.max(distances))

    best = min(orders, key=distance)
    if best == orders[0] or distance(orders[0]) < 0.1 or distance(best) > distance(orders[0]) / 3:
        return ""
    day = expected.date or "an unknown day"
    return (
        f"{swapped_pairs(names, best)}: since the calibration of {day} each stands where the other "
        "did; exchange their cables or names, or remove the old file if this is meant"
    )


def azimuth(camera: Matrix) -> float:
    """Where a camera stands, seen from the middle of the arena [degree]."""
    return float(np.degrees(np.arctan2(camera[1, 3], camera[0, 3])))


def exchanged_by_name(found: CameraCalibration) -> str:
    """A sentence if cameras do not stand where their names say.

    The number in a name such as camera60 is the angle from the first finger, clockwise [degree].
    The y axis points to the first finger.
    """
    names = [camera.name for camera in found.cameras]
    angles = [re.fullmatch(r"camera(\d+)", name) for name in names]
    if len(names) < 2 or not all(angles):
        return ""
    should = [90 - float(angle[1]) for angle in angles if angle]
    stand = [azimuth(camera.pose) for camera in found.cameras]

    def off(order: Sequence[int]) -> float:
        turns = [(stand[i] - should[j] + 180) % 360 - 180 for i, j in enumerate(order)]
        return float(np.mean(np.abs(turns)))

    orders = list(itertools.permutations(range(len(names))))
    best = min(orders, key=off)
    if best != orders[0] and off(orders[0]) > off(best) + 30:
        where = listed([f"{name} at {at:.0f}" for name, at in zip(names, stand, strict=True)])
        return (
            f"{swapped_pairs(names, best)}: seen from the middle of the arena {where} degrees from "
            "the x axis stand where others should; exchange cables or names, unless the board "
            "lay turned at the mark"
        )
    if off(best) > 50:
        return (
            f"all cameras stand {off(best):.0f} degrees off where their names say: the board "
            "probably lay turned at the mark"
        )
    return ""


def moved_since(found: CameraCalibration, before: CameraCalibration) -> Iterator[str]:
    """Yields how far each camera has moved since an earlier calibration."""
    old = {camera.name: camera for camera in before.cameras}
    for camera in found.cameras:
        if camera.name in old:
            move = np.linalg.norm(camera.pose[:3, 3] - old[camera.name].pose[:3, 3])
            turn = angle_between(camera.pose[:3, :3], old[camera.name].pose[:3, :3])
            yield (
                f"{camera.name} stands {move * 1e3:.1f} mm and {np.degrees(turn):.2f} degrees from "
                f"where it was in the calibration of {before.date or 'an unknown day'}"
            )


# What could be better.


def coverage(result: Result, camera: str) -> NDArray[np.int64]:
    """Number of corners in each of nine parts of a camera's image."""
    pixels, _ = result.residuals_of(camera)
    width, height = result.adjustment.sizes[result.adjustment.cameras.index(camera)]
    counts, _, _ = np.histogram2d(
        pixels[:, 1], pixels[:, 0], bins=3, range=((0, height), (0, width))
    )
    return counts.astype(int)


def advise(result: Result) -> Iterator[str]:
    """Yields what to do better the next time."""
    adjustment = result.adjustment
    for camera in adjustment.cameras:
        own = [view for view in adjustment.views if view.camera == camera]
        if len(own) < GOOD_VIEWS:
            yield f"{camera} sees the board in {len(own)} images only; 15 to 25 are good"
        counts = coverage(result, camera)
        empty = [REGIONS[r][c] for r in range(3) for c in range(3) if counts[r, c] == 0]
        if empty:
            yield f"no board in the {listed(empty)} of {camera}: its lens is a guess there"
        sure = result.uncertainty[camera]
        focal = result.calibration.cameras[adjustment.cameras.index(camera)].lens.focal_length[0]
        if sure.focal_length > 0.003 * focal:
            yield (
                f"the focal length of {camera} is known to {sure.focal_length / focal:.1%} only: "
                "tilt the board by 30 to 45 degrees, in several directions"
            )
        if sure.position > 0.0005 or sure.angle > np.radians(0.05):
            yield (
                f"the pose of {camera} is known to {sure.position * 1e3:.1f} mm and "
                f"{np.degrees(sure.angle):.2f} degrees only: add images, or bring the board nearer"
            )
        _, residuals = result.residuals_of(camera)
        if 0.4 < (rms := root_mean_square(residuals)) <= 1:
            yield (
                f"corners of {camera} miss by {rms:.2f} pixels, where 0.1 is usual: is the board "
                "flat, and did it lie still?"
            )
    for view in adjustment.views:
        if problem := view.quality.problem():
            yield f"{view.camera}/{view.path.name} {problem}"
    flat = [place for place in adjustment.placements if place.is_flat and not place.height]
    if not adjustment.turntable.angles and len(flat) < 3:
        yield (
            f"the table is known from {len(flat)} place{'s' * (len(flat) > 1)} of the board: lay "
            "it flat on three or more, in images whose names begin with 'table'"
        )
    for each in result.flatness:
        if abs(each.height) > 0.0015 or each.tilt > np.radians(0.75):
            yield (
                f"in '{each.name}' the board lay {each.height * 1e3:+.1f} mm off its height and "
                f"tilted by {np.degrees(each.tilt):.1f} degrees: is it flat, and the table, too?"
            )
    if result.scale is None:
        yield (
            "nothing in the images tells the size of the squares: measure a row of them with a "
            "ruler, or add images of the board flat on a block, such as raised_50mm_1.png"
        )


def remarks_on(result: Result) -> Iterator[str]:
    """Yields what is good to know."""
    for view in result.views:
        if not view.is_used:
            yield f"{view.camera}/{view.path.name} was not used: it {view.reason}"
    flat = [each for each in result.flatness if not each.name.startswith("raised")]
    if flat:
        rms = np.sqrt(np.mean([each.height**2 for each in flat]))
        places = f"{len(flat)} place{'s' * (len(flat) > 1)}"
        yield f"z = 0 is the table: over {places} the boards lie {rms * 1e3:.2f} mm off it (rms)"
    if result.scale is not None:
        size, deviation = result.scale
        yield (
            f"the squares measure {size:.2%} of what was said, to {deviation:.2%}: known heights "
            "of the board tell it"
        )
    if result.adjustment.turntable.angles:
        x, y, roll, pitch = result.fit.state.shared[2:6]
        yield (
            f"on the turntable, the board sat {np.hypot(x, y) * 1e3:.1f} mm and "
            f"{np.degrees(np.hypot(roll, pitch)):.2f} degrees off its drawing, which was corrected"
        )
        if any(place.is_flat for place in result.adjustment.placements):
            height, roll, pitch = result.fit.state.shared[6:9]
            yield (
                f"the turntable's plate stands {height * 1e3:.1f} mm above the table and is tilted "
                f"by {np.degrees(np.hypot(roll, pitch)):.2f} degrees; the table counts"
            )


def bad_size(
    board: Board, scale: tuple[float, float] | None, ratio: tuple[float, float]
) -> Iterator[str]:
    """Yields a sentence if the board is not printed in the size that was said."""
    if scale is not None:
        size, deviation = scale
        if abs(size - 1) > max(0.004, 5 * deviation):
            yield (
                f"the board is printed at {size:.1%} of its size: its squares have "
                f"{board.square * size * 1e3:.2f} mm, not {board.square * 1e3:g} mm; print it at "
                f"100 %, or say --square {board.square * size:.5f} --marker "
                f"{board.marker * size:.5f}"
            )
    size, deviation = ratio
    if abs(size - 1) > max(0.003, 5 * deviation):
        yield (
            f"the squares of the board are {abs(size - 1):.1%} "
            f"{'longer' if size > 1 else 'shorter'} along y than along x: the printer distorts; "
            "print the board elsewhere"
        )
