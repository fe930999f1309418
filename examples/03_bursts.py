# SPDX-License-Identifier: BSD-3-Clause
"""Appends a trajectory that is known in advance in one call, and reads it back in another."""

import sys

import numpy as np
import trifinger

# The robot of the name that this program is given, or one in this process.
robot = trifinger.connect(sys.argv[1]) if sys.argv[1:] else trifinger.simulate()
start = robot.latest_observation().position.copy()
end = start + np.array([0.3, 0.0, 0.0] * 3)


def plan(origin: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Plans one second from one pose to another, at rest at both ends."""
    s = np.arange(1, 1001) / 1000
    progress = s**3 * (10 - 15 * s + 6 * s**2)
    actions = np.repeat(np.array([robot.new_action()]), len(s))
    actions["position"] = origin + progress[:, None] * (goal - origin)
    return actions


# The queue takes 4096 actions before an append has to wait. From here on the robot needs no new
# actions for a second, so this program may spend that time on something else, in real time as well.
there = plan(start, end)
back = plan(end, start)
robot.append_desired_actions(there)
last = robot.append_desired_actions(back)

# Waits for the last step, then copies all observations.
observations = robot.get_observations(0, last + 1)

targets = np.concatenate([there, back])["position"]
lag = np.abs(targets - observations["position"])[:, 0].max()
turned = observations["position"][999, 0] - start[0]
print(f"{len(observations)} steps; joint 0 turned by {turned:.3f} rad and back")
print(f"it was {lag:.3f} rad behind at most")
assert last == 1999
assert abs(turned - 0.3) < 0.05
assert lag < 0.1
