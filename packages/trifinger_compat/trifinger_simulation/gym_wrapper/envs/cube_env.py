# SPDX-License-Identifier: BSD-3-Clause
"""Moving the cube, as an environment of the old Gym."""

import enum
from typing import Any

import numpy as np
from trifinger_compat.gym_environment import OldEnvironment, dict_space

from trifinger_simulation.tasks import move_cube as _move_cube
from trifinger_simulation.trifinger_platform import TriFingerPlatform


class RandomInitializer:
    """Begins each episode at random."""

    _task: Any = _move_cube

    def __init__(self, difficulty: int) -> None:
        self.difficulty = difficulty

    def get_initial_state(self) -> Any:
        """Where the cube begins, a Pose."""
        return self._task.sample_goal(difficulty=-1)

    def get_goal(self) -> Any:
        """The goal, a Pose."""
        return self._task.sample_goal(difficulty=self.difficulty)


class FixedInitializer:
    """Begins each episode in the same way."""

    _task: Any = _move_cube

    def __init__(self, difficulty: int, initial_state: Any, goal: Any) -> None:
        """Raises like validate_goal() if one of the poses is not valid."""
        self._task.validate_goal(initial_state)
        self._task.validate_goal(goal)
        self.difficulty = difficulty
        self.initial_state = initial_state
        self.goal = goal

    def get_initial_state(self) -> Any:
        """Where the cube begins, a Pose."""
        return self.initial_state

    def get_goal(self) -> Any:
        """The goal, a Pose."""
        return self.goal


class ActionType(enum.Enum):
    """What an action is."""

    TORQUE = enum.auto()
    POSITION = enum.auto()
    TORQUE_AND_POSITION = enum.auto()


def action_space(action_type: ActionType, spaces: Any) -> Any:
    """The space of actions of a type."""
    match action_type:
        case ActionType.TORQUE:
            return spaces.robot_torque.gym
        case ActionType.POSITION:
            return spaces.robot_position.gym
        case ActionType.TORQUE_AND_POSITION:
            return dict_space(torque=spaces.robot_torque.gym, position=spaces.robot_position.gym)
    raise ValueError("Invalid action_type")


def to_robot_action(platform: Any, action_type: ActionType, action: Any) -> Any:
    """The robot's action of an action of the environment."""
    match action_type:
        case ActionType.TORQUE:
            return platform.Action(torque=action)
        case ActionType.POSITION:
            return platform.Action(position=action)
    return platform.Action(torque=action["torque"], position=action["position"])


class PlatformEnvironment(OldEnvironment):
    """A task on the platform; the reward of a step is minus the sum of its costs."""

    _platform_class: type[Any] = TriFingerPlatform

    def __init__(
        self,
        initializer: Any,
        action_type: ActionType,
        visualization: bool,
        goal_space: Any,
        info: dict[str, Any],
    ) -> None:
        super().__init__()
        self.initializer = initializer
        self.action_type = action_type
        self.visualization = visualization
        spaces = self._platform_class.spaces
        self.action_space = action_space(action_type, spaces)
        self.observation_space = dict_space(
            observation=dict_space(
                position=spaces.robot_position.gym,
                velocity=spaces.robot_velocity.gym,
                torque=spaces.robot_torque.gym,
            ),
            desired_goal=goal_space,
            achieved_goal=goal_space,
        )
        self.platform: Any = None
        self.info = info
        self.step_count = 0

    def compute_reward(self, achieved_goal: Any, desired_goal: Any, info: Any) -> float:
        """Minus the cost of what was achieved."""
        raise NotImplementedError

    def _step(self, action: Any, steps: int, length: int, hint: str = "") -> Any:
        """Acts for some steps of the robot in an episode of `length`."""
        if self.platform is None:
            raise RuntimeError("Call `reset()` before starting to step.")
        if not self.action_space.contains(action):
            raise ValueError("Given action is not contained in the action space.")
        if self.step_count + steps > length:
            raise RuntimeError(f"the episode of {length} steps is over{hint}")
        reward = 0.0
        observation: Any = None
        for _ in range(steps):
            robot_action = to_robot_action(self.platform, self.action_type, action)
            t = self.platform.append_desired_action(robot_action)
            # What the action has done is to be seen one step later.
            self._advance_to(t + 1)
            observation = self._create_observation(t + 1)
            reward += self.compute_reward(
                observation["achieved_goal"], observation["desired_goal"], self.info
            )
        return observation, reward, self.step_count >= length, self.info

    def _advance_to(self, t: int) -> None:
        self.step_count = t

    def _robot_state(self, t: int) -> dict[str, Any]:
        robot = self.platform.get_robot_observation(t)
        return {"position": robot.position, "velocity": robot.velocity, "torque": robot.torque}

    def _create_observation(self, t: int) -> dict[str, Any]:
        raise NotImplementedError


class CubeEnv(PlatformEnvironment):
    """Moving the cube to a goal; the reward of a step is minus the sum of its costs."""

    _task: Any = _move_cube

    def __init__(
        self,
        initializer: Any,
        action_type: ActionType = ActionType.POSITION,
        frameskip: int = 1,
        visualization: bool = False,
    ) -> None:
        """`frameskip` is the number of steps of the robot in one step."""
        if frameskip < 1:
            raise ValueError("frameskip cannot be less than 1.")
        spaces = self._platform_class.spaces
        pose = dict_space(
            position=spaces.object_position.gym, orientation=spaces.object_orientation.gym
        )
        info = {"difficulty": initializer.difficulty}
        super().__init__(initializer, action_type, visualization, pose, info)
        self.frameskip = frameskip
        self.goal: Any = None

    def compute_reward(self, achieved_goal: Any, desired_goal: Any, info: Any) -> float:
        """Minus the cost of a pose."""
        cost = self._task.evaluate_state(desired_goal, achieved_goal, info["difficulty"])
        return -float(cost)

    def step(self, action: Any) -> Any:
        """Acts; gives observation, reward, done and info.

        Raises ValueError for an action that is not in the space, RuntimeError before the first
        reset and after the end.
        """
        length = self._task.episode_length
        return self._step(action, self.frameskip, length, "; call `reset()`")

    def reset(self, **_: Any) -> Any:
        """Begins an episode and gives the first observation."""
        # The old platform goes first.
        self.platform = None
        initial_pose = self.initializer.get_initial_state()
        goal = self.initializer.get_goal()
        self.platform = self._platform_class(
            visualization=self.visualization, initial_object_pose=initial_pose
        )
        self.goal = goal.to_dict()
        self.step_count = 0
        return self._create_observation(0)

    def seed(self, seed: int | None = None) -> list[int]:
        """Seeds actions, goals and initial states."""
        chosen = int(np.random.SeedSequence().generate_state(1)[0]) if seed is None else seed
        self.action_space.seed(chosen)
        self._task.random = np.random.RandomState(chosen % 2**32)
        return [chosen]

    def _create_observation(self, t: int) -> dict[str, Any]:
        pose = self._object_pose(t)
        return {
            "observation": self._robot_state(t),
            "desired_goal": self.goal,
            "achieved_goal": {"position": pose.position, "orientation": pose.orientation},
        }

    def _object_pose(self, t: int) -> Any:
        return self.platform.get_camera_observation(t).filtered_object_pose


class RealRobotChallengePhase1(CubeEnv):
    """The environment `real_robot_challenge_phase_1-v1`."""
