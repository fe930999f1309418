# SPDX-License-Identifier: BSD-3-Clause
"""MuJoCo Warp on its CPU device, against MuJoCo: `./run soak warp` has its packages."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco_warp", reason="MuJoCo Warp is missing: ./run soak warp")

from conftest import ALL_THAT_VARIES
from gymnasium.vector import AutoresetMode
from trifinger.environments import VectorEnvironment
from trifinger.errors import Error, InvalidArgument
from trifinger_gpu import WarpEnvironment
from trifinger_gpu.__main__ import main

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore"),  # of Warp, on a machine without a GPU
]

COUNT = 4
NEAR = 1e-4  # what may differ: [rad], [m], and of a quaternion
JOINTS = 9


def pair(**arguments: Any) -> tuple[VectorEnvironment, WarpEnvironment]:
    both = (
        VectorEnvironment("push", COUNT, num_threads=1, **arguments),
        WarpEnvironment("push", COUNT, num_threads=1, device="cpu", **arguments),
    )
    for environment in both:
        environment.reset(seed=7)
    return both


def positions(environment: VectorEnvironment) -> np.ndarray:
    rows = [environment._core.configuration(i) for i in range(COUNT)]
    return np.array(rows)[:, : JOINTS + 7]


# Each motor keeps its direction. In the first 200 ms a tip pushes a cube, and others the floor.
def some_action() -> np.ndarray:
    return np.random.default_rng(1).uniform(-1.0, 1.0, (COUNT, JOINTS)).astype(np.float32)


def largest_difference(exact: VectorEnvironment, warped: VectorEnvironment, actions: int) -> float:
    largest = 0.0
    for _ in range(actions):
        results = [one.step(some_action()) for one in (exact, warped)]
        assert not results[0][4]["fault"].any()
        np.testing.assert_allclose(results[1][1], results[0][1], atol=NEAR)  # rewards
        largest = max(largest, float(np.abs(positions(exact) - positions(warped)).max()))
    print(f"largest difference {largest:.1e}")
    return largest


@pytest.mark.parametrize(("physics_step", "actions"), [(0.001, 10), (0.004, 20)])
def test_a_hundred_steps_with_contacts_are_those_of_mujoco(
    physics_step: float, actions: int
) -> None:
    exact, warped = pair(physics_step=physics_step)
    begin = positions(exact)
    assert largest_difference(exact, warped, actions) < NEAR
    moved = np.abs(positions(exact) - begin)
    assert moved[:, JOINTS : JOINTS + 2].max() > 0.02  # a cube was pushed
    assert moved[:, :JOINTS].max() > 0.5


def test_each_simulation_varies_as_with_mujoco() -> None:
    exact, warped = pair(**ALL_THAT_VARIES)
    assert largest_difference(exact, warped, 10) < NEAR
    masses = warped._core.varied_field("body_mass")
    assert len(np.unique(masses[:, -1])) == COUNT
    np.testing.assert_allclose(warped._physics._model.body_mass.numpy(), masses, rtol=1e-6)


def test_one_simulation_is_reset_and_the_others_go_on() -> None:
    exact, warped = pair(autoreset_mode=AutoresetMode.DISABLED, **ALL_THAT_VARIES)
    assert largest_difference(exact, warped, 2) < NEAR
    before = positions(warped)
    mask = np.array([False, True, False, False])
    for one in (exact, warped):
        one.reset(options={"reset_mask": mask})
    assert (positions(warped) != before).any(axis=1).tolist() == mask.tolist()
    assert largest_difference(exact, warped, 5) < NEAR


def test_episodes_begin_again_in_the_same_step() -> None:
    exact, warped = pair(autoreset_mode=AutoresetMode.SAME_STEP, duration=0.1)
    assert largest_difference(exact, warped, 7) < NEAR


def test_too_little_room_for_contacts_is_an_error() -> None:
    environment = WarpEnvironment("push", COUNT, device="cpu", contacts=1, constraints=1)
    environment.reset(seed=7)
    with pytest.raises(Error, match="more contacts or constraints than Warp has room for"):
        environment.step(some_action())


def test_a_device_that_is_not_there_is_named() -> None:
    with pytest.raises(InvalidArgument, match="Warp has no device 'cuda:7', only cpu"):
        WarpEnvironment("push", 2, device="cuda:7")


def test_training_on_the_page_learns_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    short = "num_envs=4 rollout=10 epochs=1 batch_size=20 duration=0.2 layers=(16,16)"
    words = ["push", "--device", "cpu", "--episodes", "12", "-o", "my_push"]
    words += [word for one in short.split() for word in ("--set", one)]
    assert main(words) == 0
    policy = Path("my_push/push.policy").read_bytes()
    assert len(Path("my_push/curve.csv").read_text().splitlines()) >= 3
    assert main(words) == 0  # is done, and stays as it is
    assert Path("my_push/push.policy").read_bytes() == policy


def test_the_environment_on_the_page_steps() -> None:
    import trifinger_gpu

    environment = trifinger_gpu.WarpEnvironment("push", 4, device="cpu", physics_step=0.005)
    environment.reset(seed=1)
    observation, *_ = environment.step(environment.action_space.sample())
    assert observation.shape[0] == 4
    assert "trifinger_gpu.physics" in sys.modules
