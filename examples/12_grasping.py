# SPDX-License-Identifier: BSD-3-Clause
"""Lets three tips grasp the cube, lift it by 3 cm, put it down and let it go.

The object session delivers the cube's pose every 10 ms, with a delay of 20 ms. An estimator
computes where the cube is now.
"""

import sys

import numpy as np
import trifinger
from trifinger import control

PERIOD = 1e-3  # [s]
MOVE = 1.0  # time to move up, and to move down again [s]
STAY = 1.0  # time at the top [s]
UP = np.array([0, 0, 0.03])  # [m]


def pose_of(cube: trifinger.Element) -> control.Pose:
    """Returns the cube's newest pose from the object session."""
    return control.Pose(cube.position, cube.orientation)


robot = (
    trifinger.connect(sys.argv[1])  # a robot of this name, if this program is given one
    if sys.argv[1:]
    else trifinger.simulate("sim", {"simulation.object_delay": 0.02})
)
poses = robot.companion("object")
hold = robot.new_action(position=robot.latest_observation().position)
t = robot.append_desired_action(hold)

rest = pose_of(poses.get_latest_at(t).cube)
top = control.Pose(rest.position + UP, rest.orientation)
up = control.PoseTrajectory(rest, top, MOVE)
down = control.PoseTrajectory(top, rest, MOVE)
lift_begin = np.inf  # not known yet


def desired_at(time: float) -> control.Motion:
    """Returns where the cube should be."""
    since = time - lift_begin
    return up.at(since) if since < MOVE + STAY else down.at(since - MOVE - STAY)


grasp = control.GraspPlanner().plan([control.Motion(rest), control.Motion(top)])
assert grasp
controller = control.GraspController(control.rigid_body("box", [0.065] * 3, mass=0.094))
controller.grasp(grasp.touches, rest)

estimator = control.PoseEstimator()
highest = 0.0
while controller.state.phase is not control.GraspPhase.IDLE:
    y = robot.get_observation(t)
    now = t * PERIOD
    seen = poses.get_latest_at(t)
    then = seen.stamp.capture_index * PERIOD
    estimator.update(then, pose_of(seen.cube), desired_at(then))
    cube = estimator.predict(now, desired_at(now))
    highest = max(highest, cube.pose.position[2])

    joints = control.JointState(y.position, y.velocity, y.torque)
    torque = controller.update(PERIOD, joints, cube, desired_at(now))
    t = robot.append_desired_action(robot.new_action(torque=torque))

    phase = controller.state.phase
    if phase is control.GraspPhase.HOLD and lift_begin > now:
        lift_begin = now
    is_down = phase is control.GraspPhase.HOLD and now > lift_begin + 2 * MOVE + STAY
    if is_down or phase is control.GraspPhase.LOST:
        controller.release()

height = highest - rest.position[2]
moved = np.linalg.norm(cube.pose.position - rest.position)
print(
    f"the cube was lifted by {1e3 * height:.2f} mm and lies {1e3 * moved:.2f} mm from where it was"
)
assert abs(height - 0.03) < 2e-3
assert moved < 3e-3
