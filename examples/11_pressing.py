# SPDX-License-Identifier: BSD-3-Clause
"""Lets the tips go down to the table and press on it with 1 N each.

In the vertical direction a force replaces the spring; in the horizontal directions it remains.
"""

import sys

import numpy as np
import trifinger
from trifinger import control

FORCE = 1.0  # [N]
DOWNWARD_SPEED = 0.1  # [m/s]

# The robot of the name that this program is given, or one in this process.
robot = trifinger.connect(sys.argv[1]) if sys.argv[1:] else trifinger.simulate()
kinematics = control.Kinematics()
spring = control.TipGains(stiffness=200, damping=5)

y = robot.latest_observation()
begin = kinematics.tip_positions(y.position)
for _ in range(2000):
    jacobians = kinematics.tip_jacobians(y.position)
    tips = kinematics.tip_positions(y.position)
    velocities = (jacobians @ y.velocity).reshape(3, 3)
    forces = []
    for finger, tip in enumerate(tips):
        touches = y.tip_force[finger] > 0
        down = 0.0 if touches else -DOWNWARD_SPEED
        wanted = control.PointMotion([*begin[finger][:2], tip[2]], [0, 0, down])
        force = control.tip_impedance(wanted, tip, velocities[finger], spring)
        if touches:
            force[2] = -FORCE
        forces.append(force)
    bias = kinematics.bias_torques(y.position, y.velocity)
    torque = jacobians.T @ np.concatenate(forces) + bias
    y = robot.get_observation(robot.append_desired_action(robot.new_action(torque=torque)))

print(f"the tips press with {min(y.tip_force):.3f} to {max(y.tip_force):.3f} N")
assert np.allclose(y.tip_force, FORCE, atol=0.05)
