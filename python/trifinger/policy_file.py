# SPDX-License-Identifier: BSD-3-Clause
"""Files of policies for `trifinger.Policy`, from arrays, PyTorch and Stable-Baselines3.

    policy_file.export(model, "reach.policy", metadata={"robot": "trifinger_pro"})

Neither PyTorch nor Stable-Baselines3 is imported: their objects are read by their attributes.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from trifinger._trifinger import Policy
from trifinger.errors import InvalidArgument
from trifinger.whole_file import whole_file

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

# Weights with a row for each output, biases, and the activation: "identity", "relu", "tanh"
# or "elu".
Layer = tuple["ArrayLike", "ArrayLike", str]

ACTIVATIONS = {"ELU": "elu", "ReLU": "relu", "Tanh": "tanh"}
# Modules that change nothing when a policy is only evaluated.
WITHOUT_EFFECT = {"Dropout", "Flatten", "Identity"}


def write(
    path: str | os.PathLike[str],
    layers: Sequence[Layer],
    *,
    mean: ArrayLike | None = None,
    variance: ArrayLike | None = None,
    epsilon: float = 1e-8,
    clip: float = 10.0,
    low: ArrayLike | None = None,
    high: ArrayLike | None = None,
    bounding: str = "scale",
    metadata: Mapping[str, str] | None = None,
) -> Policy:
    """Writes the file of a policy and returns the policy.

    The arguments are those of `trifinger.Policy.from_layers`. An array may be anything that NumPy
    can turn into one. Weights and biases are rounded to single precision.
    """
    if not layers:
        raise InvalidArgument("a policy needs at least one layer")
    policy = Policy.from_layers(
        [
            (_single(weights, i, "weights", 2), _single(bias, i, "bias", 1), activation)
            for i, (weights, bias, activation) in enumerate(layers)
        ],
        mean=_numbers("mean", mean),
        variance=_numbers("variance", variance),
        epsilon=epsilon,
        clip=clip,
        low=_numbers("low", low),
        high=_numbers("high", high),
        bounding=bounding,
        metadata=dict(metadata or {}),
    )
    with whole_file(path) as part:
        policy.save(part)
    return policy


def with_metadata(onnx: bytes, metadata: Mapping[str, str]) -> bytes:
    """A file of ONNX that says more of itself: its `metadata_props`.

    In protocol buffers, what is appended to a repeated field is added to it.
    """

    def field(number: int, text: bytes) -> bytes:
        size, head = len(text), bytearray([number << 3 | 2])
        while size >= 0x80:
            head.append(size & 0x7F | 0x80)
            size >>= 7
        return bytes(head) + bytes([size]) + text

    entries = (field(1, key.encode()) + field(2, value.encode()) for key, value in metadata.items())
    return onnx + b"".join(field(14, entry) for entry in entries)


def to_onnx(policy: Policy) -> bytes:
    """The file of ONNX, with opset 17, that computes what a policy of dense layers computes.

    Its input is `observation`, N rows; its output `action`. Sums are in single precision. Needs the
    package `onnx`. Raises InvalidArgument if the policy is of ONNX already.
    """
    from onnx import TensorProto, helper, numpy_helper

    if not policy.layers:
        raise InvalidArgument("this policy is of ONNX already")
    nodes: list[Any] = []
    constants: list[Any] = []
    last = "observation"

    def constant(numbers: ArrayLike) -> str:
        name = f"c{len(constants)}"
        constants.append(numpy_helper.from_array(np.asarray(numbers, np.float32), name))
        return name

    def add(operator: str, *inputs: ArrayLike, **attributes: Any) -> None:
        nonlocal last
        names = [last, *map(constant, inputs)]
        last = f"x{len(nodes)}"
        nodes.append(helper.make_node(operator, names, [last], **attributes))

    if policy.normalization is not None:
        mean, variance, epsilon, clip = policy.normalization
        add("Sub", mean)
        add("Div", np.sqrt(np.add(variance, epsilon)))
        add("Clip", -clip, clip)
    for weights, bias, activation in policy.layers:
        add("Gemm", weights, bias, transB=1)
        if activation != "identity":
            add(activation.capitalize())
    if policy.bounds is not None:
        low, high, bounding = policy.bounds
        if bounding == "scale":
            add("Clip", -1.0, 1.0)
            add("Mul", np.subtract(high, low) / 2)
            add("Add", np.add(high, low) / 2)
        add("Max", low)
        add("Min", high)
    nodes[-1].output[0] = "action"
    sizes = {"observation": policy.num_inputs, "action": policy.num_outputs}
    first, second = (
        helper.make_tensor_value_info(name, TensorProto.FLOAT, ["N", size])
        for name, size in sizes.items()
    )
    graph = helper.make_graph(nodes, "policy", [first], [second], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    return with_metadata(model.SerializeToString(), policy.metadata)


def layers_of(network: Any) -> list[Layer]:
    """The layers of a `torch.nn.Linear`, or a `torch.nn.Sequential` of them and activations."""
    layers: list[Layer] = []
    for module in _modules(network):
        name = type(module).__name__
        if name == "Linear":
            layers.append((_array(module.weight), _bias(module), "identity"))
        elif name in ACTIVATIONS and layers and layers[-1][2] == "identity":
            layers[-1] = (*layers[-1][:2], ACTIVATIONS[name])
        elif name in ACTIVATIONS:
            raise InvalidArgument(f"the network has a {name} that does not follow a Linear")
        elif name not in WITHOUT_EFFECT:
            known = ", ".join(["Linear", *ACTIVATIONS, *sorted(WITHOUT_EFFECT)])
            raise InvalidArgument(f"the network has a {name}; a policy can be made of {known}")
    return layers


def export(
    model: Any,
    path: str | os.PathLike[str],
    *,
    normalizer: Any = None,
    metadata: Mapping[str, str] | None = None,
) -> Policy:
    """Writes the deterministic policy of a Stable-Baselines3 model, and returns it.

    `model` is a DDPG, TD3, SAC, PPO or A2C, or the policy or actor of one. `normalizer` is the
    `VecNormalize` that it was trained with; a model that still has its environment finds it there.
    Dictionaries of observations are joined in the order of the keys of their space.
    """
    if normalizer is None and hasattr(model, "get_vec_normalize_env"):
        normalizer = model.get_vec_normalize_env()
    policy = getattr(model, "policy", model)
    actor = getattr(policy, "actor", policy)
    if hasattr(actor, "latent_pi"):  # SAC: a tanh bounds its actions
        layers = _with_tanh(layers_of(actor.latent_pi) + layers_of(actor.mu))
    elif hasattr(actor, "mu"):  # DDPG, TD3
        layers = layers_of(actor.mu)
    elif hasattr(actor, "action_net"):  # PPO, A2C
        layers = layers_of(actor.mlp_extractor.policy_net) + layers_of(actor.action_net)
        if actor.squash_output:
            layers = _with_tanh(layers)
    else:
        raise InvalidArgument(
            f"a {type(model).__name__} is no model of Stable-Baselines3 that has an actor: "
            "A2C, DDPG, PPO, SAC, TD3"
        )
    _check_observations(actor)
    mean, variance = _statistics(normalizer, actor.observation_space)
    space = actor.action_space
    if not hasattr(space, "low") or len(space.shape) != 1:
        raise InvalidArgument(f"the action space is {space}, must be a Box of one dimension")
    return write(
        path,
        layers,
        mean=mean,
        variance=variance,
        epsilon=1e-8 if normalizer is None else normalizer.epsilon,
        clip=10.0 if normalizer is None else normalizer.clip_obs,
        low=space.low,
        high=space.high,
        bounding="scale" if layers[-1][2] == "tanh" else "clip",
        metadata=metadata,
    )


def _numbers(name: str, numbers: ArrayLike | None) -> list[float] | None:
    if numbers is None:
        return None
    array = _array(numbers)
    if array.ndim != 1:
        raise InvalidArgument(f"{name} has the shape {array.shape}, must have one dimension")
    return [float(number) for number in array]


def _single(numbers: ArrayLike, i: int, name: str, dimensions: int) -> NDArray[np.float32]:
    array = _array(numbers)
    if array.ndim != dimensions:
        raise InvalidArgument(
            f"{name} of layer {i} has the shape {array.shape}, must have {dimensions} dimensions"
        )
    with np.errstate(over="ignore"):  # from_layers() refuses infinity with a sentence
        return np.ascontiguousarray(array, np.float32)


def _array(numbers: Any) -> NDArray[np.float64]:
    # NumPy cannot convert tensors that have a gradient or are on a GPU.
    if hasattr(numbers, "detach"):
        numbers = numbers.detach().cpu()
    try:
        return np.asarray(numbers, np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(f"{numbers!r:.200} is no array of numbers: {error}") from error


def _bias(linear: Any) -> NDArray[np.float64]:
    if linear.bias is None:
        return np.zeros(len(linear.weight))
    return _array(linear.bias)


def _modules(module: Any) -> Iterator[Any]:
    if type(module).__name__ == "Sequential":
        for child in module:  # children() leaves out an activation that comes twice
            yield from _modules(child)
    else:
        yield module


def _with_tanh(layers: list[Layer]) -> list[Layer]:
    weights, bias, activation = layers[-1]
    if activation != "identity":
        raise InvalidArgument(
            f"the last layer has the activation {activation}, must have none before tanh"
        )
    return [*layers[:-1], (weights, bias, "tanh")]


def _check_observations(actor: Any) -> None:
    # The file holds only the layers, so nothing else may process observations before them.
    extractor = getattr(actor, "pi_features_extractor", actor.features_extractor)
    parts = [extractor]
    if type(extractor).__name__ == "CombinedExtractor":
        parts = list(extractor.extractors.values())
    for part in parts:
        if type(part).__name__ not in {"FlattenExtractor", "Flatten"}:
            raise InvalidArgument(
                f"observations go through a {type(part).__name__} before the layers; a policy "
                "can be made of models that look at plain numbers"
            )
    for name, space in _spaces(actor.observation_space):
        if not hasattr(space, "low"):
            raise InvalidArgument(f"the observation space{name} is {space}, must be a Box")


def _spaces(space: Any) -> list[tuple[str, Any]]:
    if hasattr(space, "spaces"):
        return [(f" '{key}'", part) for key, part in space.spaces.items()]
    return [("", space)]


def _statistics(
    normalizer: Any, space: Any
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
    if normalizer is None or not normalizer.norm_obs:
        return None, None
    statistics = [normalizer.obs_rms]
    if hasattr(space, "spaces"):
        if missing := set(space.spaces) - set(normalizer.obs_rms):
            raise InvalidArgument(
                f"the normalizer leaves {', '.join(sorted(missing))} as it is; a policy normalises "
                "all of its inputs or none"
            )
        statistics = [normalizer.obs_rms[key] for key in space.spaces]
    return (
        np.concatenate([np.ravel(_array(one.mean)) for one in statistics]),
        np.concatenate([np.ravel(_array(one.var)) for one in statistics]),
    )
