# SPDX-License-Identifier: BSD-3-Clause
"""Finds a device that somebody else has written."""

import importlib
import sys
from pathlib import Path

from trifinger.errors import InvalidArgument

from trifinger_view.teleoperation.command import Device


def load_device(name: str) -> Device:
    """The function that `name`, as in "module:function", stands for.

    Modules are looked for in the working directory, too.

    Raises:
        InvalidArgument: if there is no such module or function; what else an import raises
    """
    module_name, colon, function_name = name.partition(":")
    if not (colon and module_name and function_name):
        raise InvalidArgument(
            f"the device is '{name}', must be keyboard, gamepad or MODULE:FUNCTION"
        )
    folder = str(Path.cwd())
    if folder not in sys.path:
        sys.path.insert(0, folder)
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{module_name}.".startswith(f"{error.name}."):
            raise  # the module is there and lacks another one
        raise InvalidArgument(
            f"there is no module '{module_name}' here or in the packages of {sys.executable}"
        ) from error
    device: object = getattr(module, function_name, None)
    if not callable(device):
        raise InvalidArgument(
            f"module '{module_name}' ({module.__file__}) has no function '{function_name}'"
        )
    return device
