# SPDX-License-Identifier: BSD-3-Clause
"""Labels of images: which pixels show which face. `trifinger calibrate colours` learns from them.

A label is a mask beside its image, camera60.labels.png beside camera60.png, or an outline in a file
that the page of `write_page` saves.
"""

from __future__ import annotations

import base64
import html
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from trifinger import extras
from trifinger.arrays import Array
from trifinger.errors import InvalidArgument
from trifinger.whole_file import whole_file

from trifinger_camera_calibration.colours import BACKGROUND

PAINTS = {
    "red": (255, 0, 0),
    "green": (0, 255, 0),
    "blue": (0, 0, 255),
    "cyan": (0, 255, 255),
    "magenta": (255, 0, 255),
    "yellow": (255, 255, 0),
    BACKGROUND: (255, 255, 255),
}
"""What a mask has where it shows these colours; black: nobody says what is there."""
NEAR = 60  # a mask that was saved as JPEG, or drawn with soft brushes, is a little off
BACKGROUND_INDEX = 255


def mask_of(image: Path) -> Path:
    """The mask of an image."""
    return image.with_name(f"{image.stem}.labels.png")


def read_mask(path: Path, colours: Sequence[str], shape: tuple[int, int]) -> dict[str, Array]:
    """Reads a mask as tall and wide as `shape`: for each colour, where it is.

    It is painted in `PAINTS`, or has numbers: 0 for nothing, 1 for the first of `colours`, 2 for
    the second one..., 255 for the background.
    """
    image_module = _pillow("Image")
    image = image_module.open(path)
    has_numbers = image.mode in ("1", "L", "P")
    values = np.asarray(image if has_numbers else image.convert("RGB"), int)
    if values.shape[:2] != shape:
        raise InvalidArgument(
            f"{path} has {values.shape[1]} x {values.shape[0]} pixels, its image has "
            f"{shape[1]} x {shape[0]}"
        )
    if has_numbers:
        numbers = {BACKGROUND_INDEX: BACKGROUND} | dict(enumerate(colours, 1))
        unknown = sorted(set(np.unique(values).tolist()) - {0, *numbers})
        if unknown:
            raise InvalidArgument(
                f"{path} has the number {unknown[0]}; allowed are 0 for nothing, "
                f"1 to {len(colours)} for {', '.join(colours)}, and 255 for the background"
            )
        masks = {name: values == number for number, name in numbers.items()}
    else:
        known = [name for name in PAINTS if name in (*colours, BACKGROUND)]
        masks = {
            name: (np.abs(values - np.array(PAINTS[name])) < NEAR).all(axis=2) for name in known
        }
    masks = {name: mask for name, mask in masks.items() if mask.any()}
    if not masks:
        raise InvalidArgument(f"{path} labels nothing; paint it in {', '.join(PAINTS)}")
    return masks


def read_outlines(path: Path) -> dict[str, Any]:
    """Reads a file that the page saved: for each image its outlines."""
    try:
        outlines = json.loads(path.read_text())["images"]
        for each in outlines.values():
            for outline in each["outlines"]:
                corners = np.array(outline["corners"], float)
                if corners.ndim != 2 or corners.shape[1] != 2:
                    raise ValueError("corners are no list of x and y")
                if len(corners) < 3:
                    raise InvalidArgument(f"{path}: an outline has fewer than 3 corners")
                str(outline["colour"])
    except InvalidArgument:
        raise
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InvalidArgument(
            f"{path} is no file of labels; save one in the page that --page writes"
        ) from error
    return dict(outlines)


def masks_of(labels: Mapping[str, Any], shape: tuple[int, int]) -> dict[str, Array]:
    """The masks of an image with these outlines. Later ones lie above earlier ones."""
    image_module, draw_module = _pillow("Image"), _pillow("ImageDraw")
    names = list(dict.fromkeys(str(outline["colour"]) for outline in labels["outlines"]))
    image = image_module.new("I", shape[::-1], 0)
    draw = draw_module.Draw(image)
    for outline in labels["outlines"]:
        corners = [(float(x), float(y)) for x, y in outline["corners"]]
        draw.polygon(corners, fill=1 + names.index(str(outline["colour"])))
    values = np.asarray(image)
    masks = {name: values == i for i, name in enumerate(names, 1)}
    if labels.get("rest_is_background"):
        # Next to an outline, the object may go on.
        grown = image_module.fromarray((values > 0).astype(np.uint8) * 255)
        grown = grown.filter(_pillow("ImageFilter").MaxFilter(15))
        rest = np.asarray(grown) == 0
        masks[BACKGROUND] = masks.get(BACKGROUND, np.zeros(shape, bool)) | rest
    return masks


def write_page(
    path: Path, images: Mapping[str, Array], colours: Sequence[str], target: str
) -> None:
    """Writes a page on which one outlines faces with a mouse, in any browser, without a server.

    `images` are in the formats of cameras. The page saves a file that should be named `target`.
    """
    pictures = [
        {"name": name, "height": image.shape[0], "width": image.shape[1], "source": _source(image)}
        for name, image in images.items()
    ]
    paints = {
        name: "#{:02x}{:02x}{:02x}".format(*PAINTS.get(name, (255, 160, 60)))
        for name in (*dict.fromkeys(colours), BACKGROUND)
    }
    data = json.dumps({"pictures": pictures, "paints": paints, "target": target})
    # A text in a script must not end it.
    page = PAGE.replace("@DATA@", data.replace("</", "<\\/"))
    with whole_file(path) as part:
        part.write_text(page.replace("@TARGET@", html.escape(target)))


def _source(image: Array) -> str:
    """An image as a text that browsers show; a mosaic at half its size, without its pattern."""
    if image.ndim == 2:
        green = (image[0::2, 1::2].astype(int) + image[1::2, 0::2]) // 2
        image = np.stack([image[0::2, 0::2], green, image[1::2, 1::2]], axis=2).astype(np.uint8)
    file = io.BytesIO()
    _pillow("Image").fromarray(np.ascontiguousarray(image)).save(file, "PNG")
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()


def _pillow(module: str) -> Any:
    extras.require("plot", "PIL")
    import importlib

    return importlib.import_module(f"PIL.{module}")


PAGE = """\
<!DOCTYPE html>
<meta charset="utf-8">
<title>Faces</title>
<style>
  body { font: 16px sans-serif; margin: 1em; background: #222; color: #eee }
  button { font-size: 16px; margin: 0 4px 8px 0; padding: 4px 10px }
  button.chosen { outline: 3px solid #fff }
  canvas { display: block; cursor: crosshair; max-width: 95vw }
</style>
<p>Choose a colour, then click around a face of that colour: at each corner, a little inside. A
double click closes the outline. Leave out what stands in front. Three to six images that show each
colour twice are enough. At the end, save @TARGET@ and pass it with --labels.</p>
<p id="colours"></p>
<p><button id="previous">previous image</button><button id="next">next image</button>
<button id="undo">undo</button><label><input type="checkbox" id="rest" checked> the rest of this
image is background</label> <button id="save">save @TARGET@</button> <span id="name"></span></p>
<canvas id="canvas"></canvas>
<script>
"use strict";
const data = @DATA@;
const zoom = 2;
const labels = {};
for (const picture of data.pictures)
  labels[picture.name] = { outlines: [], rest_is_background: true };
const find = (id) => document.getElementById(id);
const canvas = find("canvas"), pen = canvas.getContext("2d");
let number = 0, corners = [], colour = Object.keys(data.paints)[0];
const image = new Image();
image.onload = draw;

function current() { return data.pictures[number]; }
function draw() {
  canvas.width = zoom * current().width;
  canvas.height = zoom * current().height;
  pen.drawImage(image, 0, 0, canvas.width, canvas.height);
  pen.lineWidth = 2;
  for (const outline of labels[current().name].outlines) trace(outline, true);
  trace({ colour: colour, corners: corners }, false);
  find("name").textContent = `${number + 1} of ${data.pictures.length}: ${current().name}`;
  find("rest").checked = labels[current().name].rest_is_background;
}
function trace(outline, closed) {
  pen.strokeStyle = data.paints[outline.colour];
  pen.fillStyle = data.paints[outline.colour];
  pen.beginPath();
  // The centre of pixel 0 is at 0.5 of the canvas.
  for (const [x, y] of outline.corners) pen.lineTo(zoom * (x + 0.5), zoom * (y + 0.5));
  if (closed) pen.closePath();
  pen.stroke();
  if (closed) { pen.globalAlpha = 0.25; pen.fill(); pen.globalAlpha = 1; }
}
function show(step) {
  number = (number + step + data.pictures.length) % data.pictures.length;
  corners = [];
  image.src = current().source;
}
canvas.onclick = (event) => {
  if (event.detail > 1) return;
  const frame = canvas.getBoundingClientRect();
  const scale = current().width / frame.width;
  corners.push([(event.clientX - frame.left) * scale - 0.5,
                (event.clientY - frame.top) * scale - 0.5]);
  draw();
};
canvas.ondblclick = () => {
  if (corners.length > 2) labels[current().name].outlines.push({ colour, corners });
  corners = [];
  draw();
};
find("undo").onclick = () => {
  if (corners.length) corners.pop(); else labels[current().name].outlines.pop();
  draw();
};
find("previous").onclick = () => show(-1);
find("next").onclick = () => show(1);
find("rest").onchange = () => { labels[current().name].rest_is_background = find("rest").checked; };
find("save").onclick = () => {
  const images = {};
  for (const [name, each] of Object.entries(labels)) if (each.outlines.length) images[name] = each;
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([JSON.stringify({ images }, null, 1)]));
  link.download = data.target;
  link.click();
};
for (const [name, paint] of Object.entries(data.paints)) {
  const button = document.createElement("button");
  button.textContent = name;
  button.style.borderBottom = `6px solid ${paint}`;
  button.onclick = () => {
    colour = name;
    for (const other of find("colours").children) other.classList.remove("chosen");
    button.classList.add("chosen");
    draw();
  };
  find("colours").append(button);
}
find("colours").firstChild.classList.add("chosen");
show(0);
</script>
"""
