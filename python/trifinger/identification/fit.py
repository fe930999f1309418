# SPDX-License-Identifier: BSD-3-Clause
"""Fits a simulated robot to the motion of a real one.

The log is cut into short pieces. Each begins as measured, and the simulated robot is moved by the
applied torques. What its positions differ from the measured ones is made small by Gauss-Newton
steps; docs/decisions/identification.md says why.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np

from trifinger._trifinger import FreeRun
from trifinger.arrays import Array
from trifinger.errors import InvalidArgument
from trifinger.identification.motion import Motion, cubic

DELAY = "delay"
HELD_OUT = 0.2  # share of the motion, at its end, that is not fitted
PIECE = 0.1  # [s]
LONG_PIECE = 1.0  # of a free run [s]
SAMPLES = 20  # of a piece that are compared
BLOCKS = 40  # of the log, between which errors count as independent
CENTERS = ("link_center_x", "link_center_y", "link_center_z")
OF_LINKS = ("link_mass", *CENTERS)
SCALED = ("rotor_inertia", "damping", "friction", "torque_scale", "link_mass")
LEAST_CHANGE = 0.02  # share of what torques alone change, up to which nothing has changed
SURE = 1.96  # standard deviations of a 95 % interval
WIDER = 2.5  # factor on what is seen of errors, which is not all of them
WIDER_CENTER = 4.0  # and on intervals of centres, which make up for each other
TOLD = 0.6  # what the logs leave of the spread that was assumed, for a figure to be told
MOST_PIECES = 1200
TOUCHED = (1e-3, 2e-4)  # errors that are not yet those of a touch, at first and at last [rad]
FIRST_PLAY = 0.4  # of the spread
PLAYS = (0.1, 0.3, 0.6, 1.0)  # that are tried, in spreads
TRUSTS = (0.01, 0.1)  # how much the pieces count against what is assumed, in the first steps
USUAL_CHAIN = 3  # joints that move each other, for which these numbers of pieces are
FEW_PIECES = 250  # with which figures come near their values
STEPS = 8  # of Gauss-Newton at most
ENOUGH = 0.01  # share by which a last step makes the cost less
LEAD = 50  # steps before a piece, in which motors come to where they are in their play
ENGAGED = (-20, 10)  # steps around the begin in which the torque of a joint must not turn
BLUR = 0.05  # of a delay, because torques are interpolated between steps [steps]
LEAST_EFFECT = 6e-5  # of a mass that is off by its spread, beside all others, to be fitted [rad]
_SMOOTH = 7  # steps to each side by which a velocity is measured
_LONGEST_DELAY = 12  # [steps]
_AFTER = max(_SMOOTH, ENGAGED[1])  # steps that a piece needs after it
_BEFORE = LEAD + _SMOOTH + _LONGEST_DELAY + 1  # steps that a piece needs before it
_SCALING = 0.02
_ROBUST = 5.0  # pieces with errors larger than so many usual ones hardly count


@dataclass(frozen=True)
class Kind:
    """A kind of figure: how far it may be from what is described, and what shows it."""

    name: str
    unit: str
    spread: Callable[[Mapping[str, float]], float]
    """Standard deviation of what is assumed before any log, from the limits of the joint and what
    is `described`."""
    step: float
    """For a difference, as a share of the spread."""
    low: float
    shown_by: str


KINDS = (
    Kind(
        "rotor_inertia",
        "kg m^2",
        lambda joint: max(0.5 * joint["described"], 1e-3 * joint["max_torque"]),
        0.02,
        0.0,
        "fast motion that is sped up and braked hard",
    ),
    Kind(
        "damping",
        "Nm s/rad",
        lambda joint: max(joint["described"], 0.05 * joint["max_torque"] / joint["speed"]),
        0.02,
        0.0,
        "long motion at slow and at fast speed",
    ),
    Kind(
        "friction",
        "Nm",
        lambda joint: max(joint["described"], 0.05 * joint["max_torque"]),
        0.02,
        0.0,
        "slow motion in both directions",
    ),
    Kind(
        "torque_scale",
        "",
        lambda _: 0.1,
        0.02,
        0.3,
        "motion against gravity in several poses; with a known mass it is told exactly",
    ),
    Kind("backlash", "rad", lambda _: 0.01, 0.02, 0.0, "many reversals of the torque"),
    Kind(
        "zero_offset",
        "rad",
        lambda _: 0.02,
        0.05,
        -1.0,
        "slow motion against gravity over the whole range",
    ),
    Kind(
        "link_mass",
        "",
        lambda _: 0.1,
        0.02,
        0.3,
        "motion against gravity, slow and fast, of all joints together",
    ),
    *(
        Kind(
            center,
            "m",
            lambda _: 0.005,
            0.05,
            -1.0,
            "motion against gravity, slow and fast, with the joints before it in many poses",
        )
        for center in CENTERS
    ),
)
UNITS = {kind.name: kind.unit for kind in KINDS} | {DELAY: "s"}
Figures = dict[str, list[float]]


@dataclass(frozen=True)
class Figure:
    """A number that was identified."""

    name: str
    joint: str
    """Empty for the delay, which all joints share."""
    value: float
    low: float
    """The 95 % interval."""
    high: float
    described: float
    is_told: bool
    """Whether the logs say more of it than was assumed before."""
    shown_by: str
    """Which motion would show it."""


@dataclass(frozen=True)
class Errors:
    """Standard deviations of what each joint's simulated position is off [rad], [m]."""

    one_step: Array
    """Where motors do not turn in their play."""
    free_run: Array
    """After up to `LONG_PIECE`."""


@dataclass(frozen=True)
class Identification:
    """What a robot is like, as far as its logs tell."""

    motion: Motion
    figures: list[Figure]
    torque_delay: int
    """[steps]"""
    measurement_delay: int
    """[steps]"""
    splits_delay: bool
    """Whether measured torques tell the delay of actions from that of measurements."""
    before: Errors
    """On motion that was not fitted, of the robot as described."""
    after: Errors
    values: Figures = field(repr=False)
    """All figures as they were fitted, by the keys of `identified` in a configuration."""

    @property
    def told(self) -> list[Figure]:
        """The figures that the logs tell."""
        return [figure for figure in self.figures if figure.is_told]

    @property
    def ratio(self) -> float:
        """Error of a free run after identification, as a share of the one before."""
        return float(np.sqrt(np.mean(self.after.free_run**2) / np.mean(self.before.free_run**2)))

    def of(self, name: str, joint: str = "") -> Figure:
        """One figure. Raises InvalidArgument if there is none of that name."""
        for figure in self.figures:
            if (figure.name, figure.joint) == (name, joint):
                return figure
        raise InvalidArgument(f"there is no figure '{name}' of joint '{joint}'")


@dataclass(frozen=True)
class _Parameter:
    kind: Kind | None  # None: the delay
    joint: int
    described: float
    spread: float
    is_fitted: bool
    is_known: bool = False


class _Pieces:
    """Pieces of a motion, ready to be moved again."""

    def __init__(self, motion: Motion, begins: Array, length: int) -> None:
        self.motion, self.begins, self.length = motion, begins, length
        two = begins[:, None] + np.array([-LEAD, 0])
        self.position, self.velocity = _smooth(motion.position, two, motion.period)
        around = motion.torque[begins[:, None] + np.arange(*ENGAGED)] > 0
        self.is_engaged = (around == around[:, :1]).all(axis=1)
        self.measured = motion.position[begins[:, None] + 1 + np.arange(length)]

    def run(self, robot: FreeRun, figures: Figures, delay: float) -> Array:
        """Simulated less measured positions: pieces x steps x joints."""
        whole = math.floor(delay)
        late = _late(self.motion.torque, whole)
        if delay > whole:
            share = delay - whole
            late = (1 - share) * late + share * _late(self.motion.torque, whole + 1)
        steps = self.begins.tolist()
        moved = robot.run(figures, self.position, self.velocity, steps, late, LEAD, self.length)
        errors: Array = np.asarray(moved) - self.measured
        return errors


def _late(values: Array, steps: int) -> Array:
    if steps == 0:
        return values
    return np.concatenate([np.repeat(values[:1], steps, axis=0), values[:-steps]])


def _smooth(position: Array, steps: Array, period: float) -> tuple[Array, Array]:
    """Positions and velocities there, by a cubic through the steps around."""
    offsets = np.arange(-_SMOOTH, _SMOOTH + 1)
    weights = cubic(_SMOOTH)[:2]
    around = position[steps[..., None] + offsets]
    place, speed = np.einsum("ks,...sj->k...j", weights, around)
    return place, speed / period


class _Fit:
    """The least squares problem."""

    def __init__(self, motion: Motion, robot: FreeRun, parameters: list[_Parameter]) -> None:
        self.motion, self.robot, self.parameters = motion, robot, parameters
        self.trees = np.array(robot.trees)
        self.described: Figures = {key: list(value) for key, value in robot.described.items()}
        self.spread = np.array([one.spread for one in parameters])
        self.start = np.array([one.described for one in parameters])
        self.low = np.array([one.kind.low if one.kind else 0.0 for one in parameters])
        self.touched, self.is_exact = TOUCHED[0], False
        # A chain of many joints is changed as many times, so it gets fewer pieces.
        self.share = USUAL_CHAIN / max(USUAL_CHAIN, *np.bincount(self.trees).tolist())
        threads = len(os.sched_getaffinity(0))
        self.pool = ThreadPoolExecutor(threads)

    def figures(self, values: Array) -> tuple[Figures, float]:
        """The figures of all joints, and the delay [steps]."""
        figures = {key: list(value) for key, value in self.described.items()}
        delay = 0.0
        for one, value in zip(self.parameters, values, strict=True):
            if one.kind is None:
                delay = float(value)
            else:
                figures[one.kind.name][one.joint] = float(value)
        return figures, delay

    def far(self, scale: Array) -> Array:
        """The mean square from which on a piece counts as if something had touched the robot."""
        far: Array = np.maximum(_ROBUST * scale, self.touched) ** 2
        return far

    def offset(self, values: Array, free: Sequence[int]) -> Array:
        """How far values are from what is assumed, in spreads."""
        offset: Array = (values - self.start)[free] / self.spread[free]
        return offset

    def deviations(self, system: _System, values: Array, free: Sequence[int]) -> Array:
        """Standard deviations of values."""
        _, covariance = _solve(system, self.offset(values, free))
        deviations: Array = np.sqrt(np.diag(covariance)) * self.spread[free]
        return deviations

    def errors(self, pieces: _Pieces, values: Array) -> Array:
        """Simulated less measured positions of pieces, with other values."""
        return pieces.run(self.robot, *self.figures(values))

    def compared(self, errors: Array) -> Array:
        """Some of the errors of each piece, without what an error of its begin makes of them."""
        length = errors.shape[1]
        chosen = np.linspace(0, length - 1, min(SAMPLES, length)).astype(int)
        chosen_errors = errors[:, chosen]
        line = np.stack([np.ones(len(chosen)), (chosen + 1) / length], axis=1)
        basis, _ = np.linalg.qr(line)
        part = np.einsum("sk,psj->pkj", basis, chosen_errors)
        rest: Array = chosen_errors - np.einsum("sk,pkj->psj", basis, part)
        return rest

    def colours(self) -> list[list[int]]:
        """Parameters that may be changed at once, because no joint feels two of them."""
        colours: list[tuple[set[int], list[int]]] = []
        for i, one in enumerate(self.parameters):
            if not one.is_fitted:
                continue
            tree = {int(self.trees[one.joint])} if one.kind else set(self.trees.tolist())
            for taken, members in colours:
                if not taken & tree:
                    taken |= tree
                    members.append(i)
                    break
            else:
                colours.append((set(tree), [i]))
        return [members for _, members in colours]

    def jacobian(
        self, pieces: _Pieces, values: Array, base: Array, *, is_exact: bool
    ) -> dict[int, Array]:
        """By the number of each parameter that is fitted: compared errors per spread.

        `is_exact`: from both sides, which takes twice as long.
        """
        colours = self.colours()

        def differ(members: list[int]) -> Array:
            rows = np.array([values, values])
            for i in members:
                rows[0, i] += self.step(i)
                rows[1, i] = max(rows[1, i] - self.step(i), self.low[i])
            if not is_exact:
                return self.compared(self.errors(pieces, rows[0])) - base
            ahead, behind = (self.compared(self.errors(pieces, row)) for row in rows)
            widths = np.ones(len(self.trees))
            for i in members:
                share = (rows[0, i] - rows[1, i]) / self.step(i)
                widths[self.felt(i)] = share
            change: Array = (ahead - behind) / widths
            return change

        columns: dict[int, Array] = {}
        for members, change in zip(colours, self.pool.map(differ, colours), strict=True):
            for i in members:
                columns[i] = change * (self.felt(i).astype(float) * self.spread[i] / self.step(i))
        for direction in self.scales(pieces, values, base, columns):
            # Differences are not exact enough to say that this direction changes nothing.
            along = sum(columns[i] * share for i, share in direction.items())
            for i, share in direction.items():
                columns[i] = columns[i] - along * share
        return columns

    def scales(
        self, pieces: _Pieces, values: Array, base: Array, columns: Mapping[int, Array]
    ) -> list[dict[int, float]]:
        """Directions in which masses, torques and friction of joints that move each other grow
        alike, if that changes nothing: of unit length, in spreads, by the numbers of parameters.
        """
        scaled = values.copy()
        found = {}
        for tree in set(self.trees.tolist()):
            members = [
                i
                for i, one in enumerate(self.parameters)
                if one.kind and one.kind.name in SCALED and self.trees[one.joint] == tree
            ]
            if any(self.parameters[i].is_known for i in members):
                continue
            scaled[members] *= 1 + _SCALING
            found[tree] = {i: values[i] / self.spread[i] for i in members if i in columns}
        if not found:
            return []
        change = np.abs(self.compared(self.errors(pieces, scaled)) - base)
        directions = []
        for tree, shares in found.items():
            alone = sum(
                columns[i] * share for i, share in shares.items() if self.kind(i) == "torque_scale"
            )
            usual = np.median(np.abs(alone[..., self.trees == tree]))
            if np.median(change[..., self.trees == tree]) > _SCALING * LEAST_CHANGE * usual:
                continue  # something else has a mass or a spring
            length = math.sqrt(sum(share**2 for share in shares.values()))
            directions.append({i: share / length for i, share in shares.items()})
        return directions

    def kind(self, i: int) -> str:
        """The name of a parameter."""
        kind = self.parameters[i].kind
        return kind.name if kind else DELAY

    def felt(self, i: int) -> Array:
        """Which joints feel a parameter: those that move each other, or all feel the delay."""
        one = self.parameters[i]
        felt: Array = (self.trees == self.trees[one.joint]) | (one.kind is None)
        return felt

    def step(self, i: int) -> float:
        kind = self.parameters[i].kind
        return self.spread[i] * kind.step if kind else 0.2


@dataclass(frozen=True)
class _System:
    """Normal equations in units of the spreads, and how much their right side is off."""

    matrix: Array
    gradient: Array
    noise: Array
    """Covariance of the gradient, from blocks of the log."""
    cost: float


def _system(
    fit: _Fit, pieces: _Pieces, values: Array, scale: Array, free: Sequence[int]
) -> _System:
    base = fit.compared(fit.errors(pieces, values))
    columns = fit.jacobian(pieces, values, base, is_exact=fit.is_exact)
    far = fit.far(scale)
    weights = pieces.is_engaged / (1 + np.mean(base**2, axis=1) / far) ** 2
    weights = weights[:, None, :] / scale**2
    blocks = np.minimum(np.arange(len(base)) * BLOCKS // len(base), BLOCKS - 1)
    count = len(free)
    matrix = np.zeros((count, count))
    gradients = np.zeros((BLOCKS, count))
    for a, i in enumerate(free):
        weighted = columns[i] * weights
        np.add.at(gradients[:, a], blocks, -np.einsum("psj,psj->p", weighted, base))
        for b in range(a, count):
            matrix[a, b] = matrix[b, a] = np.vdot(weighted, columns[free[b]])
    spare = gradients - gradients.mean(axis=0)
    noise = spare.T @ spare * BLOCKS / (BLOCKS - 1)
    return _System(matrix, gradients.sum(axis=0), noise, _cost(pieces, base, scale, far))


def _costs(pieces: _Pieces, compared: Array, scale: Array, far: Array) -> Array:
    """Of each joint."""
    square = np.mean(compared**2, axis=1)
    costs: Array = np.sum(square / scale**2 / (1 + square / far) * pieces.is_engaged, axis=0)
    return costs


def _cost(pieces: _Pieces, compared: Array, scale: Array, far: Array) -> float:
    return float(np.sum(_costs(pieces, compared, scale, far)))


def _scale(pieces: _Pieces, compared: Array) -> Array:
    """The usual error of each joint."""
    rms = np.sqrt(np.mean(compared**2, axis=1))
    engaged = [rms[pieces.is_engaged[:, i], i] for i in range(rms.shape[1])]
    usual = [np.median(some) if len(some) else 1.0 for some in engaged]
    scale: Array = np.maximum(np.array(usual), 1e-7)
    return scale


def _information(system: _System) -> float:
    """How much less than its curvature says the system knows, because errors hang together."""
    ratio = np.diag(system.noise) / np.maximum(np.diag(system.matrix), 1e-30)
    return 1.0 / max(float(np.median(ratio)), 1e-9)


def _solve(system: _System, offset: Array, trust: float = 1.0) -> tuple[Array, Array]:
    """The step to the best values in spreads from `offset`, and its covariance."""
    share = trust * _information(system)
    known = share * system.matrix + np.eye(len(offset))
    inverse = np.linalg.inv(known)
    step: Array = inverse @ (share * system.gradient - offset)
    covariance: Array = (
        inverse @ ((WIDER * share) ** 2 * system.noise + np.eye(len(offset))) @ inverse
    )
    return step, covariance


def _descend(
    fit: _Fit,
    pieces: _Pieces,
    values: Array,
    free: list[int],
    report: Callable[[str], None],
    steps: int = STEPS,
    trust: float = 1.0,
) -> tuple[Array, _System]:
    """Better values, and the last system."""
    index = np.array(free)
    compared = fit.compared(fit.errors(pieces, values))
    for count in range(steps):
        scale = _scale(pieces, compared)
        system = _system(fit, pieces, values, scale, free)
        step, _ = _solve(system, fit.offset(values, free), trust)
        step = np.clip(step, -3.0, 3.0)
        best = system.cost
        for length in (1.0, 0.5, 0.2):
            tried = values.copy()
            tried[index] = np.maximum(
                values[index] + length * step * fit.spread[index], fit.low[index]
            )
            compared = fit.compared(fit.errors(pieces, tried))
            best = _cost(pieces, compared, scale, fit.far(scale))
            if best < system.cost:
                values = tried
                break
        usual = 1e6 * float(np.mean(_scale(pieces, compared)))
        report(f"{len(pieces.begins)} pieces, step {count + 1}: usual error {usual:.0f} urad")
        if best > (1 - ENOUGH) * system.cost:
            break
    return values, system


def _parameters(
    motion: Motion, robot: FreeRun, known: str, *, with_centers: bool
) -> list[_Parameter]:
    trees = np.array(robot.trees)
    parameters = []
    for kind in KINDS:
        if kind.name in CENTERS and not with_centers:
            continue
        for joint, described in enumerate(robot.described[kind.name]):
            facts = {
                "described": described,
                "max_torque": min(float(motion.limits["max_torque"][joint]), 1e4),
                "speed": min(float(motion.limits["max_velocity"][joint]), 10.0),
            }
            # What moves with a joint that moves is felt by its motor.
            is_fitted = bool(motion.moved[trees == trees[joint]].any())
            if kind.name not in OF_LINKS:
                is_fitted = is_fitted and bool(motion.moved[joint])
            is_known = kind.name == known
            is_fitted = is_fitted and not is_known
            spread = kind.spread(facts)
            parameters.append(_Parameter(kind, joint, described, spread, is_fitted, is_known))
    parameters.append(_Parameter(None, 0, 0.0, 3.0, is_fitted=True))
    return parameters


def action_delay(motion: Motion) -> int | None:
    """Steps from an applied torque to its measurement; None if the log does not say it."""
    errors = []
    for delay in range(_LONGEST_DELAY):
        late = _late(motion.torque, delay + 1)
        same = motion.segment == np.concatenate(
            [motion.segment[: delay + 1], motion.segment[: -delay - 1]]
        )
        errors.append(float(np.mean((motion.measured_torque - late)[same] ** 2)))
    best = int(np.argmin(errors))
    others = min(errors[i] for i in (best - 1, best + 1) if 0 <= i < len(errors))
    return best if others > 2 * errors[best] else None


def identify(
    motion: Motion,
    known: str = "",
    report: Callable[[str], None] = lambda _text: None,
    *,
    with_centers: bool = False,
) -> Identification:
    """Fits the simulated robot to a motion.

    `known` may be "torque_scale" or "link_mass": these are as described. Without a known one, only
    their ratios are told exactly. The links' centres of mass are as described, too, unless
    `with_centers`. Raises InvalidArgument if the motion is not of this robot.
    """
    robot = FreeRun.of_text(motion.configuration)
    parameters = _parameters(motion, robot, known, with_centers=with_centers)
    fit = _Fit(motion, robot, parameters)
    split = int(len(motion) * (1 - HELD_OUT))
    pieces = _pieces(motion, PIECE, 0, split, fit.share)
    free = [i for i, one in enumerate(parameters) if one.is_fitted]
    # Far from the values a part of the pieces says enough.
    few = _thinned(pieces, max(round(FEW_PIECES * fit.share), 2 * BLOCKS))
    values = fit.start.copy()
    plays = [i for i in free if fit.kind(i) == "backlash"]
    # Little play is no play in a few steps, so slopes are of use only with some.
    values[plays] = np.maximum(values[plays], FIRST_PLAY * fit.spread[plays])
    # Errors are no noise yet: what is hardly seen would take them all.
    first = [i for i in free if fit.kind(i) not in ("zero_offset", *OF_LINKS)]
    for trust in TRUSTS:
        values = _best_delay(fit, few, values)
        values, _ = _descend(fit, few, values, first, report, 3, trust)
        values = _best_plays(fit, few, values)
    fit.is_exact = True
    values, _ = _descend(fit, few, values, free, report)
    values = _best_plays(fit, few, values)
    fit.touched = TOUCHED[1]  # reversals fit by now
    if not with_centers:  # beside which no mass would be felt
        values, free = _without_faint_masses(fit, few, values, free)
    values, system = _descend(fit, few, values, free, report)
    deviation = np.zeros(len(parameters))
    deviation[-1] = math.hypot(fit.deviations(system, values, free)[-1], BLUR)
    delay = float(values[-1])
    # The simulated robot has whole steps: the other figures are those that go with them.
    values[-1] = whole = round(delay)
    free = free[:-1]
    values, _ = _descend(fit, few, values, free, report, 4)
    values, system = _descend(fit, pieces, values, free, report, 2)
    # What another length of pieces says differently is no noise, but an error of the method.
    other = _pieces(motion, 0.5 * PIECE, 0, split, fit.share)
    scale = _scale(other, fit.compared(fit.errors(other, values)))
    offset = fit.offset(values, free)
    shift, _ = _solve(_system(fit, other, values, scale, free), offset)
    own, _ = _solve(system, offset)
    method = WIDER * np.hypot(shift - own, own) * fit.spread[free]
    deviation[free] = np.hypot(fit.deviations(system, values, free), method)
    deviation[[i for i in free if fit.kind(i) in CENTERS]] *= WIDER_CENTER
    best = values.copy()
    best[-1] = delay
    figures = _figures(motion, fit, best, deviation, known)
    acted = action_delay(motion)
    torque_delay = min(whole if acted is None else acted, whole)
    result = Identification(
        motion,
        figures,
        torque_delay,
        whole - torque_delay,
        acted is not None,
        errors_of(fit.robot, motion, *fit.figures(fit.start), split),
        errors_of(fit.robot, motion, *fit.figures(values), split),
        fit.figures(values)[0],
    )
    _require_same_robot(result)
    return result


def _without_faint_masses(
    fit: _Fit, pieces: _Pieces, values: Array, free: list[int]
) -> tuple[Array, list[int]]:
    """Masses as described, and no longer fitted, of links that motion hardly feels.

    Small errors of the model would look like such a mass.
    """
    scale = _scale(pieces, fit.compared(fit.errors(pieces, values)))
    matrix = _system(fit, pieces, values, scale, free).matrix
    inverse = np.linalg.pinv(matrix, rcond=1e-12, hermitian=True)
    values, left = values.copy(), []
    for a, i in enumerate(free):
        tree = fit.trees == fit.trees[fit.parameters[i].joint]
        count = len(pieces.begins) * min(SAMPLES, pieces.length) * np.sum(tree)
        effect = float(np.mean(scale[tree])) / math.sqrt(max(inverse[a, a], 1e-30) * count)
        if fit.kind(i) == "link_mass" and effect < LEAST_EFFECT:
            values[i] = fit.start[i]
            fit.parameters[i] = replace(fit.parameters[i], is_fitted=False)
        else:
            left.append(i)
    return values, left


def _pieces(motion: Motion, seconds: float, first: int, last: int, share: float) -> _Pieces:
    length = max(round(seconds / motion.period), 5)
    begins = motion.pieces(length, length, _BEFORE, _AFTER)
    begins = begins[(begins >= first) & (begins + length < last)]
    if len(begins) < 2 * BLOCKS:
        raise InvalidArgument("the logs have too little motion without gaps")
    return _thinned(_Pieces(motion, begins, length), max(round(MOST_PIECES * share), 2 * BLOCKS))


def _thinned(pieces: _Pieces, most: int) -> _Pieces:
    count = len(pieces.begins)
    if count <= most:
        return pieces
    chosen = np.linspace(0, count - 1, most).astype(int)
    return _Pieces(pieces.motion, pieces.begins[chosen], pieces.length)


def _best_delay(fit: _Fit, pieces: _Pieces, values: Array) -> Array:
    """With the delay that is best of all whole ones, whatever the other figures are."""
    scale = _scale(pieces, fit.compared(fit.errors(pieces, values)))
    tried = np.repeat(values[None], _LONGEST_DELAY, axis=0)
    tried[:, -1] = np.arange(_LONGEST_DELAY)

    def cost(row: Array) -> float:
        return _cost(pieces, fit.compared(fit.errors(pieces, row)), scale, fit.far(scale))

    best: Array = tried[np.argmin(list(fit.pool.map(cost, tried)))]
    return best


def _best_plays(fit: _Fit, pieces: _Pieces, values: Array) -> Array:
    """With plays that are better than those found, which steps along a slope may not reach."""
    scale = _scale(pieces, fit.compared(fit.errors(pieces, values)))

    def costs(row: Array) -> Array:
        return _costs(pieces, fit.compared(fit.errors(pieces, row)), scale, fit.far(scale))

    values = values.copy()
    for members in fit.colours():
        if any(fit.kind(i) != "backlash" for i in members):
            continue
        tried = np.repeat(values[None], 1 + len(PLAYS), axis=0)
        tried[1:, members] = np.outer(PLAYS, fit.spread[members])
        found = np.array(list(fit.pool.map(costs, tried)))
        for i in members:
            values[i] = tried[np.argmin(found[:, fit.felt(i)].sum(axis=1)), i]
    return values


def _figures(
    motion: Motion, fit: _Fit, values: Array, deviation: Array, known: str
) -> list[Figure]:
    figures = []
    for i, one in enumerate(fit.parameters):
        value, spread = float(values[i]), float(deviation[i])
        told = one.is_fitted and spread < TOLD * one.spread
        unit = motion.period if one.kind is None else 1.0
        low = max(value - SURE * spread, float(fit.low[i]))
        name = one.kind.name if one.kind else DELAY
        shown_by = one.kind.shown_by if one.kind else "motion with changes of direction"
        if name == known:
            shown_by = "it was said to be as described"
        joint = motion.joints[one.joint] if one.kind else ""
        high = value + SURE * spread
        figures.append(
            Figure(
                name, joint, unit * value, unit * low, unit * high, unit * one.described, told,
                shown_by,
            )
        )  # fmt: skip
    return figures


def errors_of(robot: FreeRun, motion: Motion, figures: Figures, delay: float, first: int) -> Errors:
    """How far a simulated robot is off after `first`."""
    measured, free = free_runs(robot, motion, figures, delay, first)
    free = free - measured
    short = motion.pieces(1, 7, _BEFORE, _AFTER)
    one = _Pieces(motion, short[short >= first], 1)
    # A motor that turns in its play has no speed that a log could tell.
    step = np.where(one.is_engaged, one.run(robot, figures, delay)[:, 0], np.nan)
    return Errors(np.sqrt(np.nanmean(step**2, axis=0)), np.sqrt(np.mean(free**2, axis=(0, 1))))


def free_runs(
    robot: FreeRun, motion: Motion, figures: Figures, delay: float, first: int
) -> tuple[Array, Array]:
    """Measured and simulated positions of pieces after `first`: pieces x steps x joints."""
    length = round(LONG_PIECE / motion.period)
    begins = motion.pieces(length, length, _BEFORE, _AFTER)
    begins = begins[begins >= first]
    if not len(begins):
        raise InvalidArgument("the logs have too little motion without gaps")
    pieces = _Pieces(motion, begins, length)
    return pieces.measured, pieces.run(robot, figures, delay) + pieces.measured


def _require_same_robot(result: Identification) -> None:
    scales = [one.value for one in result.figures if one.name in ("torque_scale", "link_mass")]
    if result.ratio > 1.1 or min(scales) < 0.5 or max(scales) > 2.0:
        raise InvalidArgument(
            f"{', '.join(result.motion.logs)}: no figures make the simulated robot move like this; "
            "the log is of another robot than its configuration says, or something touched it"
        )
