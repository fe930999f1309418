# SPDX-License-Identifier: BSD-3-Clause
"""RLPD on a problem whose best policy is known, and what checkpoints have of it."""

import dataclasses

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

import torch
from trifinger.training.algorithm import Batch
from trifinger.training.checkpoint import dump, learned_by, load, restore_learned
from trifinger.training.plan import Recipe
from trifinger.training.rlpd import Rlpd

GAMMA, STEP, EFFORT = 0.9, 0.5, 0.2
SHOWN = 0.7
RECIPE = Recipe(gamma=GAMMA, layers=(64, 64), learning_rate=1e-3)


# x' = x + STEP u costs x'^2 + EFFORT u^2: the best u is a share of x, by Riccati's equation.
def best_share() -> float:
    value = 1.0
    for _ in range(100):
        weight = 1 + GAMMA * value
        share = weight * STEP / (EFFORT + weight * STEP**2)
        value = weight * (1 - STEP * share) ** 2 + EFFORT * share**2
    return -share


# The second number never varies, as the height of an object on the table.
# The first rows are demonstrations of an action that is not the best one.
def draw(size: int, shown: int = 0) -> Batch:
    place, action = torch.rand(size) * 2 - 1, torch.rand(size, 1) * 2 - 1
    action[:shown] = SHOWN
    then = place + STEP * action[:, 0]
    still = torch.full((size,), 0.3)
    return Batch(
        torch.stack([0.2 + 0.05 * place, still], 1),  # small, and not around zero
        action,
        -then.square() - EFFORT * action[:, 0].square(),
        torch.stack([0.2 + 0.05 * then, still], 1),
        torch.zeros(size),
        (torch.arange(size) < shown).float(),
        progress=0.0,
    )


@pytest.fixture(scope="module")
def learned() -> Rlpd:
    torch.set_num_threads(1)
    torch.manual_seed(1)
    algorithm = Rlpd(2, 1, RECIPE)
    for _ in range(600):
        algorithm.update(draw(128))
    return algorithm


def test_finds_the_best_policy_of_a_linear_system_with_a_quadratic_cost(learned):
    places = torch.linspace(-0.6, 0.6, 13)
    with torch.no_grad():
        seen = torch.stack([0.2 + 0.05 * places, torch.full_like(places, 0.3)], 1)
        actions = learned.actor()(seen)[:, 0]
    np.testing.assert_allclose(actions, (best_share() * places).clamp(-1, 1), atol=0.12)


def test_after_the_end_of_a_task_nothing_has_a_value():
    torch.manual_seed(1)
    algorithm = Rlpd(2, 1, RECIPE)
    for _ in range(200):
        batch = draw(64)._replace(rewards=torch.full((64,), 3.0), terminated=torch.ones(64))
        losses = algorithm.update(batch)
    assert losses["critic_loss"] < 0.05
    assert losses["value"] == pytest.approx(3.0, abs=0.2)


def test_imitates_demonstrations_less_and_less():
    torch.manual_seed(1)
    away = []
    for progress in (0.0, 1.0):
        algorithm = Rlpd(2, 1, dataclasses.replace(RECIPE, imitation=20.0))
        for _ in range(300):
            algorithm.update(draw(64, shown=32)._replace(progress=progress))
        with torch.no_grad():
            away.append((algorithm.actor()(draw(64).observations) - SHOWN).abs().mean())
    assert away[0] < 0.1
    assert away[1] > 0.3


def test_goes_on_from_a_checkpoint_bit_for_bit(learned):
    torch.manual_seed(2)
    batch, other = draw(32), Rlpd(2, 1, RECIPE)
    restore_learned(other, load(dump(learned_by(learned))))
    losses = []
    for algorithm in (learned, other):
        torch.manual_seed(3)
        losses.append([algorithm.update(batch) for _ in range(4)])
    assert losses[0] == losses[1]
    for own, copy in zip(learned.actor().parameters(), other.actor().parameters(), strict=True):
        assert torch.equal(own, copy)


def test_the_actor_is_a_copy_that_learning_does_not_change(learned):
    before = learned.actor()
    kept = [parameter.clone() for parameter in before.parameters()]
    for _ in range(2):
        learned.update(draw(32))
    for parameter, old in zip(before.parameters(), kept, strict=True):
        assert torch.equal(parameter, old)
