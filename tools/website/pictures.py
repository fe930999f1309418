# SPDX-License-Identifier: BSD-3-Clause
"""Keeps the pictures of tutorials in docs/images, for readers of the pages outside of the site.

tests/python/test_pages.py makes them in build/docs/pictures, which the site shows. This writes
them smaller: python -m website.pictures
"""

from pathlib import Path

from PIL import Image
from tracked_files import ROOT

MADE = ROOT / "build/docs/pictures"
KEPT = ROOT / "docs/images/tutorials"
LARGEST = 900  # pixels


def keep(path: Path) -> None:
    """Writes a picture with few colours and at most `LARGEST` pixels in width."""
    with Image.open(path) as picture:
        small = picture.convert("RGB")
    small.thumbnail((LARGEST, 10 * LARGEST))
    small.quantize(64).save(KEPT / path.name, optimize=True)


if __name__ == "__main__":
    for made in sorted(MADE.glob("*.png")):
        keep(made)
