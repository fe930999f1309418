# SPDX-License-Identifier: BSD-3-Clause
"""Drawing where the cube is into images."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from trifinger_compat.opencv import opencv
from trifinger_compat.types import Array, Image, PoseLike
from trifinger_simulation.camera import CameraParameters

MODEL = "cube_v2"
WIDTH = 0.0652  # of the tracker's cube [m]
# Corners of each face, and its colour in BGR: +x, +y, +z, -z, -x, -y.
_FACES = (
    ((4, 5, 7, 6), (0, 0, 255)),
    ((2, 3, 7, 6), (0, 255, 0)),
    ((1, 3, 7, 5), (255, 0, 0)),
    ((0, 2, 6, 4), (255, 255, 0)),
    ((0, 1, 3, 2), (255, 0, 255)),
    ((0, 1, 5, 4), (0, 255, 255)),
)
_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
_NORMALS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [-1, 0, 0], [0, -1, 0]])


class CubeVisualizer:
    """Draws the cube into the images of three calibrated cameras."""

    def __init__(
        self, cube_model: Any, calibration_files: Sequence[str | Path] | None = None
    ) -> None:
        """Programs of 2020 give only the files. Raises NotImplementedError for other objects."""
        if calibration_files is not None and cube_model != MODEL:
            raise NotImplementedError(
                f"CubeVisualizer draws '{MODEL}', a cube of {WIDTH * 1e3:.1f} mm with six colours, "
                f"and the model is {cube_model!r}, whose size and colours are not known here; draw "
                "it with the lens and pose of a trifinger_simulation.camera.CameraParameters"
            )
        files = cube_model if calibration_files is None else calibration_files
        self._cameras = []
        for path in files:
            with Path(path).open() as file:
                self._cameras.append(CameraParameters.load(file))

    def draw_cube(
        self,
        images: Sequence[Image],
        object_pose: PoseLike,
        fill: bool = True,
        opacity: float = 0.5,
    ) -> list[Image]:
        """The images (BGR) with the faces of the cube that the cameras can see."""
        cv2 = opencv()

        rotation = Rotation.from_quat(object_pose.orientation).as_matrix()
        position = np.asarray(object_pose.position, dtype=float)
        corners = (_SIGNS * WIDTH / 2) @ rotation.T + position
        drawn = []
        for camera, image in zip(self._cameras, images, strict=True):
            result = np.array(image)
            pixels = np.rint(self._project(camera, corners)).astype(np.int32)
            eye = _eye(camera)
            for (face, colour), normal in zip(_FACES, _NORMALS, strict=True):
                outward = rotation @ normal
                if (eye - (position + outward * WIDTH / 2)) @ outward <= 0:
                    continue
                outline = pixels[list(face)]
                if fill:
                    cv2.fillConvexPoly(result, outline, colour)
                else:
                    cv2.polylines(result, [outline], True, colour, 2)
            mixed = cv2.addWeighted(result, opacity, np.array(image), 1 - opacity, 0)
            drawn.append(np.asarray(mixed, dtype=np.uint8))
        return drawn

    def draw_circle(
        self,
        images: Sequence[Image],
        object_pose: PoseLike,
        fill: bool = True,
        opacity: float = 0.5,
        scale: float = 1.0,
    ) -> list[Image]:
        """The images (BGR) with a circle where the cube is."""
        cv2 = opencv()

        position = np.asarray(object_pose.position, dtype=float)
        drawn = []
        for camera, image in zip(self._cameras, images, strict=True):
            result = np.array(image)
            x, y = np.rint(self._project(camera, position[None])[0]).astype(int).tolist()
            distance = float(np.linalg.norm(_eye(camera) - position))
            radius = round(scale * camera.camera_matrix[0, 0] * WIDTH / 2 / distance)
            cv2.circle(result, (x, y), radius, (0, 255, 0), -1 if fill else 2)
            mixed = cv2.addWeighted(result, opacity, np.array(image), 1 - opacity, 0)
            drawn.append(np.asarray(mixed, dtype=np.uint8))
        return drawn

    @staticmethod
    def _project(camera: CameraParameters, points: Array) -> Array:
        cv2 = opencv()

        turn = Rotation.from_matrix(camera.tf_world_to_camera[:3, :3]).as_rotvec()
        pixels, _ = cv2.projectPoints(
            points,
            turn,
            camera.tf_world_to_camera[:3, 3],
            camera.camera_matrix,
            camera.distortion_coefficients,
        )
        return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)


def _eye(camera: CameraParameters) -> Array:
    """Where a camera is, in the world."""
    return -camera.tf_world_to_camera[:3, :3].T @ camera.tf_world_to_camera[:3, 3]
