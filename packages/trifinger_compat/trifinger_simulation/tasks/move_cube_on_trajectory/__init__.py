# SPDX-License-Identifier: BSD-3-Clause
"""Moving the cube from one position to the next one."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

from trifinger_compat.types import Array

from trifinger_simulation.tasks import move_cube as move_cube
from trifinger_simulation.tasks.move_cube import NumpyEncoder as NumpyEncoder

Position: TypeAlias = Sequence[float] | Array
TrajectoryStep: TypeAlias = tuple[int, Position]
Trajectory: TypeAlias = Sequence[TrajectoryStep]

# Programs overwrite these, so they are looked up at each call. All are in steps of 1 ms.
EPISODE_LENGTH = 2 * 60 * 1000
FIRST_GOAL_DURATION = 30 * 1000
GOAL_DURATION = 10 * 1000
GOAL_DIFFICULTY = 3
INITIAL_CUBE_POSITION = (0.0, 0.0, move_cube._min_height)


def seed(seed: int) -> None:
    """Makes the next goals those of this seed."""
    move_cube.seed(seed)


def sample_goal() -> list[TrajectoryStep]:
    """Draws the positions of an episode: pairs of the step at which each begins, and position."""
    starts = [0, *range(FIRST_GOAL_DURATION, EPISODE_LENGTH, GOAL_DURATION)]
    return [(t, move_cube.sample_goal(GOAL_DIFFICULTY).position) for t in starts]


def get_active_goal(trajectory: Trajectory, time_index: int) -> Position | None:
    """The position that has begun last at a step; None before the first one."""
    active = None
    for start, position in trajectory:
        if start > time_index:
            break
        active = position
    return active


def validate_goal(trajectory: Trajectory) -> None:
    """Raises ValueError for wrong times, InvalidGoalError for a position out of reach."""
    if not len(trajectory):
        raise ValueError("Trajectory is empty")
    if trajectory[0][0] != 0:
        raise ValueError(f"First goal does not start at t=0, but at t={trajectory[0][0]}")
    previous = -1
    for i, (start, position) in enumerate(trajectory):
        if start <= previous:
            raise ValueError(
                f"Goal {i} starts before previous goal, or with it: {start} comes after {previous}"
            )
        previous = start
        move_cube.validate_goal(move_cube.Pose(position, [0, 0, 0, 1]))


def evaluate_state(trajectory: Trajectory, time_index: int, actual_position: Position) -> float:
    """The cost of being at a position at a step, at least 0."""
    goal = get_active_goal(trajectory, time_index)
    if goal is None:
        raise ValueError(f"the trajectory has no goal at step {time_index}")
    poses = (move_cube.Pose(goal), move_cube.Pose(actual_position))
    return move_cube.evaluate_state(*poses, GOAL_DIFFICULTY)


def trajectory_to_json(trajectory: Trajectory) -> str:
    """A trajectory as JSON: [[t, [x, y, z]], ..]."""
    return json.dumps(trajectory, cls=NumpyEncoder)


def json_goal_from_config(filename: str | Path) -> str:
    """The `goal` of a file as JSON; without one, a sampled one. RuntimeError for what is wrong."""
    try:
        content: dict[str, Any] = json.loads(Path(filename).read_text())
        goal = content["goal"] if "goal" in content else sample_goal()
        validate_goal(goal)
        return trajectory_to_json(goal)
    except Exception as error:
        raise RuntimeError(f"Failed to load goal configuration from {filename}: {error}") from error
