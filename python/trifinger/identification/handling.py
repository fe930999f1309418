# SPDX-License-Identifier: BSD-3-Clause
"""Mass of an object, friction of its contacts, and errors of its poses, from logs of its handling.

What the torques of a finger do beyond moving the finger itself is the force of its contact: the
observer of external forces, without contacts that are modelled. The robot should be identified
before, because friction of joints looks like force.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import mujoco
import numpy as np

from trifinger._trifinger import FreeRun, Log, configuration_text, export_mjcf
from trifinger.arrays import Array
from trifinger.errors import InvalidArgument
from trifinger.identification.fit import SURE, Figure
from trifinger.identification.motion import Motion, read_motion
from trifinger.whole_file import whole_file

EVERY = 0.01  # between two moments [s]
HALF = 0.03  # of the cubic through measured positions of joints [s]
HALF_POSE = 0.1  # and through poses [s]
NEAR = 0.004  # of a surface that is touched [m]
RAISED = 0.006  # of an object in the air [m]
LOWERED = 0.003  # of one that lies [m]
SLIDING = 0.01  # of an object [m/s]
SLIPPING = 0.04  # of a finger [m/s]
ALONG = 0.7  # cosine of the least angle between slip and drag
PRESSED = 0.15  # of a contact whose friction is looked at [N]
TURNS = 0.02  # of a joint, at which dry friction has most of its value [rad/s]
USUAL = 0.05  # errors of a force, beside the doubt [N]
WEIGHT = 9.81  # [m/s^2]
TREMBLES = 0.1  # of a tip's friction: a tip that slides trembles, which no filter resolves
LEAST_MOMENTS = 30
BLOCKS = 10  # of moments, of which each is left out once
TOLD = 0.3  # half of an interval, as a share of the value
HANDLED = "handled.yml"
FIGURES = "handled.json"
_KEYS = {
    "object_mass": "objects.{index}.mass",
    "friction": "contact.friction.{name}",
    "pose_delay": "simulation.object_delay",
    "pose_noise": "simulation.object_position_noise",
    "turn_noise": "simulation.object_orientation_noise",
}
# What is not known of an identified robot, in its forces: shares of friction and of torques.
_MEDIAN_OF_THREE = 2.366 / 3  # of the mean square of three normal numbers (chi-squared)
_UNSURE = {"friction": 0.2, "torque_scale": 0.04}


@dataclass(frozen=True)
class Moments:
    """What fingers do with an object: a row for each moment, then a column for each finger."""

    force: Array
    """On what is touched [N]: besides, as it would be with more friction, and with more torque."""
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
    """Mass of an object [kg], friction coefficients, and noise and delay of its poses.

    `robot_config` is the robot as it was identified. Raises InvalidArgument if logs are of no use,
    or do not say where the object is.
    """
    if not logs:
        raise InvalidArgument("there is no log")
    parts = []
    poses = []
    for log in logs:
        motion = read_motion([log], robot, robot_config)
        seen = _Poses(str(log), robot, object_name)
        parts.append(_moments(motion, seen, export_mjcf(robot_config), object_name))
        poses.append(seen)
    names = Moments.__dataclass_fields__
    moments = Moments(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
    return [*_contacts(moments, object_name), *_errors_of_poses(poses, object_name)]


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
        self.step: Array = elements["stamp"]["capture_index"][chosen].astype(float)
        self.delay: Array = (
            elements["stamp"]["arrival_index"][chosen] - self.step
        ) * session.period
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
    powers = np.vander(np.arange(-half, half + 1), 4, increasing=True).astype(float)
    weights = np.linalg.pinv(powers)[:3] * np.array([1, 1 / period, 2 / period**2])[:, None]
    padded = np.pad(values, ((half, half), (0, 0)), mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1, axis=0)
    place, rate, acceleration = np.einsum("kw,tjw->ktj", weights, around)
    return place, rate, acceleration


def _moments(motion: Motion, poses: _Poses, model_text: str, object_name: str) -> Moments:
    model = mujoco.MjModel.from_xml_string(model_text)
    data = mujoco.MjData(model)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, object_name)
    joints = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in motion.joints]
    if body < 0 or model.body_jntnum[body] != 1 or min(joints) < 0:
        raise InvalidArgument(f"the robot's configuration has no object '{object_name}'")
    robot = FreeRun.of_text(motion.configuration)
    known = {name: np.array(values) for name, values in robot.described.items()}
    torque_late, measured_late = robot.delays
    dofs, places = model.jnt_dofadr[joints], model.jnt_qposadr[joints]
    links = model.jnt_bodyid[joints]
    scaled, first = np.unique(links[::-1], return_index=True)
    share = known["link_mass"][::-1][first]
    model.body_mass[scaled] *= share
    model.body_inertia[scaled] *= share[:, None]
    model.dof_armature[dofs] = known["rotor_inertia"]
    mujoco.mj_setConst(model, data)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT

    half = max(round(HALF / motion.period), 2)
    q, v, a = smooth(motion.position - known["zero_offset"], half, motion.period)
    pushed, _, _ = smooth(motion.torque, half, motion.period)
    # Friction changes its sign within a moment where something sticks and slips.
    _, quick, _ = smooth(motion.position, half // 6, motion.period)
    dry, _, _ = smooth(known["friction"] * np.tanh(quick / TURNS), half, motion.period)
    every = max(round(EVERY / motion.period), 1)
    room = half + torque_late + measured_late
    last = min(len(motion) - room, int(poses.grid[-1]))
    steps = np.arange(max(room, int(poses.grid[0]) + 1), last, every)
    q, v, a, dry = (rows[steps + measured_late] for rows in (q, v, a, dry))
    resting = known["damping"] * v + dry
    scaled_torque = known["torque_scale"] * pushed[steps - torque_late]
    unsure = np.stack(
        [np.zeros_like(dry), _UNSURE["friction"] * dry, -_UNSURE["torque_scale"] * scaled_torque],
        axis=2,
    )
    external = np.repeat((resting - scaled_torque)[:, :, None], 3, axis=2) + unsure
    place, moved, bent = poses.at(steps)

    trees = [model.body_treeid[links] == tree for tree in np.unique(model.body_treeid[links])]
    touchable = model.geom_contype + model.geom_conaffinity > 0
    own = np.flatnonzero((model.geom_bodyid == body) & touchable)
    carriers = model.body_weldid[model.geom_bodyid]
    ground = np.flatnonzero((carriers == 0) & touchable)
    count = (len(steps), len(trees))
    force, touches = np.zeros((*count, 3, 3)), np.full(count, "", dtype="U6")
    normal, slip = np.zeros((*count, 3)), np.zeros((*count, 3))
    doubt, height = np.zeros(count), np.zeros(len(steps))
    unknown = known["friction"] - np.abs(dry)
    full = np.zeros((model.nv, model.nv))
    free = int(model.body_jntadr[body])
    address, speed_address = model.jnt_qposadr[free], model.jnt_dofadr[free]
    for t in range(len(steps)):
        data.qpos[places], data.qvel[dofs] = q[t], v[t]
        data.qpos[address : address + 7] = place[t]
        data.qvel[speed_address : speed_address + 3] = moved[t, :3]
        data.qvel[speed_address + 3 : speed_address + 6] = _turning(place[t, 3:], moved[t, 3:])
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_fullM(model, data, full)
        inertial = full[np.ix_(dofs, dofs)] @ a[t] + data.qfrc_bias[dofs]
        height[t] = min(_nearest(model, data, own, ground)[0], 1.0)
        for finger, members in enumerate(trees):
            mine = np.flatnonzero(
                touchable & np.isin(model.body_weldid[model.geom_bodyid], links[members])
            )
            near = [_nearest(model, data, mine, there) for there in (own, ground)]
            what = 0 if near[0][0] <= near[1][0] else 1
            distance, line, geom = near[what]
            if distance > NEAR:
                continue
            touches[t, finger] = ("object", "table")[what]
            point, link = line[:3], model.geom_bodyid[geom]
            direction = (line[3:] - point) * (1 if distance > 0 else -1)
            normal[t, finger] = direction / max(np.linalg.norm(direction), 1e-9)
            jacobian = np.zeros((3, model.nv))
            mujoco.mj_jac(model, data, jacobian, None, point, link)
            speed = jacobian @ data.qvel
            if what == 0:
                of_object = np.zeros((3, model.nv))
                mujoco.mj_jac(model, data, of_object, None, point, body)
                speed -= of_object @ data.qvel
            slip[t, finger] = speed - normal[t, finger] * (speed @ normal[t, finger])
            felt = external[t, members] + inertial[members][:, None]
            solve = np.linalg.pinv(jacobian[:, dofs[members]].T, rcond=1e-6)
            force[t, finger] = -solve @ felt
            doubt[t, finger] = np.linalg.norm(solve * unknown[t, members])
    return Moments(force, touches, normal, slip, doubt, height, moved[:, :3], bent[:, :3])


def _turning(orientation: Array, rate: Array) -> Array:
    """Angular velocity in the frame of a body: twice the product of its conjugate and its rate."""
    w, x, y, z = orientation / np.linalg.norm(orientation)
    matrix = np.array([[-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])
    turning: Array = 2.0 * matrix @ rate
    return turning


def _nearest(
    model: mujoco.MjModel, data: mujoco.MjData, mine: Array, others: Array
) -> tuple[float, Array, int]:
    """The least distance of two geoms, the points between which it is, and the own geom."""
    best, points, nearest = np.inf, np.zeros(6), -1
    line = np.zeros(6)
    for one in mine:
        for other in others:
            distance = mujoco.mj_geomDistance(model, data, int(one), int(other), 0.1, line)
            if distance < min(best, 0.1):
                best, points, nearest = distance, line.copy(), int(one)
    return best, points, nearest


def _contacts(moments: Moments, object_name: str) -> Iterator[Figure]:
    on_object, on_table = moments.touches == "object", moments.touches == "table"
    is_held = on_object.any(axis=1) & ~on_table.any(axis=1)
    # The sum of what fingers do with the object, in the three versions.
    total = np.sum(moments.force * on_object[:, :, None, None], axis=1)
    doubt = np.linalg.norm(moments.doubt * on_object, axis=1)
    rises = (moments.acceleration[:, 2] + WEIGHT)[:, None]
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
    rests = speed < SLIDING
    slips = (slipping > SLIPPING) & (normal[..., 0] > PRESSED)
    slips &= pull > ALONG * slipping * drag[..., 0]
    for what, name in (("object", "tip_object"), ("table", "tip_table")):
        chosen = slips & (moments.touches == what) & rests[:, None]
        friction = _ratio(
            "friction", name, drag[chosen], normal[chosen], moments.doubt[chosen],
            f"a tip that is pressed on the {what} and slides",
        )  # fmt: skip
        half = float(np.hypot(friction.high - friction.value, TREMBLES * friction.value))
        yield replace(friction, low=friction.value - half, high=friction.value + half)


def _ratio(
    name: str, joint: str, above: Array, below: Array, doubt: Array, shown_by: str
) -> Figure:
    """The number that times `below` is nearest to `above`, which have a column for each version."""
    if len(above) < LEAST_MOMENTS:
        return Figure(name, joint, np.nan, np.nan, np.nan, np.nan, False, shown_by)
    weight = 1 / (USUAL**2 + doubt**2)[:, None]
    tops, bottoms = weight * above * below, weight * below**2
    values = np.sum(tops, axis=0) / np.sum(bottoms * np.ones_like(tops), axis=0)
    block = np.arange(len(above)) * BLOCKS // len(above)
    without = [np.sum(tops[block != b, 0]) / np.sum(bottoms[block != b, 0]) for b in range(BLOCKS)]
    spread = np.sqrt(BLOCKS - 1) * np.std(without)  # the jackknife
    half = float(np.hypot(SURE * spread, np.linalg.norm(values[1:] - values[0])))
    value = float(values[0])
    told = bool(half < TOLD * abs(value))
    return Figure(name, joint, value, value - half, value + half, np.nan, told, shown_by)


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
        figures_as_json = json.dumps({"figures": [asdict(one) for one in figures]}, indent=1)
        part.write_text(figures_as_json + "\n", encoding="utf-8")
    return folder / HANDLED


def _section(text: str, name: str) -> str:
    """A section of a configuration, with its name."""
    found = re.search(rf"^{name}:.*\n(?:[ #].*\n)*", text, re.MULTILINE)
    return found.group() if found else ""
