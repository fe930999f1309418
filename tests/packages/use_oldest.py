# SPDX-License-Identifier: BSD-3-Clause
"""Evaluates a policy with `trifinger_rl_datasets` itself: `./run soak oldest` starts it.

    PYTHON use_oldest.py

PYTHON's environment has that package and the lowest versions that our packages allow. Its
evaluation runs with no newer ones: gymnasium 1 forwards no attributes through its wrappers.
"""

import importlib
import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from trifinger_rl_datasets import PolicyBase, PolicyConfig, evaluate_sim


class Still(PolicyBase):  # type: ignore[misc]
    """Holds the fingers where the torque of the middle leaves them."""

    def __init__(self, action_space: Any, observation_space: Any, episode_length: int) -> None:
        super().__init__(action_space, observation_space, episode_length)
        self._action = np.zeros(action_space.shape, dtype=action_space.dtype)

    @staticmethod
    def get_policy_config() -> PolicyConfig:
        """Flat observations without images."""
        return PolicyConfig(flatten_obs=True, image_obs=False)

    def get_action(self, observation: Any) -> Any:
        """The same action, whatever is observed."""
        assert np.isfinite(observation).all()
        return self._action


def main() -> None:
    """Evaluates both tasks; an assertion says what is wrong."""
    with pytest.raises(ImportError, match=r"need Gymnasium 1\.1 or newer, and gymnasium 0\."):
        importlib.import_module("trifinger.environments")
    with TemporaryDirectory() as folder:
        result = Path(folder, "result.json")
        for task in ("push", "lift"):
            words = ["evaluate_sim", task, "use_oldest.Still"]
            with patch.object(sys, "argv", [*words, "--n-episodes=1", f"--output={result}"]):
                assert evaluate_sim.main() == 0
            found = json.loads(result.read_text())
            assert found["n_episodes"] == 1
            assert found["return"] > 0, found
            print(f"evaluated {task} as trifinger_rl_datasets does: return {found['return']:.1f}")


if __name__ == "__main__":
    main()
