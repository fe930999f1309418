# SPDX-License-Identifier: BSD-3-Clause
"""The look of every scene: a sky, a floor and the light of a lamp, whatever its file has."""

from __future__ import annotations

from typing import Any

import numpy as np

FLOOR = "floor of the look"
LAMP = "lamp of the look"
TO_LAMP = np.array([0.45, -0.55, 1.1]) / np.linalg.norm([0.45, -0.55, 1.1])
TO_SIDE = np.array([-0.45, 0.55, 0.4]) / np.linalg.norm([-0.45, 0.55, 0.4])  # light without shadow
INK_RADIUS = 0.0006  # [m]
INK_COLOUR = (0.05, 0.1, 0.35, 1.0)
SKY, HORIZON = (0.66, 0.74, 0.84), (0.92, 0.93, 0.95)
SQUARES = (0.80, 0.81, 0.83), (0.77, 0.78, 0.80)
SHADOW_SIZE = 1024  # of the picture of the lamp [pixels]
LOOKS_GROUP = 2  # MuJoCo's group of shapes that only look
HIDDEN_GROUP = 3  # of those that are not drawn
FINE_GROUP, COARSE_GROUP = 4, 5  # and of those with many faces, and of what is in their shadows
MANY_FACES = 2000  # of a mesh
CELLS = 32  # along a coarse mesh, which has one corner in each
THIN = 0.01  # a mesh this much thinner than long stays as it is
BELOW = 0.002  # the floor lies this far below what lies on it, which hides it [m]


def look_of(spec: Any) -> None:
    """Gives a scene, a `mujoco.MjSpec`, our sky, floor and lights in place of its own."""
    import mujoco

    for texture in [one for one in spec.textures if one.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX]:
        spec.delete(texture)
    gradient, checker = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, mujoco.mjtBuiltin.mjBUILTIN_CHECKER
    sky: dict[str, Any] = {"type": mujoco.mjtTexture.mjTEXTURE_SKYBOX, "builtin": gradient}
    spec.add_texture(name="sky of the look", rgb1=SKY, rgb2=HORIZON, width=64, height=384, **sky)
    squares: dict[str, Any] = {"type": mujoco.mjtTexture.mjTEXTURE_2D, "builtin": checker}
    squares |= {"rgb1": SQUARES[0], "rgb2": SQUARES[1], "width": 128, "height": 128}
    spec.add_texture(name=FLOOR, **squares)
    floor = spec.add_material(
        name=FLOOR, texuniform=True, texrepeat=[2, 2], specular=0, shininess=0
    )
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = FLOOR
    ground: dict[str, Any] = {"type": mujoco.mjtGeom.mjGEOM_PLANE, "size": [30, 30, 1], "group": 2}
    # With a place of its own: MuJoCo would not look at one that is given later.
    ground |= {"pos": [0, 0, -1], "quat": [1, 0, 0, 0], "rgba": [1, 1, 1, 1]}
    ground |= {"contype": 0, "conaffinity": 0}
    spec.worldbody.add_geom(name=FLOOR, material=FLOOR, **ground)

    for light in spec.lights:
        light.active = False
    for name, direction, brightness in ((LAMP, TO_LAMP, 0.48), ("side of the look", TO_SIDE, 0.12)):
        spec.worldbody.add_light(
            name=name,
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            dir=-direction,
            castshadow=name == LAMP,
            ambient=np.zeros(3),
            diffuse=np.full(3, brightness),
            specular=np.full(3, 0.3 * brightness),
        )
    visual = spec.visual
    visual.headlight.active = 1
    visual.headlight.ambient[:] = 0.35
    visual.headlight.diffuse[:] = 0.18
    visual.headlight.specular[:] = 0.04
    visual.rgba.fog[:] = [*HORIZON, 1.0]
    visual.map.znear, visual.map.zfar = 0.01, 100.0
    visual.quality.shadowsize = SHADOW_SIZE
    # Corners that are never seen, of what is round and of planes.
    visual.quality.numslices, visual.quality.numstacks, visual.quality.numquads = 24, 10, 1


def look_with_coarse_shapes(spec: Any) -> None:
    """Also adds a coarse shape for each that has many faces: a shadow needs no more of them."""
    import mujoco

    look_of(spec)
    for geom in spec.geoms:
        if geom.group in (FINE_GROUP, COARSE_GROUP):
            geom.group = HIDDEN_GROUP
    shell = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    for geom in [one for one in spec.geoms if one.meshname and one.group == LOOKS_GROUP]:
        mesh, name = spec.mesh(geom.meshname), f"{geom.meshname} (coarse)"
        corners, faces = np.reshape(mesh.uservert, (-1, 3)), np.reshape(mesh.userface, (-1, 3))
        if len(faces) <= MANY_FACES:
            continue
        if spec.mesh(name) is None:
            cells = np.round(corners * CELLS / np.ptp(corners, axis=0).max())
            numbers = cells @ [1, 1e5, 1e10]  # each cell has its own
            _, kept, own = np.unique(numbers, return_index=True, return_inverse=True)
            faces = own[faces]
            faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
            fewest = corners[kept] - corners[kept].mean(axis=0)
            spread = np.linalg.svd(fewest, compute_uv=False)
            if not len(faces) or spread[-1] < THIN * spread[0]:
                continue  # The corners left of a rod or a plate may lie in a line or a plane.
            fewer = {"uservert": corners[kept].ravel(), "userface": faces.ravel()}
            place = {"scale": mesh.scale, "refpos": mesh.refpos, "refquat": mesh.refquat}
            spec.add_mesh(name=name, inertia=shell, **fewer, **place)
        looks = {"type": geom.type, "material": geom.material, "rgba": geom.rgba}
        place = {"pos": geom.pos, "quat": geom.quat}
        coarse = geom.parent.add_geom(meshname=name, group=COARSE_GROUP, **looks, **place)
        coarse.alt, coarse.mass, coarse.contype, coarse.conaffinity = geom.alt, 0, 0, 0
        geom.group = FINE_GROUP


def landing_height(model: Any, data: Any) -> float | None:
    """The height of the highest level ground of a scene [m]; None if it has none.

    What has no height of its own is hidden, since our floor is drawn there.
    """
    import mujoco

    ground = (model.geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE)) & (model.geom_bodyid == 0)
    ground &= data.geom_xmat[:, 8] > 0.999
    ground &= np.arange(model.ngeom) != mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, FLOOR)
    model.geom_rgba[ground, 3] = 0.0
    return float(data.geom_xpos[ground, 2].max()) if ground.any() else None


def lowest_height(model: Any, data: Any, shapes: Any) -> float:
    """The height of the lowest point of some shapes [m]; infinity without shapes."""
    from mujoco import mjtGeom as Kind

    low = np.inf
    for shape in shapes:
        (radius, half), up = model.geom_size[shape, :2], data.geom_xmat[shape, 6:]
        kind, mesh = model.geom_type[shape], model.geom_dataid[shape]
        middle, box = np.split(model.geom_aabb[shape], 2)
        depth = np.abs(up) @ box - up @ middle
        if kind == Kind.mjGEOM_MESH:
            first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
            depth = -(model.mesh_vert[first : first + count] @ up).min()
        elif kind in (Kind.mjGEOM_SPHERE, Kind.mjGEOM_CAPSULE):
            depth = radius + half * abs(up[2]) * (kind == Kind.mjGEOM_CAPSULE)
        elif kind == Kind.mjGEOM_CYLINDER:
            depth = radius * np.hypot(*up[:2]) + half * abs(up[2])
        low = min(low, float(data.geom_xpos[shape, 2] - depth))
    return low
