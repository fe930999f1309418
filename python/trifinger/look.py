# SPDX-License-Identifier: BSD-3-Clause
"""The look of every scene: a sky, a floor and the light of a lamp, whatever its file has."""

from __future__ import annotations

from typing import Any

import numpy as np

FLOOR = "floor of the look"
LAMP = "lamp of the look"
TO_LAMP = np.array([0.45, -0.55, 1.1]) / np.linalg.norm([0.45, -0.55, 1.1])
TO_SIDE = np.array([-0.45, 0.55, 0.4]) / np.linalg.norm([-0.45, 0.55, 0.4])  # light without shadow
SKY, HORIZON = (0.66, 0.74, 0.84), (0.92, 0.93, 0.95)
SQUARES = (0.80, 0.81, 0.83), (0.77, 0.78, 0.80)
SHADOW_SIZE = 1024  # of the picture of the lamp [pixels]
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


def landing_height(model: Any, data: Any) -> float | None:
    """The height of the highest level ground of a scene [m]; None if it has none.

    What has no height of its own is hidden, since our floor is drawn there.
    """
    import mujoco

    ground = (model.geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE)) & (model.geom_bodyid == 0)
    ground &= data.geom_xmat[:, 8] > 0.999
    ground[model.geom(FLOOR).id] = False
    model.geom_rgba[ground, 3] = 0.0
    return float(data.geom_xpos[ground, 2].max()) if ground.any() else None
