# SPDX-License-Identifier: BSD-3-Clause
"""Draws pictures of a scene and writes films of pictures, without a screen."""

from __future__ import annotations

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
from trifinger.arrays import Array
from trifinger.errors import Error, InvalidArgument
from trifinger.foreign_models import model_of
from trifinger.placement import Placement
from trifinger.whole_file import whole_file

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


DRAWING_PACKAGES = ("libegl1", "libgl1-mesa-dri", "libopengl0")  # on Debian, without a screen
FILM_RATE = 30  # rate of films that skip steps [images/s]
MARK_RADIUS = 0.01  # [m]
MARK_COLOUR = (0.95, 0.75, 0.1, 1.0)


# Azimuth and elevation of views for every model [degrees]: between two fingers, or from above.
CAMERAS = {"front": (90.0, -20.0), "side": (210.0, -20.0), "top": (90.0, -89.9)}
LARGEST = 4096  # largest width and height [pixels]
MARGIN = 1.06  # size of the picture, relative to that of robot and objects in it
TABLE = ((0.1, 0.1, 0.0), (0.1, -0.1, 0.0), (-0.1, 0.1, 0.0), (-0.1, -0.1, 0.0))  # always seen [m]
STEEP = 60.0  # elevation from which a view is steep [degrees]
BEHIND = 0.05  # parts of frame and wall are drawn if they are this far behind the middle [m]
SURROUND_GROUP = 1  # MuJoCo's group of the shapes of frame and wall
LOOKS_GROUP = 2  # and of those that only look


@dataclass(frozen=True)
class View:
    """The camera of a picture, and the size of the picture.

    `camera` is "front", "side" or "top", or azimuth and elevation in degrees, as in "120,-15". With
    these, robot and objects fill the picture, and parts of frame and wall that would hide them are
    not drawn. `camera` can also be a camera of the model, such as "camera60", which draws all.
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


class SceneCamera:
    """A camera that looks at a MuJoCo model."""

    def __init__(self, model: Any, view: View) -> None:
        """Places the camera of `view`; raises InvalidArgument if there is no such camera."""
        import mujoco

        self._mujoco, self._model = mujoco, model
        self._aspect = view.width / view.height
        moving = model.geom_bodyid > 0
        self._shapes = np.flatnonzero(moving & (model.geom_group == 0))
        self.is_of_ours = len(self._shapes) > 0
        """False for the model of a robot from a file, which only has shapes that look."""
        if not self.is_of_ours:
            self._shapes = np.flatnonzero(moving & (model.geom_group == LOOKS_GROUP))
        self._surround = np.flatnonzero(model.geom_group == SURROUND_GROUP)
        self._opacity = model.geom_rgba[self._surround, 3].copy()
        self.camera = mujoco.MjvCamera()
        mujoco.mjv_defaultFreeCamera(model, self.camera)
        angles = CAMERAS.get(view.camera) or _angles(view.camera)
        if angles is not None:
            self.camera.azimuth, self.camera.elevation = angles
            self.fill()
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
        """Hides the parts of frame and wall that stand in front of the scene.

        Only parts that are farther away than the middle of the scene stay visible. The distance is
        measured over the ground, or along the view if the view is steep. Cameras of the model show
        all parts.
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

    def fill(self, configurations: Iterable[ArrayLike] = ()) -> None:
        """Moves the camera so that robot and objects just fill the picture.

        They are seen in the start pose, or in each of these configurations, MuJoCo's `qpos`. Of our
        own scenes, the middle of the table is always seen. A camera of the model stays.
        """
        if self.camera.type != self._mujoco.mjtCamera.mjCAMERA_FREE:
            return
        axes = _axes(self.camera)
        model = self._model
        start = model.key_qpos[0] if model.nkey else model.qpos0
        corners = [self._corners(qpos) for qpos in (*configurations,) or (start,)]
        if self.is_of_ours or not len(self._shapes):
            corners.append(np.array(TABLE))
        points = np.concatenate(corners) @ axes.T
        slope = np.tan(np.radians(model.vis.global_.fovy) / 2) / MARGIN
        # In the frame of the camera, a point is in view if |x - place| <= slope * (z - camera z).
        places, depths = [], []
        for column, half in ((points[:, 0], slope * self._aspect), (points[:, 1], slope)):
            high = np.max(column - half * points[:, 2])
            low = np.min(column + half * points[:, 2])
            places.append((high + low) / 2)
            depths.append((low - high) / (2 * half))
        middle = (points[:, 2].min() + points[:, 2].max()) / 2
        self.camera.lookat[:] = np.array([*places, middle]) @ axes
        self.camera.distance = middle - min(depths)

    def _corners(self, qpos: ArrayLike) -> Array:
        """Corners of boxes around all shapes of robot and objects in a configuration."""
        model, data = self._model, self._mujoco.MjData(self._model)
        data.qpos[:] = qpos
        self._mujoco.mj_forward(model, data)
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        boxes = model.geom_aabb[self._shapes]
        corners = boxes[:, None, :3] + boxes[:, None, 3:] * signs
        turns = data.geom_xmat[self._shapes].reshape(-1, 3, 3)
        world = np.einsum("gij,gcj->gci", turns, corners) + data.geom_xpos[self._shapes][:, None]
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
    """The camera's axes in the world frame, as rows: right, up and forward."""
    azimuth, elevation = np.radians([camera.azimuth, camera.elevation])
    level = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    forward = np.cos(elevation) * level + [0.0, 0.0, np.sin(elevation)]
    right = np.array([level[1], -level[0], 0.0])
    return np.stack([right, np.cross(right, forward), forward])


class Painter:
    """Draws a model in any configuration."""

    def __init__(self, mjcf: str, is_plain: bool = False, view: View | None = None) -> None:
        """Plain pictures lack shadows and smooth edges; drawing them takes a tenth of the time.

        Raises InvalidArgument if the model does not have the camera of `view`. Raises Error, which
        says what to install, if this machine cannot draw.
        """
        with explained():
            import mujoco
            from mujoco.rendering.classic.renderer import Renderer

        self._mujoco = mujoco
        self._model = model_of(mjcf)
        view = view or View()
        self.size = (view.width, view.height)
        self._model.vis.global_.offwidth, self._model.vis.global_.offheight = self.size
        if is_plain:
            self._model.vis.quality.offsamples = 0
        self._data = mujoco.MjData(self._model)
        self.placement = Placement(self._model)
        self._scene_camera = SceneCamera(self._model, view)
        with explained():
            self._renderer = Renderer(self._model, width=view.width, height=view.height)
        if is_plain:
            for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
                self._renderer.scene.flags[flag] = False

    def look_at(self, configurations: Iterable[ArrayLike]) -> None:
        """Moves the camera so that a robot from a file fills the picture in all of these.

        Our own robots are seen in their start pose: they stay on their table.
        """
        if not self._scene_camera.is_of_ours:
            self._scene_camera.fill(configurations)

    def draw(self, configuration: ArrayLike, marks: ArrayLike = ()) -> Array:
        """The scene as an image, height x width x 3.

        `configuration` begins with MuJoCo's qpos, as `placement` makes it. `marks` are the centres
        of balls that show goals: a row x, y, z for each [m].
        """
        mujoco = self._mujoco
        self._data.qpos[:] = np.asarray(configuration)[: self._model.nq]
        mujoco.mj_normalizeQuat(self._model, self._data.qpos)
        mujoco.mj_forward(self._model, self._data)
        self._scene_camera.clear(self._data)
        self._renderer.update_scene(self._data, self._scene_camera.camera)
        draw_marks(self._renderer.scene, marks, keep=self._renderer.scene.ngeom)
        pixels: Array = self._renderer.render()
        return pixels

    def close(self) -> None:
        """Releases the memory for drawing."""
        self._renderer.close()


@contextlib.contextmanager
def explained() -> Iterator[None]:
    """Turns errors of MuJoCo's drawing into an Error that says what to install.

    MuJoCo draws without a screen unless MUJOCO_GL says otherwise. It must be imported in this
    block, because the import loads the libraries that MUJOCO_GL names.
    """
    platform = os.environ.setdefault("MUJOCO_GL", "egl")
    extras.require("film", "OpenGL")
    try:
        yield
    # PyOpenGL and drivers raise anything if a library is missing, even an AttributeError.
    except Exception as error:
        remedy = f"apt-get install {' '.join(DRAWING_PACKAGES)}" if platform == "egl" else ""
        remedy = remedy or "unset it, and nothing needs a screen"
        raise Error(f"MuJoCo cannot draw with MUJOCO_GL={platform}: {remedy} ({error})") from error


def draw_marks(scene: Any, marks: ArrayLike, keep: int = 0) -> None:
    """Adds a ball for each mark, a row x, y, z [m], after the first `keep` shapes of a scene."""
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
    """Writes a film of images, height x width x 3, at a rate [images/s]."""
    extras.require("film", "av")
    import av

    with whole_file(path) as part, av.open(str(part), "w") as container:
        stream = container.add_stream("libx264", rate=rate)
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": "23", "preset": "veryfast"}
        for number, picture in enumerate(images):
            # The format allows only even sizes: images of odd sizes lose a row or a column.
            even = picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2]
            image = np.ascontiguousarray(even)
            if number == 0:
                stream.height, stream.width = image.shape[:2]
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode())
