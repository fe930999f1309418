# SPDX-License-Identifier: BSD-3-Clause
"""States of a controller that lifts a cube, in which the episodes of a training begin, too.

`python evaluation/lift_states.py lift_states.npz` takes two minutes. Then `trifinger train lift
--algorithm ppo --set reset_states=lift_states.npz` needs not find out by chance what a grip is.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import solvers
from trifinger.environments import Environment, ResetStates

KEPT = Path("build/learning/lift_states.npz")  # for evaluations
SEED = 900_000  # No policy is judged in episodes of this seed.
EPISODES = 200
DURATION = 10.0  # of an episode [s]
FIRST, EVERY = 200, 100  # The controller's first steps are all alike [steps].


def collect_states(seed: int = SEED, episodes: int = EPISODES) -> ResetStates:
    """States on the way of a cube to reachable goals: before it is grasped, and in the air."""
    environment = Environment("lift", options=solvers.options("lift", duration=DURATION))
    planner = solvers.RoutePlanner()
    rows: list[tuple[Any, ...]] = []
    number = 0
    while episodes > 0:
        steps: list[tuple[Any, ...]] = []

        def keep(
            seen: solvers.Observation,
            action: npt.NDArray[np.float32],
            steps: list[tuple[Any, ...]] = steps,
        ) -> None:
            pose = np.concatenate([seen["object_position"], seen["object_orientation"]])
            steps.append((seen["joint_position"].copy(), solvers.MAX_TORQUE * action, pose))

        if solvers.try_goal(environment, planner, seed, number, keep):
            episodes -= 1
            rows += steps[FIRST - 1 :: EVERY]
        number += 1
    position, torque, pose = (np.array(column, np.float64) for column in zip(*rows, strict=True))
    return ResetStates(position, torque, pose)


def kept_states() -> Path:
    """The file of the states of evaluations, which is written if there is none."""
    if not KEPT.exists():
        KEPT.parent.mkdir(parents=True, exist_ok=True)
        collect_states().save(KEPT)
    return KEPT


def main() -> None:
    """Writes the file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--episodes", type=int, default=EPISODES, help=f"default: {EPISODES}")
    arguments = parser.parse_args()
    if arguments.episodes < 1:
        parser.error(f"--episodes is {arguments.episodes}, must be at least 1")
    states = collect_states(episodes=arguments.episodes)
    states.save(arguments.file)
    in_air = (states.object[:, 2] > 0.04).sum()
    print(f"{arguments.file}: {len(states.position)} states, {in_air} with the cube in the air")


if __name__ == "__main__":
    main()
