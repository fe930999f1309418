# SPDX-License-Identifier: BSD-3-Clause
"""Photographs of scenes, as far as a ray tracer can take them.

Lamps of several colours, soft shadows, sheen, dirt and scratches, a table with grain, hands, blur,
a sensor with filters that overlap, a white balance that is off, tone curves, chromatic noise.
"""

from typing import Any, NamedTuple

import mujoco
import numpy as np
import trifinger
from ray_tracer import (
    BANDS,
    Box,
    Capsule,
    Lamp,
    Plane,
    Shape,
    Surface,
    Texture,
    Tracer,
    Wall,
    World,
    diode,
    glow,
    nearest,
    peak,
    step,
)
from tracking_scenes import Scene, cameras_of, faces_in_image
from trifinger.arrays import Array

SAMPLES = 9  # rays per pixel where the object is
COARSE = 3  # pixels per ray elsewhere, in each direction
COARSE_SAMPLES = 4
MARGIN = 14  # around the object [pixel]
EXPOSURE = 0.0015  # [s]
CALIBRATION_ERROR = 0.5  # root mean square in the arena [pixel]
MEAN_LEVEL = (55, 115)  # of the images: robots are set up to some 90
FACES = ("red", "green", "blue", "cyan", "magenta", "yellow")  # +x, +y, +z, -z, -x, -y
RED, GREEN, BLUE = 598.0, 532.0, 462.0  # middle of the filters [nm]


class Light(NamedTuple):
    """How a photograph differs from others of the same scene."""

    sensor: Array
    """Sensitivities of red, green and blue."""
    gains: Array
    tone: float
    shoulder: float
    electrons: float
    """Per level."""
    read_noise: float
    vignetting: Array
    blur: float
    """Of the lens: standard deviation [pixel]."""


def pigments(random: np.random.Generator) -> dict[str, Array]:
    """The spectra of the six colours, of a maker who mixes them anew each time.

    Clean and in daylight, they are as saturated as the published pictures of the cube's faces.
    """

    def near(value: float, spread: float) -> float:
        return float(random.normal(value, spread))

    floor = random.uniform(0.01, 0.03)
    full = random.uniform(0.85, 1.1)
    magenta = 0.5 * step(near(603, 6), 11) + 0.42 * peak(near(438, 6), near(30, 3))
    return {
        "red": floor + 0.62 * full * step(near(598, 6), near(9, 1)),
        "green": floor + 0.03 + 0.5 * full * peak(near(534, 6), near(34, 4)),
        "blue": floor + 0.34 * full * peak(near(450, 6), near(27, 3)),
        "cyan": floor + 0.09 + 0.5 * full * peak(near(495, 6), near(46, 4)),
        "magenta": floor + 0.07 + full * magenta,
        "yellow": floor + 0.06 + 0.72 * full * step(near(513, 5), near(12, 1)),
    }


def sensor(random: np.random.Generator) -> Array:
    """Three filters that overlap, and let some of all light through."""
    rows = []
    for middle, width in ((RED, 30.0), (GREEN, 33.0), (BLUE, 26.0)):
        row = peak(random.normal(middle, 4), random.normal(width, 2))
        row += random.uniform(0.0, 0.025)
        rows.append(row / row.sum())
    return np.array(rows)


def lamp_spectrum(random: np.random.Generator) -> Array:
    """A lamp as one buys them, or a window."""
    kelvin = random.uniform(2700, 6800)
    return diode(kelvin) if random.random() < 0.6 else glow(kelvin)


class Studio:
    """Takes photographs of the scenes of one robot. Equal numbers give equal photographs."""

    def __init__(self, config: str, half: Array | None = None) -> None:
        """`half` are half the lengths of the box [m]; default: the cube of 65 mm."""
        self._model = mujoco.MjModel.from_xml_string(trifinger.export_mjcf(config))
        self._data = mujoco.MjData(self._model)
        self._half = np.full(3, 0.0325) if half is None else np.asarray(half, float)
        self.calibration = trifinger.CameraRenderer(config).calibration
        self._cameras = cameras_of(self.calibration)

    def take(self, scene: Scene, seed: int, number: int, again: int = 0) -> list[Array]:
        """One image of each camera. Other `again` give the same photographs with other noise."""
        random = np.random.default_rng([seed, number, 7])
        world = self._world(scene, random)
        light = self._light(world, random)
        velocity = np.zeros(6)
        if random.random() < 0.4:
            velocity = np.concatenate([random.normal(0, 0.15, 3), random.normal(0, 1.0, 3)])
        pictures = [
            self._picture(camera, scene, world, light, velocity, random) for camera in self._cameras
        ]
        light = _exposed(light, pictures, random.uniform(*MEAN_LEVEL))
        noise = np.random.default_rng([seed, number, again, 8])
        return [_developed(picture, light, noise) for picture in pictures]

    def faces(self, scene: Scene, seed: int, number: int) -> list[Array]:
        """The faces of the cube in these photographs, as far as nothing stands in front of them."""
        world = self._world(scene, np.random.default_rng([seed, number, 7]))
        box = next(shape for shape in world.shapes if isinstance(shape, FacedBox))

        def first_face(origin: Array, directions: Array) -> Array:
            hits = nearest(world, np.broadcast_to(origin, directions.shape), directions)
            faces = hits.surface[:, None] == box.surfaces
            return np.where(faces.any(axis=1), faces.argmax(axis=1), -1)

        return [faces_in_image(camera, scene.position, first_face) for camera in self._cameras]

    def _world(self, scene: Scene, random: np.random.Generator) -> World:
        texture, fine = Texture(random), Texture(random, 0.8)
        offset = random.uniform(0, 1, (8, 2)).astype(np.float32)
        surfaces = [_table(random, texture)]
        grey = random.uniform(0.3, 0.75) * (1 + random.normal(0, 0.02) * np.linspace(-1, 1, 25))
        surfaces.append(Surface(grey, gloss=random.choice([0, 0.04])))  # the wall
        for darkness in (random.uniform(0.03, 0.1), random.uniform(0.05, 0.6), 0.04):
            tint = 1 + random.normal(0, 0.05) * np.linspace(-1, 1, 25)
            surfaces.append(Surface(darkness * tint, gloss=0.04, sharpness=random.uniform(10, 80)))
        surfaces.append(_skin(random))
        colours = pigments(random)
        dirt_power = random.uniform(0, 1) ** 2
        dirt = random.uniform(0.08, 0.5) * (0.7 + 0.5 * step(570, 60))
        plastic: dict[str, Any] = {
            "gloss": random.uniform(0.02, 0.05),
            "sharpness": random.uniform(8, 200),
        }
        rim = np.full(len(BANDS), random.uniform(0.02, 0.07))
        width = 0.06 * 2 * self._half[0] * random.uniform(0.9, 1.1)
        box_surfaces = []
        for i, name in enumerate(FACES):
            axis = (0, 1, 2, 2, 0, 1)[i]
            mixture = _wear(texture, fine, offset[i], axis, dirt_power, random)
            box_surfaces.append(len(surfaces))
            surfaces.append(Surface(colours[name], dirt, mixture, **plastic))
        rim_surface = len(surfaces)
        surfaces.append(Surface(rim, **plastic))
        lamps = _lamps(random)
        sky = lamp_spectrum(random) * random.uniform(0.15, 0.6)
        tilt = random.normal(0, 0.3, 3)
        tilt *= min(1.0, 0.8 / float(np.linalg.norm(tilt)))
        world = World(surfaces, lamps, sky, tilt)
        world.shapes += [Plane(0.6, 0), Wall(*_wall(random), 1)]
        world.shapes += self._fingers(scene.configuration)
        if random.random() < 0.35:
            world.shapes += _hand(scene, self._half, random)
        pose = _matrix(scene.position, scene.orientation)
        box = FacedBox(pose, self._half, box_surfaces)
        box.rim, box.rim_surface = np.float32(width), rim_surface
        world.shapes.append(box)
        return world

    def _fingers(self, configuration: Array) -> list[Shape]:
        model, data = self._model, self._data
        data.qpos[:] = configuration[: model.nq]
        mujoco.mj_forward(model, data)
        shapes: list[Shape] = []
        for finger in range(model.nsite):
            base, shoulder, elbow = data.xanchor[3 * finger : 3 * finger + 3]
            tip = data.site_xpos[finger]
            shapes.append(
                Capsule(base, base + 1.6 * (shoulder - base) + np.array([0, 0, 0.01]), 0.028, 3)
            )
            shapes.append(Capsule(shoulder, elbow, 0.019, 2))
            shapes.append(Capsule(elbow, tip, 0.0075, 3))
            shapes.append(Capsule(tip, tip + np.array([0, 0, 0.002]), 0.0085, 4))
        return shapes

    def _light(self, world: World, random: np.random.Generator) -> Light:
        filters = sensor(random)
        light = sum((lamp.spectrum for lamp in world.lamps), world.sky)
        white = filters @ light
        # The camera's white balance was right once, about.
        gains = white[1] / white * np.exp(random.normal(0, 0.08, 3))
        is_linear = random.random() < 0.5
        fade = random.uniform(0, 0.3)
        return Light(
            filters,
            gains,
            1.0 if is_linear else random.uniform(0.7, 1.0),
            0.0 if is_linear else random.uniform(0, 0.4),
            random.uniform(25, 90),
            random.uniform(0.3, 1.5),
            fade * (1 + random.normal(0, 0.1, 3)),
            random.uniform(0.3, 0.8),
        )

    def _picture(
        self,
        camera: Any,
        scene: Scene,
        world: World,
        light: Light,
        velocity: Array,
        random: np.random.Generator,
    ) -> Array:
        """Light on each pixel: height x width x 3."""
        tracer = Tracer(world, light.sensor, random)
        real = _misaligned(camera, random)
        pose = _matrix(scene.position, scene.orientation)
        corners = pose[:3, 3] + (_CORNERS * self._half) @ pose[:3, :3].T
        seen = camera.project(corners)
        low = np.clip(np.floor(seen.min(axis=0)) - MARGIN, 0, 540).astype(int)
        high = np.clip(np.ceil(seen.max(axis=0)) + MARGIN, 0, 540).astype(int)
        box = next(shape for shape in world.shapes if isinstance(shape, FacedBox))
        grid = np.arange(0, 540, COARSE) + 0.5 * (COARSE - 1)
        coarse = _traced(tracer, real, grid, grid, light.blur, COARSE_SAMPLES, lambda _: None)
        picture = _enlarged(coarse)

        def move(share: float) -> None:
            time = EXPOSURE * (share - 0.5)
            turned = _turned(velocity[3:] * time) @ pose[:3, :3]
            box.rotation = turned.astype(np.float32)
            box.position = (pose[:3, 3] + time * velocity[:3]).astype(np.float32)

        columns, rows = np.arange(low[0], high[0]), np.arange(low[1], high[1])
        if len(columns) and len(rows):
            part = _traced(tracer, real, columns, rows, light.blur, SAMPLES, move)
            picture[low[1] : high[1], low[0] : high[0]] = part
        move(0.5)
        return picture


class FacedBox(Box):
    """A box whose faces end before its edges."""

    rim = np.float32(0)
    rim_surface = 0

    def meet(self, hits: Any, origin: Array, direction: Array) -> None:
        """Updates `hits` where this is nearer."""
        before = hits.distance.copy()
        super().meet(hits, origin, direction)
        where = np.flatnonzero(hits.distance < before)
        inside = np.sort(self.half - np.abs(hits.place[where]), axis=1)[:, 1]
        hits.surface[where[inside < self.rim]] = self.rim_surface


_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)


def _matrix(position: Array, orientation: Array) -> Array:
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, orientation)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.reshape(3, 3), position
    return pose


def _turned(vector: Array) -> Array:
    angle = float(np.linalg.norm(vector))
    quaternion = np.array([1.0, 0, 0, 0])
    if angle > 0:
        mujoco.mju_axisAngle2Quat(quaternion, vector / angle, angle)
    return _matrix(np.zeros(3), quaternion)[:3, :3]


def _table(random: np.random.Generator, texture: Texture) -> Surface:
    kind = random.random()
    if kind < 0.5:  # plain, from dark to white
        level = random.uniform(0.04, 0.8)
        tint = 1 + random.normal(0, 0.06) * np.linspace(-1, 1, 25)
        own, other = level * tint, level * tint * random.uniform(0.6, 0.95)
        grain = 1.0
    elif kind < 0.8:  # wood
        own = random.uniform(0.2, 0.5) * (0.45 + 0.75 * step(560, 45))
        other = own * random.uniform(0.5, 0.85)
        grain = random.uniform(4, 9)
    else:  # painted or a mat
        hue = random.uniform(430, 640)
        own = random.uniform(0.08, 0.3) * (0.7 + random.uniform(0.1, 0.5) * peak(hue, 50))
        other = own * random.uniform(0.7, 0.95)
        grain = 1.0
    size = random.uniform(200, 900)

    def mixture(place: Array) -> Array:
        value = texture(place[:, 0], np.float32(grain) * place[:, 1], size)
        return np.asarray(np.clip(0.5 + 0.4 * value, 0, 1))

    return Surface(own, other, mixture, gloss=random.choice([0.0, 0.04]), sharpness=30)


def _skin(random: np.random.Generator) -> Surface:
    melanin = random.uniform(0.35, 1.0)
    blood = 1 - 0.18 * peak(545, 12) - 0.18 * peak(577, 12) - 0.3 * peak(420, 18)
    spectrum = melanin * (0.22 + 0.45 * step(590, 28)) * blood
    return Surface(spectrum, gloss=0.03, sharpness=12)


def _wear(
    texture: Texture,
    fine: Texture,
    offset: Array,
    axis: int,
    power: float,
    random: np.random.Generator,
) -> Any:
    """Dirt in patches, thin dust, and scratches that go through to the plastic."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    haze = power * random.uniform(0, 0.3)
    limit = random.uniform(0.8, 2.5) - power
    scratches = []
    for _ in range(int(power * random.integers(0, 12))):
        angle = random.uniform(0, np.pi)
        scratches.append((np.cos(angle), np.sin(angle), random.uniform(-0.03, 0.03)))

    def mixture(place: Array) -> Array:
        u, v = place[:, a], place[:, b]
        spots = np.clip((texture(u + offset[0], v + offset[1], 1500) - limit) * 1.5, 0, 1)
        share = haze + (0.9 - haze) * spots * np.float32(min(1, 1.5 * power))
        share = share + 0.05 * power * fine(u, v, 4000)
        for x, y, distance in scratches:
            is_on = np.abs(u * x + v * y - distance) < 0.0003
            share = np.where(is_on & (texture(u, v, 400) > -0.3), 0.7, share)
        return np.asarray(np.clip(share, 0, 1))

    return mixture


def _lamps(random: np.random.Generator) -> list[Lamp]:
    lamps = []
    for _ in range(random.integers(1, 4)):
        heading, rise = random.uniform(0, 2 * np.pi), random.uniform(0.5, 1.4)
        away = np.array([np.cos(heading) * np.cos(rise), np.sin(heading) * np.cos(rise), 0])
        away[2] = np.sin(rise)
        distance = random.uniform(0.8, 2.5)
        power = random.uniform(0.15, 0.6)
        size = random.uniform(0.03, 0.4)
        lamps.append(Lamp(distance * away, size, power * lamp_spectrum(random)))
    return lamps


def _wall(random: np.random.Generator) -> tuple[float, float, float]:
    """Radius, slope and height: one of the two walls that exist."""
    return (0.195, 0.55, 0.17) if random.random() < 0.6 else (0.242, 0.0, 0.25)


def _hand(scene: Scene, half: Array, random: np.random.Generator) -> list[Shape]:
    """Two to four fingers of a hand that comes from one side and from above."""
    heading = random.uniform(0, 2 * np.pi)
    away = np.array([np.cos(heading), np.sin(heading), 0.0])
    side = np.array([-away[1], away[0], 0.0])
    reach = float(np.linalg.norm(half[:2]))
    palm = scene.position + away * (reach + 0.055) + [0, 0, half[2] + 0.055]
    shapes: list[Shape] = [Capsule(palm, palm + 0.25 * away + [0, 0, 0.08], 0.027, 5)]
    shapes += [Capsule(palm - 0.025 * side, palm + 0.025 * side, 0.02, 5)]
    for place in np.linspace(-1, 1, random.integers(2, 5)):
        knuckle = palm + 0.03 * place * side
        tip = scene.position + away * random.uniform(0.2, 1) * reach + 0.025 * place * side
        tip[2] += half[2] * random.uniform(0.6, 1.2) + 0.008
        middle = (knuckle + tip) / 2 + [0, 0, 0.012]
        shapes += [Capsule(knuckle, middle, 0.0085, 5), Capsule(middle, tip, 0.0075, 5)]
    return shapes


def _misaligned(camera: Any, random: np.random.Generator) -> Any:
    """The camera as it is: half a pixel beside its calibration."""
    grid = np.array(
        [[x, y, z] for x in (-0.12, 0, 0.12) for y in (-0.12, 0, 0.12) for z in (0, 0.1)]
    )
    turn, shift = random.normal(size=3), random.normal(size=3)
    focus = random.normal(size=2)

    def changed(size: float) -> Any:
        pose = np.array(camera.pose)
        pose[:3, :3] = pose[:3, :3] @ _turned(1e-3 * size * turn)
        pose[:3, 3] += 5e-4 * size * shift
        lens = trifinger.Lens(
            camera.lens.focal_length * (1 + 1e-3 * size * focus[0]),
            camera.lens.principal_point + 0.3 * size * focus[1],
            camera.lens.distortion,
        )
        return trifinger.Camera(camera.name, 540, 540, camera.pixels, lens, pose)

    expected = camera.project(grid)

    def error(size: float) -> float:
        off = changed(size).project(grid) - expected
        return float(np.sqrt((off**2).sum(axis=1).mean()))

    size = 1.0
    for _ in range(8):
        size *= CALIBRATION_ERROR / error(size)
    return changed(size)


def _traced(
    tracer: Tracer, camera: Any, columns: Array, rows: Array, blur: float, count: int, move: Any
) -> Array:
    x, y = np.meshgrid(columns, rows)
    pixels = np.stack([x.ravel(), y.ravel()], axis=1).astype(float)
    rotation = np.asarray(camera.pose)[:3, :3]
    place = np.asarray(camera.pose)[:3, 3].astype(np.float32)
    sum_ = np.zeros((len(pixels), 3), np.float32)
    pitch = float(columns[1] - columns[0]) if len(columns) > 1 else 1.0
    spread = np.hypot(blur, pitch / np.sqrt(12))
    for number in range(count):
        # Places and times that are spread evenly, and independent of each other.
        radius = np.sqrt(-2 * np.log(1 - (number + 0.5) / count)) * spread
        angle = 2.399963 * number
        offset = radius * np.array([np.cos(angle), np.sin(angle)])
        move(((7 * number + 3) % count + 0.5) / count)
        rays = camera.lens.unproject(pixels + offset)
        direction = np.column_stack([rays[:, :2], np.ones(len(rays))]) @ rotation.T
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        origin = np.broadcast_to(place, direction.shape)
        sum_ += tracer.light(origin, direction.astype(np.float32), number, count)
    return (sum_ / count).reshape(len(rows), len(columns), 3)


def _enlarged(coarse: Array) -> Array:
    """A value for each pixel: between those of rays linearly."""
    for axis in (0, 1):
        count = coarse.shape[axis]
        place = (np.arange(COARSE * count) - 0.5 * (COARSE - 1)) / COARSE
        place = np.clip(place, 0, count - 1)
        lower = np.minimum(place.astype(int), count - 2)
        share = np.expand_dims(place - lower, 1 if axis == 0 else 0)[..., None]
        coarse = (1 - share) * coarse.take(lower, axis) + share * coarse.take(lower + 1, axis)
    return np.ascontiguousarray(coarse)


def _toned(level: Array, light: Light) -> Array:
    """A curve that bends near white, and one that lifts the dark."""
    bent = (1 - light.shoulder) * level + light.shoulder * (1 - np.exp(-1.6 * level))
    return np.asarray(np.clip(bent, 0, 1) ** light.tone)


def _exposed(light: Light, pictures: list[Array], level: float) -> Light:
    """The light with gains that give the images this mean level."""
    sample = np.concatenate([picture[::9, ::9].reshape(-1, 3) for picture in pictures])
    for _ in range(12):
        mean = 255 * _toned(np.clip(sample * light.gains, 0, 4), light).mean()
        light = light._replace(gains=light.gains * min(2.0, max(0.5, level / mean)))
    return light


def _developed(picture: Array, light: Light, random: np.random.Generator) -> Array:
    """What the sensor makes of the light: a mosaic of 8 bits."""
    height, width, _ = picture.shape
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    radius = (x * x + y * y)[..., None] / 2
    raw = picture * (1 - light.vignetting * radius)
    mosaic = np.empty((height, width))
    gains = np.empty((height, width))
    for row, column, channel in ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)):
        mosaic[row::2, column::2] = raw[row::2, column::2, channel]
        gains[row::2, column::2] = light.gains[channel]
    # Noise comes before the gains: the channel with the largest gain has the most.
    per_level = light.electrons * light.gains.mean() / gains
    level = 255 * mosaic * gains
    deviation = np.sqrt((level + light.read_noise**2) / per_level + (0.01 * level) ** 2)
    level = np.clip((level + deviation * random.normal(size=level.shape)) / 255, 0, 4)
    return np.asarray(np.rint(255 * _toned(level, light)), np.uint8)
