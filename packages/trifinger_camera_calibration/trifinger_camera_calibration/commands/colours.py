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
from trifinger.commands.command_line import ArgumentParser, add_output, run, say
from trifinger.errors import Error, InvalidArgument
from trifinger.whole_file import whole_file

HOW_TO = """\
Each folder has one image of each camera, as 'trifinger look ROBOT --raw -o FOLDER' saves them. The
poses are found with the colours that are known already, and only those that are sure are used.
If none is, say where the object lies, --pose 0 0 0.0325 1 0 0 0 for a cube in the middle, or which
pixels show which face. Then no pose is needed, and five images are enough:
  --page faces.html writes a page for any browser, in which one clicks around the faces and saves
    labels.json. Pass that with --labels.
  A mask camera60.labels.png beside camera60.png is read, too: red, green, blue, cyan, magenta and
    yellow where these faces are, white for the background, black where nobody says what is there;
    or the numbers 1, 2... of the faces' colours, 255 for the background, 0 for nothing.
Show each face to the cameras, in the light and with the things around that will be there later.
Example:
  trifinger calibrate colours trifinger-pro --images images/* -o colours.yml
  trifinger calibrate colours trifinger-pro --images images/* --page faces.html
  trifinger calibrate colours trifinger-pro --images images/* --labels labels.json
  trifinger track trifinger-pro --colours colours.yml"""


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(
        prog="trifinger calibrate colours",
        description="Learn how the faces of an object look to a robot's cameras.",
        epilog=HOW_TO,
    )
    parser.add_argument("robot", metavar="ROBOT", help="name of the robot")
    parser.add_argument(
        "--images", type=Path, nargs="+", required=True, metavar="FOLDER", help="folders of images"
    )
    add_output(parser, "the colours; default: colours.yml", default=Path("colours.yml"))
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
    parser.add_argument(
        "--page", type=Path, metavar="FILE", help="write a page to label the images; learn nothing"
    )
    parser.add_argument(
        "--labels", type=Path, metavar="FILE", help="what was saved in that page: labels.json"
    )
    return parser.parse_args(words)


def read_image(path: Path, pixels: str) -> Array:
    """An image in the format of its camera."""
    extras.require("plot", "PIL")
    from PIL import Image

    if not path.exists():
        raise Error(f"{path} is missing; each folder needs an image of each camera")
    image = np.asarray(Image.open(path))
    if pixels == "bayer_rggb8" and image.ndim == 3:
        # Colours of a mosaic, as the original's programs save them; the tracker takes mosaics.
        raw = image[:, :, 1].copy()
        raw[::2, ::2], raw[1::2, 1::2] = image[::2, ::2, 0], image[1::2, 1::2, 2]
        return raw
    if image.ndim != (2 if pixels == "bayer_rggb8" else 3):
        raise InvalidArgument(
            f"{path} is not in the format of its camera, {pixels}; save it with "
            "'trifinger look --raw'"
        )
    return np.ascontiguousarray(image[..., :3] if image.ndim == 3 else image)


def labelled(
    arguments: argparse.Namespace, calibration: CameraCalibration, colours: Sequence[str]
) -> dict[Path, dict[str, Array]]:
    """The masks of all images that have labels."""
    from trifinger_camera_calibration.colour_labels import (
        mask_of,
        masks_of,
        read_mask,
        read_outlines,
    )

    outlines = read_outlines(arguments.labels) if arguments.labels else {}
    found = {}
    for folder in arguments.images:
        for camera in calibration.cameras:
            path, shape = folder / f"{camera.name}.png", (camera.height, camera.width)
            labels = outlines.pop(str(path), None)
            if labels is not None:
                found[path] = masks_of(labels, shape)
            elif mask_of(path).exists():
                found[path] = read_mask(mask_of(path), colours, shape)
    if outlines:
        raise InvalidArgument(
            f"{arguments.labels} labels {next(iter(outlines))}, which is not among the images of "
            "--images; name the same folders as for --page"
        )
    return found


def label(arguments: argparse.Namespace) -> int:
    """Writes the page in which one labels the images."""
    from trifinger.tracking import tracked_object

    from trifinger_camera_calibration.colour_labels import write_page

    calibration = CameraCalibration.read(calibration_file(arguments))
    tracked = tracked_object(arguments.config, {}, arguments.object)
    images = {
        str(path): read_image(path, camera.pixels)
        for folder in arguments.images
        for camera in calibration.cameras
        if (path := folder / f"{camera.name}.png").exists()
    }
    if not images:
        raise Error(f"{arguments.images[0]} has no image of a camera of {arguments.robot}")
    write_page(arguments.page, images, tracked.colours, "labels.json")
    say(f"{arguments.page} written: open it in a browser.")
    return 0


def calibration_file(arguments: argparse.Namespace) -> Path:
    """The file of the cameras' calibration."""
    file = arguments.calibration or Path(CameraCalibration.file_of(arguments.robot))
    if not file.exists():
        raise Error(f"{arguments.robot} has no calibration: {file} is not there")
    return Path(file)


def learn(arguments: argparse.Namespace) -> int:
    """Learns from all folders and writes the model."""
    from trifinger.tracking import Tracker, tracked_object

    from trifinger_camera_calibration.colours import Samples

    calibration = CameraCalibration.read(calibration_file(arguments))
    text = calibration.text()
    tracked = tracked_object(arguments.config, {}, arguments.object)
    known = arguments.colours.read_text() if arguments.colours else None
    tracker = Tracker(text, tracked, known)
    samples = Samples()
    masks = labelled(arguments, calibration, list(dict.fromkeys(tracked.colours)))
    for path, each in masks.items():
        pixels = next(c.pixels for c in calibration.cameras if c.name == path.stem)
        samples.add_labelled(read_image(path, pixels), each)
    for folder in arguments.images:
        if any(path.parent == folder for path in masks):
            continue
        images = [read_image(folder / f"{c.name}.png", c.pixels) for c in calibration.cameras]
        if arguments.pose:
            position, orientation = np.split(np.array(arguments.pose), [3])
        else:
            estimate = tracker.track(images)
            if not estimate.is_sure:
                say(f"{folder}: the pose is not sure, and nothing is labelled; left out")
                continue
            position, orientation = estimate.position, estimate.orientation
        samples.add(images, text, tracked, position, orientation)
    model = samples.learn(f"{arguments.robot}.")
    with whole_file(arguments.output) as part:
        part.write_text(model)
    say(f"{arguments.output} written.")
    return 0


def main(words: Sequence[str] | None = None) -> int:
    """The program."""
    arguments = parse(words)
    return run(lambda: label(arguments) if arguments.page else learn(arguments))
