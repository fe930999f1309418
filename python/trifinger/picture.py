# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a scene and films of pictures, without a screen."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trifinger.errors import Error

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[Any]


FILM_RATE = 30  # of films that leave out images [images/s]
MARK_RADIUS = 0.01  # [m]
MARK_COLOUR = (0.95, 0.75, 0.1, 1.0)


@dataclass(frozen=True)
class View:
    """From where a scene is seen, and how large the picture is."""

    size: tuple[int, int] = (720, 540)  # [pixels]
    height: float = 0.13  # of the point in the middle of the picture, above the centre [m]
    distance: float = 0.95  # [m]
    azimuth: float = 90.0  # [degrees]
    elevation: float = -18.0  # [degrees]


class Painter:
    """Draws a model in any configuration."""

    def __init__(self, mjcf: str, is_plain: bool = False, view: View | None = None) -> None:
        """Plain pictures have neither shadows nor smooth edges, and take a tenth of the time."""
        os.environ.setdefault("MUJOCO_GL", "egl")
        import mujoco
        from mujoco.rendering.classic.renderer import Renderer

        self._mujoco = mujoco
        self._model = mujoco.MjModel.from_xml_string(mjcf)
        view = view or View()
        self.size = view.size
        self._model.vis.global_.offwidth, self._model.vis.global_.offheight = view.size
        if is_plain:
            self._model.vis.quality.offsamples = 0
        self._data = mujoco.MjData(self._model)
        self._renderer = Renderer(self._model, width=view.size[0], height=view.size[1])
        if is_plain:
            for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
                self._renderer.scene.flags[flag] = False
        self._camera = mujoco.MjvCamera()
        mujoco.mjv_defaultFreeCamera(self._model, self._camera)
        self._camera.lookat[:] = (0.0, 0.0, view.height)
        self._camera.distance = view.distance
        self._camera.azimuth = view.azimuth
        self._camera.elevation = view.elevation

    def draw(self, configuration: ArrayLike, marks: ArrayLike = ()) -> Array:
        """The scene at joints and objects as MuJoCo's qpos begins: height x width x 3.

        `marks` are centres of balls to draw on top, as goals are: a row x, y, z for each [m].
        """
        import numpy as np

        mujoco = self._mujoco
        self._data.qpos[:] = np.asarray(configuration)[: self._model.nq]
        mujoco.mj_normalizeQuat(self._model, self._data.qpos)
        mujoco.mj_forward(self._model, self._data)
        self._renderer.update_scene(self._data, self._camera)
        draw_marks(self._renderer.scene, marks, keep=self._renderer.scene.ngeom)
        pixels: Array = self._renderer.render()
        return pixels

    def close(self) -> None:
        """Gives the memory of the pictures back."""
        self._renderer.close()


def draw_marks(scene: Any, marks: ArrayLike, keep: int = 0) -> None:
    """Adds a ball for each mark, a row x, y, z [m], behind the first `keep` shapes of a scene."""
    import mujoco
    import numpy as np

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
    try:
        import av
    except ImportError as error:
        raise Error('PyAV is missing: pip install "trifinger[film]"') from error
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=rate)
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": "23", "preset": "veryfast"}
        for number, image in enumerate(images):
            if number == 0:
                stream.height, stream.width = image.shape[:2]
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode())
