# SPDX-License-Identifier: BSD-3-Clause
"""Calibrates cameras: lenses and poses from images of a ChArUco board.

    images = ImageSet.of_folder(Path("images"))
    result = calibrate(images, PRESETS["a4"])
    if not result.problems:
        Path("robot.cameras.yml").write_text(result.calibration.text())

Needs OpenCV: the packages of the extra `cameras`, as `trifinger.extras` says.
"""

from trifinger.camera_calibration.board import PRESETS, Board
from trifinger.camera_calibration.calibration import Options, calibrate
from trifinger.camera_calibration.images import ImageSet
from trifinger.camera_calibration.result import Result

__all__ = ["PRESETS", "Board", "ImageSet", "Options", "Result", "calibrate"]
