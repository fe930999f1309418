# SPDX-License-Identifier: BSD-3-Clause
"""Simulated cameras. Images are drawn by this project's renderer, without noise."""

from collections.abc import Sequence
from math import radians, tan
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
import trifinger
from scipy.spatial.transform import Rotation
from trifinger import foreign_yaml
from trifinger_compat.camera_files import IDS, MATRICES, matrix_text
from trifinger_compat.generation import chosen
from trifinger_compat.handles import Client
from trifinger_compat.types import Array, Image, Numbers
from trifinger_compat.world import world_of

# What TriFingerCameras are: position [m] and orientation x, y, z, w, as OpenCV has it.
_SIMPLE_POSES = (
    ((0.2496, 0.2458, 0.4190), (0.3760, 0.8690, -0.2918, -0.1354)),
    ((0.0047, -0.2834, 0.4558), (0.9655, -0.0098, -0.0065, -0.2603)),
    ((-0.2470, 0.2513, 0.3943), (-0.3633, 0.8686, -0.3141, 0.1220)),
)

# What planes of cameras must leave [m]: between them is all that the original's cameras can see.
_NEAREST, _FARTHEST = 0.1, 1.5
_SIZE = chosen().image_size


def calib_data_to_matrix(data: dict[str, Any]) -> Array:
    """The matrix of a calibration file's {rows, cols, data}."""
    return foreign_yaml.matrix(data)


def rbg_to_bayer_bg(image: Image) -> Image:
    """The Bayer mosaic of an RGB image: rows R G and G B, height x width."""
    bayer = np.array(image[:, :, 1])
    bayer[0::2, 0::2] = image[0::2, 0::2, 0]
    bayer[1::2, 1::2] = image[1::2, 1::2, 2]
    return bayer


class CameraParameters(NamedTuple):
    """A calibrated camera."""

    name: str
    width: int
    height: int
    camera_matrix: Array
    distortion_coefficients: Array  # five numbers
    tf_world_to_camera: Array

    @classmethod
    def load(cls, stream: IO[str]) -> "CameraParameters":
        """Reads a calibration file."""
        content = foreign_yaml.parse(stream.read())
        matrices = [foreign_yaml.matrix(content[name]) for name in MATRICES]
        size = content["image_width"], content["image_height"]
        return cls(content["camera_name"], *size, matrices[0], matrices[1].ravel(), matrices[2])

    def dump(self, stream: IO[str]) -> None:
        """Writes a calibration file."""
        text = f"camera_name: {self.name}\n"
        text += f"image_height: {self.height}\nimage_width: {self.width}\n"
        for name, matrix in zip(MATRICES, self[3:], strict=True):
            text += matrix_text(name, np.atleast_2d(matrix))
        stream.write(text)


def load_camera_parameters(
    config_dir: str | Path, filename_pattern: str = "camera{id}.yml"
) -> list[CameraParameters]:
    """Reads the calibration files of the cameras 60, 180 and 300."""
    parameters = []
    for camera_id in IDS:
        with Path(config_dir, filename_pattern.format(id=camera_id)).open() as file:
            parameters.append(CameraParameters.load(file))
    return parameters


def _check_planes(near: float, far: float) -> None:
    """Raises an error for planes that are wrong, or that would hide what images here show."""
    if not 0 < near < far:
        raise ValueError(
            f"near_plane_distance is {near} m and far_plane_distance {far} m, must be greater than "
            "0 and in this order"
        )
    if near > _NEAREST or far < _FARTHEST:
        raise NotImplementedError(
            f"near_plane_distance is {near} m and far_plane_distance {far} m: images here show all "
            f"that is in front of a camera, so give at most {_NEAREST} m and at least {_FARTHEST} m"
        )


class BaseCamera:
    """A camera of a simulation."""

    def __init__(self, described: trifinger.Camera, pybullet_client_id: Client | int) -> None:
        self._described = described
        self._pybullet_client_id = pybullet_client_id
        self._renderer: trifinger.CameraRenderer | None = None
        self._rendered: object = None
        # By the original's names, for programs that read them.
        self._output_width, self._output_height = described.width, described.height

    def get_image(self, renderer: Any = None) -> Image:  # noqa: ARG002  # there is one renderer
        """What the camera sees now: RGB, height x width x 3."""
        world = world_of(self._pybullet_client_id)
        if self._renderer is None or self._rendered is not world.core:
            world.core.configuration()  # builds the core, if need be
            self._renderer = trifinger.CameraRenderer(
                world.config,
                world.overrides,
                calibration=trifinger.CameraCalibration([self._described]).text(),
                pixels="rgb8",
                read_noise=0.0,
                shot_noise=0.0,
            )
            self._rendered = world.core
        configuration = world.core.configuration()
        return self._renderer.render(configuration, 0)[0]

    def get_bayer_image(self, renderer: Any = None) -> Image:
        """The same as a Bayer mosaic, rows R G and G B: height x width x 1."""
        return rbg_to_bayer_bg(self.get_image(renderer))[:, :, None]

    def get_width(self) -> int:
        """Width of the image [pixel]."""
        return self._described.width

    def get_height(self) -> int:
        """Height of the image [pixel]."""
        return self._described.height


def _view(position: Array, orientation: Numbers) -> Array:
    """The pose of a camera that looks as the original's does.

    The original takes the third axis of `orientation`, which has a length of 1 m, for the point
    that is looked at. So a camera looks where it was meant to only if it looks at the origin from
    1 m away; TriFingerCameras miss by 0.6 to 1.05 degrees. Pictures are comparable only so.
    """
    _, up, target = (Rotation.from_quat(orientation).as_matrix() * (1, -1, 1)).T
    forward = target - position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.stack([right, np.cross(forward, right), forward, position], axis=1)
    return pose


class Camera(BaseCamera):
    """A camera without distortion, at a position [m] and with an orientation x, y, z, w.

    The orientation's third axis is the point of the world that is looked at [m]; its second one
    points down in the image.
    """

    def __init__(
        self,
        camera_position: Numbers,
        camera_orientation: Numbers,
        image_size: tuple[int, int] = (_SIZE, _SIZE),
        field_of_view: float = 52,
        near_plane_distance: float = 0.001,
        far_plane_distance: float = 100.0,
        pybullet_client_id: Client | int = 0,
    ) -> None:
        """`image_size` is width and height [pixel], `field_of_view` that of the height [degree]."""
        _check_planes(near_plane_distance, far_plane_distance)
        width, height = image_size
        focal_length = height / 2 / tan(radians(field_of_view) / 2)
        pose = _view(np.asarray(camera_position, dtype=float), camera_orientation)
        lens = trifinger.Lens([focal_length] * 2, [(width - 1) / 2, (height - 1) / 2])
        super().__init__(
            trifinger.Camera("camera", width, height, "rgb8", lens, pose), pybullet_client_id
        )


class CalibratedCamera(BaseCamera):
    """A camera whose lens and pose were measured."""

    def __init__(
        self,
        camera_matrix: Numbers,
        distortion_coefficients: Numbers,
        tf_world_to_camera: Numbers,
        image_size: tuple[int, int],
        near_plane_distance: float = 0.02,
        far_plane_distance: float = 2.0,
        pybullet_client_id: Client | int = 0,
    ) -> None:
        """`image_size` is width and height [pixel]."""
        _check_planes(near_plane_distance, far_plane_distance)
        width, height = image_size
        matrix = np.asarray(camera_matrix, dtype=float)
        distortion = np.zeros(5)
        given = np.ravel(np.asarray(distortion_coefficients, dtype=float))[:5]
        distortion[: len(given)] = given
        lens = trifinger.Lens(
            [matrix[0, 0], matrix[1, 1]], [matrix[0, 2], matrix[1, 2]], distortion
        )
        from_world = np.asarray(tf_world_to_camera, dtype=float)
        # The stored matrices are means, and not quite rotations.
        u, _, v = np.linalg.svd(from_world[:3, :3])
        rotation = u @ v
        pose = np.eye(4)
        pose[:3, :3] = rotation.T
        pose[:3, 3] = -rotation.T @ from_world[:3, 3]
        super().__init__(
            trifinger.Camera("camera", width, height, "rgb8", lens, pose), pybullet_client_id
        )

    def distort_image(self, image: Image) -> Image:
        """An image of a camera without distortion, as this lens shows it; black where it ends.

        It may have margins on all sides: its middle is that of this camera's images.
        """
        height, width = image.shape[:2]
        margins = (width - self._described.width) // 2, (height - self._described.height) // 2
        lens = self._described.lens.cropped(-margins[0], -margins[1])
        rows, columns = np.mgrid[:height, :width]
        rays = lens.unproject(np.stack([columns.ravel(), rows.ravel()], axis=1).astype(float))
        seen = np.rint(rays[:, :2] * lens.focal_length + lens.principal_point).astype(int)
        is_inside = np.all((seen >= 0) & (seen < (width, height)), axis=1).reshape(height, width)
        x, y = seen.T.reshape(2, height, width) * is_inside
        distorted = np.zeros_like(image)
        distorted[is_inside] = image[y, x][is_inside]
        return distorted


class CameraArray:
    """Several cameras."""

    def __init__(self, cameras: Sequence[BaseCamera]) -> None:
        self.cameras: list[Any] = list(cameras)

    def get_images(self, renderer: Any = None) -> list[Image]:
        """What the cameras see now: RGB, height x width x 3."""
        return [
            each.get_image() if renderer is None else each.get_image(renderer)
            for each in self.cameras
        ]

    def get_bayer_images(self, renderer: Any = None) -> list[Image]:
        """The same as Bayer mosaics, height x width x 1."""
        return [rbg_to_bayer_bg(image)[:, :, None] for image in self.get_images(renderer)]


class TriFingerCameras(CameraArray):
    """The cameras 60, 180 and 300 without distortion; arguments are those of Camera."""

    def __init__(self, **camera_kwargs: Any) -> None:
        super().__init__([Camera(*pose, **camera_kwargs) for pose in _SIMPLE_POSES])


def create_trifinger_camera_array(
    camera_parameters: Sequence[CameraParameters],
    pybullet_client_id: Client | int = 0,
    near_plane_distance: float = 0.02,
    far_plane_distance: float = 2.0,
) -> CameraArray:
    """The cameras of calibrations, which must be those of 60, 180 and 300 in this order."""
    names = [each.name for each in camera_parameters]
    if names != [f"camera{camera_id}" for camera_id in IDS]:
        raise ValueError(f"the cameras are {names}, must be camera60, camera180, camera300")
    return CameraArray(
        [
            CalibratedCamera(
                each.camera_matrix,
                each.distortion_coefficients,
                each.tf_world_to_camera,
                (each.width, each.height),
                near_plane_distance,
                far_plane_distance,
                pybullet_client_id,
            )
            for each in camera_parameters
        ]
    )


def create_trifinger_camera_array_from_config(
    config_dir: str | Path,
    calib_filename_pattern: str = "camera{id}.yml",
    pybullet_client_id: Client | int = 0,
    **kwargs: Any,
) -> CameraArray:
    """The cameras of the calibration files in a folder."""
    parameters = load_camera_parameters(config_dir, calib_filename_pattern)
    return create_trifinger_camera_array(parameters, pybullet_client_id, **kwargs)
