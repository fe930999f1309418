# SPDX-License-Identifier: BSD-3-Clause
"""Moving the cube along positions, as an environment of the old Gym."""

from typing import Any

import numpy as np

from trifinger_simulation.gym_wrapper.envs.cube_env import (
    ActionType as ActionType,
    PlatformEnvironment,
)
from trifinger_simulation.tasks import move_cube_on_trajectory as task
from trifinger_simulation.trifinger_platform import TriFingerPlatform


class RandomInitializer:
    """Draws the positions of each episode."""

    def get_trajectory(self) -> Any:
        """The positions of an episode."""
        return task.sample_goal()


class FixedInitializer:
    """Has the same positions in each episode."""

    def __init__(self, trajectory: Any) -> None:
        """Raises like validate_goal() if the positions are not valid."""
        task.validate_goal(trajectory)
        self.trajectory = trajectory

    def get_trajectory(self) -> Any:
        """The positions of an episode."""
        return self.trajectory


class CubeTrajectoryEnv(PlatformEnvironment):
    """Moving the cube along positions; the reward of a step is minus the sum of its costs."""

    def __init__(
        self,
        initializer: Any,
        action_type: ActionType = ActionType.POSITION,
        step_size: int = 1,
        visualization: bool = False,
    ) -> None:
        """`step_size` is the number of steps of the robot in one step."""
        if step_size < 1:
            raise ValueError("step_size cannot be less than 1.")
        position = TriFingerPlatform.spaces.object_position.gym
        super().__init__(initializer, action_type, visualization, position, {"time_index": -1})
        self.step_size = step_size

    def compute_reward(self, achieved_goal: Any, desired_goal: Any, info: Any) -> float:
        """Minus the cost of a position at a step; the goal is that of the trajectory."""
        del desired_goal
        cost = task.evaluate_state(info["trajectory"], info["time_index"], achieved_goal)
        return -float(cost)

    def step(self, action: Any) -> Any:
        """Acts; gives observation, reward, done and info. Raises like CubeEnv.step()."""
        return self._step(action, self.step_size, task.EPISODE_LENGTH)

    def _advance_to(self, t: int) -> None:
        super()._advance_to(t)
        self.info["time_index"] = t

    def reset(self, **_: Any) -> Any:
        """Begins an episode and gives the first observation."""
        self.platform = None
        trajectory = self.initializer.get_trajectory()
        begin = task.move_cube.Pose(np.array(task.INITIAL_CUBE_POSITION), np.array([0, 0, 0, 1.0]))
        self.platform = TriFingerPlatform(
            visualization=self.visualization, initial_object_pose=begin
        )
        self.info = {"time_index": -1, "trajectory": trajectory}
        self.step_count = 0
        return self._create_observation(0)

    def seed(self, seed: int | None = None) -> list[int]:
        """Seeds actions and positions."""
        chosen = int(np.random.SeedSequence().generate_state(1)[0]) if seed is None else seed
        self.action_space.seed(chosen)
        task.seed(chosen % 2**32)
        return [chosen]

    def _create_observation(self, t: int) -> dict[str, Any]:
        pose = self.platform.get_camera_observation(t).filtered_object_pose
        goal = task.get_active_goal(self.info["trajectory"], t)
        return {
            "observation": self._robot_state(t),
            "desired_goal": np.asarray(goal),
            "achieved_goal": pose.position,
        }


class RealRobotChallengeTrajectory(CubeTrajectoryEnv):
    """The environment `cube_trajectory-v1`."""
