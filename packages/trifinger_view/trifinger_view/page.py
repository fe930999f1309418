# SPDX-License-Identifier: BSD-3-Clause
"""The page: the robot in 3D, its state in words, what cameras see, and curves.

A page knows neither sessions nor logs. It is told what to show and sends what has changed. It can
be used by all threads, but by one at a time. Other panels, such as those of a log or of a
controller, get `page.server` and add their own to it.
"""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from trifinger.log.plot.panels import COLOURS

from trifinger_view.curves import Window
from trifinger_view.frame import Frame
from trifinger_view.scene import Body, Scene, glb
from trifinger_view.words import Line

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from trifinger.arrays import Array

    from trifinger_view.authentication import Authentication

GHOST_ANGLE = 0.03  # difference from which the desired pose is shown [rad]
METRES_PER_NEWTON = 0.03  # length of the arrow of a force
MIN_FORCE = 0.05  # that is shown [N]
ARROW_COLOUR = (230, 60, 20)
AZIMUTH, ELEVATION = np.radians([115.0, 24.0])  # in which the camera looks at first, and down
FIELD_OF_VIEW = 0.66  # [rad]
IMAGE_WIDTH = 320  # of what cameras see [pixels]
PLOT_HEIGHT = 170  # [pixels]
BRAND = (0, 114, 178)
LEVELS = {"good": "#1a8f4c", "warning": "#b36b00", "bad": "#d02030"}
ENVIRONMENT = 0.35  # brightness of light from everywhere


def help_slow_browsers(authentication: Authentication, *, is_plain: bool) -> None:
    """Makes the page quicker in browsers without a graphics card; before the server starts.

    Unless the page is plain, they tell who looks at it how to make it so.
    """
    part = (Path(__file__).parent / "slow_browser.html").read_text(encoding="utf-8")
    authentication.add_to_page(part.replace("@IS_PLAIN@", str(is_plain).lower()))


class Page:
    """What a browser shows. `server` is a viser.ViserServer; see authentication.page_server."""

    def __init__(self, server: Any, title: str, *, is_plain: bool = False) -> None:
        """A plain page is drawn without lights and shadows, for browsers without a graphics card.

        Who looks at it can change that.
        """
        self.server = server
        server.gui.configure_theme(
            control_width="large",
            show_logo=False,
            show_share_button=False,
            brand_color=BRAND,
        )
        server.gui.main_panel.dock_right()
        server.gui.set_panel_label(title)
        self._state = server.gui.add_html("", order=0.0)
        self._shown_state = ""
        self.order = 1.0
        """Place in the panel for what other modules add, such as a time line."""
        self._images_folder: Any = None
        self._images: dict[str, Any] = {}
        self._plots_folder: Any = None
        self._plots: dict[str, Any] = {}
        self.scene = SceneView(server, is_plain)
        """The robot in 3D."""

    @property
    def is_watched(self) -> bool:
        """Whether a browser is connected."""
        return bool(self.server.get_clients())

    def begin(self, scene: Scene | None) -> None:
        """Shows another session: its scene, or none if it has no model. Curves start anew."""
        with self.server.atomic():
            self.scene.begin(scene)
            for handle in self._plots.values():
                handle.remove()
            self._plots.clear()

    def show(self, frame: Frame) -> None:
        """Shows a frame of the session in 3D."""
        with self.server.atomic():
            self.scene.show(frame)

    def show_state(self, lines: Sequence[Line]) -> None:
        """Shows the state in words."""
        rows = "".join(
            f'<tr><td style="opacity:0.6;padding-right:0.8em;vertical-align:top;'
            f'white-space:nowrap">{html.escape(line.label)}</td>'
            f'<td class="trifinger-{html.escape(line.label.replace(" ", "-"))}"'
            f"{_style(line.level)}>{html.escape(line.text)}</td></tr>"
            for line in lines
        )
        text = f'<table style="font-size:0.85em;margin:0.4em 0.8em">{rows}</table>'
        if text != self._shown_state:
            self._shown_state = self._state.content = text

    def show_images(self, images: Mapping[str, NDArray[np.uint8]]) -> None:
        """Shows what cameras see."""
        if images and self._images_folder is None:
            self._images_folder = self.server.gui.add_folder("Cameras", order=3.0)
        for name in [name for name in self._images if name not in images]:
            self._images.pop(name).remove()
        for name, image in images.items():
            small = smaller(image, IMAGE_WIDTH)
            if name in self._images:
                self._images[name].image = small
            else:
                with self._images_folder:
                    self._images[name] = self.server.gui.add_image(
                        small, label=name, format="jpeg", jpeg_quality=75
                    )

    def show_curves(self, window: Window) -> None:
        """Shows curves of the last seconds, a plot for each title."""
        times = window.times
        if len(times) < 2:
            return
        if self._plots_folder is None:
            self._plots_folder = self.server.gui.add_folder("Curves", order=4.0)
        with self.server.atomic():
            for title in [title for title in self._plots if title not in window.series]:
                self._plots.pop(title).remove()
            for title, rows in window.series.items():
                data = (times, *(np.ascontiguousarray(column) for column in rows.T))
                if title in self._plots and len(self._plots[title].data) == len(data):
                    self._plots[title].data = data
                    continue
                if title in self._plots:
                    self._plots.pop(title).remove()
                with self._plots_folder:
                    self._plots[title] = self.server.gui.add_uplot(
                        data,
                        _lines(rows.shape[1]),
                        title=title,
                        height=PLOT_HEIGHT,
                        legend={"show": False},
                        scales={"x": {"time": False}},
                        axes=({}, {"space": 18, "size": 56}),
                        padding=(4, 8, 0, 0),
                    )


class SceneView:
    """The robot, its objects, the desired pose and the forces at the tips in 3D."""

    def __init__(self, server: Any, is_plain: bool) -> None:
        self._server = server
        self.scene: Scene | None = None
        """What is shown; None without a model."""
        self._is_new = False
        self._bodies: list[_Node] = []
        self._ghosts: list[_Node] = []
        self._forces: Any = None
        self._surrounds: list[tuple[Any, bool]] = []  # with whether one can look through
        gui = server.gui
        with gui.add_folder("Show", order=2.0, expand_by_default=False):
            self._with_ghost = gui.add_checkbox("desired pose", True)
            self._with_forces = gui.add_checkbox("forces at the tips", True)
            self._with_wall = gui.add_checkbox("wall", True)
            self._with_frame = gui.add_checkbox("frame", False)
            self._is_plain = gui.add_checkbox(
                "plain drawing",
                is_plain,
                hint="Without lights and shadows: quicker in a browser without a graphics card",
            )
        self._with_wall.on_update(lambda _: self._show_surround())
        self._with_frame.on_update(lambda _: self._show_surround())
        self._shown_plain: bool | None = None
        self._shown_with: tuple[bool, ...] = ()

    @property
    def is_outdated(self) -> bool:
        """Whether somebody has chosen to see other things since the last frame was shown."""
        return self._shown_with != self._choices()

    def begin(self, scene: Scene | None) -> None:
        """Shows another scene in place of the one before."""
        self._light(self._is_plain.value)
        for node in (*self._bodies, *self._ghosts):
            node.remove()
        for handle, _ in self._surrounds:
            handle.remove()
        self._bodies, self._ghosts, self._surrounds = [], [], []
        self.scene = scene
        if scene is None:
            if self._forces is not None:
                self._forces.visible = False
            return
        start = zip(scene.bodies, *scene.poses(), strict=True)
        for number, (body, place, turn) in enumerate(start):
            self._add(number, body, place, turn)
        if scene.tip_names and self._forces is None:
            self._forces = self._server.scene.add_arrows(
                "/tip_forces",
                np.zeros((len(scene.tip_names), 2, 3), np.float32),
                ARROW_COLOUR,
                shaft_radius=0.0025,
                head_radius=0.006,
                head_length=0.012,
                visible=False,
            )
        self._is_new = True

    def show(self, frame: Frame) -> None:
        """Moves everything to where it is in a frame."""
        scene = self.scene
        if scene is None:
            return
        self._shown_with = self._choices()
        if self._is_plain.value != self._shown_plain:
            self.begin(scene)
        if self._is_new:
            self._is_new = False
            self._look(*scene.sphere(frame.position, frame.objects))
        places, turns = scene.poses(frame.position, frame.objects)
        for node, place, turn in zip(self._bodies, places, turns, strict=True):
            is_seen = not node.object or node.object in frame.objects
            node.move(place, turn, is_seen)
        desired = frame.desired
        is_apart = (
            desired is not None
            and frame.position is not None
            and bool(np.abs(desired - frame.position).max() > GHOST_ANGLE)
        )
        is_shown = is_apart and self._with_ghost.value
        if is_shown:
            places, turns = scene.poses(desired)
        for node in self._ghosts:
            node.move(places[node.number], turns[node.number], is_shown)
        self._show_forces(scene, frame)

    def _choices(self) -> tuple[bool, ...]:
        return (self._is_plain.value, self._with_ghost.value, self._with_forces.value)

    def _light(self, is_plain: bool) -> None:
        """Lets browsers compute light and shadows, or not."""
        if is_plain == self._shown_plain:
            return
        self._shown_plain = is_plain
        scene = self._server.scene
        scene.configure_default_lights(enabled=not is_plain, cast_shadow=not is_plain)
        light_around = None if is_plain else "warehouse"
        scene.configure_environment_map(light_around, environment_intensity=ENVIRONMENT)

    def _add(self, number: int, body: Body, place: Array, turn: Array) -> None:
        add = self._server.scene.add_glb
        light = turn if self._shown_plain else None
        solid = [mesh for mesh in body.meshes if not mesh.is_surround]
        around = [mesh for mesh in body.meshes if mesh.is_surround]
        handles = []
        pose: dict[str, Any] = {"position": place, "wxyz": turn}
        # Names of bodies can be anything; numbers cannot be taken for paths.
        if solid:
            handles.append(add(f"/robot/{number}", glb(solid, light), **pose))
        for kind, mesh in enumerate(around):
            handle = add(
                f"/around/{number}_{kind}",
                glb([mesh], light),
                cast_shadow=not mesh.is_transparent,
                receive_shadow=not mesh.is_transparent,
                visible=self._is_shown(mesh.is_transparent),
                **pose,
            )
            self._surrounds.append((handle, mesh.is_transparent))
        self._bodies.append(_Node(number, body.object, handles, place, turn))
        ghost = body.ghost()
        if ghost is not None and body.is_moving and not body.object:
            handle = add(
                f"/desired/{number}",
                glb([ghost], light),
                cast_shadow=False,
                receive_shadow=False,
                visible=False,
                **pose,
            )
            self._ghosts.append(_Node(number, "", [handle], place, turn, is_seen=False))

    def _show_forces(self, scene: Scene, frame: Frame) -> None:
        if self._forces is None:
            return
        force = frame.tip_force
        if force is None or len(force) != len(scene.tip_names) or not self._with_forces.value:
            is_shown = False
        else:
            is_shown = bool(np.any(force > MIN_FORCE))
        if is_shown and force is not None:
            tips, directions = scene.tips(frame.position)
            lengths = METRES_PER_NEWTON * np.where(force > MIN_FORCE, force, 0.0)
            # An arrow of no length has no direction.
            ends = tips + np.maximum(lengths, 1e-6)[:, None] * directions
            self._forces.points = np.stack([tips, ends], axis=1).astype(np.float32)
        if self._forces.visible != is_shown:
            self._forces.visible = is_shown

    def _show_surround(self) -> None:
        for handle, is_transparent in self._surrounds:
            handle.visible = self._is_shown(is_transparent)

    def _is_shown(self, is_transparent: bool) -> bool:
        """Whether a part of the surroundings is shown: of the wall, or of the opaque frame."""
        return bool((self._with_wall if is_transparent else self._with_frame).value)

    def _look(self, middle: Array, radius: float) -> None:
        """Places the cameras of new browsers so that a sphere fills the picture."""
        distance = radius / np.sin(FIELD_OF_VIEW / 2)
        level = np.cos(ELEVATION)
        back = np.array([-level * np.cos(AZIMUTH), -level * np.sin(AZIMUTH), np.sin(ELEVATION)])
        camera = self._server.initial_camera
        camera.position, camera.look_at = tuple(middle + distance * back), tuple(middle)
        camera.fov = FIELD_OF_VIEW
        camera.near, camera.far = radius / 50, radius * 50


class _Node:
    """Something in the scene that is sent only if it has moved."""

    def __init__(
        self,
        number: int,
        object_name: str,
        handles: list[Any],
        place: Array,
        turn: Array,
        is_seen: bool = True,
    ) -> None:
        self.number, self.object = number, object_name
        self._handles = handles
        self._place, self._turn, self._is_seen = place, turn, is_seen

    def move(self, place: Array, turn: Array, is_seen: bool) -> None:
        if is_seen != self._is_seen:
            self._is_seen = is_seen
            for handle in self._handles:
                handle.visible = is_seen
        if not is_seen:
            return
        if not np.array_equal(place, self._place):
            self._place = place
            for handle in self._handles:
                handle.position = place
        if not np.array_equal(turn, self._turn):
            self._turn = turn
            for handle in self._handles:
                handle.wxyz = turn

    def remove(self) -> None:
        for handle in self._handles:
            handle.remove()


def smaller(image: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    """The image with at most `width` columns; each pixel is the mean of a square."""
    factor = -(-image.shape[1] // width)
    if factor <= 1:
        return image
    rows, columns = image.shape[0] // factor, image.shape[1] // factor
    part = image[: rows * factor, : columns * factor]
    squares = part.reshape(rows, factor, columns, factor, -1)
    return np.asarray(squares.mean(axis=(1, 3)), np.uint8)


def _style(level: str) -> str:
    return f' style="color:{LEVELS[level]};font-weight:600"' if level in LEVELS else ""


def _lines(count: int) -> tuple[Any, ...]:
    """How the lines of a plot look: fingers, or other threes, share a colour."""
    group = 3 if count % 3 == 0 and count > 3 else 1
    lines: list[dict[str, Any]] = [{"label": "time [s]"}]
    for number in range(count):
        dash = ([], [6, 3], [2, 2])[number % 3] if group == 3 else []
        lines.append(
            {
                "label": f"{number}",
                "stroke": COLOURS[(number // group) % len(COLOURS)],
                "width": 1.2,
                "dash": dash,
                "points": {"show": False},
            }
        )
    return tuple(lines)
