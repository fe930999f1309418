# SPDX-License-Identifier: BSD-3-Clause
"""Laying out 25 dice in a pattern."""

import itertools
import json
import random
from collections.abc import Sequence
from math import hypot
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation
from trifinger_compat.generation import why_sizes_differ
from trifinger_compat.opencv import opencv
from trifinger_compat.types import Array, Image

from trifinger_simulation.tasks.move_cube import NumpyEncoder as NumpyEncoder

Cell: TypeAlias = tuple[int, int]
Position: TypeAlias = Sequence[float] | Array
Goal: TypeAlias = Sequence[Position]

EPISODE_LENGTH = 2 * 60 * 1000
ARENA_RADIUS = 0.19  # [m]
NUM_DICE = 25
DIE_WIDTH = 0.022  # [m]
DIE_COLOUR = "#0a7dcf"  # not in the original
TOLERANCE = 0.004  # [m]
TARGET_WIDTH = DIE_WIDTH + TOLERANCE
N_CELLS_PER_ROW = 17

# Of each face the indices of its corners, in the order of `_corners`.
FACE_CORNERS = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (3, 2, 6, 7), (0, 3, 7, 4), (1, 2, 6, 5))
_CORNER_SIGNS = np.array(
    [
        *[(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1)],
        *[(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)],
    ]
)

_rng = random.Random()


class InvalidGoalError(Exception):
    """A goal of another number of dice, or with wrong positions."""


class OutOfArenaError(InvalidGoalError):
    """A die of a goal would not be on the table; `position` is where."""

    def __init__(self, position: Position) -> None:
        super().__init__(f"Position {position} is outside the arena.")
        self.position = position

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.position,)


def seed(seed: int) -> None:
    """Makes the next goals those of this seed."""
    global _rng
    _rng = random.Random(seed)


def _get_cell_center_position(cell: Cell) -> tuple[float, float, float]:
    x, y = ((i - N_CELLS_PER_ROW / 2) * DIE_WIDTH + DIE_WIDTH / 2 for i in cell)
    return x, y, DIE_WIDTH / 2


def _is_cell_valid(cell: Cell) -> bool:
    """True if the whole cell is on the table."""
    x, y, _ = _get_cell_center_position(cell)
    return hypot(abs(x) + DIE_WIDTH / 2, abs(y) + DIE_WIDTH / 2) <= ARENA_RADIUS


def _get_valid_cells() -> list[Cell]:
    numbers = range(N_CELLS_PER_ROW)
    cells = itertools.product(numbers, numbers)
    return [cell for cell in cells if _is_cell_valid(cell)]


def sample_goal() -> list[tuple[float, float, float]]:
    """Draws the positions of 25 dice [m]."""
    return [_get_cell_center_position(cell) for cell in _rng.sample(_get_valid_cells(), NUM_DICE)]


def validate_goal(goal: Goal) -> None:
    """Raises InvalidGoalError for a wrong shape, OutOfArenaError for a die beside the table."""
    if len(goal) != NUM_DICE:
        raise InvalidGoalError(f"Wrong number of positions.  Expected {NUM_DICE}, got {len(goal)}")
    for i, position in enumerate(goal):
        if np.shape(position) != (3,):
            raise InvalidGoalError(
                f"Position {i} has invalid shape. It is {np.shape(position)}, must be (3,)"
            )
        x, y, z = (float(value) for value in position)
        is_outside = hypot(abs(x) + DIE_WIDTH / 2, abs(y) + DIE_WIDTH / 2) > ARENA_RADIUS
        if is_outside or z < DIE_WIDTH / 2:
            raise OutOfArenaError(position)


def evaluate_state(goal_masks: Sequence[Image], actual_masks: Sequence[Image]) -> float:
    """The cost: the number of pixels that show a die where the goal has none."""
    goals, actuals = np.asarray(goal_masks), np.asarray(actual_masks)
    if goals.shape != actuals.shape:
        raise ValueError(
            f"the masks of the goal have shape {goals.shape} and the others {actuals.shape}, must "
            f"have the same; {why_sizes_differ(goals.shape[-1] if goals.ndim else 0)}"
        )
    return float(np.count_nonzero(np.logical_and(actuals != 0, goals == 0)))


def generate_goal_mask(camera_parameters: Sequence[Any], goal: Goal) -> list[Image]:
    """Where the cameras would see the dice of a goal: 255 there and 0 elsewhere.

    `camera_parameters` are those of `trifinger_simulation.camera`. Dice are a little larger than
    they are, so that they need not lie exactly.
    """
    return [_mask(camera, goal) for camera in camera_parameters]


def _mask(camera: Any, goal: Goal) -> Image:
    cv2 = opencv()

    mask: Image = np.zeros((camera.height, camera.width), dtype=np.uint8)
    from_world = np.asarray(camera.tf_world_to_camera, dtype=float)
    rotation = Rotation.from_matrix(from_world[:3, :3]).as_rotvec()
    centres = np.asarray(goal, dtype=float).reshape(-1, 1, 3)
    corners = centres + _CORNER_SIGNS * TARGET_WIDTH / 2
    points, _ = cv2.projectPoints(
        corners.reshape(-1, 3),
        rotation,
        from_world[:3, 3],
        np.asarray(camera.camera_matrix, dtype=float),
        np.asarray(camera.distortion_coefficients, dtype=float),
    )
    pixels = np.rint(points).astype(np.int32).reshape(-1, 8, 2)
    for die in pixels:
        for face in FACE_CORNERS:
            cv2.fillConvexPoly(mask, die[list(face)], (255,))
    return mask


def goal_to_json(goal: Goal) -> str:
    """A goal as JSON: [[x, y, z], ..]."""
    return json.dumps([[float(value) for value in position] for position in goal])


def json_goal_from_config(filename: str | Path) -> str:
    """The `goal` of a file as JSON; without one, a sampled one. RuntimeError for what is wrong."""
    try:
        content: dict[str, Any] = json.loads(Path(filename).read_text())
        goal = content["goal"] if "goal" in content else sample_goal()
        validate_goal(goal)
        return goal_to_json(goal)
    except Exception as error:
        raise RuntimeError(f"Failed to load goal configuration from {filename}: {error}") from error


def visualize_2d(target_positions: Goal) -> None:
    """Shows a goal from above in a window of Matplotlib."""
    import matplotlib.pyplot as plt
    from matplotlib.patches import Circle, Rectangle

    _, axes = plt.subplots()
    axes.add_patch(Circle((0, 0), ARENA_RADIUS, fill=False))
    for x, y, _z in target_positions:
        corner = (x - DIE_WIDTH / 2, y - DIE_WIDTH / 2)
        axes.add_patch(Rectangle(corner, DIE_WIDTH, DIE_WIDTH))
    axes.set_aspect("equal")
    axes.set_xlim(-ARENA_RADIUS, ARENA_RADIUS)
    axes.set_ylim(-ARENA_RADIUS, ARENA_RADIUS)
    plt.show()
