# SPDX-License-Identifier: BSD-3-Clause
"""Where packages keep their files, for programs that ask ROS 2 for it; an installed ROS is first.

`from ament_index_python.packages import get_package_share_directory` works, too.
"""

import sys
from collections.abc import Callable
from pathlib import Path

from trifinger_compat.camera_files import data_folder
from trifinger_compat.urdf import share_folder

_FOLDERS: dict[str, Callable[[], Path]] = {
    "robot_properties_fingers": share_folder,  # has `urdf`
    "trifinger_simulation": lambda: data_folder().parent,  # has `data/camera_params`
}


class PackageNotFoundError(KeyError):
    """There is no such package."""


def get_package_share_directory(package_name: str) -> str:
    """The folder with a package's files; PackageNotFoundError for packages of others."""
    if package_name not in _FOLDERS:
        raise PackageNotFoundError(
            f"package '{package_name}' not found; without ROS there are {', '.join(_FOLDERS)}"
        )
    return str(_FOLDERS[package_name]())


sys.modules[f"{__name__}.packages"] = sys.modules[__name__]
