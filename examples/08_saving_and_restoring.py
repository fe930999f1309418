# SPDX-License-Identifier: BSD-3-Clause
"""A simulation continues from a saved state exactly like the first time.

It can begin anew in any state that you choose.
"""

import numpy as np
import trifinger


def push(robot: trifinger.Frontend) -> np.ndarray:
    """Pushes all fingers inwards, against the cube and each other, where differences would grow."""
    for _ in range(500):
        t = robot.append_desired_action(robot.new_action(torque=-0.05))
    return robot.get_observations(t - 499, t + 1)


simulation = trifinger.Simulation()
with simulation.connect() as robot:
    push(robot)
    saved = simulation.save()
    first = push(robot)

# Every session begins in the state that was restored before it.
simulation.restore(saved)
with simulation.connect() as robot:
    second = push(robot)
print("the same 500 steps from the saved state are equal:", np.array_equal(first, second))
assert np.array_equal(first, second)

pose = np.array([0.1, 0.9, -1.7] * 3)
simulation.reset(pose, seed=7)
with simulation.connect() as robot:
    y = robot.latest_observation()
print(f"after the reset joint 0 is at {y.position[0]} rad")
assert np.array_equal(y.position, pose)
