# SPDX-License-Identifier: BSD-3-Clause
"""Bundle adjustment: lenses, poses of cameras and places of boards, fitted to all corners at once.

Unknown are, for each camera, its lens and its pose; for each place of the board, what its kind
leaves open; and a few numbers that all share. The method is that of Levenberg and Marquardt.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from trifinger.poses import pose

from trifinger_camera_calibration.board import Board, Matrix
from trifinger_camera_calibration.detection import View
from trifinger_camera_calibration.geometry import about_z, project, rotations, vector_of
from trifinger_camera_calibration.images import Kind, Placement

LENS, CAMERA, BOARD = 9, 15, 6  # numbers per lens, camera with its lens, and board
# The numbers that all share.
SCALE = slice(0, 2)  # of the pattern along x and y
OFFSET = slice(2, 6)  # of the board on the turntable: x, y, and rotations about x and y
AXIS = slice(6, 9)  # of the turntable: height, and rotations about x and y
SHARED = 9

FACE_UP = np.diag([1.0, -1.0, -1.0])  # a board on the table: its z points into the table

# What is known of lenses before, as mean and standard deviation. It matters only if the images say
# little, as where no board comes near a corner.
DISTORTION_SPREAD = np.array([0.5, 0.5, 0.02, 0.02, 0.5])
PIXEL_NOISE = 0.1  # of a corner [pixel]
ANGLE_NOISE = np.radians(0.1)  # of a turntable


@dataclasses.dataclass(frozen=True)
class Turntable:
    """A board on a turntable whose axis is the z axis of the world."""

    board: Matrix
    """Pose of the board in the world at angle 0."""
    angles: dict[str, float]
    """The nominal angle of each image [rad]."""


NO_TURNTABLE = Turntable(np.eye(4), {})


@dataclasses.dataclass
class State:
    """All numbers that are fitted."""

    cameras: Matrix
    """Lens, then rotation vector and translation from the world to the camera (n, 15)."""
    boards: Matrix
    """Flat: x, y of the middle and yaw. Anywhere: rotation vector and position. Turning: angle."""
    shared: Matrix

    def vector(self) -> Matrix:
        """All in one vector."""
        return np.concatenate([self.cameras.ravel(), self.boards.ravel(), self.shared])

    def of_vector(self, vector: Matrix) -> "State":
        """The state of a vector like that of this one."""
        cameras, boards = self.cameras.size, self.boards.size
        return State(
            vector[:cameras].reshape(self.cameras.shape),
            vector[cameras : cameras + boards].reshape(self.boards.shape),
            vector[cameras + boards :],
        )

    def camera_from_world(self, camera: int) -> Matrix:
        """The pose of the world in a camera's frame."""
        numbers = self.cameras[camera]
        return pose(rotations(numbers[9:12]), numbers[12:15])


@dataclasses.dataclass
class Fit:
    """A fitted state and what it leaves unexplained."""

    state: State
    residuals: Matrix
    """Of each corner: seen minus expected [pixel]."""
    covariance: Matrix
    """Of the vector of the state; zero where nothing was fitted."""

    @property
    def rms(self) -> float:
        """Root mean square of the distances [pixel]."""
        return root_mean_square(self.residuals)


def root_mean_square(residuals: Matrix) -> float:
    """Root mean square of the lengths of rows."""
    return float(np.sqrt(np.mean(np.sum(residuals**2, axis=1)))) if len(residuals) else 0.0


class Adjustment:
    """The corners of all views, and the numbers that explain them."""

    def __init__(
        self,
        board: Board,
        cameras: Sequence[str],
        placements: Sequence[Placement],
        views: Sequence[View],
        turntable: Turntable = NO_TURNTABLE,
    ) -> None:
        self.board = board
        self.cameras = list(cameras)
        self.placements = list(placements)
        self.views = list(views)
        self.turntable = turntable
        number = {placement.name: i for i, placement in enumerate(self.placements)}
        lengths = [len(view.numbers) for view in self.views]
        self.view = np.repeat(np.arange(len(self.views)), lengths)
        """The view that each corner belongs to."""
        cameras_of_views = [self.cameras.index(view.camera) for view in self.views]
        self.camera = np.repeat(np.array(cameras_of_views, int), lengths)
        places_of_views = [number[view.name] for view in self.views]
        self.place = np.repeat(np.array(places_of_views, int), lengths)
        self.points = np.concatenate([board.corners[view.numbers] for view in self.views])
        self.pixels = np.concatenate([view.pixels for view in self.views])
        self.not_free = [
            place
            for place, placement in enumerate(self.placements)
            if placement.is_flat or self.is_turning(place)
        ]
        sizes = {view.camera: view.size for view in self.views}
        self.sizes = np.array([sizes.get(name, (1, 1)) for name in self.cameras])

    def pose_of_board(self, state: State, place: int) -> Matrix:
        """The pose of the board in the world."""
        placement, numbers = self.placements[place], state.boards[place]
        if self.is_turning(place):
            return self.turning_pose(state, float(numbers[0]))
        if placement.is_flat:
            height = placement.height + self.board.thickness
            turn = about_z(float(numbers[2])) @ FACE_UP
            scale = np.append(state.shared[SCALE], 1)
            middle = np.array([numbers[0], numbers[1], height])
            return pose(turn, middle - turn @ (self.board.middle * scale))
        return pose(rotations(numbers[:3]), numbers[3:6])

    def is_turning(self, place: int) -> bool:
        """Whether the board is on the turntable."""
        return self.placements[place].name in self.turntable.angles

    def turning_pose(self, state: State, angle: float) -> Matrix:
        """The pose in the world of the board on the turntable."""
        x, y, roll, pitch = state.shared[OFFSET]
        height, axis_roll, axis_pitch = state.shared[AXIS]
        zero = np.zeros(3)
        axis = pose(rotations(np.array([axis_roll, axis_pitch, 0])), np.array([0, 0, height]))
        shift = pose(rotations(np.array([roll, pitch, 0])), np.array([x, y, 0]))
        return np.asarray(axis @ pose(about_z(angle), zero) @ shift @ self.turntable.board)

    def fixed_numbers(self, place: int) -> Matrix:
        """The numbers of a place that is known: that of the mark, or a step of the turntable."""
        numbers = np.zeros(BOARD)
        if self.is_turning(place):
            numbers[0] = self.turntable.angles[self.placements[place].name]
        return numbers

    def poses_of_boards(self, state: State) -> Matrix:
        """The poses of all boards in the world (n, 4, 4)."""
        poses = np.tile(np.eye(4), (len(self.placements), 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = rotations(state.boards[:, :3]), state.boards[:, 3:6]
        for place in self.not_free:
            poses[place] = self.pose_of_board(state, place)
        return poses

    def world(self, state: State) -> Matrix:
        """Where all corners are in the world [m]."""
        poses = self.poses_of_boards(state)[self.place]
        scaled = self.points * np.append(state.shared[SCALE], 1)
        return np.asarray((poses[:, :3, :3] @ scaled[..., None])[..., 0] + poses[:, :3, 3])

    def seen(self, state: State, world: Matrix) -> Matrix:
        """Where points of the world, one for each corner, should be seen [pixel]."""
        turns = rotations(state.cameras[:, 9:12])[self.camera]
        cameras = state.cameras[self.camera]
        points = (turns @ world[..., None])[..., 0] + cameras[:, 12:15]
        return project(cameras[:, :LENS], points)

    def predict(self, state: State) -> Matrix:
        """Where all corners should be seen [pixel]."""
        return self.seen(state, self.world(state))

    def free_numbers(
        self, *, lenses: bool = True, cameras: bool = True, scale: Sequence[bool] = (False, False)
    ) -> NDArray[np.bool_]:
        """Which numbers of the state are fitted; boards always are as far as they are open."""
        of_cameras = np.zeros((len(self.cameras), CAMERA), bool)
        of_cameras[:, :LENS], of_cameras[:, LENS:] = lenses, cameras
        of_boards = np.zeros((len(self.placements), BOARD), bool)
        for place, placement in enumerate(self.placements):
            if self.is_turning(place):
                of_boards[place, 0] = True
            elif placement.kind is Kind.FLAT:
                of_boards[place, :3] = True
            elif placement.kind is Kind.FREE:
                of_boards[place] = True
        shared = np.zeros(SHARED, bool)
        shared[SCALE] = scale
        if self.turntable.angles:
            shared[OFFSET] = True
            shared[AXIS] = any(placement.is_flat for placement in self.placements)
        return np.concatenate([of_cameras.ravel(), of_boards.ravel(), shared])

    def jacobian(self, state: State, free: NDArray[np.bool_]) -> Matrix:
        """The derivatives of all pixels (2 n) with respect to the free numbers."""
        vector = state.vector()
        count = len(self.pixels)
        result = np.zeros((count, 2, np.count_nonzero(free)))
        # Where the derivative with respect to a number goes.
        place_of = np.where(free, np.cumsum(free) - 1, -1)
        boards = state.cameras.size
        shared = boards + state.boards.size
        world = self.world(state)

        def add(columns: NDArray[np.int64], owner: NDArray[np.int64]) -> None:
            # A corner depends on one camera and one place, so all of them can be moved at once.
            if not free[columns].any():
                return
            step = 1e-6 * (1 + np.abs(vector[columns]).max())
            pixels = []
            for sign in (1, -1):
                moved = vector.copy()
                moved[columns] += sign * step
                other = state.of_vector(moved)
                points = world if columns[0] < boards else self.world(other)
                pixels.append(self.seen(other, points))
            targets = place_of[columns][owner]
            rows = np.flatnonzero(targets >= 0)
            result[rows, :, targets[rows]] = ((pixels[0] - pixels[1]) / (2 * step))[rows]

        for number in range(CAMERA):
            add(number + CAMERA * np.arange(len(self.cameras)), self.camera)
        for number in range(BOARD):
            add(boards + number + BOARD * np.arange(len(self.placements)), self.place)
        for column in range(shared, len(vector)):
            add(np.array([column]), np.zeros(count, int))
        return result.reshape(2 * count, -1)

    def priors(self, state: State) -> tuple[Matrix, Matrix]:
        """What is known beforehand: the mean and the weight of each number [pixel per unit]."""
        mean, spread = state.vector(), np.full(len(state.vector()), np.inf)
        for camera, size in enumerate(self.sizes):
            lens = slice(CAMERA * camera, CAMERA * camera + LENS)
            middle = (size - 1) / 2
            focal = state.cameras[camera, :2].mean()  # weak: the two are nearly the same
            mean[lens] = [focal, focal, *middle, *np.zeros(5)]
            spread[lens] = [0.05 * focal] * 2 + [0.15 * size.max()] * 2 + list(DISTORTION_SPREAD)
        for place in range(len(self.placements)):
            if self.is_turning(place):
                at = state.cameras.size + BOARD * place
                mean[at], spread[at] = self.fixed_numbers(place)[0], ANGLE_NOISE
        return mean, PIXEL_NOISE / spread

    def fit(
        self,
        state: State,
        free: NDArray[np.bool_],
        used: NDArray[np.bool_] | None = None,
        robust: float = np.inf,
        steps: int = 100,
    ) -> Fit:
        """Fits the free numbers to the corners that are used.

        Corners that are further off than `robust` [pixel] pull no more than those at this distance.
        """
        mask = np.ones(len(self.pixels), bool) if used is None else used
        problem = _Problem(self, state, free, mask, robust)
        current = state.vector()
        errors = problem.residuals(current)
        cost = problem.cost(errors, current)
        # Robust fits only find out what to leave out, and the last steps of theirs are many.
        enough = 1e-4 if np.isfinite(robust) else 1e-7
        damping = 1e-3
        normal = np.zeros((0, 0))
        for _ in range(steps):
            normal, pull = problem.normal_equations(errors, current)
            scale = np.sqrt(np.maximum(np.diag(normal), 1e-12))
            normed = normal / np.outer(scale, scale)
            improved = False
            while damping < 1e9:
                step = np.linalg.solve(normed + damping * np.eye(len(scale)), pull / scale) / scale
                tried = current.copy()
                tried[free] += step
                new_errors = problem.residuals(tried)
                new_cost = problem.cost(new_errors, tried)
                if new_cost < cost:
                    improved = True
                    break
                damping *= 10
            if not improved:
                break
            done = cost - new_cost < enough * cost
            current, errors, cost, damping = tried, new_errors, new_cost, max(damping / 10, 1e-9)
            if done:
                break
        covariance = self.covariance(normal, errors[mask], free, problem.weight)
        return Fit(state.of_vector(current), errors, covariance)

    @staticmethod
    def covariance(
        normal: Matrix, errors: Matrix, free: NDArray[np.bool_], weight: Matrix
    ) -> Matrix:
        """How uncertain the fitted numbers are, if errors of corners are independent."""
        known = np.count_nonzero(weight[free])
        variance = np.sum(errors**2) / max(
            2 * len(errors) + int(known) - int(np.count_nonzero(free)), 1
        )
        covariance = np.zeros((len(free), len(free)))
        covariance[np.ix_(free, free)] = np.linalg.pinv(normal, hermitian=True) * variance
        return covariance


class _Problem:
    """The cost of a fit and its normal equations, for any vector of the state."""

    def __init__(
        self,
        adjustment: Adjustment,
        state: State,
        free: NDArray[np.bool_],
        used: NDArray[np.bool_],
        robust: float,
    ) -> None:
        self._adjustment = adjustment
        self._state = state
        self._free = free
        self._used = used
        self._robust = robust
        _, self.weight = adjustment.priors(state)

    def residuals(self, vector: Matrix) -> Matrix:
        """Of all corners: seen minus expected [pixel]."""
        adjustment = self._adjustment
        return np.asarray(adjustment.pixels - adjustment.predict(self._state.of_vector(vector)))

    def cost(self, errors: Matrix, vector: Matrix) -> float:
        """The cost of residuals and of deviations from what was known before."""
        robust, lengths = self._robust, np.linalg.norm(errors, axis=1)
        far = robust * (2 * lengths - robust) if np.isfinite(robust) else lengths**2
        mean, _ = self._adjustment.priors(self._state.of_vector(vector))
        known = np.sum((self.weight * (vector - mean))[self._free] ** 2)
        return float(np.sum(np.where(lengths < robust, lengths**2, far)[self._used]) + known)

    def normal_equations(self, errors: Matrix, vector: Matrix) -> tuple[Matrix, Matrix]:
        """Matrix and right-hand side of the equations of a step without damping."""
        state, free = self._state.of_vector(vector), self._free
        jacobian = self._adjustment.jacobian(state, free)
        lengths = np.maximum(np.linalg.norm(errors, axis=1), 1e-12)
        weights = np.repeat(np.minimum(1, self._robust / lengths) * self._used, 2)
        mean, _ = self._adjustment.priors(state)
        known = (self.weight * (mean - vector))[free] * self.weight[free]
        normal = jacobian.T @ (weights[:, None] * jacobian) + np.diag(self.weight[free] ** 2)
        return normal, jacobian.T @ (weights * errors.ravel()) + known


def numbers_of_free(board_in_world: Matrix) -> Matrix:
    """The numbers of a board that may be anywhere."""
    return np.concatenate([vector_of(board_in_world[:3, :3]), board_in_world[:3, 3]])


def numbers_of_flat(board_in_world: Matrix, board: Board) -> Matrix:
    """The numbers of a board that lies on the table."""
    middle = board_in_world[:3, :3] @ board.middle + board_in_world[:3, 3]
    turn = board_in_world[:3, :3]
    yaw = np.arctan2(turn[1, 0], turn[0, 0])
    return np.array([middle[0], middle[1], yaw, 0, 0, 0])
