# SPDX-License-Identifier: BSD-3-Clause
"""Motion that shows what a robot is like: each joint alone and all together, slow and fast."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from trifinger._trifinger import ModelKinematics
from trifinger.arrays import Array
from trifinger.errors import InvalidArgument

# Between the robot and all else, itself included [m]: the largest that is kept where it begins.
CLEARANCES = (0.02, 0.015, 0.01, 0.005)
ALONE = 0.3  # share of the time in which joints of a finger move one by one
SPEEDS = (0.05, 0.2, 0.5)  # of moves, as shares of the largest speed
FASTEST = 5.0  # [rad/s]
LEAST_MOVE = 0.3  # s
REST = 0.1  # between two moves [s]
TRIALS = 200  # to find a move that touches nothing
SHAKE = (0.015, 0.05)  # of a move, besides where it goes [rad]
SIZES = (1.0, 0.5, 0.2, 0.0)  # of a shake, until it touches nothing
SHAKE_RATE = (1.0, 7.0)  # [1/s]
LOOK = 0.03  # between two positions that are looked at [s]
EDGE = 0.08  # share of a joint's range that is left at both ends
SOFTEST = 0.4  # share of the usual gains at first
STIFFER = 1.15  # factor on gains as long as nothing trembles
SOFTER = 0.6  # and for good, of a joint that has trembled
TREMBLES = 0.25  # share of steps in which a joint gets its largest torque


class Gains:
    """Gains as large as a robot bears: with them it moves fast, but if its torques are late it
    trembles.
    """

    def __init__(self, limits: Mapping[str, Array]) -> None:
        """`limits` are those of `safety`."""
        self._usual, self._most_torque = limits["default_kp"], 0.98 * limits["max_torque"]
        self._share = np.full(len(self._usual), SOFTEST)
        self._has_trembled = np.zeros(len(self._usual), dtype=bool)

    @property
    def kp(self) -> Array:
        """Of each joint [Nm/rad]."""
        kp: Array = self._share * self._usual
        return kp

    def look(self, torque: Array) -> None:
        """Changes the gains by torques that were applied, a row for each step."""
        trembles = np.mean(np.abs(torque) >= self._most_torque, axis=0) > TREMBLES
        self._share[trembles & ~self._has_trembled] *= SOFTER
        self._has_trembled |= trembles
        stiffer = np.minimum(STIFFER * self._share, 1.0)
        self._share = np.where(self._has_trembled, self._share, stiffer)


class Excitation:
    """Plans positions for all joints, step by step, that touch nothing in a model of the robot."""

    def __init__(
        self,
        model: str,
        joints: Sequence[str],
        limits: Mapping[str, Array],
        period: float,
        seed: int = 0,
    ) -> None:
        """`model` is the text of a model in MuJoCo's format, `limits` are those of `safety`."""
        self._model = mujoco.MjModel.from_xml_string(model)
        self._data = mujoco.MjData(self._model)
        if self._model.nkey:
            mujoco.mj_resetDataKeyframe(self._model, self._data, 0)
        ids = [mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in joints]
        if min(ids) < 0:
            missing = joints[ids.index(min(ids))]
            raise InvalidArgument(
                f"'{missing}' is no joint of the model, but several: move such a robot yourself, "
                "and identify it from the logs"
            )
        self._places = self._model.jnt_qposadr[ids]
        bodies = self._model.jnt_bodyid[ids]
        self._trees = self._model.body_treeid[bodies]
        moves = np.isin(self._model.body_treeid, self._trees)
        self._is_own = moves[self._model.geom_bodyid]
        self._near_at_home: dict[tuple[int, int], float] = {}
        self._period = period
        self._random = np.random.default_rng(seed)
        lower = np.maximum(limits["soft_lower"], -np.pi)
        upper = np.minimum(limits["soft_upper"], np.pi)
        self._lower = lower + EDGE * (upper - lower)
        self._upper = upper - EDGE * (upper - lower)
        self._speed = np.minimum(limits["max_velocity"], FASTEST)

    def plan(self, start: Array, seconds: float) -> Array:
        """Positions of all joints from `start` on, a row for each step [rad].

        The motion itself begins there or where the model does, in a free pose.
        """
        home = self._data.qpos[self._places].copy()
        home = self._free_pose(np.array(start, dtype=float), home)
        rows = [self._home(np.array(start, dtype=float), home)]
        count = 0
        place = home
        visited: list[Array] = []
        for part in self._alone(place, ALONE * seconds):
            rows.append(part)
            count += len(part)
        while count < seconds / self._period:
            target = self._target(place)
            for size in SIZES:
                part = self._move(place, target, size)
                if self._are_free(part):
                    break
            else:
                part = self._home(place, place)
            visited.append(place)
            place = part[-1]
            rows.append(part)
            count += len(part)
        while visited and not self._is_free_way(place, home):
            before = visited.pop()  # back the way that it came
            rows.append(self._home(place, before))
            place = before
        rows.append(self._home(place, home))
        return np.concatenate(rows)

    def is_free(self, position: Array) -> bool:
        """Whether the robot touches nothing there, nor nearly."""
        near = self._near(position)
        return all(self._near_at_home.get(pair, 0.0) > 0 and far > 0 for pair, far in near.items())

    def _are_free(self, rows: Array) -> bool:
        return all(map(self.is_free, rows[:: round(LOOK / self._period)]))

    def _free_pose(self, *poses: Array) -> Array:
        """The first of these poses that is free, with the largest clearance that one of them has.

        Links of one robot may always be near each other: with the least one, such pairs may be so
        elsewhere, too, as long as they do not touch.
        """
        inside = [np.clip(pose, self._lower, self._upper) for pose in poses]
        for clearance in CLEARANCES:
            self._model.geom_margin[:] = clearance
            self._model.pair_margin[:] = clearance
            self._model.body_margin[:] = clearance
            for pose in inside:
                if self.is_free(pose):
                    return pose
        for pose in inside:
            self._near_at_home = self._near(pose)
            if self.is_free(pose):
                return pose
        raise InvalidArgument(
            "the robot touches something where it is, and in the pose in which sessions begin: "
            "move it to a free pose"
        )

    def _near(self, position: Array) -> dict[tuple[int, int], float]:
        """Distances of what the robot nearly touches, by pairs of geoms [m]."""
        self._data.qpos[self._places] = position
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)
        contact = self._data.contact
        near: dict[tuple[int, int], float] = {}
        for (one, other), distance in zip(contact.geom, contact.dist, strict=True):
            if self._is_own[one] or self._is_own[other]:
                pair = (int(one), int(other))
                near[pair] = min(float(distance), near.get(pair, np.inf))
        return near

    def _is_free_way(self, begin: Array, end: Array) -> bool:
        count = max(int(np.max(np.abs(end - begin)) / 0.03), 2)
        return all(self.is_free(begin + s * (end - begin)) for s in np.linspace(0, 1, count))

    def _target(self, place: Array) -> Array:
        for trial in range(TRIALS):
            # Far goals are rarely free, so goals come nearer.
            reach = 1.0 - 0.9 * trial / TRIALS
            goal = self._random.uniform(self._lower, self._upper)
            goal = np.clip(place + reach * (goal - place), self._lower, self._upper)
            if self._is_free_way(place, goal):
                return goal
        return place

    def _move(self, begin: Array, end: Array, shaken: float) -> Array:
        """A move with a shake, and a rest."""
        line = self._straight(begin, end, self._random.choice(SPEEDS))
        seconds = len(line) * self._period
        s = np.arange(1, len(line) + 1)[:, None] / len(line)
        size = shaken * self._random.uniform(*SHAKE, len(begin))
        rate = self._random.uniform(*SHAKE_RATE, len(begin))
        phase = self._random.uniform(0, 2 * np.pi, len(begin))
        shake = size * np.sin(2 * np.pi * rate * s * seconds + phase) * np.sin(np.pi * s) ** 0.5
        moved = np.clip(line + shake, self._lower, self._upper)
        rest = np.repeat(moved[-1:], round(REST / self._period), axis=0)
        return np.concatenate([moved, rest])

    def _alone(self, home: Array, seconds: float) -> Iterator[Array]:
        """Moves the first joint of each finger, then the second, and so on."""
        ranks = np.array([np.sum(self._trees[:i] == tree) for i, tree in enumerate(self._trees)])
        each = seconds / (ranks.max() + 1)
        for rank in range(ranks.max() + 1):
            moving = ranks == rank
            low, high = self._free_range(home, moving, -1.0), self._free_range(home, moving, 1.0)
            middle, half = (low + high) / 2, (high - low) / 2
            begin = home.copy()
            begin[moving] = middle[moving]
            for shrunk in SIZES[:-1]:
                parts = [self._home(home, begin)]
                for share, speed in ((0.55, SPEEDS[0]), (0.15, SPEEDS[1]), (0.3, SPEEDS[2])):
                    steps = round(share * each / self._period)
                    time = self._period * np.arange(1, steps + 1)[:, None]
                    # Smaller turns for faster motion, so that torques suffice.
                    fast = np.minimum(half, 0.4 * self._speed * speed)
                    size = np.maximum(shrunk * (half if share > 0.5 else fast), 1e-3)
                    rate = np.minimum(speed * self._speed / size, 2 * np.pi * SHAKE_RATE[1])
                    fade = np.minimum(1.0, np.minimum(time, time[-1] - time) / 0.2)
                    rows = begin + np.where(moving, fade * size * np.sin(rate * time), 0.0)
                    parts.append(np.clip(rows, self._lower, self._upper))
                whole = np.concatenate([*parts, self._home(begin, home)])
                if self._are_free(whole):
                    yield whole
                    break

    def _free_range(self, home: Array, moving: Array, sign: float) -> Array:
        """How far these joints may go together, each from home."""
        end = np.where(sign > 0, self._upper, self._lower)
        free = home.copy()
        for s in np.linspace(0, 1, 40):
            tried = np.where(moving, home + s * (end - home), home)
            if not self.is_free(tried):
                break
            free = tried
        return free

    def _home(self, begin: Array, end: Array) -> Array:
        """A slow straight move."""
        return self._straight(begin, end, 0.15)

    def _straight(self, begin: Array, end: Array, share: float) -> Array:
        """A move with at most this share of the largest speed."""
        seconds = max(LEAST_MOVE, 1.9 * float(np.max(np.abs(end - begin) / (share * self._speed))))
        way = _least_jerk(round(seconds / self._period))[:, None]
        moved: Array = begin + way * (end - begin)
        return moved


@dataclass(frozen=True)
class Stroke:
    """How a tip slides to and fro over a level surface on which it is pressed."""

    way: float
    """Of the desired position to each side [m]; the tip itself goes further or less far."""
    drag: float
    """Force along, as a share of the force that presses."""
    kd: float
    """Of the joints [Nms/rad]."""
    seconds: float
    """For once to and fro."""
    turns: int


# On a table a force alone moves the tip; what is loose would be flung by that.
ON_TABLE = Stroke(way=0.0, drag=1.4, kd=0.05, seconds=1.5, turns=2)
ON_OBJECT = Stroke(way=0.02, drag=1.1, kd=0.2, seconds=1.5, turns=3)
PRESSES = (0.7, 1.0)  # [N]
SWELLS = (0.25, 1.25)  # of a press, least and largest [N]
SWELLING = ((3, 0.5), (16, 8.0))  # how often a press swells, and how often in a second [Hz]
YIELDING = 0.15  # share of the usual gains, while a tip is pressed
LIFT = 0.05  # over a surface, before and after [m]
APPROACH = 0.1  # [m/s]
FADE = 0.4  # [s]
SIGN = 0.02  # of a desired motion at which the force along has most of its value [m/s]


def strokes(
    kinematics: ModelKinematics,
    limits: Mapping[str, Array],
    period: float,
    start: Array,
    radius: float,
    top: Array,
) -> dict[str, Array]:
    """Actions with which each finger presses on the table, at z = 0, and slides over it and over
    an object.

    Tips are spheres of this `radius` [m]; `top` is the middle of the object's top [m]. Fields are
    those of an action, a row for each step.
    """
    usual_kp, usual_kd = limits["default_kp"], limits["default_kd"]
    rows: list[tuple[Array, Array, Array, Array]] = []

    def move(frame: str, mine: Array, path: Sequence[Array], joints: Array) -> Array:
        for begin, end in itertools.pairwise(path):
            way = float(np.linalg.norm(end - begin))
            for s in _least_jerk(max(round(1.9 * way / APPROACH / period), 1)):
                point = begin + s * (end - begin)
                found = kinematics.inverse_kinematics(frame, point, near=joints).position
                joints = np.where(mine, found, start)
                rows.append((joints, np.zeros_like(start), usual_kp, usual_kd))
        return joints

    def yield_to(
        frame: str, mine: Array, joints: Array, force: Array, share: float, kd: float
    ) -> None:
        torque = kinematics.jacobian(frame, joints)[:3].T @ force
        torque += kinematics.gravity_torques(joints)
        kp = np.where(mine, usual_kp * (1 - share + share * YIELDING), usual_kp)
        damped = np.where(mine, np.maximum(usual_kd, share * kd), usual_kd)
        rows.append((joints, np.where(mine, share * torque, 0.0), kp, damped))

    def faded(count: int) -> Array:
        steps = np.arange(count)
        share: Array = np.minimum(1, np.minimum(steps, steps[::-1]) * period / FADE)
        return share

    def press(frame: str, mine: Array, joints: Array) -> None:
        parts = [np.linspace(0, count, round(count / rate / period)) for count, rate in SWELLING]
        turned = 2 * np.pi * np.concatenate(parts)
        forces = SWELLS[0] + (SWELLS[1] - SWELLS[0]) * (1 - np.cos(turned)) / 2
        for share, force in zip(faded(len(forces)), forces, strict=True):
            yield_to(frame, mine, joints, np.array([0, 0, -force]), share, ON_TABLE.kd)

    def slide(frame: str, mine: Array, middle: Array, stroke: Stroke, joints: Array) -> Array:
        count = round(stroke.turns * stroke.seconds / period)
        turned = 2 * np.pi * stroke.turns * np.arange(count) / count
        out = middle[:2] - top[:2] if stroke is ON_TABLE else kinematics.pose(frame, start)[0][:2]
        out = np.append(out / max(float(np.linalg.norm(out)), 1e-9), 0.0)
        for pressed, along in itertools.product(PRESSES, (out, np.cross([0, 0, 1], out))):
            for share, angle in zip(faded(count), turned, strict=True):
                speed = 2 * np.pi / stroke.seconds * stroke.way * np.cos(angle)
                sense = np.tanh(speed / SIGN) if stroke.way else np.sin(angle)
                point = middle + stroke.way * np.sin(angle) * along
                found = kinematics.inverse_kinematics(frame, point, near=joints).position
                joints = np.where(mine, found, start)
                force = pressed * (stroke.drag * sense * along - np.array([0, 0, 1]))
                yield_to(frame, mine, joints, force, share, stroke.kd)
        return joints

    for frame in kinematics.frames:
        mine = np.any(kinematics.jacobian(frame, start)[:3] != 0, axis=0)
        beside, _ = kinematics.pose(frame, start)
        for stroke in (ON_TABLE, ON_OBJECT):
            middle = np.array([*beside[:2], 0.0]) if stroke is ON_TABLE else top
            middle = middle + np.array([0.0, 0.0, radius])
            above = np.array([*middle[:2], top[2] + radius + LIFT])
            path = [beside, np.array([*beside[:2], above[2]]), above, middle]
            joints = move(frame, mine, path, start)
            if stroke is ON_TABLE:
                press(frame, mine, joints)
            joints = slide(frame, mine, middle, stroke, joints)
            move(frame, mine, path[::-1], joints)
    names = ("position", "torque", "position_kp", "position_kd")
    return {
        name: np.array(column) for name, column in zip(names, zip(*rows, strict=True), strict=True)
    }


def _least_jerk(steps: int) -> Array:
    """The way along a straight move, as shares of it (Flash, Hogan 1985)."""
    s = np.arange(1, steps + 1) / steps
    way: Array = s**3 * (10 - 15 * s + 6 * s**2)
    return way
