# SPDX-License-Identifier: BSD-3-Clause
"""The page about a calibration: one file that needs no server, no network and no script."""

import base64
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from pathlib import Path

import cv2
import numpy as np

from trifinger_camera_calibration import findings
from trifinger_camera_calibration.adjustment import root_mean_square
from trifinger_camera_calibration.board import Matrix
from trifinger_camera_calibration.detection import View
from trifinger_camera_calibration.geometry import angle_between
from trifinger_camera_calibration.images import read, to_grey
from trifinger_camera_calibration.result import Result

FOLDER = Path(__file__).parent
ARENA = 0.195  # radius of the table that fingers reach [m]
THUMBNAIL = 260  # [pixel]


def svg(width: float, height: float, content: Iterable[str], title: str) -> str:
    """A picture in SVG."""
    return (
        f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{escape(title)}">'
        f"{''.join(content)}</svg>"
    )


def arrows(result: Result, camera: str) -> str:
    """The residuals of a camera where they are in its image, and where no corner was."""
    pixels, residuals = result.residuals_of(camera)
    width, height = result.adjustment.sizes[result.adjustment.cameras.index(camera)]
    rms = root_mean_square(residuals)
    factor = 0.03 * width / max(rms, 1e-6)

    def shapes() -> Iterator[str]:
        yield f'<rect class="frame" x="0.5" y="0.5" width="{width - 1}" height="{height - 1}"/>'
        counts = findings.coverage(result, camera)
        for row, column in np.argwhere(counts == 0):
            yield (
                f'<rect class="empty" x="{column * width / 3:g}" y="{row * height / 3:g}" '
                f'width="{width / 3:g}" height="{height / 3:g}"/>'
            )
        for (x, y), (u, v) in zip(pixels, residuals, strict=True):
            yield f'<circle class="tip" cx="{x:.1f}" cy="{y:.1f}" r="1.6"/>'
            yield f'<path class="arrow" d="M{x:.1f} {y:.1f}l{u * factor:.1f} {v * factor:.1f}"/>'

    return svg(width, height, shapes(), f"residuals of {camera}") + (
        f"<p>Arrows are {factor:.0f} times as long as the residuals. No corner was seen in the "
        "shaded parts.</p>"
    )


def histogram(result: Result, camera: str) -> str:
    """How often which residual occurs."""
    _, residuals = result.residuals_of(camera)
    lengths = np.linalg.norm(residuals, axis=1)
    top = float(np.ceil(max(lengths.max(initial=0.1), 0.1) * 10) / 10)
    counts, _ = np.histogram(lengths, bins=30, range=(0, top))
    highest = max(int(counts.max()), 1)
    width, height = 360, 110

    def shapes() -> Iterator[str]:
        for i, count in enumerate(counts):
            tall = 80 * count / highest
            yield f'<rect class="bar" x="{i * 12 + 1}" y="{85 - tall:.1f}" width="10" '
            yield f'height="{tall:.1f}"/>'
        yield f'<path class="frame" d="M0 85.5H{width}"/>'
        for i in range(5):
            anchor = ("start", "middle", "middle", "middle", "end")[i]
            yield (
                f'<text x="{i * width / 4:g}" y="102" text-anchor="{anchor}">'
                f"{top * i / 4:.2f}{' pixel' * (i == 4)}</text>"
            )

    return svg(width, height, shapes(), f"histogram of the residuals of {camera}")


def outline(result: Result, place: int) -> Matrix:
    """The corners of the pattern in the world."""
    width, height = result.board.size
    local = np.array([[0, 0, 0], [width, 0, 0], [width, height, 0], [0, height, 0]])
    pose = result.adjustment.pose_of_board(result.fit.state, place)
    return np.asarray(local @ pose[:3, :3].T + pose[:3, 3])


def scene(result: Result, axes: tuple[int, int], title: str) -> str:
    """Cameras and boards along two axes of the world."""
    cameras = result.calibration.cameras
    reach = max(0.25, *(float(np.abs(camera.pose[:2, 3]).max()) for camera in cameras)) + 0.1
    top = max(0.3, *(float(camera.pose[2, 3]) for camera in cameras)) + 0.1
    from_above = axes == (0, 1)
    low = -reach if from_above else -0.05
    high = reach if from_above else top
    scale = 420 / (2 * reach)
    width, height = 420.0, (high - low) * scale

    def at(point: Matrix) -> str:
        x, y = point[axes[0]], point[axes[1]]
        return f"{(x + reach) * scale:.1f} {(high - y) * scale:.1f}"

    def polygon(points: Sequence[Matrix], kind: str) -> str:
        return f'<path class="{kind}" d="M{"L".join(map(at, points))}Z"/>'

    def shapes() -> Iterator[str]:
        if from_above:
            centre = at(np.zeros(3)).split()
            yield f'<circle class="frame" cx="{centre[0]}" cy="{centre[1]}" r="{ARENA * scale:g}"/>'
        else:
            table = [np.array([-reach, -reach, 0.0]), np.array([reach, reach, 0.0])]
            yield f'<path class="frame" d="M{at(table[0])}L{at(table[1])}"/>'
        for i, placement in enumerate(result.adjustment.placements):
            yield polygon(list(outline(result, i)), "flat" if placement.is_flat else "free")
        for camera in cameras:
            pose = camera.pose
            corners = np.array([[-1, -1, 1.6], [1, -1, 1.6], [1, 1, 1.6], [-1, 1, 1.6]]) * 0.03
            seen = corners @ pose[:3, :3].T + pose[:3, 3]
            for i in range(4):
                yield polygon([pose[:3, 3], seen[i], seen[(i + 1) % 4]], "camera")
            x, y = (float(each) for each in at(pose[:3, 3]).split())
            anchor = "start" if x < 110 else "end" if x > 310 else "middle"
            y += 24 if y > height / 2 else -14
            yield f'<text class="name" x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}">'
            yield f"{escape(camera.name)}</text>"
        for axis, name in zip(axes, ("xyz"[axis] for axis in axes), strict=True):
            end = np.zeros(3)
            end[axis] = 0.1
            where = at(end * 1.2).split()
            yield f'<path class="axis" d="M{at(np.zeros(3))}L{at(end)}"/>'
            yield f'<text class="name" x="{where[0]}" y="{where[1]}">{name}</text>'

    return f'<div class="card"><h3>{title}</h3>{svg(width, height, shapes(), title)}</div>'


def flatness(result: Result) -> str:
    """How far boards lay from the table, as a table of figures."""
    if not result.flatness:
        return "<p>No image shows the board flat on the table.</p>"
    rows = "".join(
        f"<tr><td>{escape(each.name)}</td><td>{each.x * 1e3:+.0f}, {each.y * 1e3:+.0f}</td>"
        f"<td>{each.height * 1e3:+.2f}</td><td>{np.degrees(each.tilt):.2f}</td></tr>"
        for each in result.flatness
    )
    return (
        "<p>Where each board lay if only the cameras are believed. All of these boards together "
        "define z = 0.</p>"
        '<div class="wide"><table><tr><th>image</th><th>middle x, y [mm]</th>'
        f"<th>too high [mm]</th><th>tilt [degree]</th></tr>{rows}</table></div>"
    )


def figures(result: Result) -> str:
    """The cameras as a table of figures."""
    head = (
        "camera",
        "images",
        "corners",
        "residual [pixel]",
        "focal length [pixel]",
        "principal point [pixel]",
        "position [m]",
        "position, angle known to",
        "k1 k2 p1 p2 k3",
    )
    rows = ""
    for camera in result.calibration.cameras:
        pixels, residuals = result.residuals_of(camera.name)
        views = sum(view.camera == camera.name for view in result.adjustment.views)
        sure = result.uncertainty[camera.name]
        lens = camera.lens
        cells = (
            camera.name,
            f"{views} of {sum(view.camera == camera.name for view in result.views)}",
            str(len(pixels)),
            f"{root_mean_square(residuals):.3f}",
            f"{lens.focal_length[0]:.2f}, {lens.focal_length[1]:.2f} ± {sure.focal_length:.2f}",
            f"{lens.principal_point[0]:.2f}, {lens.principal_point[1]:.2f} "
            f"± {sure.principal_point:.2f}",
            " ".join(f"{number:.4f}" for number in camera.pose[:3, 3]),
            f"{sure.position * 1e3:.2f} mm, {np.degrees(sure.angle):.3f}°",
            " ".join(f"{number:.4f}" for number in lens.distortion),
        )
        rows += "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"
    titles = "".join(f"<th>{title}</th>" for title in head)
    return f'<div class="wide"><table><tr>{titles}</tr>{rows}</table></div>'


def picture(result: Result, view: View) -> str:
    """An image with the corners that were found, as HTML."""
    grey = to_grey(read(view.path))
    scale = THUMBNAIL / grey.shape[1]
    size = (THUMBNAIL, round(grey.shape[0] * scale))
    small = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    colours = cv2.cvtColor(small, cv2.COLOR_GRAY2BGR)
    for x, y in (view.pixels + 0.5) * scale - 0.5:
        # OpenCV counts in parts of a pixel here.
        centre = (round(x * 16), round(y * 16))
        cv2.circle(colours, centre, 3 * 16, (40, 160, 255), 1, cv2.LINE_AA, 4)
    _, data = cv2.imencode(".jpg", colours, [cv2.IMWRITE_JPEG_QUALITY, 80])
    code = base64.b64encode(data.tobytes()).decode()
    adjustment = result.adjustment
    own = [i for i, each in enumerate(adjustment.views) if each is view]
    if own:
        miss = root_mean_square(result.fit.residuals[(adjustment.view == own[0]) & result.used])
        note = f"{len(view.numbers)} corners, {miss:.2f} pixel"
        if problem := view.quality.problem():
            note += f'; <span class="warn">{escape(problem)}</span>'
    else:
        note = f'<span class="bad">not used: {escape(view.reason or "it does not fit")}</span>'
    name = escape(f"{view.camera}/{view.path.name}")
    return (
        f'<figure><img loading="lazy" alt="{name}" src="data:image/jpeg;base64,{code}">'
        f"<figcaption>{escape(view.name)}: {note}</figcaption></figure>"
    )


def as_sentence(text: str) -> str:
    """A text with a capital letter, unless it begins with a name or a formula, and a full stop."""
    first = text.split()[0]
    return (text if not first.isalpha() or len(first) == 1 else text[0].upper() + text[1:]) + "."


def sentences(title: str, kind: str, texts: Sequence[str]) -> str:
    """A list of sentences with a title; empty if there are none."""
    if not texts:
        return ""
    items = "".join(f"<li>{escape(as_sentence(text))}</li>" for text in texts)
    return f'<h2 class="{kind}">{title}</h2><ul>{items}</ul>'


def pairs_of_cameras(result: Result) -> str:
    """Distances and angles between cameras, which a ruler can check."""
    cameras = result.calibration.cameras
    rows = ""
    for i, one in enumerate(cameras):
        for other in cameras[i + 1 :]:
            move = np.linalg.norm(one.pose[:3, 3] - other.pose[:3, 3])
            turn = np.degrees(angle_between(one.pose[:3, :3], other.pose[:3, :3]))
            rows += f"<tr><td>{escape(one.name)} to {escape(other.name)}</td>"
            rows += f"<td>{move * 1e3:.1f} mm</td><td>{turn:.2f}°</td></tr>"
    return f"<table>{rows}</table>" if rows else ""


def page(result: Result, robot: str) -> str:
    """The whole page, as HTML."""
    verdict = (
        '<p class="bad">This calibration must not be used.</p>'
        if result.problems
        else f'<p class="good">Corners miss by {result.rms:.3f} pixels (root mean square).</p>'
    )
    residuals = "".join(
        f'<div class="card"><h3>{escape(name)}</h3>{arrows(result, name)}'
        f"{histogram(result, name)}</div>"
        for name in result.adjustment.cameras
    )
    pictures = "".join(
        f"<h3>{escape(name)}</h3><div class='pictures'>"
        + "".join(picture(result, view) for view in result.views if view.camera == name)
        + "</div>"
        for name in result.adjustment.cameras
    )
    scenes = scene(result, (0, 1), "From above") + scene(result, (0, 2), "From the side")
    title = f"Calibration of the cameras of {robot}"
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title>
<style>{(FOLDER / "page.css").read_text()}</style>
</head>
<body>
<h1>{escape(title)}</h1>
<p>{escape(result.calibration.date)}. The board has {escape(str(result.board))}.</p>
{verdict}
{sentences("What is wrong", "bad", result.problems)}
{sentences("What to do better", "warn", result.advice)}
{sentences("What else was found", "", result.remarks)}
<h2>Cameras</h2>
{figures(result)}
<h2>Residuals</h2>
<div class="cards">{residuals}</div>
<h2>Where cameras and boards were</h2>
<div class="cards">{scenes}</div>
{pairs_of_cameras(result)}
<h2>Table</h2>
{flatness(result)}
<h2>Images</h2>
{pictures}
<h2>File</h2>
<details><summary>The calibration</summary><pre>{escape(result.calibration.text())}</pre></details>
</body>
</html>
"""
