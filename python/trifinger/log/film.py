# SPDX-License-Identifier: BSD-3-Clause
"""A session as a film, and as a strip of its pictures.

The scene is drawn only from the log: joints as measured, objects as seen. Measured poses of objects
are noisy, so each is the mean of several.
"""

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from trifinger import picture
from trifinger._trifinger import LoggedSession
from trifinger.arrays import Array
from trifinger.errors import InvalidArgument
from trifinger.log.manipulation import Trace, save_report
from trifinger.picture import Painter, View
from trifinger.progress import shown

STRIP_IMAGES = 8
SMOOTHING = 5  # poses of an object in a mean


class Scene:
    """Draws the scene of a log at any step."""

    def __init__(
        self, session: LoggedSession, is_plain: bool = False, view: View | None = None
    ) -> None:
        """Plain pictures lack shadows and smooth edges; drawing them takes a tenth of the time."""
        if "model.xml" not in session.documents:
            raise InvalidArgument(f"'{session.name}' has no model in its log to draw")
        self._painter = Painter(session.documents["model.xml"], is_plain, view)
        self.size = self._painter.size
        self._time_index = session.time_index
        self._joints = session.observations["position"]
        self._times, self._objects = object_poses(session)

    def image(self, step: int) -> Array:
        """The scene at a step: height x width x 3."""
        objects = [np.interp(step, self._times, column) for column in self._objects.T]
        row = min(int(np.searchsorted(self._time_index, step)), len(self._joints) - 1)
        return self._painter.draw([*self._joints[row], *objects])

    def close(self) -> None:
        """Releases the memory for drawing."""
        self._painter.close()


def object_poses(session: LoggedSession) -> tuple[Array, Array]:
    """The steps at which objects were seen, and a row of positions and quaternions per step."""
    elements = session.companion("object").observations
    names = [name for name in elements.dtype.names or () if name != "stamp"]
    columns = [
        np.asarray(elements[name][part]) for name in names for part in ("position", "orientation")
    ]
    poses = np.concatenate(columns, axis=1)
    for first in range(3, poses.shape[1], 7):
        # A quaternion and its negative are the same rotation, but have no mean.
        part = poses[:, first : first + 4]
        turns = np.sign(np.einsum("ij,ij->i", part[1:], part[:-1]))
        part[1:] *= np.cumprod(np.where(turns == 0, 1, turns))[:, None]
    padded = np.pad(poses, ((SMOOTHING // 2, SMOOTHING // 2), (0, 0)), mode="edge")
    kernel = np.ones(SMOOTHING) / SMOOTHING
    smooth = np.stack([np.convolve(column, kernel, "valid") for column in padded.T], axis=1)
    return np.asarray(elements["stamp"]["capture_index"]), smooth


def save_film(scene: Scene, session: LoggedSession, path: Path) -> None:
    """Writes a film at real speed."""
    every = max(round(1.0 / (picture.FILM_RATE * session.period)), 1)
    steps = range(int(session.time_index[0]), int(session.time_index[-1]) + 1, every)
    images = (scene.image(step) for step in shown(steps, path.name, len(steps)))
    picture.save_film(images, path, picture.FILM_RATE)


def save_strip(scene: Scene, session: LoggedSession, steps: Sequence[int], path: Path) -> None:
    """Saves pictures of some steps in two rows, each with its time."""
    from matplotlib.figure import Figure

    columns = (len(steps) + 1) // 2
    aspect = scene.size[1] / scene.size[0]
    figure = Figure(figsize=(3.0 * columns, 2 * 3.0 * aspect), layout="constrained")
    # Matplotlib's stubs do not know that "constrained" makes an engine with these arguments.
    figure.get_layout_engine().set(w_pad=0.02, h_pad=0.02, wspace=0.0, hspace=0.0)  # type: ignore[union-attr,call-arg]
    for number, step in enumerate(shown(steps, path.name, len(steps))):
        axes = figure.add_subplot(2, columns, number + 1)
        axes.imshow(scene.image(step))
        axes.axis("off")
        label: dict[str, Any] = {"facecolor": "black", "alpha": 0.55, "edgecolor": "none", "pad": 3}
        axes.text(
            0.03,
            0.95,
            f"{step * session.period:.1f} s",
            transform=axes.transAxes,
            va="top",
            color="white",
            fontsize=10,
            bbox=label,
        )
    figure.savefig(path, dpi=110)


def film(
    session: LoggedSession,
    output: Path,
    trace: Trace | None = None,
    view: View | None = None,
) -> Iterator[Path]:
    """Draws a session into the folder `output` and yields the path of each file.

    The files are film.mp4 and strip.png. With the `trace` of a manipulation in this session there
    is report.png as well.
    """
    if not len(session.time_index):
        raise InvalidArgument(f"there are no steps of '{session.name}' to draw")
    output.mkdir(parents=True, exist_ok=True)
    path = output / "film.mp4"
    with contextlib.closing(Scene(session, is_plain=True, view=view)) as scene:
        save_film(scene, session, path)
    yield path
    first, last = int(session.time_index[0]), int(session.time_index[-1])
    if trace:
        steps = [min(step, last) for step in trace.steps(STRIP_IMAGES)]
    else:
        steps = np.linspace(first, last, STRIP_IMAGES).astype(int).tolist()
    path = output / "strip.png"
    with contextlib.closing(Scene(session, view=view)) as scene:
        save_strip(scene, session, steps, path)
    yield path
    if trace:
        path = output / "report.png"
        save_report(trace, path)
        yield path
