# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger calibrate colours`: learns how the faces of an object look to a robot's cameras."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from trifinger import extras
from trifinger._trifinger import CameraCalibration
from trifinger.arrays import Array
from trifinger.commands.command_line import run
from trifinger.errors import Error, InvalidArgument

HOW_TO = """\
Each folder has one image of each camera, as 'trifinger look ROBOT --raw -o FOLDER' saves them. The
poses are found with the colours that are known already, and only those that are sure are used.
If none is, say where the object lies: --pose 0 0 0.0325 1 0 0 0 for a cube in the middle. Show
each face to the cameras, in the light and with the things around that will be there later.
Example:
  trifinger calibrate colours trifinger-pro --images images/* --to colours.yml
  trifinger track trifinger-pro --colours colours.yml"""


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = argparse.ArgumentParser(
        prog="trifinger calibrate colours",
        description="Learn how the faces of an object look to a robot's cameras.",
        epilog=HOW_TO,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("robot", metavar="ROBOT", help="name of the robot")
    parser.add_argument(
        "--images", type=Path, nargs="+", required=True, metavar="FOLDER", help="folders of images"
    )
    parser.add_argument(
        "--to", type=Path, default=Path("colours.yml"), help="default: colours.yml", metavar="FILE"
    )
    parser.add_argument(
        "--calibration", type=Path, metavar="FILE", help="of the cameras; default: the robot's own"
    )
    parser.add_argument(
        "--config", default="sim", help="a configuration with the object; default: sim"
    )
    parser.add_argument("--object", default="cube", help="its name there; default: cube")
    parser.add_argument("--colours", type=Path, metavar="FILE", help="colours that are known")
    parser.add_argument(
        "--pose",
        type=float,
        nargs=7,
        metavar="NUMBER",
        help="where the object lies in all images: x y z [m], then a quaternion w x y z",
    )
    return parser.parse_args(words)


def read_image(path: Path, pixels: str) -> Array:
    """An image in the format of its camera."""
    extras.require("plot", "PIL")
    from PIL import Image

    if not path.exists():
        raise Error(f"{path} is missing; each folder needs an image of each camera")
    image = np.asarray(Image.open(path))
    if image.ndim != (2 if pixels == "bayer_rggb8" else 3):
        raise InvalidArgument(
            f"{path} is not in the format of its camera, {pixels}; save it with "
            "'trifinger look --raw'"
        )
    return np.ascontiguousarray(image[..., :3] if image.ndim == 3 else image)


def learn(arguments: argparse.Namespace) -> int:
    """Learns from all folders and writes the model."""
    from trifinger.colours import Samples
    from trifinger.tracking import Tracker, tracked_object

    file = arguments.calibration or Path(CameraCalibration.file_of(arguments.robot))
    if not file.exists():
        raise Error(f"{arguments.robot} has no calibration: {file} is not there")
    calibration = CameraCalibration.read(file)
    text = calibration.text()
    tracked = tracked_object(arguments.config, {}, arguments.object)
    known = arguments.colours.read_text() if arguments.colours else None
    tracker = Tracker(text, tracked, known)
    samples = Samples()
    for folder in arguments.images:
        images = [read_image(folder / f"{c.name}.png", c.pixels) for c in calibration.cameras]
        if arguments.pose:
            position, orientation = np.split(np.array(arguments.pose), [3])
        else:
            estimate = tracker.track(images)
            if not estimate.is_sure:
                print(f"{folder}: the pose is not sure; left out")
                continue
            position, orientation = estimate.position, estimate.orientation
        samples.add(images, text, tracked, position, orientation)
    arguments.to.write_text(samples.learn(f"{arguments.robot}."))
    print(f"{arguments.to} written.")
    return 0


def main(words: Sequence[str] | None = None) -> int:
    """The program."""
    return run(lambda: learn(parse(words)))
