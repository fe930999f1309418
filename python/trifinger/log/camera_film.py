# SPDX-License-Identifier: BSD-3-Clause
"""A film of what the cameras of a robot saw, above a plot with the same time."""

from __future__ import annotations

import io
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from trifinger import picture
from trifinger._trifinger import LoggedSession
from trifinger.arrays import Array
from trifinger.errors import InvalidArgument
from trifinger.log.images import LoggedCameras, LoggedImages
from trifinger.log.plot import curves as plot_curves, matplotlib_figure, panels
from trifinger.log.steps import steps_between
from trifinger.progress import shown

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIZE = 480  # width of an image in the film [pixels]
PLOT_HEIGHT = 400  # [pixels]
ROWS = 2  # panels of the plot
DPI = 100
CURSOR = (192, 32, 42)
DARK = 40  # brightness of an image that is missing


class Plot:
    """A plot as pixels, in which a line marks the time."""

    def __init__(self, session: LoggedSession, width: int, height: int) -> None:
        import matplotlib as mpl
        from matplotlib.figure import Figure

        curves = plot_curves.read(session)
        rows = panels.panels_of(curves)[:ROWS]
        with mpl.rc_context(matplotlib_figure.STYLE):
            figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, layout="constrained")
            grid = figure.add_gridspec(len(rows), 12)
            axes = []
            for row, panel in enumerate(rows):
                part = 12 // len(panel.groups)
                places = [
                    figure.add_subplot(grid[row, begin : begin + part])
                    for begin in range(0, 12, part)
                ]
                matplotlib_figure.draw_row(places, curves, panel)
                axes += places
            for place in axes:
                place.set_xlim(0, max(curves.duration, 1e-6))
            axes[-1].set_xlabel("time since the first step [s]")
            drawn = io.BytesIO()
            figure.savefig(drawn, format="rgba", dpi=DPI)
        colours = np.frombuffer(drawn.getvalue(), np.uint8).reshape(height, width, 4)
        self._pixels: NDArray[np.uint8] = colours[:, :, :3].copy()
        self._axes = [
            (place.transData.transform, place.get_window_extent().extents) for place in axes
        ]

    def at(self, time: float) -> NDArray[np.uint8]:
        """The plot with a line at a time since the first step [s]."""
        pixels = self._pixels.copy()
        height, width = pixels.shape[:2]
        for transform, (left, bottom, right, top) in self._axes:
            x = round(float(transform((time, 0))[0]))
            if left - 1 <= x <= right + 1:
                columns = slice(max(x - 1, 0), min(x + 1, width))
                pixels[height - round(top) : height - round(bottom), columns] = CURSOR
        return pixels


class CameraStrip:
    """The newest image of each camera at any time."""

    def __init__(self, cameras: LoggedCameras, begin: np.datetime64) -> None:
        self._cameras = cameras
        self._names = cameras.names
        self._begin = begin
        found = [
            (images.index, [images.time_of(name) for name in self._names])
            for images in shown(cameras, "times of images", len(cameras))
        ]
        if not found:
            raise InvalidArgument("there are no images in this part of the log")
        self._indices = np.array([index for index, _ in found])
        times = np.array([times for _, times in found], "datetime64[ns]")
        # Two images of one camera may come with times in another order if one of them is missing.
        self._times = np.maximum.accumulate((times - begin).astype(np.int64) * 1e-9, axis=0)
        self._shown: dict[str, tuple[int, Array]] = {}

    def at(self, time: float) -> Array:
        """All images side by side: those whose exposure was in its middle at `time` or before."""
        return np.concatenate([self._image(i, time) for i in range(len(self._names))], axis=1)

    def _image(self, camera: int, time: float) -> Array:
        name = self._names[camera]
        row = int(np.searchsorted(self._times[:, camera], time + 1e-6, side="right")) - 1
        if row < 0:
            return self._labelled(None, f"{name}: none yet")
        known = self._shown.get(name)
        if known is None or known[0] != row:
            images = self._cameras.at(int(self._indices[row]))
            seconds = self._times[row, camera]
            known = (row, self._drawn(images, name, seconds))
            self._shown[name] = known
        return known[1]

    def _drawn(self, images: LoggedImages, name: str, time: float) -> Array:
        frame = images.frame(name)
        if not images.has(name):
            state = "not recorded" if frame.state == "good" else frame.state
            return self._labelled(None, f"{name}  {state}")
        return self._labelled(images[name], f"{name}  {time:.3f} s  no. {frame.number}")

    @staticmethod
    def _labelled(image: Array | None, label: str) -> Array:
        from PIL import Image, ImageDraw, ImageFont

        # A square for each camera, whatever the shape of its images.
        drawn = Image.new("RGB", (SIZE, SIZE), (DARK, DARK, DARK))
        if image is not None:
            scale = SIZE / max(image.shape[:2])
            height, width = (round(length * scale) for length in image.shape[:2])
            scaled = Image.fromarray(image).resize((width, height), Image.Resampling.BILINEAR)
            drawn.paste(scaled, ((SIZE - width) // 2, (SIZE - height) // 2))
        brush = ImageDraw.Draw(drawn)
        font = ImageFont.load_default(16)
        box = brush.textbbox((8, 6), label, font=font)
        brush.rectangle((box[0] - 5, box[1] - 4, box[2] + 5, box[3] + 4), fill=(0, 0, 0))
        brush.text((8, 6), label, font=font, fill=(255, 255, 255))
        return np.asarray(drawn)


def frames(
    session: LoggedSession, begin: float | None = None, end: float | None = None
) -> Iterator[Array]:
    """Yields the pictures of the film, height x width x 3."""
    ends = steps_between(session, begin, end)[[0, -1]]
    rows = np.searchsorted(session.time_index, ends)
    start, stop = (session.times[rows] - session.times[0]).astype(np.int64) * 1e-9
    times = np.arange(start, stop + 1e-9, 1.0 / picture.FILM_RATE)
    cameras = LoggedCameras(session)
    strip = CameraStrip(cameras, session.times[0])
    plot = Plot(session, SIZE * len(cameras.names), PLOT_HEIGHT)
    for time in shown(times, "cameras.mp4", len(times)):
        yield np.concatenate([_of_height(strip.at(time)), plot.at(time)], axis=0)


def _of_height(image: Array) -> Array:
    # The format of films allows only even sizes.
    return image[: image.shape[0] // 2 * 2]


def camera_film(
    session: LoggedSession, output: Path, begin: float | None = None, end: float | None = None
) -> Path:
    """Writes cameras.mp4 into the folder `output`, at real speed; returns its path.

    With `begin` and `end`, times since the first step [s], only what is between them.
    """
    output.mkdir(parents=True, exist_ok=True)
    path = output / "cameras.mp4"
    picture.save_film(frames(session, begin, end), path, Fraction(picture.FILM_RATE))
    return path
