# SPDX-License-Identifier: BSD-3-Clause
"""A learner's environment around the platform, with goals of move_cube and the old Gym's steps."""

import sys

import gymnasium as gym
import numpy as np
import robot_fingers
import trifinger_simulation
from trifinger_simulation import trifingerpro_limits
from trifinger_simulation.tasks import move_cube


class CubeGymEnvironment(gym.Env):
    def __init__(self, goal, difficulty, steps, real_robot, step_size=10):
        self.goal, self.difficulty = goal, difficulty
        self.steps, self.real_robot, self.step_size = steps, real_robot, step_size
        robot_torque_space = gym.spaces.Box(
            low=trifingerpro_limits.robot_torque.low, high=trifingerpro_limits.robot_torque.high
        )
        robot_position_space = gym.spaces.Box(
            low=trifingerpro_limits.robot_position.low, high=trifingerpro_limits.robot_position.high
        )
        object_state_space = gym.spaces.Dict(
            {
                "position": gym.spaces.Box(
                    low=trifingerpro_limits.object_position.low,
                    high=trifingerpro_limits.object_position.high,
                ),
                "orientation": gym.spaces.Box(
                    low=trifingerpro_limits.object_orientation.low,
                    high=trifingerpro_limits.object_orientation.high,
                ),
            }
        )
        self.action_space = robot_position_space
        self.observation_space = gym.spaces.Dict(
            {
                "robot_position": robot_position_space,
                "robot_torque": robot_torque_space,
                "object": object_state_space,
            }
        )
        self._initial_action = trifingerpro_limits.robot_position.default
        self.platform = None

    def compute_reward(self, pose):
        return -move_cube.evaluate_state(self.goal, pose, self.difficulty)

    def reset(self):
        if self.real_robot:
            if self.platform is not None:
                raise RuntimeError("Once started, this environment cannot be reset.")
            self.platform = robot_fingers.TriFingerPlatformWithObjectFrontend()
        else:
            del self.platform
            self.platform = trifinger_simulation.TriFingerPlatform(
                visualization=False, initial_object_pose=move_cube.sample_goal(difficulty=-1)
            )
        self.step_count = 0
        return self.step(self._initial_action)[0]

    def step(self, action):
        reward = 0.0
        for _ in range(self.step_size):
            self.step_count += 1
            if self.step_count > self.steps:
                raise RuntimeError("Exceeded number of steps for one episode.")
            robot_action = self.platform.Action(position=action)
            t = self.platform.append_desired_action(robot_action)
            # Like in simulation: the observation after the action.
            observation = self.platform.get_robot_observation(t)
            camera_observation = self.platform.get_camera_observation(t)
            pose = camera_observation.filtered_object_pose
            reward += self.compute_reward(pose)
        result = {
            "robot_position": observation.position,
            "robot_torque": observation.torque,
            "object": {"position": pose.position, "orientation": pose.orientation},
        }
        return result, reward, self.step_count >= self.steps, {}


def main():
    real_robot = sys.argv[1] == "real"
    move_cube.seed(1)
    goal = move_cube.sample_goal(difficulty=3).to_dict()
    move_cube.validate_goal(goal)
    env = CubeGymEnvironment(goal, 3, 300, real_robot)
    observation = env.reset()
    total, is_done = 0.0, False
    while not is_done:
        target = np.clip(
            observation["robot_position"] + 0.01,
            trifingerpro_limits.robot_position.low,
            trifingerpro_limits.robot_position.high,
        )
        observation, reward, is_done, _ = env.step(target)
        total += reward
    print(f"reward {total:.4f} after {env.step_count} steps")


if __name__ == "__main__":
    main()
