# SPDX-License-Identifier: BSD-3-Clause
"""Pictures show robot and objects, as large as they can be, and nothing hides them."""

import os
import subprocess

import numpy as np
import pytest
from conftest import PROGRAM
from trifinger import InvalidArgument, look, picture
from trifinger.foreign_models import model_of
from trifinger.look import FLOOR, LAMP, look_of
from trifinger.picture import (
    CAMERAS,
    SURROUND_GROUP,
    TABLE,
    Painter,
    SceneCamera,
    View,
    shadowed,
)

os.environ.setdefault("MUJOCO_GL", "egl")  # the default of Painter

SCENES = {
    "edu": (),
    "pro": ("--variant", "pro"),
    "one": ("--variant", "one"),
    "single finger": ("--single-finger",),
    "flipped": ("--flipped",),
    "high": ("--finger-height", "0.5"),
    "low": ("--variant", "pro", "--finger-height", "0.2"),
    "flipped ball": ("--flipped", "--object", "ball"),
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

    model = model_of(mjcf_of(scene), look_of)
    view = View(camera)
    scene_camera = SceneCamera(model, view)
    data = mujoco.MjData(model)
    data.qpos[:] = model.key_qpos[0]
    mujoco.mj_forward(model, data)
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

    model = model_of(mjcf_of("edu"), look_of)
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
    configuration = painter.model.key_qpos[0].copy()
    shaded = painter.draw(configuration).astype(int).sum(axis=2)
    painter.model.light(LAMP).castshadow = False
    lit = painter.draw(configuration + 1e-3).astype(int).sum(axis=2)
    painter.close()
    darkening = (lit - shaded)[lit - shaded > 3]
    assert len(darkening) > 0.05 * lit.size
    # Half shadows are a good part of all that is in shadow.
    deepest = np.percentile(darkening, 95)
    assert ((darkening > 0.15 * deepest) & (darkening < 0.85 * deepest)).mean() > 0.15


def test_shadows_change_nothing_else():
    random = np.random.default_rng(2)
    bright = random.integers(0, 256, (24, 32, 3), np.uint8)
    bright[:6] = 0  # something black throws no shadow on what is beside it
    lit = random.integers(0, 256, (47, 63, 3), np.uint8)
    assert (shadowed(lit, bright, bright) == lit).all()
    dark = bright.copy()
    dark[10:14, 12:16] //= 2
    shaded = shadowed(lit, bright, dark)
    assert (shaded <= lit).all()
    is_darker = (shaded < lit).any(axis=2)
    assert is_darker[20:28, 24:32].mean() > 0.9
    is_darker[18:30, 22:34] = False  # as far as the edges are soft
    assert not is_darker.any()


def pixels_of(points, scene_camera, model, view):
    """Where points are in the picture, both from -1 to 1, and how far away [m]."""
    camera = scene_camera.camera
    right, up, forward = scene_camera._axes
    away = np.asarray(points) - (camera.lookat - camera.distance * forward)
    slope = np.tan(np.radians(model.vis.global_.fovy) / 2)
    depth = away @ forward
    across = away @ right / (slope * view.width / view.height)
    return across / depth, away @ up / depth / slope, depth


@pytest.mark.parametrize("camera", [*CAMERAS, "35,-10"])
@pytest.mark.parametrize("speed", [0.0, 1.0, 8.0])
def test_a_path_shows_all_that_moves_at_every_time(camera, speed):
    import mujoco

    model = model_of(mjcf_of("flipped ball"), look_of)
    view = View(camera, 320, 240)
    scene_camera = SceneCamera(model, view)
    data = mujoco.MjData(model)
    random = np.random.default_rng(int(10 * speed))
    ball = model.joint(int(np.flatnonzero(model.jnt_type == 0)[0]))
    azimuth = random.uniform(-np.pi, np.pi)
    times = np.arange(0.0, 3.0, 1 / 30)
    ways = np.maximum(times - 1.0, 0.0)
    configurations = np.tile(model.key_qpos[0], (len(times), 1))
    configurations[:, :9] += 0.3 * np.sin(times[:, None] * random.uniform(1, 9, 9))
    places = configurations[:, ball.qposadr[0] : ball.qposadr[0] + 3]
    places += speed * ways[:, None] * [np.cos(azimuth), np.sin(azimuth), 0.5]
    places[:, 2] = np.maximum(places[:, 2] - 4.9 * ways**2, 0.02)  # it lands on the table
    shown = np.flatnonzero((model.geom_bodyid > 0) & (model.geom_group == 0))
    path = scene_camera.path(configurations)
    assert len(path) == len(times)
    for i in range(2 * len(times) - 1):  # between two pictures, too
        share = 0.5 * (i % 2)
        mean = (1 - share) * configurations[i // 2] + share * configurations[-(-i // 2)]
        data.qpos[:] = mean
        mujoco.mj_kinematics(model, data)
        scene_camera.look((1 - share) * path[i // 2] + share * path[-(-i // 2)])
        x, y, depth = pixels_of(data.geom_xpos[shown], scene_camera, model, view)
        assert depth.min() > 0
        assert max(np.abs(x).max(), np.abs(y).max()) < 1
        # Its lamp sees what the camera sees.
        away = data.geom_xpos[shown] - scene_camera.camera.lookat
        assert np.linalg.norm(away, axis=1).max() < scene_camera.reach
    # A camera that follows does so smoothly; one that need not, stands still.
    turns = np.abs(np.diff(path, 2, axis=0)).max()
    assert turns <= 0.2 * speed / 30
    assert (turns == 0) == (speed < 0.1)


def test_what_falls_through_the_ground_is_not_followed():
    model = model_of(mjcf_of("flipped ball"), look_of)
    scene_camera = SceneCamera(model, View())
    start = model.key_qpos[0].copy()
    fallen = start.copy()
    fallen[int(model.jnt_qposadr[model.jnt_type == 0][0]) + 2] = -50.0
    path = scene_camera.path([start, fallen])
    assert np.ptp(path, axis=0).max() < 0.2


FOREIGN = """
<mujoco>
  <default><geom rgba="1 0 0 1" group="2"/></default>
  <worldbody>
    {ground}
    <body pos="0 0 2">
      <joint name="hinge" axis="0 1 0"/>
      <geom type="capsule" size="0.05" fromto="0 0 0 0 0 -0.5" rgba="0 0 1 1"/>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize(
    ("ground", "height"),
    [("", 1.45), ('<geom type="plane" size="1 1 1" pos="0 0 0.5"/>', 0.5)],
)
def test_a_robot_from_a_file_stands_in_light_on_a_floor(ground, height):
    painter = Painter(FOREIGN.format(ground=ground), View("front", 160, 120))
    picture = painter.draw(painter.model.qpos0).astype(int)
    floor = painter._data.geom(FLOOR).xpos[2]
    painter.close()
    assert floor == pytest.approx(height, abs=0.01)
    assert picture[:2].min() > 150  # the sky
    assert np.ptp(picture[-2:], axis=2).max() < 20  # a grey floor, whatever colours the file has
    assert picture[-2:].min() > 100
    is_blue = picture[..., 2] > picture[..., 0] + 60
    assert 0.01 < is_blue.mean() < 0.5


def ball_of_many_faces(turns=160, slices=160):
    """A robot from a file that is a mesh of a ball, turned and moved in its body."""
    up, around = np.linspace(0, np.pi, slices), np.linspace(0, 2 * np.pi, turns, endpoint=False)
    up, around = np.meshgrid(up, around, indexing="ij")
    ball = np.stack([np.sin(up) * np.cos(around), np.sin(up) * np.sin(around), np.cos(up)], axis=-1)
    row, column = np.mgrid[: slices - 1, :turns]
    here, there = row * turns + column, row * turns + (column + 1) % turns
    low = np.stack([here, here + turns, there + turns], axis=-1)[:-1]
    high = np.stack([here, there + turns, there], axis=-1)[1:]
    faces = np.concatenate([low.reshape(-1, 3), high.reshape(-1, 3)])
    texts = (" ".join(map(str, one.ravel())) for one in (ball, faces))
    mesh = '<mesh name="ball" scale="0.1 0.1 0.3" vertex="{}" face="{}"/>'.format(*texts)
    shape = '<geom type="mesh" mesh="ball" pos="0.2 0 -0.3" euler="30 60 0" mass="1"/>'
    return FOREIGN.format(ground=f"<body><joint/>{shape}</body>").replace(
        "<worldbody>", f"<asset>{mesh}</asset><worldbody>"
    )


def test_shadows_need_few_of_the_faces_of_a_mesh_and_look_the_same(monkeypatch):
    import mujoco

    pictures, faces = [], []
    for many in (look.MANY_FACES, 10**9):
        monkeypatch.setattr(look, "MANY_FACES", many)
        painter = Painter(ball_of_many_faces())
        pictures.append(painter.draw(painter.model.qpos0).astype(int))
        drawn = painter._scene.geoms[: painter._scene.ngeom]
        kind = int(mujoco.mjtGeom.mjGEOM_MESH)
        meshes = [one.dataid // 2 for one in drawn if one.type == kind]
        faces.append(painter.model.mesh_facenum[meshes].sum())
        painter.close()
    assert 0 < faces[0] < faces[1] / 2
    difference = np.abs(pictures[0] - pictures[1]).max(axis=2)
    assert (difference > 20).mean() < 1e-3
    assert difference.mean() < 0.1


def test_edges_are_smooth_where_a_graphics_card_draws(monkeypatch):
    pictures = []
    for software in ("", "no renderer is called so"):
        monkeypatch.setattr(picture, "SOFTWARE", software)
        painter = Painter(FOREIGN.format(ground=""), View("front", 160, 120))
        pictures.append(painter.draw(painter.model.qpos0).astype(int))
        painter.close()
    differing = (np.abs(pictures[0] - pictures[1]).max(axis=2) > 10).mean()
    assert 0.001 < differing < 0.05


def test_what_does_not_move_is_not_drawn_again():
    painter = Painter(mjcf_of("edu"), view=View("front", 64, 48))
    start = painter.model.key_qpos[0].copy()
    first = painter.draw(start)
    first[:] = 0  # pictures belong to who asked for them
    again = painter.draw(start + 1e-6)
    moved = painter.draw(start + 0.1)
    painter.close()
    assert again.std() > 10
    assert (again != moved).any()


def test_cameras_of_the_platform_have_their_names():
    painter = Painter(mjcf_of("edu"), view=View("camera180", 100, 100))
    picture = painter.draw(painter.model.key_qpos[0])
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


@pytest.mark.parametrize("sides", [(1.0, 0.004, 0.004), (1.0, 1.0, 0.002), (0.2, 0.1, 0.05)])
@pytest.mark.parametrize("place", [0.0, 0.0156, 0.3])
def test_thin_meshes_of_many_faces_are_drawn(sides, place):
    import mujoco

    spec = mujoco.MjSpec()
    angles, along = np.meshgrid(np.linspace(0, 2 * np.pi, 31)[:-1], np.linspace(-0.5, 0.5, 80))
    corners = np.stack([along, np.cos(angles) / 2, np.sin(angles) / 2], axis=-1).reshape(-1, 3)
    corners = corners * sides + place
    first = np.arange(79 * 30).reshape(79, 30)
    second = np.roll(first, -1, axis=1)
    faces = np.stack([first, second, first + 30, second, second + 30, first + 30], axis=-1)
    shell = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    data = {"uservert": corners.ravel(), "userface": faces.ravel(), "inertia": shell}
    spec.add_mesh(name="thin", **data)
    body = spec.worldbody.add_body()
    body.add_joint()
    mesh = mujoco.mjtGeom.mjGEOM_MESH
    body.add_geom(type=mesh, meshname="thin", group=2, mass=0, contype=0, conaffinity=0)
    for group in (3, 4, 5):
        hidden = {"size": [0.3, 0, 0], "rgba": [1, 0, 0, 1], "group": group}
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, mass=1, **hidden)
    spec.compile()
    painter = Painter(spec.to_xml(), View(width=320, height=240))
    image = painter.draw(painter.model.qpos0).astype(int)
    painter.close()
    assert np.ptp(image[..., 1]) > 20
    assert not (image[..., 0] > image[..., 1] + 60).any()  # nothing red
