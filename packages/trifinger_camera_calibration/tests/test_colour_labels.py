# SPDX-License-Identifier: BSD-3-Clause
"""Labels of images, as masks and as outlines."""

import json
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from trifinger.errors import InvalidArgument
from trifinger_camera_calibration.colour_labels import (
    masks_of,
    read_mask,
    read_outlines,
    write_page,
)

COLOURS = ["red", "green"]


@pytest.mark.parametrize("has_numbers", [False, True])
def test_masks_name_the_colour_of_each_pixel(tmp_path: Path, has_numbers: bool) -> None:
    values = np.zeros((60, 80) if has_numbers else (60, 80, 3), np.uint8)
    values[10:20, 10:30] = 2 if has_numbers else (0, 255, 0)
    values[40:, :] = 255
    PIL.Image.fromarray(values).save(tmp_path / "mask.png")
    masks = read_mask(tmp_path / "mask.png", COLOURS, (60, 80))
    assert set(masks) == {"green", "background"}
    assert masks["green"].sum() == 200
    assert masks["background"].sum() == 1600
    with pytest.raises(InvalidArgument, match="80 x 60"):
        read_mask(tmp_path / "mask.png", COLOURS, (540, 540))


def test_outlines_become_masks(tmp_path: Path) -> None:
    square = {"colour": "red", "corners": [[10, 10], [29, 10], [29, 29], [10, 29]]}
    labels = {"images": {"1/a.png": {"outlines": [square], "rest_is_background": True}}}
    (tmp_path / "labels.json").write_text(json.dumps(labels))
    masks = masks_of(read_outlines(tmp_path / "labels.json")["1/a.png"], (60, 80))
    assert masks["red"].sum() == 400
    assert not (masks["red"] & masks["background"]).any()
    (tmp_path / "labels.json").write_text("{}")
    with pytest.raises(InvalidArgument, match="no file of labels"):
        read_outlines(tmp_path / "labels.json")
    square["corners"] = [[10, 10], [29, 10]]
    (tmp_path / "labels.json").write_text(json.dumps(labels))
    with pytest.raises(InvalidArgument, match="fewer than 3 corners"):
        read_outlines(tmp_path / "labels.json")
    square["corners"] = [10, 10, 29, 10, 29, 29]
    (tmp_path / "labels.json").write_text(json.dumps(labels))
    with pytest.raises(InvalidArgument, match="no file of labels"):
        read_outlines(tmp_path / "labels.json")


def test_the_page_has_all_images_and_colours(tmp_path: Path) -> None:
    write_page(tmp_path / "p.html", {"1/a.png": np.zeros((8, 8), np.uint8)}, COLOURS, "labels.json")
    page = (tmp_path / "p.html").read_text()
    assert '"1/a.png"' in page
    assert all(f'"{name}"' in page for name in (*COLOURS, "background"))
    assert "@" not in page.split("<script>")[1]
