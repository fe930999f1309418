# SPDX-License-Identifier: BSD-3-Clause
"""A task of your own for the environment: hold the middle of the three tips at a goal.

The task says what a goal is, what is achieved, and how good that is. Everything else, such as
observations, actions and spaces, is the environment's.
"""

import numpy as np
from trifinger.environments import Environment, Options
from trifinger.tasks import Random, Start, Task, View


class Middle(Task):
    """Hold the middle of the three tips at a goal."""

    name = "middle"
    options = Options(duration=2.0, action="position_change")
    goal_low = (-0.05, -0.05, 0.08)
    goal_high = (0.05, 0.05, 0.14)

    def draw_start(self, random: Random) -> Start:
        self.nearest = np.inf  # data of an episode
        return Start()

    def achieve(self, view: View) -> np.ndarray:
        return view.tips.mean(axis=0)

    def reward(self, achieved: np.ndarray, desired: np.ndarray) -> float:
        distance = float(np.linalg.norm(achieved - desired))
        self.nearest = min(self.nearest, distance)
        return -distance


task = Middle()
environment = Environment(task)
print(environment.observation_space, environment.action_space)
observation, info = environment.reset(seed=1)
random = np.random.default_rng(1)
steps, total, truncated = 0, 0.0, False
while not truncated:
    action = random.uniform(-1, 1, environment.action_space.shape).astype(np.float32)
    observation, reward, terminated, truncated, info = environment.step(action)
    assert reward == -np.linalg.norm(info["achieved_goal"] - info["desired_goal"])
    steps, total = steps + 1, total + reward
environment.close()
print(f"{steps} random actions: mean distance {-1e3 * total / steps:.0f} mm, nearest", end=" ")
print(f"{1e3 * task.nearest:.0f} mm")
assert steps == 100
assert 0 < task.nearest < -total / steps
