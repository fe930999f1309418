# SPDX-License-Identifier: BSD-3-Clause
"""A policy at 100 Hz on a robot at 1 kHz: every action is appended ten times."""

import sys

import numpy as np
import trifinger

FACTOR = 10

# The robot of the name that this program is given, or one in this process.
robot = trifinger.connect(sys.argv[1]) if sys.argv[1:] else trifinger.simulate()
hold = robot.new_action(position=robot.latest_observation().position)


def policy(y: trifinger.Observation) -> trifinger.Action:
    """Swings joint 0 of each finger about zero; the robot's PD follows at 1 kHz."""
    action = hold.copy()
    action.position[0::3] = np.where(y.position[0::3] < 0.0, 0.2, -0.2)
    return action


# t counts the policy's cycles, and FACTOR * t the robot's steps, like in the paper. y[FACTOR * t]
# belongs to the last step that has an action. So in real time the policy has one period to answer,
# not FACTOR periods.
robot.append_desired_action(hold)
for t in range(100):
    action = policy(robot.get_observation(FACTOR * t))
    for _ in range(FACTOR):
        robot.append_desired_action(action)
robot.finish()

# One row per cycle: all its steps have the same action.
targets = robot.get_desired_actions(1, 1001)["position"][:, 0].reshape(100, FACTOR)
swings = np.count_nonzero(np.diff(targets[:, 0]))
print(f"{robot.current_time_index()} steps, 100 actions, {swings} changes of direction")
# A robot in real time repeats an action if this program is late; later ones then shift by a step.
assert (targets == targets[:, :1]).all() or robot.current_time_index() > 1001
assert swings > 4
