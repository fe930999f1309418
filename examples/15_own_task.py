# SPDX-License-Identifier: BSD-3-Clause
"""A task of your own: hold the middle of the three tips at a goal, with one robot and with many.

The task says what a goal is, what is achieved, and how good that is. Everything else, such as
observations, actions and spaces, is the environment's. All arrays have a row for each robot.

    trifinger train 15_own_task:Middle
"""

import numpy as np
from trifinger.environments import Environment, Options, VectorEnvironment
from trifinger.tasks import Random, Start, Task, View


class Middle(Task):
    """Hold the middle of the three tips at a goal."""

    name = "middle"
    options = Options(duration=2.0, action="position_change")
    goal_low = (-0.05, -0.05, 0.08)
    goal_high = (0.05, 0.05, 0.14)

    def prepare(self, num_robots: int) -> None:
        self.nearest = np.full(num_robots, np.inf)  # data of each robot

    def draw_start(self, random: Random) -> Start:
        self.nearest[random.robots] = np.inf
        return Start()

    def achieve(self, view: View) -> np.ndarray:
        middle = view.tips.mean(axis=1)
        distance = np.linalg.norm(middle - view.goal, axis=1)
        self.nearest[view.robots] = np.minimum(self.nearest[view.robots], distance)
        return middle

    def reward(self, achieved: np.ndarray, desired: np.ndarray) -> np.ndarray:
        return -np.linalg.norm(achieved - desired, axis=1)


if __name__ == "__main__":
    environment = Environment(Middle())
    print(environment.observation_space, environment.action_space)
    task = Middle()
    environments = VectorEnvironment(task, 16)
    observation, info = environment.reset(seed=1)
    observations, _ = environments.reset(seed=1)
    assert (observation == observations[0]).all()
    random = np.random.default_rng(1)
    steps, total, truncated = 0, 0.0, False
    while not truncated:
        actions = random.uniform(-1, 1, environments.action_space.shape).astype(np.float32)
        observation, reward, terminated, truncated, info = environment.step(actions[0])
        observations, rewards, *_ = environments.step(actions)
        assert reward == rewards[0]  # to the last bit
        assert np.isclose(reward, -np.linalg.norm(info["achieved_goal"] - info["desired_goal"]))
        steps, total = steps + 1, total + rewards.mean()
    environment.close()
    print(f"{steps} random actions of {len(rewards)} robots: mean distance", end=" ")
    print(f"{-1e3 * total / steps:.0f} mm, nearest {1e3 * task.nearest.mean():.0f} mm")
    assert steps == 100
    assert 0 < task.nearest.mean() < -total / steps
