# SPDX-License-Identifier: BSD-3-Clause
"""Policies from Python, beside what NumPy, PyTorch and Stable-Baselines3 compute."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trifinger
from numpy.typing import NDArray
from trifinger import policy_file

pytestmark = pytest.mark.bindings

Array = NDArray[np.float64]
FUNCTIONS = {"identity": lambda x: x, "relu": lambda x: np.maximum(x, 0), "tanh": np.tanh}

WIDTHS = [[1, 1], [36, 256, 256, 9], [7, 400, 300, 3], [12, 64, 64, 64, 64, 4], [3, 5]]


def random_layers(random: np.random.Generator, widths: list[int]) -> list[policy_file.Layer]:
    """Layers of single precision, with tanh at the end."""
    activations = [*random.choice(list(FUNCTIONS), len(widths) - 2), "tanh"]
    return [
        (
            random.normal(0, inputs**-0.5, (outputs, inputs)).astype(np.float32),
            random.normal(0, 0.3, outputs).astype(np.float32),
            str(activation),
        )
        for inputs, outputs, activation in zip(widths[:-1], widths[1:], activations, strict=True)
    ]


def recomputed(layers: list[policy_file.Layer], observation: Array) -> Array:
    """The output of the layers for an observation, in double precision."""
    values = observation.astype(np.float32).astype(np.float64)
    for weights, bias, activation in layers:
        affine = np.asarray(weights, np.float64) @ values + np.asarray(bias, np.float64)
        values = FUNCTIONS[activation](affine)
    return values


@pytest.fixture
def policy() -> trifinger.Policy:
    """Three inputs, two outputs."""
    return trifinger.Policy.from_layers(
        [(np.full((2, 3), 0.5, np.float32), np.zeros(2, np.float32), "tanh")]
    )


@pytest.mark.parametrize("widths", WIDTHS)
def test_computes_what_numpy_does(widths: list[int], tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    layers = random_layers(random, widths)
    made = policy_file.write(tmp_path / "a.policy", layers, metadata={"rate": "50 Hz"})
    policy = trifinger.Policy(tmp_path / "a.policy")
    assert [len(bias) for _, bias, _ in policy.layers] == widths[1:]
    assert len(made.layers) == len(policy.layers)
    assert (policy.num_inputs, policy.num_outputs) == (widths[0], widths[-1])
    for read, written in zip(policy.layers, layers, strict=True):
        np.testing.assert_array_equal(read[0], np.asarray(written[0], np.float32))
        np.testing.assert_array_equal(read[1], np.asarray(written[1], np.float32))
        assert read[2] == written[2]
    assert policy.metadata == {"rate": "50 Hz"}
    assert policy.bounds is None
    for _ in range(100):
        observation = random.normal(0, 3, widths[0])
        action = policy(observation)
        np.testing.assert_allclose(action, recomputed(layers, observation), rtol=0, atol=1e-13)
        assert np.array_equal(action, made(observation))


def test_normalises_its_inputs_and_bounds_its_outputs(tmp_path: Path) -> None:
    random = np.random.default_rng(2)
    layers = random_layers(random, [6, 20, 4])
    mean, variance = random.normal(0, 3, 6), random.uniform(0, 4, 6)
    low = random.normal(0, 1, 4)
    high = low + random.uniform(0, 1, 4)
    path = tmp_path / "a.policy"
    policy_file.write(
        path, layers, mean=mean, variance=variance, epsilon=1e-3, clip=2.5, low=low, high=high
    )
    policy = trifinger.Policy(path)
    assert policy.bounds == (low.tolist(), high.tolist(), "scale")
    for _ in range(100):
        observation = random.normal(0, 5, 6)
        normal = np.clip((observation - mean) / np.sqrt(variance + 1e-3), -2.5, 2.5)
        expected = low + (recomputed(layers, normal) + 1) / 2 * (high - low)
        np.testing.assert_allclose(policy(observation), expected, rtol=0, atol=3e-7)


def test_sums_in_the_precision_that_was_asked_for(tmp_path: Path) -> None:
    random = np.random.default_rng(4)
    layers = random_layers(random, [36, 256, 256, 9])
    policy_file.write(tmp_path / "a.policy", layers)
    policy = trifinger.Policy(tmp_path / "a.policy")
    single = trifinger.Policy(tmp_path / "a.policy", precision="single")
    assert (policy.precision, single.precision) == ("double", "single")
    assert trifinger.Policy.from_layers(layers, precision="single").precision == "single"
    observations = random.normal(0, 3, (100, 36))
    deviations = [np.abs(single(each) - policy(each)).max() for each in observations]
    # The bound that follows from the network is tested in C++.
    assert 1e-9 < max(deviations) < 2e-6
    for name in ("half", "", "Single"):
        said = f"precision is '{name}'.*'double'.*'single'"
        with pytest.raises(trifinger.InvalidArgument, match=said):
            trifinger.Policy(tmp_path / "a.policy", precision=name)


def test_file_is_what_its_description_says(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    layers = random_layers(random, [3, 4, 2])
    path = tmp_path / "a.policy"
    policy_file.write(path, layers, low=[-1, -2], high=[1, 2], metadata={"robot": "ä"})
    first, header, numbers = path.read_bytes().split(b"\n", 2)
    assert first == b"trifinger policy 1"
    assert json.loads(header) == {
        "layers": [
            {"inputs": 3, "outputs": 4, "activation": layers[0][2]},
            {"inputs": 4, "outputs": 2, "activation": "tanh"},
        ],
        "bounds": {"low": [-1, -2], "high": [1, 2], "bounding": "scale"},
        "metadata": {"robot": "ä"},
    }
    expected = [np.ravel(part) for layer in layers for part in layer[:2]]  # type: ignore[arg-type]
    assert np.array_equal(np.frombuffer(numbers, "<f4"), np.concatenate(expected))


@pytest.mark.parametrize(
    "observation",
    [
        [1, 2, 3],
        (1.0, 2.0, 3.0),
        np.array([1, 2, 3], np.float32),
        np.array([1, 2, 3], np.int64),
        np.array([1.0, 9.0, 2.0, 9.0, 3.0])[::2],
        np.array([1.0, 2.0, 3.0], ">f8"),
    ],
    ids=["list", "tuple", "float32", "int64", "strided", "big endian"],
)
def test_takes_what_numpy_takes_for_numbers(policy: trifinger.Policy, observation: Any) -> None:
    expected = policy(np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(policy(observation), expected, atol=1e-15)


def test_gives_an_array_of_its_own_each_time(policy: trifinger.Policy) -> None:
    first = policy([1, 2, 3])
    kept = first.copy()
    second = policy([-1, 0, 3])
    assert np.array_equal(first, kept)
    assert first.dtype == np.float64
    assert first.flags.owndata
    assert not np.array_equal(first, second)


@pytest.mark.parametrize(
    ("observation", "said"),
    [
        ([1, 2], r"has the shape \(2,\), must have \(3,\)"),
        ([[1, 2, 3]], r"has the shape \(1, 3\), must have \(3,\)"),
        (5.0, r"has the shape \(\), must have \(3,\)"),
        ([1, np.nan, 3], r"observation\[1\] is nan, must be finite"),
        ([1, 2, -np.inf], r"observation\[2\] is -inf, must be finite"),
        ([1, 2, 1e300], "too large"),
        (["a", "b", "c"], "cannot be taken for an array of float64: \\['a'"),
        ([1j, 2, 3], "cannot be taken for an array of float64"),
        ({"position": [1, 2, 3]}, "cannot be taken for an array"),
        ([[1], [2, 3]], "cannot be taken for an array"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_says_what_is_wrong_with_an_observation(
    policy: trifinger.Policy, observation: Any, said: str
) -> None:
    with pytest.raises(trifinger.InvalidArgument, match=said):
        policy(observation)


def test_a_file_that_is_none_is_an_error_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "a.policy"
    path.write_bytes(b"no policy")
    with pytest.raises(trifinger.PolicyFileError, match=r"a\.policy is not a policy.*begin with"):
        trifinger.Policy(path)
    with pytest.raises(FileNotFoundError, match="nowhere"):
        trifinger.Policy(tmp_path / "nowhere")


def test_says_what_is_wrong_with_layers(tmp_path: Path) -> None:
    path = tmp_path / "a.policy"
    weights, bias = np.ones((2, 3)), np.ones(2)

    def refusal(layers: list[Any], **others: Any) -> str:
        with pytest.raises(trifinger.InvalidArgument) as error:
            policy_file.write(path, layers, **others)
        assert not path.exists()
        return str(error.value)

    assert "at least one layer" in refusal([])
    assert "activation is 'gelu', must be 'identity', 'relu', 'tanh' or 'elu'" in refusal(
        [(weights, bias, "gelu")]
    )
    assert "weights of layer 0 has the shape (2,)" in refusal([(bias, bias, "tanh")])
    assert "bias of layer 0 has 3 numbers, must have 2" in refusal([(weights, np.ones(3), "tanh")])
    assert "not finite" in refusal([(weights * np.nan, bias, "tanh")])
    assert "not finite" in refusal([(weights * 1e300, bias, "tanh")])
    assert "is no array of numbers" in refusal([("weights", bias, "tanh")])
    layer = [(weights, bias, "tanh")]
    assert "mean and variance go together" in refusal(layer, mean=np.zeros(3))
    assert "low and high go together" in refusal(layer, high=np.zeros(2))
    assert "low has the shape (1, 2)" in refusal(layer, low=[[0, 0]], high=[1, 1])
    assert "bounding is 'fold'" in refusal(layer, low=[0, 0], high=[1, 1], bounding="fold")


# ---- networks without PyTorch ----


class Tensor:
    """A tensor with a gradient: NumPy can convert it only after detach()."""

    def __init__(self, numbers: Any) -> None:
        self.numbers = np.asarray(numbers, np.float32)

    def __len__(self) -> int:
        return len(self.numbers)

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise TypeError("call detach first")

    def detach(self) -> Tensor:
        return self

    def cpu(self) -> Any:
        return self.numbers


class Module:
    def __init__(self, *children: Any) -> None:
        self._children = children

    def __iter__(self) -> Any:
        return iter(self._children)


class Sequential(Module):
    pass


class Linear(Module):
    def __init__(self, random: np.random.Generator, inputs: int, outputs: int) -> None:
        super().__init__()
        self.weight = Tensor(random.normal(0, inputs**-0.5, (outputs, inputs)))
        self.bias: Tensor | None = Tensor(random.normal(0, 0.3, outputs))


class ReLU(Module):
    pass


class Tanh(Module):
    pass


class Dropout(Module):
    pass


class GELU(Module):
    pass


def test_makes_layers_of_a_network() -> None:
    random = np.random.default_rng(4)
    first, second, third = (Linear(random, *sizes) for sizes in ((3, 8), (8, 5), (5, 2)))
    second.bias = None
    network = Sequential(Sequential(first, ReLU(), Dropout()), second, Sequential(third, Tanh()))
    layers = policy_file.layers_of(network)
    assert [activation for _, _, activation in layers] == ["relu", "identity", "tanh"]
    for (weights, bias, _), linear in zip(layers, (first, second, third), strict=True):
        assert np.array_equal(weights, linear.weight.numbers)
        expected = np.zeros(5) if linear.bias is None else linear.bias.numbers
        assert np.array_equal(bias, expected)


@pytest.mark.parametrize(
    ("network", "said"),
    [
        (lambda linear: Sequential(linear, GELU()), "has a GELU; a policy can be made of Linear"),
        (lambda linear: Sequential(ReLU(), linear), "a ReLU that does not follow a Linear"),
        (lambda linear: Sequential(linear, Tanh(), Tanh()), "a Tanh that does not follow"),
        (lambda _: Module(), "has a Module"),
    ],
)
def test_names_what_cannot_be_part_of_a_policy(network: Any, said: str) -> None:
    with pytest.raises(trifinger.InvalidArgument, match=said):
        policy_file.layers_of(network(Linear(np.random.default_rng(5), 2, 2)))


def test_says_that_something_is_no_model(tmp_path: Path) -> None:
    with pytest.raises(trifinger.InvalidArgument, match="a str is no model of Stable-Baselines3"):
        policy_file.export("model.zip", tmp_path / "a.policy")


def test_does_not_import_what_trains() -> None:
    program = "import sys, trifinger.policy_file; print({'torch', 'gymnasium'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout == "set()\n", done.stderr


# ---- networks of PyTorch, models of Stable-Baselines3 ----


@pytest.mark.without_sanitizer
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("hidden", ["ReLU", "Tanh"])
@pytest.mark.parametrize("widths", WIDTHS)
def test_equals_pytorch(widths: list[int], hidden: str, precision: str, tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    torch.manual_seed(0)
    modules: list[Any] = []
    for inputs, outputs in itertools.pairwise(widths):
        modules += [torch.nn.Linear(inputs, outputs), getattr(torch.nn, hidden)()]
    modules[-1] = torch.nn.Tanh()
    network = torch.nn.Sequential(*modules)
    path = tmp_path / "a.policy"
    policy_file.write(path, policy_file.layers_of(network))
    policy = trifinger.Policy(path, precision=precision)
    observations = np.random.default_rng(6).normal(0, 2, (1000, widths[0]))
    with torch.no_grad():
        expected = network(torch.as_tensor(observations, dtype=torch.float32)).numpy()
    actions = np.stack([policy(observation) for observation in observations])
    np.testing.assert_allclose(actions, expected, rtol=0, atol=1e-6)


def environment(*, is_dictionary: bool = False) -> Any:
    """One environment, whose observations need normalisation and whose bounds differ."""
    gymnasium = pytest.importorskip("gymnasium")
    vector = pytest.importorskip("stable_baselines3.common.vec_env")
    box = gymnasium.spaces.Box
    parts = {"velocity": box(-50, 50, (4,)), "goal": box(-50, 50, (2, 3))}

    class Environment(gymnasium.Env):  # type: ignore[misc]
        observation_space = (
            gymnasium.spaces.Dict(parts) if is_dictionary else box(-50, 50, (10,), np.float64)
        )
        action_space = box(np.array([-1, -2, 0.5], np.float32), np.array([1, 0, 0.75], np.float32))

        def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
            super().reset(seed=seed, options=options)
            return self._observation(), {}

        def step(self, action: Any) -> Any:
            return self._observation(), float(-np.sum(action**2)), False, False, {}

        def _observation(self) -> Any:
            numbers = self.np_random.normal(3, 10, 10)
            if not is_dictionary:
                return numbers
            numbers = numbers.astype(np.float32)
            return {"velocity": numbers[:4], "goal": numbers[4:].reshape(2, 3)}

    made = vector.VecNormalize(vector.DummyVecEnv([Environment]), clip_obs=2.0)
    made.seed(0)
    made.reset()
    for _ in range(50):  # in which the normaliser learns
        made.step(np.zeros((1, 3)))
    made.training = False
    return made


@pytest.mark.slow
@pytest.mark.without_sanitizer
@pytest.mark.parametrize("is_dictionary", [False, True], ids=["box", "dictionary"])
@pytest.mark.parametrize("algorithm", ["DDPG", "TD3", "SAC", "PPO", "A2C"])
def test_equals_stable_baselines3(algorithm: str, is_dictionary: bool, tmp_path: Path) -> None:
    package = pytest.importorskip("stable_baselines3")
    environment_ = environment(is_dictionary=is_dictionary)
    model = getattr(package, algorithm)(
        "MultiInputPolicy" if is_dictionary else "MlpPolicy",
        environment_,
        seed=1,
        device="cpu",
        policy_kwargs={"net_arch": [64, 48]},
    )
    path = tmp_path / "a.policy"
    policy_file.export(model, path, metadata={"algorithm": algorithm})
    policy = trifinger.Policy(path)
    assert policy.metadata == {"algorithm": algorithm}
    assert [np.shape(weights) for weights, _, _ in policy.layers] == [(64, 10), (48, 64), (3, 48)]
    assert policy.bounds is not None
    assert policy.bounds[2] == ("clip" if algorithm in {"PPO", "A2C"} else "scale")
    for _ in range(100):
        environment_.step(np.zeros((1, 3)))
        original = environment_.get_original_obs()
        action, _ = model.predict(environment_.normalize_obs(original), deterministic=True)
        flat = (
            np.concatenate([np.ravel(original[key]) for key in model.observation_space.spaces])
            if is_dictionary
            else np.ravel(original)
        )
        np.testing.assert_allclose(policy(flat), action[0], rtol=0, atol=1e-6)


@pytest.mark.without_sanitizer
def test_loads_a_saved_model_and_takes_its_normalizer_beside_it(tmp_path: Path) -> None:
    package = pytest.importorskip("stable_baselines3")
    environment_ = environment()
    model = package.TD3("MlpPolicy", environment_, seed=1, device="cpu")
    model.save(tmp_path / "model.zip")
    loaded = package.TD3.load(tmp_path / "model.zip", device="cpu")
    expected = policy_file.export(model, tmp_path / "a.policy")
    policy = policy_file.export(loaded, tmp_path / "b.policy", normalizer=environment_)
    observation = np.arange(10.0)
    assert np.array_equal(policy(observation), expected(observation))
    without = policy_file.export(loaded.policy.actor, tmp_path / "c.policy")
    assert not np.array_equal(without(observation), expected(observation))


@pytest.mark.without_sanitizer
def test_refuses_models_that_look_at_more_than_numbers(tmp_path: Path) -> None:
    gymnasium = pytest.importorskip("gymnasium")
    package = pytest.importorskip("stable_baselines3")
    model = package.PPO("MlpPolicy", gymnasium.make("CartPole-v1"), device="cpu")
    with pytest.raises(trifinger.InvalidArgument, match="action space is Discrete"):
        policy_file.export(model, tmp_path / "a.policy")
