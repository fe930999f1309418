# SPDX-License-Identifier: BSD-3-Clause
"""Wrong pictures of a cube, made from right ones: what goes wrong when cameras are set up.

A tracker must not be sure of any of them, however good its pose looks. Pictures that show none of
the faces that are exchanged are right ones, whichever of the two cubes lies there: where the pose
is known, these are left out.
"""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from trifinger import CameraCalibration
from trifinger.poses import Matrix
from trifinger.tracking import TrackedObject, Tracker, coloured_box

FACES = ("red", "green", "blue", "cyan", "magenta", "yellow")  # +x, +y, +z, -z, -x, -y
SIZE = 0.065  # of the cube [m]
RIM = 0.06  # of a cube, in its lengths
STALE = 20  # how far an image of an instant before lies beside the new one [pixel]
SHIFT = 40  # between two parts of the sensor [pixel]

Images = Sequence[np.ndarray]


def cube(size: float = SIZE, colours: Sequence[str] = FACES) -> TrackedObject:
    """A cube with rims, as the simulation draws it."""
    return coloured_box("cube", [size] * 3, list(colours), RIM * size)


BELIEVED: Mapping[str, TrackedObject] = {
    "cube of 50 mm believed": cube(0.05),
    "cube of 80 mm believed": cube(0.08),
    "colours of the cube of 2020 believed": cube(colours=(*FACES[:4], "yellow", "magenta")),
    "red and blue faces exchanged": cube(colours=("blue", "green", "red", *FACES[3:])),
    "opposite faces exchanged": cube(colours=("magenta", *FACES[1:4], "red", "yellow")),
}
"""What the tracker takes the cube for, if the images are right."""

SEEN = 10.0  # a face that leans more against the view is not seen [degrees]
AXES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [-1, 0, 0], [0, -1, 0]])
CHANGED: Mapping[str, Sequence[int]] = {
    "colours of the cube of 2020 believed": (4, 5),
    "red and blue faces exchanged": (0, 2),
}
"""Faces that must be seen to tell what is believed from what lies there."""


def _moved(image: np.ndarray, rows: int, columns: int) -> np.ndarray:
    return np.roll(image, (rows, columns), axis=(0, 1))


def _mirrored(image: np.ndarray, axis: int) -> np.ndarray:
    mirror = np.flip(image, axis)
    if image.ndim == 3 or axis == 2:
        return mirror
    return np.roll(mirror, 1, axis)  # the pattern of the mosaic stays


def _red_for_blue(image: np.ndarray) -> np.ndarray:
    return image[..., ::-1] if image.ndim == 3 else _moved(image, 1, 1)


def _green_for_red(image: np.ndarray) -> np.ndarray:
    return image[..., [1, 0, 2]] if image.ndim == 3 else _moved(image, 0, 1)


def _one(
    change: Callable[[np.ndarray], np.ndarray],
) -> Callable[[Images, Images, np.random.Generator], Images]:
    """Changes the image of one camera."""

    def changed(images: Images, _: Images, random: np.random.Generator) -> Images:
        which = random.integers(len(images))
        return [change(each) if i == which else each for i, each in enumerate(images)]

    return changed


def _all(
    change: Callable[[np.ndarray], np.ndarray],
) -> Callable[[Images, Images, np.random.Generator], Images]:
    return lambda images, _, __: [change(each) for each in images]


def _exchanged(images: Images, _: Images, random: np.random.Generator) -> Images:
    exchanged = list(images)
    a, b = random.choice(len(images), 2, replace=False)
    exchanged[a], exchanged[b] = images[b], images[a]
    return exchanged


def _in_turn(images: Images, _: Images, random: np.random.Generator) -> Images:
    step = int(random.integers(1, len(images)))
    return [*images[step:], *images[:step]]


def _twice(images: Images, _: Images, random: np.random.Generator) -> Images:
    a, b = random.choice(len(images), 2, replace=False)
    return [images[a] if i == b else each for i, each in enumerate(images)]


def _of_before(images: Images, before: Images, random: np.random.Generator) -> Images:
    which = random.integers(len(images))
    return [before[i] if i == which else each for i, each in enumerate(images)]


def _stale(images: Images, _: Images, random: np.random.Generator) -> Images:
    which = random.integers(len(images))
    angle = random.uniform(0, 2 * np.pi)
    rows, columns = 2 * np.rint(STALE / 2 * np.array([np.sin(angle), np.cos(angle)])).astype(int)
    return [_moved(each, rows, columns) if i == which else each for i, each in enumerate(images)]


WRONG: Mapping[str, Callable[[Images, Images, np.random.Generator], Images]] = {
    "two cameras exchanged": _exchanged,
    "all cameras in another order": _in_turn,
    "one image for two cameras": _twice,
    "all images mirrored": _all(lambda image: _mirrored(image, 1)),
    "one image mirrored": _one(lambda image: _mirrored(image, 1)),
    "all images upside down": _all(lambda image: _mirrored(_mirrored(image, 0), 1)),
    "one image upside down": _one(lambda image: _mirrored(_mirrored(image, 0), 1)),
    "red and blue channels exchanged": _all(_red_for_blue),
    "red and green channels exchanged": _all(_green_for_red),
    "red and blue channels exchanged in one image": _one(_red_for_blue),
    f"one image {STALE} pixels stale": _stale,
    "one image of another scene": _of_before,
    f"another part of the sensor, {SHIFT} pixels beside": _all(
        lambda image: _moved(image, 0, SHIFT)
    ),
}
"""What becomes of images, `before` are the images of the scene before."""


RIGHT = "right"
KINDS = (RIGHT, *BELIEVED, *WRONG)


class Answer(NamedTuple):
    """What the tracker said of a picture."""

    kind: str
    is_sure: bool
    position: np.ndarray
    orientation: np.ndarray


class Judge:
    """Shows right and wrong pictures of a cube to a tracker."""

    def __init__(self, calibration: str) -> None:
        """`calibration` is the text of one."""
        self._right = Tracker(calibration, cube())
        self._believed = {kind: Tracker(calibration, each) for kind, each in BELIEVED.items()}
        self._before: Images | None = None
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "cameras.yml"
            path.write_text(calibration)
            self._cameras = CameraCalibration.read(path).cameras

    def _shows(self, faces: Sequence[int], pose: Matrix) -> bool:
        """Whether a camera sees one of these faces, fingers aside."""
        for normal in AXES[list(faces)] @ pose[:3, :3].T:
            middle = pose[:3, 3] + SIZE / 2 * normal
            for camera in self._cameras:
                view = camera.pose[:3, 3] - middle
                leans = normal @ view / np.linalg.norm(view)
                pixel = camera.project([middle])[0]
                is_inside = (pixel > 0).all() and (pixel < (camera.width, camera.height)).all()
                if leans > np.sin(np.radians(SEEN)) and is_inside:
                    return True
        return False

    def judge(
        self, images: Images, seed: Sequence[int], pose: Matrix | None = None
    ) -> list[Answer]:
        """The answers to these images and all that is made of them; `pose` is that of the cube."""

        def answer(kind: str, tracker: Tracker, shown: Images) -> Answer:
            found = tracker.track([np.ascontiguousarray(each) for each in shown])
            return Answer(kind, found.is_sure, found.position, found.orientation)

        answers = [answer(RIGHT, self._right, images)]
        answers += [
            answer(kind, each, images)
            for kind, each in self._believed.items()
            if pose is None or self._shows(CHANGED.get(kind, range(len(AXES))), pose)
        ]
        for number, (kind, change) in enumerate(WRONG.items()):
            random = np.random.default_rng([*seed, number])
            if self._before is not None or change is not _of_before:
                shown = change(images, self._before or images, random)
                answers.append(answer(kind, self._right, shown))
        self._before = images
        return answers


def counts(answers: Sequence[Answer], kind: str) -> tuple[int, int]:
    """How many pictures of this kind were called sure, and how many there were."""
    own = [each.is_sure for each in answers if each.kind == kind]
    return sum(own), len(own)
