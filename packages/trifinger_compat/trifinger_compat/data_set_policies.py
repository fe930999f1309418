# SPDX-License-Identifier: BSD-3-Clause
"""What programs use of `trifinger_rl_datasets` and `rrc_2022_datasets` if these are not installed.

Policies, and the poses of keypoints, need no data set and work here. The environments with their
data sets need the packages themselves.
"""

import importlib
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from trifinger_compat.types import Array, Numbers

# For each corner of a box whether it is on the positive side in x, y and z.
_SIGNS = np.array([[1 - 2 * (i >> axis & 1) for axis in range(3)] for i in range(8)])


@dataclass
class PolicyConfig:
    """What a policy wants as an observation: flat arrays, and images."""

    flatten_obs: bool = True
    image_obs: bool = False


class PolicyBase(ABC):
    """A policy that can be evaluated."""

    def __init__(self, action_space: Any, observation_space: Any, episode_length: int) -> None:  # noqa: B027  # need not be overridden
        """`episode_length` is in steps."""

    @staticmethod
    def get_policy_config() -> PolicyConfig:
        """What this policy wants as an observation."""
        return PolicyConfig()

    def reset(self) -> None:  # noqa: B027  # need not be overridden
        """Is called at the beginning of each episode."""

    @abstractmethod
    def get_action(self, observation: Any) -> Any:
        """The action after an observation."""


def load_policy_class(policy_class_str: str) -> type[PolicyBase]:
    """The class "package.module.Class"; raises RuntimeError if it cannot be imported."""
    module, _, name = policy_class_str.rpartition(".")
    try:
        found: type[PolicyBase] = getattr(importlib.import_module(module), name)
    except Exception as error:
        raise RuntimeError(f"Failed to import policy {name} from module {module}") from error
    return found


def get_pose_from_keypoints(
    keypoints: Numbers, dimensions: Numbers = (0.065, 0.065, 0.065)
) -> tuple[Array, Array]:
    """Position [m] and orientation x, y, z, w of a box with these corners.

    The first corner is at positive x, y and z. Then x changes first and z last. At least the first
    three corners must be given; ValueError for fewer.
    """
    seen = np.asarray(keypoints, dtype=float).reshape(-1, 3)
    if not 3 <= len(seen) <= len(_SIGNS):
        raise ValueError(f"there are {len(seen)} keypoints, must be 3 to 8")
    corners = _SIGNS[: len(seen)] * np.asarray(dimensions, dtype=float) / 2
    middle = corners.mean(axis=0)
    turn = Rotation.align_vectors(seen - seen.mean(axis=0), corners - middle)[0]
    return seen.mean(axis=0) - turn.apply(middle), turn.as_quat()


class TriFingerDatasetEnv:
    """The environment of a data set, which only its own package has."""

    def __init__(self, *_: Any, **__: Any) -> None:
        raise NotImplementedError(
            "the data sets belong to the package trifinger_rl_datasets, which runs on top of this "
            "one: install it as docs/coming_from_the_original.md says in 'Data sets'"
        )

    def get_dataset(self, *_: Any, **__: Any) -> dict[str, Any]:
        """Never reached: there is no such environment without the package."""
        raise NotImplementedError
