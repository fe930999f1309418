# SPDX-License-Identifier: BSD-3-Clause
"""OpenCV, which only raw images and masks need."""

from importlib.util import find_spec
from typing import Any

# What needs it.
USERS = frozenset(
    (
        "trifinger_cameras.utils.check_image_sharpness",
        "trifinger_cameras.utils.convert_image",
        "trifinger_object_tracking.cube_visualizer.CubeVisualizer",
        "trifinger_object_tracking.py_lightblue_segmenter.segment_image",
        "trifinger_simulation.tasks.rearrange_dice.generate_goal_mask",
    )
)
MISSING = (
    "cv2 is missing: pip install opencv-python, or opencv-python-headless, which opens no windows; "
    "only one of them can be installed"
)


def is_missing() -> bool:
    """True if OpenCV is not installed."""
    try:
        return find_spec("cv2") is None
    except ValueError:  # somebody has put something without a spec in its place
        return True


def opencv() -> Any:
    """The module cv2; raises ModuleNotFoundError that names the packages which have it."""
    try:
        import cv2
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(MISSING, name="cv2") from error
    return cv2
