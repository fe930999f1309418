# SPDX-License-Identifier: BSD-3-Clause
"""Plays a motion on a robot, from any pose."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import signal
import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from trifinger.errors import InvalidArgument

from trifinger_view.motion.facts import JointFacts
from trifinger_view.motion.limits import Samples, violations
from trifinger_view.motion.trajectories import Trajectory, find_trajectory

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from trifinger._trifinger import Action, Frontend

    from trifinger_view.motion.motion import Motion

SETTLING = 0.1  # [s]
AT_REST = 0.1  # [rad/s]
STANDS = 1e-3  # [rad/s]; a motion that ends slower than this has ended at rest
AHEAD = 0.5  # [s]
QUEUE = 4096  # actions that a session takes before an append waits
CHUNK = 50  # actions


@dataclasses.dataclass(frozen=True)
class Part:
    """A part of a plan: a row for each step, a column for each joint."""

    positions: NDArray[np.float64]
    """Desired positions [rad]."""
    velocities: NDArray[np.float64]
    """Their velocities [rad/s]."""
    torques: NDArray[np.float64] | None
    """Torques of the motors that this needs in free space [Nm]; None if nobody knows them."""

    @staticmethod
    def of(facts: JointFacts, samples: Samples) -> Part:
        """The part with these samples, one for each step."""
        torques = facts.torques(samples.positions, samples.velocities, samples.accelerations)
        return Part(samples.positions, samples.velocities, torques)

    def __len__(self) -> int:
        return len(self.positions)


@dataclasses.dataclass(frozen=True)
class Plan:
    """What a robot is going to be asked for."""

    parts: tuple[Part, ...]
    """The trajectory to the start, the motion, and, alternating, trajectories back and repetitions;
    the stop.
    """
    period: float
    """Length of a step [s]."""

    @property
    def approach_time(self) -> float:
        """Length of the trajectory to the start of the motion [s]."""
        return len(self.parts[0]) * self.period

    @property
    def duration(self) -> float:
        """Length of all of it [s]."""
        return sum(map(len, self.parts)) * self.period


def plan(
    motion: Motion,
    facts: JointFacts,
    start: NDArray[np.float64],
    period: float,
    *,
    start_velocity: NDArray[np.float64] | None = None,
    times: int = 1,
    speed: float = 1.0,
) -> Plan:
    """Plans the trajectory from the pose `start` [rad] to the motion, the motion, and a stop.

    `period` is the length of a step of the robot [s]. The motion is done `times` times, with a
    trajectory back to its start in between. On these no joint is faster than `speed` [rad/s], and
    they hold all limits. Raises InvalidArgument if the motion is for another robot, violates a
    limit, or if there is no trajectory to it.
    """
    motion.require_robot(facts.robot, facts.joints, "this robot")
    if times < 1:
        raise InvalidArgument(f"times is {times}; allowed are 1 and more")
    if not speed > 0:
        raise InvalidArgument(f"speed is {speed:g} rad/s; allowed are numbers above 0")
    # A whole number of steps: less than one step is added.
    steps = max(2, math.ceil(motion.duration / period * (1 - 1e-9)))
    at_rate = motion.slow(max(1.0, steps * period / motion.duration)).resample(period)
    for one in (motion, at_rate):
        if found := violations(facts, Samples.of(one)):
            more = f" ({len(found) - 1} more)" if len(found) > 1 else ""
            advice = (
                "trim it"
                if found[0].kind == "position"
                else ("'trifinger motion slow --within-limits' and 'smooth' help")
            )
            raise InvalidArgument(
                f"the motion is beyond the limits of this robot: {found[0]}{more}; {advice}"
            )
    whole = Samples.of(at_rate)
    still = np.zeros(len(facts.joints))
    velocity = still if start_velocity is None else start_velocity

    def part(samples: Samples) -> Part:
        return Part.of(facts, samples)

    first = find_trajectory(facts, start, velocity, whole.positions[0], whole.velocities[0], speed)
    end = (whole.positions[-1], whole.velocities[-1])
    # The trajectory to the motion ends with its first sample.
    middle = part(_after_first(whole))
    parts = [part(_sampled(first, period)), middle]
    if times > 1:
        trajectory = find_trajectory(facts, *end, whole.positions[0], whole.velocities[0], speed)
        back = part(_sampled(trajectory, period))
        parts += [back, middle] * (times - 1)
    if np.abs(end[1]).max() > STANDS:
        parts.append(part(_sampled(find_trajectory(facts, *end, None, still), period)))
    parts.append(part(_resting(parts[-1].positions[-1], period)))
    return Plan(tuple(parts), period)


def play(
    robot: Frontend,
    motion: Motion,
    *,
    times: int = 1,
    speed: float = 1.0,
    feedforward: bool = True,
    facts: JointFacts | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    on_plan: Callable[[Plan], None] = lambda _: None,
) -> int:
    """Leads the robot from its pose to the start of the motion, plays it, and brings it to rest.

    The robot must be controlled by this front-end. Everything is checked before the first action:
    a motion that is refused leaves the robot as it is. `times`, `speed` and what is refused are
    those of `plan`. With `feedforward` the actions have the torques that the motion needs in free
    space, if somebody knows them, and the gains only correct; without, the gains do all.
    Limits are those of `facts`, by default of the robot's session.

    Returns the step of the last action, at most half a second before it is applied. The last
    actions hold the robot at rest, so that you can go on from there, or finish(). In real time the
    actions are half a second ahead of the robot.

    Ctrl-C, or `should_stop()`, which is asked after every 50 steps, stops the motion: the robot
    brakes within its limits and holds; after Ctrl-C KeyboardInterrupt follows. `on_plan` gets the
    plan before the first action. Raises RobotStopped if the session ends.
    """
    known = facts or JointFacts.of_session(robot)
    for dtype in (robot.action_dtype, robot.observation_dtype):
        names = dtype.names or ()
        if "position" not in names or dtype["position"].shape != (len(known.joints),):
            raise InvalidArgument(
                f"a robot of type '{robot.session_info().type}' has no position for each of its "
                f"{len(known.joints)} joints, so it cannot play motions"
            )
    start, velocity = _state_of(robot)
    period = robot.session_info().period
    whole = plan(motion, known, start, period, start_velocity=velocity, times=times, speed=speed)
    on_plan(whole)
    ahead = min(max(CHUNK, round(AHEAD / period)), QUEUE // 2)
    position, velocity, last = start, np.zeros_like(start), -1
    with _interrupts() as interrupted:
        for chunk in _chunks(whole):
            if interrupted() or should_stop():
                for part in _brake(known, position, velocity, period):
                    last = robot.append_desired_actions(_actions(robot, known, part, feedforward))
                break
            last = robot.append_desired_actions(_actions(robot, known, chunk, feedforward))
            position, velocity = chunk.positions[-1], chunk.velocities[-1]
            if last >= ahead:
                robot.wait_until_time_index(last - ahead)
        was_interrupted = interrupted()
    if was_interrupted:
        raise KeyboardInterrupt
    return last


def _chunks(whole: Plan) -> Iterator[Part]:
    for part in whole.parts:
        for row in range(0, len(part), CHUNK):
            rows = slice(row, row + CHUNK)
            torques = None if part.torques is None else part.torques[rows]
            yield Part(part.positions[rows], part.velocities[rows], torques)


def _state_of(robot: Frontend) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    # Where the robot was asked to be, or where it is if nobody has said that.
    y = robot.latest_observation()
    position = np.array(y.position)
    _, steps = robot.range("desired_action")
    if steps > 0:
        asked = np.array(robot.get_desired_action(steps - 1)["position"])
        position = np.where(np.isfinite(asked), asked, position)
    names = robot.observation_dtype.names or ()
    velocity = np.array(y["velocity"]) if "velocity" in names else np.zeros_like(position)
    return position, np.where(np.abs(velocity) > AT_REST, velocity, 0.0)


def _actions(robot: Frontend, facts: JointFacts, part: Part, feedforward: bool) -> NDArray[Action]:
    actions = np.repeat(np.array([robot.new_action()], robot.action_dtype), len(part))
    actions["position"] = part.positions
    if feedforward and part.torques is not None and "torque" in (robot.action_dtype.names or ()):
        # Both dampings act on the velocity; they must not hold the motion back.
        actions["torque"] = part.torques + (facts.safety_kd + facts.default_kd) * part.velocities
    return actions


def _brake(
    facts: JointFacts,
    position: NDArray[np.float64],
    velocity: NDArray[np.float64],
    period: float,
) -> Iterator[Part]:
    # From the last action that was appended.
    still = np.zeros_like(velocity)
    try:
        trajectory = find_trajectory(facts, position, velocity, None, still)
    except InvalidArgument:  # near a limit, where the robot's own checks brake harder
        trajectory = Trajectory(position, velocity, position + velocity * 0.05, still, 0.1)
    stop = _sampled(trajectory, period)
    yield Part.of(facts, stop)
    yield Part.of(facts, _resting(stop.positions[-1], period))


@contextlib.contextmanager
def _interrupts() -> Iterator[Callable[[], bool]]:
    # While actions are appended, an exception could come when nobody knows which ones are in the
    # queue. So Ctrl-C sets a flag; a second Ctrl-C interrupts at once.
    seen = threading.Event()

    def note(_number: int, _frame: object) -> None:
        if seen.is_set():
            raise KeyboardInterrupt
        seen.set()

    ours = (
        threading.current_thread() is threading.main_thread()
        and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )
    if not ours:
        yield seen.is_set
        return
    signal.signal(signal.SIGINT, note)
    try:
        yield seen.is_set
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _sampled(trajectory: Trajectory, period: float) -> Samples:
    # The states at the ends of all steps; a whole number of steps, so the trajectory is a little
    # longer.
    steps = max(1, math.ceil(trajectory.duration / period))
    longer = dataclasses.replace(trajectory, duration=steps * period)
    return longer.at(np.linspace(period, steps * period, steps))


def _after_first(samples: Samples) -> Samples:
    return Samples(
        samples.times[1:],
        samples.positions[1:],
        samples.velocities[1:],
        samples.accelerations[1:],
    )


def _resting(position: NDArray[np.float64], period: float) -> Samples:
    steps = max(1, round(SETTLING / period))
    positions = np.repeat(position[None], steps, axis=0)
    nothing = np.zeros_like(positions)
    return Samples(np.linspace(period, steps * period, steps), positions, nothing, nothing)
