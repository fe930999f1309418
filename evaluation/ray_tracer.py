# SPDX-License-Identifier: BSD-3-Clause
"""A small ray tracer in NumPy: pictures that share nothing with the simulation's renderer.

Light has a spectrum here, and so have surfaces and the three filters of a sensor. Lamps have a
size, so shadows are soft. What is not lit by a lamp sees the surroundings or the next surface.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from trifinger.arrays import Array

BANDS = np.linspace(400, 700, 25)  # [nm]
FAR = np.float32(1e3)
CLOSE = np.float32(1e-4)  # nothing this near stops a ray [m]


def peak(middle: float, width: float) -> Array:
    """A spectrum with one peak of height 1."""
    return np.exp(-0.5 * ((BANDS - middle) / width) ** 2)


def step(middle: float, width: float) -> Array:
    """A spectrum that rises from 0 to 1."""
    return np.asarray(1 / (1 + np.exp((middle - BANDS) / width)))


def glow(kelvin: float) -> Array:
    """The light of a hot body, with mean 1."""
    light = BANDS**-5 / np.expm1(1.4388e7 / (BANDS * kelvin))
    return np.asarray(light / light.mean())


def diode(kelvin: float) -> Array:
    """The light of a white diode, with mean 1: blue light, part of which a powder turns yellow."""
    blue = np.clip((kelvin - 2000) / 6000, 0.1, 1.0)
    light = blue * peak(452, 11) + 0.75 * peak(565 + 30 * (1 - blue), 58)
    return np.asarray(light / light.mean())


class Texture:
    """Noise without end: values with mean 0 and deviation 1 in a plane."""

    SIZE = 256

    def __init__(self, random: np.random.Generator, roughness: float = 1.3) -> None:
        """Small `roughness` means fine grain."""
        frequency = np.hypot(*np.meshgrid(*2 * [np.fft.fftfreq(self.SIZE) * self.SIZE]))
        frequency[0, 0] = np.inf
        waves = np.fft.fft2(random.normal(size=(self.SIZE, self.SIZE))) * frequency**-roughness
        values = np.fft.ifft2(waves).real
        self._values = (values / values.std()).astype(np.float32)

    def __call__(self, u: Array, v: Array, per_metre: float) -> Array:
        """The values at points [m]; `per_metre` cells of the texture make a metre."""
        x, y = u * np.float32(per_metre), v * np.float32(per_metre)
        column, row = np.floor(x), np.floor(y)
        a, b = x - column, y - row
        i, j = column.astype(np.int64) % self.SIZE, row.astype(np.int64) % self.SIZE
        k, m = (i + 1) % self.SIZE, (j + 1) % self.SIZE
        upper = self._values[j, i] * (1 - a) + self._values[j, k] * a
        lower = self._values[m, i] * (1 - a) + self._values[m, k] * a
        return np.asarray(upper * (1 - b) + lower * b)


@dataclass
class Surface:
    """How a surface reflects light. Points of it are a mixture of two spectra."""

    spectrum: Array
    """Share of the light that it reflects to all sides, per band."""
    other: Array | None = None
    """What `mixture` mixes in, such as dirt."""
    mixture: Callable[[Array], Array] | None = None
    """For points in the shape's own frame the share of `other`, 0 to 1."""
    gloss: float = 0.0
    """Share of the light that is mirrored, seen from above."""
    sharpness: float = 40.0
    """Exponent of the mirror image of a lamp."""


@dataclass
class Hits:
    """Where rays meet the first thing in their way."""

    distance: Array
    normal: Array
    surface: Array
    """Number of the surface; -1 if there is nothing."""
    place: Array
    """The point in the shape's own frame."""


class Plane:
    """The table: a disc at height zero."""

    def __init__(self, radius: float, surface: int) -> None:
        self.radius, self.surface = radius, surface

    def meet(self, hits: Hits, origin: Array, direction: Array) -> None:
        """Updates `hits` where this is nearer."""
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = -origin[:, 2] / direction[:, 2]
            point = origin + distance[:, None] * direction
            is_met = (distance > CLOSE) & (distance < hits.distance)
            is_met &= (point[:, :2] ** 2).sum(axis=1) < self.radius**2
        where = np.flatnonzero(is_met)
        hits.distance[where] = distance[where]
        hits.normal[where] = (0, 0, 1)
        hits.surface[where] = self.surface
        hits.place[where] = point[where]


class Wall:
    """A cone around the z axis that opens upwards, seen from inside."""

    def __init__(self, radius: float, slope: float, height: float, surface: int) -> None:
        self.radius, self.slope, self.height, self.surface = radius, slope, height, surface

    def meet(self, hits: Hits, origin: Array, direction: Array) -> None:
        """Updates `hits` where this is nearer. Rays from outside and above may look in."""
        wide = self.radius + self.slope * origin[:, 2]
        a = (direction[:, :2] ** 2).sum(axis=1) - (self.slope * direction[:, 2]) ** 2
        b = (origin[:, :2] * direction[:, :2]).sum(axis=1) - self.slope * wide * direction[:, 2]
        c = (origin[:, :2] ** 2).sum(axis=1) - wide**2
        root = np.sqrt(np.maximum(0, b * b - a * c))
        safe = np.where(np.abs(a) < 1e-9, np.float32(1e-9), a)
        for distance in ((-b - root) / safe, (-b + root) / safe):
            point = origin + distance[:, None] * direction
            is_met = (distance > CLOSE) & (distance < hits.distance) & (b * b > a * c)
            is_met &= (point[:, 2] > 0) & (point[:, 2] < self.height)
            flat = point[:, :2]
            # Only its inner side: the outer one is glass to us.
            is_met &= (flat * direction[:, :2]).sum(axis=1) > self.slope * direction[:, 2] * (
                self.radius + self.slope * point[:, 2]
            )
            where = np.flatnonzero(is_met)
            hits.distance[where] = distance[where]
            inwards = -flat[where] / np.linalg.norm(flat[where], axis=1, keepdims=True)
            normal = np.column_stack([inwards, np.full(len(where), self.slope)])
            hits.normal[where] = normal / np.float32(np.hypot(1, self.slope))
            hits.surface[where] = self.surface
            hits.place[where] = point[where]


class Capsule:
    """A cylinder with round ends."""

    def __init__(self, start: Array, end: Array, radius: float, surface: int) -> None:
        self.start = np.asarray(start, np.float32)
        self.end = np.asarray(end, np.float32)
        self.radius, self.surface = np.float32(radius), surface

    def meet(self, hits: Hits, origin: Array, direction: Array) -> None:
        """Updates `hits` where this is nearer."""
        along, away = self.end - self.start, origin - self.start
        length = along @ along
        beside, ahead = direction @ along, away @ along
        forward = (direction * away).sum(axis=1)
        square = (away * away).sum(axis=1)
        a = length - beside**2
        b = length * forward - ahead * beside
        c = length * square - ahead**2 - self.radius**2 * length
        # Rays that miss the endless cylinder miss the capsule.
        near = np.flatnonzero(b * b - a * c > 0)
        if not len(near):
            return
        a, b, c = np.maximum(a[near], 1e-12), b[near], c[near]
        distance = (-b - np.sqrt(np.maximum(0, b * b - a * c))) / a
        share = (ahead[near] + distance * beside[near]) / length
        is_end = (share <= 0) | (share >= 1)
        centre = np.where((share <= 0)[:, None], self.start, self.end)
        off = origin[near] - centre
        middle = (direction[near] * off).sum(axis=1)
        open_ = middle**2 - (off * off).sum(axis=1) + self.radius**2
        round_ = np.where(open_ > 0, -middle - np.sqrt(np.maximum(open_, 0)), FAR)
        distance = np.where(is_end, round_, distance)
        is_met = (distance > CLOSE) & (distance < hits.distance[near])
        where = near[is_met]
        if not len(where):
            return
        hits.distance[where] = distance[is_met]
        point = origin[where] + distance[is_met, None] * direction[where]
        axis = self.start + np.clip(share[is_met], 0, 1)[:, None] * along
        hits.normal[where] = (point - axis) / self.radius
        hits.surface[where] = self.surface
        hits.place[where] = point


class Box:
    """A box with a surface on each side: +x, +y, +z, -z, -x, -y."""

    NUMBERS = np.array([[4, 0], [5, 1], [3, 2]])  # of the side against and along each axis

    def __init__(self, pose: Array, half: Array, surfaces: Sequence[int]) -> None:
        """`pose` is a 4 x 4 matrix."""
        self.rotation = np.asarray(pose[:3, :3], np.float32)
        self.position = np.asarray(pose[:3, 3], np.float32)
        self.half = np.asarray(half, np.float32)
        self.surfaces = np.asarray(surfaces)

    def meet(self, hits: Hits, origin: Array, direction: Array) -> None:
        """Updates `hits` where this is nearer."""
        away = origin - self.position
        forward = (direction * away).sum(axis=1)
        miss = (away * away).sum(axis=1) - forward**2
        near = np.flatnonzero(miss < self.half @ self.half)
        if not len(near):
            return
        start, ray = away[near] @ self.rotation, direction[near] @ self.rotation
        inverse = 1 / np.where(np.abs(ray) < 1e-9, np.float32(1e-9), ray)
        sides = -np.sign(inverse) * self.half
        entry = (sides - start) * inverse
        leave = ((-sides - start) * inverse).min(axis=1)
        axis = entry.argmax(axis=1)
        distance = entry[np.arange(len(near)), axis]
        is_met = (distance < leave) & (distance > CLOSE) & (distance < hits.distance[near])
        where, axis = near[is_met], axis[is_met]
        if not len(where):
            return
        hits.distance[where] = distance[is_met]
        place = start[is_met] + distance[is_met, None] * ray[is_met]
        sign = np.sign(sides[is_met][np.arange(len(where)), axis])
        hits.normal[where] = (self.rotation[:, axis] * sign).T
        hits.surface[where] = self.surfaces[self.NUMBERS[axis, (sign > 0).astype(int)]]
        hits.place[where] = place


Shape = Plane | Wall | Capsule | Box


@dataclass
class Lamp:
    """A round lamp."""

    position: Array
    radius: float
    spectrum: Array
    """Light at the middle of the table, if it faces the lamp."""


@dataclass
class World:
    """What there is to see."""

    surfaces: list[Surface]
    lamps: list[Lamp]
    sky: Array
    """Spectrum of the light from all sides."""
    tilt: Array
    """The sky is brighter on this side: a vector shorter than 1."""
    shapes: list[Shape] = field(default_factory=list)


def nearest(world: World, origin: Array, direction: Array) -> Hits:
    """The first thing in the way of each ray."""
    count = len(origin)
    hits = Hits(
        np.full(count, FAR),
        np.zeros((count, 3), np.float32),
        np.full(count, -1),
        np.zeros((count, 3), np.float32),
    )
    for shape in world.shapes:
        shape.meet(hits, origin, direction)
    return hits


class Tracer:
    """Traces rays through a world, as a sensor with these filters sees it."""

    def __init__(self, world: World, filters: Array, random: np.random.Generator) -> None:
        """`filters` has a row of sensitivities for red, green and blue."""
        self._world, self._filters, self._random = world, filters, random
        nothing = np.zeros(len(BANDS))
        own = np.array([each.spectrum for each in world.surfaces])
        other = np.array([nothing if s.other is None else s.other for s in world.surfaces])
        # What the sensor gets from each surface under each light is all that spectra are needed
        # for: light adds up.
        lights = np.array([*(lamp.spectrum for lamp in world.lamps), world.sky])
        self._own = np.einsum("sb,lb,cb->lsc", own, lights, filters).astype(np.float32)
        self._other = np.einsum("sb,lb,cb->lsc", other, lights, filters).astype(np.float32)
        self._plain = (lights @ filters.T).astype(np.float32)
        self._gloss = np.array([s.gloss for s in world.surfaces], np.float32)
        self._sharpness = np.array([s.sharpness for s in world.surfaces], np.float32)
        self._spots = np.zeros((len(world.lamps), 3))  # of lamps, where a pass looks at them
        self._turn = 0.0

    def light(self, origin: Array, direction: Array, number: int, count: int) -> Array:
        """What comes along each ray: red, green, blue. Pass `number` of `count` of a picture."""
        for i, lamp in enumerate(self._world.lamps):
            self._spots[i] = self._random.normal(scale=0.5 * lamp.radius, size=3)
        self._turn = self._random.uniform(0, 2 * np.pi)
        hits = self._first(origin, direction)
        light = self._surroundings(direction)
        seen = np.flatnonzero(hits.surface >= 0)
        if not len(seen):
            return light
        surface, normal = hits.surface[seen], hits.normal[seen]
        towards = -direction[seen]
        point = origin[seen] + hits.distance[seen, None] * direction[seen]
        point += np.float32(2) * CLOSE * normal
        mixture = self._mixture(surface, hits.place[seen])
        total = np.zeros((len(seen), 3), np.float32)
        for i, lamp in enumerate(self._world.lamps):
            total += self._lit(i, lamp, point, normal, towards, surface, mixture)
        total += self._filled(point, normal, towards, surface, mixture, number, count)
        light[seen] = total
        return light

    def _first(self, origin: Array, direction: Array) -> Hits:
        return nearest(self._world, origin, direction)

    def _mixture(self, surface: Array, place: Array) -> Array:
        shares = np.zeros(len(surface), np.float32)
        for i, each in enumerate(self._world.surfaces):
            if each.mixture is not None:
                where = np.flatnonzero(surface == i)
                if len(where):
                    shares[where] = each.mixture(place[where])
        return shares[:, None]

    def _colour(self, light: int, surface: Array, mixture: Array) -> Array:
        own, other = self._own[light][surface], self._other[light][surface]
        colour: Array = own + mixture * (other - own)
        return colour

    def _surroundings(self, direction: Array) -> Array:
        share = 1 + direction @ self._world.tilt.astype(np.float32)
        return np.asarray(share[:, None] * self._plain[-1] * np.float32(0.6))

    def _lit(
        self,
        number: int,
        lamp: Lamp,
        point: Array,
        normal: Array,
        towards: Array,
        surface: Array,
        mixture: Array,
    ) -> Array:
        # All rays of a pass go to one point of the lamp: noise of its own in each pixel would look
        # like colours to a mosaic of filters.
        ray = (lamp.position + self._spots[number]).astype(np.float32) - point
        distance = np.linalg.norm(ray, axis=1)
        ray /= distance[:, None]
        cosine = np.maximum(0, (ray * normal).sum(axis=1))
        is_lit = np.flatnonzero(cosine > 0)
        blocked = self._first(point[is_lit], ray[is_lit]).distance < distance[is_lit]
        cosine[is_lit[blocked]] = 0
        power = (np.float32(np.linalg.norm(lamp.position)) / distance) ** 2
        half = ray + towards
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        sharpness = self._sharpness[surface]
        mirrored = np.maximum(0, (half * normal).sum(axis=1)) ** sharpness * (sharpness + 2) / 8
        mirrored *= self._fresnel(surface, (half * towards).sum(axis=1))
        diffuse = (cosine * power)[:, None] * self._colour(number, surface, mixture)
        sheen = (cosine * power * mirrored)[:, None] * self._plain[number]
        return np.asarray(diffuse + sheen)

    def _filled(
        self,
        point: Array,
        normal: Array,
        towards: Array,
        surface: Array,
        mixture: Array,
        number: int,
        count: int,
    ) -> Array:
        """Light from everything but lamps: one ray to somewhere."""
        turn = np.float32(2.399963 * number + self._turn)
        rise = np.float32((number + 0.5) / count)
        flat = np.sqrt(rise)
        side = np.where(np.abs(normal[:, :1]) > 0.7, *np.eye(3, dtype=np.float32)[[1, 0]])
        u = np.cross(normal, side)
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        v = np.cross(normal, u)
        ray = flat * np.cos(turn) * u + flat * np.sin(turn) * v + np.sqrt(1 - rise) * normal
        hits = self._first(point, ray)
        light = self._surroundings(ray) / np.float32(0.6)
        stopped = np.flatnonzero(hits.surface >= 0)
        if len(stopped):
            # What stands there is lit by about half of all light.
            colour = self._own[:, hits.surface[stopped]].sum(axis=0)
            light[stopped] = np.float32(0.45) * colour
        reflect = self._colour(len(self._own) - 1, surface, mixture) / self._plain[-1]
        shine = self._fresnel(surface, (normal * towards).sum(axis=1))[:, None]
        mirror = 2 * (normal * towards).sum(axis=1)[:, None] * normal - towards
        return np.asarray(light * reflect + shine * self._surroundings(mirror))

    def _fresnel(self, surface: Array, cosine: Array) -> Array:
        base = self._gloss[surface]
        rest = np.where(base > 0, (1 - np.clip(cosine, 0, 1)) ** 5, 0)
        return np.asarray(base + (np.float32(0.6) - base) * rest)
