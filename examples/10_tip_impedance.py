# SPDX-License-Identifier: BSD-3-Clause
"""Hangs each tip on a spring and a damper. Their other end moves up by 3 cm.

The transposed Jacobian turns the force into joint torques.
"""

import sys

import numpy as np
import trifinger
from trifinger import control

UP = np.array([0, 0, 0.03])  # [m]

# The robot of the name that this program is given, or one in this process.
robot = trifinger.connect(sys.argv[1]) if sys.argv[1:] else trifinger.simulate()
kinematics = control.Kinematics()
spring = control.TipGains(stiffness=200, damping=2.5)

y = robot.latest_observation()
trajectories = [
    control.LineTrajectory(tip, tip + UP, 1.0) for tip in kinematics.tip_positions(y.position)
]
for i in range(2000):
    jacobians = kinematics.tip_jacobians(y.position)
    tips = kinematics.tip_positions(y.position)
    velocities = (jacobians @ y.velocity).reshape(3, 3)
    wanted = [trajectory.at(i * 1e-3) for trajectory in trajectories]
    forces = [
        control.tip_impedance(*motion, spring)
        for motion in zip(wanted, tips, velocities, strict=True)
    ]
    bias = kinematics.bias_torques(y.position, y.velocity)
    torque = jacobians.T @ np.concatenate(forces) + bias
    y = robot.get_observation(robot.append_desired_action(robot.new_action(torque=torque)))

errors = [np.linalg.norm(point.position - tip) for point, tip in zip(wanted, tips, strict=True)]
print(f"the tips are within {1e3 * max(errors):.2f} mm of where they should be")
assert max(errors) < 1e-3
