# SPDX-License-Identifier: BSD-3-Clause
"""The paper's basic control loop: moves the joints to a goal, and holds them there.

It ends when somebody stops the robot. Start a robot first: `trifinger run sim`. In the end, stop
it: `trifinger stop sim`.
"""

import numpy as np
import trifinger

GOAL = np.array([0.1, 0.8, -1.5] * 3)  # [rad]


def policy(y: trifinger.Observation) -> trifinger.Action:
    """Computes a[t+1] from y[t]: a target on the way to the goal. The robot's PD follows it."""
    return robot.new_action(position=y.position + np.clip(GOAL - y.position, -0.1, 0.1))


try:
    robot = trifinger.connect("sim")
    hold = robot.new_action(position=robot.latest_observation().position)

    t = robot.append_desired_action(hold)
    while True:
        t = robot.append_desired_action(policy(robot.get_observation(t)))
except trifinger.RobotStopped as stopped:
    if stopped.fault.needs_recovery:
        raise
    print(stopped)
