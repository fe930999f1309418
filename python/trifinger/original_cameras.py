# SPDX-License-Identifier: BSD-3-Clause
"""Calibration files of the original stack: three for each camera.

They are of the whole image of the sensor (`_full`, 720 x 540), of its part that is used
(`_cropped`, 540 x 540) and of this part at half the size (`_cropped_and_downsampled`). The
original halves a principal point c to c / 2. Pixel centres are at whole numbers, so an image of
half the size has it at (c + 0.5) / 2 - 0.5, which is 0.25 pixels less. Files keep the original's
meaning, when read and when written.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trifinger import foreign_yaml
from trifinger._trifinger import Camera, CameraCalibration, Lens
from trifinger.errors import InvalidArgument
from trifinger.poses import Matrix, inverse, nearest_rotation
from trifinger.text import natural_order
from trifinger.whole_file import whole_file

FULL, CROPPED = (720, 540), (540, 540)
LEFT = 88  # columns of the sensor before the part that is used
HALF = (CROPPED[0] // 2, CROPPED[1] // 2)
Pixels = NDArray[np.uint8]
SUFFIXES = {"_full": FULL, "_cropped": CROPPED, "_cropped_and_downsampled": HALF}


def text_of(camera: Camera, suffix: str) -> str:
    """One of the three files of a camera; its images must be those of the original."""
    lens = lens_for(camera, suffix)
    (fx, fy), (cx, cy) = lens.focal_length, lens.principal_point
    from_world = inverse(camera.pose)
    width, height = SUFFIXES[suffix]

    def matrix(name: str, numbers: Matrix) -> str:
        rows, columns = numbers.shape
        data = ", ".join(repr(float(number)) for number in numbers.ravel())
        return f"{name}:\n  rows: {rows}\n  cols: {columns}\n  data: [{data}]\n"

    # OpenCV wants the first line, PyYAML and yaml-cpp take it.
    text = f'%YAML 1.0\n---\ncamera_name: "{camera.name}"\n'
    text += f"image_width: {width}\nimage_height: {height}\n"
    text += matrix("camera_matrix", np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]))
    text += matrix("distortion_coefficients", lens.distortion[None])
    text += matrix("tf_world_to_camera", from_world)
    return text + matrix("tf_world_to_camera_std", np.zeros((4, 4)))


def lens_for(camera: Camera, suffix: str) -> Lens:
    """The lens as a file of the original has it."""
    match (camera.width, camera.height):
        case size if size == CROPPED:
            cropped = camera.lens
        case size if size == FULL:
            cropped = camera.lens.cropped(LEFT, 0)
        case width, height:
            raise InvalidArgument(
                f"{camera.name} has images of {width} x {height} pixels; the original stack knows "
                "540 x 540 and 720 x 540 only"
            )
    if suffix == "_cropped":
        return cropped
    if suffix == "_full":
        return cropped.cropped(-LEFT, 0)
    return Lens(cropped.focal_length / 2, cropped.principal_point / 2, cropped.distortion)


def write(calibration: CameraCalibration, folder: Path) -> list[Path]:
    """Writes the files of all cameras to a folder and returns their paths."""
    texts = {
        folder / f"{camera.name}{suffix}.yml": text_of(camera, suffix)
        for camera in calibration.cameras
        for suffix in SUFFIXES
    }
    folder.mkdir(parents=True, exist_ok=True)
    for path, text in texts.items():
        with whole_file(path) as part:
            part.write_text(text)
    return list(texts)


def read(paths: Sequence[Path]) -> CameraCalibration:
    """The cameras of files of the original stack, with images of 540 x 540 pixels.

    Files of one camera must agree. Raises InvalidArgument if they do not or make no sense.
    """
    cameras: dict[str, tuple[Path, Camera]] = {}
    for path in paths:
        camera = read_camera(path)
        first, known = cameras.setdefault(camera.name, (path, camera))
        mine = (*camera.lens.focal_length, *camera.lens.principal_point, *camera.pose.ravel())
        other = (*known.lens.focal_length, *known.lens.principal_point, *known.pose.ravel())
        if not np.allclose(mine, other, atol=0.01):
            raise InvalidArgument(f"{first} and {path} are of {camera.name}, but do not agree")
    names = sorted(cameras, key=natural_order)
    return CameraCalibration([cameras[name][1] for name in names])


def for_images(camera: Camera, image: Pixels) -> Camera:
    """A camera that `read` returns, with images like this one.

    The original delivers the whole image of the sensor, its part that is used, or this part at
    half the size, as mosaics; its programs save them in colours, too. Raises InvalidArgument at
    images of another size.
    """
    height, width = image.shape[:2]
    pixels = "rgb8" if image.ndim == 3 else "bayer_rggb8"
    if (width, height) == FULL:
        lens = camera.lens.cropped(-LEFT, 0)
    elif (width, height) == CROPPED:
        lens = camera.lens
    elif (width, height) == HALF:
        lens = camera.reduced(2).lens
    else:
        raise InvalidArgument(
            f"{camera.name} has images of {width} x {height} pixels, must be 720 x 540, 540 x 540 "
            "or 270 x 270"
        )
    return Camera(camera.name, width, height, pixels, lens, camera.pose)


def read_camera(path: Path) -> Camera:
    """The camera of a file of the original stack, with images of 540 x 540 pixels."""
    try:
        content = foreign_yaml.parse(path.read_text())
    except (UnicodeDecodeError, InvalidArgument) as error:
        raise InvalidArgument(f"{path} is no file of a camera: {error}") from error

    def value(name: str) -> Any:
        if name not in content:
            raise InvalidArgument(f"{path} has no '{name}'")
        return content[name]

    def matrix(name: str, *shapes: tuple[int, int]) -> Matrix:
        try:
            numbers = foreign_yaml.matrix(value(name))
        except InvalidArgument as error:
            raise InvalidArgument(f"{path}: '{name}': {error}") from error
        if numbers.shape not in shapes or not np.isfinite(numbers).all():
            raise InvalidArgument(
                f"{path}: '{name}' must be {shapes[0][0]} x {shapes[0][1]} numbers"
            )
        return numbers

    size = value("image_width"), value("image_height")
    name = re.sub(r"_(full|cropped|cropped_and_downsampled)$", "", str(value("camera_name")))
    intrinsics = matrix("camera_matrix", (3, 3))
    focal, centre = intrinsics[[0, 1], [0, 1]], intrinsics[:2, 2]
    distortion = matrix("distortion_coefficients", (1, 5), (5, 1)).ravel()
    if size == FULL:
        lens = Lens(focal, centre - (LEFT, 0), distortion)
    elif size == CROPPED:
        lens = Lens(focal, centre, distortion)
    elif size == HALF:
        lens = Lens(2 * focal, 2 * centre, distortion)
    else:
        raise InvalidArgument(
            f"{path} is of images of {size[0]} x {size[1]} pixels, must be 720 x 540, 540 x 540 "
            "or 270 x 270"
        )
    if not focal.min() > 0:
        raise InvalidArgument(f"{path}: 'camera_matrix' has focal lengths that are not above zero")
    from_world = matrix("tf_world_to_camera", (4, 4))
    # The mean of rotation matrices is one to about 1e-5 only.
    turn = nearest_rotation(from_world[:3, :3])
    if np.abs(turn - from_world[:3, :3]).max() > 0.01:
        raise InvalidArgument(f"{path}: 'tf_world_to_camera' is no rotation and translation")
    from_world[:3, :3], from_world[3] = turn, (0, 0, 0, 1)
    return Camera(name, *CROPPED, "bayer_rggb8", lens, inverse(from_world))
