# SPDX-License-Identifier: BSD-3-Clause
"""Draws pictures of a scene and writes films of pictures, without a screen."""

from __future__ import annotations

import contextlib
import itertools
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from trifinger import extras, look
from trifinger.arrays import Array
from trifinger.errors import Error, InvalidArgument
from trifinger.foreign_models import model_of
from trifinger.placement import Placement
from trifinger.whole_file import whole_file

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


DRAWING_PACKAGES = ("libegl1", "libgl1-mesa-dri", "libopengl0")  # on Debian, without a screen
FILM_RATE = 30  # rate of films that skip steps [images/s]
MP4 = ("libx264", {"crf": "23", "preset": "veryfast"})  # codec of a film, and its options
WEBM = ("libvpx-vp9", {"crf": "34", "b": "0", "deadline": "good", "cpu-used": "2"})
MARK_RADIUS = 0.01  # [m]
MARK_COLOUR = (0.95, 0.75, 0.1, 1.0)


# Azimuth and elevation of views for every model [degrees]: between two fingers, or from above.
CAMERAS = {"front": (90.0, -20.0), "side": (210.0, -20.0), "top": (90.0, -89.9)}
LARGEST = 4096  # largest width and height [pixels]
MARGIN = 1.06  # size of the picture, relative to that of robot and objects in it
TABLE = ((0.1, 0.1, 0.0), (0.1, -0.1, 0.0), (-0.1, 0.1, 0.0), (-0.1, -0.1, 0.0))  # always seen [m]
SAMPLES = 4  # of a pixel on a graphics card, so that edges are smooth
SOFTWARE = "llvmpipe|softpipe|SwiftShader"  # draws without a card, and would take twice as long
COARSE = 2  # pixels of a picture in one of its shadows, along each side
FOG = np.array([1.5, 4.0])  # where the floor begins and ends to fade, in reaches of the lamp
SAME = 1e-4  # a scene that moves less is not drawn again [m], [rad]
MOST_SHAPES = 10_000  # of a scene
SMALLEST = 1.6  # how much farther away a camera may be that stands still
FOLLOW = 15  # pictures before and after, which a camera that follows sees
STEEP = 60.0  # elevation from which a view is steep [degrees]
BEHIND = 0.05  # parts of frame and wall are drawn if they are this far behind the middle [m]
SURROUND_GROUP = 1  # MuJoCo's group of the shapes of frame and wall


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
    """A camera that looks at a MuJoCo model, which has our look."""

    def __init__(self, model: Any, view: View) -> None:
        """Places the camera of `view`; raises InvalidArgument if there is no such camera."""
        import mujoco

        self._mujoco, self._model = mujoco, model
        self._data = mujoco.MjData(model)
        model.stat.extent = 1.0  # what counts in extents now counts in metres
        moving = model.geom_bodyid > 0
        shapes, looks = moving & (model.geom_group == 0), (look.LOOKS_GROUP, look.FINE_GROUP)
        self._is_of_ours = bool(shapes.any())  # a robot from a file has shapes that look alone
        if not self._is_of_ours:
            # With its base, which may be a part of the world, but without the walls of a room.
            shapes = np.isin(model.geom_group, looks) & (model.geom_rbound > 0)
            largest = model.geom_rbound[shapes & moving].max(initial=0.0)
            shapes &= moving | (model.geom_rbound < 2 * largest)
        roots = model.body_jntadr[model.body_rootid[model.geom_bodyid]]
        free = (roots >= 0) & (model.jnt_type[roots] == int(mujoco.mjtJoint.mjJNT_FREE))
        self._shapes, self._objects = np.flatnonzero(shapes), np.flatnonzero(shapes & free)
        is_fixed = np.isin(model.geom_group, (0, SURROUND_GROUP, *looks)) & ~free
        self._fixed = np.flatnonzero(is_fixed & (model.geom_rbound > 0))  # planes have no bound
        self._surround = np.flatnonzero(model.geom_group == SURROUND_GROUP)
        self._opacity = model.geom_rgba[self._surround, 3].copy()
        self.camera = mujoco.MjvCamera()
        mujoco.mjv_defaultFreeCamera(model, self.camera)
        angles = CAMERAS.get(view.camera) or _angles(view.camera)
        if angles is not None:
            self.camera.azimuth, self.camera.elevation = angles
        else:
            self.camera.fixedcamid = mujoco.mj_name2id(
                model, mujoco.mjtObj.mjOBJ_CAMERA, view.camera
            )
            self.camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        if angles is None and self.camera.fixedcamid < 0:
            names = [*CAMERAS, *(model.camera(i).name for i in range(model.ncam))]
            raise InvalidArgument(
                f"there is no camera '{view.camera}', only {', '.join(names)}; or give azimuth and "
                'elevation in degrees, as in "120,-15"'
            )
        self._axes = _axes(self.camera)
        slope = np.tan(np.radians(model.vis.global_.fovy) / 2) / MARGIN
        self._slopes = slope * np.array([view.width / view.height, 1.0])
        start = np.array(model.key_qpos[0] if model.nkey else model.qpos0)
        self._move(start)
        self._landing = look.landing_height(model, self._data)
        self._start = self._needs([start])[0]
        self.look(self._places(self._start))
        self._middle = self.camera.lookat.copy()

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
            depth = (data.geom_xpos[self._surround] - self._middle) @ forward
            opacity = np.where(depth > BEHIND, opacity, 0.0)
        self._model.geom_rgba[self._surround, 3] = opacity

    def path(self, configurations: Sequence[ArrayLike]) -> Array:
        """A place of the camera for each configuration: robot and objects are in the picture.

        The camera stands still if robot and objects are large enough when it sees where all of them
        ever are. Otherwise it follows them, and is where it must be for those within FOLLOW
        configurations. A place between two places also has in its picture what moves from one to
        the other.
        """
        needs = self._needs(configurations)
        still = self._places(needs.max(axis=0))
        if _distance(still) <= SMALLEST * np.median(_distance(self._places(needs))):
            return np.tile(still, (len(needs), 1))
        ends = ((FOLLOW, FOLLOW), (0, 0))
        near = np.lib.stride_tricks.sliding_window_view(
            np.pad(needs, ends, mode="edge"), 2 * FOLLOW + 1, axis=0
        )
        # A weighted mean of places that all see something sees it, too: they are in a cone.
        places = np.pad(self._places(near.max(axis=-1)), ends, mode="edge")
        weights = np.hanning(2 * FOLLOW + 3)[1:-1]
        weights /= weights.sum()
        return np.stack([np.convolve(column, weights, "valid") for column in places.T], axis=1)

    def place_for(self, configuration: ArrayLike) -> Array:
        """The place that sees the robot in its start pose, and the objects where they are."""
        needs = self._start
        if len(self._objects):
            self._move(configuration)
            needs = np.maximum(needs, self._needs_of(self._objects))
        return self._places(needs)

    def look(self, place: ArrayLike) -> None:
        """Moves the camera and its lamp to a place; a camera of the model stays."""
        place = np.asarray(place)
        self.reach = 1.8 * float(np.hypot(_distance(place) * self._slopes.max(), place[4]))
        target = place[[0, 1, 3]] @ self._axes
        self._model.light(look.LAMP).pos = target + 3 * self.reach * look.TO_LAMP
        if self.camera.type == self._mujoco.mjtCamera.mjCAMERA_FREE:
            self.camera.lookat[:], self.camera.distance = target, _distance(place)

    def _move(self, configuration: ArrayLike) -> None:
        self._data.qpos[:] = np.asarray(configuration)[: self._model.nq]
        self._mujoco.mj_kinematics(self._model, self._data)

    def _needs(self, configurations: Sequence[ArrayLike]) -> Array:
        """What the camera must see in each configuration; the floor goes below all of them."""
        ground = self._landing
        if ground is None:
            low = np.inf
            for configuration in configurations:
                self._move(configuration)
                low = min(low, look.lowest_height(self._model, self._data, self._fixed))
            ground = low if np.isfinite(low) else 0.0
        self._model.geom(look.FLOOR).pos[2] = ground - look.BELOW
        rows = []
        for configuration in configurations:
            self._move(configuration)
            # What has fallen through the ground is gone.
            above = self._data.geom_xpos[self._shapes, 2] >= ground
            rows.append(self._needs_of(self._shapes[above | ~np.isin(self._shapes, self._objects)]))
        return np.array(rows)

    def _needs_of(self, shapes: Array) -> Array:
        """How far the edges of the picture, and its nearest and farthest points, must be out.

        In the frame of the camera, a point is in view if |x - place| <= slope * (z - camera z).
        """
        corners = self._corners(shapes)
        if self._is_of_ours or not len(corners):
            corners = np.concatenate([corners, TABLE])
        x, y, z = self._axes @ corners.T
        wide, high = self._slopes
        edges = [x - wide * z, -x - wide * z, y - high * z, -y - high * z, -z, z]
        return np.asarray(np.max(edges, axis=1))

    def _places(self, needs: Array) -> Array:
        """Rows of the camera's place right, up and forward, its target's, and half the depth."""
        right, left, top, bottom, near, far = needs.T
        wide, high = self._slopes
        depth = np.minimum(-(right + left) / (2 * wide), -(top + bottom) / (2 * high))
        sides = (right - left) / 2, (top - bottom) / 2
        return np.stack([*sides, depth, (far - near) / 2, (far + near) / 2], axis=-1)

    def _corners(self, shapes: Array) -> Array:
        """Corners of boxes around shapes, where they are now."""
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        boxes = self._model.geom_aabb[shapes]
        corners = boxes[:, None, :3] + boxes[:, None, 3:] * signs
        turns = self._data.geom_xmat[shapes].reshape(-1, 3, 3)
        world = np.einsum("gij,gcj->gci", turns, corners) + self._data.geom_xpos[shapes][:, None]
        return np.asarray(world.reshape(-1, 3))


def _distance(places: Array) -> Array:
    return np.asarray(places[..., 3] - places[..., 2])


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

    def __init__(self, mjcf: str, view: View | None = None) -> None:
        """Raises InvalidArgument if the model does not have the camera of `view`.

        Raises Error, which says what to install, if this machine cannot draw.
        """
        with explained():
            import mujoco
            from mujoco.gl_context import GLContext

        self._mujoco = mujoco
        self.model = model_of(mjcf, look.look_with_coarse_shapes)
        view = view or View()
        self.size = (view.width, view.height)
        self.model.vis.global_.offwidth, self.model.vis.global_.offheight = self.size
        self._data = mujoco.MjData(self.model)
        self.placement = Placement(self.model)
        self._scene_camera = SceneCamera(self.model, view)
        self._last: tuple[Array, NDArray[np.uint8]] = np.empty(0), np.empty(0, np.uint8)
        self._options = mujoco.MjvOption()
        self._options.sitegroup[:] = 0
        self._scene = mujoco.MjvScene(self.model, maxgeom=MOST_SHAPES)
        with explained():
            self._screen = GLContext(*self.size)
            self._screen.make_current()
            from OpenGL.GL import GL_RENDERER, glGetString  # type: ignore[import-untyped]

            has_card = not re.search(SOFTWARE, glGetString(GL_RENDERER).decode())
            self.model.vis.quality.offsamples = SAMPLES * has_card
            self._context = mujoco.MjrContext(self.model, mujoco.mjtFontScale.mjFONTSCALE_50)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR

    def path(self, configurations: Sequence[ArrayLike]) -> Array:
        """A place of the camera for each configuration, with which `draw` shows all that moves."""
        return self._scene_camera.path(configurations)

    def draw(
        self,
        configuration: ArrayLike,
        marks: ArrayLike = (),
        place: ArrayLike | None = None,
        ink: ArrayLike = (),
    ) -> NDArray[np.uint8]:
        """The scene as an image, height x width x 3.

        `configuration` begins with MuJoCo's qpos, as `placement` makes it. `marks` are the centres
        of balls that show goals: a row x, y, z for each [m]. `place` is one of `path`, or between
        two of them; without it the camera sees the start pose, and all objects. `ink` has the two
        ends of each line that was written [m], float[n, 2, 3].
        """
        mujoco, model, data = self._mujoco, self.model, self._data
        scene_camera = self._scene_camera
        place = scene_camera.place_for(configuration) if place is None else place
        drawn = np.concatenate([np.ravel(one) for one in (configuration, place, marks, ink)])
        before, pixels = self._last
        if drawn.shape == before.shape and np.abs(drawn - before).max() < SAME:
            return pixels.copy()
        data.qpos[:] = np.asarray(configuration)[: model.nq]
        mujoco.mj_normalizeQuat(model, data.qpos)
        scene_camera.look(place)
        for move in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_tendon):
            move(model, data)
        scene_camera.clear(data)
        self._context.shadowClip = scene_camera.reach
        self._context.fogStart, self._context.fogEnd = FOG * scene_camera.reach
        self._screen.make_current()
        self._update(marks, look.FINE_GROUP)
        draw_ink(self._scene, ink)
        lit = self._pixels(*self.size, shadows=False)
        # The shadows alone: where, and by how much, they make a smaller picture darker.
        small = [-(-length // COARSE) for length in self.size]
        self._update(marks, look.COARSE_GROUP)
        bright, dark = (self._pixels(*small, shadows=shadows) for shadows in (False, True))
        pixels = shadowed(lit, bright, dark)
        self._last = drawn, pixels
        return pixels.copy()

    def _update(self, marks: ArrayLike, group: int) -> None:
        """Takes what is to be drawn: of fine shapes and coarse ones those of a group."""
        mujoco, scene, camera = self._mujoco, self._scene, self._scene_camera.camera
        for one in (look.FINE_GROUP, look.COARSE_GROUP):
            self._options.geomgroup[one] = one == group
        every = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self.model, self._data, self._options, None, camera, every, scene)
        draw_marks(scene, marks, keep=scene.ngeom)
        scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = True

    def _pixels(self, width: int, height: int, *, shadows: bool) -> NDArray[np.uint8]:
        mujoco = self._mujoco
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows
        rectangle = mujoco.MjrRect(0, 0, width, height)
        pixels = np.empty((height, width, 3), np.uint8)
        mujoco.mjr_render(rectangle, self._scene, self._context)
        mujoco.mjr_readPixels(pixels, None, rectangle, self._context)
        return pixels[::-1]  # OpenGL begins with the lowest row

    def close(self) -> None:
        """Releases the memory for drawing."""
        self._screen.make_current()
        self._context.free()
        self._screen.free()


def shadowed(
    lit: NDArray[np.uint8], bright: NDArray[np.uint8], dark: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """A picture with the soft shadows by which `dark` is darker than `bright`, two smaller ones."""
    before, after = (one.sum(axis=2, dtype=np.uint16) for one in (bright, dark))
    share: Array = np.minimum((after + np.float32(1)) / (before + np.float32(1)), 1)
    for _ in range(2):  # a mean of neighbours, down and then across
        padded = np.pad(share, ((1, 1), (0, 0)), mode="edge")
        share = ((padded[:-2] + padded[1:-1] + padded[2:]) / 3).T
    factors = (256 * share).astype(np.uint16).repeat(COARSE, 0).repeat(COARSE, 1)
    pixels = lit * factors[: lit.shape[0], : lit.shape[1], None] >> 8
    return np.asarray(pixels, np.uint8)


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


def draw_ink(scene: Any, ink: ArrayLike) -> None:
    """Adds lines to a scene, each from one of its two ends to the other [m], float[n, 2, 3]."""
    import mujoco

    lines = np.reshape(np.asarray(ink, float), (-1, 2, 3))
    for begin, end in lines[max(len(lines) - (scene.maxgeom - scene.ngeom), 0) :]:
        shape, capsule = scene.geoms[scene.ngeom], mujoco.mjtGeom.mjGEOM_CAPSULE
        colour = np.array(look.INK_COLOUR, np.float32)
        mujoco.mjv_initGeom(shape, capsule, np.zeros(3), np.zeros(3), np.eye(3).ravel(), colour)
        mujoco.mjv_connector(shape, capsule, look.INK_RADIUS, begin, end)
        scene.ngeom += 1


def save_film(images: Iterable[Array], path: Path, rate: int | Fraction) -> None:
    """Writes a film of images, height x width x 3, at a rate [images/s]: an .mp4 or a .webm."""
    extras.require("film", "av")
    import av

    with whole_file(path) as part, av.open(str(part), "w") as container:
        codec, options = WEBM if path.suffix == ".webm" else MP4
        stream = cast("av.VideoStream", container.add_stream(codec, rate=rate))
        stream.pix_fmt = "yuv420p"
        stream.options = {**options}
        for number, picture in enumerate(images):
            # The format allows only even sizes: images of odd sizes lose a row or a column.
            even = picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2]
            image = np.ascontiguousarray(even)
            if number == 0:
                stream.height, stream.width = image.shape[:2]
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode())
