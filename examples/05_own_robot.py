# SPDX-License-Identifier: BSD-3-Clause
"""Drives the cart of 05_own_robot.cpp, a robot that Python does not know.

Its session says which fields its actions have. Needs the built examples on the path.
"""

import subprocess

import numpy as np
import trifinger

# Usually the cart would run already. This starts the C++ program and waits for its first line.
with subprocess.Popen(
    ["05_own_robot"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
) as cart:
    print(cart.stdout.readline().strip())

    with trifinger.connect("cart") as robot:
        print("an action has the fields", robot.action_dtype.names)
        print("an observation has the fields", robot.observation_dtype.names)

        # Two seconds of a curve: the right wheel is asked for more than it can do.
        action = robot.new_action(speed=[10.0, 25.0])
        for _ in range(2000):
            t = robot.append_desired_action(action)
        applied = robot.get_applied_action(t)
        y = robot.get_observation(t + 1)

    cart.communicate("\n")  # Enter stops it

print(f"after {t + 1} steps: {y.distance:.3f} m driven, heading {y.heading:.3f} rad")
assert applied.speed[1] == 20.0
assert np.isclose(y.distance, 0.9)
assert np.isclose(y.heading, 3.0)
assert cart.returncode == 0
