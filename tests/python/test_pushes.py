# SPDX-License-Identifier: BSD-3-Clause
"""More transitions of a push: what is made of one could have happened as well."""

from typing import Any

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

import trifinger
from gymnasium.vector import AutoresetMode
from scipy.spatial.transform import Rotation
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from trifinger.arrays import Array
from trifinger.environments import VectorEnvironment
from trifinger.errors import InvalidArgument
from trifinger.training import Plan
from trifinger.training.algorithm import ClassModel
from trifinger.training.experience import INTERVENTION, TRUNCATED, Transition
from trifinger.training.learner import Learner
from trifinger.training.model import rows_of
from trifinger.training.pushes import Pushes, fingers_of, offsets_of, turn_of

# isort: split
import torch

PLAN = Plan.of("push", "rlpd")


def pushes(**settings: object) -> Pushes:
    plan = Plan.of("push", "rlpd", settings=settings)
    return Pushes(plan, rows_of(plan, 1))


@pytest.fixture(scope="module")
def lived() -> tuple[Array, Array, Array, Array]:
    """What 64 robots saw before and after an action, those actions, and the rewards of the task."""
    many = VectorEnvironment(
        "push", 64, options=PLAN.options, num_threads=1, autoreset_mode=AutoresetMode.DISABLED
    )
    rng = np.random.default_rng(1)
    before, _ = many.reset(seed=5)
    for _ in range(4):
        before = before.copy()
        actions = rng.uniform(-1, 1, (64, 9)).astype(np.float32)
        after, rewards, *_ = many.step(actions)
    return before, actions, after.copy(), rewards


def samples(lived: tuple[Array, Array, Array, Array]) -> ReplayBufferSamples:
    before, actions, after, rewards = (one.astype(np.float32) for one in lived)
    arrays = before, actions, after, np.zeros((64, 1), np.float32), rewards[:, None]
    return ReplayBufferSamples(*(torch.from_numpy(one.copy()) for one in arrays))


def test_without_other_goals_and_turns_nothing_changes(lived) -> None:
    made = pushes(relabelled=0.0, symmetry=False)(samples(lived), lived[2], lived[0])
    for one, other in zip(made[:5], samples(lived)[:5], strict=True):
        torch.testing.assert_close(one, other)


def test_rewards_are_those_of_the_simulation_also_of_turned_transitions(lived) -> None:
    # The goals are the own ones, so the rewards are what the simulation gave, times their scale.
    make = pushes(relabelled=1e-12, approach=0.0)
    made = make(samples(lived), lived[2], lived[0])
    assert (made.observations != samples(lived).observations).any()
    torch.testing.assert_close(made.rewards, 10 * samples(lived).rewards, atol=1e-4, rtol=1e-4)
    for seen in (made.observations, made.next_observations):
        assert seen.abs().max() <= 1.0 + 1e-6


def test_turned_transitions_are_as_near_to_a_push(lived) -> None:
    plain = pushes(relabelled=1e-12, symmetry=False)(samples(lived), lived[2], lived[0])
    turned = pushes(relabelled=1e-12)(samples(lived), lived[2], lived[0])
    torch.testing.assert_close(plain.rewards, turned.rewards, atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("third", [1, 2])
def test_a_turned_robot_does_what_the_turned_observation_says(third: int) -> None:
    rng = np.random.default_rng(0)
    actions = rng.uniform(-0.5, 0.5, (3, 9)).astype(np.float32)
    seen = []
    flat = pushes()._flat
    for order in (np.arange(9), fingers_of(third)):
        robot = VectorEnvironment(
            "push", 1, options=PLAN.options, num_threads=1, autoreset_mode=AutoresetMode.DISABLED
        )
        robot.reset(seed=3)  # a cube far from all tips
        for one in actions:
            observation, *_ = robot.step(one[order][None])
        seen.append(observation[0].copy())
    matrix = turn_of(flat, third, 0)
    of_robot = [place for name in ("joint_position", "tip_position") for place in flat[name][0]]
    np.testing.assert_allclose((matrix @ seen[0])[of_robot], seen[1][of_robot], atol=0.01)


def test_a_turned_cube_looks_turned() -> None:
    flat = pushes()._flat
    places = flat["object_orientation"][0]
    for seed in range(20):  # also cubes that stand on an edge
        orientation = Rotation.random(random_state=seed)
        seen = np.zeros(37)
        seen[places] = np.roll(orientation.as_quat(), 1)
        for third in range(3):
            for quarter in range(4):
                table = Rotation.from_euler("z", 120 * third, degrees=True)
                cube = Rotation.from_euler("z", 90 * quarter, degrees=True)
                turned = (turn_of(flat, third, quarter) @ seen)[places]
                apart = Rotation.from_quat(np.roll(turned, -1)).inv() * table * orientation * cube
                assert apart.magnitude() < 1e-5


def test_other_goals_are_those_of_others_or_where_the_cube_came_to(lived) -> None:
    before, _, after, _ = lived
    make = pushes(relabelled=1.0, symmetry=False)
    made = make(samples(lived), np.roll(after, 1, axis=0), np.roll(before, 2, axis=0))
    place = make._flat["goal"][0]
    goals = made.observations.numpy()[:, place]
    cube = make._rows.entries(np.roll(after, 1, axis=0))["object_position"]
    bound = make._flat["goal"][2]
    reached = np.abs(goals[:, :2] - cube[:, :2] / bound[:2]).max(axis=1) < 1e-5
    of_others = np.abs(goals[:, :2] - np.roll(before, 2, axis=0)[:, place[:2]]).max(axis=1) < 1e-6
    assert (reached | of_others).all()
    assert reached.any()
    assert of_others.any()
    np.testing.assert_array_equal(goals, made.next_observations.numpy()[:, place])


def test_offsets_are_from_the_cube_to_goal_and_tips(lived) -> None:
    make = pushes()
    seen = make._rows.entries(lived[0])
    cube = seen["object_position"][:, None, :2]
    ends = [seen["goal"][:, None, :2], seen["tip_position"].reshape(-1, 3, 3)[..., :2]]
    expected = (np.concatenate(ends, axis=1) - cube).reshape(-1, 8) / 0.2
    np.testing.assert_allclose(lived[0] @ offsets_of(make._flat).T, expected, atol=1e-5)


def test_the_file_of_a_policy_has_offsets_in_its_first_layer(lived, tmp_path) -> None:
    model = ClassModel(PLAN, pushes()._rows, 10)
    model.export(tmp_path / "p.policy", {})
    seen = torch.from_numpy(lived[0])
    more = torch.cat([seen, seen @ torch.from_numpy(offsets_of(pushes()._flat)).float().T], 1)
    expected = model._algorithm.actor()(more).detach().numpy()
    policy = trifinger.Policy(tmp_path / "p.policy")
    acted = [policy(row) for row in lived[0]]
    np.testing.assert_allclose(acted, expected, atol=1e-4)


@pytest.mark.parametrize(
    ("task", "algorithm", "settings"),
    [
        ("reach", "rlpd", {"symmetry": True}),
        ("lift", "rlpd", {"offsets": True}),
        ("lift", "rlpd", {"relabelled": 0.5}),
        ("push", "ddpg", {"symmetry": True}),
    ],
)
def test_only_pushes_by_classes_are_turned(task, algorithm, settings) -> None:
    with pytest.raises(InvalidArgument, match="are for pushes of a TriFinger"):
        Plan.of(task, algorithm, settings=settings)


def test_a_setting_changes_the_algorithm_as_its_argument_does() -> None:
    by_setting = Plan.of("push", "ddpg", settings={"algorithm": "rlpd"})
    assert by_setting == Plan.of("push", "rlpd")
    with pytest.raises(InvalidArgument, match="no algorithm 'rldp'"):
        Plan.of("push", "ddpg", settings={"algorithm": "rldp"})


def test_an_observation_with_the_last_action_is_turned_whole() -> None:
    make = pushes(mapping="state_augmentation")
    whole = sum(len(places) for places, _, _ in make._flat.values())
    action = make._flat["action"][0]
    seen = np.zeros(whole)
    seen[action] = np.arange(9)
    turned = turn_of(make._flat, 1, 0) @ seen
    np.testing.assert_array_equal(turned[action], np.arange(9)[fingers_of(1)])


def test_the_learner_draws_turned_pushes_and_shown_ones_have_no_goals_of_others(lived) -> None:
    before, actions, after, rewards = lived
    learner = Learner(Plan.of("push", "rlpd", settings={"relabelled": 1.0, "symmetry": False}))
    for i in range(64):
        flags = INTERVENTION if i < 32 else TRUNCATED
        element = {
            "observation": after[i], "action": actions[i], "reward": rewards[i], "flags": flags,
            "achieved": after[i, 27:30], "desired": after[i, 34:37],
        }  # fmt: skip
        learner._remember(Transition({"observation": before[i]}, element, is_cut=True))
    memory = learner._model.memory
    drawn = memory.sample(400)
    assert memory.demonstrated(400) == 200
    make = pushes()
    goal, flat = make._goal, make._flat
    for row, action in zip(drawn.observations[:200].numpy(), drawn.actions[:200], strict=True):
        (own,) = np.flatnonzero(np.all(actions[:32] == action.numpy(), axis=1))
        reached = pushes_reached(after[own], flat)
        assert np.array_equal(row[goal], before[own, goal]) or np.allclose(row[goal], reached)


def pushes_reached(seen: Array, flat: Any) -> Array:
    places, low, high = flat["object_position"]
    _, goal_low, goal_high = flat["goal"]
    place = low + 0.5 * (seen[places] + 1) * (high - low)
    return (2 * (place - goal_low) / (goal_high - goal_low) - 1)[:2]
