# SPDX-License-Identifier: BSD-3-Clause
"""Behaviour cloning: a policy that acts as the actions of a data set do.

A network of layers learns the mean action for each observation, by least squares. Some episodes are
kept apart: the network that predicts their actions best is the result.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import json
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from trifinger import extras, policy_file
from trifinger.errors import InvalidArgument

from trifinger_data_sets import MINARI
from trifinger_data_sets.rows import ACTION, ENVIRONMENT, STATE

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from trifinger._trifinger import Policy

MAKE = "trifinger_data_sets.recorded_environment:make"
EPSILON = 1e-8
# Called after each epoch with its number and the deviation of the episodes kept apart.
Watch = Callable[[int, float], None]


@dataclass(frozen=True)
class Examples:
    """Observations and the actions that followed: a row for each action."""

    observations: NDArray[np.float32]
    actions: NDArray[np.float32]
    episodes: NDArray[np.int64]
    """The number of the episode of each row."""
    inputs: Sequence[str] = ()
    outputs: Sequence[str] = ()
    environment: dict[str, Any] = field(default_factory=dict)
    """What made the environment of the episodes: task, options, config and config_overrides."""
    note: str = ""
    """Why the policy cannot be run in the environment of the episodes, if it cannot."""
    low: NDArray[np.float32] | None = None
    """Bounds of actions; None for those of the data set."""
    high: NDArray[np.float32] | None = None


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """How a network learns."""

    layers: tuple[int, ...] = (256, 256)
    epochs: int = 100
    batch_size: int = 256
    learning_rate: float = 1e-3
    """It falls to zero, along half a cosine."""
    weight_decay: float = 1e-5
    kept_apart: float = 0.1
    """Share of the episodes that choose the best network."""
    seed: int = 1

    def __post_init__(self) -> None:
        for name in ("epochs", "batch_size"):
            if getattr(self, name) < 1:
                raise InvalidArgument(f"{name} is {getattr(self, name)}, must be at least 1")
        if not 0 <= self.kept_apart < 1:
            raise InvalidArgument(f"kept_apart is {self.kept_apart}, must be from 0 to below 1")


@dataclass(frozen=True, kw_only=True)
class Result:
    """How well a policy predicts the actions of episodes that it has not learned from."""

    policy: Policy
    deviation: float
    """Root mean square, in units of the actions."""
    constant: float
    """The same for a policy that always does the mean action."""
    actions: int
    """Number of actions that were learned from."""

    def __str__(self) -> str:
        return (
            f"learned from {self.actions} actions; others deviate by {self.deviation:.3g} (rms), "
            f"from the mean action by {self.constant:.3g}"
        )


def read(data_set: str | os.PathLike[str]) -> Examples:
    """Reads a data set: the folder of a LeRobotDataset, or the name of one of Minari.

    Raises InvalidArgument if it is neither; Error if a package is missing.
    """
    folder = Path(data_set)
    if (folder / "meta" / "info.json").exists():
        return _read_lerobot(folder)
    from trifinger_data_sets import minari

    name = str(data_set)
    if not (minari.root() / name / "data" / "metadata.json").exists():
        raise InvalidArgument(
            f"{name} is neither the folder of a LeRobotDataset nor a data set of Minari in "
            f"{minari.root()}"
        )
    return _read_minari(name)


def clone(
    examples: Examples,
    path: str | os.PathLike[str],
    recipe: Recipe | None = None,
    watch: Watch | None = None,
) -> Result:
    """Learns from examples and writes the file of a policy.

    The same examples and recipe give the same policy on the same machine. Raises InvalidArgument
    for examples that nothing can be learned from; Error if PyTorch is missing.
    """
    extras.require("learning", "torch")
    recipe = recipe or Recipe()
    _check(examples)
    is_apart = _apart(examples, recipe)
    learned, apart = ~is_apart, is_apart if is_apart.any() else ~is_apart
    scaling = _Scaling.of(examples, learned)
    network, deviation = _train(
        scaling.scaled(examples, learned), scaling.scaled(examples, apart), scaling, recipe, watch
    )
    policy = _write(path, network, scaling, examples)
    constant = float(np.sqrt(((examples.actions[apart] - scaling.action_mean) ** 2).mean()))
    return Result(
        policy=policy,
        deviation=deviation,
        constant=constant,
        actions=int(np.count_nonzero(learned)),
    )


@dataclass(frozen=True)
class _Scaling:
    """Brings observations and actions to zero mean and unit variance."""

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    action_mean: NDArray[np.float64]
    spread: NDArray[np.float64]
    """Standard deviation of the actions."""

    @classmethod
    def of(cls, examples: Examples, rows: NDArray[np.bool_]) -> _Scaling:
        mean = examples.observations[rows].mean(axis=0, dtype=np.float64)
        variance = examples.observations[rows].var(axis=0, dtype=np.float64)
        # What never changes in the examples must not be magnified when it does change.
        variance = np.where(variance < EPSILON, 1.0, variance)
        action_mean = examples.actions[rows].mean(axis=0, dtype=np.float64)
        spread = examples.actions[rows].std(axis=0, dtype=np.float64)
        spread = np.where(spread < EPSILON, 1.0, spread)
        return cls(mean, variance, action_mean, spread)

    def scaled(self, examples: Examples, rows: NDArray[np.bool_]) -> tuple[Any, Any]:
        """The tensors of some rows: inputs, and wanted outputs."""
        import torch

        numbers = (examples.observations[rows] - self.mean) / np.sqrt(self.variance + EPSILON)
        wanted = (examples.actions[rows] - self.action_mean) / self.spread
        return (
            torch.from_numpy(np.clip(numbers, -10, 10).astype(np.float32)),
            torch.from_numpy(wanted.astype(np.float32)),
        )


def _train(
    learned: tuple[Any, Any],
    apart: tuple[Any, Any],
    scaling: _Scaling,
    recipe: Recipe,
    watch: Watch | None,
) -> tuple[Any, float]:
    """The network that predicts the actions kept apart best, and by how much it deviates."""
    import torch

    inputs, outputs = learned
    test_inputs, test_outputs = apart
    generator = torch.Generator().manual_seed(recipe.seed)
    with torch.random.fork_rng():
        torch.manual_seed(recipe.seed)
        network = _network([inputs.shape[1], *recipe.layers, outputs.shape[1]])
    optimizer = torch.optim.AdamW(
        network.parameters(), recipe.learning_rate, weight_decay=recipe.weight_decay
    )
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, recipe.epochs)
    scale = torch.from_numpy(scaling.spread.astype(np.float32))
    best, best_state = np.inf, None
    with _one_thread():
        for epoch in range(recipe.epochs):
            order = torch.randperm(len(inputs), generator=generator)
            for begin in range(0, len(order), recipe.batch_size):
                rows = order[begin : begin + recipe.batch_size]
                optimizer.zero_grad()
                loss = ((network(inputs[rows]) - outputs[rows]) ** 2).mean()
                loss.backward()
                optimizer.step()
            schedule.step()
            with torch.no_grad():
                error = (network(test_inputs) - test_outputs) * scale
                deviation = float((error**2).mean().sqrt())
            if deviation < best:
                best = deviation
                best_state = {name: one.clone() for name, one in network.state_dict().items()}
            if watch is not None:
                watch(epoch + 1, deviation)
    if best_state is None:
        raise InvalidArgument("the network has learned nothing: its errors are not finite")
    network.load_state_dict(best_state)
    return network, best


def _write(
    path: str | os.PathLike[str], network: Any, scaling: _Scaling, examples: Examples
) -> Policy:
    layers = policy_file.layers_of(network)
    weights, bias, activation = layers[-1]
    # The last layer computes actions in their own units.
    layers[-1] = (
        np.asarray(weights) * scaling.spread[:, None],
        np.asarray(bias) * scaling.spread + scaling.action_mean,
        activation,
    )
    low, high = examples.low, examples.high
    if low is None or high is None:
        low, high = examples.actions.min(axis=0), examples.actions.max(axis=0)
        # The policy's bounds must not be equal, even if an action never changed.
        high = np.maximum(high, np.nextafter(low, np.float32(np.inf)))
    return policy_file.write(
        path,
        layers,
        mean=scaling.mean,
        variance=scaling.variance,
        epsilon=EPSILON,
        low=low,
        high=high,
        bounding="clip",
        metadata=_metadata(examples),
    )


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    # With small layers, more threads wait for each other longer than they compute.
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def _check(examples: Examples) -> None:
    count = len(examples.actions)
    if count < 2:
        raise InvalidArgument(f"the data set has {count} actions; nothing can be learned from it")
    for name in ("observations", "actions"):
        rows = ~np.isfinite(getattr(examples, name)).all(axis=1)
        if rows.any():
            raise InvalidArgument(
                f"row {int(np.flatnonzero(rows)[0])} of the {name} has a number that is not finite"
            )


def _apart(examples: Examples, recipe: Recipe) -> NDArray[np.bool_]:
    episodes = np.unique(examples.episodes)
    count = min(len(episodes) - 1, int(np.ceil(recipe.kept_apart * len(episodes))))
    random = np.random.default_rng(recipe.seed)
    chosen = random.choice(episodes, max(count, 0), replace=False)
    return np.isin(examples.episodes, chosen)


def _network(sizes: Sequence[int]) -> Any:
    from torch import nn

    modules: list[nn.Module] = []
    for inputs, outputs in itertools.pairwise(sizes):
        modules += [nn.Linear(inputs, outputs), nn.ReLU()]
    return nn.Sequential(*modules[:-1])


def _metadata(examples: Examples) -> dict[str, str]:
    if examples.environment:
        from trifinger._trifinger import robot_configuration
        from trifinger.environments import Options

        # The overrides have all that the task needs. A task in Python is not imported, because an
        # untrusted data set may name it.
        made = examples.environment
        return {
            "task": made["task"],
            "options": Options.from_json(made["options"]).to_json(),
            "robot": made["config"],
            "configuration": robot_configuration(made["config"], made["config_overrides"]),
        }
    return {"inputs": "\n".join(examples.inputs), "outputs": "\n".join(examples.outputs)}


def _read_lerobot(folder: Path) -> Examples:
    extras.require("trifinger-data-sets[lerobot]", "pyarrow")
    import pyarrow.parquet as pq

    info = json.loads((folder / "meta" / "info.json").read_text(encoding="utf-8"))
    features = info["features"]
    names = [name for name in (STATE, ENVIRONMENT) if name in features]
    if not names or ACTION not in features:
        raise InvalidArgument(f"{folder} has no {STATE} and {ACTION} to learn from")
    parts: dict[str, list[Any]] = {name: [] for name in (*names, ACTION, "episode_index")}
    for file in sorted((folder / "data").glob("*/*.parquet")):
        table = pq.read_table(file, columns=list(parts))
        for name, found in parts.items():
            column = table.column(name).combine_chunks()
            flat = column if name == "episode_index" else column.flatten()
            found.append(flat.to_numpy(zero_copy_only=False).reshape(len(table), -1))
    joined = {name: np.concatenate(found) for name, found in parts.items()}
    return Examples(
        np.concatenate([joined[name] for name in names], axis=1).astype(np.float32),
        joined[ACTION].astype(np.float32),
        joined["episode_index"].ravel().astype(np.int64),
        inputs=[one for name in names for one in features[name]["names"] or ()],
        outputs=features[ACTION]["names"] or (),
    )


def _read_minari(name: str) -> Examples:
    extras.require(*MINARI)
    import minari
    from gymnasium import spaces

    from trifinger_data_sets.recorded_environment import is_path

    data = minari.load_dataset(name)
    for what, space in (("observation", data.observation_space), ("action", data.action_space)):
        if not isinstance(space, spaces.Box) or len(space.shape) != 1:
            raise InvalidArgument(
                f"the {what} space of {name} is {space}; a policy learns from vectors: export it "
                "with --observation flat"
            )
    observations, actions, episodes = [], [], []
    for number, episode in enumerate(data.iterate_episodes()):
        observations.append(episode.observations[:-1])
        actions.append(episode.actions)
        episodes.append(np.full(len(episode.actions), number))
    metadata = data.storage.metadata
    names: dict[str, list[str]] = metadata.get("names", {})
    examples = Examples(
        np.concatenate(observations).astype(np.float32),
        np.concatenate(actions).astype(np.float32),
        np.concatenate(episodes),
        inputs=[one for key, part in names.items() if key != ACTION for one in part],
        outputs=names.get(ACTION, ()),
    )
    spec = json.loads(metadata["env_spec"]) if "env_spec" in metadata else {}
    if spec.get("entry_point") != MAKE:
        return examples
    if spec.get("additional_wrappers"):
        return dataclasses.replace(examples, note="its environment has wrappers")
    made = spec["kwargs"]
    if made.pop("files", None) is not None:
        made |= metadata["recorded_with"]
    config = made["config"]
    if is_path(config) and not Path(config).is_file():
        return dataclasses.replace(examples, note=f"{config}, the file of its robot, is not here")
    return dataclasses.replace(
        examples,
        environment=made,
        low=data.action_space.low,
        high=data.action_space.high,
    )
