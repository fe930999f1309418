# SPDX-License-Identifier: BSD-3-Clause
"""Behaviour cloning: from an expert's episodes by a log and a data set to a policy that does it."""

from pathlib import Path

import numpy as np
import pytest
import trifinger
from test_data_sets import Recorded, export, record
from trifinger.environments import Environment
from trifinger.errors import InvalidArgument
from trifinger.evaluation import evaluate
from trifinger_data_sets import cloning
from trifinger_data_sets.cloning import Examples, Recipe, clone
from trifinger_data_sets.commands import clone as command
from trifinger_data_sets.recorded_environment import RecordEpisodes

EPISODES = 500
ACTIONS = 2  # of each episode: the expert's action is the same throughout
LOW, HIGH = np.deg2rad([-70.0, 0.0, -160.0]), np.deg2rad([70.0, 70.0, -2.0])


class Expert:
    """Moves the finger to where inverse kinematics says that the goal is."""

    def __init__(self, environment: Environment) -> None:
        self._environment = environment
        self._kinematics = trifinger.Kinematics(*environment.scene)

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        goal = self._environment.entries(observation)["goal"]
        position, _ = self._kinematics.inverse_kinematics(0, goal, 0.5 * (LOW + HIGH))
        return np.float32(np.clip(2 * (position - LOW) / (HIGH - LOW) - 1, -1, 1))


@pytest.fixture(scope="module")
def episodes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("expert")
    base = Environment("finger_reach")
    expert = Expert(base)
    environment = RecordEpisodes(base, folder, sentence="Reach the goal")
    for seed in range(EPISODES):
        observation, _ = environment.reset(seed=seed)
        for _ in range(ACTIONS):
            observation, *_ = environment.step(expert(observation))
    environment.close()
    return folder


def expert_distance() -> float:
    """The median of the expert's final distances [m], in the episodes of `evaluate`."""
    environment = Environment("finger_reach")
    expert = Expert(environment)
    distances = []
    for i in range(20):
        observation, info = environment.reset(seed=1_000_000 + i)
        for _ in range(environment.episode_actions):
            observation, *_, info = environment.step(expert(observation))
        distances.append(float(info["distance"][0]))
    environment.close()
    return float(np.median(distances))


@pytest.mark.slow
def test_a_cloned_policy_does_what_the_expert_does(
    episodes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    export("minari", episodes, "--episodes", "marks", "-o", "finger-v0")
    path = tmp_path / "finger.policy"
    words = ["finger-v0", "-o", str(path), "--layers", "128", "128", "--epochs", "200"]
    assert command.main(words) == 0
    assert command.main(words) == 2, "a policy that is there stays"
    policy = trifinger.Policy(path)
    assert policy.metadata["task"] == "finger_reach"
    cloned = evaluate(policy, "finger_reach", 20).summary()
    nothing = Examples(
        np.random.default_rng(1).normal(size=(100, policy.num_inputs)).astype(np.float32),
        np.zeros((100, policy.num_outputs), np.float32),
        np.arange(100),
    )
    lazy = clone(nothing, tmp_path / "lazy.policy", Recipe(epochs=1)).policy
    assert cloned.median < expert_distance() + 0.02
    assert cloned.median < 0.3 * evaluate(lazy, "finger_reach", 20).summary().median


@pytest.mark.slow
def test_the_policy_of_a_linear_expert_is_the_expert(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    observations = random.normal(3.0, [1.0, 10.0, 0.1], (4000, 3)).astype(np.float32)
    observations = np.column_stack([observations, np.full(4000, 7.0, np.float32)])
    matrix = np.array([[0.2, 0.01, -3.0, 0], [0, 0.05, 1.0, 0]])
    actions = np.float32(observations @ matrix.T)
    examples = Examples(observations, actions, np.repeat(np.arange(40), 100))
    result = clone(examples, tmp_path / "x.policy", Recipe(layers=(64,), epochs=30))
    assert result.deviation < 0.1 * result.constant
    found = np.array([result.policy(row.astype(float)) for row in observations[:200]])
    assert np.sqrt(((found - actions[:200]) ** 2).mean()) < 0.1 * actions.std()
    # The bounds are those of the examples.
    far = result.policy(observations[0] + 1000.0)
    assert (far <= actions.max(axis=0) + 1e-6).all()
    assert (far >= actions.min(axis=0) - 1e-6).all()
    again = clone(examples, tmp_path / "y.policy", Recipe(layers=(64,), epochs=30))
    assert again.deviation == result.deviation
    assert (tmp_path / "x.policy").read_bytes() == (tmp_path / "y.policy").read_bytes()


@pytest.fixture(scope="module")
def wave(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return record(tmp_path_factory.mktemp("wave"), 4, "sim", {})


def test_both_formats_teach_the_same(
    wave: Recorded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    export("lerobot", wave.folder, "-o", tmp_path / "set", "--task", "Swing")
    export("minari", wave.folder, "-o", "me/wave-v0")
    one, other = cloning.read(tmp_path / "set"), cloning.read("me/wave-v0")
    assert list(one.inputs) == list(other.inputs)
    assert list(one.outputs) == list(other.outputs)
    for number in range(2):
        count = np.count_nonzero(other.episodes == number)
        for name in ("observations", "actions"):
            np.testing.assert_array_equal(
                getattr(one, name)[one.episodes == number][:count],
                getattr(other, name)[other.episodes == number],
            )
    path = tmp_path / "wave.policy"
    words = [str(tmp_path / "set"), "-o", str(path), "--epochs", "2", "--layers", "8"]
    assert command.main(words) == 0
    assert trifinger.Policy(path).metadata["inputs"].splitlines() == list(one.inputs)


def test_what_cannot_be_learned_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidArgument, match="neither the folder of a LeRobotDataset nor"):
        cloning.read(tmp_path)
    numbers = np.zeros((10, 2), np.float32)
    numbers[3, 1] = np.nan
    examples = Examples(numbers, np.zeros((10, 1), np.float32), np.arange(10))
    with pytest.raises(InvalidArgument, match="row 3 of the observations"):
        clone(examples, tmp_path / "x.policy")
