# SPDX-License-Identifier: BSD-3-Clause
"""Draws boards for a printer: SVG and PDF, which keep their size in millimetres."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from trifinger.errors import InvalidArgument
from trifinger.whole_file import whole_file

from trifinger_camera_calibration.board import MARGIN, Board, dictionary_of

PAPER = ((0.210, 0.297), (0.297, 0.420), (0.420, 0.594), (0.594, 0.841), (0.841, 1.189))  # A4 to A0
LINE = 0.0002  # width of lines outside of the pattern [m]

Rectangle = tuple[float, float, float, float]


def black_rectangles(board: Board) -> Iterator[Rectangle]:
    """Yields x, y, width and height of what is black, in the frame of the board [m]."""
    drawn = board.to_opencv()
    with_marker = set()
    bits = dictionary_of(board.dictionary).markerSize + 2
    cell = board.marker / bits
    for number, outline in zip(np.ravel(drawn.getIds()), drawn.getObjPoints(), strict=True):
        left, top = (float(each) for each in outline[0][:2])
        with_marker.add((round(left // board.square), round(top // board.square)))
        picture = cv2.aruco.generateImageMarker(
            dictionary_of(board.dictionary), int(number), bits, borderBits=1
        )
        for row, line in enumerate(picture):
            # One rectangle for each run of black cells: seams between cells would be printed.
            edges = np.flatnonzero(np.diff(np.r_[255, line, 255].astype(int)))
            for begin, end in edges.reshape(-1, 2):
                width = float(end - begin) * cell
                yield left + float(begin) * cell, top + row * cell, width, cell
    for row in range(board.rows):
        for column in range(board.columns):
            if (column, row) not in with_marker:
                yield column * board.square, row * board.square, board.square, board.square


def page_of(board: Board) -> tuple[float, float]:
    """Width and height of the smallest sheet for a board; its own size if no sheet is so large."""
    wide, high = (side + 2 * MARGIN for side in board.size)
    for short, long in PAPER:
        if max(wide, high) <= long and min(wide, high) <= short:
            return (long, short) if wide > high else (short, long)
    return wide, high


def marks(board: Board, left: float, top: float) -> list[Rectangle]:
    """Lines in the margin at the middle of each side: they lie on the axes of the world."""
    wide, high = board.size
    length = MARGIN * 2 / 3
    x, y = left + wide / 2 - LINE / 2, top + high / 2 - LINE / 2
    return [
        (x, top - length, LINE, length),
        (x, top + high, LINE, length),
        (left - length, y, length, LINE),
        (left + wide, y, length, LINE),
    ]


def words(board: Board) -> str:
    """What is printed below the pattern."""
    return f"{board}. x to the right. Print at 100 %, then measure a row of squares."


def layout(board: Board) -> tuple[float, float, float, float]:
    """Width and height of the page, and where the pattern begins on it [m]."""
    width, height = page_of(board)
    return width, height, (width - board.size[0]) / 2, (height - board.size[1]) / 2


def svg(board: Board) -> str:
    """The board as a picture in SVG."""
    width, height, left, top = layout(board)
    pattern = [(x + left, y + top, w, h) for x, y, w, h in black_rectangles(board)]
    shapes = "\n".join(
        f'<rect x="{x * 1e3:.4f}" y="{y * 1e3:.4f}" width="{w * 1e3:.4f}" height="{h * 1e3:.4f}"/>'
        for x, y, w, h in [*pattern, *marks(board, left, top)]
    )
    return f"""<svg xmlns="http://www.w3.org/2000/svg" width="{width * 1e3:g}mm" \
height="{height * 1e3:g}mm" viewBox="0 0 {width * 1e3:g} {height * 1e3:g}">
<!-- SPDX-License-Identifier: BSD-3-Clause -->
<rect width="100%" height="100%" fill="#fff"/>
<g shape-rendering="crispEdges">
{shapes}
</g>
<text x="{left * 1e3:.2f}" y="{(top + board.size[1]) * 1e3 + 4.5:.2f}" font-family="sans-serif" \
font-size="2.5">{words(board)}</text>
</svg>
"""


def pdf(board: Board) -> bytes:
    """The board as a page in PDF."""
    width, height, left, top = layout(board)
    point = 72 / 0.0254  # per metre

    def shape(x: float, y: float, w: float, h: float) -> str:
        numbers = (x, height - y - h, w, h)  # PDF begins at the bottom
        return " ".join(f"{number * point:.5f}" for number in numbers) + " re"

    shapes = [shape(x + left, y + top, w, h) for x, y, w, h in black_rectangles(board)]
    shapes += [shape(*mark) for mark in marks(board, left, top)]
    at = f"{left * point:.3f} {(height - top - board.size[1] - 0.0045) * point:.3f}"
    content = "\n".join([*shapes, "f", f"BT /F 7 Tf {at} Td ({words(board)}) Tj ET"])
    objects = [
        # Without this, many viewers shrink the page to what the printer can reach.
        "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width * point:.5f} {height * point:.5f}] "
        "/Contents 4 0 R /Resources << /Font << /F 5 0 R >> >> >>",
        f"<< /Length {len(content)} >>\nstream\n{content}\nendstream",
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    body = "%PDF-1.4\n"
    places = []
    for number, each in enumerate(objects, 1):
        places.append(len(body))
        body += f"{number} 0 obj\n{each}\nendobj\n"
    table = "".join(f"{place:010d} 00000 n \n" for place in places)
    size = len(objects) + 1
    end = (
        f"xref\n0 {size}\n0000000000 65535 f \n{table}"
        f"trailer\n<< /Size {size} /Root 1 0 R >>\nstartxref\n{len(body)}\n%%EOF\n"
    )
    return (body + end).encode("ascii")


def draw(board: Board, path: Path) -> None:
    """Writes a board to a file: SVG or PDF, by its suffix."""
    match path.suffix.lower():
        case ".svg":
            content = svg(board).encode()
        case ".pdf":
            content = pdf(board)
        case suffix:
            raise InvalidArgument(
                f"boards are drawn as .svg or .pdf, which keep their size on paper, not '{suffix}'"
            )
    with whole_file(path) as part:
        part.write_bytes(content)
