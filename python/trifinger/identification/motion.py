# SPDX-License-Identifier: BSD-3-Clause
"""What logs say of the motion of a robot's joints, and why a log says nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from trifinger._trifinger import Log, LoggedSession, configuration_text, read_joint_facts
from trifinger.arrays import Array
from trifinger.errors import InvalidArgument

GOOD_ENDS = ("finished", "detached")
SHORTEST = 10.0  # of all motion together [s]
MOVED = 0.02  # a joint that stays within this range has not moved [rad]
MOST_SATURATED = 0.2  # share of the steps in which a joint may get its largest torque
_JUMP = 0.5  # of a period, by which two steps are not one after the other
_FIELDS = {"observation": ("position", "velocity", "torque"), "applied_action": ("torque",)}


@dataclass(frozen=True)
class Motion:
    """Steps of logs, one after the other; each row is a step, each column a joint."""

    configuration: str
    """The text of the robot's configuration."""
    joints: tuple[str, ...]
    limits: dict[str, Array]
    """Of each joint, by the keys of `safety`."""
    period: float
    """[s]"""
    position: Array
    velocity: Array
    measured_torque: Array
    torque: Array
    """As it was applied."""
    segment: Array
    """The number of the part of a log without a gap to which each step belongs."""
    logs: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.position)

    @property
    def moved(self) -> Array:
        """Whether each joint has moved."""
        moved: Array = np.ptp(self.position, axis=0) > MOVED
        return moved

    def pieces(self, length: int, every: int, before: int, after: int) -> Array:
        """The steps at which pieces of the motion begin that have no gap.

        `before` and `after` are steps that a piece needs besides its `length`.
        """
        begins = np.arange(before, len(self) - length - after, every)
        same = self.segment[begins - before] == self.segment[begins + length + after]
        chosen: Array = begins[same]
        return chosen


def read_motion(
    logs: Sequence[str | Path], robot: str = "", robot_config: str | None = None
) -> Motion:
    """Reads logs of one robot. Raises InvalidArgument with a sentence if they are of no use.

    `robot_config` is its configuration, if it is not the one in the logs.
    """
    found = [(str(path), Log(path).session(robot)) for path in logs]
    if not found:
        raise InvalidArgument("there is no log")
    for path, session in found:
        _require_good_end(path, session)
    configuration = configuration_text(robot_config) if robot_config else _document(*found[0])
    parts, segment, count = [], [], 0
    for path, session in found:
        _require_same(path, session, *found[0])
        steps = session.read(series=_FIELDS)
        if not len(steps):
            raise InvalidArgument(f"{path}: there is no step of '{session.name}' in this log")
        seen, applied = _asked(steps.observations), _asked(steps.applied_actions)
        parts.append((seen["position"], seen["velocity"], seen["torque"], applied["torque"]))
        breaks = np.diff(steps.time_index) != 1
        if session.is_real_time:
            waits = np.diff(steps.times).astype(np.int64) * 1e-9
            breaks |= np.abs(waits - session.period) > _JUMP * session.period
        segment.append(count + np.concatenate([[0], np.cumsum(breaks)]))
        count = int(segment[-1][-1]) + 1
    position, velocity, measured, torque = (
        np.concatenate([np.asarray(part[i], dtype=float) for part in parts]) for i in range(4)
    )
    joints, limits = _facts(configuration, found[0][1], position.shape[1])
    motion = Motion(
        configuration,
        joints,
        limits,
        found[0][1].period,
        position,
        velocity,
        measured,
        torque,
        np.concatenate(segment),
        tuple(path for path, _ in found),
    )
    _require_useful(motion)
    return motion


def cubic(half: int) -> Array:
    """Weights of `half` values to each side of a place, for the coefficients of the cubic that is
    nearest to them: of powers of steps from there, the constant first.
    """
    powers = np.vander(np.arange(-half, half + 1), 4, increasing=True).astype(float)
    weights: Array = np.linalg.pinv(powers)
    return weights


def _asked(series: Array | None) -> Array:
    if series is None:
        raise InvalidArgument("the log lacks a series")
    return series


def _document(path: str, session: LoggedSession) -> str:
    text = session.documents.get("configuration.yml")
    if text is None:
        raise InvalidArgument(
            f"{path}: the log has no configuration of '{session.name}'; --robot-config says it"
        )
    return text


def _facts(
    configuration: str, session: LoggedSession, count: int
) -> tuple[tuple[str, ...], dict[str, Array]]:
    _, joints, limits = read_joint_facts(configuration, session.type, opens_file=True)
    if len(joints) != count:
        raise InvalidArgument(
            f"the log is of another robot: it has {count} joints, the configuration {len(joints)}"
        )
    return joints, limits


def _require_good_end(path: str, session: LoggedSession) -> None:
    fault = session.fault
    if fault is None or fault.code in GOOD_ENDS:
        return
    raise InvalidArgument(
        f"{path}: the robot stopped with a fault in step {fault.time_index} "
        f"({session.fault_text}); use a log in which it did not"
    )


def _require_same(path: str, session: LoggedSession, other: str, first: LoggedSession) -> None:
    if session.type != first.type or session.period != first.period:
        raise InvalidArgument(
            f"{path} is of another robot than {other}: of type '{session.type}' with steps of "
            f"{session.period:g} s, not '{first.type}' with {first.period:g} s"
        )


def _require_useful(motion: Motion) -> None:
    where = ", ".join(motion.logs)
    if len(motion) * motion.period < SHORTEST:
        raise InvalidArgument(
            f"{where}: {len(motion) * motion.period:.1f} s are too short, "
            f"{SHORTEST:g} s of motion are needed"
        )
    numbers = (motion.position, motion.velocity, motion.torque)
    if not all(np.isfinite(values).all() for values in numbers):
        raise InvalidArgument(f"{where}: there are measurements that are no numbers")
    if not motion.moved.any():
        raise InvalidArgument(
            f"{where}: nothing moves; 'trifinger identify NAME' moves the robot and records it"
        )
    saturated = np.mean(np.abs(motion.torque) > 0.98 * motion.limits["max_torque"], axis=0)
    worst = int(np.argmax(saturated))
    if saturated[worst] > MOST_SATURATED:
        raise InvalidArgument(
            f"{where}: joint '{motion.joints[worst]}' gets its largest torque in "
            f"{100 * saturated[worst]:.0f} % of the steps; use a log with slower motion"
        )
