# SPDX-License-Identifier: BSD-3-Clause
"""Files of checkpoints: numbers and nothing that could run, whoever has written them.

A file is an archive of NumPy's arrays (.npz) with a text, `state.json`. The text is the tree of
lists, tuples, dictionaries and plain values; it refers to an array by its number.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections import deque
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import VectorizedActionNoise
from stable_baselines3.common.save_util import recursive_getattr, recursive_setattr

from trifinger.arrays import Array

TREE = "state.json"
PLAIN = (bool, int, float, str, type(None))


def dump(state: Any) -> bytes:
    """The file of a state: arrays, tensors and plain values in lists, tuples and dictionaries."""
    arrays: dict[str, Array] = {}
    text = json.dumps(_tree(state, arrays))
    arrays[TREE] = np.frombuffer(text.encode(), np.uint8)
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    return file.getvalue()


def load(content: bytes) -> Any:
    """The state in a file. Raises ValueError if it is none of dump()."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            # dump() compresses nothing, so nothing gets larger than the file.
            if any(one.compress_type != zipfile.ZIP_STORED for one in archive.infolist()):
                raise ValueError("it is compressed")
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            return _state(json.loads(arrays[TREE].tobytes()), arrays)
    except Exception as error:  # readers of damaged archives raise errors of every kind
        raise ValueError(f"{type(error).__name__}: {error}") from error


def _tree(value: Any, arrays: dict[str, Array]) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, PLAIN):
        return value
    if isinstance(value, torch.Tensor):
        return {"tensor": _kept(value.detach().cpu().numpy(), arrays)}
    if isinstance(value, np.ndarray):
        return {"array": _kept(value, arrays)}
    if isinstance(value, dict):
        return {"dict": [[_tree(key, arrays), _tree(one, arrays)] for key, one in value.items()]}
    if isinstance(value, list | tuple):
        kind = "list" if isinstance(value, list) else "tuple"
        return {kind: [_tree(one, arrays) for one in value]}
    raise TypeError(f"a checkpoint cannot have a {type(value).__name__}")


def _kept(values: Array, arrays: dict[str, Array]) -> str:
    name = str(len(arrays))
    arrays[name] = values
    return name


def _state(tree: Any, arrays: Any) -> Any:
    if isinstance(tree, PLAIN):
        return tree
    ((kind, value),) = tree.items()
    match kind:
        case "array":
            return arrays[value]
        case "tensor":
            return torch.from_numpy(arrays[value])
        case "dict":
            return {_state(key, arrays): _state(one, arrays) for key, one in value}
        case "list":
            return [_state(one, arrays) for one in value]
        case "tuple":
            return tuple(_state(one, arrays) for one in value)
    raise ValueError(f"it has an unknown kind of value: {kind}")


# ---- models ----


def state_of(model: BaseAlgorithm) -> dict[str, Any]:
    """What learning has changed in a model that its plan has made."""
    names, variables = model._get_torch_save_params()
    noise = getattr(model, "action_noise", None)
    if isinstance(noise, VectorizedActionNoise):
        noise = noise.noises[0]  # all have drawn equally often
    return {
        "parameters": {name: recursive_getattr(model, name).state_dict() for name in names},
        "variables": {name: recursive_getattr(model, name) for name in variables},
        "numbers": _numbers(model),
        "noise": {} if noise is None else _numbers(noise),
        "finished": [list(one or ()) for one in (model.ep_info_buffer, model.ep_success_buffer)],
    }


def restore(model: BaseAlgorithm, state: dict[str, Any]) -> None:
    """Makes a model that the same plan has made what it was in state_of().

    Raises ValueError, KeyError, TypeError or RuntimeError if the state is that of another model.
    """
    model.set_parameters(state["parameters"], exact_match=True, device="cpu")
    for name, value in state["variables"].items():
        recursive_setattr(model, f"{name}.data", value.data)
    _set_numbers(model, state["numbers"])
    if (noise := getattr(model, "action_noise", None)) is not None:
        _set_numbers(noise, state["noise"])
    names = ("ep_info_buffer", "ep_success_buffer")
    for name, values in zip(names, state["finished"], strict=True):
        setattr(model, name, deque(values, maxlen=model._stats_window_size))


def learned_by(algorithm: Any) -> dict[str, Any]:
    """What learning has changed in the attributes of an Algorithm."""
    parts = {
        name: one if isinstance(one, torch.Tensor) else one.state_dict()
        for name, one in _parts(algorithm).items()
    }
    return {"parts": parts, "numbers": _numbers(algorithm)}


def restore_learned(algorithm: Any, state: dict[str, Any]) -> None:
    """Gives an Algorithm what learned_by() returned.

    Raises ValueError, KeyError, TypeError or RuntimeError if that is of another one.
    """
    for name, one in _parts(algorithm).items():
        if isinstance(one, torch.Tensor):
            one.data.copy_(state["parts"][name])  # in place, because an optimizer may have it
        else:
            one.load_state_dict(state["parts"][name])
    _set_numbers(algorithm, state["numbers"])


def arrays_of(holder: Any) -> dict[str, Any]:
    """The arrays and numbers of a buffer of transitions."""
    arrays = {name: one for name, one in vars(holder).items() if isinstance(one, np.ndarray)}
    return {"arrays": arrays, "numbers": _numbers(holder)}


def set_arrays(holder: Any, state: dict[str, Any]) -> None:
    """Gives a buffer what arrays_of() returned. Raises ValueError if it is that of another one."""
    for name, values in state["arrays"].items():
        own = vars(holder)[name]
        if own.shape != values.shape or own.dtype != values.dtype:
            raise ValueError(f"{name} is {values.dtype}{values.shape}, not {own.dtype}{own.shape}")
        own[...] = values
    _set_numbers(holder, state["numbers"])


def _parts(algorithm: Any) -> dict[str, Any]:
    held = {"": algorithm} | vars(algorithm)  # it may be a module itself
    return {
        name: one
        for name, one in held.items()
        if isinstance(one, torch.Tensor) or hasattr(one, "state_dict")
    }


def _numbers(holder: Any) -> dict[str, Any]:
    return {
        name: value
        for name, value in vars(holder).items()
        if isinstance(value, bool | int | float | np.generic)
    }


def _set_numbers(holder: Any, numbers: dict[str, Any]) -> None:
    known = vars(holder)
    for name, value in numbers.items():
        if name not in known or not isinstance(value, bool | int | float):
            raise ValueError(f"there is no number {name}")
        known[name] = value
