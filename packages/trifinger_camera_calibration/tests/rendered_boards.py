# SPDX-License-Identifier: BSD-3-Clause
"""Images of boards by ray casting, with the truth about lenses and poses.

Knows nothing of the calibration under test: lens, geometry and mosaic are written again here, and
OpenCV draws the boards.
"""

import dataclasses
from pathlib import Path

import cv2
import numpy as np
from trifinger_camera_calibration.board import Board

CELLS = 4000  # pixels of a drawn board per metre
MARGIN = 0.010  # white around the pattern [m]

# Lens and pose of the cameras of a real robot, at 540 x 540 pixels: fx fy cx cy, distortion,
# position and orientation (w, x, y, z; x right, y up, looking back along z).
REAL = {
    "camera60": (
        (587.298, 591.540, 291.286, 277.456),
        (-0.23805, 0.10826, -0.00246, 0.00005, -0.02723),
        (0.24998, 0.24582, 0.38930),
        (0.36162, 0.13517, 0.32880, 0.86189),
    ),
    "camera180": (
        (585.064, 587.965, 281.135, 278.415),
        (-0.23739, 0.14669, -0.00336, 0.00022, -0.13565),
        (-0.00169, -0.26687, 0.46216),
        (0.96447, 0.26419, -0.00029, 0.00070),
    ),
    "camera300": (
        (586.437, 590.807, 288.080, 284.183),
        (-0.23391, 0.09394, -0.00279, -0.00007, -0.01742),
        (-0.25001, 0.24745, 0.38901),
        (0.35182, 0.13976, -0.32376, -0.86711),
    ),
}


def rotation(quaternion: tuple[float, ...] | np.ndarray) -> np.ndarray:
    w, x, y, z = np.asarray(quaternion) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def turn(axis: str, angle: float) -> np.ndarray:
    """Rotation about an axis [rad]."""
    quaternion = np.zeros(4)
    quaternion[0] = np.cos(angle / 2)
    quaternion["xyz".index(axis) + 1] = np.sin(angle / 2)
    return rotation(quaternion)


@dataclasses.dataclass
class TrueCamera:
    name: str
    intrinsics: tuple[float, float, float, float]
    distortion: tuple[float, float, float, float, float]
    pose: np.ndarray  # camera in the world: x right, y down, z forward
    size: tuple[int, int] = (540, 540)
    samples: int = 3  # along each side of a pixel
    _rays: np.ndarray | None = None

    def bend(self, rays: np.ndarray) -> np.ndarray:
        k1, k2, p1, p2, k3 = self.distortion
        x, y = rays[..., 0], rays[..., 1]
        r2 = x * x + y * y
        radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        return np.stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
            ],
            axis=-1,
        )

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixels of points of the world."""
        seen = (points - self.pose[:3, 3]) @ self.pose[:3, :3]
        fx, fy, cx, cy = self.intrinsics
        return self.bend(seen[:, :2] / seen[:, 2:]) * (fx, fy) + (cx, cy)

    def rays(self) -> np.ndarray:
        """Directions of all samples of all pixels in the world."""
        if self._rays is None:
            fx, fy, cx, cy = self.intrinsics
            width, height = self.size
            # Lenses are smooth: between the middles of pixels, and one more at each edge, straight
            # lines are off by less than 1e-3 pixels.
            pixels = np.stack(
                np.meshgrid(np.arange(-1.0, width + 1), np.arange(-1.0, height + 1)), -1
            )
            bent = (pixels - (cx, cy)) / (fx, fy)
            rays = bent.copy()
            for _ in range(20):  # a fixed point, unlike the Newton steps of the code under test
                rays += bent - self.bend(rays)
            count = self.samples
            rays = cv2.resize(rays, None, fx=count, fy=count)[count:-count, count:-count]
            rays = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=-1)
            self._rays = (rays @ self.pose[:3, :3].T).astype(np.float32)
        return self._rays


def real_cameras() -> dict[str, TrueCamera]:
    cameras = {}
    for name, (intrinsics, distortion, position, quaternion) in REAL.items():
        pose = np.eye(4)
        pose[:3, :3] = rotation(quaternion) @ np.diag([1.0, -1.0, -1.0])
        pose[:3, 3] = position
        cameras[name] = TrueCamera(name, intrinsics, distortion, pose)
    return cameras


def drawn(board: Board) -> np.ndarray:
    """How much light the pattern and a white margin reflect.

    It is as smooth as the samples of a pixel are far apart, or edges would be ragged.
    """
    size = tuple(round(side * CELLS) for side in board.size)
    picture = board.to_opencv().generateImage(size, marginSize=0, borderBits=1)
    reflected = np.pad(0.06 + 0.94 / 255 * picture, round(MARGIN * CELLS), constant_values=1.0)
    return cv2.GaussianBlur(reflected.astype(np.float32), (0, 0), 1.3)


@dataclasses.dataclass(kw_only=True)
class Look:
    """Light and sensor."""

    white: float = 200.0
    blur: float = 0.6  # [pixel]
    motion: float = 0.0  # [pixel], along a row
    noise: float = 2.0
    gains: tuple[float, float, float] = (0.55, 1.0, 0.7)  # of red, green, blue
    scale: float = 1.0  # of the print


def render(
    camera: TrueCamera, board: Board, pose: np.ndarray, look: Look, pixels: str, seed: int
) -> np.ndarray:
    """An image of a board whose pose in the world is given."""
    picture = drawn(board)
    width, height = camera.size
    light = np.full((height, width), 0.3, np.float32)
    outline = np.array([[x, y, 0.0] for x in (-1, 1) for y in (-1, 1)])
    outline *= (*(np.array(board.size) / 2 + MARGIN) * look.scale, 0)
    middle = np.array([*board.size, 0]) / 2 * look.scale
    seen = camera.project((outline + middle) @ pose[:3, :3].T + pose[:3, 3])
    left, top = np.clip(np.floor(seen.min(axis=0)).astype(int) - 8, 0, camera.size)
    right, bottom = np.clip(np.ceil(seen.max(axis=0)).astype(int) + 9, 0, camera.size)
    count = camera.samples
    rays = camera.rays()[top * count : bottom * count, left * count : right * count]
    depth = ((pose[:3, 3] - camera.pose[:3, 3]) @ pose[:3, 2]) / (rays @ pose[:3, 2])
    points = camera.pose[:3, 3] - pose[:3, 3] + rays * depth[..., None]
    local = points @ pose[:3, :2] / look.scale
    at = ((local + MARGIN) * CELLS - 0.5).astype(np.float32)
    lit = cv2.remap(picture, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderValue=0.3)
    light[top:bottom, left:right] = lit.reshape(bottom - top, count, right - left, count).mean(
        axis=(1, 3)
    )
    light = cv2.GaussianBlur(light, (0, 0), look.blur)
    if look.motion:
        light = cv2.blur(light, (round(look.motion), 1))
    random = np.random.default_rng(seed)
    if pixels == "bayer_rggb8":
        red, green, blue = look.gains
        light = light * np.tile([[red, green], [green, blue]], (height // 2, width // 2))
    image = light * look.white
    if pixels == "rgb8":
        image = image[..., None] * look.gains
    image = image + random.normal(0, look.noise, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def save(image: np.ndarray, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), image if image.ndim == 2 else image[..., ::-1])


def flat(board: Board, x: float, y: float, yaw: float, height: float = 0.0) -> np.ndarray:
    """A board on the table with its middle at x, y."""
    pose = np.eye(4)
    pose[:3, :3] = turn("z", yaw) @ np.diag([1.0, -1.0, -1.0])
    middle = np.array([*board.size, 0]) / 2
    pose[:3, 3] = np.array([x, y, board.thickness + height]) - pose[:3, :3] @ middle
    return pose


def held(
    board: Board, x: float, y: float, z: float, turns: tuple[float, float, float]
) -> np.ndarray:
    """A board in the air: its middle, and yaw, pitch and roll."""
    pose = np.eye(4)
    yaw, pitch, roll = turns
    pose[:3, :3] = turn("z", yaw) @ turn("y", pitch) @ turn("x", roll) @ np.diag([1.0, -1.0, -1.0])
    middle = np.array([*board.size, 0]) / 2
    pose[:3, 3] = np.array([x, y, z]) - pose[:3, :3] @ middle
    return pose


def places(board: Board, free: int = 14, seed: int = 1) -> dict[str, np.ndarray]:
    """What somebody with a board would do: at the mark, on the table, in the air."""
    random = np.random.default_rng(seed)
    poses = {
        "mark": flat(board, 0, 0, 0),
        "table_1": flat(board, 0.06, 0.03, 0.7),
        "table_2": flat(board, -0.05, 0.05, 2.2),
        "table_3": flat(board, 0.02, -0.06, -1.2),
        "raised_60mm": flat(board, 0.01, 0.02, 0.3, 0.06),
    }
    for number in range(free):
        turns = (random.uniform(-3.1, 3.1), random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5))
        x, y = random.uniform(-0.1, 0.1, 2)
        poses[f"held_{number:02}"] = held(board, x, y, random.uniform(0.04, 0.16), turns)
    return poses


def write_images(
    folder: Path,
    cameras: dict[str, TrueCamera],
    board: Board,
    poses: dict[str, np.ndarray],
    look: Look | None = None,
    pixels: str = "bayer_rggb8",
) -> None:
    for number, camera in enumerate(cameras.values()):
        for step, (name, pose) in enumerate(poses.items()):
            image = render(camera, board, pose, look or Look(), pixels, 1000 * number + step)
            save(image, folder / camera.name / f"{name}.png")
