# SPDX-License-Identifier: BSD-3-Clause
"""Finds the corners of a board in images, or says why there are none."""

import dataclasses
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from trifinger.errors import InvalidArgument

from trifinger_camera_calibration.board import Board, Matrix, dictionary_names, dictionary_of
from trifinger_camera_calibration.images import Grey, ImageSet, Quality, read, to_grey

MIN_CORNERS = 8  # fewer say little about the place of a board

Numbers = NDArray[np.int64]


@dataclasses.dataclass(frozen=True)
class View:
    """What one image shows of the board."""

    camera: str
    name: str
    path: Path
    size: tuple[int, int]
    """Width and height of the image [pixel]."""
    quality: Quality
    """Of the part that shows the board, or of the whole image without one."""
    numbers: Numbers
    """Which corners of the board were found."""
    pixels: Matrix
    """Where they are [pixel]."""
    reason: str = ""
    """Why there are too few, as the end of a sentence."""

    @property
    def is_used(self) -> bool:
        """Whether enough corners were found."""
        return not self.reason


@lru_cache(maxsize=8)
def detector_of(board: Board) -> cv2.aruco.CharucoDetector:
    """OpenCV's detector of a board."""
    return cv2.aruco.CharucoDetector(board.to_opencv())


def find_corners(grey: Grey, board: Board) -> tuple[Numbers, Matrix, Numbers]:
    """Numbers and pixels of the corners of a board in an image, and numbers of its markers."""
    corners, numbers, _, markers = detector_of(board).detectBoard(grey)
    seen = np.empty(0, int) if markers is None else np.asarray(markers, int).ravel()
    if corners is None or len(corners) == 0:
        return np.empty(0, int), np.empty((0, 2)), seen
    pixels = np.asarray(corners, np.float64).reshape(-1, 2)
    found, pixels = without_strays(np.asarray(numbers, int).ravel(), pixels, board)
    pixels = refined(grey, board, found, pixels)
    good = np.isfinite(pixels).all(axis=1)
    return found[good], pixels[good], seen


def without_strays(numbers: Numbers, pixels: Matrix, board: Board) -> tuple[Numbers, Matrix]:
    """Leaves out corners that do not lie where their neighbours expect them.

    The small dictionaries take stray patterns for markers, so a few corners may be wrong.
    """
    if len(numbers) < MIN_CORNERS:
        return numbers, pixels
    plane = board.corners[numbers, :2]
    homography, _ = cv2.findHomography(plane, pixels, cv2.RANSAC, 4.0)
    if homography is None:
        return numbers[:0], pixels[:0]
    seen = cv2.perspectiveTransform(plane[None], homography)[0]
    # The lens bends lines by some pixels; a wrong marker misses by a good part of a square.
    spans = np.linalg.norm(pixels[:, None] - pixels[None], axis=2)
    lengths = np.linalg.norm(plane[:, None] - plane[None], axis=2)
    square = np.median(spans[lengths > 0] / lengths[lengths > 0]) * board.square
    good = np.linalg.norm(seen - pixels, axis=1) < max(4.0, 0.25 * square)
    return numbers[good], pixels[good]


def refined(grey: Grey, board: Board, numbers: Numbers, pixels: Matrix) -> Matrix:
    """Corners to some hundredths of a pixel; NaN where there is none or the image ends.

    A corner is where all gradients along the two edges through it are at right angles to the way
    to it. OpenCV takes the gradients in a square window. A tilted board needs another shape: a
    cross whose arms lie along the edges and end before the next marker begins.
    """
    if len(numbers) < MIN_CORNERS:
        return pixels
    slopes = (
        np.asarray(cv2.Scharr(grey, cv2.CV_64F, 1, 0), np.float64),
        np.asarray(cv2.Scharr(grey, cv2.CV_64F, 0, 1), np.float64),
    )
    plane = board.corners[numbers, :2]
    homography, _ = cv2.findHomography(plane, pixels)
    if homography is None:
        return pixels
    length, width = 0.3 * board.square, 0.15 * (board.square - board.marker)
    better = pixels.copy()
    for i, point in enumerate(plane):
        to_board = np.linalg.inv(derivative_of(np.asarray(homography, np.float64), point))
        better[i] = corner_at(pixels[i], slopes, np.asarray(to_board, np.float64), length, width)
    return better


def corner_at(
    start: Matrix, slopes: tuple[Matrix, Matrix], to_board: Matrix, length: float, width: float
) -> Matrix:
    """The corner near a pixel; NaN if there is none. `to_board` turns pixels into metres."""
    reach = length * np.linalg.norm(np.linalg.inv(to_board), axis=1)
    last = np.array(slopes[0].shape)[::-1] - 1
    corner = start.copy()
    for _ in range(10):
        low = np.floor(corner - reach).astype(int)
        high = np.ceil(corner + reach).astype(int)
        if (low < 1).any() or (high >= last).any() or np.linalg.norm(corner - start) > 3:
            break
        rows, columns = np.mgrid[low[1] : high[1] + 1, low[0] : high[0] + 1]
        away = np.stack([columns, rows], axis=-1) - corner
        along, across = np.moveaxis(np.abs(away @ to_board.T), -1, 0)
        weight = np.exp(-0.5 * (np.minimum(along, across) / width) ** 2)
        weight *= np.maximum(along, across) < length
        slope = np.stack([each[rows, columns] for each in slopes], axis=-1)
        moments = np.einsum("ij,ijk,ijl->kl", weight, slope, slope)
        pulls = np.einsum("ij,ijk,ijl,ijl->k", weight, slope, slope, away)
        if np.linalg.cond(moments) > 1e3:  # an edge, or nothing
            break
        step = np.linalg.solve(moments, pulls)
        corner = corner + step
        if np.linalg.norm(step) < 1e-3:
            return corner
    return np.full(2, np.nan)


def derivative_of(homography: Matrix, point: Matrix) -> Matrix:
    """How a pixel changes with its point of the plane."""
    u, v, w = homography @ (*point, 1)
    return np.asarray((homography[:2, :2] - np.outer((u / w, v / w), homography[2, :2])) / w)


def mask_of(pixels: Matrix, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """The part of an image inside of points."""
    mask = np.zeros(shape, np.uint8)
    hull = cv2.convexHull(np.rint(pixels).astype(np.int32))
    cv2.fillConvexPoly(mask, hull, (1,))
    return mask.astype(bool)


def why_not_found(grey: Grey, board: Board, found: int, seen: Numbers, search: bool) -> str:
    """Why an image shows too few corners of a board, as the end of a sentence.

    On request, other dictionaries of markers are searched, which takes longer.
    """
    if problem := Quality.of(grey).problem():
        return problem
    is_marked = len(seen) > board.markers // 2
    if is_marked and (first := first_id_in(grey, board, seen)) is not None:
        return (
            f"shows the board with markers from {first} on, not from {board.first_id}: say "
            f"--first-id {first}"
        )
    if found:
        return (
            f"shows only {found} corners of the board, {MIN_CORNERS} are needed: bring the "
            "board nearer, or turn it to the camera"
        )
    if is_marked:
        if board.rows % 2 == 0:
            other = dataclasses.replace(board, legacy=not board.legacy)
            if len(find_corners(grey, other)[0]):
                how = "with" if other.legacy else "without"
                return f"shows the board {how} OpenCV's legacy pattern: say {how_to(other)}"
        if in_order(grey, board):
            return "shows the board, but no corners: it is too steep, too far away or blurred"
        return (
            f"shows {len(seen)} markers of {board.dictionary}, but not in the order of a board of "
            f"{board.columns} x {board.rows} squares"
        )
    if search and (other_dictionary := dictionary_in(grey, board)):
        return (
            f"shows markers of the dictionary {other_dictionary}, not of {board.dictionary}: this "
            "is another board"
        )
    return "shows no board"


def first_id_in(grey: Grey, board: Board, seen: Numbers) -> int | None:
    """The first marker of the board in an image, if the board has other markers than was said."""
    last = len(dictionary_of(board.dictionary).bytesList) - board.markers
    for first in range(max(0, int(seen.max()) - board.markers + 1), min(last, int(seen.min())) + 1):
        other = dataclasses.replace(board, first_id=first)
        if first != board.first_id and len(find_corners(grey, other)[0]) >= MIN_CORNERS:
            return first
    return None


def in_order(grey: Grey, board: Board) -> bool:
    """Whether the markers in an image have the order of those on a board."""
    detector = cv2.aruco.ArucoDetector(dictionary_of(board.dictionary))
    corners, found, _ = detector.detectMarkers(grey)
    drawn = board.to_opencv()
    outlines = dict(zip(np.ravel(drawn.getIds()), drawn.getObjPoints(), strict=True))
    pairs = [
        (outlines[number], np.reshape(corner, (4, 2)))
        for number, corner in zip(np.ravel(found), corners, strict=True)
        if number in outlines
    ]
    if len(pairs) < 2:
        return False
    plane = np.concatenate([np.asarray(outline)[:, :2] for outline, _ in pairs])
    pixels = np.concatenate([corner for _, corner in pairs])
    _, good = cv2.findHomography(plane, pixels, cv2.RANSAC, 5.0)
    return good is not None and bool(np.mean(good) > 0.7)


def how_to(board: Board) -> str:
    """The option that says whether a board has the legacy pattern."""
    return "--legacy" if board.legacy else "--no-legacy"


def dictionary_in(grey: Grey, board: Board) -> str:
    """The dictionary of the markers in an image; empty if there are no more than strays."""
    best, most = "", 5
    # Dictionaries of one family begin alike: the smallest one that has all markers is meant.
    by_size = sorted(dictionary_names(), key=lambda name: len(dictionary_of(name).bytesList))
    for name in by_size:
        dictionary = dictionary_of(name)
        _, numbers, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(grey)
        count = 0 if numbers is None else len(np.unique(numbers))
        if count > most:
            best, most = name, count
    return "" if best == board.dictionary else best


def look(camera: str, name: str, path: Path, board: Board, search: bool = True) -> View:
    """What an image shows of a board; `search` says whether to look for other boards."""
    grey = to_grey(read(path))
    numbers, pixels, markers = find_corners(grey, board)
    size = (grey.shape[1], grey.shape[0])
    if len(numbers) < MIN_CORNERS:
        reason = why_not_found(grey, board, len(numbers), markers, search)
        return View(camera, name, path, size, Quality.of(grey), numbers, pixels, reason)
    quality = Quality.of(grey, mask_of(pixels, grey.shape))
    # Such images are measured all the same: they are weak, but the page says so.
    return View(camera, name, path, size, quality, numbers, pixels)


def look_at_all(images: ImageSet, board: Board) -> list[View]:
    """What all images show; raises InvalidArgument if a camera has images of several sizes."""
    views: list[View] = []
    is_known = False
    for camera, paths in images.paths.items():
        for name, path in paths.items():
            views.append(look(camera, name, path, board, search=not is_known))
            is_known = is_known or views[-1].is_used
    for camera in images.cameras:
        sizes: dict[tuple[int, int], View] = {}
        for view in views:
            if view.camera == camera:
                sizes.setdefault(view.size, view)
        if len(sizes) > 1:
            (one, first), (other, second) = list(sizes.items())[:2]
            raise InvalidArgument(
                f"images of {camera} have several sizes: {first.path.name} has {one[0]} x {one[1]} "
                f"pixels, {second.path.name} {other[0]} x {other[1]}; a calibration is of one size"
            )
    return views
