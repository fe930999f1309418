# SPDX-License-Identifier: BSD-3-Clause
"""A robot and its objects as plain data: meshes, and where they are in a frame.

    scene = scene_of(session.documents)       # None if the session has no model
    for body in scene.bodies:                 # fixed order
        for mesh in body.meshes:              # at most one opaque and one transparent of a kind
            show(body.name, mesh.vertices, mesh.faces, mesh.normals, mesh.colours)
    positions, quaternions = scene.poses(frame.position, frame.objects)   # one row for each body

A mesh is in the frame of its body. Everything else is in the world frame: z up, origin on the
table, metres, quaternions w, x, y, z. Bodies are those of the MuJoCo model "model.xml", so any
robot that has one can be shown. Nothing here draws or needs a screen. One Scene belongs to one
thread.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from trifinger.foreign_models import model_of
from trifinger.log.objects import stick_length, written
from trifinger.look import BELOW, INK_COLOUR, INK_RADIUS, landing_height, lowest_height
from trifinger.placement import Placement

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from trifinger.arrays import Array

MODEL = "model.xml"
VISIBLE_GROUPS = (0, 1, 2)  # MuJoCo's own viewer hides the others, such as collision shapes
SURROUND_GROUP = 1  # MuJoCo's group of the shapes of frame and wall
SEGMENTS = 32  # of a circle
LARGEST_PLANE = 3.0  # half the size of a plane without edges [m]
SMOOTH = 0.5  # cosine between triangle and normal above which a surface is smooth


@dataclass(frozen=True)
class Mesh:
    """Triangles in the frame of their body."""

    vertices: NDArray[np.float32]
    """[n, 3], in metres; each has one normal, so edges are sharp"""
    normals: NDArray[np.float32]
    """[n, 3], of length 1"""
    colours: NDArray[np.uint8]
    """[n, 4], sRGB and opacity"""
    faces: NDArray[np.uint32]
    """[m, 3], anticlockwise seen from outside"""
    is_transparent: bool
    is_surround: bool
    """Frame or wall around the robot, which can hide it."""


@dataclass(frozen=True)
class Body:
    """A rigid body."""

    name: str
    """Name in the model; unnamed bodies have "body" and a number."""
    meshes: tuple[Mesh, ...]
    is_moving: bool
    """False if nothing can move it, as the table."""
    object: str
    """Name of the object it is; empty for a part of the robot or the surroundings."""


class Scene:
    """The bodies of a session's model, and the function from a frame to their poses."""

    def __init__(self, mjcf: str) -> None:
        """Reads a MuJoCo model; raises InvalidArgument if it is not one."""
        import mujoco

        self._mujoco = mujoco
        self._model = model = model_of(mjcf)
        self._data = mujoco.MjData(model)
        self._placement = Placement(model)
        self.joint_names = self._placement.joint_names
        """Names of the joints, in the order of the positions."""
        self._place(None, {})
        self._ground = landing_height(model, self._data)
        standing = np.isin(model.geom_group, VISIBLE_GROUPS) & (model.geom_rbound > 0)
        standing &= ~np.isin(model.geom_bodyid, [*self._placement.object_bodies])
        self._standing = np.flatnonzero(standing)
        self._shown: Array = np.array([], int)
        self.bodies: tuple[Body, ...] = ()
        """All bodies that can be seen, in the order of the model."""
        self._make_bodies()
        tips = [i for i in range(model.nsite) if "_tip_" in model.site(i).name]
        self._tips = np.array(tips, int)
        self.tip_names = tuple(model.site(i).name for i in tips)
        """Names of the tips, in the order of the forces; empty if the robot has none."""

    @property
    def has_pen(self) -> bool:
        """Whether an object is a stick, which leaves ink."""
        return any(stick_length(self._model, name) for name in self.object_names)

    def ink(self, steps: Array, objects: Mapping[str, Array]) -> tuple[Array, Mesh]:
        """What sticks have written: the step of each line, and two triangles for each of them.

        The arguments are those of `trifinger.log.objects.written`.
        """
        ends, lines = written(self._model, steps, objects)
        begin, end = lines[:, 0], lines[:, 1]
        aside = np.cross([0.0, 0.0, INK_RADIUS], end - begin)
        aside /= np.linalg.norm(end - begin, axis=1, keepdims=True) + 1e-12
        corners = np.stack([begin - aside, end - aside, end + aside, begin + aside], axis=1)
        faces = 4 * np.arange(len(lines))[:, None, None] + [[0, 1, 2], [0, 2, 3]]
        shape = corners.reshape(-1, 3), np.full((4 * len(lines), 3), [0, 0, 1]), faces
        return ends, _painted(shape, np.array(INK_COLOUR))

    @property
    def object_names(self) -> tuple[str, ...]:
        """Names of the objects that can move freely."""
        return self._placement.object_names

    def poses(
        self, position: Array | None = None, objects: Mapping[str, Array] | None = None
    ) -> tuple[Array, Array]:
        """Where the bodies are: positions [m] float[bodies, 3], quaternions float[bodies, 4].

        `position` are those of the joints [rad] and `objects` the poses of objects by name, as in
        Frame. What is None, or missing, is where the model starts.

        Raises:
            InvalidArgument: if there are more or fewer positions than joints
        """
        self._place(position, objects or {})
        data = self._data
        return data.xpos[self._shown].copy(), data.xquat[self._shown].copy()

    def tips(self, position: Array | None = None) -> tuple[Array, Array]:
        """Centres of the tips [m] and the directions in which they press, both float[tips, 3].

        A tip presses along its link. The sensor of a tip measures the size of a force alone.
        """
        self._place(position, {})
        places = self._data.site_xpos[self._tips].copy()
        links = self._data.xpos[self._model.site_bodyid[self._tips]]
        along = places - links
        lengths = np.linalg.norm(along, axis=1, keepdims=True)
        return places, np.divide(along, lengths, out=np.zeros_like(along), where=lengths > 0)

    def sphere(
        self, moments: Iterable[tuple[Array | None, Mapping[str, Array]]]
    ) -> tuple[Array, float]:
        """Centre [m] and radius [m] of a sphere around robot and objects, without surroundings.

        It has room for all of some moments, which are arguments of `poses`.
        """
        corners = np.array([self.bounds(*moment) for moment in moments])
        low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
        return (low + high) / 2, float(np.linalg.norm(high - low)) / 2

    def floor(self, moments: Iterable[tuple[Array | None, Mapping[str, Array]]]) -> float:
        """The height of the floor [m]: that of the ground, or below the robot in some moments."""
        heights = [] if self._ground is None else [self._ground]
        for moment in moments if self._ground is None else ():
            self._place(*moment)
            heights.append(lowest_height(self._model, self._data, self._standing))
        low = min(heights)
        return (low if np.isfinite(low) else 0.0) - BELOW

    def bounds(
        self, position: Array | None = None, objects: Mapping[str, Array] | None = None
    ) -> tuple[Array, Array]:
        """Corners of a box [m] around robot and objects, without surroundings.

        The arguments are those of `poses`.
        """
        positions, quaternions = self.poses(position, objects)
        corners = []
        for body, place, turn in zip(self.bodies, positions, quaternions, strict=True):
            if body.name == "world":
                continue
            points = [mesh.vertices for mesh in body.meshes if not mesh.is_surround]
            if points:
                corners.append(np.concatenate(points) @ _matrix(turn).T + place)
        if not corners:
            return np.full(3, -0.5), np.full(3, 0.5)
        every = np.concatenate(corners)
        return every.min(axis=0), every.max(axis=0)

    def _place(self, position: Array | None, objects: Mapping[str, Array]) -> None:
        self._data.qpos[:] = self._placement.qpos(position, objects)
        self._mujoco.mj_kinematics(self._model, self._data)  # normalises quaternions in its poses

    def _make_bodies(self) -> None:
        model = self._model
        shapes: dict[int, list[Mesh]] = {}
        for geom in range(model.ngeom):
            if model.geom_group[geom] in VISIBLE_GROUPS:
                mesh = _mesh_of(model, geom)
                if mesh is not None:
                    shapes.setdefault(int(model.geom_bodyid[geom]), []).append(mesh)
        self._shown = np.array(sorted(shapes), int)
        self.bodies = tuple(
            Body(
                name=model.body(int(i)).name or f"body{i}",
                meshes=_merged(shapes[int(i)]),
                is_moving=bool(model.body_weldid[i] != 0),
                object=self._placement.object_bodies.get(int(i), ""),
            )
            for i in self._shown
        )


def scene_of(documents: Mapping[str, str]) -> Scene | None:
    """The scene of a session, from its documents; None if the robot has no model.

    Raises:
        InvalidArgument: if the model cannot be read
    """
    return Scene(documents[MODEL]) if MODEL in documents else None


def _joined(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh of several; it is transparent, or surroundings, if the first one is."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        normals=np.concatenate([mesh.normals for mesh in meshes]),
        colours=np.concatenate([mesh.colours for mesh in meshes]),
        faces=np.concatenate(
            [mesh.faces + np.uint32(start) for mesh, start in zip(meshes, starts, strict=False)]
        ),
        is_transparent=meshes[0].is_transparent,
        is_surround=meshes[0].is_surround,
    )


def _merged(meshes: Sequence[Mesh]) -> tuple[Mesh, ...]:
    kinds: dict[tuple[bool, bool], list[Mesh]] = {}
    for mesh in meshes:
        kinds.setdefault((mesh.is_transparent, mesh.is_surround), []).append(mesh)
    return tuple(_joined(kinds[kind]) for kind in sorted(kinds))


def _matrix(quaternion: Array) -> Array:
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


Shape = tuple["Array", "Array", "Array"]  # vertices, normals, faces


def _mesh_of(model: Any, geom: int) -> Mesh | None:
    """The shape of a geom in the frame of its body; None if it cannot be seen."""
    colour = np.array(_colour(model, geom))
    if colour[3] <= 0:
        return None
    shape = _shape(model, geom)
    if shape is None:
        return None
    vertices, normals, faces = shape
    turn = _matrix(model.geom_quat[geom])
    placed = vertices @ turn.T + model.geom_pos[geom], normals @ turn.T, faces
    return _painted(placed, colour, bool(model.geom_group[geom] == SURROUND_GROUP))


def _painted(shape: tuple[Array, Array, Array], colour: Array, is_surround: bool = False) -> Mesh:
    """A mesh of vertices, normals and faces in a colour, RGBA from 0 to 1."""
    vertices, normals, faces = shape
    rgba = np.round(np.clip(colour, 0, 1) * 255).astype(np.uint8)
    return Mesh(
        vertices=vertices.astype(np.float32),
        normals=normals.astype(np.float32),
        colours=np.tile(rgba, (len(vertices), 1)),
        faces=faces.reshape(-1, 3).astype(np.uint32),
        is_transparent=bool(rgba[3] < 255),
        is_surround=is_surround,
    )


def _colour(model: Any, geom: int) -> Array:
    """RGBA from 0 to 1. A texture counts with its mean colour."""
    rgba = np.array(model.geom_rgba[geom], float)
    material = int(model.geom_matid[geom])
    if material < 0:
        return rgba
    # A colour of the geom's own goes before that of its material: MuJoCo's default is grey.
    if np.allclose(rgba, (0.5, 0.5, 0.5, 1.0)):
        rgba = np.array(model.mat_rgba[material], float)
    textures = [int(texture) for texture in np.ravel(model.mat_texid[material]) if texture >= 0]
    for texture in textures[:1]:
        first = int(model.tex_adr[texture])
        channels = int(model.tex_nchannel[texture])
        size = int(model.tex_width[texture] * model.tex_height[texture]) * channels
        pixels = model.tex_data[first : first + size].reshape(-1, channels)
        if channels >= 3:
            rgba[:3] *= pixels[:, :3].mean(axis=0) / 255.0
    return rgba


def _shape(model: Any, geom: int) -> Shape | None:
    """The surface of a geom in the geom's own frame; None for a kind without a surface."""
    import mujoco

    kind, size = int(model.geom_type[geom]), np.array(model.geom_size[geom], float)
    kinds = mujoco.mjtGeom
    if kind == kinds.mjGEOM_BOX:
        return _box(size)
    if kind == kinds.mjGEOM_PLANE:
        half = [extent if 0 < extent < LARGEST_PLANE else LARGEST_PLANE for extent in size[:2]]
        return _plane(half[0], half[1])
    if kind == kinds.mjGEOM_SPHERE:
        return _round(size[0], 0.0)
    if kind == kinds.mjGEOM_CAPSULE:
        return _round(size[0], size[1])
    if kind == kinds.mjGEOM_ELLIPSOID:
        vertices, normals, faces = _round(1.0, 0.0)
        normals = normals / size
        return vertices * size, normals / np.linalg.norm(normals, axis=1, keepdims=True), faces
    if kind == kinds.mjGEOM_CYLINDER:
        return _cylinder(size[0], size[1])
    if kind == kinds.mjGEOM_MESH:
        return _triangles(model, int(model.geom_dataid[geom]))
    if kind == kinds.mjGEOM_HFIELD:
        return _height_field(model, int(model.geom_dataid[geom]))
    return None


def _grid(rows: int, columns: int) -> Array:
    """Triangles of a grid of vertices, row after row."""
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    one = np.stack([first, first + 1, first + columns + 1], axis=1)
    two = np.stack([first, first + columns + 1, first + columns], axis=1)
    return np.concatenate([one, two])


def _plane(x: float, y: float) -> Shape:
    vertices = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]], float)
    return vertices, np.tile([0.0, 0.0, 1.0], (4, 1)), np.array([[0, 1, 2], [0, 2, 3]])


def _box(half: Array) -> Shape:
    vertices, normals, faces = [], [], []
    for axis, sign in itertools.product(range(3), (-1.0, 1.0)):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            corner = np.zeros(3)
            corner[axis], corner[one], corner[two] = sign, a, b
            vertices.append(corner * half)
        normals += [np.eye(3)[axis] * sign] * 4
        first = len(vertices) - 4
        order = (0, 1, 2, 3) if sign > 0 else (0, 3, 2, 1)
        faces += [[first + order[0], first + order[1], first + order[2]]]
        faces += [[first + order[0], first + order[2], first + order[3]]]
    return np.array(vertices), np.array(normals), np.array(faces)


def _round(radius: float, half_length: float) -> Shape:
    """A sphere, or a capsule along z if `half_length` is not zero."""
    quarter = np.linspace(-np.pi / 2, 0.0, SEGMENTS // 4 + 1)
    latitudes = np.concatenate([quarter, -quarter[::-1]])
    shifts = np.repeat([-half_length, half_length], len(quarter))
    if half_length == 0.0:  # the equator once is enough
        latitudes, shifts = np.delete(latitudes, len(quarter)), np.delete(shifts, len(quarter))
    angles = np.linspace(0.0, 2 * np.pi, SEGMENTS + 1)
    latitude, angle = np.meshgrid(latitudes, angles, indexing="ij")
    normals = np.stack(
        [np.cos(latitude) * np.cos(angle), np.cos(latitude) * np.sin(angle), np.sin(latitude)],
        axis=-1,
    ).reshape(-1, 3)
    vertices = radius * normals
    vertices[:, 2] += np.repeat(shifts, len(angles))
    return vertices, normals, _grid(len(latitudes), len(angles))


def _cylinder(radius: float, half_length: float) -> Shape:
    angles = np.linspace(0.0, 2 * np.pi, SEGMENTS + 1)
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    up = np.array([0.0, 0.0, half_length])
    vertices = [radius * ring - up, radius * ring + up]
    normals = [ring, ring]
    faces = [_grid(2, len(angles))]
    for sign in (-1.0, 1.0):
        first = sum(map(len, vertices))
        vertices += [np.concatenate([[sign * up], radius * ring + sign * up])]
        normals += [np.tile([0.0, 0.0, sign], (len(ring) + 1, 1))]
        edge = first + 1 + np.arange(len(angles) - 1)
        fan = np.stack([np.full(len(edge), first), edge, edge + 1], axis=1)
        faces.append(fan if sign > 0 else fan[:, ::-1])
    return np.concatenate(vertices), np.concatenate(normals), np.concatenate(faces)


def _triangles(model: Any, mesh: int) -> Shape:
    first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    faces = model.mesh_face[first : first + count] + model.mesh_vertadr[mesh]
    turns = model.mesh_facenormal[first : first + count] + model.mesh_normaladr[mesh]
    places = np.array(model.mesh_vert[faces], float)
    across = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    lengths = np.linalg.norm(across, axis=1, keepdims=True)
    flat = np.divide(across, lengths, out=np.zeros_like(across), where=lengths > 0)[:, None]
    # Smooth where the model is smooth. MuJoCo's normals of hulls can point anywhere.
    smooth = np.array(model.mesh_normal[turns], float)
    agrees = np.einsum("fci,fci->fc", smooth, np.broadcast_to(flat, smooth.shape)) > SMOOTH
    normals = np.where(agrees[..., None], smooth, flat).reshape(-1, 3)
    rows = np.concatenate([faces.reshape(-1, 1), np.round(normals, 4)], axis=1)
    _, corners, index = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return places.reshape(-1, 3)[corners], normals[corners], np.reshape(index, (-1, 3))


def _height_field(model: Any, field: int) -> Shape:
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    x, y, top, _ = model.hfield_size[field]
    first = int(model.hfield_adr[field])
    heights = model.hfield_data[first : first + rows * columns].reshape(rows, columns) * top
    places = np.meshgrid(np.linspace(-y, y, rows), np.linspace(-x, x, columns), indexing="ij")
    vertices = np.stack([places[1], places[0], heights], axis=-1).reshape(-1, 3)
    slopes = np.gradient(heights, 2 * y / (rows - 1), 2 * x / (columns - 1))
    normals = np.stack([-slopes[1], -slopes[0], np.ones_like(heights)], axis=-1).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return vertices, normals, _grid(rows, columns)
