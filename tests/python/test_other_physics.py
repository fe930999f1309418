# SPDX-License-Identifier: BSD-3-Clause
"""Simulations that others move: here MuJoCo itself, which must give the same bits."""

from typing import Any

import mujoco
import numpy as np
import pytest
from conftest import ALL_THAT_VARIES
from gymnasium.vector import AutoresetMode
from trifinger import _trifinger
from trifinger.environments import Options, VectorEnvironment
from trifinger.errors import Error, InvalidArgument
from trifinger.tasks import Task, View

COUNT = 3


class MujocoPhysics:
    """Moves one simulation after the other, each by a model of its own."""

    def __init__(self, core: _trifinger.EnvironmentBatch) -> None:
        self._core = core
        self._memory: dict[str, Any] = core.memory
        model = ("model.mjb", {"model.mjb": core.model_file})
        self._models = [mujoco.MjModel.from_binary_path(*model) for _ in range(len(core))]
        self._datas = [mujoco.MjData(one) for one in self._models]
        self.calls = 0
        self.fails_at = -1

    def __call__(self, moves: np.ndarray, models_changed: bool) -> None:
        self.calls += 1
        if self.calls == self.fails_at:
            raise Error("no more steps")
        if models_changed:
            for name in self._core.varied_fields:
                for model, numbers in zip(self._models, self._core.varied_field(name), strict=True):
                    field = getattr(model, name)
                    field[:] = numbers.reshape(field.shape)
        for i in np.flatnonzero(moves):
            data = self._datas[i]
            names = ("qpos", "qvel", "qacc_warmstart")
            for name in (*names, "ctrl"):
                getattr(data, name)[:] = self._memory[name][i]
            for _ in range(self._core.substeps):
                mujoco.mj_step(self._models[i], data)
            for name in names:
                self._memory[name][i] = getattr(data, name)


class Middle(Task):
    """A task in Python, which is asked about all robots at once, before and after the physics."""

    name = "middle"
    options = Options(duration=0.2, action="position_change")
    goal_low = (-0.05, -0.05, 0.08)
    goal_high = (0.05, 0.05, 0.14)

    def achieve(self, view: View) -> Any:
        return view.tips.mean(axis=1)


def pair(task: Any = "push", **arguments: Any) -> tuple[Any, Any, MujocoPhysics]:
    plain, other = (VectorEnvironment(task, COUNT, **arguments) for _ in range(2))
    physics = MujocoPhysics(other._core)
    other._core.set_physics(physics)
    return plain, other, physics


def told(environment: Any, results: tuple[Any, ...]) -> list[Any]:
    core = environment._core
    *numbers, info = results
    kept = [core.final_observation, core.final_scores, core.final_hidden, core.hidden]
    return [*numbers, info["fault"], info["achieved_goal"], *(one.copy() for one in kept)]


def assert_same(plain: Any, other: Any, calls: int) -> int:
    """Returns how many episodes have ended."""
    random = np.random.default_rng(1)
    ended = 0
    np.testing.assert_equal(*(told(one, one.reset(seed=5)) for one in (plain, other)))
    for _ in range(calls):
        action = random.uniform(-1.0, 1.0, plain.action_space.shape).astype(np.float32)
        results = [told(one, one.step(action)) for one in (plain, other)]
        np.testing.assert_equal(*results)
        ended += int((results[0][2] | results[0][3]).sum())
    return ended


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("physics_step", [0.001, 0.005])
def test_the_same_physics_give_the_same_bits(mode: AutoresetMode, physics_step: float) -> None:
    arguments = {"autoreset_mode": mode, "physics_step": physics_step, "duration": 0.2}
    plain, other, physics = pair(**arguments, **ALL_THAT_VARIES)
    assert assert_same(plain, other, 25) >= 2 * COUNT
    assert physics.calls > 0


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_tasks_in_python_are_the_same_too(mode: AutoresetMode) -> None:
    plain, other, _ = pair(f"{__name__}:Middle", autoreset_mode=mode)
    assert assert_same(plain, other, 25) >= 2 * COUNT


def test_a_robot_that_does_not_vary_has_no_fields_that_do() -> None:
    plain, other, _ = pair()
    assert other._core.varied_fields == []
    with pytest.raises(InvalidArgument, match="no field of the model called 'body_mass' varies"):
        other._core.varied_field("body_mass")
    assert_same(plain, other, 3)


def test_only_marked_simulations_are_reset() -> None:
    plain, other, _ = pair(autoreset_mode=AutoresetMode.DISABLED, **ALL_THAT_VARIES)
    assert_same(plain, other, 3)
    before = [other._core.configuration(i) for i in range(COUNT)]
    mask = np.array([False, True, False])
    for one in (plain, other):
        one.reset(options={"reset_mask": mask})
    after = [other._core.configuration(i) for i in range(COUNT)]
    assert [a == b for a, b in zip(before, after, strict=True)] == [True, False, True]
    action = np.zeros(plain.action_space.shape, np.float32)
    np.testing.assert_equal(*(told(one, one.step(action)) for one in (plain, other)))


def test_a_failure_of_the_physics_ends_the_episodes() -> None:
    plain, other, physics = pair()
    assert_same(plain, other, 1)
    physics.fails_at = physics.calls + 3
    action = np.zeros(plain.action_space.shape, np.float32)
    with pytest.raises(Error, match="no more steps"):
        other.step(action)
    assert other._core.truncated.all()
    _, _, _, truncated, _ = other.step(action)  # the next episodes
    assert not truncated.any()


def test_physics_that_are_gone_are_named() -> None:
    _, other, physics = pair()
    other.reset(seed=1)
    del physics
    with pytest.raises(Error, match="physics of these simulations are gone"):
        other.step(np.zeros(other.action_space.shape, np.float32))


def test_images_need_mujoco_itself() -> None:
    images = VectorEnvironment("push", 2, observation="images", camera_size=54)
    with pytest.raises(InvalidArgument, match="images need the physics of MuJoCo itself"):
        images._core.set_physics(MujocoPhysics(images._core))
