# SPDX-License-Identifier: BSD-3-Clause
"""Mass of an object, contacts, and errors of poses, from logs of how fingers handle it.

What the torques of a finger do beyond moving the finger itself is the force of its contact: the
observer of external forces, without contacts that are modelled. The robot should be identified
before, because friction of joints looks like force.
"""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np

from trifinger._trifinger import FreeRun, Log, configuration_text, export_mjcf
from trifinger.arrays import Array
from trifinger.errors import InvalidArgument
from trifinger.identification.fit import CENTERS, SURE, Figure
from trifinger.identification.motion import Motion, cubic, read_motion
from trifinger.identification.softness import Press, SoftContact, presses, softness
from trifinger.whole_file import whole_file

EVERY = 0.01  # between two moments [s]
HALF = 0.03  # of the cubic through measured positions of joints [s]
HALF_POSE = 0.1  # and through poses [s]
NEAR = 0.004  # of a surface that is touched [m]
FAR = 0.1  # beyond which distances do not count [m]
RAISED = 0.006  # of an object in the air [m]
LOWERED = 0.003  # of one that lies [m]
SLIDING = 0.01  # of an object [m/s]
SLIPPING = 0.01  # of a finger [m/s]
STILL = 10  # moments to each side, in which an object rests over which a finger slips
ALONG = 0.7  # cosine of the least angle between slip and drag
PRESSED = 0.4  # of a contact whose friction is looked at [N]
DOUBTED = 0.15  # a force that is known less well says nothing of this [N]
LIMIT = 0.7  # quantile of drag by pressure: a tip that slides sticks in between, and drags less
TURNS = 0.02  # of a joint, at which dry friction has most of its value [rad/s]
USUAL = 0.05  # errors of a force, beside the doubt [N]
GRAVITY = 9.81  # [m/s^2]
AROUND = 0.25  # quantiles to each side: half of what is between them is what is not known of it
LEVEL = 0.95  # cosine of the angle to the vertical of what a tip slides on
LEAST_MOMENTS = 30
BLOCKS = 10  # of moments, of which each is left out once
TOLD = 0.3  # half of an interval, as a share of the value
HANDLED = "handled.yml"
FIGURES = "handled.json"
_KEYS = {
    "object_mass": "objects.{index}.mass",
    "friction": "contact.friction.{name}",
    "tip_time_constant": "contact.tip_time_constant",
    "tip_damping_ratio": "contact.tip_damping_ratio",
    "pose_delay": "simulation.object_delay",
    "pose_noise": "simulation.object_position_noise",
    "turn_noise": "simulation.object_orientation_noise",
}
_MEDIAN_OF_THREE = 2.366 / 3  # of the mean square of three normal numbers (chi-squared)
# What is not known of an identified robot, in its forces: shares of friction, and of all torques of
# a finger, whose scale its motion does not tell.
_UNSURE = {"friction": 0.05, "scale": 0.05}


@dataclass(frozen=True)
class Moments:
    """What fingers do with an object: a row for each moment, then a column for each finger."""

    force: Array
    """On what is touched [N]: besides, with more friction, and with another scale of torques."""
    touches: Array
    """What is touched: "object", "table" or nothing."""
    normal: Array
    """Into what is touched."""
    slip: Array
    """Velocity of the finger along the surface that it touches [m/s]."""
    doubt: Array
    """In a force, because friction of joints that rest may be anything [N]."""
    height: Array
    """Of the object above the table [m]."""
    velocity: Array
    """Of the object [m/s]."""
    acceleration: Array


def identify_handling(
    logs: Sequence[str | Path], robot_config: str, object_name: str, robot: str = ""
) -> list[Figure]:
    """Mass of an object [kg], friction coefficients, softness of tips, noise and delay of poses.

    `robot_config` is the robot as it was identified. Raises InvalidArgument if logs are of no use,
    or do not say where the object is.
    """
    if not logs:
        raise InvalidArgument("there is no log")
    parts, poses, pressed = [], [], []
    for log in logs:
        motion = read_motion([log], robot, robot_config)
        seen = _Poses(str(log), robot, object_name)
        scene = _Scene(motion, robot_config, object_name)
        part, its_presses = _moments(motion, seen, scene)
        parts.append(part)
        pressed.extend(its_presses)
        poses.append(seen)
    names = Moments.__dataclass_fields__
    moments = Moments(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
    return [
        *contacts(moments, object_name),
        *softness(pressed, scene.soft_contact, _every(motion) * motion.period),
        *_errors_of_poses(poses, object_name),
    ]


class _Poses:
    """Where a log says that an object is."""

    def __init__(self, log: str, robot: str, name: str) -> None:
        session = Log(log).session(robot)
        companion = next((one for one in session.companions if one.name.endswith(".object")), None)
        if companion is None:
            raise InvalidArgument(f"{log}: nothing says where objects are")
        elements = companion.observations
        if name not in (elements.dtype.names or ()):
            raise InvalidArgument(f"{log}: nothing says where '{name}' is")
        capture, chosen = np.unique(elements["stamp"]["capture_index"], return_index=True)
        chosen = chosen[capture >= 0]
        self.step: Array = capture[capture >= 0].astype(float)
        self.time_index: Array = session.time_index
        """Of each row of the motion."""
        arrival = elements["stamp"]["arrival_index"][chosen]
        self.delay: Array = (arrival - self.step) * session.period
        place = np.asarray(elements[name]["position"][chosen], dtype=float)
        turned = np.asarray(elements[name]["orientation"][chosen], dtype=float)
        flips = np.where(np.sum(turned[1:] * turned[:-1], axis=1) < 0, -1.0, 1.0)
        turned[1:] *= np.cumprod(flips)[:, None]
        self.measured = np.concatenate([place, turned], axis=1)
        self.every = float(np.median(np.diff(self.step))) if len(self.step) > 1 else 1.0
        if len(self.step) < 4 * HALF_POSE / (self.every * session.period):
            raise InvalidArgument(f"{log}: there are too few poses of '{name}'")
        self.grid = np.arange(self.step[0], self.step[-1], self.every)
        even = np.stack([np.interp(self.grid, self.step, row) for row in self.measured.T], axis=1)
        half = max(round(HALF_POSE / (self.every * session.period)), 2)
        self.smooth = smooth(even, half, self.every * session.period)

    def at(self, steps: Array) -> tuple[Array, Array, Array]:
        """Pose, its velocity and acceleration: seven columns each."""
        found = [
            np.stack([np.interp(steps, self.grid, row) for row in rows.T], axis=1)
            for rows in self.smooth
        ]
        return found[0], found[1], found[2]


def smooth(values: Array, half: int, period: float) -> tuple[Array, Array, Array]:
    """Values, rates and accelerations by a cubic through `half` rows to each side."""
    weights = cubic(half)[:3] * np.array([1, 1 / period, 2 / period**2])[:, None]
    padded = np.pad(values, ((half, half), (0, 0)), mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1, axis=0)
    place, rate, acceleration = np.einsum("kw,tjw->ktj", weights, around)
    return place, rate, acceleration


@dataclass(frozen=True)
class _Touch:
    what: str
    normal: Array
    """Into what is touched."""
    depth: float
    """In what is touched, as far as joints tell [m]."""
    is_of_tip: bool
    slip: Array
    """[m/s]"""
    lever: Array
    """Torques of the finger's joints that a force of 1 N needs: joints x 3 [m]."""


class _Scene:
    """A model of the robot as it was identified, and of the object."""

    def __init__(self, motion: Motion, robot_config: str, object_name: str) -> None:
        robot = FreeRun.of_text(motion.configuration)
        self.known = known = {name: np.array(values) for name, values in robot.described.items()}
        self.delays = robot.delays
        """Of torques and of measurements [steps]."""
        self.model = model = mujoco.MjModel.from_xml_string(export_mjcf(robot_config))
        self.data = mujoco.MjData(model)
        self.body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, object_name)
        ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in motion.joints]
        if self.body < 0 or model.body_jntnum[self.body] != 1 or min(ids) < 0:
            raise InvalidArgument(f"the robot's configuration has no object '{object_name}'")
        self.dofs, self.places = model.jnt_dofadr[ids], model.jnt_qposadr[ids]
        links = model.jnt_bodyid[ids]
        # If several joints move the same link, the last one says its mass.
        scaled, last = np.unique(links[::-1], return_index=True)
        shares = known["link_mass"][::-1][last]
        shifts = np.stack([known[name][::-1][last] for name in CENTERS], axis=1)
        mujoco.mj_kinematics(model, self.data)
        turned = self.data.xmat.reshape(-1, 3, 3)
        for link, share, shift in zip(scaled, shares, shifts, strict=True):
            fixed = model.body_weldid == link  # with all that is fixed to it
            model.body_mass[fixed] *= share
            model.body_inertia[fixed] *= share
            model.body_ipos[fixed] += (turned[link] @ shift) @ turned[fixed]
        model.dof_armature[self.dofs] = known["rotor_inertia"]
        mujoco.mj_setConst(model, self.data)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        trees = model.body_treeid[links]
        self.fingers = [np.flatnonzero(trees == tree) for tree in np.unique(trees)]
        """The joints of each."""
        carriers = model.body_weldid[model.geom_bodyid]
        touchable = model.geom_contype + model.geom_conaffinity > 0
        self.object = np.flatnonzero((model.geom_bodyid == self.body) & touchable)
        self.ground = np.flatnonzero((carriers == 0) & touchable)
        self.surfaces = [
            np.flatnonzero(np.isin(carriers, links[finger]) & touchable) for finger in self.fingers
        ]
        free = int(model.body_jntadr[self.body])
        pose, speed = int(model.jnt_qposadr[free]), int(model.jnt_dofadr[free])
        self.pose, self.moves = slice(pose, pose + 7), slice(speed, speed + 3)
        self.turns = slice(speed + 3, speed + 6)

        geoms = np.concatenate(self.surfaces)
        self.tips: list[int] = geoms[model.geom_priority[geoms] > 0].tolist()
        """Geoms that decide alone how contacts with them are."""
        self.soft_contact = SoftContact.of(model, self.tips[-1]) if self.tips else None

    def set(self, position: Array, velocity: Array, pose: Array, rate: Array) -> None:
        """Puts joints and object there."""
        self.data.qpos[self.places], self.data.qvel[self.dofs] = position, velocity
        self.data.qpos[self.pose], self.data.qvel[self.moves] = pose, rate[:3]
        self.data.qvel[self.turns] = _turning(pose[3:], rate[3:])
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)

    def inverse_dynamics(self, acceleration: Array) -> Array:
        """Torques that joints without friction need [Nm]."""
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, full)
        inertial = full[np.ix_(self.dofs, self.dofs)] @ acceleration
        torques: Array = inertial + self.data.qfrc_bias[self.dofs]
        return torques

    def height(self) -> float:
        """Of the object above the ground [m]; not more than `FAR`."""
        return self._nearest(self.object, self.ground)[0]

    def touch(self, finger: int) -> _Touch | None:
        """What a finger touches."""
        mine = self.surfaces[finger]
        on_object, on_ground = (self._nearest(mine, one) for one in (self.object, self.ground))
        distance, line, geom = min(on_object, on_ground, key=lambda found: found[0])
        if distance > NEAR:
            return None
        point = line[:3]
        normal = (line[3:] - point) * (1 if distance > 0 else -1)
        normal /= max(float(np.linalg.norm(normal)), 1e-9)
        jacobian = self._jacobian(point, int(self.model.geom_bodyid[geom]))
        speed = jacobian @ self.data.qvel
        is_object = distance == on_object[0]
        if is_object:
            speed = speed - self._jacobian(point, self.body) @ self.data.qvel
        slip = speed - normal * (speed @ normal)
        lever = jacobian[:, self.dofs[self.fingers[finger]]].T
        what = "object" if is_object else "table"
        return _Touch(what, normal, -distance, geom in self.tips, slip, lever)

    def _jacobian(self, point: Array, body: int) -> Array:
        jacobian = np.zeros((3, self.model.nv))
        mujoco.mj_jac(self.model, self.data, jacobian, None, point, body)
        return jacobian

    def _nearest(self, mine: Array, others: Array) -> tuple[float, Array, int]:
        """The least distance of two geoms, the points between which it is, and the own geom."""
        best, points, nearest = FAR, np.zeros(6), -1
        line = np.zeros(6)
        for one, other in itertools.product(mine.tolist(), others.tolist()):
            distance = mujoco.mj_geomDistance(self.model, self.data, one, other, FAR, line)
            if distance < best:
                best, points, nearest = distance, line.copy(), one
        return best, points, nearest


def _every(motion: Motion) -> int:
    """Steps between two moments."""
    return max(round(EVERY / motion.period), 1)


def _moments(motion: Motion, poses: _Poses, scene: _Scene) -> tuple[Moments, list[Press]]:
    """What fingers do, and how they press on the table."""
    known = scene.known
    half, every = max(round(HALF / motion.period), 1), _every(motion)
    position = motion.position - known["zero_offset"]
    # Friction changes its sign within a moment where something sticks and slips.
    _, quick, _ = smooth(position, max(half // 6, 2), motion.period)
    friction = known["friction"] * np.tanh(quick / TURNS)
    torque_late, measured_late = scene.delays
    room = half + torque_late + measured_late
    steps = motion.pieces(1, every, room, room)
    seen = poses.time_index[steps]
    steps = steps[(seen > poses.grid[0]) & (seen < poses.grid[-1])]
    q, v, a = (rows[steps + measured_late] for rows in smooth(position, half, motion.period))
    dry = smooth(friction, half, motion.period)[0][steps + measured_late]
    acts = (
        known["torque_scale"] * smooth(motion.torque, half, motion.period)[0][steps - torque_late]
    )
    # Three versions: as identified, with more friction, with larger torques.
    missing = known["damping"] * v + dry - acts
    more = [np.zeros_like(dry), _UNSURE["friction"] * dry, _UNSURE["scale"] * missing]
    missing = np.stack([missing + one for one in more], axis=2)
    unknown = known["friction"] - np.abs(dry)
    place, rate, bent = poses.at(poses.time_index[steps])

    count = (len(steps), len(scene.fingers))
    force, touches = np.zeros((*count, 3, len(more))), np.full(count, "", dtype="U6")
    normal, slip = np.zeros((*count, 3)), np.zeros((*count, 3))
    depth, is_of_tip = np.zeros(count), np.zeros(count, dtype=bool)
    doubt, height = np.zeros(count), np.zeros(len(steps))
    for t in range(len(steps)):
        scene.set(q[t], v[t], place[t], rate[t])
        needed = scene.inverse_dynamics(a[t])[:, None] + missing[t]
        height[t] = scene.height()
        for finger, joints in enumerate(scene.fingers):
            touch = scene.touch(finger)
            if touch is None:
                continue
            touches[t, finger] = touch.what
            normal[t, finger], slip[t, finger] = touch.normal, touch.slip
            depth[t, finger], is_of_tip[t, finger] = touch.depth, touch.is_of_tip
            solve = np.linalg.pinv(touch.lever, rcond=1e-6)
            force[t, finger] = -solve @ needed[joints]
            doubt[t, finger] = np.linalg.norm(solve * unknown[t, joints])
    moments = Moments(force, touches, normal, slip, doubt, height, rate[:, :3], bent[:, :3])
    rests = is_of_tip & (touches == "table") & (normal[:, :, 2] < -LEVEL)
    rests &= np.linalg.norm(slip, axis=2) < SLIPPING
    rests[1:] &= (np.diff(steps) == every)[:, None]
    press = np.einsum("tfi,tfiv->tfv", normal, force)
    # Friction of joints that hardly move may be twice what is said of it.
    press[..., 1] = press[..., 0] + (press[..., 1] - press[..., 0]) / _UNSURE["friction"]
    return moments, presses(rests, press, depth, every * motion.period)


def _turning(orientation: Array, rate: Array) -> Array:
    """Angular velocity in the frame of a body: twice the product of its conjugate and its rate."""
    w, x, y, z = orientation / np.linalg.norm(orientation)
    matrix = np.array([[-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])
    turning: Array = 2.0 * matrix @ rate
    return turning


def contacts(moments: Moments, object_name: str) -> Iterator[Figure]:
    """Mass of the object, and friction coefficients, from the forces of fingers."""
    on_object, on_table = moments.touches == "object", moments.touches == "table"
    is_held = on_object.any(axis=1) & ~on_table.any(axis=1)
    # The sum of what fingers do with the object, in the three versions.
    total = np.sum(moments.force * on_object[:, :, None, None], axis=1)
    doubt = np.linalg.norm(moments.doubt * on_object, axis=1)
    rises = (moments.acceleration[:, 2] + GRAVITY)[:, None]
    lifted = is_held & (moments.height > RAISED)
    mass = _ratio(
        "object_mass", object_name, total[lifted, 2], rises[lifted], doubt[lifted],
        "a lift, up and down, without a rest",
    )  # fmt: skip
    yield mass
    speed = np.linalg.norm(moments.velocity[:, :2], axis=1)
    along = moments.velocity[:, :2] / np.maximum(speed, 1e-9)[:, None]
    # A single finger sticks and slips, faster than poses tell.
    is_led = is_held & (on_object.sum(axis=1) > 1)
    slid = is_led & (moments.height < LOWERED) & (speed > SLIDING) & mass.is_told
    pushes = np.einsum("ti,tiv->tv", along, total[:, :2])
    speeds_up = np.einsum("ti,ti->t", along, moments.acceleration[:, :2])[:, None]

    def of_table(weight: float) -> Figure:
        return _ratio(
            "friction", "object_table", (pushes - weight * speeds_up)[slid],
            (weight * rises - total[:, 2])[slid], doubt[slid],
            "an object that slides on the table, and a lift of it",
        )  # fmt: skip

    friction = of_table(mass.value)
    half = float(
        np.hypot(friction.high - friction.value, friction.value - of_table(mass.high).value)
    )
    yield replace(friction, low=friction.value - half, high=friction.value + half)
    slipping = np.linalg.norm(moments.slip, axis=2)
    normal = np.einsum("tfi,tfiv->tfv", moments.normal, moments.force)
    across = moments.force - moments.normal[..., None] * normal[:, :, None]
    drag = np.linalg.norm(across, axis=2)
    pull = np.einsum("tfi,tfi->tf", moments.slip, across[..., 0])
    # What an object that is dragged along does is not seen as fast as a finger.
    around = np.pad(speed, STILL, mode="edge")
    rests = np.lib.stride_tricks.sliding_window_view(around, 2 * STILL + 1).max(axis=1) < SLIDING
    slips = (slipping > SLIPPING) & (normal[..., 0] > PRESSED) & (moments.doubt < DOUBTED)
    slips &= moments.normal[:, :, 2] < -LEVEL
    slips &= pull > ALONG * slipping * drag[..., 0]
    for what, name in (("object", "tip_object"), ("table", "tip_table")):
        chosen = slips & (moments.touches == what) & rests[:, None]
        shown_by = f"a tip that is pressed on the {what} and slides"
        yield _limit("friction", name, drag[chosen] / normal[chosen], shown_by)


def _ratio(
    name: str, joint: str, above: Array, below: Array, doubt: Array, shown_by: str
) -> Figure:
    """The number that times `below` is nearest to `above`, which have a column for each version."""
    weight = 1 / (USUAL**2 + doubt**2)[:, None]
    tops, bottoms = weight * above * below, weight * below**2 * np.ones_like(above)

    def value(chosen: Array) -> Array:
        ratio: Array = np.sum(tops[chosen], axis=0) / np.sum(bottoms[chosen], axis=0)
        return ratio

    return _figure(name, joint, value, len(above), shown_by)


def _limit(name: str, joint: str, ratios: Array, shown_by: str) -> Figure:
    """The largest of these, but for errors; there is a column for each version."""

    def value(chosen: Array) -> Array:
        limit: Array = np.quantile(ratios[chosen], LIMIT, axis=0)
        return limit

    below, above = (
        np.quantile(ratios[:, 0], [LIMIT - AROUND, LIMIT + AROUND]) if len(ratios) else (0, 0)
    )
    return _figure(name, joint, value, len(ratios), shown_by, (above - below) / 2)


def _figure(
    name: str,
    joint: str,
    value: Callable[[Array], Array],
    count: int,
    shown_by: str,
    unsure: float = 0.0,
) -> Figure:
    """A figure from `count` moments: `value` is that of chosen ones, in each version."""
    if count < LEAST_MOMENTS:
        return Figure(name, joint, np.nan, np.nan, np.nan, np.nan, False, shown_by)
    block = np.arange(count) * BLOCKS // count
    without = [value(block != b)[0] for b in range(BLOCKS)]
    spread = np.sqrt(BLOCKS - 1) * np.std(without)  # the jackknife
    best, *others = value(block >= 0).tolist()
    half = float(np.linalg.norm([SURE * spread, unsure, *(np.array(others) - best)]))
    told = half < TOLD * abs(best)
    return Figure(name, joint, best, best - half, best + half, np.nan, told, shown_by)


def _errors_of_poses(poses: Sequence[_Poses], object_name: str) -> Iterator[Figure]:
    """How late poses are, and how far from a smooth motion."""
    delay = np.concatenate([one.delay for one in poses])
    low, value, high = (float(x) for x in np.percentile(delay, [2.5, 50, 97.5]))
    yield Figure("pose_delay", object_name, value, low, high, np.nan, True, "")
    off = np.concatenate([one.measured - one.at(one.step)[0] for one in poses])
    # A quaternion differs by half of the angle; what moves fast is not smooth, so: the median.
    for name, columns, scale in (("pose_noise", slice(3), 1.0), ("turn_noise", slice(3, 7), 2.0)):
        square = np.sum(off[:, columns] ** 2, axis=1) / 3 * scale**2
        usual = float(np.sqrt(np.median(square) / _MEDIAN_OF_THREE))
        yield Figure(name, object_name, usual, 0.9 * usual, 1.1 * usual, np.nan, True, "")


def as_rows(figures: Sequence[Figure]) -> list[dict[str, object]]:
    """All figures for programs; of one that is not told, which motion would show it."""
    told = ("name", "joint", "value", "low", "high")
    untold = ("name", "joint", "shown_by")
    return [
        {key: getattr(one, key) for key in (told if one.is_told else untold)} for one in figures
    ]


def save_handling(figures: Sequence[Figure], folder: Path, base: str) -> Path:
    """Writes a configuration that extends `base`, with what is told, and all figures as JSON."""
    text = configuration_text(base)
    names = re.findall(r"^  - name: (\S+)", _section(text, "objects"), re.MULTILINE)
    found: dict[str, object] = {}
    notes = []
    for one in figures:
        if not one.is_told:
            continue
        key = _KEYS[one.name].format(
            name=one.joint, index=names.index(one.joint) if one.joint in names else 0
        )
        found[key] = round(one.value, 6)
        notes.append(f"# {key}: {one.low:.4g} to {one.high:.4g}")
    text = configuration_text(base, found)
    path = Path(base)
    head = ["# Written by 'trifinger identify --object'. Intervals are of 95 %.", *notes]
    head.append(f"extends: {json.dumps(str(path.resolve()) if path.is_file() else base)}")
    sections = dict.fromkeys(key.partition(".")[0] for key in found)
    folder.mkdir(parents=True, exist_ok=True)
    with whole_file(folder / HANDLED) as part:
        lines = [*head, *(_section(text, name) for name in sections)]
        part.write_text("\n".join(lines), encoding="utf-8")
    with whole_file(folder / FIGURES) as part:
        part.write_text(json.dumps(as_rows(figures), indent=1) + "\n", encoding="utf-8")
    return folder / HANDLED


def _section(text: str, name: str) -> str:
    """A section of a configuration, with its name."""
    found = re.search(rf"^{name}:.*\n(?:[ #].*\n)*", text, re.MULTILINE)
    return found.group() if found else ""
