# SPDX-License-Identifier: BSD-3-Clause
"""Images of boards: images of one instant have one name, which says how the board lay.

The files are CAMERA/NAME.png, or NAME/CAMERA.png as `trifinger look --raw -o NAME` saves them.

- `mark...`: at the mark, on the table;
- `table...`: on the table, anywhere;
- `raised_50mm...`: on a block of this height on the table;
- any other name: held or put anywhere.
"""

import dataclasses
import enum
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from trifinger.errors import InvalidArgument
from trifinger.text import natural_order

Pixels = NDArray[np.uint8]
Grey = NDArray[np.uint8]

SUFFIXES = {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm"}
FLAT = ("mark", "table", "raised")  # beginnings of names of images of a board on the table
RAISED = re.compile(r"raised_(\d+(?:\.\d+)?)mm")


class Kind(enum.Enum):
    """How the board lay when images were taken."""

    MARK = "at the mark"
    FLAT = "flat on the table"
    FREE = "anywhere"


@dataclasses.dataclass(frozen=True)
class Placement:
    """One place of the board, seen by one camera or several at once."""

    name: str
    kind: Kind
    height: float = 0.0
    """Height of the block below the board [m]."""

    @property
    def is_flat(self) -> bool:
        """Whether the board is parallel to the table at a known height."""
        return self.kind is not Kind.FREE

    @classmethod
    def of_name(cls, name: str) -> "Placement":
        """The placement that the name of an image stands for."""
        if name.startswith("mark"):
            return cls(name, Kind.MARK)
        if name.startswith("table"):
            return cls(name, Kind.FLAT)
        if name.startswith("raised"):
            height = RAISED.match(name)
            if height is None:
                raise InvalidArgument(
                    f"the image '{name}' must say the height of the block below the board: "
                    "raised_50mm, or raised_50mm_2"
                )
            return cls(name, Kind.FLAT, float(height[1]) / 1e3)
        return cls(name, Kind.FREE)


@dataclasses.dataclass(frozen=True)
class ImageSet:
    """The images of a calibration."""

    paths: dict[str, dict[str, Path]]
    """The file of each image, by camera and name."""

    @property
    def cameras(self) -> list[str]:
        """The names of the cameras."""
        return list(self.paths)

    @property
    def names(self) -> list[str]:
        """The names of the images, in order; a camera need not have all."""
        names = {name for paths in self.paths.values() for name in paths}
        return sorted(names, key=natural_order)

    @classmethod
    def of_folder(cls, folder: Path) -> "ImageSet":
        """The images in FOLDER/CAMERA/NAME.png or FOLDER/NAME/CAMERA.png.

        Raises InvalidArgument if there are none.
        """
        if not folder.is_dir():
            raise InvalidArgument(f"{folder} is no folder")
        files = [path for path in folder.glob("*/*") if path.suffix.lower() in SUFFIXES]
        if not files:
            raise InvalidArgument(
                f"{folder} has no images; there must be a folder for each camera with images in "
                f"it, such as {folder / 'camera60' / 'mark.png'}"
            )
        by_name = any(path.parent.name.startswith(FLAT) for path in files) or all(
            path.stem.startswith("camera") for path in files
        )
        paths: dict[str, dict[str, Path]] = {}
        for path in sorted(files, key=lambda path: natural_order(str(path))):
            pair = (path.stem, path.parent.name)
            camera, name = pair if by_name else pair[::-1]
            other = paths.setdefault(camera, {}).setdefault(name, path)
            if other != path:
                raise InvalidArgument(f"{other} and {path} are two images of one name")
        return cls({name: paths[name] for name in sorted(paths, key=natural_order)})


def read(path: Path) -> Pixels:
    """The pixels of an image as in the file: one channel, or red, green, blue."""
    import cv2

    loaded = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if loaded is None:
        raise InvalidArgument(f"{path} cannot be read: it is damaged or no image")
    pixels = np.asarray(loaded)
    if pixels.dtype == np.uint16:
        pixels = (pixels // 256).astype(np.uint8)
    if pixels.dtype != np.uint8:
        raise InvalidArgument(f"{path} has pixels of {pixels.dtype}, must have 8 or 16 bits")
    if pixels.ndim == 2:
        return np.asarray(pixels, np.uint8)
    if pixels.shape[2] < 3:
        return np.asarray(pixels[:, :, 0], np.uint8)
    return np.asarray(pixels[:, :, 2::-1], np.uint8)


def mosaic_gains(pixels: Pixels) -> NDArray[np.float64]:
    """How bright each of the four lattices of a mosaic (R G / G B) is, relative to the greens.

    A chessboard has no colours, so each lattice sees it times a factor: that of the light and of
    the camera's white balance.
    """
    height, width = (side // 2 * 2 for side in pixels.shape)
    lattices = np.array(
        [pixels[row:height:2, column:width:2] for row in (0, 1) for column in (0, 1)], float
    )
    green = (lattices[1] + lattices[2]) / 2
    # Bright and not saturated; the rest says little about a factor.
    used = (green > np.percentile(green, 50)) & (lattices.max(axis=0) < 250)
    if np.count_nonzero(used) < 100:
        return np.ones(4)
    return np.array([np.median(lattice[used] / np.maximum(green[used], 1)) for lattice in lattices])


def pixels_of(images: list[Pixels]) -> str:
    """The name of the pixel format that images seem to have."""
    if images[0].ndim == 3:
        return "rgb8"
    gains = np.median([mosaic_gains(image) for image in images], axis=0)
    return "bayer_rggb8" if np.max(np.abs(gains - 1)) > 0.03 else "mono8"


def to_grey(pixels: Pixels) -> Grey:
    """The brightness of an image of a black and white board.

    In a mosaic, each lattice is made as bright as the greens. Nothing is interpolated, so edges
    stay where they are, which demosaicing does not promise.
    """
    if pixels.ndim == 3:
        import cv2

        return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY), np.uint8)
    gains = mosaic_gains(pixels)
    if np.max(np.abs(gains - 1)) < 0.01:
        return pixels
    even = pixels.astype(np.float32)
    for lattice, gain in enumerate(gains):
        even[lattice // 2 :: 2, lattice % 2 :: 2] /= max(gain, 0.05)
    return np.clip(np.rint(even), 0, 255).astype(np.uint8)


@dataclasses.dataclass(frozen=True)
class Quality:
    """How good an image, or the part of it that shows the board, is for measuring."""

    white: float
    """Brightness of its bright parts, 0 to 255."""
    contrast: float
    """Difference between bright and dark parts."""
    saturated: float
    """Share of pixels that are as bright as can be."""
    edge_width: float
    """Width of its sharpest edges in the direction in which they are worst [pixel]."""

    DARK = 60.0
    LOW_CONTRAST = 40.0
    BLURRED = 7.0

    @classmethod
    def of(cls, grey: Grey, mask: NDArray[np.bool_] | None = None) -> "Quality":
        """Measures an image, or the part of it in a mask."""
        import cv2

        inside = np.ones(grey.shape, bool) if mask is None else mask
        values = grey[inside]
        black, white = np.percentile(values, (2, 98))
        contrast = float(white - black)
        smooth = cv2.GaussianBlur(grey, (0, 0), 0.8).astype(float)
        slopes = []
        for axis in (0, 1):
            slope = np.abs(np.gradient(smooth, axis=axis))[inside]
            slopes.append(float(np.percentile(slope, 99)))
        # A step that the lens has blurred by s rises by contrast / (s sqrt(2 pi)) per pixel; from
        # 10 % to 90 % it takes 2.56 s.
        blur = contrast / (np.sqrt(2 * np.pi) * max(min(slopes), 1e-3))
        return cls(float(white), contrast, float(np.mean(values >= 254)), 2.56 * blur)

    def problem(self) -> str:
        """What is wrong with the image, as the end of a sentence; empty if nothing is."""
        if self.white < self.DARK:
            return (
                f"is dark: white is {self.white:.0f} of 255; expose longer or add light, until it "
                "is about 200"
            )
        if self.contrast < self.LOW_CONTRAST:
            return f"has little contrast: white is only {self.contrast:.0f} of 255 above black"
        if self.saturated > 0.2:
            return (
                f"is too bright: {self.saturated:.0%} of its pixels are white without detail; "
                "expose less"
            )
        if self.edge_width > self.BLURRED:
            return (
                f"is blurred: edges are {self.edge_width:.0f} pixels wide; let the board lie "
                "still, and focus the lens"
            )
        return ""
