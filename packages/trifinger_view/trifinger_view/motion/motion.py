# SPDX-License-Identifier: BSD-3-Clause
"""A motion and what can be made of it."""

from __future__ import annotations

import dataclasses
import datetime
import math
import os
from typing import TYPE_CHECKING, Self

import numpy as np
from trifinger.errors import InvalidArgument

from trifinger_view.motion import curves, file, symmetry, trajectories
from trifinger_view.motion.facts import JointFacts, is_trifinger
from trifinger_view.motion.limits import Samples, Violation, slowing_factor, violations

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from trifinger._trifinger import LoggedSession


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Motion:
    """A trajectory of the joints of one robot, as samples; between them it is a smooth curve.

    Every change returns a new motion and adds a line to its `history`. Wrong shapes, numbers that
    are not finite and times that do not grow raise InvalidArgument.
    """

    times: NDArray[np.float64]
    """Time of each sample since the first one [s]: shape (n,), n at least 2, growing from 0.

    The constructor subtracts the first time, so that any clock may be given."""
    positions: NDArray[np.float64]
    """Position of each joint [rad], of a slide [m]: shape (n, number of joints)."""
    joints: tuple[str, ...]
    """Names of the joints, in the order of the robot's actions."""
    robot: str
    """The robot that the motion is for, such as "trifinger-edu": see `JointFacts.robot`."""
    tips: NDArray[np.float64] | None = None
    """Position of each tip as it was measured [m]: shape (n, number of tips, 3), world frame."""
    configuration: str = ""
    """The text of the robot's configuration, with its limits; empty if nobody knows it."""
    history: tuple[str, ...] = ()
    """How the motion came about: a line for its origin and one for each change."""
    created: str = ""
    """When the motion was recorded: date and time (ISO 8601); the constructor sets the present."""

    def __post_init__(self) -> None:
        times = _array(self.times, "times")
        positions = _array(self.positions, "positions")
        if times.ndim != 1 or len(times) < 2:
            raise InvalidArgument(f"times have the shape {times.shape}; expected is (n,), n >= 2")
        if len(times) > file.MAX_ROWS:
            raise InvalidArgument(f"there are {len(times)} samples; allowed are {file.MAX_ROWS}")
        joints = tuple(self.joints)
        file.check_names(self.robot, joints)
        if positions.shape != (len(times), len(joints)):
            raise InvalidArgument(
                f"positions have the shape {positions.shape}; expected is "
                f"{(len(times), len(joints))}: a row for each time, a column for each joint"
            )
        times = times - times[0]
        if not np.all(np.diff(times) > 0):
            row = int(np.argmin(np.diff(times) > 0)) + 1
            raise InvalidArgument(f"times[{row}] is not later than the time before it")
        if self.tips is not None:
            tips = _array(self.tips, "tips")
            if tips.shape[:1] + tips.shape[2:] != (len(times), 3) or not (
                1 <= tips.shape[1] <= file.MAX_TIPS
            ):
                raise InvalidArgument(
                    f"tips have the shape {tips.shape}; expected is ({len(times)}, number, 3)"
                )
            object.__setattr__(self, "tips", _frozen(tips))
        object.__setattr__(self, "times", _frozen(times))
        object.__setattr__(self, "positions", _frozen(positions))
        object.__setattr__(self, "joints", joints)
        object.__setattr__(self, "history", tuple(map(_line, self.history)))
        if not self.created:
            now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
            object.__setattr__(self, "created", now)

    def __repr__(self) -> str:
        return (
            f"<Motion of {len(self.joints)} joints of {self.robot}: "
            f"{self.duration:.3f} s, {len(self)} samples>"
        )

    def __len__(self) -> int:
        return len(self.times)

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.times[-1])

    @property
    def velocities(self) -> NDArray[np.float64]:
        """Velocity of each joint at each sample [rad/s], from differences: like `positions`."""
        return curves.slopes(self.times, self.positions)

    @property
    def accelerations(self) -> NDArray[np.float64]:
        """Acceleration of each joint at each sample [rad/s^2]: like `positions`."""
        return curves.slopes(self.times, self.velocities)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Motion:
        """Reads a file that `save` wrote.

        Raises MotionFileError, which says what is wrong with the file, and OSError.
        """
        return cls(**file.read(path)._asdict())

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Writes the file in one step: nobody ever sees half of it.

        Raises InvalidArgument if the file exists and not `overwrite`, and OSError.
        """
        fields = {name: getattr(self, name) for name in file.Contents._fields}
        file.write(path, file.Contents(**fields), overwrite)

    @classmethod
    def from_log(
        cls,
        session: LoggedSession,
        begin: float | None = None,
        end: float | None = None,
        *,
        series: str = "observation",
    ) -> Motion:
        """What the robot did in a session of a log, from `begin` to `end` [s].

        Times count from the first step in the log. The series "observation" has the measured
        positions, "desired_action" those that were asked for. Raises InvalidArgument for a robot
        without joint positions, and where steps are missing.
        """
        if series not in ("observation", "desired_action"):
            raise InvalidArgument(
                f"series is '{series}'; allowed are 'observation' and 'desired_action'"
            )
        facts = JointFacts.of_session(session)
        first, last = (
            session.range(series)
            if begin is None and end is None
            else session.between(begin or 0.0, 1e9 if end is None else end)
        )
        fields = {series: ("position",)}
        steps = session.read(first, last, fields)
        elements = steps.observations if series == "observation" else steps.desired_actions
        if len(steps) < 2 or elements is None:
            raise InvalidArgument(f"{len(steps)} steps are no motion; the log has too few there")
        missing = np.flatnonzero(np.diff(steps.time_index) != 1)
        if len(missing) > 0:
            raise InvalidArgument(
                f"steps are missing in the log after step {steps.time_index[missing[0]]}; "
                "take the part before or after them: 'trifinger log info' lists all gaps"
            )
        positions = np.array(elements["position"])
        if np.isnan(positions).any():
            row = int(np.argmax(np.isnan(positions).any(axis=1)))
            raise InvalidArgument(
                f"the action of step {steps.time_index[row]} has no position for every joint; "
                "take the series 'observation'"
            )
        when = datetime.datetime.fromtimestamp(session.created, datetime.UTC)
        return cls(
            np.linspace(0.0, (len(positions) - 1) * session.period, len(positions)),
            positions,
            facts.joints,
            facts.robot,
            configuration=facts.configuration,
            history=(
                f"{series} of '{session.name}', session {session.session_id}, steps "
                f"{steps.time_index[0]} to {steps.time_index[-1]}",
            ),
            created=when.isoformat(timespec="seconds"),
        )

    def facts(self) -> JointFacts:
        """Joints and limits of the robot that the motion is for, from `configuration`.

        Raises InvalidArgument if the motion has none, or that of another robot.
        """
        if not self.configuration:
            raise InvalidArgument(
                "the motion does not have the configuration of its robot; "
                "say which it is: facts=JointFacts.load(NAME), --config NAME"
            )
        facts = JointFacts.of_configuration(self.configuration, self.robot, self.joints)
        self.require_robot(facts.robot, facts.joints, "the robot of its configuration")
        return facts

    def violations(self, facts: JointFacts | None = None) -> list[Violation]:
        """Where the motion is farthest beyond each limit of its robot; empty if all limits hold.

        Limits are those of `facts`, by default of the configuration in the motion.
        """
        return violations(self._known(facts), Samples.of(self))

    def at(self, times: ArrayLike) -> NDArray[np.float64]:
        """Positions at any times [s]: shape (number of times, number of joints).

        Between samples the curve is a cubic Hermite spline, so position and velocity are
        continuous. Before the first and after the last sample the robot is there at rest.
        """
        return curves.hermite(self.times, self.positions, np.asarray(times, np.float64))

    def trim(self, begin: float | None = None, end: float | None = None) -> Motion:
        """The part from time `begin` to time `end` [s]; by default from the start, to the end."""
        first = 0.0 if begin is None else float(begin)
        last = self.duration if end is None else float(end)
        if not 0 <= first < last <= self.duration:
            raise InvalidArgument(
                f"cannot trim to {first:g} s to {last:g} s: the motion goes from 0 s to "
                f"{self.duration:g} s, and a part needs a length"
            )
        # A sample right beside an end would give a slope of rounding errors.
        space = 0.01 * min(float(np.median(np.diff(self.times))), last - first)
        inside = self.times[(self.times > first + space) & (self.times < last - space)]
        times = np.concatenate([[first], inside, [last]])
        return self._sampled(times, f"trimmed to {first:g} s to {last:g} s")

    def resample(self, period: float) -> Motion:
        """The same curve with a sample every `period` [s], and one at its end."""
        _require_positive("period", period, "s")
        count = math.ceil(self.duration / period * (1 - 1e-12))
        if count >= file.MAX_ROWS:
            raise InvalidArgument(f"a period of {period:g} s gives more than {file.MAX_ROWS} rows")
        times = np.append(np.arange(count) * period, self.duration)
        return self._sampled(times, f"sampled every {period:g} s")

    def smooth(self, cutoff: float) -> Motion:
        """Without vibrations above about `cutoff` [Hz], and without a delay.

        A Gaussian low-pass filter passes 0.71 of a vibration at `cutoff`, and 0.25 at twice of it.
        The first and the last position stay. The samples have equal distances afterwards.
        """
        _require_positive("cutoff", cutoff, "Hz")
        count = len(self)
        times = np.linspace(0.0, self.duration, count)
        period = self.duration / (count - 1)
        even = self._sampled(times, f"smoothed below {cutoff:g} Hz")
        tips = even.tips
        if tips is not None:
            flat = curves.low_pass(tips.reshape(count, -1), period, cutoff)
            tips = flat.reshape(tips.shape)
        return dataclasses.replace(
            even, positions=curves.low_pass(even.positions, period, cutoff), tips=tips
        )

    def slow(self, factor: float) -> Motion:
        """The same way in `factor` times the time; a factor below 1 makes it faster."""
        _require_positive("factor", factor, "")
        return self._changed(f"slowed by {factor:.6g}", times=self.times * factor)

    def slow_within_limits(self, facts: JointFacts | None = None) -> Motion:
        """The same way as fast as it was, or just as slow as the limits ask for.

        Limits are those of `facts`, by default of the configuration in the motion. Raises
        InvalidArgument if the motion cannot hold them at any speed.
        """
        factor = slowing_factor(self._known(facts), self)
        return self if factor == 1 else self.slow(factor)

    def turn(self, fingers: int = 1) -> Motion:
        """Each finger does what another one did: finger i + `fingers` takes the part of finger i.

        The fingers stand 120 degrees apart, so the tips move as before, turned about the vertical
        by 120 degrees clockwise for each finger, as seen from above.
        """
        if len(self.joints) != 9 or not is_trifinger(self.robot):
            raise InvalidArgument(
                f"a motion of three fingers of a TriFinger can be turned; this one is of "
                f"{len(self.joints)} joints of '{self.robot}'"
            )
        tips = self.tips
        if tips is not None:
            angle = -2 * np.pi / 3 * fingers
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            tips = np.roll(tips, fingers, axis=1)
            tips[..., :2] = tips[..., :2] @ turn.T
        return self._changed(
            f"turned by {fingers} finger{'s' * (fingers != 1)}",
            positions=symmetry.turned(self.positions, fingers),
            tips=tips,
        )

    def mirror(self, finger: int = 0, facts: JointFacts | None = None) -> Motion:
        """Left and right exchanged: tips move as in a mirror that stands along one finger.

        The mirror is the vertical plane through `finger`, which keeps its part; two other fingers
        exchange theirs. Raises InvalidArgument where a finger cannot reach the mirror image.
        """
        kinematics = self._known(facts).kinematics
        if kinematics is None or kinematics.num_joints != len(self.joints):
            raise InvalidArgument("only motions of TriFingers and their fingers can be mirrored")
        mirror = symmetry.Mirror.of(kinematics, finger)
        tips = None if self.tips is None else mirror(self.tips[:, list(mirror.partner)])
        return self._changed(
            f"mirrored at finger {finger}",
            positions=symmetry.mirrored(kinematics, self.times, self.positions, mirror),
            tips=tips,
        )

    def join(
        self, other: Motion, blend: float | None = None, facts: JointFacts | None = None
    ) -> Motion:
        """This motion, then a trajectory of `blend` [s] to the start of `other`, then `other`.

        Position and velocity have no jump. Without `blend` the trajectory is the shortest within
        the limits of `facts`, by default of the configuration in the motion. Measured tips are left
        out. Raises InvalidArgument for a motion of another robot, and if there is no such
        trajectory.
        """
        self.require_robot(other.robot, other.joints, "the robot of the other motion")
        ends = (self.positions[-1], self.velocities[-1], other.positions[0], other.velocities[0])
        if blend is None:
            trajectory = trajectories.find_trajectory(self._known(facts), *ends)
        else:
            _require_positive("blend", blend, "s")
            trajectory = trajectories.Trajectory(*ends, blend)
        count = max(2, math.ceil(trajectory.duration / float(np.median(np.diff(self.times)))))
        between = trajectory.at(np.linspace(0.0, trajectory.duration, count + 1)[1:-1])
        gap = self.duration + trajectory.duration
        return self._changed(
            f"joined, by a trajectory of {trajectory.duration:.3f} s, with: "
            + "; ".join(other.history),
            times=np.concatenate([self.times, self.duration + between.times, gap + other.times]),
            positions=np.vstack([self.positions, between.positions, other.positions]),
            tips=None,
        )

    def require_robot(self, robot: str, joints: tuple[str, ...], what: str) -> None:
        """Raises InvalidArgument unless the motion is for this robot; `what` says whose it is."""
        if robot != self.robot:
            raise InvalidArgument(
                f"the motion is for the robot '{self.robot}'; {what} is '{robot}'"
            )
        if joints != self.joints:
            other = [name for name in joints if name not in self.joints] or list(joints)
            raise InvalidArgument(
                f"the motion is for the joints {', '.join(self.joints)}; "
                f"{what} has others or another order: {', '.join(other)}"
            )

    def _known(self, facts: JointFacts | None) -> JointFacts:
        if facts is None:
            return self.facts()
        self.require_robot(facts.robot, facts.joints, "the robot of these limits")
        return facts

    def _sampled(self, times: NDArray[np.float64], change: str) -> Motion:
        tips = self.tips
        if tips is not None:
            flat = curves.hermite(self.times, tips.reshape(len(self), -1), times)
            tips = flat.reshape(len(times), *tips.shape[1:])
        return self._changed(change, times=times, positions=self.at(times), tips=tips)

    def _changed(self, change: str, **values: object) -> Self:
        changed: Self = dataclasses.replace(
            self,
            history=(*self.history, change),
            **values,  # type: ignore[arg-type]
        )
        return changed


def _array(values: ArrayLike, name: str) -> NDArray[np.float64]:
    try:
        array = np.array(values, np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(f"{name} are no array of numbers: {error}") from None
    if not np.isfinite(array).all():
        raise InvalidArgument(f"{name} have a number that is not finite")
    return array


def _frozen(array: NDArray[np.float64]) -> NDArray[np.float64]:
    array.flags.writeable = False
    return array


def _line(text: str) -> str:
    return " ".join(text.split())


def _require_positive(name: str, value: float, unit: str) -> None:
    if not (math.isfinite(value) and value > 0):
        raise InvalidArgument(f"{name} is {value:g} {unit}; allowed are numbers above 0".strip())
