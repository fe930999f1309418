# SPDX-License-Identifier: BSD-3-Clause
"""Keeps pictures in docs/ for readers outside of the site: of tutorials and in notebooks.

tests/python/test_pages.py and test_notebooks.py make them in build/docs, which the site shows. This
writes them smaller: python -m website.pictures
"""

import base64
import io
import json
from pathlib import Path

from PIL import Image
from tracked_files import ROOT

from .pages import MADE

LARGEST = 900  # pixels


def smaller(picture: bytes) -> bytes:
    """Returns a PNG with 256 colours and at most `LARGEST` pixels in width."""
    with Image.open(io.BytesIO(picture)) as image:
        small = image.convert("RGB")
    small.thumbnail((LARGEST, 10 * LARGEST))
    written = io.BytesIO()
    small.quantize(256, Image.Quantize.FASTOCTREE).save(written, "png", optimize=True)
    return written.getvalue()


def with_smaller_pictures(notebook: str) -> str:
    """Returns the text of a notebook whose outputs have smaller pictures."""
    content = json.loads(notebook)
    for cell in content["cells"]:
        for output in cell.get("outputs", []):
            if "image/png" in output.get("data", {}):
                picture = base64.b64decode(output["data"]["image/png"])
                output["data"]["image/png"] = base64.b64encode(smaller(picture)).decode()
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def kept(made: Path) -> bytes:
    """Returns what is kept of a picture, or of a notebook with its pictures."""
    if made.suffix == ".ipynb":
        return with_smaller_pictures(made.read_text()).encode()
    return smaller(made.read_bytes())


if __name__ == "__main__":
    for folder, newest in MADE.items():
        for file in sorted(newest.glob("*.*")):
            (ROOT / folder / file.name).write_bytes(kept(file))
