# SPDX-License-Identifier: BSD-3-Clause
"""Packages that programs import beside the original: what stands in if they are not installed."""

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ament_index_python import packages as ament
from rrc_2022_datasets.utils import get_pose_from_keypoints
from scipy.spatial.transform import Rotation
from trifinger_rl_datasets import PolicyBase, PolicyConfig, TriFingerDatasetEnv
from trifinger_rl_datasets.evaluate_sim import load_policy_class
from trifinger_simulation import finger_types_data


class Resting(PolicyBase):
    def get_action(self, observation: Any) -> Any:
        return np.zeros_like(observation)


def test_a_policy_has_a_configuration_and_acts() -> None:
    with pytest.raises(TypeError, match="abstract"):
        PolicyBase(None, None, 750)  # type: ignore[abstract]
    policy = Resting(None, None, 750)
    assert policy.get_policy_config() == PolicyConfig(flatten_obs=True, image_obs=False)
    policy.reset()
    assert list(policy.get_action(np.ones(9))) == [0] * 9


def test_policies_are_found_by_their_names() -> None:
    assert load_policy_class(f"{__name__}.Resting") is Resting
    for wrong in (f"{__name__}.Missing", "missing.module.Policy", "nothing"):
        with pytest.raises(RuntimeError, match="Failed to import policy"):
            load_policy_class(wrong)


@pytest.mark.parametrize("count", [3, 5, 8])
def test_the_pose_of_a_box_follows_from_its_corners(count: int) -> None:
    position, size = np.array([0.1, -0.2, 0.3]), np.array([0.065, 0.03, 0.02])
    turn = Rotation.from_euler("xyz", [0.4, -0.9, 2.0])
    # x changes first: + + +, - + +, + - +, ...
    corners = [[x, y, z] for z in (1, -1) for y in (1, -1) for x in (1, -1)]
    seen = position + turn.apply(np.array(corners) * size / 2)
    found, orientation = get_pose_from_keypoints(seen[:count], size)
    assert found == pytest.approx(position)
    assert (Rotation.from_quat(orientation) * turn.inv()).magnitude() < 1e-6
    with pytest.raises(ValueError, match="must be 3 to 8"):
        get_pose_from_keypoints(seen[:2])


def test_data_sets_need_their_own_package() -> None:
    with pytest.raises(NotImplementedError, match=r"install it as docs/coming_from_the_original"):
        TriFingerDatasetEnv(name="trifinger-cube-push-sim-expert-v0")
    assert callable(TriFingerDatasetEnv.get_dataset)


def test_an_installed_package_comes_before_what_stands_in_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # pip puts both into one folder.
    (tmp_path / "other_data_sets").mkdir()
    (tmp_path / "other_data_sets" / "__init__.py").write_text("origin = 'installed'\n")
    (tmp_path / "other_data_sets.py").write_text("origin = 'stands in'\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert importlib.import_module("other_data_sets").origin == "installed"


def test_files_of_packages_are_found_without_ros() -> None:
    folder = Path(ament.get_package_share_directory("robot_properties_fingers"))
    assert (folder / "urdf" / finger_types_data.get_finger_urdf("trifingerpro")).is_file()
    cameras = Path(ament.get_package_share_directory("trifinger_simulation"), "data/camera_params")
    assert (cameras / "camera60_cropped.yml").is_file()
    with pytest.raises(KeyError, match="not found"):
        ament.get_package_share_directory("something_else")
    with pytest.raises(ament.PackageNotFoundError):
        ament.get_package_share_directory("something_else")
