# SPDX-License-Identifier: BSD-3-Clause
"""Moving the cube along positions, as an environment of the old Gym."""

from typing import Any

import numpy as np
from trifinger_compat.gym_environment import OldEnvironment, dict_space

from trifinger_simulation.gym_wrapper.envs.cube_env import (
    ActionType as ActionType,
    action_space,
    to_robot_action,
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


class CubeTrajectoryEnv(OldEnvironment):
    """Moving the cube along positions; the reward of a step is minus the sum of its costs."""

    def __init__(
        self,
        initializer: Any,
        action_type: ActionType = ActionType.POSITION,
        step_size: int = 1,
        visualization: bool = False,
    ) -> None:
        """`step_size` is the number of steps of the robot in one step."""
        super().__init__()
        if step_size < 1:
            raise ValueError("step_size cannot be less than 1.")
        self.initializer = initializer
        self.action_type = action_type
        self.step_size = step_size
        self.visualization = visualization
        spaces = TriFingerPlatform.spaces
        self.action_space = action_space(action_type, spaces)
        self.observation_space = dict_space(
            observation=dict_space(
                position=spaces.robot_position.gym,
                velocity=spaces.robot_velocity.gym,
                torque=spaces.robot_torque.gym,
            ),
            desired_goal=spaces.object_position.gym,
            achieved_goal=spaces.object_position.gym,
        )
        self.platform: Any = None
        self.info: dict[str, Any] = {"time_index": -1}
        self.step_count = 0

    def compute_reward(self, achieved_goal: Any, desired_goal: Any, info: Any) -> float:
        """Minus the cost of a position at a step; the goal is that of the trajectory."""
        del desired_goal
        cost = task.evaluate_state(info["trajectory"], info["time_index"], achieved_goal)
        return -float(cost)

    def step(self, action: Any) -> Any:
        """Acts; gives observation, reward, done and info. Raises like CubeEnv.step()."""
        if self.platform is None:
            raise RuntimeError("Call `reset()` before starting to step.")
        if not self.action_space.contains(action):
            raise ValueError("Given action is not contained in the action space.")
        if self.step_count + self.step_size > task.EPISODE_LENGTH:
            raise RuntimeError(f"the episode of {task.EPISODE_LENGTH} steps is over")
        reward = 0.0
        observation: Any = None
        for _ in range(self.step_size):
            t = self.platform.append_desired_action(
                to_robot_action(self.platform, self.action_type, action)
            )
            # What the action has done is to be seen one step later.
            self.info["time_index"] = t + 1
            self.step_count = t + 1
            observation = self._create_observation(t + 1)
            reward += self.compute_reward(
                observation["achieved_goal"], observation["desired_goal"], self.info
            )
        return observation, reward, self.step_count >= task.EPISODE_LENGTH, self.info

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
        robot = self.platform.get_robot_observation(t)
        pose = self.platform.get_camera_observation(t).filtered_object_pose
        goal = task.get_active_goal(self.info["trajectory"], t)
        return {
            "observation": {
                "position": robot.position,
                "velocity": robot.velocity,
                "torque": robot.torque,
            },
            "desired_goal": np.asarray(goal),
            "achieved_goal": pose.position,
        }


class RealRobotChallengeTrajectory(CubeTrajectoryEnv):
    """The environment `cube_trajectory-v1`."""
