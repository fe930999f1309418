# SPDX-License-Identifier: BSD-3-Clause
"""The page: the robot in 3D, its state in words, what cameras see, and curves.

A page knows neither sessions nor logs. It is told what to show and sends what has changed. It can
be used by all threads, but by one at a time. Others, such as the panel of a controller, send their
own messages by `page.server`.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from trifinger_view.curves import Window
from trifinger_view.frame import Frame
from trifinger_view.page_server import PageServer
from trifinger_view.scene import Mesh, Scene
from trifinger_view.to_browser import Document, Numbers, document, jpeg, message, placed, session_of
from trifinger_view.words import Line

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from trifinger.arrays import Array

    Moment = tuple[Array | None, Mapping[str, Array]]

IMAGE_WIDTH = 320  # of what cameras see [pixels]


def document_of(title: str, *, robot: str = "", is_plain: bool = False) -> Document:
    """What a server of pages serves; with the name of a robot, it has a stop for this robot."""
    scripts = [("scene.js", "page.js", "served.js"), *([("stop.js",)] if robot else [])]
    return document(*scripts, TITLE=title, ROBOT=robot, PARTS="plain" if is_plain else "")


class Page:
    """What the browsers of a server show."""

    def __init__(self, server: PageServer, put: Callable[[str, bytes], None] | None = None) -> None:
        """Sends messages to the browsers of a server, or gives them to `put` in its place."""
        self.server = server
        """Sends what it is told to the browsers."""
        self._put = put
        self._scene: Scene | None = None
        self._session = 0
        self._id = secrets.token_hex(8)
        self._told: dict[str, Any] = {}
        self._moments: list[Moment] = []
        self._ink: tuple[Array, Mesh] | None = None
        self._is_new = False
        self._lines: Sequence[Line] = ()
        self._sent: dict[str, bytes] = {}  # the newest message of each kind
        self._images: Mapping[str, NDArray[np.uint8]] = {}

    def begin(
        self,
        scene: Scene | None,
        title: str,
        facts: str = "",
        *,
        moments: Iterable[Moment] = (),
        ink: tuple[Array, Mesh] | None = None,
        **told: Any,
    ) -> None:
        """Shows another session: its scene, or none if it has no model.

        The camera has room for all of some moments of it. Without them it has room for the first
        frame, and goes after the robot. `told` is more that the page must know.
        """
        self._scene, self._session = scene, self._session + 1
        self._moments, self._ink = list(moments), ink
        self._told = {"title": title, "facts": facts, "follows": not self._moments, **told}
        self._told["server"] = self._id
        self._is_new = scene is not None
        if scene is None:
            self._send("session", bodies=[], **self._told)

    def show(self, frame: Frame) -> None:
        """Shows a frame of the session in 3D."""
        scene = self._scene
        if scene is None:
            return
        if self._is_new:
            self._is_new = False
            numbers = Numbers()
            moments = self._moments or [(frame.position, frame.objects)]
            more = {"hasGhost": True, "hasForces": bool(scene.tip_names)}
            told = session_of(scene, numbers, moments, self._ink)
            self._send("session", numbers, **told, **more, **self._told)
        here = placed(scene, frame.position, frame.desired, frame.objects, frame.tip_force)
        numbers = Numbers()
        self._send(
            "frame",
            numbers,
            step=frame.time_index,
            poses=numbers.add(here.poses, "<f4"),
            ghosts=None if here.ghosts is None else numbers.add(here.ghosts, "<f4"),
            forces=numbers.add(here.forces, "<f4"),
        )

    def show_state(self, lines: Sequence[Line]) -> None:
        """Shows the state in words."""
        if lines != self._lines:
            self._lines = list(lines)
            self._send("state", lines=[asdict(line) for line in lines])

    def show_images(self, images: Mapping[str, NDArray[np.uint8]]) -> None:
        """Shows what cameras see."""
        if not images and not self._images:
            return
        self._images = images
        numbers = Numbers()
        files = [
            (name, numbers.add_file(jpeg(image, IMAGE_WIDTH))) for name, image in images.items()
        ]
        self._send("images", numbers, images=files)

    def show_curves(self, window: Window, groups: Sequence[str] = ()) -> None:
        """Shows curves of the last seconds, a plot for each title.

        `groups` are names of parts of a robot, such as fingers; of each the plots have as many
        lines.
        """
        times, numbers = window.times, Numbers()
        if len(times) < 2:
            return
        plots = []
        for title, rows in window.series.items():
            size = max(rows.shape[1] // max(len(groups), 1), 1)
            is_grouped = bool(groups) and rows.shape[1] == size * len(groups)
            lines = [
                {
                    "values": numbers.add(column, "<f4"),
                    "group": number // size if is_grouped else None,
                    "number": number % size if is_grouped else number,
                    "isDesired": False,
                }
                for number, column in enumerate(rows.T)
            ]
            plots.append({"title": title, "lines": lines})
        self._send(
            "curves",
            numbers,
            times=numbers.add(times, "<f8"),
            begin=times[0],
            end=times[-1],
            plots=plots,
            groups=groups,
        )

    def _send(self, kind: str, numbers: Numbers | None = None, **told: Any) -> None:
        sent = message(kind, numbers, session=self._session, **told)
        if sent != self._sent.get(kind):
            self._sent[kind] = sent
            (self._put or self.server.put)(kind, sent)
