# SPDX-License-Identifier: BSD-3-Clause
"""How soft the tips of fingers are, and how much they damp, from presses on a table.

A press that swells slowly and quickly shows both: a soft tip yields more, and one that damps yields
later. Friction of joints makes it late, too; as far as it grows with speed, it looks like damping.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from trifinger.arrays import Array
from trifinger.identification.fit import SURE, Figure

DEPTHS = np.concatenate([np.linspace(0, 2e-3, 200), np.geomspace(2.1e-3, 0.05, 100)])  # [m]
SUBSTEPS = 4  # between two moments
LEAST_SECONDS = 2.0  # of a press
LEAST_SWELL = 0.5  # of its force [N]
SETTLED = 0.2  # after its begin [s]
MOST_FRICTION = 0.5  # of joints, in a force [N]
BLOCKS = 10  # of moments, of which each is left out once
TOLD = math.log(2)  # of the logarithm of a figure, to each side
MOST_UNSURE = 10.0  # of the logarithm of a figure
MICRO = 1e6  # errors of depths are compared in micrometres
# What a configuration may have of each figure.
_ALLOWED = {"tip_time_constant": (0.002, 0.1), "tip_damping_ratio": (0.1, 10.0)}  # [s]
_BOUNDS = np.array([[np.log(5e-4), np.log(0.1), 0.0], [np.log(0.3), np.log(10.0), MOST_FRICTION]])
_AT_A_BOUND = 1e-3
_SHOWN_BY = "tips that are pressed on the table with forces that swell slowly and quickly"

Press = tuple[Array, Array]
"""Forces [N], a column for each version of them, and depths [m], a row for each moment."""


@dataclass(frozen=True)
class SoftContact:
    """The contact of a tip with what does not move, as MuJoCo has it ("Solver parameters")."""

    time_constant: float
    """[s]"""
    damping_ratio: float
    impedance: Array
    """MuJoCo's five numbers."""
    inverse_mass: float
    """Of the tip [1/kg]."""

    @classmethod
    def of(cls, model: mujoco.MjModel, geom: int) -> SoftContact | None:
        """That of a geom of a model; None if it has a stiffness instead of a time constant."""
        if model.geom_solref[geom, 0] <= 0:
            return None
        inverse_mass = float(model.body_invweight0[model.geom_bodyid[geom], 0])
        time_constant, damping_ratio = model.geom_solref[geom].tolist()
        return cls(time_constant, damping_ratio, model.geom_solimp[geom].copy(), inverse_mass)

    def depths(self, force: Array, period: float, parameters: Array) -> Array:
        """How deep a tip is in what it presses on: a row for each press, by its forces [N], [m].

        `parameters` are the logarithms of the time constant at a damping ratio of 1 and of the
        damping ratio, and the force that friction of joints takes [N].
        """
        most = self.impedance[1]
        stiffness = np.exp(-2 * parameters[0]) / most**2
        damping = 2 * np.exp(parameters[1] - parameters[0]) / most
        impedance = self._impedance(DEPTHS)
        at_rest = stiffness * impedance**2 * DEPTHS / ((1 - impedance) * self.inverse_mass)
        held = force[:, 0]
        depth, speed = np.interp(held, at_rest, DEPTHS), np.zeros(len(force))
        rows = [depth]
        step = period / SUBSTEPS
        for before, after in itertools.pairwise(force.T):
            for part in range(1, SUBSTEPS + 1):
                asked = before + part / SUBSTEPS * (after - before)
                old, held = held, np.clip(held, asked - parameters[2], asked + parameters[2])
                impedance = self._impedance(depth)
                pushed = (old + held) / 2 * (1 - impedance) / impedance * self.inverse_mass
                spring = stiffness * impedance
                # The rule of trapezoids.
                left = step * damping / 2 + step**2 * spring / 4
                faster = speed
                speed = (speed * (1 - left) + step * (pushed - spring * depth)) / (1 + left)
                depth = depth + step * (faster + speed) / 2
            rows.append(depth)
        return np.stack(rows, axis=1)

    def _impedance(self, depth: Array) -> Array:
        least, most, width, middle, power = self.impedance
        share = np.clip(depth / width, 0, 1)
        bent = np.where(
            share <= middle,
            share**power / middle ** (power - 1),
            1 - (1 - share) ** power / (1 - middle) ** (power - 1),
        )
        impedance: Array = least + bent * (most - least)
        return impedance


def presses(rests: Array, force: Array, depth: Array, period: float) -> list[Press]:
    """What is measured while tips are pressed on the table.

    Rows are moments, one after the other; columns are fingers: whether their tip rests on the
    table, the force (in as many versions as its last index has) [N], and the depth [m].
    """
    found = []
    for finger in range(rests.shape[1]):
        edges = np.flatnonzero(np.diff(rests[:, finger], prepend=False, append=False))
        for begin, end in edges.reshape(-1, 2):
            chosen = slice(begin + round(SETTLED / period), end)
            if period * (chosen.stop - chosen.start) < LEAST_SECONDS:
                continue
            press = (force[chosen, finger], depth[chosen, finger])
            if np.ptp(press[0][:, 0]) >= LEAST_SWELL and all(np.isfinite(x).all() for x in press):
                found.append(press)
    return found


def softness(
    pressed: Sequence[Press], contact: SoftContact | None, period: float
) -> Iterator[Figure]:
    """Time constant [s] and damping ratio of tips, from presses; `contact` is as described."""
    if not pressed or contact is None:
        for name in _ALLOWED:
            yield Figure(name, "tips", np.nan, np.nan, np.nan, np.nan, False, _SHOWN_BY)
        return
    longest = max(len(depth) for _, depth in pressed)
    rows = [np.minimum(np.arange(longest), len(depth) - 1) for _, depth in pressed]
    is_measured = np.array([np.arange(longest) < len(depth) for _, depth in pressed])
    force = np.array([one[row] for row, (one, _) in zip(rows, pressed, strict=True)])
    depth = np.array([one[row] for row, (_, one) in zip(rows, pressed, strict=True)])
    counts = is_measured.sum(axis=1, keepdims=True)
    start = np.log([contact.time_constant * contact.damping_ratio, contact.damping_ratio])
    start = np.clip([*start, 0.1 * MOST_FRICTION], _BOUNDS[0] + 1e-6, _BOUNDS[1] - 1e-6)

    def fit(version: int) -> OptimizeResult:
        def errors(parameters: Array) -> Array:
            off = contact.depths(force[..., version], period, parameters) - depth
            # Where the surface is, joints do not tell that well.
            off -= np.sum(off * is_measured, axis=1, keepdims=True) / counts
            chosen: Array = MICRO * off[is_measured]
            return chosen

        return least_squares(errors, start, bounds=_BOUNDS, x_scale=[0.1, 0.1, 0.02])

    best, *others = [fit(version) for version in range(force.shape[-1])]
    is_free = np.all(np.abs(best.x - _BOUNDS)[:, :2] > _AT_A_BOUND)
    left_out = np.sqrt(BLOCKS - 1) * _without_blocks(best)  # the jackknife

    def figure(name: str, share: Array, offset: float = 0.0) -> Figure:
        """That whose logarithm is a sum of shares of the parameters."""
        shifts = [share @ (other.x - best.x) for other in others]
        half = min(float(np.linalg.norm([SURE * np.std(left_out @ share), *shifts])), MOST_UNSURE)
        low, value, high = np.exp(share @ best.x + offset + half * np.array([-1, 0, 1])).tolist()
        is_told = bool(is_free and half < TOLD and _ALLOWED[name][0] <= value <= _ALLOWED[name][1])
        return Figure(name, "tips", value, low, high, np.nan, is_told, _SHOWN_BY)

    time_constant = figure("tip_time_constant", np.array([1.0, -1.0, 0.0]))
    ratio = figure("tip_damping_ratio", np.array([0.0, 1.0, 0.0]))
    if not (time_constant.is_told and ratio.is_told):
        # The damping is the one that is described. The tip yields as much as it does.
        ratio = replace(ratio, is_told=False)
        described = -np.log(contact.damping_ratio)
        time_constant = figure("tip_time_constant", np.array([1.0, 0.0, 0.0]), described)
    yield from (time_constant, ratio)


def _without_blocks(fitted: OptimizeResult) -> Array:
    """How parameters change without each block of the errors."""
    free = fitted.x > _BOUNDS[0] + 1e-4
    changes = np.zeros((BLOCKS, len(free)))
    slopes = fitted.jac[:, free]
    all_slopes = slopes.T @ slopes
    for change, block in zip(changes, np.array_split(np.arange(len(slopes)), BLOCKS), strict=True):
        own = slopes[block]
        inverse = np.linalg.pinv(all_slopes - own.T @ own, hermitian=True)
        change[free] = inverse @ (own.T @ fitted.fun[block])
    return changes
