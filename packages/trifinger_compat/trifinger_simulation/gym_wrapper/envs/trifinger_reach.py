# SPDX-License-Identifier: BSD-3-Clause
"""Reaching random positions with the tips, as an environment of the old Gym."""

from math import inf
from typing import Any

import numpy as np
from trifinger_compat.gym_environment import OldEnvironment
from trifinger_compat.types import Array

from trifinger_simulation import sample
from trifinger_simulation.gym_wrapper.data_logger import DataLogger
from trifinger_simulation.gym_wrapper.finger_spaces import FingerSpaces
from trifinger_simulation.gym_wrapper.utils import compute_distance, scale, unscale
from trifinger_simulation.sim_finger import SimFinger


class TriFingerReach(OldEnvironment):
    """The tips of a robot go to random positions; everything is scaled to -1 to 1.

    An observation is that of the first step of an action, before it acts.
    """

    _keys: tuple[str, ...] = (
        "joint_positions",
        "joint_velocities",
        "goal_position",
        "action_joint_positions",
    )
    _has_separate_goals = True

    def __init__(
        self,
        control_rate_s: float = 0.02,
        finger_type: str = "trifingerone",
        enable_visualization: bool = False,
        smoothing_params: dict[str, Any] | None = None,
        use_real_robot: bool = False,
        finger_config_suffix: str = "0",
        synchronize: bool = False,
    ) -> None:
        """`control_rate_s` is the time of an action [s].

        `smoothing_params` has `num_episodes`, `start_after`, `stop_after` and `final_alpha`:
        between these shares of the episodes, more and more of the action before is mixed into an
        action. With `is_test`, it is `final_alpha` from the beginning.
        """
        super().__init__()
        del finger_config_suffix, synchronize
        if use_real_robot:
            raise NotImplementedError(
                "use trifinger.environments for a real robot: `trifinger/Reach` with a `robot`"
            )
        self.finger = SimFinger(finger_type, 0.001, enable_visualization)
        self.steps_per_control = round(control_rate_s / 0.001)
        self.logger = DataLogger()
        count = self.finger.number_of_fingers
        whole = {"goal_position": 3 * count if self._has_separate_goals else 3}
        sizes = [{**whole, "object_position": 3}.get(key, 3 * count) for key in self._keys]
        self.spaces = FingerSpaces(count, self._keys, sizes, self._has_separate_goals)
        self.unscaled_observation_space = self.spaces.get_unscaled_observation_space()
        self.unscaled_action_space = self.spaces.get_unscaled_action_space()
        self.observation_space = self.spaces.get_scaled_observation_space()
        self.action_space = self.spaces.get_scaled_action_space()
        self.goal: Any = None
        self.episode_count = 0
        self.smoothed_action: Array | None = None
        self._set_smoothing(smoothing_params or {"is_test": True, "final_alpha": 0.0})

    def _set_smoothing(self, parameters: dict[str, Any]) -> None:
        if "is_test" in parameters:
            self.smoothing_alpha = parameters["final_alpha"]
            self._smoothed_episodes: tuple[float, float] = (0, inf)
            self._smoothing_step = 0.0
            return
        total = parameters["num_episodes"]
        begin, end = (int(total * parameters[name]) for name in ("start_after", "stop_after"))
        self.smoothing_alpha = 0.0
        self._smoothed_episodes = (begin, end)
        self._smoothing_step = parameters["final_alpha"] / (end - begin)

    def update_smoothing(self) -> None:
        """Makes the smoothing of the next episode stronger, if this is its time."""
        begin, end = self._smoothed_episodes
        if begin <= self.episode_count < end:
            self.smoothing_alpha += self._smoothing_step

    def step(self, action: Any) -> Any:
        """Goes to joint positions; gives observation, reward, done and info."""
        wanted = unscale(action, self.unscaled_action_space)
        before = wanted if self.smoothed_action is None else self.smoothed_action
        self.smoothed_action = self.smoothing_alpha * before + (1 - self.smoothing_alpha) * wanted
        state = self._act(self.smoothed_action)
        joints = state[self.spaces.key_to_index["joint_positions"]]
        tips = self.finger.kinematics.forward_kinematics(joints)
        reward = -compute_distance(tips, self.goal) * self.steps_per_control
        return self._scaled(state), reward, False, {"is_success": np.float32(0)}

    def _act(self, wanted: Array) -> Array:
        """Goes to joint positions [rad] and returns the state at the first step."""
        action = self.finger.Action(position=wanted)
        state: Array | None = None
        for _ in range(self.steps_per_control):
            t = self.finger.append_desired_action(action)
            if state is None:
                state = self._state(self.finger.get_observation(t), wanted)
        assert state is not None  # noqa: S101  # an action has at least one step
        return state

    def reset(self, **_: Any) -> Any:
        """Begins an episode with another goal and gives the first observation."""
        self.update_smoothing()
        self.episode_count += 1
        self.smoothed_action = None
        begin, end = self._random_pose(), self._random_pose()
        observation = self.finger.reset_finger_positions_and_velocities(begin)
        self.goal = self.finger.kinematics.forward_kinematics(end)
        self.logger.new_episode(end, self.goal)
        return self._scaled(self._state(observation, begin))

    def _random_pose(self) -> Array:
        bounds = self.spaces.action_bounds
        return sample.feasible_random_joint_positions_for_reaching(self.finger, bounds)

    def _state(self, observation: Any, action: Array) -> Array:
        """The parts of an observation, not scaled."""
        tips = self.finger.kinematics.forward_kinematics(observation.position)
        self.logger.append(observation.position, np.ravel(tips), self.finger._t)
        parts = {
            "joint_positions": observation.position,
            "joint_velocities": observation.velocity,
            "goal_position": np.ravel(self.goal),
            "action_joint_positions": action,
            **self._more_parts(),
        }
        return np.concatenate([parts[key] for key in self._keys])

    def _more_parts(self) -> dict[str, Any]:
        return {}

    def _scaled(self, state: Array) -> Any:
        return scale(state, self.unscaled_observation_space)
