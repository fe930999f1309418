# SPDX-License-Identifier: BSD-3-Clause
"""Whether a motion stays within the limits of its robot, and how slow it must be to do so."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
from trifinger.errors import InvalidArgument

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from trifinger_view.motion.facts import JointFacts
    from trifinger_view.motion.motion import Motion

ANGLE_TOLERANCE = 1e-6  # [rad]
SPEED_TOLERANCE = 0.01  # [rad/s]; a check that brakes acts in proportion to the excess
RELATIVE_TOLERANCE = 1e-6
MAX_FACTOR = 1000.0
UNITS = {
    "rad": {"position": "rad", "speed": "rad/s", "torque": "Nm"},
    "m": {"position": "m", "speed": "m/s", "torque": "N"},
}
"""Units of a joint by that of its position."""


@dataclasses.dataclass(frozen=True)
class Violation:
    """The place where a joint of a motion is farthest beyond one of its limits."""

    kind: str
    """"position", "speed" or "torque"."""
    joint: str
    time: float
    """Since the first sample [s]."""
    value: float
    """What the motion needs [rad], [rad/s] or [Nm]; of a slide [m], [m/s] or [N]."""
    allowed: float
    """What the robot allows there, in the same unit."""
    joint_unit: str = "rad"
    """Unit of the joint's position: see `JointFacts.units`."""

    def __str__(self) -> str:
        units = [UNITS[one][self.kind] for one in self.joint_unit.split(" or ")]
        unit = " or ".join(units)
        need = {"position": "goes to", "speed": "moves at", "torque": "needs"}[self.kind]
        limit = {"position": "soft limit", "speed": "speed limit there", "torque": "limit"}
        return (
            f"{self.joint} {need} {self.value:.4g} {unit} at {self.time:.3f} s; "
            f"its {limit[self.kind]} is {self.allowed:.4g} {unit}"
        )


@dataclasses.dataclass(frozen=True)
class Samples:
    """Points of a trajectory: in each array a row for each point, a column for each joint."""

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    accelerations: NDArray[np.float64]

    @staticmethod
    def of(motion: Motion) -> Samples:
        """The samples of a motion."""
        return Samples(motion.times, motion.positions, motion.velocities, motion.accelerations)


def allowed_speeds(facts: JointFacts, samples: Samples) -> NDArray[np.float64]:
    """Largest speed of each joint at each sample [rad/s], as the check `limit_velocity` has it.

    It is min(max_velocity, sqrt(2 braking d)), where d is the distance to the soft limit ahead.
    """
    ahead = np.where(samples.velocities >= 0, facts.soft_upper, facts.soft_lower)
    distance = np.abs(ahead - samples.positions)
    beyond = (samples.positions - ahead) * np.sign(samples.velocities) > 0
    with np.errstate(invalid="ignore"):
        braked = np.sqrt(2 * facts.braking * np.where(beyond, 0.0, distance))
    braked = np.where(np.isnan(braked), np.inf, braked)  # infinite braking right at the limit
    return np.minimum(facts.max_velocity, braked)


def violations(facts: JointFacts, samples: Samples) -> list[Violation]:
    """The worst violation of each kind for each joint; an empty list if all limits hold.

    A torque is what the motion asks for in free space: dynamics plus `safety_kd` times velocity.
    Where something touches the robot nobody knows the torques, and where nobody knows the dynamics
    they are not checked. A speed may be 0.01 rad/s above its limit.
    """
    q, v = samples.positions, samples.velocities
    found = []
    below = q < facts.soft_lower
    edge = np.where(below, facts.soft_lower, facts.soft_upper)
    beyond = np.maximum(facts.soft_lower - q, q - facts.soft_upper)
    found += _worst("position", facts, samples, q, edge, beyond - ANGLE_TOLERANCE)
    speed = allowed_speeds(facts, samples)
    found += _worst("speed", facts, samples, np.abs(v), speed, np.abs(v) - speed - SPEED_TOLERANCE)
    motor = facts.torques(q, v, samples.accelerations)
    if motor is not None:
        asked = motor + facts.safety_kd * v
        torque = np.maximum(np.abs(motor), np.abs(asked))
        most = np.broadcast_to(facts.max_torque, torque.shape)
        excess = torque - most * (1 + RELATIVE_TOLERANCE)
        found += _worst("torque", facts, samples, torque, most, excess)
    return found


def _worst(
    kind: str,
    facts: JointFacts,
    samples: Samples,
    values: NDArray[np.float64],
    allowed: NDArray[np.float64],
    excess: NDArray[np.float64],
) -> list[Violation]:
    found = []
    for joint in np.flatnonzero((excess > 0).any(axis=0)):
        row = int(np.argmax(excess[:, joint]))
        found.append(
            Violation(
                kind,
                facts.joints[joint],
                float(samples.times[row]),
                float(values[row, joint]),
                float(allowed[row, joint]),
                facts.units[joint],
            )
        )
    return found


def slowing_factor(facts: JointFacts, motion: Motion) -> float:
    """The least factor, at least 1, from which on the slowed motion holds all limits.

    Raises InvalidArgument if no factor helps: the motion leaves the soft limits, a pose cannot be
    held against gravity, or the factor would be above 1000.
    """
    samples = Samples.of(motion)
    found = violations(facts, samples)
    for violation in found:
        if violation.kind == "position":
            raise InvalidArgument(f"slower does not help: {violation}")
    if not found:
        return 1.0
    rate = np.full(samples.positions.shape, np.inf)  # r = 1 / factor that is allowed at a sample
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = allowed_speeds(facts, samples) + SPEED_TOLERANCE
        rate = np.minimum(
            rate, np.where(samples.velocities != 0, speed / abs(samples.velocities), np.inf)
        )
    rate = np.minimum(rate, _torque_rates(facts, samples))
    row, joint = np.unravel_index(int(np.argmin(rate)), rate.shape)
    factor = 1 / float(rate[row, joint]) if rate[row, joint] > 0 else math.inf
    if factor > MAX_FACTOR:
        raise InvalidArgument(
            f"slower does not help: {facts.joints[joint]} would have to be more than "
            f"{MAX_FACTOR:g} times as slow at {samples.times[row]:.3f} s; smooth or trim the motion"
        )
    # All slower motions hold the limits as well, so rounding goes to this side.
    return max(1.0, factor * (1 + 1e-9))


def _torque_rates(facts: JointFacts, samples: Samples) -> NDArray[np.float64]:
    # With the rate r, velocities are multiplied by r and accelerations by r^2. So the torque that
    # is asked for is c r^2 + b r + g, and that of the motor c r^2 + g: see docs/motions.md.
    q, v = samples.positions, samples.velocities
    hold = facts.holding_torques(q)
    whole = facts.torques(q, v, samples.accelerations)
    if hold is None or whole is None:
        return np.full(q.shape, np.inf)
    most = facts.max_torque
    if (np.abs(hold) > most).any():
        row, joint = np.argwhere(np.abs(hold) > most)[0]
        unit = UNITS[facts.units[joint]]["torque"]
        raise InvalidArgument(
            f"slower does not help: {facts.joints[joint]} needs {abs(hold[row, joint]):.3g} {unit} "
            f"to hold its pose at {samples.times[row]:.3f} s; its limit is {most[joint]:.3g} {unit}"
        )
    c, b = whole - hold, facts.safety_kd * v
    rate = np.full(q.shape, np.inf)
    for side in (-1.0, 1.0):
        for linear in (b, np.zeros_like(b)):
            # g + b r + c r^2 = side * most; written so that the bound is positive at r = 0.
            rate = np.minimum(rate, _first_root(side * c, side * linear, side * hold - most))
    return rate


def _first_root(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The least r > 0 with a r^2 + b r + c = 0, for c <= 0; infinity if there is none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        discriminant = b * b - 4 * a * c
        root = np.sqrt(np.maximum(discriminant, 0))
        # Of the two forms of the formula this one subtracts nothing that is almost equal.
        half = -0.5 * (b + np.where(b >= 0, root, -root))
        candidates = np.stack([half / a, c / half])
    candidates = np.where((candidates > 0) & np.isfinite(candidates), candidates, np.inf)
    least: NDArray[np.float64] = np.where(discriminant >= 0, candidates.min(axis=0), np.inf)
    return least
