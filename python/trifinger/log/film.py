# SPDX-License-Identifier: BSD-3-Clause
"""A session as a film, and as a strip of its pictures.

The scene is drawn only from the log: joints as measured, objects as seen.
"""

import contextlib
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from trifinger import picture
from trifinger._trifinger import LoggedSession
from trifinger.arrays import Array
from trifinger.element_text import positions_field
from trifinger.errors import InvalidArgument
from trifinger.log.manipulation import Trace, save_report
from trifinger.log.objects import object_poses, written
from trifinger.log.steps import steps_between
from trifinger.picture import Painter, View
from trifinger.progress import shown
from trifinger.whole_file import whole_file

STRIP_IMAGES = 8


class Scene:
    """Draws the scene of a log."""

    def __init__(
        self,
        session: LoggedSession,
        view: View | None = None,
        begin: float | None = None,
        end: float | None = None,
    ) -> None:
        """The camera sees all that moves between two times since the first step [s].

        Raises InvalidArgument if there is nothing to draw.
        """
        if "model.xml" not in session.documents:
            raise InvalidArgument(f"'{session.name}' has no model in its log to draw")
        self._painter = Painter(session.documents["model.xml"], view)
        self.size = self._painter.size
        self._time_index = session.time_index
        observations = session.observations
        self._joints = observations[positions_field(observations.dtype.names or ())]
        has_objects = any(companion.name.endswith(".object") for companion in session.companions)
        self._times: Array = np.empty(0)
        self._objects: dict[str, Array] = {}
        if has_objects:
            self._times, self._objects = object_poses(session)
        steps = steps_between(session, begin, end)
        every = max(round(1.0 / (picture.FILM_RATE * session.period)), 1)
        self.steps = np.arange(steps[0], steps[-1] + 1, every)
        """Steps of the pictures of a film."""
        self.rate = Fraction(1.0 / (every * session.period)).limit_denominator(1000)
        """Pictures in a second at real speed."""
        self._ends, self._ink = written(self._painter.model, self._times, self._objects)
        self._places = self._painter.path([self._configuration(step) for step in self.steps])

    def image(self, step: int) -> Array:
        """The scene at a step: height x width x 3."""
        place = [np.interp(step, self.steps, column) for column in self._places.T]
        ink = self._ink[self._ends <= step]
        return self._painter.draw(self._configuration(step), place=place, ink=ink)

    def _configuration(self, step: int) -> Array:
        objects = {
            name: np.array([np.interp(step, self._times, column) for column in poses.T])
            for name, poses in self._objects.items()
        }
        row = min(int(np.searchsorted(self._time_index, step)), len(self._joints) - 1)
        return self._painter.placement.qpos(self._joints[row], objects)

    def close(self) -> None:
        """Releases the memory for drawing."""
        self._painter.close()


def save_film(scene: Scene, path: Path) -> None:
    """Writes a film at real speed."""
    images = (scene.image(step) for step in shown(scene.steps, path.name, len(scene.steps)))
    picture.save_film(images, path, scene.rate)


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
    with whole_file(path) as part:
        figure.savefig(part, dpi=110)


def film(
    session: LoggedSession,
    output: Path,
    trace: Trace | None = None,
    view: View | None = None,
    begin: float | None = None,
    end: float | None = None,
) -> Iterator[Path]:
    """Draws a session, or what is between two times since its first step [s].

    Yields the path of each file: film.mp4 and strip.png in the folder `output`. With the `trace` of
    a manipulation in this session there is report.png as well.
    """
    with contextlib.closing(Scene(session, view, begin, end)) as scene:
        output.mkdir(parents=True, exist_ok=True)
        path = output / "film.mp4"
        save_film(scene, path)
        yield path
        first, last = int(scene.steps[0]), int(scene.steps[-1])
        steps = trace.steps(STRIP_IMAGES) if trace else []
        steps = [step for step in steps if first <= step <= last]
        steps = steps or np.linspace(first, last, STRIP_IMAGES).astype(int).tolist()
        path = output / "strip.png"
        save_strip(scene, session, steps, path)
        yield path
    if trace:
        path = output / "report.png"
        save_report(trace, path)
        yield path
