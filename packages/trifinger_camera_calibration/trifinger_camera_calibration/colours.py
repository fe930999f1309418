# SPDX-License-Identifier: BSD-3-Clause
"""Learns how the colours of an object look in images: the model that a tracker tells them apart by.

A colour is a sum of normal distributions of three features: the log of red over green, the log of
blue over green, and the log of the mean (include/trifinger/tracking/colour_model.hpp).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from trifinger.arrays import Array
from trifinger.errors import InvalidArgument
from trifinger.tracking import TrackedObject, balanced_blocks, faces_in_blocks

BACKGROUND = "background"
DARK = 6.0  # levels; keeps the noise of dark pixels from looking like a colour
BELLS = {BACKGROUND: 14}  # normal distributions of a colour; others have
FEW_BELLS = 4
MAX_PER_IMAGE = 150  # pixels of a face
MAX_BACKGROUND = 600
MAX_LABELLED = 1500  # pixels of a colour in an image that was labelled by hand
MOST = 30_000  # pixels of a colour that are used
LEAST = 200  # pixels that a colour needs
SMALLEST_VARIANCE = 2e-3
FOREIGN = 3.5  # features this many deviations off belong to something in front of a face
HEADER = """\
# SPDX-License-Identifier: BSD-3-Clause
#
# How surfaces look to cameras: normal distributions of the log of red over green, the log of blue
# over green and the log of the mean. Covariances are xx, xy, xz, yy, yz, zz. {origin}
colours:
"""


class Samples:
    """Pixels of known colours."""

    def __init__(self, seed: int = 0) -> None:
        """Of too many pixels, some are drawn at random: equal seeds draw the same."""
        self._random = np.random.default_rng(seed)
        self._pixels: dict[str, list[Array]] = {}

    def add(
        self,
        images: Sequence[Array],
        calibration: str,
        tracked: TrackedObject,
        position: Array,
        orientation: Array,
    ) -> None:
        """Adds images that show the object at a known pose, with little in front of it."""
        contents = faces_in_blocks(calibration, tracked, position, orientation)
        for image, content in zip(images, contents, strict=True):
            pixels, faces = balanced_blocks(image), np.asarray(content)
            for face, colour in enumerate(tracked.colours):
                self._add(colour, self._own(pixels[faces == face]), MAX_PER_IMAGE)
            self._add_background(pixels[faces == -1])

    def add_labelled(self, image: Array, masks: Mapping[str, Array]) -> None:
        """Adds an image in which somebody marked the pixels of each colour, or of the background.

        A mask is true where its colour is, for each pixel of the image.
        """
        pixels = np.asarray(balanced_blocks(image))
        for name, mask in masks.items():
            height, width = (size // 2 for size in mask.shape)
            whole = mask[: 2 * height, : 2 * width].reshape(height, 2, width, 2).all(axis=(1, 3))
            marked = pixels[whole.ravel()]
            if name == BACKGROUND:
                self._add_background(marked)
            else:
                self._add(name, self._own(marked), MAX_LABELLED)

    def learn(self, origin: str, *, is_varied: bool = True) -> str:
        """The model as the text of a file. Varied: other light and cameras are expected, too.

        Raises InvalidArgument if a colour has too few pixels.
        """
        model = HEADER.format(origin=origin)
        for name in sorted(self._pixels, key=lambda name: name == BACKGROUND):
            pixels = self._drawn(np.concatenate(self._pixels[name]), MOST)
            if len(pixels) < LEAST:
                raise InvalidArgument(
                    f"{name} has {len(pixels)} pixels, must have {LEAST}: give more images"
                )
            if is_varied:
                pixels = np.concatenate([pixels, self._varied(pixels)])
            bells = fit(features(pixels), BELLS.get(name, FEW_BELLS), self._random)
            model += f"  - name: {name}\n    bells:\n" + "".join(map(_line, *bells))
        return model

    def _own(self, pixels: Array) -> Array:
        """Leaves out what stands in front of a face: pixels unlike most others."""
        if len(pixels) < 30:
            return pixels[:0]
        chroma = features(pixels)[:, :2]
        middle = np.median(chroma, axis=0)
        spread = 1.5 * np.median(np.abs(chroma - middle), axis=0) + 0.03
        return np.asarray(pixels[(np.abs(chroma - middle) < FOREIGN * spread).all(axis=1)])

    def _add(self, name: str, pixels: Array, most: int) -> None:
        if len(pixels):
            self._pixels.setdefault(name, []).append(self._drawn(pixels, most))

    def _add_background(self, pixels: Array) -> None:
        if not len(pixels):
            return
        # Colourful things count more: they are what colours are mixed up with.
        largest, smallest = pixels.max(axis=1), pixels.min(axis=1)
        weights = 0.05 + ((largest - smallest) / (largest + 1)) ** 2
        count = min(MAX_BACKGROUND, len(pixels))
        drawn = self._random.choice(len(pixels), count, False, weights / weights.sum())
        self._add(BACKGROUND, pixels[drawn], count)

    def _drawn(self, pixels: Array, most: int) -> Array:
        if len(pixels) <= most:
            return pixels
        return np.asarray(pixels[self._random.choice(len(pixels), most, False)])

    def _varied(self, pixels: Array) -> Array:
        """The pixels with another white balance, exposure, contrast and noise."""
        random, count = self._random, len(pixels)
        light = np.exp(random.normal(scale=0.05, size=(count, 3)))
        exposure = 2 ** random.uniform(-1, 0.5, (count, 1))
        contrast = random.uniform(0.9, 1.25, (count, 1))
        levels = 255 * (np.clip(pixels * light * exposure, 0, 255) / 255) ** contrast
        return np.asarray(np.clip(levels + random.normal(scale=1.5, size=levels.shape), 0, 255))


def features(pixels: Array) -> Array:
    """Features of rows of red, green and blue, 0 to 255."""
    green = np.log(pixels[:, 1] + DARK)
    red, blue = np.log(pixels[:, 0] + DARK), np.log(pixels[:, 2] + DARK)
    return np.stack([red - green, blue - green, np.log(pixels.mean(axis=1) + DARK)], axis=1)


def fit(
    points: Array, bells: int, random: np.random.Generator, steps: int = 60
) -> tuple[Array, Array, Array]:
    """Weights, means and covariances of a sum of normal distributions: expectation maximisation."""
    means = points[random.choice(len(points), bells, False)]
    covariances = np.repeat(np.cov(points.T)[None], bells, axis=0)
    weights = np.full(bells, 1 / bells)
    for _ in range(steps):
        away = points[:, None] - means
        distances = np.einsum("nki,kij,nkj->nk", away, np.linalg.inv(covariances), away)
        logs = np.log(weights) - 0.5 * (np.linalg.slogdet(covariances)[1] + distances)
        shares = np.exp(logs - logs.max(axis=1, keepdims=True))
        shares /= shares.sum(axis=1, keepdims=True)
        counts = shares.sum(axis=0) + 1e-9
        weights = counts / counts.sum()
        means = shares.T @ points / counts[:, None]
        away = points[:, None] - means
        covariances = np.einsum("nk,nki,nkj->kij", shares, away, away) / counts[:, None, None]
        covariances += SMALLEST_VARIANCE * np.eye(3)
    return weights, means, covariances


def _line(weight: float, mean: Array, covariance: Array) -> str:
    if weight < 5e-4:
        return ""
    middle = ", ".join(f"{number:.4f}" for number in mean)
    spread = ", ".join(f"{number:.4f}" for number in covariance[np.triu_indices(3)])
    return f"      - {{weight: {weight:.4f}, mean: [{middle}], covariance: [{spread}]}}\n"
