# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a scene and films of pictures, without a screen."""

from __future__ import annotations

import argparse
import contextlib
import itertools
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trifinger import extras
from trifinger.errors import Error, InvalidArgument

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[Any]


DRAWING_PACKAGES = ("libegl1", "libgl1-mesa-dri", "libopengl0")  # of Debian, without a screen
FILM_RATE = 30  # of films that leave out images [images/s]
MARK_RADIUS = 0.01  # [m]
MARK_COLOUR = (0.95, 0.75, 0.1, 1.0)


# Azimuth and elevation of views that every model has [degrees]: between two fingers, from above.
CAMERAS = {"front": (90.0, -20.0), "side": (210.0, -20.0), "top": (90.0, -89.9)}
LARGEST = 4096  # [pixels]
MARGIN = 1.06  # of the picture around robot and objects
TABLE = ((0.1, 0.1, 0.0), (0.1, -0.1, 0.0), (-0.1, 0.1, 0.0), (-0.1, -0.1, 0.0))  # always seen [m]
STEEP = 60.0  # [degrees]
BEHIND = 0.05  # how much farther than the middle what is drawn of frame and wall is [m]
SURROUND_GROUP = 1  # of MuJoCo's shapes: frame and wall


@dataclass(frozen=True)
class View:
    """From where a scene is seen, and how large the picture is.

    `camera` is "front", "side" or "top", or azimuth and elevation in degrees, as in "120,-15": then
    robot and objects fill the picture, and parts of frame and wall that would hide them are not
    drawn. Or it is a camera of the model, such as "camera60", which sees what it sees.
    """

    camera: str = "front"
    width: int = 720  # [pixels]
    height: int = 540

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            if not 16 <= getattr(self, name) <= LARGEST:
                raise InvalidArgument(
                    f"the {name} of a picture is {getattr(self, name)} pixels, must be from 16 to "
                    f"{LARGEST}"
                )


def add_view_options(parser: argparse.ArgumentParser, default: View | None = None) -> None:
    """Gives a command --camera, --width and --height; `view_of` reads them."""
    view = default or View()
    parser.add_argument(
        "--camera",
        default=view.camera,
        metavar="NAME|AZIMUTH,ELEVATION",
        help=f"{', '.join(CAMERAS)}, a camera of the model such as camera60, or two angles in "
        f"degrees; default: {view.camera}",
    )
    for name in ("width", "height"):
        parser.add_argument(
            f"--{name}",
            type=int,
            default=getattr(view, name),
            metavar="PIXELS",
            help=f"of pictures; default: {getattr(view, name)}",
        )


def view_of(arguments: argparse.Namespace) -> View:
    """What `add_view_options` asked for; raises InvalidArgument."""
    return View(arguments.camera, arguments.width, arguments.height)


class Sight:
    """What a camera sees of a model, a MuJoCo model for pictures."""

    def __init__(self, model: Any, view: View) -> None:
        """Places the camera; raises InvalidArgument if the model does not have it."""
        import mujoco

        self._mujoco, self._model = mujoco, model
        self._surround = np.flatnonzero(model.geom_group == SURROUND_GROUP)
        self._opacity = model.geom_rgba[self._surround, 3].copy()
        self.camera = mujoco.MjvCamera()
        mujoco.mjv_defaultFreeCamera(model, self.camera)
        angles = CAMERAS.get(view.camera) or _angles(view.camera)
        if angles is not None:
            self.camera.azimuth, self.camera.elevation = angles
            self._fill(view.width / view.height)
            return
        self.camera.fixedcamid = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, view.camera)
        self.camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        if self.camera.fixedcamid < 0:
            names = [*CAMERAS, *(model.camera(i).name for i in range(model.ncam))]
            raise InvalidArgument(
                f"there is no camera '{view.camera}', only {', '.join(names)}; or give azimuth and "
                'elevation in degrees, as in "120,-15"'
            )

    def clear(self, data: Any, camera: Any = None) -> None:
        """Lets the model show of frame and wall only what does not stand before the scene.

        That is what is farther than the middle of the scene: over the ground, or along the view
        if that is steep.
        """
        camera = camera or self.camera
        opacity = self._opacity
        if camera.type == self._mujoco.mjtCamera.mjCAMERA_FREE:
            forward = _axes(camera)[2]
            if abs(camera.elevation) < STEEP:
                forward[2] = 0.0
            depth = (data.geom_xpos[self._surround] - camera.lookat) @ forward
            opacity = np.where(depth > BEHIND, opacity, 0.0)
        self._model.geom_rgba[self._surround, 3] = opacity

    def _fill(self, aspect: float) -> None:
        """Moves the camera to where robot, objects and the table's middle just fit in."""
        axes = _axes(self.camera)
        points = np.concatenate([self._corners(), TABLE]) @ axes.T
        slope = np.tan(np.radians(self._model.vis.global_.fovy) / 2) / MARGIN
        # In the frame of the camera a point is in sight if |x - place| <= slope * (z - camera z).
        places, depths = [], []
        for column, half in ((points[:, 0], slope * aspect), (points[:, 1], slope)):
            high = np.max(column - half * points[:, 2])
            low = np.min(column + half * points[:, 2])
            places.append((high + low) / 2)
            depths.append((low - high) / (2 * half))
        middle = (points[:, 2].min() + points[:, 2].max()) / 2
        self.camera.lookat[:] = np.array([*places, middle]) @ axes
        self.camera.distance = middle - min(depths)

    def _corners(self) -> Array:
        """Of boxes around all shapes of robot and objects where an episode begins."""
        model, data = self._model, self._mujoco.MjData(self._model)
        if model.nkey:
            data.qpos[:] = model.key_qpos[0]
        self._mujoco.mj_forward(model, data)
        shown = np.flatnonzero((model.geom_bodyid > 0) & (model.geom_group == 0))
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        boxes = model.geom_aabb[shown]
        corners = boxes[:, None, :3] + boxes[:, None, 3:] * signs
        turns = data.geom_xmat[shown].reshape(-1, 3, 3)
        world = np.einsum("gij,gcj->gci", turns, corners) + data.geom_xpos[shown][:, None]
        return np.asarray(world.reshape(-1, 3))


def _angles(text: str) -> tuple[float, float] | None:
    try:
        azimuth, elevation = map(float, text.split(","))
    except ValueError:
        return None
    if not (np.isfinite(azimuth) and -90 <= elevation <= 90):
        raise InvalidArgument(f"the elevation in '{text}' must be from -90 to 90 degrees")
    return azimuth, elevation


def _axes(camera: Any) -> Array:
    """Rows: to the right, up and forward, in the world."""
    azimuth, elevation = np.radians([camera.azimuth, camera.elevation])
    level = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    forward = np.cos(elevation) * level + [0.0, 0.0, np.sin(elevation)]
    right = np.array([level[1], -level[0], 0.0])
    return np.stack([right, np.cross(right, forward), forward])


class Painter:
    """Draws a model in any configuration."""

    def __init__(self, mjcf: str, is_plain: bool = False, view: View | None = None) -> None:
        """Plain pictures have neither shadows nor smooth edges, and take a tenth of the time.

        Raises InvalidArgument if the model does not have the camera of `view`, Error with what to
        install if this machine cannot draw.
        """
        with explained():
            import mujoco
            from mujoco.rendering.classic.renderer import Renderer

        self._mujoco = mujoco
        self._model = mujoco.MjModel.from_xml_string(mjcf)
        view = view or View()
        self.size = (view.width, view.height)
        self._model.vis.global_.offwidth, self._model.vis.global_.offheight = self.size
        if is_plain:
            self._model.vis.quality.offsamples = 0
        self._data = mujoco.MjData(self._model)
        self._sight = Sight(self._model, view)
        with explained():
            self._renderer = Renderer(self._model, width=view.width, height=view.height)
        if is_plain:
            for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
                self._renderer.scene.flags[flag] = False

    def draw(self, configuration: ArrayLike, marks: ArrayLike = ()) -> Array:
        """The scene at joints and objects as MuJoCo's qpos begins: height x width x 3.

        `marks` are centres of balls to draw on top, as goals are: a row x, y, z for each [m].
        """
        mujoco = self._mujoco
        self._data.qpos[:] = np.asarray(configuration)[: self._model.nq]
        mujoco.mj_normalizeQuat(self._model, self._data.qpos)
        mujoco.mj_forward(self._model, self._data)
        self._sight.clear(self._data)
        self._renderer.update_scene(self._data, self._sight.camera)
        draw_marks(self._renderer.scene, marks, keep=self._renderer.scene.ngeom)
        pixels: Array = self._renderer.render()
        return pixels

    def close(self) -> None:
        """Gives the memory of the pictures back."""
        self._renderer.close()


@contextlib.contextmanager
def explained() -> Iterator[None]:
    """Says what to install if MuJoCo cannot be made to draw, without a screen if not told else.

    Importing MuJoCo belongs to it: that loads the libraries that MUJOCO_GL names.
    """
    platform = os.environ.setdefault("MUJOCO_GL", "egl")
    extras.require("film", "OpenGL")
    try:
        yield
    # Whatever PyOpenGL and drivers raise where a library is missing: even an AttributeError.
    except Exception as error:
        remedy = f"apt-get install {' '.join(DRAWING_PACKAGES)}" if platform == "egl" else ""
        remedy = remedy or "unset it, and nothing needs a screen"
        raise Error(f"MuJoCo cannot draw with MUJOCO_GL={platform}: {remedy} ({error})") from error


def draw_marks(scene: Any, marks: ArrayLike, keep: int = 0) -> None:
    """Adds a ball for each mark, a row x, y, z [m], behind the first `keep` shapes of a scene."""
    import mujoco

    scene.ngeom = keep
    for mark in np.reshape(np.asarray(marks, float), (-1, 3))[: scene.maxgeom - keep]:
        mujoco.mjv_initGeom(
            scene.geoms[scene.ngeom],
            mujoco.mjtGeom.mjGEOM_SPHERE,
            np.full(3, MARK_RADIUS),
            mark,
            np.eye(3).ravel(),
            np.array(MARK_COLOUR, np.float32),
        )
        scene.ngeom += 1


def save_film(images: Iterable[Array], path: Path, rate: int | Fraction) -> None:
    """A film of images, height x width x 3, at some rate [images/s]."""
    extras.require("film", "av")
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=rate)
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": "23", "preset": "veryfast"}
        for number, picture in enumerate(images):
            # The format has no odd sizes: those lose a row or a column.
            even = picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2]
            image = np.ascontiguousarray(even)
            if number == 0:
                stream.height, stream.width = image.shape[:2]
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode())
