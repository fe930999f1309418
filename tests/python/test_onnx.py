# SPDX-License-Identifier: BSD-3-Clause
"""Policies of others, in files of ONNX, beside onnxruntime."""

import itertools
import json
import subprocess
import types
import warnings
from collections.abc import Iterator
from copy import copy
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import pytest
import torch
import trifinger
from conftest import BUILD, StartProgram
from rsl_rl.models import CNNModel, MLPModel, RNNModel
from rsl_rl.runners import OnPolicyRunner
from tensordict import TensorDict
from torch import nn
from trifinger import policy_file
from trifinger.commands import policy as policy_command
from trifinger.environments import Options
from trifinger.evaluation import act_of, evaluate
from trifinger.policy_file import Layer, with_metadata

import onnx
from onnx import TensorProto, helper

# What is foreign here is large, and tests/onnx has the same code under sanitizers.
pytestmark = pytest.mark.without_sanitizer
OBSERVED, ACTED = 36, 9


class Normalised(nn.Module):
    """An actor as rsl_rl exports it: normalised observations, then an ELU network."""

    def __init__(self, *widths: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.randn(1, widths[0]))
        self.register_buffer("std", torch.rand(1, widths[0]) + 0.5)
        self.network = dense(nn.ELU, *widths)

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        return self.network((observation - self.mean) / (self.std + 1e-2))


class Recurrent(nn.Module):
    """A recurrent actor as rsl_rl and others export it: its state is an input and an output."""

    def __init__(self, kind: type[nn.Module]) -> None:
        super().__init__()
        self.memory, self.head = kind(OBSERVED, 32), nn.Linear(32, ACTED)

    def forward(self, observation: torch.Tensor, *state: torch.Tensor) -> Any:
        before = state if len(state) > 1 else state[0]
        seen, after = self.memory(observation.unsqueeze(0), before)
        action = self.head(seen.squeeze(0))
        return (action, *after) if len(state) > 1 else (action, after)


class Layered(nn.Module):
    """Layer norm and SiLU, as of recent off-policy actors; actions are clipped."""

    def __init__(self) -> None:
        super().__init__()
        self.first, self.norm = nn.Linear(OBSERVED, 32), nn.LayerNorm(32)
        self.last = nn.Linear(32, ACTED)

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        return torch.clamp(self.last(nn.functional.silu(self.norm(self.first(observation)))), -1, 1)


def dense(activation: type[nn.Module], *widths: int) -> nn.Module:
    layers: list[nn.Module] = []
    for inputs, outputs in itertools.pairwise(widths):
        layers += [nn.Linear(inputs, outputs), activation()]
    return nn.Sequential(*layers[:-1])


def convolutions() -> nn.Module:
    return nn.Sequential(
        nn.Conv2d(9, 16, 8, 4), nn.ReLU(), nn.Conv2d(16, 32, 4, 2), nn.BatchNorm2d(32), nn.ELU(),
        nn.Conv2d(32, 32, 3, padding=1, groups=4), nn.MaxPool2d(2), nn.Flatten(),
        nn.Linear(288, ACTED), nn.Tanh(),
    )  # fmt: skip


ROW = (1, OBSERVED)
STATE = (1, 1, 32)
NETWORKS = {
    "relu": (lambda: dense(nn.ReLU, OBSERVED, 64, 64, ACTED), [ROW]),
    "elu": (lambda: Normalised(OBSERVED, 64, 32, ACTED), [ROW]),
    "selu": (lambda: dense(nn.SELU, OBSERVED, 64, ACTED), [ROW]),
    "leaky relu": (lambda: dense(nn.LeakyReLU, OBSERVED, 64, ACTED), [ROW]),
    "softplus": (lambda: dense(nn.Softplus, OBSERVED, 64, 64, ACTED), [ROW]),
    "sigmoid": (lambda: dense(nn.Sigmoid, OBSERVED, 64, ACTED), [ROW]),
    "gelu": (lambda: dense(nn.GELU, OBSERVED, 64, ACTED), [ROW]),
    "layer norm": (Layered, [ROW]),
    "gru": (lambda: Recurrent(nn.GRU), [ROW, STATE]),
    "lstm": (lambda: Recurrent(nn.LSTM), [ROW, STATE, STATE]),
    "convolutions": (convolutions, [(1, 9, 64, 64)]),
}


def export(network: nn.Module, path: Path, shapes: list[tuple[int, ...]], opset: int = 17) -> Path:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the exporter that needs no further package is the old one
        torch.onnx.export(
            network.eval(), tuple(torch.zeros(shape) for shape in shapes), path,
            opset_version=opset, dynamo=False,
        )  # fmt: skip
    return path


class Official:
    """onnxruntime, which keeps the state of a recurrent network between two calls."""

    def __init__(self, path: Path) -> None:
        self.session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
        inputs = self.session.get_inputs()
        parts = len(inputs) + 1 - len(self.session.get_outputs())
        self.parts, self.states = inputs[:parts], inputs[parts:]
        self.reset()

    def reset(self) -> None:
        self.state = [np.zeros(one.shape, np.float32) for one in self.states]

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        given = {one.name: state for one, state in zip(self.states, self.state, strict=True)}
        ends = np.cumsum([np.prod(one.shape) for one in self.parts], dtype=int)
        parts = np.split(observation.astype(np.float32), ends[:-1])
        for one, part in zip(self.parts, parts, strict=True):
            given[one.name] = part.reshape(one.shape)
        action, *self.state = self.session.run(None, given)
        return np.asarray(action).ravel()


@pytest.mark.parametrize("opset", [17, 20])
@pytest.mark.parametrize("name", NETWORKS)
def test_gives_the_actions_of_onnxruntime(tmp_path: Path, name: str, opset: int) -> None:
    torch.manual_seed(1)
    network, shapes = NETWORKS[name]
    path = export(network(), tmp_path / "network.onnx", shapes, opset)
    policy, official = trifinger.Policy(path), Official(path)
    assert policy.has_state == (len(shapes) > 1)
    random = np.random.default_rng(2)
    for _ in range(10):
        for _ in range(10 if name == "convolutions" else 100):
            observation = random.normal(size=policy.num_inputs)
            np.testing.assert_allclose(policy(observation), official(observation), atol=1e-6)
        policy.reset()
        official.reset()


def exported_by_rsl_rl(kind: type[MLPModel], folder: Path, **more: Any) -> Path:
    """What the runner of rsl_rl writes of an actor: the weights are in a file of their own."""
    torch.manual_seed(1)
    groups = {"state": torch.randn(8, OBSERVED)}
    if kind is CNNModel:
        groups["camera"] = torch.randn(8, 3, 64, 64)
    seen = TensorDict(groups, batch_size=[8])
    noise = {"class_name": "GaussianDistribution", "init_std": 1.0}
    widths = [512, 256, 128]
    actor = kind(seen, {"actor": [*groups]}, "actor", ACTED, widths, "elu", True, noise, **more)
    actor.update_normalization(seen)
    runner = types.SimpleNamespace(alg=types.SimpleNamespace(get_policy=lambda: actor))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        OnPolicyRunner.export_policy_to_onnx(runner, str(folder), "actor.onnx")
    assert (folder / "actor.onnx.data").exists()
    return folder / "actor.onnx"


IMAGES = {"output_channels": [16, 32], "kernel_size": [8, 4], "stride": [4, 2], "activation": "elu"}
ACTORS = {
    "elu": (MLPModel, {}),
    "gru": (RNNModel, {"rnn_type": "gru", "rnn_hidden_dim": 64}),
    "two layers of gru": (RNNModel, {"rnn_type": "gru", "rnn_hidden_dim": 64, "rnn_num_layers": 2}),
    "lstm": (RNNModel, {"rnn_type": "lstm", "rnn_hidden_dim": 64}),
    "images": (CNNModel, {"cnn_cfg": IMAGES}),
}


@pytest.mark.parametrize("name", ACTORS)
def test_actors_of_rsl_rl_give_the_actions_of_onnxruntime(tmp_path: Path, name: str) -> None:
    kind, more = ACTORS[name]
    path = exported_by_rsl_rl(kind, tmp_path, **more)
    whole = tmp_path / "whole.onnx"
    whole.write_bytes(policy_command.network_of(path)[1])
    policy, official = trifinger.Policy(whole), Official(path)
    assert policy.num_inputs == OBSERVED + (3 * 64 * 64 if kind is CNNModel else 0)
    assert policy.has_state == (kind is RNNModel)
    random = np.random.default_rng(2)
    for _ in range(10):
        for _ in range(100):
            observation = random.normal(size=policy.num_inputs)
            np.testing.assert_allclose(policy(observation), official(observation), atol=1e-6)
        policy.reset()
        official.reset()


@pytest.mark.parametrize("seed", range(40))
def test_convolutions_and_pools_of_any_shape_are_those_of_onnxruntime(
    tmp_path: Path, seed: int
) -> None:
    random = np.random.default_rng(seed)
    groups = int(random.integers(1, 4))
    channels = groups * int(random.integers(1, 4))
    results = groups * int(random.integers(1, 40))
    size = random.integers(7, 20, 2).tolist()
    window = random.integers(1, 4, 2)
    how: dict[str, Any] = {
        "kernel_shape": window, "strides": random.integers(1, 4, 2),
        "dilations": random.integers(1, 3, 2), "pads": random.integers(0, window.min(), 4),
    }  # fmt: skip
    weights = random.normal(size=(results, channels // groups, *window)).astype(np.float32)
    how = {name: numbers.tolist() for name, numbers in how.items()}
    tensors = {"w": weights / 10, "b": random.normal(size=results).astype(np.float32)}
    for node in (
        helper.make_node("Conv", ["x", "w", "b"], ["y"], group=groups, **how),
        helper.make_node("MaxPool", ["x"], ["y"], **how),
    ):
        shape = (1, channels, *size)
        graph = helper.make_graph(
            [node], "g", [helper.make_tensor_value_info("x", TensorProto.FLOAT, shape)],
            [helper.make_tensor_value_info("y", TensorProto.FLOAT, None)],
            [onnx.numpy_helper.from_array(one, name) for name, one in tensors.items()],
        )  # fmt: skip
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
        path = tmp_path / "one.onnx"
        path.write_bytes(model.SerializeToString())
        policy, official = trifinger.Policy(path), Official(path)
        observation = random.normal(size=policy.num_inputs)
        np.testing.assert_allclose(policy(observation), official(observation), atol=2e-6)


def nodes() -> Iterator[tuple[str, list[onnx.NodeProto], dict[str, Any]]]:
    """Each operator alone, with its constants."""
    make = helper.make_node
    for op in ("Exp", "Erf", "Abs", "Neg", "Tanh", "Sigmoid", "Identity"):
        yield op, [make(op, ["x"], ["y"])], {}
    yield "Elu", [make("Elu", ["x"], ["y"], alpha=0.3)], {}
    yield "LeakyRelu", [make("LeakyRelu", ["x"], ["y"], alpha=0.3)], {}
    yield "Gelu", [make("Gelu", ["x"], ["y"], approximate="tanh")], {}
    yield "Clip", [make("Clip", ["x", "", "m"], ["y"])], {"m": np.float32(0.4)}
    column = np.linspace(0.5, 2, 3, dtype=np.float32)[:, None]
    for op in ("Add", "Sub", "Mul", "Div", "Max", "Min"):
        yield op, [make(op, ["x", "c"], ["y"])], {"c": column}
        yield f"{op} of row", [make(op, ["c", "x"], ["y"])], {"c": column.reshape(1, 3, 1)}
    yield "Pow", [make("Pow", ["x", "c"], ["y"])], {"c": np.float32(2)}
    less = [make("Less", ["x", "c"], ["l"]), make("Where", ["l", "x", "c"], ["y"])]
    yield "Where", less, {"c": column}
    yield "Transpose", [make("Transpose", ["x"], ["y"], perm=[2, 0, 1])], {}
    yield "Flatten", [make("Flatten", ["x"], ["y"], axis=2)], {}
    yield "Reshape", [make("Reshape", ["x", "s"], ["y"])], {"s": np.array([0, -1, 2])}
    yield "Squeeze", [make("Squeeze", ["x", "s"], ["y"])], {"s": np.array([0])}
    yield "Unsqueeze", [make("Unsqueeze", ["x", "s"], ["y"])], {"s": np.array([-1, 1])}
    yield "Expand", [make("Expand", ["x", "s"], ["y"])], {"s": np.array([2, 1, 1])}
    yield "Gather", [make("Gather", ["x", "i"], ["y"], axis=2)], {"i": np.array([[3, -4], [0, 0]])}
    indices = {"a": np.array([1, -3]), "b": np.array([9, -1]), "d": np.array([1, 2])}
    sliced = make("Slice", ["x", "a", "b", "d", "e"], ["y"])
    yield "Slice", [sliced], indices | {"e": np.array([1, 2])}
    parts = make("Split", ["x", "s"], ["p", "q"], axis=2)
    join = make("Concat", ["q", "c", "p"], ["y"], axis=2)
    rest = {"s": np.array([1, 3]), "c": np.ones((1, 3, 2), np.float32)}
    yield "Split and Concat", [parts, join], rest
    yield "ReduceMean", [make("ReduceMean", ["x", "s"], ["y"], keepdims=0)], {"s": np.array([-1])}
    weights = np.arange(8, dtype=np.float32).reshape(4, 2)
    yield "MatMul", [make("MatMul", ["x", "w"], ["y"])], {"w": weights}
    taken = [
        make("Shape", ["x"], ["a"]), make("Gather", ["a", "i"], ["b"]),
        make("Concat", ["b", "m"], ["s"], axis=0), make("Reshape", ["x", "s"], ["y"]),
    ]  # fmt: skip
    yield "Shape", taken, {"i": np.array([0]), "m": np.array([-1])}


@pytest.mark.parametrize(
    ("made", "constants"), [one[1:] for one in nodes()], ids=[one[0] for one in nodes()]
)
def test_computes_operators_as_onnxruntime_does(
    tmp_path: Path, made: list[onnx.NodeProto], constants: dict[str, Any]
) -> None:
    shape = (1, 3, 4)
    tensors = [
        onnx.numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()
    ]
    graph = helper.make_graph(
        made, "g", [helper.make_tensor_value_info("x", TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, None)], tensors,
    )  # fmt: skip
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 20)], ir_version=9)
    path = tmp_path / "one.onnx"
    path.write_bytes(model.SerializeToString())
    policy, official = trifinger.Policy(path), Official(path)
    random = np.random.default_rng(3)
    for _ in range(10):
        observation = random.normal(size=policy.num_inputs)
        np.testing.assert_allclose(policy(observation), official(observation), atol=1e-6)


def test_copies_have_states_of_their_own_and_evaluations_one_for_each_robot(tmp_path: Path) -> None:
    torch.manual_seed(1)
    path = export(Recurrent(nn.GRU), tmp_path / "gru.onnx", [ROW, STATE])
    policy = trifinger.Policy(path)
    rows = np.random.default_rng(1).normal(size=(3, OBSERVED))
    act = act_of(policy)
    first, second = act(rows), act(rows[::-1])
    for row, after, one, two in zip(rows, rows[::-1], first, second, strict=True):
        alone = copy(policy)
        np.testing.assert_array_equal(alone(row), one)
        np.testing.assert_array_equal(alone(after), two)


@pytest.mark.parametrize("name", ["elu", "gru"])
def test_a_network_of_somebody_else_runs_on_a_robot(
    tmp_path: Path, start_program: StartProgram, name: str
) -> None:
    kind, more = ACTORS[name]
    path = exported_by_rsl_rl(kind, tmp_path, **more)
    observed = Options.of("reach").changed(mapping="state_augmentation", steps_per_action=1)
    words = ["import", str(path), "--task", "reach", "-o", str(tmp_path / "mine.onnx")]
    words += ["--set", "mapping=state_augmentation", "--set", "steps_per_action=1"]
    words += ["--set", "duration=1.0"]
    assert policy_command.main(words) == 0
    policy = trifinger.Policy(tmp_path / "mine.onnx")
    assert Options.from_json(policy.metadata["options"]) == observed.changed(duration=1.0)
    onnx.checker.check_model(onnx.load(tmp_path / "mine.onnx"))
    start_program("run", "trifinger_edu", "--name", "p", "--non-real-time").wait_for(
        "waits for a user"
    )
    report = tmp_path / "report"
    words = [str(BUILD / "apps/trifinger-run-policy"), str(tmp_path / "mine.onnx"), "--robot", "p"]
    subprocess.run([*words, "--episodes", "2", "-o", str(report)], check=True)
    episodes = json.loads(report.read_text())
    assert [one["actions"] for one in episodes] == [1000, 1000]
    assert [one["repeated_steps"] for one in episodes] == [0, 0]
    assert len(evaluate(policy, "reach", 2).distances) == 2


def test_says_of_a_file_what_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    torch.manual_seed(1)
    path = export(Recurrent(nn.GRU), tmp_path / "gru.onnx", [ROW, STATE])
    assert policy_command.main(["info", str(path)]) == 0
    said = capsys.readouterr().out
    assert "36 numbers become 9, also of earlier observations" in said
    assert "task: the file does not say it" in said
    path.write_bytes(with_metadata(path.read_bytes(), {"task": "reach", "long": 300 * "é"}))
    assert policy_command.main(["info", "--json", str(path)]) == 0
    about = json.loads(capsys.readouterr().out)
    assert about["metadata"] == {"task": "reach", "long": 300 * "é"}


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["info", "none.onnx"], "none.onnx"),
        (["import", "small.onnx", "--task", "reach"], "turns 5 numbers into 9"),
        (["import", "small.onnx", "--task", "rech"], "no task 'rech'"),
        (["import", "small.policy", "--task", "reach"], "does not end in .onnx"),
        (["import", "text.onnx", "--task", "reach"], "no ONNX file"),
        (["import", "dynamic.onnx", "--task", "reach"], "not fixed"),
        (["import", "split.onnx", "--task", "reach"], "in another file"),
    ],
)
def test_says_what_is_wrong(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    says: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    small = export(dense(nn.ELU, 5, ACTED), Path("small.onnx"), [(1, 5)])
    Path("text.onnx").write_text("a text")
    onnx.save(onnx.load(small), "split.onnx", save_as_external_data=True, size_threshold=0)
    model = onnx.load(small)
    model.graph.input[0].type.tensor_type.shape.dim[1].dim_param = "size"
    Path("dynamic.onnx").write_bytes(model.SerializeToString())
    assert policy_command.main(words) in (1, 2)
    assert says in capsys.readouterr().err
    assert not Path("reach.onnx").exists()


@pytest.mark.parametrize("activation", ["relu", "tanh", "elu"])
@pytest.mark.parametrize("bounding", [None, "scale", "clip"])
def test_a_policy_of_ours_is_the_same_as_onnx(
    activation: str, bounding: str | None, tmp_path: Path
) -> None:
    random = np.random.default_rng(3)
    widths = [12, 40, 30, 5]
    layers: list[Layer] = [
        (random.normal(0, before**-0.5, (after, before)), random.normal(0, 0.3, after), activation)
        for before, after in itertools.pairwise(widths)
    ]
    layers[-1] = (*layers[-1][:2], "tanh" if bounding == "scale" else "identity")
    bounds = {"low": random.uniform(-2, -0.5, 5), "high": random.uniform(0.5, 2, 5)}
    ours = policy_file.write(
        tmp_path / "ours.policy",
        layers,
        mean=random.normal(size=12),
        variance=random.uniform(0.1, 2, 12),
        clip=3.0,
        **({} if bounding is None else {**bounds, "bounding": bounding}),
        metadata={"task": "reach", "rate": "50 Hz"},
    )
    path = tmp_path / "ours.onnx"
    assert policy_command.main(["export", str(tmp_path / "ours.policy")]) == 0
    onnx.checker.check_model(onnx.load(path), full_check=True)
    theirs = onnxruntime.InferenceSession(path)
    read = trifinger.Policy(path)
    assert read.metadata == ours.metadata
    seen = random.normal(0, 2, (1000, 12)).astype(np.float32)
    expected = np.array([ours(one) for one in seen])
    np.testing.assert_allclose(theirs.run(None, {"observation": seen})[0], expected, atol=2e-6)
    np.testing.assert_allclose([read(one) for one in seen], expected, atol=2e-6)


def test_what_cannot_be_exported_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    layer = (np.ones((2, 3)), np.zeros(2), "identity")
    policy_file.write(tmp_path / "a.policy", [layer])
    words = ["export", str(tmp_path / "a.policy")]
    assert policy_command.main([*words, "-o", str(tmp_path / "b.txt")]) == 2
    assert "b.txt does not end in .onnx" in capsys.readouterr().err
    assert policy_command.main(words) == 0
    assert policy_command.main(["export", str(tmp_path / "a.onnx")]) == 2
    assert "is of ONNX already" in capsys.readouterr().err
