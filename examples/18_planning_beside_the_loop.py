# SPDX-License-Identifier: BSD-3-Clause
"""Pushes the cube to a place, with plans that are made beside the loop at 1 kHz.

Every 40 ms the planner gets what was measured and looks half a second ahead. Meanwhile, the robot
follows the newest plan. Neither waits for the other.
"""

import sys
import time

import numpy as np
import trifinger
from trifinger import control
from trifinger.control import CostKind, CostShape, CostTerm

PERIOD = 1e-3  # [s]
AWAY = np.array([0.03, 0.02, 0])  # [m]
NEAR = 0.01  # [m]
LONGEST = 60.0  # [s]

is_here = not sys.argv[1:]
robot = trifinger.simulate() if is_here else trifinger.connect(sys.argv[1])
poses = robot.companion("object")
action = robot.new_action(position=robot.latest_observation().position)
t = robot.append_desired_action(action)
seen = poses.get_latest_at(t).cube
goal = control.Pose(seen.position + AWAY, seen.orientation)

model = control.PlanningModel()
cube = model.object("cube")
state = model.initial_state()
options = control.PlannerOptions(seed=1)
planner = control.OnlinePlanner(
    model,
    control.PlanningTask(
        [
            CostTerm(kind=CostKind.OBJECT_POSITION, weight=10, goal=goal),
            CostTerm(kind=CostKind.OBJECT_VELOCITY, weight=0.7, shape=CostShape.SQUARE),
            CostTerm(kind=CostKind.TIP_OBJECT, weight=2, distance=0.046),
            CostTerm(kind=CostKind.TARGET_DISTANCE, weight=0.1, shape=CostShape.SQUARE),
        ],
        late_factor=3,
    ),
    options,
)

begin = time.monotonic() - t * PERIOD
distance = np.inf
while distance > NEAR and t * PERIOD < LONGEST:
    y = robot.get_observation(t)
    seen = poses.get_latest_at(t).cube
    distance = np.linalg.norm(seen.position - goal.position)

    model.set_joints(y.position, y.velocity, state)
    model.set_object(cube, control.Pose(seen.position, seen.orientation), control.Twist(), state)
    state.time = t * PERIOD
    planner.set_state(state)

    commands = planner.at(state.time)
    if commands is not None:  # the first plan is there
        target, _ = commands
        action = robot.new_action(position=target, position_kp=options.kp, position_kd=options.kd)
    t = robot.append_desired_action(action)
    if is_here:  # this simulation does not wait for the clock, but plans take real time
        time.sleep(max(0.0, begin + t * PERIOD - time.monotonic()))

status = planner.status
print(f"after {t * PERIOD:.1f} s the cube is {1e3 * distance:.0f} mm from its goal")
print(f"{status.num_plans} plans; the last one took {1e3 * status.duration:.0f} ms")
assert distance < NEAR
