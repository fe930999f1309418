# SPDX-License-Identifier: BSD-3-Clause
"""Scenes at random to test a tracker: a cube anywhere in the arena, and fingers at it."""

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import trifinger
from trifinger import Camera, CameraCalibration, poses
from trifinger.control import Kinematics

CONFIG = Path(__file__).parent.parent / "config"
VARIANTS = ("edu", "pro", "one")
SIZE = 0.065  # of the cube [m]
TIP_RADIUS = 0.0095  # estimate for all variants [m]
DEEPEST = 0.003  # fingers may overlap this far with the cube or each other [m]
ARENA = 0.17  # radius in which the cube's centre lies [m]
HIGHEST = 0.13  # [m]: above, the cube leaves the images
AXES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [-1, 0, 0], [0, -1, 0]])
"""Where the faces of the cube look to, in its frame."""
DRAWN = np.array([1, 1, 1, 0, 0, 0], np.uint8)  # groups of parts that cameras see
UPS = np.array(  # rotations that put each face on the table
    [[1, 0, 0, 0], [0, 1, 0, 0], [1, 1, 0, 0], [1, -1, 0, 0], [1, 0, 1, 0], [1, 0, -1, 0]], float
)


class Scene(NamedTuple):
    """A robot with a cube."""

    configuration: np.ndarray
    """MuJoCo's qpos."""
    position: np.ndarray
    """Of the cube [m]."""
    orientation: np.ndarray
    """Of the cube: a quaternion w, x, y, z."""
    contacts: int
    """Fingers at the cube."""

    @property
    def pose(self) -> np.ndarray:
        """Of the cube (4, 4)."""
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, self.orientation)
        return poses.pose(rotation.reshape(3, 3), self.position)


def config_of(variant: str, folder: Path) -> str:
    """Writes a configuration of that robot with a cube, and returns its path."""
    base = (CONFIG / "sim.yml").read_text()
    path = folder / f"{variant}.yml"
    path.write_text(base.replace("trifinger_edu.yml", f"{CONFIG}/trifinger_{variant}.yml"))
    return str(path)


def cameras_of(calibration: str) -> Sequence[Camera]:
    """The cameras in the text of a calibration."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cameras.yml"
        path.write_text(calibration)
        return CameraCalibration.read(path).cameras


def faces_in_image(
    camera: Camera, position: np.ndarray, first_face: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> np.ndarray:
    """For each pixel the number of the face of the cube that it shows; -1 for everything else.

    `first_face` gives these numbers for rays: where all begin, and their directions (n, 3).
    """
    faces = np.full((camera.height, camera.width), -1, np.int8)
    signs = np.array(np.meshgrid(*3 * [(-1, 1)])).reshape(3, -1).T
    # A box that holds the cube in any orientation.
    seen = camera.project(position + SIZE * signs)
    size = np.array([camera.width, camera.height])
    left, top = np.clip(np.floor(seen.min(axis=0)), 0, size).astype(int)
    right, bottom = np.clip(np.ceil(seen.max(axis=0)) + 1, 0, size).astype(int)
    if left >= right or top >= bottom:
        return faces
    x, y = np.meshgrid(np.arange(left, right), np.arange(top, bottom))
    rays = camera.lens.unproject(np.stack([x.ravel(), y.ravel()], axis=1).astype(float))
    pose = np.asarray(camera.pose)
    directions = np.column_stack([rays[:, :2], np.ones(len(rays))]) @ pose[:3, :3].T
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    faces[top:bottom, left:right] = first_face(pose[:3, 3], directions).reshape(x.shape)
    return faces


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The product of two quaternions."""
    result = np.zeros(4)
    mujoco.mju_mulQuat(result, a, b)
    return result / np.linalg.norm(result)


def angle(a: np.ndarray, b: np.ndarray) -> float:
    """The angle of the rotation from a to b [degrees]."""
    return float(np.degrees(2 * np.arccos(min(1.0, abs(float(np.dot(a, b)))))))


class Scenes:
    """Scenes of one robot. Equal numbers give equal scenes."""

    def __init__(self, config: str) -> None:
        """`config` is the path of a configuration with a cube as its only object."""
        self._model = mujoco.MjModel.from_xml_string(trifinger.export_mjcf(config))
        self._data = mujoco.MjData(self._model)
        self._kinematics = Kinematics(config)
        self._joints = self._kinematics.num_joints
        # The number of the face that each part of the model is. Faces are thin boxes.
        self._faces = np.full(self._model.ngeom + 1, -1, np.int8)  # the last one: nothing
        for geom in range(self._model.ngeom):
            body, place = self._model.geom_bodyid[geom], self._model.geom_pos[geom]
            if self._model.body_dofnum[body] == 6 and np.any(place):
                self._faces[geom] = np.argmax(AXES @ place)

    def draw(self, seed: int, number: int) -> Scene:
        """Scene `number`: most cubes lie on the table, and most are touched by some fingers."""
        random = np.random.default_rng([seed, number])
        position, orientation = self._pose(random)
        data = self._data
        data.qpos[:] = self._model.key_qpos[0]
        data.qpos[: self._joints] += random.normal(scale=0.15, size=self._joints)
        data.qpos[self._joints :] = [*position, *orientation]
        contacts = 0
        if random.random() < 0.75:
            for finger in random.permutation(self._joints // 3):
                contacts += self._reach(int(finger), position, orientation, random)
        return Scene(data.qpos.copy(), position, orientation, contacts)

    def faces(self, scene: Scene, cameras: Sequence[Camera]) -> list[np.ndarray]:
        """The faces of the cube that cameras see, fingers in front of them included."""
        model, data = self._model, self._data
        data.qpos[:] = scene.configuration
        mujoco.mj_forward(model, data)

        def first_face(origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
            count = len(directions)
            geoms, distances = np.zeros(count, np.int32), np.zeros(count)
            mujoco.mj_multiRay(
                model,
                data,
                origin,
                directions.ravel(),
                DRAWN,
                True,
                -1,
                geoms,
                distances,
                None,
                count,
                mujoco.mjMAXVAL,
            )
            return self._faces[geoms]

        return [faces_in_image(camera, scene.position, first_face) for camera in cameras]

    def _pose(self, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        kind = random.random()
        yaw = random.uniform(0, 2 * np.pi)
        upright = UPS[random.integers(len(UPS))]
        flat = product(np.array([np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)]), upright)
        height = SIZE / 2
        if kind < 0.6:
            orientation = flat
        elif kind < 0.8:  # held, and a little tilted
            tilt = np.array([1, *random.normal(scale=0.07, size=3)])
            orientation = product(tilt, flat)
            height = random.uniform(SIZE / 2, HIGHEST)
        else:
            orientation = random.normal(size=4)
            orientation /= np.linalg.norm(orientation)
            height = random.uniform(SIZE * np.sqrt(3) / 2, HIGHEST)
        radius = ARENA * np.sqrt(random.random()) * (1 if height < 0.08 else 0.6)
        heading = random.uniform(0, 2 * np.pi)
        return np.array([radius * np.cos(heading), radius * np.sin(heading), height]), orientation

    def _reach(
        self,
        finger: int,
        position: np.ndarray,
        orientation: np.ndarray,
        random: np.random.Generator,
    ) -> bool:
        """Puts a tip at a face of the cube if it finds a way that overlaps with nothing."""
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, orientation)
        joints = slice(3 * finger, 3 * finger + 3)
        before = self._data.qpos[joints].copy()
        for _ in range(8):
            axis, side = random.integers(3), random.choice([-1, 1])
            point = random.uniform(-0.8, 0.8, 3) * SIZE / 2
            point[axis] = side * (SIZE / 2 + TIP_RADIUS)
            tip = position + rotation.reshape(3, 3) @ point
            pose, reach = self._kinematics.inverse_kinematics(finger, tip)
            if reach != "yes":
                continue
            self._data.qpos[joints] = pose
            mujoco.mj_forward(self._model, self._data)
            if all(
                contact.dist > -DEEPEST
                for contact in self._data.contact[: self._data.ncon]
                if self._moves(contact.geom1) or self._moves(contact.geom2)
            ):
                return True
            self._data.qpos[joints] = before
        return False

    def _moves(self, geom: int) -> bool:
        return int(self._model.body_weldid[self._model.geom_bodyid[geom]]) != 0
