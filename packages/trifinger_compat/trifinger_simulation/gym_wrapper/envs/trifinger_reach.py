# SPDX-License-Identifier: BSD-3-Clause
"""Reaching random positions with the tips, as an environment of the old Gym."""

from typing import Any

import numpy as np
from trifinger_compat.gym_environment import OldEnvironment

from trifinger_simulation import sample
from trifinger_simulation.gym_wrapper.finger_spaces import FingerSpaces
from trifinger_simulation.gym_wrapper.utils import scale, unscale
from trifinger_simulation.sim_finger import SimFinger

_KEYS = ("end_effector_position", "joint_positions", "joint_velocities", "goal_position")


class TriFingerReach(OldEnvironment):
    """The tips of a robot go to random positions; everything is scaled to -1 to 1."""

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
        """`control_rate_s` is the time of an action [s]."""
        super().__init__()
        del finger_config_suffix, synchronize
        if use_real_robot:
            raise NotImplementedError(
                "use trifinger.environments for a real robot: `trifinger/Reach` with a `robot`"
            )
        self.finger = SimFinger(finger_type, 0.001, enable_visualization)
        count = self.finger.number_of_fingers
        self.steps_per_control = round(control_rate_s / 0.001)
        self.smoothing_params = smoothing_params
        self._spaces = FingerSpaces(count, _KEYS, [3 * count] * 4, separate_goals=True)
        self.action_space = self._spaces.get_scaled_action_space()
        self._unscaled_space = self._spaces.get_unscaled_observation_space()
        self.observation_space = self._spaces.get_scaled_observation_space()
        self.goal: Any = None
        self._smoothed: Any = None
        self._episodes = 0

    def step(self, action: Any) -> Any:
        """Goes to joint positions; gives observation, reward, done and info."""
        wanted = unscale(action, self._spaces.get_unscaled_action_space())
        wanted = self._smooth(wanted)
        t = -1
        for _ in range(self.steps_per_control):
            t = self.finger.append_desired_action(self.finger.Action(position=wanted))
        observation = self.finger.get_observation(t + 1)
        tips = np.array(self.finger.kinematics.forward_kinematics(observation.position)).ravel()
        reward = -float(np.linalg.norm(tips - self.goal)) * self.steps_per_control
        return self._scaled(observation, tips), reward, False, {}

    def _smooth(self, wanted: Any) -> Any:
        if self.smoothing_params is None:
            return wanted
        parameters = self.smoothing_params
        begin, end = parameters["start_after"], parameters["stop_after"]
        total = parameters["num_episodes"]
        share = (self._episodes / total - begin) / max(end - begin, 1e-9)
        alpha = parameters["final_alpha"] * float(np.clip(share, 0, 1))
        if self._smoothed is not None:
            wanted = alpha * self._smoothed + (1 - alpha) * wanted
        self._smoothed = wanted
        return wanted

    def reset(self, **_: Any) -> Any:
        """Begins an episode with another goal and gives the first observation."""
        bounds = self._spaces.action_bounds
        draw = sample.feasible_random_joint_positions_for_reaching
        begin, end = draw(self.finger, bounds), draw(self.finger, bounds)
        observation = self.finger.reset_finger_positions_and_velocities(begin)
        kinematics = self.finger.kinematics
        self.goal = np.array(kinematics.forward_kinematics(end)).ravel()
        self._smoothed = None
        self._episodes += 1
        return self._scaled(observation, np.array(kinematics.forward_kinematics(begin)).ravel())

    def _scaled(self, observation: Any, tips: Any) -> Any:
        parts = (tips, observation.position, observation.velocity, self.goal)
        return scale(np.concatenate(parts), self._unscaled_space)
