# SPDX-License-Identifier: BSD-3-Clause
"""Tasks that are written in Python."""

from typing import Any

import numpy as np
import pytest
import trifinger
from gymnasium.utils.env_checker import check_env
from trifinger.environments import Environment, GoalEnvironment, Options, VectorEnvironment
from trifinger.tasks import Random, Start, Task, View

pytestmark = pytest.mark.bindings

CUBE = {"objects": [{"name": "cube", "type": "cube"}]}


class Middle(Task):
    name = "middle"
    options = Options(duration=0.4, action="position_change")
    goal_low = (-0.05, -0.05, 0.08)
    goal_high = (0.05, 0.05, 0.14)

    def achieve(self, view: View) -> Any:
        self.view = view
        return view.tips.mean(axis=0)


class Reach(Task):
    """The task "reach", once more."""

    name = "reach"
    options = Options.of("reach")
    has_goals_of_fingers = True
    goal_low = (-0.3, -0.3, 0.0) * 3
    goal_high = (0.3, 0.3, 0.5) * 3

    def achieve(self, view: View) -> Any:
        return view.tips.ravel()

    def reward(self, achieved: Any, desired: Any) -> float:
        return -float(np.linalg.norm((achieved - desired).reshape(3, 3), axis=1).sum()) / 3


class Push(Task):
    """The cube is put somewhere by the task itself."""

    name = "place"
    config_overrides = CUBE
    object_name = "cube"
    goal_low = (-0.1, -0.1)
    goal_high = (0.1, 0.1)

    def draw_start(self, random: Random) -> Start:
        x, y = random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1)
        self.place = (x, y)
        return Start(object_position=[x, y, 0.0325])

    def achieve(self, view: View) -> Any:
        return view.object_position[:2]

    def num_goals(self, time: float) -> int:
        return 1 + int(time / 0.5)

    def has_ended(self, view: View) -> bool:
        return view.time > 0.9


def run(environment: Environment, seed: int) -> list[Any]:
    """Rewards and observations under random actions."""
    random = np.random.default_rng(seed)
    seen: list[Any] = [environment.reset(seed=seed)[0].copy()]
    over = False
    while not over:
        action = random.uniform(-1, 1, 9).astype(np.float32)
        observation, reward, terminated, truncated, _ = environment.step(action)
        seen += [observation.copy(), reward]
        over = terminated or truncated
    environment.close()
    return seen


def test_gymnasium_finds_nothing_wrong_with_it() -> None:
    check_env(Environment(Middle()), skip_render_check=True)


def test_episodes_of_a_seed_are_the_same_again() -> None:
    one, other = run(Environment(Middle()), 3), run(Environment(Middle()), 3)
    assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))
    assert not np.array_equal(run(Environment(Middle()), 4)[0], one[0])


def test_what_it_sees_are_the_tips() -> None:
    task = Middle()
    environment = Environment(task)
    environment.reset(seed=1)
    kinematics = trifinger.Kinematics("trifinger_edu")
    position = environment.process.robot.latest_observation().position
    tips = np.asarray(kinematics.tip_positions(position)).reshape(3, 3)
    assert task.view.tips == pytest.approx(tips, abs=1e-9)
    assert task.view.time == 0.0


def test_the_same_task_in_python_rewards_as_that_in_cpp() -> None:
    own, known = Environment(Reach()), Environment("reach")
    _, info = own.reset(seed=5)
    known.reset(seed=5)
    achieved = np.random.default_rng(1).uniform(-0.2, 0.2, (20, 9))
    desired = np.repeat(info["desired_goal"][None], 20, axis=0)
    rewards = own.unwrapped._core.compute_reward(achieved, desired)
    assert rewards == pytest.approx(known._core.compute_reward(achieved, desired))


def test_it_can_place_an_object_change_its_goal_and_end_an_episode() -> None:
    task = Push()
    environment = Environment(task)
    _, info = environment.reset(seed=2)
    assert info["achieved_goal"] == pytest.approx(task.place, abs=1e-3)
    goals, terminated, steps = [info["desired_goal"].copy()], False, 0
    while not terminated:
        _, _, terminated, truncated, info = environment.step(np.zeros(9, np.float32))
        assert not truncated
        goals.append(info["desired_goal"].copy())
        steps += 1
    assert steps == 46
    assert len(np.unique(goals, axis=0)) == 2


def test_goal_conditioned_environments_take_it() -> None:
    environment = GoalEnvironment(Middle())
    observation, _ = environment.reset(seed=1)
    assert observation["desired_goal"].shape == (3,)


class Mistaken(Middle):
    def achieve(self, view: View) -> Any:
        if view.time > 0.1:
            raise LookupError("where is it?")
        return super().achieve(view)


class WrongSize(Middle):
    def achieve(self, view: View) -> Any:
        return [1.0]


class NoGoal(Task):
    pass


def test_its_mistakes_are_errors_that_say_what_is_wrong() -> None:
    environment = Environment(Mistaken())
    environment.reset(seed=1)
    for _ in range(5):
        environment.step(np.zeros(9, np.float32))
    with pytest.raises(LookupError, match="where is it"):
        environment.step(np.zeros(9, np.float32))
    with pytest.raises(trifinger.InvalidArgument, match=r"achieve\(\) has 1 numbers, must have 3"):
        Environment(WrongSize()).reset(seed=1)
    with pytest.raises(trifinger.InvalidArgument, match="have 0 numbers, must have 1 to 9"):
        Environment(NoGoal())
    with pytest.raises(trifinger.InvalidArgument, match="task is in Python"):
        VectorEnvironment(Middle(), 2)  # type: ignore[arg-type]
