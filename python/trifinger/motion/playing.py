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
from trifinger.motion.facts import JointFacts
from trifinger.motion.limits import Samples, violations
from trifinger.motion.ways import Way, find_way

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from trifinger._trifinger import Action, Frontend
    from trifinger.motion.motion import Motion

SETTLING = 0.1  # [s]
AT_REST = 0.1  # [rad/s]
STANDS = 1e-3  # [rad/s]; a motion that ends slower than this has ended at rest
AHEAD = 0.5  # [s]
QUEUE = 4096  # actions that a session takes before an append waits
CHUNK = 50  # actions


@dataclasses.dataclass(frozen=True)
class Plan:
    """What a robot is going to be asked for: a row for each step, a column for each joint."""

    positions: NDArray[np.float64]
    """Desired positions [rad]."""
    velocities: NDArray[np.float64]
    """Their velocities [rad/s]."""
    torques: NDArray[np.float64] | None
    """Torques of the motors that this needs in free space [Nm]; None if nobody knows them."""
    begin: int
    """The row at which the motion begins, after the way to its start."""
    period: float
    """Length of a step [s]."""

    @property
    def duration(self) -> float:
        """Length of all of it [s]."""
        return len(self.positions) * self.period


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
    """Plans the way from the pose `start` [rad] to the motion, the motion, and a stop.

    `period` is the length of a step of the robot [s]. The motion is done `times` times, with a way
    back to its start in between. On these ways no joint is faster than `speed` [rad/s], and they
    hold all limits. Raises InvalidArgument if the motion is for another robot, violates a limit, or
    if there is no way to it.
    """
    motion.require_robot(facts.robot, facts.joints, "this robot")
    if times < 1:
        raise InvalidArgument(f"times is {times}; allowed are 1 and more")
    if not speed > 0:
        raise InvalidArgument(f"speed is {speed:g} rad/s; allowed are numbers above 0")
    # A whole number of steps: less than one step is added.
    steps = max(2, math.ceil(motion.duration / period * (1 - 1e-9)))
    at_rate = motion.slow(max(1.0, steps * period / motion.duration)).resample(period)
    for part in (motion, at_rate):
        if found := violations(facts, Samples.of(part)):
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
    first = _sampled(
        find_way(facts, start, velocity, whole.positions[0], whole.velocities[0], speed), period
    )
    end = (whole.positions[-1], whole.velocities[-1])
    parts = [first, _after_first(whole)]
    if times > 1:
        back = _sampled(
            find_way(facts, *end, whole.positions[0], whole.velocities[0], speed), period
        )
        parts += [back, _after_first(whole)] * (times - 1)
    if np.abs(end[1]).max() > STANDS:
        parts.append(_sampled(find_way(facts, *end, None, still), period))
    rest = parts[-1].positions[-1]
    parts.append(_resting(rest, max(1, round(SETTLING / period))))
    positions = np.vstack([part.positions for part in parts])
    velocities = np.vstack([part.velocities for part in parts])
    accelerations = np.vstack([part.accelerations for part in parts])
    torques = facts.torques(positions, velocities, accelerations)
    return Plan(positions, velocities, torques, len(first.positions), period)


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
    actions = _actions(robot, known, whole, feedforward)
    ahead = min(max(CHUNK, round(AHEAD / period)), QUEUE // 2)
    with _interrupts() as interrupted:
        done, last = 0, -1
        while done < len(actions):
            if interrupted() or should_stop():
                last = _brake(robot, known, whole, done, feedforward)
                break
            part = actions[done : done + CHUNK]
            last = robot.append_desired_actions(part)
            done += len(part)
            if last - ahead >= 0 and done < len(actions):
                robot.wait_until_time_index(last - ahead)
        was_interrupted = interrupted()
    if was_interrupted:
        raise KeyboardInterrupt
    return last


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


def _actions(robot: Frontend, facts: JointFacts, whole: Plan, feedforward: bool) -> NDArray[Action]:
    actions = np.repeat(np.array([robot.new_action()], robot.action_dtype), len(whole.positions))
    actions["position"] = whole.positions
    if feedforward and whole.torques is not None and "torque" in (robot.action_dtype.names or ()):
        # Both dampings act on the velocity; they must not hold the motion back.
        actions["torque"] = whole.torques + (facts.safety_kd + facts.default_kd) * whole.velocities
    return actions


def _brake(robot: Frontend, facts: JointFacts, whole: Plan, done: int, feedforward: bool) -> int:
    # From the last action that was appended; before the first one the robot is at rest.
    row = max(done - 1, 0)
    still = np.zeros(len(facts.joints))
    position = whole.positions[row]
    velocity = whole.velocities[row] if done else still
    try:
        way = find_way(facts, position, velocity, None, still)
    except InvalidArgument:  # near a limit, where the robot's own checks brake harder
        way = Way(position, velocity, position + velocity * 0.05, still, 0.1)
    part = _sampled(way, whole.period)
    rest = _resting(part.positions[-1], max(1, round(SETTLING / whole.period)))
    positions = np.vstack([part.positions, rest.positions])
    velocities = np.vstack([part.velocities, rest.velocities])
    torques = facts.torques(
        positions, velocities, np.vstack([part.accelerations, rest.accelerations])
    )
    stop = Plan(positions, velocities, torques, 0, whole.period)
    return robot.append_desired_actions(_actions(robot, facts, stop, feedforward))


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


def _sampled(way: Way, period: float) -> Samples:
    # The states at the ends of all steps; a whole number of steps, so the way is a little longer.
    steps = max(1, math.ceil(way.duration / period))
    longer = dataclasses.replace(way, duration=steps * period)
    return longer.at(np.linspace(period, steps * period, steps))


def _after_first(samples: Samples) -> Samples:
    return Samples(
        samples.times[1:],
        samples.positions[1:],
        samples.velocities[1:],
        samples.accelerations[1:],
    )


def _resting(position: NDArray[np.float64], steps: int) -> Samples:
    positions = np.repeat(position[None], steps, axis=0)
    nothing = np.zeros_like(positions)
    return Samples(np.linspace(0.0, 1.0, steps), positions, nothing, nothing)
