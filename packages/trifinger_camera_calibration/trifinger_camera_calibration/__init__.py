# SPDX-License-Identifier: BSD-3-Clause
"""Calibrates cameras: lenses and poses from images of a ChArUco board.

    images = ImageSet.of_folder(Path("images"))
    result = calibrate(images, PRESETS["a4"])
    if not result.problems:
        Path("robot.cameras.yml").write_text(result.calibration.text())

These names need OpenCV: the packages of the extra `opencv`. `colours` learns how the faces of an
object look to the cameras.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if find_spec("trifinger") is None:
    raise ModuleNotFoundError(
        "trifinger-camera-calibration needs the package `trifinger`, which is not installed and on "
        "no index: install it from its sources or its wheel, as docs/installing.md says",
        name="trifinger",
    )

if TYPE_CHECKING:
    from trifinger_camera_calibration.board import PRESETS, Board
    from trifinger_camera_calibration.calibration import Options, calibrate
    from trifinger_camera_calibration.images import ImageSet
    from trifinger_camera_calibration.result import Result

__all__ = ["PRESETS", "Board", "ImageSet", "Options", "Result", "calibrate"]

_MODULES = {
    "PRESETS": "board",
    "Board": "board",
    "ImageSet": "images",
    "Options": "calibration",
    "Result": "result",
    "calibrate": "calibration",
}


def __getattr__(name: str) -> Any:
    """A name of this package, whose module is imported when somebody asks for it."""
    if name not in _MODULES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
