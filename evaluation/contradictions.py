# SPDX-License-Identifier: BSD-3-Clause
"""Whether pictures of a cube contradict what is believed of it, for anybody who looks at them.

Faulty pictures may show nothing wrong: a finger hides the face whose colour is believed wrongly,
the camera whose image is old does not see the cube, and another orientation of a wrong cube may
show the same colours at the same places. The truth decides, not a tracker: it is known which pixels
show which face, fingers in front of the cube included.
"""

import colorsys
import itertools
from collections import Counter
from collections.abc import Sequence

import cv2
import numpy as np
from tracking_scenes import AXES

PAINTS = {  # of the cube of the simulation: red, green, blue
    "red": (195, 48, 0),
    "green": (153, 208, 96),
    "blue": (4, 35, 96),
    "cyan": (116, 200, 191),
    "magenta": (164, 91, 164),
    "yellow": (255, 235, 108),
}
LIKE = 30.0
"""Hues this near look alike in some light [degrees]. Those of the cube differ by 36 and more."""
BORDER = 2
"""Pixels this near to something else do not count: blur and the mosaic mix their colours."""
VISIBLE = 100
"""Pixels that anybody sees: a square of 10 x 10, some 6 mm of the cube in a full image."""


def _turns() -> list[np.ndarray]:
    """For each of 24 orientations, the number of the face that comes to the place of each face."""
    turns = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((-1, 1), repeat=3):
            rotation = np.diag(signs)[list(order)]
            if np.linalg.det(rotation) > 0:
                turns.append(np.argmax(AXES @ rotation @ AXES.T, axis=1))
    return turns


TURNS = _turns()


def painted(faces: Sequence[np.ndarray], colours: Sequence[str]) -> list[np.ndarray]:
    """The images without light: the faces in their colours, black for everything else."""
    paints = np.array([*(PAINTS[colour] for colour in colours), (0, 0, 0)], np.uint8)
    return [paints[numbers] for numbers in faces]


def looks_like(paint: Sequence[int], colour: str) -> bool:
    """Whether this red, green and blue may be a face of this colour in some light."""
    if not any(paint):
        return False
    hue, own = (colorsys.rgb_to_hsv(*each)[0] for each in (paint, PAINTS[colour]))
    return 360 * abs((hue - own + 0.5) % 1 - 0.5) <= LIKE


def contradicting_pixels(
    shown: Sequence[np.ndarray], faces: Sequence[np.ndarray], believed: Sequence[str]
) -> int:
    """The number of pixels that speak against a cube, in the orientation that explains them best.

    `shown` are painted images, one of each camera, `faces` the numbers of the faces that these
    cameras see if all is well, and `believed` the colours of the cube.
    """
    found: Counter[tuple[int, tuple[int, ...]]] = Counter()
    for image, numbers in zip(shown, faces, strict=True):
        code = (numbers + 1.0) * 2**24 + image.astype(float) @ (2**16, 2**8, 1)
        around = np.ones((2 * BORDER + 1, 2 * BORDER + 1))
        is_clear = cv2.erode(code, around) == cv2.dilate(code, around)
        for each, count in zip(*np.unique(code[is_clear], return_counts=True), strict=True):
            number, *paint = int(each).to_bytes(4, "big")
            found[number - 1, tuple(paint)] += int(count)

    def against(turn: np.ndarray) -> int:
        return sum(
            count
            for (face, paint), count in found.items()
            if (any(paint) if face < 0 else not looks_like(paint, believed[turn[face]]))
        )

    return min(against(turn) for turn in TURNS)
