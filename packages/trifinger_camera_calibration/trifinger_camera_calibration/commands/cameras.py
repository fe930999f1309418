# SPDX-License-Identifier: BSD-3-Clause
"""`trifinger calibrate cameras`.

Optional packages are imported only when the command runs, so a missing one is a one-line error.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from trifinger import extras
from trifinger._trifinger import CameraCalibration
from trifinger.commands.command_line import ArgumentParser, add_json, run, say, say_json
from trifinger.errors import Error, InvalidArgument
from trifinger.whole_file import whole_file

if TYPE_CHECKING:
    from trifinger_camera_calibration import Board

HOW_TO = """\
Take images of the board with all cameras at once, such as by 'trifinger look ROBOT --raw -o
FOLDER/NAME'. The files are FOLDER/NAME/CAMERA.png or FOLDER/CAMERA/NAME.png. The NAME says how
the board lay:
  mark...           flat at the mark: its middle at the origin, its x axis along that of the world
  table...          flat on the table, anywhere
  raised_50mm...    flat on a block of this height; tells the size of the squares
  any other name    held or put anywhere, tilted, in all parts of the images
One mark, three on the table, one raised and 15 others make a good calibration.
Example:
  trifinger calibrate cameras --print-board board.pdf
  trifinger calibrate cameras trifinger-pro --images images
  trifinger calibrate cameras trifinger-pro --check --images this_morning
  trifinger calibrate cameras trifinger-pro --images images --board original --turntable
  trifinger calibrate cameras trifinger-pro --from-original camera*_full.yml
  trifinger calibrate cameras trifinger-pro --from-original camera*_full.yml --images images"""


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    """The arguments of the command line."""
    parser = ArgumentParser(
        prog="trifinger calibrate cameras",
        description="Find out where the cameras of a robot are, and their lenses, from images of a "
        "board.",
        epilog=HOW_TO,
    )
    parser.add_argument("robot", nargs="?", metavar="ROBOT", help="name of the robot")
    parser.add_argument(
        "--images",
        type=Path,
        metavar="FOLDER",
        help="images of the board; with --from-original: any that the cameras took, which tell "
        "their size and whether they are mosaics",
    )
    parser.add_argument(
        "--file",
        type=Path,
        help="file of the calibration; default: ROBOT.cameras.yml in the folder of calibrations, "
        "where the robot's programs find it",
    )
    parser.add_argument(
        "--page", type=Path, metavar="FILE", help="page of the result; default: ROBOT.cameras.html"
    )
    parser.add_argument(
        "--force", action="store_true", help="write the calibration even if something is wrong"
    )
    add_other_jobs(parser)
    add_board_options(parser)
    add_image_options(parser)
    arguments = parser.parse_args(words)
    if arguments.print_board is None and arguments.robot is None:
        parser.error("ROBOT is needed: the name of a robot, which names its calibration")
    needs_images = not (arguments.print_board or arguments.from_original or arguments.to_original)
    if arguments.json and not arguments.check:
        parser.error("--json is for --check")
    if needs_images and arguments.images is None:
        parser.error("--images is needed: a folder with a folder of images for each camera")
    return arguments


def add_other_jobs(parser: argparse.ArgumentParser) -> None:
    """Adds the options that ask for something else than a calibration."""
    other = parser.add_argument_group("instead of a calibration").add_mutually_exclusive_group()
    other.add_argument(
        "--check", action="store_true", help="check the present calibration with --images"
    )
    add_json(parser)
    other.add_argument(
        "--from-original",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="make the calibration of files of the original stack",
    )
    other.add_argument(
        "--to-original",
        type=Path,
        metavar="FOLDER",
        help="write the calibration as files of the original stack, three for each camera",
    )
    other.add_argument(
        "--print-board", type=Path, metavar="FILE", help="draw the board: .pdf or .svg"
    )


def add_image_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options that say what the images show."""
    images = parser.add_argument_group("images")
    images.add_argument(
        "--pixels",
        choices=("mono8", "bayer_rggb8", "rgb8"),
        help="what the cameras deliver; default: what the images look like",
    )
    images.add_argument(
        "--lenses", type=Path, metavar="FILE", help="take the lenses from this calibration"
    )
    images.add_argument(
        "--turntable",
        action="store_true",
        help="the board turns on the original stack's turntable, whose axis is that of the world; "
        "the number at the end of an image's name counts the steps",
    )
    images.add_argument(
        "--step", type=float, default=10.0, metavar="DEGREES", help="of the turntable; default: 10"
    )
    images.add_argument(
        "--zero",
        type=float,
        default=0.0,
        metavar="DEGREES",
        help="direction of the board's x axis in the first image on the turntable; default: 0",
    )


def add_board_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options that say what the board looks like; `board_of` reads them."""
    board = parser.add_argument_group("the board")
    board.add_argument(
        "--board",
        default="a4",
        choices=("a4", "original"),
        help="a4: 8 x 5 squares of 35 mm; original: that of the original stack; default: a4. The "
        "options below change single properties",
    )
    board.add_argument("--squares", metavar="NxM", help="squares along x and y")
    board.add_argument("--square", type=float, metavar="METRES", help="side of a square")
    board.add_argument("--marker", type=float, metavar="METRES", help="side of a marker")
    board.add_argument("--dictionary", help="of the markers, such as 4x4_50 or apriltag_16h5")
    board.add_argument(
        "--first-id",
        type=int,
        metavar="NUMBER",
        help="number of the first marker in its dictionary; the others follow; default: 0",
    )
    board.add_argument(
        "--legacy",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="boards of even rows begin with white, as before OpenCV 4.6",
    )
    board.add_argument(
        "--thickness", type=float, metavar="METRES", help="height of the pattern above the table"
    )


def board_of(arguments: argparse.Namespace) -> Board:
    """The board that the options of `add_board_options` describe; raises InvalidArgument."""
    from trifinger_camera_calibration import PRESETS

    names = ("square", "marker", "dictionary", "first_id", "legacy", "thickness")
    given = {name: getattr(arguments, name) for name in names}
    changes = {name: value for name, value in given.items() if value is not None}
    if arguments.squares is not None:
        sides = re.fullmatch(r"(\d+)x(\d+)", arguments.squares)
        if sides is None:
            raise InvalidArgument(f"--squares is '{arguments.squares}', must be like 8x5")
        changes.update(columns=int(sides[1]), rows=int(sides[2]))
    return dataclasses.replace(PRESETS[arguments.board], **changes)


def file_of(arguments: argparse.Namespace) -> Path:
    """The file of the robot's calibration; raises InvalidArgument if the name is none."""
    robot: str = arguments.robot
    if not re.fullmatch(r"[\w.-]+", robot) or robot.endswith((".yml", ".yaml")):
        raise InvalidArgument(
            f"'{robot}' is no name of a robot; it is what stands as 'name' in its configuration, "
            "such as trifinger-pro"
        )
    if arguments.file is not None:
        return Path(arguments.file)
    return Path(CameraCalibration.file_of(robot))


def present(arguments: argparse.Namespace) -> CameraCalibration:
    """The present calibration of the robot; raises Error if there is none."""
    file = file_of(arguments)
    if not file.exists():
        raise Error(f"{arguments.robot} has no calibration: {file} is not there")
    return CameraCalibration.read(file)


def write(calibration: CameraCalibration, path: Path) -> None:
    """Writes a calibration to a file at once; what was there before is kept beside it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.exists():
        before = path.with_name(path.name + ".before")
        path.replace(before)
        say(f"the calibration before is now in {before}.")
    with whole_file(path) as part:
        part.write_text(calibration.text())
    say(f"{path} written.")


def with_images(calibration: CameraCalibration, folder: Path) -> CameraCalibration:
    """The calibration of the original for images as they are in a folder."""
    from trifinger import original_cameras as original

    from trifinger_camera_calibration import ImageSet
    from trifinger_camera_calibration.images import read

    paths = ImageSet.of_folder(folder).paths
    cameras = []
    for camera in calibration.cameras:
        if camera.name not in paths:
            raise InvalidArgument(f"{folder} has no images of {camera.name}")
        changed = [original.for_images(camera, read(path)) for path in paths[camera.name].values()]
        if len({(each.width, each.pixels) for each in changed}) > 1:
            raise InvalidArgument(f"the images of {camera.name} in {folder} differ in size or kind")
        cameras.append(changed[0])
    return CameraCalibration(cameras)


def calibrate(arguments: argparse.Namespace) -> int:
    """Calibrates from images, and writes the page and the file."""
    from trifinger_camera_calibration import ImageSet, Options, calibrate
    from trifinger_camera_calibration.page import as_sentence, page

    file = file_of(arguments)
    options = Options(
        pixels=arguments.pixels,
        lenses=CameraCalibration.read(arguments.lenses) if arguments.lenses else None,
        expected=CameraCalibration.read(file) if file.exists() else None,
        turntable=arguments.turntable,
        step=math.radians(arguments.step),
        zero=math.radians(arguments.zero),
    )
    images = ImageSet.of_folder(arguments.images)
    result = calibrate(
        images, board_of(arguments), options, lambda text: say(f"{text} ...", flush=True)
    )
    path = arguments.page or Path(f"{arguments.robot}.cameras.html")
    with whole_file(path) as part:
        part.write_text(page(result, arguments.robot))
    for text in [*result.remarks, *result.advice]:
        say(f"- {as_sentence(text)}")
    say(f"corners miss by {result.rms:.3f} pixels (root mean square).")
    say(f"{path} written: look at it.")
    for text in result.problems:
        say(f"WRONG: {as_sentence(text)}")
    if result.problems and not arguments.force:
        say(f"{file} was not written; --force writes it.")
        return 1
    write(result.calibration, file)
    return 0


def check(arguments: argparse.Namespace) -> int:
    """Checks the present calibration with new images."""
    from trifinger_camera_calibration import ImageSet
    from trifinger_camera_calibration.check import check
    from trifinger_camera_calibration.page import as_sentence

    calibration = present(arguments)
    found = check(ImageSet.of_folder(arguments.images), board_of(arguments), calibration)
    if arguments.json:
        say_json(
            {
                "is_good": not found.problems,
                "images": found.images,
                "residuals": found.residuals,
                "problems": found.problems,
            }
        )
        return 1 if found.problems else 0
    for text in found.lines():
        say(as_sentence(text))
    for text in found.problems:
        say(f"WRONG: {as_sentence(text)}")
    if not found.problems:
        say("the calibration holds.")
    return 1 if found.problems else 0


def work(arguments: argparse.Namespace) -> int:
    """Does what the arguments ask for."""
    extras.require("trifinger-camera-calibration[opencv]", "cv2", "yaml")
    from trifinger import original_cameras as original

    from trifinger_camera_calibration.drawing import draw

    if arguments.print_board is not None:
        board = board_of(arguments)
        draw(board, arguments.print_board)
        say(f"{arguments.print_board} written: {board}. Print it at 100 %, on a flat plate.")
        return 0
    if arguments.check:
        return check(arguments)
    if arguments.from_original is not None:
        calibration = original.read(arguments.from_original)
        if arguments.images is not None:
            calibration = with_images(calibration, arguments.images)
        write(calibration, file_of(arguments))
        return 0
    if arguments.to_original is not None:
        for path in original.write(present(arguments), arguments.to_original):
            say(f"{path} written.")
        say(
            "Files of half the size have the original's principal point, c / 2; our images of half "
            "the size have (c + 0.5) / 2 - 0.5."
        )
        return 0
    return calibrate(arguments)


def main(words: Sequence[str] | None = None) -> int:
    """`trifinger calibrate cameras`."""
    arguments = parse(words)
    return run(lambda: work(arguments))
