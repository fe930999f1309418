# SPDX-License-Identifier: BSD-3-Clause
"""Solves the tasks of the Real Robot Challenge with the parts of `trifinger.control`.

A program like the challenge's own evaluate_policy.py, for `./run evaluate challenge`:

    python challenge_policy.py LEVEL INITIAL_POSE GOAL LOG
    python challenge_policy.py TRAJECTORY LOG

Three tips grasp the object where it lies, carry it to its goal and hold it there. If another face
must be up, the object is put down so tilted that it falls over. It is turned in several grasps.
What cannot be grasped is drawn towards the middle by one tip.
"""

import itertools
import sys
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from challenge_task import Task
from solvers import Array, on_table, rotated, rotation, turned
from trifinger import Kinematics, control
from trifinger.control import GraspPhase, Motion, Pose, PoseTrajectory

CONFIG = "trifinger_pro"
PERIOD = 1e-3  # [s]
MEMORY = 1000  # age at which a pose says nothing any more [steps]

SPEED, TURN_SPEED, SHORTEST = 0.15, 1.2, 0.3  # mean speeds of the object [m/s], [rad/s]; [s]
SLOWER = 0.6  # by which speeds are multiplied after each loss
STANDING = 0.01  # height above its goal at which an object must fall over first [m]
CLEARANCE = 0.004  # height above the table on the way to a low goal [m]
SHARES = np.linspace(0.0, 1.0, 7)  # points of a trajectory that the planner checks
TURNS = (0.0, 0.3, -0.3, 0.6, -0.6, 0.9, -0.9)  # in one grasp [rad]
TURN_COST = 0.1  # of 1 rad, in shares of the motors' torque

STILL = 2e-4  # distance of two poses in a row of an object that rests [m]
SETTLE = 50  # steps after which a pose says where a released object is
# Share of the object's error at the end of a way that changes what is desired, and how often.
CORRECTION, CORRECTION_STEPS = 0.03, 10
NEAR_PLACE, NEAR_ANGLE = 4e-3, 0.08  # errors with which the object is released [m], [rad]
LONGEST_CORRECTION = 1.0  # before it is released [s]
RETRY = 5.0  # time until another plan is made if there was none [s]

HOLDING = control.GraspControllerConfig(
    friction=0.42, friction_sides=8, slip_friction=0.47, approach_speed=0.5, closing_speed=0.1,
    closing_time=1.0, engage_time=0.2,
)  # fmt: skip


class Stop(NamedTuple):
    """A pose on the way of the object, in the middle of whose approach is `time` or later [s]."""

    time: float
    pose: Pose


class Leg(NamedTuple):
    """A way of the object in one grasp."""

    touches: Sequence[control.Touch]
    start: Pose
    stops: Sequence[Stop]
    is_released: bool
    """At the last stop, or else held there to the end."""


# The next leg of an object that rests at a pose, at a time [s].
NextLeg = Callable[[Pose, float], Leg | None]


def trajectory(start: Pose, end: Pose, slower: float = 1.0) -> PoseTrajectory:
    """Returns a way from rest to rest."""
    length = float(np.linalg.norm(end.position - start.position))
    angle = float(np.linalg.norm(control.rotation_error(end.orientation, start.orientation)))
    duration = max(length / SPEED / slower, angle / TURN_SPEED / slower, SHORTEST)
    return PoseTrajectory(start, end, duration)


def moved_to(pose: Pose, position: Iterable[float]) -> Pose:
    """Returns the pose at another place."""
    return Pose(tuple(position), pose.orientation)


def face_up(pose: Pose) -> tuple[int, float]:
    """Returns the axis of the body that is most upright, and its sign."""
    row = rotation(pose)[2]
    axis = int(np.argmax(np.abs(row)))
    return axis, float(np.sign(row[axis]))


def long_axis(size: Sequence[float]) -> int | None:
    """Returns the axis of the body along which it is much longer than along the others."""
    axis = int(np.argmax(size))
    return axis if size[axis] > 2 * sorted(size)[1] else None


def to_lying(pose: Pose, axis: int) -> Array:
    """Returns the turn after which an axis of the body is horizontal."""
    along = rotation(pose)[:, axis]
    # An axis that is upright falls towards any side.
    level = along * (1.0, 1.0, 0.0) + 1e-9 * rotation(pose)[:, axis - 1]
    vector = np.cross(along, level)
    angle = np.arcsin(min(abs(along[2]), 1.0))
    turn: Array = vector * (angle / max(float(np.linalg.norm(vector)), 1e-12))
    return turn


def yaw(end: Pose, start: Pose) -> float:
    """Returns the turn about the vertical between two poses [rad]."""
    return float(control.rotation_error(end.orientation, start.orientation)[2])


def candidates(task: Task) -> tuple[Sequence[control.GraspPlannerConfig], ...]:
    """Returns the grasps that are tried to carry it, the best first, and those for a fall.

    Offsets leave out the ends of a long box at first: two tips on one long face and one on the
    opposite face hold it better. An object that falls over is held below its centre, which then
    helps. Tips have a friction of 0.5 in the challenge's tasks.
    """
    if long_axis(task.size) is not None:
        sides, ends = [0.012, 0.024, 0.034], [0.0, 0.012]
        return (_slender(sides), _slender(ends)), (_slender([0.0, *sides], 0.43, 1.0),), ()
    offsets = [0.0, 0.009, 0.018, 0.026]
    near = control.GraspPlannerConfig(
        heights=[0.02, 0.01, 0.0, -0.01, -0.02], friction=0.4, friction_sides=8, largest_torque=0.9
    )
    far = control.GraspPlannerConfig(
        heights=[0.03, 0.025, 0.02, 0.01, 0.0, -0.01, -0.02],
        offsets=offsets,
        friction=0.43,
        friction_sides=8,
        limit_margin=0.005,
        clearance=1e-5,
    )
    falling = control.GraspPlannerConfig(
        heights=[-0.01, -0.015, -0.02], offsets=offsets, friction=0.4, friction_sides=8
    )
    return (near, far), (), (falling,)


def _slender(
    offsets: Sequence[float], friction: float = 0.3, largest_torque: float = 0.9
) -> control.GraspPlannerConfig:
    """Returns grasps of a box with short edges. Tips touch it between them."""
    return control.GraspPlannerConfig(
        heights=[0.02, 0.005, 0.002, -0.02],
        offsets=offsets,
        friction=friction,
        friction_sides=8,
        limit_margin=0.005,
        clearance=1e-5,
        largest_torque=largest_torque,
        shared_faces=True,
    )


class Planner:
    """Finds grasps for ways of a box."""

    def __init__(self, task: Task) -> None:
        self.size = task.size
        scene: dict[str, object] = {
            "objects": [{"name": "box", "type": "cuboid", "size": task.size, "mass": task.mass}]
        }
        self.strong, self.weak, self.falling = (
            [control.GraspPlanner(CONFIG, scene, "box", settings) for settings in some]
            for some in candidates(task)
        )

    def plan(
        self,
        rest: Pose,
        ways: Iterable[tuple[float, Sequence[Stop]]],
        *,
        is_released: bool,
        planners: Sequence[control.GraspPlanner] | None = None,
    ) -> Leg | None:
        """Returns the best grasp and its way; each way comes with what it costs beside torque."""
        ways = list(ways)
        for planner in self.strong if planners is None else planners:
            best: tuple[float, Leg] | None = None
            for cost, stops in ways:
                if best is not None and cost >= best[0]:
                    continue
                poses = [rest, *(stop.pose for stop in stops)]
                parts = [trajectory(a, b) for a, b in itertools.pairwise(poses)]
                grasp = planner.plan([p.at(share * p.duration) for p in parts for share in SHARES])
                if grasp is not None and (best is None or cost + grasp.torque_share < best[0]):
                    leg = Leg(grasp.touches, rest, stops, is_released)
                    best = cost + grasp.torque_share, leg
            if best is not None:
                return best[1]
        return None

    def resting(self, pose: Pose) -> Pose:
        """Returns where a box comes to rest that is put down."""
        return on_table(pose, self.size)

    def route(self, start: Pose, goal: Pose, time: float = 0.0) -> list[Stop]:
        """Returns a way on which the box does not touch the table."""
        lowest = self.resting(goal).position[2] + CLEARANCE
        is_level = abs(rotation(goal)[2, face_up(goal)[0]]) > 0.999
        if is_level and goal.position[2] > lowest:
            return [Stop(time, goal)]
        height = max(start.position[2], goal.position[2], lowest)
        up, over = (moved_to(pose, (*pose.position[:2], height)) for pose in (start, goal))
        return [Stop(time, up), Stop(time, over), Stop(time, goal)]

    def put_down(self, rest: Pose, places: Iterable[Array], turns: Iterable[float]) -> Leg | None:
        """Returns a leg to the first place on the table, with the first turn, that is reached."""
        for place in places:
            for turn in turns:
                end = turned(moved_to(rest, (*place, rest.position[2])), turn)
                leg = self.plan(rest, [(0.0, self.route(rest, end))], is_released=True)
                if leg is not None:
                    return leg
        return None


# A position, and the time from which it counts [s].
Goal = tuple[float, Array]


class ToPositions:
    """Brings the object to positions, one after the other, with any orientation.

    If a position cannot be reached, it stays as near as it can be brought.
    """

    NEARER = (1.0, 0.93, 0.86, 0.78, 0.7)  # shares of a goal's distance from the middle
    FAR = 0.12  # distance of a goal that is at the edge of the reach [m]

    def __init__(self, planner: Planner, goals: Sequence[Goal]) -> None:
        self._planner = planner
        self._goals = goals
        self._unreached: set[tuple[object, ...]] = set()
        self._tries: Counter[float] = Counter()  # to reach a goal that counts from a time [s] on

    def next_leg(self, rest: Pose, now: float) -> Leg | None:
        """A leg to as many goals as one grasp reaches."""
        times = [time for time, _ in self._goals[1:]] + [np.inf]
        goals = [goal for goal, end in zip(self._goals, times, strict=True) if now < end]
        if rest.position[2] > goals[0][1][2] + STANDING:
            return None
        time, first = goals[0]
        # What was lost at the edge of the reach is held nearer to the middle the next time.
        losses = self._tries[time] if np.linalg.norm(first[:2]) > self.FAR else 0
        shares = self.NEARER[min(losses, 2) :]
        goals[0] = time, first * (shares[0], shares[0], 1.0)
        for count in range(len(goals), 0, -1):
            leg = self._leg(rest, goals, count)
            if leg is not None:
                self._tries[time] += 1
                return leg
        for nearer, is_weak in itertools.product(shares, (False, True)):
            goals[0] = time, first * (nearer, nearer, 1.0)
            leg = self._leg(rest, goals, 1, is_weak)
            self._tries[time] += leg is not None
            leg = leg or self._regrasp(rest, goals, is_weak)
            if leg is not None:
                return leg
        return self._planner.put_down(rest, [0.6 * rest.position[:2], np.zeros(2)], TURNS)

    def _leg(
        self, rest: Pose, goals: Sequence[Goal], count: int, is_weak: bool = False
    ) -> Leg | None:
        # The end of the last one: it is put down when the next goal needs another grasp.
        ends = list(goals[:count])
        is_last = count == len(goals)
        if not is_last:
            below = (*goals[count - 1][1][:2], rest.position[2])
            ends.append((goals[count][0], np.array(below)))
        planners = self._planner.weak if is_weak else self._planner.strong
        return self._planner.plan(
            rest, self._ways(rest, ends), is_released=not is_last, planners=planners
        )

    def _regrasp(self, rest: Pose, goals: Sequence[Goal], is_weak: bool) -> Leg | None:
        """A leg to where another grasp reaches the first goal."""
        case = (*goals[0][1], is_weak)
        if case in self._unreached:
            return None
        places = list(itertools.product((np.zeros(2), 0.5 * goals[0][1][:2]), TURNS))
        tested = 0
        for place, turn in places:
            leg = self._planner.put_down(rest, [place], [turn])
            if leg is not None:
                tested += 1
                if self._leg(leg.stops[-1].pose, goals, 1, is_weak) is not None:
                    return leg
        if tested == len(places):
            self._unreached.add(case)
        return None

    def _ways(self, rest: Pose, goals: Sequence[Goal]) -> Iterator[tuple[float, list[Stop]]]:
        for turn in TURNS:
            stops: list[Stop] = []
            for time, position in goals:
                # What lies on the table is higher than its goal by what touches from afar.
                low = max(position[2], rest.position[2])
                end = turned(moved_to(rest, (*position[:2], low)), turn)
                stops += self._planner.route(stops[-1].pose if stops else rest, end, time)
            yield TURN_COST * abs(turn), stops


class ToPose:
    """Brings the object to a pose; to the one of least cost that can be reached, if it cannot."""

    TILTS = (1.0, 0.85, 0.7, 0.5, 0.25, 0.0)  # shares of the goal's tilt
    NEARER = (1.0, 0.85, 0.7)  # shares of its distance from the middle
    PLACES = (1.0, 0.5, 0.0)  # where the last grasp may begin, likewise
    FARTHEST = 0.09  # from the middle, where it may begin [m]
    TRIES = 3  # until another pose is tried
    EASIER = 0.03  # by which it then costs more at least
    RESTS = 3  # poses in which the last grasp may begin that are looked for
    LARGEST_TURN = 1.2  # in one grasp [rad]
    STEPS = (0.9, 0.6, 0.3)  # turns of a larger one [rad]
    FALLS = (1.0, 0.9)  # tilts in which the object falls over [rad]
    FALL_TURNS = (0.0, 0.4, -0.4, 0.8, -0.8)  # on the way to it [rad]
    CENTRE = 0.04  # distance from the middle at which it falls over [m]
    RAISED = 0.058  # height of the centre on the way to it [m]
    DROP = 0.003  # height above the table of an edge on which it would stand [m]

    def __init__(self, planner: Planner, goal: Pose, cost: Callable[[Pose], float]) -> None:
        self._planner = planner
        self._long = long_axis(planner.size)
        level = self._level(goal)
        tilt = control.rotation_error(goal.orientation, level.orientation)
        if self._long is not None:
            tilt = -to_lying(goal, self._long)
        ends = [
            moved_to(rotated(level, share * tilt), goal.position * (nearer, nearer, 1.0))
            for share in self.TILTS
            for nearer in self.NEARER
        ]
        self._ends = iter(sorted((cost(end), k, end) for k, end in enumerate(ends)))
        self._least_cost = 0.0
        self._choose_end()

    def _level(self, pose: Pose) -> Pose:
        """Where it would come to rest, on a long face if it has any."""
        if self._long is not None:
            pose = rotated(pose, to_lying(pose, self._long))
        return self._planner.resting(pose)

    def _choose_end(self) -> None:
        """Takes the pose of the least cost of those that are left and can be reached."""
        self._tries = 0
        for cost, _, end in self._ends:
            if cost < self._least_cost:
                continue
            self._end, self._rests = end, self._find_rests(end)
            if self._rests:
                self._least_cost = cost + self.EASIER
                return

    def _find_rests(self, end: Pose) -> list[Pose]:
        """Poses on the table from which a grasp reaches the end."""
        rests: list[Pose] = []
        for place in self.PLACES:
            xy = place * end.position[:2]
            xy *= min(1.0, self.FARTHEST / max(float(np.linalg.norm(xy)), 1e-9))
            for turn in TURNS:
                level = self._level(end)
                rest = turned(moved_to(level, (*xy, level.position[2])), turn)
                if self._hold(rest, end) is not None:
                    rests.append(rest)
                if len(rests) == self.RESTS:
                    return rests
        return rests

    def next_leg(self, rest: Pose, _now: float) -> Leg | None:
        """A leg to the end, or towards it."""
        if self._tries == self.TRIES:  # It was lost there each time.
            self._choose_end()
        if self._long is not None:
            if face_up(rest)[0] == self._long:
                return None
            self._roll(rest, self._long)
        if face_up(rest) != face_up(self._level(self._end)):
            leg = self._fall_over(rest)
        else:
            leg = self._last_leg(rest) or self._turn(rest)
        return leg or self._planner.put_down(rest, [0.4 * rest.position[:2]], TURNS[1:])

    def _roll(self, rest: Pose, axis: int) -> None:
        """Turns the end about the long axis, which costs nothing, until the face up is the same."""
        quarter = np.pi / 2 * np.eye(3)[axis]
        for _ in range(4):
            if face_up(rest) == face_up(self._level(self._end)):
                return
            self._end, *self._rests = (
                rotated(pose, rotation(pose) @ quarter) for pose in (self._end, *self._rests)
            )

    def _last_leg(self, rest: Pose) -> Leg | None:
        if abs(yaw(self._level(self._end), rest)) > self.LARGEST_TURN:
            return None
        leg = self._hold(rest, self._end)
        self._tries += leg is not None
        return leg

    def _hold(self, rest: Pose, end: Pose) -> Leg | None:
        route = self._planner.route(rest, end)
        return self._planner.plan(rest, [(0.0, route)], is_released=False)

    def _turn(self, rest: Pose) -> Leg | None:
        """A leg to where the last grasp begins, or part of the way."""

        def effort(pose: Pose) -> float:
            return 10 * float(np.linalg.norm(pose.position - rest.position)) + abs(yaw(pose, rest))

        for pose in sorted(self._rests, key=effort):
            turn = yaw(pose, rest)
            steps = [step * np.sign(turn) for step in self.STEPS if step < abs(turn)]
            xy, leg = pose.position[:2], None
            if abs(turn) < self.LARGEST_TURN:
                leg = self._planner.put_down(rest, [xy], [turn])
            # Near the middle all fingers reach all faces.
            leg = leg or self._planner.put_down(rest, [0.3 * xy, xy], steps)
            if leg is not None:
                return leg
        return None

    def _fall_over(self, rest: Pose) -> Leg | None:
        """A leg after which the right face is up, or will be after another one."""
        for tilt in self.FALLS:
            falls = self._falls(rest, tilt)
            leg = self._planner.plan(rest, falls, is_released=True, planners=self._planner.falling)
            if leg is not None:
                return leg
        return None

    def _falls(self, rest: Pose, tilt: float) -> Iterator[tuple[float, list[Stop]]]:
        up, (wanted, sign) = face_up(rest)[0], face_up(self._level(self._end))
        distance = max(float(np.linalg.norm(rest.position[:2])), 1e-9)
        xy = rest.position[:2] * min(0.5, self.CENTRE / distance)
        for turn in self.FALL_TURNS:
            over = turned(moved_to(rest, (*xy, self.RAISED)), turn)
            axes = rotation(over)
            for k, side in itertools.product({0, 1, 2} - {up}, (1, -1)):
                axis = side * axes[:, k]
                fallen = face_up(rotated(over, np.pi / 2 * axis))
                if up != wanted and fallen != (wanted, sign):
                    continue
                # On its edge it is as high as half of the diagonal.
                half = float(np.linalg.norm(np.delete(self._planner.size, k))) / 2
                end = moved_to(rotated(over, tilt * axis), (*xy, half + self.DROP))
                yield TURN_COST * abs(turn), [Stop(0.0, over), Stop(0.0, end)]


class Push:
    """Where no grasp reaches an object, one tip goes behind it and drags it to the middle.

    An object that stands on its end falls over. Tips follow points by position control.
    """

    STIFFNESS, DAMPING = 250.0, 3.0  # of a tip [N/m], [Ns/m]
    SPEED = 1.5e-4  # of the tips [m/step]
    RAISED = 0.1  # height of the tips on their way [m]
    RADIUS = 0.01  # of a tip, and a little more [m]
    BESIDE = (0.02, 0.008)  # distance from the face at which the tip comes down [m]
    SHORTEST, LONGEST = 0.03, 0.07  # motion of the object [m]
    BORDER, FARTHEST = 0.05, 0.185  # height and distance at which the border leaves a tip room [m]
    MOVED = 0.01  # distance by which an object has moved that was pushed [m]
    HEIGHT = 0.85  # at which a face is touched that is higher than wide, in shares of its height

    def __init__(self) -> None:
        self._kinematics = Kinematics(CONFIG)
        self._home = self._kinematics.tip_positions([0.0, 0.9, -1.7] * 3)
        self._points: list[Array] = []
        self._rest, self._choice = np.zeros(3), 0

    @property
    def is_active(self) -> bool:
        """True until the tips are above the object again."""
        return bool(self._points)

    def begin(self, rest: Pose, size: Sequence[float], joints: Array) -> None:
        """Chooses a face that looks away from the middle, and a finger that reaches behind it.

        Without such a finger nothing begins.
        """
        axes, up = rotation(rest), face_up(rest)[0]
        height = size[up] * (self.HEIGHT if up == long_axis(size) else 0.5)
        sides = [(side * axes[:, k], k) for k in {0, 1, 2} - {up} for side in (1, -1)]
        sides.sort(key=lambda side: -float(side[0] @ rest.position))
        options = self._options(sides[:2], rest, size, height, self.FARTHEST)
        options = options or self._options(sides, rest, size, height, np.inf)
        # What moved nothing is not tried again at once.
        is_same = np.linalg.norm(rest.position - self._rest) < self.MOVED
        self._choice, self._rest = self._choice + 1 if is_same else 0, rest.position
        if options:
            finger, way = options[self._choice % len(options)]
            self._target = self._kinematics.tip_positions(joints)
            raised = self._target.copy()
            raised[:, 2] = self.RAISED
            self._points = [raised, *(self._home.copy() for _ in way), self._home]
            for points, point in zip(self._points[1:], way, strict=False):
                points[finger] = point

    def _options(
        self,
        sides: Sequence[tuple[Array, int]],
        rest: Pose,
        size: Sequence[float],
        height: float,
        farthest: float,
    ) -> list[tuple[int, list[Array]]]:
        """Fingers that can push some of the faces, and their points."""
        options = []
        up = face_up(rest)[0]
        for (outward, k), shift, beside in itertools.product(sides, (0.35, 0.0), self.BESIDE):
            distance = float(outward @ rest.position)
            touch = rest.position + (size[k] / 2 + self.RADIUS) * outward
            if distance < 0.5 * np.linalg.norm(rest.position[:2]):
                # A push at the outer end turns the face farther outwards.
                other = 3 - k - up
                along = rotation(rest)[:, other]
                touch = touch + shift * size[other] * np.sign(along @ rest.position) * along
            touch[2] = max(height, self.RADIUS + 0.002)
            length = np.clip(distance, self.SHORTEST, self.LONGEST)
            begin, end = touch + beside * outward, touch - length * outward
            if touch[2] < self.BORDER and np.linalg.norm(begin[:2]) > farthest:
                continue
            over, after = (np.array([*point[:2], self.RAISED]) for point in (begin, end))
            way = [over, begin, end, end + 0.01 * outward, after]
            for finger in np.argsort(np.linalg.norm(self._home - begin, axis=1)):
                if all(self._reaches(int(finger), point) for point in way):
                    options.append((int(finger), way))
        return options

    def _reaches(self, finger: int, point: Array) -> bool:
        return self._kinematics.inverse_kinematics(finger, point)[1] == "yes"

    def act(self, robot: Any) -> Array:
        """Returns the torques of the next step."""
        path = self._points[0] - self._target
        length = float(np.linalg.norm(path, axis=1).max())
        self._target = self._target + path * min(1.0, self.SPEED / max(length, 1e-9))
        if length <= self.SPEED:
            self._points.pop(0)
        jacobians = self._kinematics.tip_jacobians(robot.position)
        velocity = jacobians @ robot.velocity
        error = (self._target - self._kinematics.tip_positions(robot.position)).ravel()
        forces = self.STIFFNESS * error - self.DAMPING * velocity
        torque: Array = jacobians.T @ forces
        return torque + self._kinematics.gravity_torques(robot.position)


class Controller:
    """Carries out legs: a grasp, the way, and the release or holding.

    It knows poses of the object that are seldom and late. In between, tips that roll on its faces
    feel how it moves.
    """

    def __init__(self, task: Task, next_leg: NextLeg, start: Pose | None) -> None:
        body = control.rigid_body("box", task.size, mass=task.mass)
        self._task, self._next_leg = task, next_leg
        self._controller = control.GraspController(body, CONFIG, {}, HOLDING)
        self._step, self._seen, self._newest = 0, -1, None
        self._idle_since, self._try_at, self._losses = 0, 0.0, 0
        self._phase = GraspPhase.IDLE
        self._push, self._joints = Push(), np.array([0.0, 0.9, -1.7] * 3)
        self._rest = start
        self._felt, self._memory = Pose(), deque[Pose](maxlen=MEMORY)
        self._desired = Motion(start or Pose())
        self._leg: Leg | None = None
        self._way: list[tuple[float, PoseTrajectory]] = []
        self._begin()

    def act(self, robot: Any, cameras: Any) -> Array:
        """Returns the torques of the next step."""
        now = self._step * PERIOD
        if self._push.is_active:
            self._step += 1
            self._idle_since = self._step
            return self._push.act(robot)
        self._follow_phases(now)
        if cameras is not self._newest:
            self._newest, self._joints = cameras, robot.position
            self._see(cameras)
        self._desired = self._desired_motion(now)
        joints = control.JointState(robot.position, robot.velocity, robot.torque)
        torque = self._controller.update(PERIOD, joints, self._object(), self._desired)
        self._felt = control.moved(self._felt, self._controller.state.felt, PERIOD)
        self._memory.append(self._felt)
        self._step += 1
        return torque

    def _begin(self) -> None:
        self._way, self._phase = [], GraspPhase.IDLE
        self._felt, self._memory = Pose(), deque([Pose()], maxlen=MEMORY)
        self._shift, self._turn = np.zeros(3), np.zeros(3)
        now = self._step * PERIOD
        self._leg = None
        if self._rest is None or now < self._try_at:
            return
        self._leg = self._next_leg(self._rest, now)
        if self._leg is None:
            self._push.begin(self._rest, self._task.size, self._joints)
            self._try_at = now if self._push.is_active else now + RETRY
            self._rest = None
            return
        self._known = self._leg.start, self._felt
        self._desired = Motion(self._leg.start)
        self._controller.grasp(self._leg.touches, self._leg.start)

    def _follow_phases(self, now: float) -> None:
        phase = self._controller.state.phase
        if phase is GraspPhase.IDLE and self._phase is not GraspPhase.IDLE:
            self._idle_since, self._rest = self._step, None
        self._phase = phase
        if phase is GraspPhase.LOST:
            self._losses += 1
            self._controller.release()
        elif phase is GraspPhase.HOLD and self._leg is not None:
            if not self._way:
                self._plan_way(self._leg, now)
            elif now > self._end and self._step % CORRECTION_STEPS == 0:
                self._correct(self._leg, now)

    def _plan_way(self, leg: Leg, now: float) -> None:
        previous, self._end = leg.start, now
        for time, pose in leg.stops:
            part = trajectory(previous, pose, SLOWER ** min(self._losses, 3))
            begin = max(self._end, time - part.duration / 2)
            self._way.append((begin, part))
            self._end, previous = begin + part.duration, pose

    def _desired_motion(self, now: float) -> Motion:
        if self._phase is not GraspPhase.HOLD or not self._way:
            return Motion(self._desired.pose)
        while len(self._way) > 1 and now >= self._way[1][0]:
            self._way.pop(0)
        begin, part = self._way[0]
        motion = part.at(now - begin) if now > begin else part.at(0.0)
        pose = moved_to(motion.pose, motion.pose.position + self._shift)
        return Motion(rotated(pose, self._turn), motion.twist, motion.acceleration)

    def _object(self) -> Motion:
        if self._phase is not GraspPhase.HOLD:
            return self._desired
        # Where it was when it was seen, and how the tips have felt it move since.
        pose, felt = self._known
        turn = control.rotation_error(self._felt.orientation, felt.orientation)
        place = pose.position + self._felt.position - felt.position
        return Motion(rotated(moved_to(pose, place), turn), self._controller.state.felt)

    def _see(self, cameras: Any) -> None:
        captured = round(cameras.cameras[0].timestamp / PERIOD)
        age = self._step - captured
        if captured <= self._seen or age >= MEMORY:
            return
        self._seen = captured
        pose = pose_of(cameras.filtered_object_pose)
        if self._phase is GraspPhase.IDLE:
            self._look(pose, captured)
        elif self._phase is GraspPhase.HOLD and age < len(self._memory):
            self._known = pose, self._memory[-1 - age]

    def _look(self, pose: Pose, captured: int) -> None:
        if captured < self._idle_since + SETTLE:
            return
        before, self._rest = self._rest, pose
        if before is not None and np.linalg.norm(pose.position - before.position) < STILL:
            height = pose.position[2]
            level = on_table(pose, self._task.size)
            self._rest = moved_to(level, (*level.position[:2], height))
            self._begin()

    def _correct(self, leg: Leg, now: float) -> None:
        """Moves what is desired until the object is where it should be; then releases it."""
        goal, pose = leg.stops[-1].pose, self._object().pose
        shift = goal.position - pose.position
        turn = control.rotation_error(goal.orientation, pose.orientation)
        self._shift = np.clip(self._shift + CORRECTION * shift, -0.02, 0.02)
        self._turn = np.clip(self._turn + CORRECTION * turn, -0.5, 0.5)
        is_there = np.linalg.norm(shift) < NEAR_PLACE and np.linalg.norm(turn) < NEAR_ANGLE
        if leg.is_released and (is_there or now > self._end + LONGEST_CORRECTION):
            self._controller.release()


def pose_of(pose: Any) -> Pose:
    """Returns a pose of the challenge, whose quaternions are x, y, z, w."""
    x, y, z, w = pose.orientation
    return Pose(pose.position, (w, x, y, z))


def solve(task: Task) -> float:
    """Solves a task; returns the mean cost per step."""
    planner = Planner(task)
    if task.level == 4:
        next_leg: NextLeg = ToPose(planner, pose_of(task.goal), task.cost_of).next_leg
    else:
        next_leg = ToPositions(planner, task.positions).next_leg
    start = pose_of(task.initial_pose)
    is_resting = abs(planner.resting(start).position[2] - start.position[2]) < CLEARANCE
    return task.run(Controller(task, next_leg, start if is_resting else None).act)


if __name__ == "__main__":
    print(solve(Task(sys.argv[1:])))
