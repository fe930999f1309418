# SPDX-License-Identifier: BSD-3-Clause
"""A task of the Real Robot Challenge, as a program gets it and as its log is judged.

Goals, costs, platform and logs are those of the compatibility packages. Their platform has no
cuboid; here it has one in the place of the cube.
"""

import json
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from solvers import Array
from trifinger.control import Pose
from trifinger_compat.evaluation import replay
from trifinger_simulation import TriFingerPlatform, collision_objects
from trifinger_simulation.tasks import move_cube, move_cube_on_trajectory, move_cuboid

CUBOID_MASS = 0.016  # [kg]
# What is evaluated, and its words before the goal: the first ones of a program.
KINDS = {
    **{f"cube, level {level}": (str(level),) for level in (1, 2, 3, 4)},
    "cube on a trajectory": (),
    **{f"cuboid, level {level}": ("cuboid", str(level)) for level in (1, 2, 3, 4)},
}


class CuboidPlatform(TriFingerPlatform):
    """The platform with the cuboid of the challenge's third phase."""

    cube: Any

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        pose = self._initial_object_pose
        self.cube = collision_objects.Cuboid(
            pose.position,
            pose.orientation,
            move_cuboid._CUBOID_HALF_SIZE.tolist(),
            mass=CUBOID_MASS,
            pybullet_client_id=self.simfinger._pybullet_client_id,
        )
        self.simfinger._world.core.keep_steps()


class Task:
    """What is to be done, from the words that a program gets: [cuboid] LEVEL INITIAL GOAL LOG."""

    def __init__(self, words: Sequence[str]) -> None:
        """A program for trajectories gets TRAJECTORY LOG."""
        is_cuboid = words[0] == "cuboid"
        self._task: Any = move_cuboid if is_cuboid else move_cube
        self._platform = CuboidPlatform if is_cuboid else TriFingerPlatform
        self.size = [float(edge) for edge in move_cuboid._CUBOID_SIZE] if is_cuboid else [0.065] * 3
        self.mass = CUBOID_MASS if is_cuboid else 0.094
        words = words[is_cuboid:]
        self._log = words[-1]
        self.trajectory: list[tuple[int, Array]] = []
        self.initial_pose: Any
        self.goal: Any
        if len(words) == 2:
            self.level = move_cube_on_trajectory.GOAL_DIFFICULTY
            self.trajectory = [(t, np.array(goal)) for t, goal in json.loads(words[0])]
            self.initial_pose = move_cube.Pose(move_cube_on_trajectory.INITIAL_CUBE_POSITION)
            self.goal = move_cube.Pose(self.trajectory[0][1])
        else:
            self.level = int(words[0])
            self.initial_pose, self.goal = map(move_cube.Pose.from_json, words[1:3])

    @property
    def positions(self) -> list[tuple[float, Array]]:
        """The goals, and from when on they count [s]."""
        return [(t / 1000, goal) for t, goal in self.trajectory] or [(0.0, self.goal.position)]

    def cost_of(self, pose: Pose) -> float:
        """The cost of a step in which the object is at a pose."""
        w, x, y, z = pose.orientation
        actual = move_cube.Pose(pose.position, (x, y, z, w))
        return float(self._task.evaluate_state(self.goal, actual, self.level))

    @property
    def idle_cost(self) -> float:
        """The mean cost per step of an object that stays where it is."""
        if not self.trajectory:
            return float(self._task.evaluate_state(self.goal, self.initial_pose, self.level))
        times = range(0, move_cube.EPISODE_LENGTH, move_cube_on_trajectory.GOAL_DURATION)
        place = self.initial_pose.position
        costs = [move_cube_on_trajectory.evaluate_state(self.trajectory, t, place) for t in times]
        return float(np.mean(costs))

    def run(self, act: Callable[[Any, Any], Array]) -> float:
        """Does what `act` says for robot and camera observations; returns the mean cost per step.

        Writes the log, if the last word names one.
        """
        platform = self._platform(initial_object_pose=self.initial_pose)
        cost, total = self._cost(), 0.0
        for t in range(move_cube.EPISODE_LENGTH):
            torque = act(platform.get_robot_observation(t), platform.get_camera_observation(t))
            platform.append_desired_action(platform.Action(torque=torque))
            total += cost(t, platform.get_camera_observation(t).filtered_object_pose)
        if self._log:
            platform.store_action_log(self._log)
        return total / move_cube.EPISODE_LENGTH

    def _cost(self) -> Callable[[int, Any], float]:
        """The cost of each step, as the challenge computes it from the pose that is published."""
        if self.trajectory:
            goals = self.trajectory
            return lambda t, pose: float(
                move_cube_on_trajectory.evaluate_state(goals, t, pose.position)
            )
        newest: tuple[Any, float] = (None, 0.0)

        def cost(_t: int, pose: Any) -> float:
            nonlocal newest
            if pose is not newest[0]:
                newest = pose, float(self._task.evaluate_state(self.goal, pose, self.level))
            return newest[1]

        return cost

    def cost_of_log(self) -> float:
        """The mean cost per step of a log, whose actions are applied again."""
        length = move_cube.EPISODE_LENGTH
        reward = replay(
            self._log,
            self._cost(),
            length=length,
            decimals=6,
            initial_pose=self.initial_pose,
            make_platform=self._platform,
        )
        return -reward / length


def words_of(kind: str, seed: int) -> list[str]:
    """The words of a task whose start and goal the challenge's own sampler draws."""
    first = KINDS[kind]
    if not first:
        move_cube_on_trajectory.seed(seed)
        goals = move_cube_on_trajectory.sample_goal()
        return [move_cube_on_trajectory.trajectory_to_json(goals)]
    task: Any = move_cuboid if first[0] == "cuboid" else move_cube
    task.random = np.random.RandomState(seed)
    initial, goal = task.sample_goal(-1), task.sample_goal(int(first[-1]))
    return [*first, initial.to_json(), goal.to_json()]
