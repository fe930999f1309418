# SPDX-License-Identifier: BSD-3-Clause
"""What a browser is told: documents, arrays, the bodies of a scene and where they are in a frame.

The file of a log and the server of a page say all of it in the same words, so both show the same.
"""

from __future__ import annotations

import base64
import hashlib
import html
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from trifinger.arrays import Array

    from trifinger_view.scene import Mesh, Scene

GHOST_ANGLE = 0.03  # difference from which the desired pose is shown [rad]
METRES_PER_NEWTON = 0.03  # length of the arrow of a force
MIN_FORCE = 0.05  # that is shown [N]
AZIMUTH, ELEVATION = np.radians([295.0, 24.0])  # from what the camera looks at to its eye, at first
FIELD_OF_VIEW = 0.66  # [rad]
JPEG_QUALITY = 75
MOMENTS = 24
"""Frames of a log for which the camera has room at first."""
FOLDER = Path(__file__).parent / "web"
Place = tuple[int, int]
"""Where an array is in the numbers of a message: its offset [bytes] and how many it has."""


class Numbers:
    """Arrays and files one after the other."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, values: Array, kind: str) -> Place:
        """Adds an array of the numbers `kind`."""
        array = np.ascontiguousarray(values, kind)
        return self._append(array.tobytes()), array.size

    def add_file(self, content: bytes) -> Place:
        """Adds the bytes of a file."""
        return self._append(content), len(content)

    def joined(self) -> bytes:
        """All of it."""
        return b"".join(self._parts)

    def _append(self, content: bytes) -> int:
        place = self._size
        padded = content + bytes(-len(content) % 8)  # browsers want aligned numbers
        self._parts.append(padded)
        self._size += len(padded)
        return place


def message(kind: str, numbers: Numbers | None = None, **told: Any) -> bytes:
    """A message of a server: the size of its text, its text, and numbers."""
    text = json.dumps({"kind": kind, **told}, separators=(",", ":")).encode()
    text += b" " * (-(4 + len(text)) % 8)
    return len(text).to_bytes(4, "little") + text + (numbers.joined() if numbers else b"")


@dataclass(frozen=True)
class Document:
    """A page as HTML, and the policy that lets a browser run its scripts and no other ones."""

    text: str
    policy: str


def document(
    *scripts: Sequence[str],
    data: Mapping[str, str] | None = None,
    page_name: str = "page",
    **words: str,
) -> Document:
    """The page with some files of the folder `web`, which are one script each time.

    `page_name` is that of its files of HTML and CSS.
    `data` are texts that the scripts find by their names, and `words` what stands in place of
    @TITLE@ and the like.
    """
    texts = ["".join(_read(name) for name in each) for each in scripts]
    style = _read("colours.css") + _read(f"{page_name}.css")
    hashes = [f"'sha256-{_hash(text)}'" for text in (style, *texts)]
    policy = (
        f"default-src 'none'; style-src {hashes[0]}; script-src {' '.join(hashes[1:])}; "
        "img-src blob: data:"
    )
    # A server says it in its headers.
    meta = f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n' if data else ""
    page = _read(f"{page_name}.html").replace("@POLICY@\n", meta).replace("@STYLE@", style)
    for name, value in {"ROBOT": "", "PARTS": "", "FACTS": "", **words}.items():
        page = page.replace(f"@{name}@", html.escape(value))
    held = [
        f'<script type="text/plain" id="{name}">{text}</script>\n'
        for name, text in (data or {}).items()
    ]
    run = [f"<script>{text}</script>\n" for text in texts]
    return Document("".join([page, *held, *run, "</body>\n</html>\n"]), policy)


def session_of(
    scene: Scene,
    numbers: Numbers,
    moments: Sequence[tuple[Array | None, Mapping[str, Array]]],
    ink: tuple[Array, Mesh] | None,
) -> dict[str, Any]:
    """The bodies of a scene, its floor, its ink, and the camera that sees some moments of it."""
    middle, radius = scene.sphere(moments)
    return {
        "bodies": [
            {
                "name": body.name,
                "parts": [_part(mesh, numbers) for mesh in body.meshes],
                "isMoving": body.is_moving and not body.object,
            }
            for body in scene.bodies
        ],
        "ink": ink and {"steps": numbers.add(ink[0], "<f8"), **_part(ink[1], numbers)},
        "metresPerNewton": METRES_PER_NEWTON,
        "home": {
            "middle": [float(number) for number in middle],
            "radius": float(radius),
            "azimuth": float(AZIMUTH),
            "elevation": float(ELEVATION),
            "fieldOfView": FIELD_OF_VIEW,
            "floor": scene.floor(moments),
        },
    }


@dataclass(frozen=True)
class Placed:
    """Where everything is in a frame."""

    poses: NDArray[np.float32]
    """[bodies, 7]; NaN for an object that was never seen."""
    ghosts: NDArray[np.float32] | None
    """The same for the desired pose; None where the robot is near it."""
    forces: NDArray[np.float32]
    """[tips, 6]: where a tip is [m], and its force [N]; empty without such sensors."""


def placed(
    scene: Scene,
    position: Array | None,
    desired: Array | None,
    objects: Mapping[str, Array],
    tip_force: Array | None,
) -> Placed:
    """Where the bodies, the desired pose and the forces are; the arguments are those of Frame."""
    poses = np.concatenate(scene.poses(position, objects), axis=1).astype(np.float32)
    poses[[bool(body.object) and body.object not in objects for body in scene.bodies]] = np.nan
    ghosts = None
    is_apart = (
        desired is not None
        and position is not None
        and bool(np.abs(desired - position).max(initial=0.0) > GHOST_ANGLE)
    )
    if is_apart:
        ghosts = np.concatenate(scene.poses(desired, objects), axis=1).astype(np.float32)
    forces = np.zeros((0, 6), np.float32)
    if tip_force is not None and len(tip_force) == len(scene.tip_names):
        places, along = scene.tips(position)
        force = np.where(tip_force > MIN_FORCE, tip_force, 0.0)
        forces = np.concatenate([places, along * force[:, None]], axis=1).astype(np.float32)
    return Placed(poses, ghosts, forces)


def jpeg(image: NDArray[np.uint8], width: int) -> bytes:
    """A file of an image with at most so many pixels in a row."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(smaller(image, width)).save(file, "jpeg", quality=JPEG_QUALITY)
    return file.getvalue()


def smaller(image: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    """An image with at most `width` pixels in a row; a pixel is the mean of a square of them."""
    factor = -(-image.shape[1] // width)
    rows, columns = image.shape[0] // factor, image.shape[1] // factor
    part = image[: rows * factor, : columns * factor]
    squares = part.reshape(rows, factor, columns, factor, -1)
    return np.asarray(squares.mean(axis=(1, 3)), np.uint8)


def _part(mesh: Mesh, numbers: Numbers) -> dict[str, Any]:
    normals = np.zeros((len(mesh.normals), 4), np.int8)
    normals[:, :3] = np.round(127 * mesh.normals)
    return {
        "positions": numbers.add(mesh.vertices, "<f4"),
        "normals": numbers.add(normals, "i1"),
        "colours": numbers.add(mesh.colours, "u1"),
        "triangles": numbers.add(mesh.faces, "<u4"),
        "isTransparent": mesh.is_transparent,
        "isSurround": mesh.is_surround,
    }


def _read(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
