# SPDX-License-Identifier: BSD-3-Clause
"""A first guess for the bundle adjustment, which single wrong images cannot spoil."""

from collections.abc import Sequence

import cv2
import numpy as np
from trifinger.errors import Error
from trifinger.poses import inverse, pose

from trifinger_camera_calibration.adjustment import (
    BOARD,
    CAMERA,
    LENS,
    SHARED,
    Adjustment,
    State,
    numbers_of_flat,
    numbers_of_free,
)
from trifinger_camera_calibration.board import Board, Matrix
from trifinger_camera_calibration.detection import View
from trifinger_camera_calibration.geometry import angle_between, rotations, vector_of
from trifinger_camera_calibration.images import ImageSet, Kind, Placement

MIN_VIEWS = 4  # of the board for a lens
CAP = 0.2  # poses that differ by more are just different


def no_mark() -> Error:
    """The error if nothing says where the world is."""
    return Error(
        "no image shows the board at the mark, so nothing says where the world is: lay it "
        "there, and let the name of the images begin with 'mark'"
    )


def not_together(some: Sequence[str], others: Sequence[str]) -> Error:
    """The error if no image connects cameras with the others."""
    alone, together = sorted((some, others), key=len)
    return Error(
        f"no image of {' or '.join(alone)} shows the board together with one of "
        f"{' or '.join(together)}: images of one instant must have the same name in "
        "the folder of each camera"
    )


def too_few(camera: str, count: int) -> Error:
    """The error if a camera has not enough images for a lens."""
    return Error(
        f"{camera} sees the board in {count} images; {MIN_VIEWS} are needed at least, and "
        "20 are good"
    )


def require_names(images: ImageSet, *, has_lenses: bool, turns: bool) -> None:
    """Says at once what the names of images tell before anybody has looked at the images.

    Raises Error if there cannot be a calibration even if every image shows the board.
    """
    kinds = [Placement.of_name(name).kind for name in images.names]
    if not turns and Kind.MARK not in kinds:
        raise no_mark()
    first, *others = images.cameras
    reached, names = {first}, set(images.paths[first])
    while new := [one for one in others if one not in reached and names & set(images.paths[one])]:
        reached.update(new)
        names.update(name for one in new for name in images.paths[one])
    if apart := [one for one in others if one not in reached]:
        raise not_together(apart, [one for one in images.cameras if one in reached])
    for camera, paths in images.paths.items():
        if not has_lenses and len(paths) < MIN_VIEWS:
            raise too_few(camera, len(paths))


def difference(one: Matrix, other: Matrix) -> float:
    """How much two poses differ; 1 stands for 1 rad or for 0.5 m."""
    turn = angle_between(one[:3, :3], other[:3, :3])
    move = float(np.linalg.norm(one[:3, 3] - other[:3, 3]))
    return min(turn + 2 * move, CAP)


def most_central(poses: Sequence[Matrix]) -> Matrix:
    """The pose that agrees best with the others."""
    sums = [sum(difference(one, other) for other in poses) for one in poses]
    return poses[int(np.argmin(sums))]


def first_lens(camera: str, views: Sequence[View], board: Board) -> Matrix:
    """The lens of a camera from its own views; raises Error if there are too few."""
    own = [view for view in views if view.camera == camera]
    if len(own) < MIN_VIEWS:
        raise too_few(camera, len(own))
    flags = cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST
    _, matrix, distortion, _, _ = cv2.calibrateCamera(
        [board.corners[view.numbers].astype(np.float32) for view in own],
        [view.pixels.astype(np.float32) for view in own],
        own[0].size,
        np.eye(3),
        np.zeros(5),
        flags=flags,
    )
    lens = np.concatenate(
        [[matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]], distortion.ravel()[:5]]
    )
    size = max(own[0].size)
    if not (0.2 * size < lens[0] < 20 * size and np.isfinite(lens).all()):
        raise Error(
            f"the images of {camera} do not determine its lens: the board must be seen tilted, "
            "in several directions"
        )
    return lens


def board_in_camera(view: View, lens: Matrix, board: Board) -> Matrix:
    """The pose of the board that a view shows, in the frame of its camera."""
    fx, fy, cx, cy = lens[:4]
    _, turn, place = cv2.solvePnP(
        board.corners[view.numbers],
        view.pixels,
        np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]),
        lens[4:],
        flags=cv2.SOLVEPNP_IPPE,
    )
    return pose(rotations(np.reshape(turn, (1, 3)))[0], np.ravel(place))


class Guess:
    """Poses of cameras and boards that most views agree on."""

    def __init__(self, adjustment: Adjustment, lenses: Matrix) -> None:
        self.adjustment = adjustment
        self.lenses = lenses
        self.seen: dict[tuple[int, int], Matrix] = {}
        """The pose of the board in the frame of the camera, by camera and place."""
        places = {each.name: i for i, each in enumerate(adjustment.placements)}
        for view in adjustment.views:
            camera = adjustment.cameras.index(view.camera)
            self.seen[camera, places[view.name]] = board_in_camera(
                view, lenses[camera], adjustment.board
            )

    def state(self) -> State:
        """The guess; raises Error if cameras or the world are not connected by images."""
        adjustment = self.adjustment
        rig = self.rig()
        world = self.world_in(rig)
        cameras = np.zeros((len(adjustment.cameras), CAMERA))
        for camera, in_rig in enumerate(rig):
            from_world = inverse(in_rig) @ world
            cameras[camera, :LENS] = self.lenses[camera]
            cameras[camera, 9:12] = vector_of(from_world[:3, :3])
            cameras[camera, 12:] = from_world[:3, 3]
        boards = np.zeros((len(adjustment.placements), BOARD))
        for place, placement in enumerate(adjustment.placements):
            boards[place] = adjustment.fixed_numbers(place)
            if placement.kind is Kind.MARK or adjustment.is_turning(place):
                continue
            found = most_central(
                [
                    inverse(world) @ rig[camera] @ board
                    for (camera, at), board in self.seen.items()
                    if at == place
                ]
            )
            if placement.kind is Kind.FLAT:
                boards[place] = numbers_of_flat(found, adjustment.board)
            else:
                boards[place] = numbers_of_free(found)
        return State(cameras, boards, np.concatenate([np.ones(2), np.zeros(SHARED - 2)]))

    def rig(self) -> list[Matrix]:
        """The poses of all cameras in the frame of the first one."""
        adjustment = self.adjustment
        count = len(adjustment.cameras)
        rig: dict[int, Matrix] = {0: np.eye(4)}
        while len(rig) < count:
            best: tuple[int, int, list[Matrix]] | None = None
            for known in rig:
                for new in set(range(count)) - set(rig):
                    common = [
                        board @ inverse(self.seen[new, place])
                        for (camera, place), board in self.seen.items()
                        if camera == known and (new, place) in self.seen
                    ]
                    if common and (best is None or len(common) > len(best[2])):
                        best = (known, new, common)
            if best is None:
                alone = [adjustment.cameras[i] for i in set(range(count)) - set(rig)]
                together = [adjustment.cameras[i] for i in rig]
                raise not_together(alone, together)
            known, new, common = best
            rig[new] = rig[known] @ most_central(common)
        return [rig[camera] for camera in range(count)]

    def world_in(self, rig: Sequence[Matrix]) -> Matrix:
        """The pose of the world in the frame of the first camera."""
        adjustment = self.adjustment
        state = State(
            np.zeros((0, CAMERA)),
            np.array([adjustment.fixed_numbers(i) for i in range(len(adjustment.placements))]),
            np.concatenate([np.ones(2), np.zeros(SHARED - 2)]),
        )
        candidates = [
            rig[camera] @ board @ inverse(adjustment.pose_of_board(state, place))
            for (camera, place), board in self.seen.items()
            if adjustment.placements[place].kind is Kind.MARK or adjustment.is_turning(place)
        ]
        if not candidates:
            raise no_mark()
        flat = [
            (adjustment.placements[place].height, rig[camera] @ board)
            for (camera, place), board in self.seen.items()
            if adjustment.placements[place].is_flat
        ]

        def doubt(world: Matrix) -> float:
            others = sum(difference(world, other) for other in candidates)
            return others + sum(min(not_flat(inverse(world) @ b, h), CAP) for h, b in flat)

        return min(candidates, key=doubt)


def not_flat(board_in_world: Matrix, height: float) -> float:
    """How far a board is from lying face up at a height."""
    tilt = float(np.linalg.norm(board_in_world[:3, 2] - (0, 0, -1)))
    return tilt + 2 * abs(float(board_in_world[2, 3]) - height)
