# SPDX-License-Identifier: BSD-3-Clause
"""Wrong pictures of a cube, made from right ones: what goes wrong when cameras are set up.

A tracker must not be sure of any of them, however good its pose looks. Those that contradict
nothing are right ones for anybody who sees them: where the truth is known, these are left out.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from contradictions import VISIBLE, contradicting_pixels, painted
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


SIZES: Mapping[str, float] = {"cube of 50 mm believed": 0.05, "cube of 80 mm believed": 0.08}
COLOURS: Mapping[str, Sequence[str]] = {
    "colours of the cube of 2020 believed": (*FACES[:4], "yellow", "magenta"),
    "red and blue faces exchanged": ("blue", "green", "red", *FACES[3:]),
    "opposite faces exchanged": ("magenta", *FACES[1:4], "red", "yellow"),
}
BELIEVED: Mapping[str, TrackedObject] = {
    **{kind: cube(size) for kind, size in SIZES.items()},
    **{kind: cube(colours=colours) for kind, colours in COLOURS.items()},
}
"""What the tracker takes the cube for, if the images are right."""


def _moved(image: np.ndarray, rows: int, columns: int) -> np.ndarray:
    return np.roll(image, (rows, columns), axis=(0, 1))


def _mirrored(image: np.ndarray, axis: int) -> np.ndarray:
    mirror = np.flip(image, axis)
    if image.ndim == 3:
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
    shows_it: bool
    """Whether the picture shows what is wrong with it."""


class Judge:
    """Shows right and wrong pictures of a cube to a tracker."""

    def __init__(self, calibration: str) -> None:
        """`calibration` is the text of one."""
        self._right = Tracker(calibration, cube())
        self._believed = {kind: Tracker(calibration, each) for kind, each in BELIEVED.items()}
        self._before: tuple[Images, Images] | None = None

    def judge(
        self, images: Images, seed: Sequence[int], faces: Sequence[np.ndarray] | None = None
    ) -> list[Answer]:
        """The answers to these images and all that is made of them.

        `faces` has for each pixel the number of the face that it shows, or -1. Without it, all
        pictures are said to show what is wrong.
        """
        drawn = [] if faces is None else painted(faces, FACES)

        def answer(kind: str, tracker: Tracker, shown: Images, drawn: Images) -> Answer:
            found = tracker.track([np.ascontiguousarray(each) for each in shown])
            shows_it = (
                faces is None
                or kind in (RIGHT, *SIZES)
                or contradicting_pixels(drawn, faces, COLOURS.get(kind, FACES)) >= VISIBLE
            )
            return Answer(kind, found.is_sure, shows_it)

        answers = [answer(RIGHT, self._right, images, drawn)]
        answers += [answer(kind, each, images, drawn) for kind, each in self._believed.items()]
        before, drawn_before = self._before or (images, drawn)
        for number, (kind, change) in enumerate(WRONG.items()):
            if self._before is None and change is _of_before:
                continue
            shown = change(images, before, np.random.default_rng([*seed, number]))
            again = np.random.default_rng([*seed, number])
            shown_drawn = change(drawn, drawn_before, again) if drawn else drawn
            answers.append(answer(kind, self._right, shown, shown_drawn))
        self._before = images, drawn
        return answers


def counts(answers: Sequence[Answer], kind: str) -> tuple[int, int, int]:
    """How many pictures of this kind were called sure, how many there were, and were left out."""
    own = [each for each in answers if each.kind == kind]
    counted = [each.is_sure for each in own if each.shows_it]
    return sum(counted), len(counted), len(own) - len(counted)
