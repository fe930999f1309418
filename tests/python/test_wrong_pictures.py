# SPDX-License-Identifier: BSD-3-Clause
"""Which faulty pictures of a cube show that they are faulty, and what is known of scenes."""

import colorsys
from pathlib import Path

import numpy as np
import pytest
import trifinger
from contradictions import PAINTS, VISIBLE, contradicting_pixels, looks_like, painted
from tracking_scenes import Scenes, cameras_of, config_of
from wrong_pictures import COLOURS, FACES, RIGHT, WRONG, Judge, counts

MIRRORED = COLOURS["opposite faces exchanged"]
SQUARE = 20  # pixels of a face


def image_of(*colours: str, square: int = SQUARE) -> np.ndarray:
    """The numbers of faces in an image that shows squares of these colours."""
    faces = np.full((40, 200), -1, np.int8)
    for i, colour in enumerate(colours):
        faces[10 : 10 + square, 10 + 40 * i : 10 + 40 * i + square] = FACES.index(colour)
    return faces


def against(faces: list[np.ndarray], believed: tuple[str, ...] = FACES) -> int:
    return contradicting_pixels(painted(faces, FACES), faces, believed)


def after(change: str, *images: np.ndarray, seed: int = 0) -> int:
    drawn = painted(images, FACES)
    shown = WRONG[change](drawn, drawn, np.random.default_rng(seed))
    return contradicting_pixels(shown, images, FACES)


def test_a_right_picture_contradicts_nothing() -> None:
    assert against([image_of("red", "green", "blue"), image_of("magenta", "yellow")]) == 0


@pytest.mark.parametrize(
    ("seen", "is_visible"),
    [
        (("red", "green", "blue"), True),
        (("red", "magenta", "green", "yellow"), False),  # upside down
        (("red", "green"), False),  # the mirror image looks like this from another side
        (("green", "blue", "yellow"), False),
    ],
)
def test_a_mirror_image_shows_with_three_faces_of_a_corner(
    seen: tuple[str, ...], is_visible: bool
) -> None:
    assert (against([image_of(*seen)], tuple(MIRRORED)) >= VISIBLE) == is_visible
    split = [image_of(colour) for colour in seen]  # no camera needs to see two of them
    assert (against(split, tuple(MIRRORED)) >= VISIBLE) == is_visible


def test_borders_of_faces_and_small_parts_of_them_are_not_seen() -> None:
    seen = ["red", "green", "blue"]
    believed = tuple(MIRRORED)
    assert against([image_of(*seen)], believed) == (SQUARE - 4) ** 2
    assert against([image_of(*seen, square=13)], believed) < VISIBLE
    assert against([image_of(*seen, square=14)], believed) == VISIBLE


def test_red_and_blue_exchanged_show_unless_the_colours_stay() -> None:
    change = "red and blue channels exchanged in one image"
    assert after(change, image_of("magenta")) == 0
    assert after(change, image_of("yellow")) == 0  # alone it may be the cyan one
    others = image_of("red", "green", "blue", "magenta")
    assert max(after(change, image_of("yellow"), others, seed=seed) for seed in range(4)) > VISIBLE


def test_an_image_of_before_shows_if_it_shows_the_cube() -> None:
    change = "one image 20 pixels stale"
    assert after(change, image_of("yellow")) > VISIBLE
    assert after(change, image_of()) == 0


def test_colours_are_told_apart_by_their_hue() -> None:
    for a in PAINTS:
        assert [b for b in PAINTS if looks_like(PAINTS[a], b)] == [a]
        assert looks_like([value // 3 for value in PAINTS[a]], a)  # in the shadow
    assert not any(looks_like((0, 0, 0), colour) for colour in PAINTS)


def test_counts_leave_out_what_shows_nothing(tmp_path: Path) -> None:
    calibration = trifinger.CameraRenderer(config_of("edu", tmp_path)).calibration
    grey = [np.full((540, 540), 110, np.uint8)] * 3
    nothing = [np.full((540, 540), -1, np.int8)] * 3
    answers = Judge(calibration).judge(grey, (0, 0), nothing)
    assert counts(answers, RIGHT) == (0, 1, 0)
    assert counts(answers, "cube of 50 mm believed") == (0, 1, 0)
    assert counts(answers, "one image mirrored") == (0, 0, 1)
    assert counts(answers, "opposite faces exchanged") == (0, 0, 1)
    unknown = Judge(calibration).judge(grey, (0, 0))
    assert counts(unknown, "opposite faces exchanged") == (0, 1, 0)


def test_faces_of_a_scene_are_where_the_renderer_draws_them(tmp_path: Path) -> None:
    config = config_of("edu", tmp_path)
    scenes = Scenes(config)
    renderer = trifinger.CameraRenderer(config, pixels="rgb8", shadows=False, read_noise=0.0)
    cameras = cameras_of(renderer.calibration)
    shares, hidden = [], 0
    for number in range(3):
        scene = scenes.draw(7, number)
        faces = scenes.faces(scene, cameras)
        for image, numbers in zip(renderer.render(scene.configuration), faces, strict=True):
            for face, colour in enumerate(FACES):
                rows, columns = np.nonzero(numbers == face)
                if len(rows) < 200:
                    hidden += 1
                    continue
                hue = colorsys.rgb_to_hsv(*(PAINTS[colour]))[0]
                seen = [colorsys.rgb_to_hsv(*p)[0] for p in np.asarray(image)[rows, columns] / 255]
                off = np.abs((np.array(seen) - hue + 0.5) % 1 - 0.5)
                shares.append(float(np.mean(off < 1 / 18)))
    assert len(shares) >= 10
    assert min(shares) > 0.85
    assert hidden > 0
