# SPDX-License-Identifier: BSD-3-Clause
"""Finding the light blue dice in an image."""

import numpy as np
from trifinger_compat.opencv import opencv
from trifinger_compat.types import Image

# Of the colour of the dice, 0x0A7DCF, in all light: hue (0 to 179), saturation, value.
LOW, HIGH = (92, 90, 40), (112, 255, 255)


def segment_image(image_bgr: Image) -> Image:
    """255 where an image (height, width, 3) shows dice, 0 elsewhere; RuntimeError for others."""
    cv2 = opencv()

    image = np.asarray(image_bgr)
    if image.ndim != 3 or image.shape[2] != 3:
        raise RuntimeError(f"the image has shape {image.shape}, must have three channels")
    hsv = cv2.cvtColor(np.ascontiguousarray(image, dtype=np.uint8), cv2.COLOR_BGR2HSV)
    mask = cv2.medianBlur(cv2.inRange(hsv, np.array(LOW), np.array(HIGH)), 3)
    opened = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    return np.asarray(opened, dtype=np.uint8)
