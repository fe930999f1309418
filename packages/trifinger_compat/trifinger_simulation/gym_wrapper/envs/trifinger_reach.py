# SPDX-License-Identifier: BSD-3-Clause
"""Reaching random positions with the tips, as an environment of the old Gym."""

from math import radians
from typing import Any

import numpy as np
from trifinger_compat.gym_environment import OldEnvironment
from trifinger_compat.spaces import box

from trifinger_simulation import sample
from trifinger_simulation.sim_finger import SimFinger

_LOW = np.array([radians(-70), radians(-70), radians(-160)])
_HIGH = np.array([radians(70), radians(0), radians(-2)])
_JOINTS_LOW = np.array([radians(-90), radians(-90), radians(-172)])
_JOINTS_HIGH = np.array([radians(90), radians(100), radians(-2)])


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
        self._low, self._high = np.tile(_LOW, count), np.tile(_HIGH, count)
        self._joints = (np.tile(_JOINTS_LOW, count), np.tile(_JOINTS_HIGH, count))
        self._speeds = (np.full(3 * count, -20.0), np.full(3 * count, 20.0))
        self._goals = (np.full(3 * count, -0.5), np.full(3 * count, 0.5))
        self._tips = (np.tile([-0.5, -0.5, 0.0], count), np.full(3 * count, 0.5))
        size = 12 * count
        self.action_space = box(-np.ones(3 * count), np.ones(3 * count), "float64")
        self.observation_space = box(-np.ones(size), np.ones(size), "float64")
        self.goal: Any = None
        self._smoothed: Any = None
        self._episodes = 0

    def step(self, action: Any) -> Any:
        """Goes to joint positions; gives observation, reward, done and info."""
        wanted = self._low + (np.asarray(action, dtype=float) + 1) / 2 * (self._high - self._low)
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
        bounds = {"low": self._low, "high": self._high}
        draw = sample.feasible_random_joint_positions_for_reaching
        begin, end = draw(self.finger, bounds), draw(self.finger, bounds)
        observation = self.finger.reset_finger_positions_and_velocities(begin)
        kinematics = self.finger.kinematics
        self.goal = np.array(kinematics.forward_kinematics(end)).ravel()
        self._smoothed = None
        self._episodes += 1
        return self._scaled(observation, np.array(kinematics.forward_kinematics(begin)).ravel())

    def _scaled(self, observation: Any, tips: Any) -> Any:
        parts = (
            (tips, self._tips),
            (observation.position, self._joints),
            (observation.velocity, self._speeds),
            (self.goal, self._goals),
        )
        return np.concatenate(
            [2 * (values - low) / (high - low) - 1 for values, (low, high) in parts]
        )
