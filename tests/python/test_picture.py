# SPDX-License-Identifier: BSD-3-Clause
"""Pictures show robot and objects, as large as they can be, and nothing hides them."""

import os
import subprocess

import numpy as np
import pytest
from conftest import PROGRAM
from trifinger import InvalidArgument
from trifinger.picture import CAMERAS, SURROUND_GROUP, TABLE, Painter, SceneCamera, View

os.environ.setdefault("MUJOCO_GL", "egl")  # the default of Painter

SCENES = {
    "edu": (),
    "pro": ("--variant", "pro"),
    "one": ("--variant", "one"),
    "single finger": ("--single-finger",),
    "flipped": ("--flipped",),
    "high": ("--finger-height", "0.5"),
    "low": ("--variant", "pro", "--finger-height", "0.2"),
    "all objects": ("--object", "cube", "cuboid", "stick", "ball"),
}


def mjcf_of(scene: str) -> str:
    command = [PROGRAM, "model", "export", "--format", "mjcf", *SCENES[scene]]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def seen_pixels(model, data, scene_camera, view, is_cleared):
    """How many pixels show which shape, without what is translucent."""
    from mujoco.rendering.classic.renderer import Renderer

    if is_cleared:
        scene_camera.clear(data)
    model.vis.quality.offsamples = 0
    renderer = Renderer(model, width=view.width, height=view.height)
    renderer.enable_segmentation_rendering()
    renderer.update_scene(data, scene_camera.camera)
    numbers = renderer.render()[..., 0]
    renderer.close()
    return np.bincount(numbers[numbers >= 0].ravel(), minlength=model.ngeom)


def seen(scene, camera):
    """A scene in its start pose, with a camera."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(mjcf_of(scene))
    data = mujoco.MjData(model)
    data.qpos[:] = model.key_qpos[0]
    mujoco.mj_forward(model, data)
    view = View(camera)
    scene_camera = SceneCamera(model, view)
    return model, data, view, scene_camera


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("camera", [*CAMERAS, "120,-15"])
def test_robot_and_objects_fill_the_picture(scene, camera):
    import mujoco

    model, data, view, scene_camera = seen(scene, camera)
    place = mujoco.MjvScene(model, maxgeom=1000)
    options = mujoco.MjvOption()
    mujoco.mjv_updateScene(
        model, data, options, None, scene_camera.camera, mujoco.mjtCatBit.mjCAT_ALL, place
    )
    eye, other = place.camera[:2]  # the scene has two eyes
    middle = (np.array(eye.pos) + other.pos) / 2
    shown = (model.geom_bodyid > 0) & (model.geom_group == 0)
    points = np.concatenate([data.geom_xpos[shown], TABLE]) - middle
    depth = points @ eye.forward
    up = points @ eye.up / depth / np.tan(np.radians(model.vis.global_.fovy) / 2)
    across = points @ np.cross(eye.forward, eye.up) / depth
    across /= np.tan(np.radians(model.vis.global_.fovy) / 2) * view.width / view.height
    assert np.abs(up).max() < 1
    assert np.abs(across).max() < 1
    # Centres of shapes: their edges are farther out.
    assert max(np.ptp(up), np.ptp(across)) > 1.4


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("camera", CAMERAS)
def test_neither_frame_nor_wall_hides_the_scene(scene, camera):
    model, data, view, scene_camera = seen(scene, camera)
    surround = model.geom_group == SURROUND_GROUP
    assert surround.sum() > 20
    drawn = seen_pixels(model, data, scene_camera, view, is_cleared=True)
    model.geom_rgba[surround, 3] = 0.0
    alone = seen_pixels(model, data, scene_camera, view, is_cleared=False)
    shown = (model.geom_bodyid > 0) & ~surround
    assert alone[shown].sum() > 0.08 * view.width * view.height
    assert drawn[shown].sum() == pytest.approx(alone[shown].sum(), rel=0.05)


def test_the_frame_is_there_where_it_hides_nothing():
    import mujoco

    model = mujoco.MjModel.from_xml_string(mjcf_of("edu"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    surround = model.geom_group == SURROUND_GROUP
    whole = model.geom_rgba[surround, 3].copy()
    scene_camera = SceneCamera(model, View())
    scene_camera.clear(data)
    assert 10 < (model.geom_rgba[surround, 3] > 0).sum() < surround.sum() - 10
    scene_camera.clear(data, SceneCamera(model, View("camera60")).camera)
    assert model.geom_rgba[surround, 3].tolist() == whole.tolist()


def test_shadows_have_soft_edges():
    painter = Painter(mjcf_of("edu"), view=View("top"))
    configuration = painter._model.key_qpos[0].copy()
    shaded = painter.draw(configuration).astype(int).sum(axis=2)
    painter._model.light_castshadow[:] = False
    lit = painter.draw(configuration).astype(int).sum(axis=2)
    painter.close()
    darkening = (lit - shaded)[lit - shaded > 3]
    # Half shadows are a good part of all that is in shadow.
    deepest = np.percentile(darkening, 95)
    assert ((darkening > 0.15 * deepest) & (darkening < 0.85 * deepest)).mean() > 0.2


def test_cameras_of_the_platform_have_their_names():
    painter = Painter(mjcf_of("edu"), is_plain=True, view=View("camera180", 100, 100))
    picture = painter.draw(painter._model.key_qpos[0])
    painter.close()
    assert picture.shape == (100, 100, 3)
    assert picture.std() > 20


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (("nowhere",), "no camera 'nowhere', only front, side, top, camera60, camera180"),
        (("10,-120",), "elevation in '10,-120' must be from -90 to 90"),
        (("10,nan",), "elevation"),
        (("front", 8), "width of a picture is 8 pixels, must be from 16 to 4096"),
        (("front", 720, 5000), "height of a picture is 5000 pixels"),
    ],
)
def test_a_view_that_there_is_not(arguments, what):
    with pytest.raises(InvalidArgument, match=what):
        Painter(mjcf_of("edu"), view=View(*arguments))
