# SPDX-License-Identifier: BSD-3-Clause
"""Robot descriptions and kinematics of the original stack, for this project's models."""

from pathlib import Path

from trifinger_compat.urdf import share_folder as _share_folder

from robot_properties_fingers.kinematics import Kinematics as Kinematics

__all__ = ["Kinematics", "get_urdf_base_path"]

_FOLDERS = {"pro": "pro", "edu": "edu", "one": ".", "_root_": "."}


def get_urdf_base_path(robot_type: str) -> Path:
    """The folder with the descriptions of "pro", "edu" or "one", or "_root_" of all of them."""
    if robot_type not in _FOLDERS:
        raise ValueError(
            f"Invalid robot type '{robot_type}'. Valid types are {', '.join(_FOLDERS)}"
        )
    return _share_folder() / "urdf" / _FOLDERS[robot_type]
