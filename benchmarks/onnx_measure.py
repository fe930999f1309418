# SPDX-License-Identifier: BSD-3-Clause
"""Times networks of ONNX beside onnxruntime with bound memory, one thread each, in the same run.

    .venv/bin/python benchmarks/onnx_measure.py

Prints the medians of both [us] and by how much their results differ. A call from Python is part of
both times: `nothing` is a network without work.
"""

import itertools
import statistics
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import torch
import trifinger
from torch import nn

ROUNDS, CALLS = 12, 500
ROW, STATE, IMAGE = (1, 36), (1, 1, 256), (1, 3, 64, 64)


class Recurrent(nn.Module):
    """A GRU of 256 units and a layer after it."""

    def __init__(self) -> None:
        super().__init__()
        self.memory, self.head = nn.GRU(ROW[1], STATE[2]), nn.Linear(STATE[2], 9)

    def forward(self, observation: torch.Tensor, state: torch.Tensor) -> Any:
        """The action and the next state."""
        seen, after = self.memory(observation.unsqueeze(0), state)
        return self.head(seen.squeeze(0)), after


def dense(activation: type[nn.Module], *widths: int) -> nn.Module:
    """A perceptron."""
    layers = [[nn.Linear(*pair), activation()] for pair in itertools.pairwise(widths)]
    return nn.Sequential(*itertools.chain(*layers))[:-1]


def images(*widths: int) -> nn.Module:
    """Three convolutions and a layer."""
    first, second, third = widths
    return nn.Sequential(
        nn.Conv2d(3, first, 8, 4), nn.ReLU(), nn.Conv2d(first, second, 4, 2), nn.ReLU(),
        nn.Conv2d(second, third, 3), nn.ReLU(), nn.Flatten(), nn.Linear(16 * third, 9),
    )  # fmt: skip


NETWORKS: dict[str, tuple[Callable[[], nn.Module], list[tuple[int, ...]]]] = {
    "nothing": (nn.Identity, [ROW]),
    "2 x 256": (lambda: dense(nn.ReLU, 36, 256, 256, 9), [ROW]),
    "512-256-128, ELU": (lambda: dense(nn.ELU, 36, 512, 256, 128, 9), [ROW]),
    "GRU 256": (Recurrent, [ROW, STATE]),
    "16-32-32 on 3 x 64 x 64": (lambda: images(16, 32, 32), [IMAGE]),
    "32-64-64 on 3 x 64 x 64": (lambda: images(32, 64, 64), [IMAGE]),
}


def official(path: Path, observation: np.ndarray) -> tuple[Callable[[], None], np.ndarray]:
    """What onnxruntime does with an observation, and its first result."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    binding = session.io_binding()
    first, *states = session.get_inputs()
    given = [observation.astype(np.float32).reshape(first.shape)]
    given += [np.zeros(one.shape, np.float32) for one in states]
    for one, numbers in zip(session.get_inputs(), given, strict=True):
        binding.bind_ortvalue_input(one.name, onnxruntime.OrtValue.ortvalue_from_numpy(numbers))
    for one in session.get_outputs():
        room = onnxruntime.OrtValue.ortvalue_from_numpy(np.zeros(one.shape, np.float32))
        binding.bind_ortvalue_output(one.name, room)

    def run() -> None:
        session.run_with_iobinding(binding)

    run()
    return run, binding.copy_outputs_to_cpu()[0].ravel()


def median(run: Callable[[], Any]) -> float:
    """The median time of a call [us]."""
    times = []
    for _ in range(CALLS):
        begin = time.perf_counter_ns()
        run()
        times.append(time.perf_counter_ns() - begin)
    return statistics.median(times) / 1000


def measure(network: nn.Module, shapes: Sequence[tuple[int, ...]], path: Path) -> str:
    """Both times, their ratio and the largest difference of the actions."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        inputs = tuple(torch.zeros(shape) for shape in shapes)
        torch.onnx.export(network.eval(), inputs, path, opset_version=17, dynamo=False)
    policy = trifinger.Policy(path)
    observation = np.random.default_rng(1).normal(size=policy.num_inputs)
    theirs, expected = official(path, observation)
    difference = np.abs(policy(observation) - expected).max()
    pairs = [(median(lambda: policy(observation)), median(theirs)) for _ in range(ROUNDS)]
    ours, others = (statistics.median(times) for times in zip(*pairs, strict=True))
    return f"{ours:6.2f}   onnxruntime {others:6.2f}   {ours / others:.2f}   {difference:.0e}"


def main() -> None:
    """Measures all networks."""
    torch.manual_seed(1)
    with tempfile.TemporaryDirectory() as folder:
        for name, (make, shapes) in NETWORKS.items():
            print(f"{name:24s} {measure(make(), shapes, Path(folder, 'a.onnx'))}", flush=True)


if __name__ == "__main__":
    main()
