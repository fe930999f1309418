# SPDX-License-Identifier: BSD-3-Clause
"""Small helps for images."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from trifinger_compat.opencv import opencv
from trifinger_compat.types import Array, Image, Numbers


def convert_image(raw_image: Any, format: str = "bgr") -> Image:  # noqa: A002  # the original's name
    """A raw image, a Bayer mosaic with rows R G and G B, in colours: "bgr", "rgb" or "gray".

    Colours have the shape (height, width, 3), gray (height, width). Raises ValueError for another
    format.
    """
    cv2 = opencv()

    image = np.ascontiguousarray(np.squeeze(np.asarray(raw_image)), dtype=np.uint8)
    # OpenCV names a mosaic by the second row, from the second column on.
    codes = {
        "bgr": cv2.COLOR_BAYER_BG2BGR,
        "rgb": cv2.COLOR_BAYER_BG2RGB,
        "gray": cv2.COLOR_BAYER_BG2GRAY,
    }
    if format not in codes:
        raise ValueError(f"Invalid format '{format}', must be one of {', '.join(codes)}")
    return np.asarray(cv2.cvtColor(image, codes[format]), dtype=np.uint8)


def rodrigues_to_matrix(rvec: Numbers) -> Array:
    """The rotation about a vector by its length [rad], as a 4 x 4 matrix."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec(np.asarray(rvec, dtype=float).ravel()).as_matrix()
    return matrix


def check_image_sharpness(
    image: Image, threshold1: float = 25, threshold2: float = 250
) -> tuple[float, Image]:
    """The mean of the edges in an image, and the edges. More edges mean a sharper image."""
    cv2 = opencv()

    edges = np.asarray(cv2.Canny(image, threshold1, threshold2), dtype=np.uint8)
    return float(np.mean(edges)), edges
