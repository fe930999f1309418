# SPDX-License-Identifier: BSD-3-Clause
"""A grasping controller of the kind of 2020, for comparison: position control of the tips.

It is called like challenge_policy.py. The tips go up, over the object, beside it, and against three
of its faces. Two opposite ones are pressed with a fixed force; then all tips are led along straight
lines. Poses of the object correct them. Nothing turns the object on purpose.
"""

import itertools
import sys
from typing import Any

import numpy as np
from challenge_policy import face_up, pose_of
from challenge_task import Task
from solvers import Array, rotation
from trifinger import Kinematics

STIFFNESS, DAMPING = 250.0, 3.0  # of a tip [N/m], [Ns/m]
FORCE = 3.0  # with which the two opposite faces are pressed [N]
SPEED = 1.5e-4  # of tips and object [m/step]
RAISED, BESIDE, RADIUS = 0.1, 0.04, 0.01  # height, distance from a face, of the tips [m]
PRESSING = 300  # steps from the touch until the object is led
LOST = 0.04  # distance of the object from where it should be [m]
CORRECTION = 0.2  # share of the error that each pose corrects


def towards(target: Array, end: Array) -> Array:
    """Returns the target, a step nearer to its end; both have a point in each row."""
    way = end - target
    length = float(np.linalg.norm(way, axis=-1).max())
    return end if length <= SPEED else target + way * (SPEED / length)


class Reference:
    """Approach, pinch and way; from the beginning if the object gets lost."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self._kinematics = Kinematics("trifinger_pro")
        self._home = self._kinematics.tip_positions([0.0, 0.9, -1.7] * 3)
        self._target, self._points = self._home, list[Array]()
        self._pose, self._newest = pose_of(task.initial_pose), None
        self._step, self._held_since = 0, -1

    def act(self, robot: Any, cameras: Any) -> Array:
        """Returns the torques of the next step."""
        if cameras is not self._newest:
            self._newest, self._pose = cameras, pose_of(cameras.filtered_object_pose)
            if self._held_since >= 0:
                self._correct()
        tips = self._kinematics.tip_positions(robot.position)
        if self._held_since < 0 and not self._points:
            self._begin(tips)
        self._lead()
        jacobians = self._kinematics.tip_jacobians(robot.position)
        velocity = np.reshape(jacobians @ robot.velocity, (3, 3))
        forces = STIFFNESS * (self._target - tips) - DAMPING * velocity
        if self._held_since >= 0:
            forces += FORCE * self._inward
        self._step += 1
        torque: Array = jacobians.T @ forces.ravel()
        return torque + self._kinematics.gravity_torques(robot.position)

    def _begin(self, tips: Array) -> None:
        """Chooses three faces and the points of the approach."""
        axes, up = rotation(self._pose), face_up(self._pose)[0]
        a, b = ((up + 1) % 3, (up + 2) % 3)
        best = np.inf
        for (one, other), sign in itertools.product(((a, b), (b, a)), (1, -1)):
            faces = np.array([axes[:, one], -axes[:, one], sign * axes[:, other]])
            faces[:, 2] = 0
            halves = np.array([self._task.size[k] / 2 for k in (one, one, other)])
            for order in map(list, itertools.permutations(range(3))):
                outward, half = faces[order], halves[order][:, None]
                touches = self._pose.position + (half + RADIUS) * outward
                distance = np.linalg.norm(touches - self._home, axis=1).sum()
                if distance < best:
                    best = distance
                    presses = np.array([index < 2 for index in order])
                    self._inward = -outward * presses[:, None]
                    self._touches, beside = touches, touches + BESIDE * outward
        self._touches[:, 2] = beside[:, 2] = max(self._pose.position[2], RADIUS + 0.002)
        up_here, over = tips.copy(), beside.copy()
        up_here[:, 2] = over[:, 2] = RAISED
        self._points = [up_here, over, beside, self._touches]
        self._target = tips

    def _lead(self) -> None:
        if self._points:
            self._target = towards(self._target, self._points[0])
            if self._target is self._points[0]:
                self._points.pop(0)
            if not self._points:
                self._held_since, self._shift = self._step, np.zeros(3)
                self._start = self._place = self._pose.position
        elif self._step > self._held_since + PRESSING:
            times = [time for time, _ in self._task.positions]
            active = int(np.searchsorted(times, self._step / 1000, side="right")) - 1
            self._place = towards(self._place, self._task.positions[active][1])
            self._target = self._touches + self._place + self._shift - self._start

    def _correct(self) -> None:
        error = self._place - self._pose.position
        self._shift += CORRECTION * np.clip(error, -0.005, 0.005)
        if np.linalg.norm(error) > LOST:
            self._held_since = -1


def solve(task: Task) -> float:
    """Tries a task; returns the mean cost per step."""
    return task.run(Reference(task).act)


if __name__ == "__main__":
    print(solve(Task(sys.argv[1:])))
