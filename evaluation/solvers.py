# SPDX-License-Identifier: BSD-3-Clause
"""Solves the tasks push and lift with the parts of `trifinger.control`.

A `Solver` sees what the environment shows to everybody and answers with torques, like a policy. A
`RoutePlanner` says beforehand whether the fingers can do it. The reachable set is the set of goals
for which it finds a route.
"""

import itertools
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt
from trifinger import Simulation, control
from trifinger.control import GraspPhase, Motion, Pose, PoseTrajectory
from trifinger.environments import Environment, Options

Array = npt.NDArray[np.float64]
Observation = dict[str, npt.NDArray[Any]]

PERIOD = 1e-3  # [s]
CONFIG = "trifinger_edu"
OVERRIDES: dict[str, object] = {"objects": [{"name": "cube", "type": "cube"}]}
SIZE = 0.065  # edge of the cube [m]
CUBE = control.rigid_body("box", [SIZE] * 3, mass=0.094)
MAX_TORQUE = 0.36  # [Nm]
SAFETY_KD = np.tile([0.09, 0.09, 0.05], 3)  # [Nms/rad]

SPEED = 0.06  # mean speed at which the cube is moved [m/s]
TURN_SPEED = 0.6  # [rad/s]
SHORTEST_LEAD = 1.0  # [s]
OLDEST = 1000  # age at which a pose of the cube says nothing any more [steps]
REST_TIME = 0.2  # time in which a released cube comes to rest [s]
# Share of its weight that a sliding cube leaves on the table. The planner does not know the drag.
# With a much larger share, motors have no torque left for the drag.
TABLE_SHARE = 0.2
HARDLY_LIFTED = 1e-4  # Goals on the table are not exact to the last bit [m].

HEIGHTS = [0.02, 0.01, 0.0, -0.01, -0.02]  # heights of the tips above the cube's centre [m]
LARGEST_TORQUE = 0.9  # share of the motors' torque that carrying may take

TURNS = (0.0, 0.2, -0.2, 0.4, -0.4, 0.6, -0.6, 0.8, -0.8)  # turns on the way to a goal [rad]
TURN_COST = 0.1  # cost of 1 rad, in shares of the motors' torque
VIA_TURNS = (0.0, 0.4, -0.4, 0.8, -0.8)  # turns on the way to the place of the next grasp [rad]
POINTS = np.linspace(0.0, 1.0, 8)  # points of a trajectory that the planner checks


def options(task: str, **changes: Any) -> Options:
    """Returns options of the environments in which a solver works: torques at 1 kHz."""
    return Options.of(
        task,
        action="torque",
        steps_per_action=1,
        mapping="state_augmentation",
        observation="dictionary",
        **changes,
    )


class Leg(NamedTuple):
    """A part of a route with one grasp."""

    touches: Sequence[control.Touch]
    trajectory: PoseTrajectory
    table_share: float
    """Share of the cube's weight that stays on the table."""
    cost: float
    """The largest share of a motor's torque, plus a cost for turning the cube."""

    def at(self, time: float) -> Motion:
        """Returns the cube's desired motion, `time` [s] after the beginning of the leg."""
        return _relieved(self.trajectory.at(time), self.table_share)


def pose_of(observation: Observation) -> Pose:
    """Returns the observed pose of the cube."""
    return Pose(observation["object_position"], observation["object_orientation"])


def on_table(pose: Pose, size: Sequence[float] = (SIZE, SIZE, SIZE)) -> Pose:
    """Returns the pose in which a slightly tilted cube, or another box, comes to rest."""
    axes = rotation(pose)
    axis = int(np.argmax(np.abs(axes[2])))
    upward = np.sign(axes[2, axis]) * axes[:, axis]
    tilt = np.cross(upward, (0.0, 0.0, 1.0))
    sine = float(np.linalg.norm(tilt))
    back = tilt * (np.arcsin(min(sine, 1.0)) / sine) if sine > 0 else tilt
    return Pose((*pose.position[:2], size[axis] / 2), rotated(pose, back).orientation)


class RoutePlanner:
    """Finds routes of the cube to a goal, with a grasp for each leg."""

    def __init__(self) -> None:
        settings = control.GraspPlannerConfig(
            heights=HEIGHTS, friction_sides=8, largest_torque=LARGEST_TORQUE
        )
        self._planner = control.GraspPlanner(CONFIG, OVERRIDES, "cube", settings)

    def plan(self, start: Pose, goal: npt.ArrayLike) -> list[Leg] | None:
        """Finds a route from rest at `start` to the position `goal` [m], with any orientation.

        The route has one grasp if possible. Otherwise the cube slides to another place and is
        grasped again there. Returns None if that does not reach the goal either.
        """
        goal = np.asarray(goal, np.float64)
        direct = self._best_leg(start, goal)
        if direct is not None:
            return [direct]
        routes = list(self._routes_with_regrasp(start, goal))
        return min(routes, key=lambda route: max(leg.cost for leg in route), default=None)

    def _routes_with_regrasp(self, start: Pose, goal: Array) -> Iterator[list[Leg]]:
        a, b = start.position[:2], goal[:2]
        for place, turn in itertools.product(((a + b) / 2, a / 2, b / 2, 0 * a), VIA_TURNS):
            via = turned(Pose((*place, SIZE / 2), start.orientation), turn)
            first = self._leg(start, via)
            if first is None:
                continue
            last = self._best_leg(via, goal)
            if last is not None:
                yield [first, last]

    def _best_leg(self, start: Pose, goal: Array) -> Leg | None:
        legs = []
        for turn in TURNS:
            leg = self._leg(start, turned(Pose(goal, start.orientation), turn))
            if leg is not None:
                legs.append(leg._replace(cost=leg.cost + TURN_COST * abs(turn)))
        return min(legs, key=lambda leg: leg.cost, default=None)

    def _leg(self, start: Pose, end: Pose) -> Leg | None:
        distance = float(np.linalg.norm(end.position - start.position))
        angle = float(np.linalg.norm(control.rotation_error(end.orientation, start.orientation)))
        duration = max(distance / SPEED, angle / TURN_SPEED, SHORTEST_LEAD)
        trajectory = PoseTrajectory(start, end, duration)
        is_lifted = end.position[2] > start.position[2] + HARDLY_LIFTED
        table_share = 0.0 if is_lifted else TABLE_SHARE
        motions = [_relieved(trajectory.at(share * duration), table_share) for share in POINTS]
        grasp = self._planner.plan(motions)
        if grasp is None:
            return None
        return Leg(grasp.touches, trajectory, table_share, grasp.torque_share)


class Solver:
    """Brings the cube to its goal and holds it there.

    It knows the observations, the age of the cube's pose, and the robot's configuration. Planning
    takes no time of the episode.
    """

    def __init__(self, planner: RoutePlanner, observation: Observation) -> None:
        """Makes a solver for one episode, which begins with `observation`."""
        self._planner = planner
        settings = control.GraspControllerConfig(friction_sides=8)
        self._controller = control.GraspController(CUBE, CONFIG, OVERRIDES, settings)
        self._estimator = control.PoseEstimator()
        self._now = 0.0
        self._look_time = 0.0  # time at which the cube rests
        self._age = 0  # of the cube's pose [steps]
        self._is_sure = False
        self._seen = -OLDEST  # step of the newest pose, counted from the first observation
        self._wanted: deque[Motion] = deque(maxlen=OLDEST)  # the newest desired motion is the last
        self._desired = Motion(on_table(pose_of(observation)))
        self._leg: Leg | None = None
        self._is_last = False
        self._lead_begin = np.inf  # not known yet
        self.grasps = 0
        """Number of times that the cube was grasped."""

    @property
    def is_leading(self) -> bool:
        """True while the cube is held, on its trajectory or at its goal."""
        return self._controller.state.phase is GraspPhase.HOLD

    def act(self, observation: Observation, info: dict[str, Any]) -> npt.NDArray[np.float32]:
        """Returns the action for an observation. Call this with every observation and its info."""
        self._age, self._is_sure = int(info["object_age"]), bool(info["object_is_sure"])
        self._follow_phases(observation)
        self._desired = self._desired_motion()
        self._wanted.append(self._desired)
        self._see(observation)
        position, velocity = observation["joint_position"], observation["joint_velocity"]
        # The motors' torques are not observed. They follow from the last action.
        applied = MAX_TORQUE * observation["action"] - SAFETY_KD * velocity
        joints = control.JointState(position, velocity, np.clip(applied, -MAX_TORQUE, MAX_TORQUE))
        cube = self._estimator.predict(self._now, self._desired)
        torque = self._controller.update(PERIOD, joints, cube, self._desired)
        self._now += PERIOD
        return np.clip(torque / MAX_TORQUE, -1.0, 1.0).astype(np.float32)

    def _follow_phases(self, observation: Observation) -> None:
        phase = self._controller.state.phase
        if phase is GraspPhase.IDLE:
            if self._now >= self._look_time:
                self._begin_leg(observation)
            return
        self._look_time = self._now + REST_TIME
        if phase is GraspPhase.HOLD and self._leg:
            self._lead_begin = min(self._lead_begin, self._now)
            has_arrived = self._now > self._lead_begin + self._leg.trajectory.duration
            if has_arrived and not self._is_last:
                self._controller.release()
        elif phase is GraspPhase.LOST:
            self._controller.release()

    def _begin_leg(self, observation: Observation) -> None:
        if not self._is_sure:
            return
        start = on_table(pose_of(observation))
        route = self._planner.plan(start, observation["goal"])
        self._estimator.reset()
        self._lead_begin = np.inf
        self._desired = Motion(start)
        if not route:
            # The cube may still be rolling.
            self._look_time = self._now + REST_TIME
            return
        self._leg, self._is_last = route[0], len(route) == 1
        self._controller.grasp(self._leg.touches, start)
        self.grasps += 1

    def _desired_motion(self) -> Motion:
        phase = self._controller.state.phase
        if self._leg is None or phase in (GraspPhase.IDLE, GraspPhase.RELEASE, GraspPhase.LOST):
            return Motion(self._desired.pose)
        return self._leg.at(max(self._now - self._lead_begin, 0.0))

    def _see(self, observation: Observation) -> None:
        captured = round(self._now / PERIOD) - self._age
        if not 0 <= self._age < OLDEST or captured <= self._seen:
            return
        self._seen = captured
        then = self._wanted[max(len(self._wanted) - 1 - self._age, 0)]
        self._estimator.update(captured * PERIOD, pose_of(observation), then)


class Trial(NamedTuple):
    """The result for one goal."""

    seed: int
    episode: int
    legs: int
    """Number of grasps that were planned."""
    grasps: int
    """Number of grasps that were needed."""
    is_success: bool
    """Success at the last step, judged by the environment."""
    distance: float
    """Distance from the goal at the last step, judged by the environment [m]."""


def try_goal(
    environment: Environment,
    planner: RoutePlanner,
    seed: int,
    episode: int,
    watch: Callable[[Observation, npt.NDArray[np.float32]], None] = lambda _seen, _action: None,
) -> Trial | None:
    """Plays an episode to its end. Returns None if its goal is not in the reachable set.

    `watch` is called with the observation after each step, and the action of that step.
    """
    observation, info = environment.reset(seed=seed, options={"episode": episode})
    start = Pose(*_simulation_of(environment).object_pose("cube"))
    route = planner.plan(on_table(start), observation["goal"])
    if route is None:
        return None
    solver = Solver(planner, cast(Observation, observation))
    has_ended = False
    while not has_ended:
        action = solver.act(cast(Observation, observation), info)
        observation, _, terminated, truncated, info = environment.step(action)
        watch(cast(Observation, observation), action)
        has_ended = terminated or truncated
    return Trial(
        seed, episode, len(route), solver.grasps, bool(info["is_success"]), info["distance"]
    )


def _simulation_of(environment: Environment) -> Simulation:
    if environment.simulation is None:
        raise ValueError("the environment must have a simulation of its own")
    return environment.simulation


def rotation(pose: Pose) -> Array:
    """Returns the axes of a body in the world, as columns."""
    body = Motion(Pose(orientation=pose.orientation))
    return np.column_stack([control.point_of_body(body, axis).position for axis in np.eye(3)])


def rotated(pose: Pose, vector: npt.ArrayLike) -> Pose:
    """Returns the pose turned about its place by a rotation vector in the world [rad]."""
    return control.moved(pose, control.Twist(angular=vector), 1.0)


def turned(pose: Pose, angle: float) -> Pose:
    """Returns the pose turned about the vertical [rad]."""
    return rotated(pose, (0.0, 0.0, angle))


def _relieved(motion: Motion, table_share: float) -> Motion:
    # The fingers carry only their share of the weight; the table carries the rest.
    acceleration = control.Acceleration(
        motion.acceleration.linear + table_share * control.gravity(), motion.acceleration.angular
    )
    return Motion(motion.pose, motion.twist, acceleration)
