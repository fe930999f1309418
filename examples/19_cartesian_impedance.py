# SPDX-License-Identifier: BSD-3-Clause
"""An arm from a file moves its flange on a circle, as if it hung on a spring. A push moves it away,
and it comes back.

The transposed Jacobian turns the wrench of the spring into joint torques. The arm has a joint more
than the flange needs: torques of the null space keep its elbow, and do not move the flange.
"""

from pathlib import Path

import numpy as np
import trifinger
from trifinger import control

CONFIG = str(Path(__file__).with_name("panda.yml"))
FRAME = "flange"
RADIUS, TURN = 0.05, 4.0  # [m], time of one turn [s]
SPRING = control.ObjectGains(
    stiffness=4000, damping=150, rotational_stiffness=100, rotational_damping=6
)
PUSH = range(9000, 9500)  # steps

simulation = trifinger.Simulation(CONFIG)
robot = simulation.connect()
arm = trifinger.ModelKinematics(CONFIG, [FRAME])
no_mass = control.RigidBody(mass=0.0, inertia=np.zeros((3, 3)))
home = arm.initial_position
begin, orientation = arm.pose(FRAME, home)


def desired(t: float) -> control.Motion:
    """Where the flange should be at time t [s]: a circle that grows in its first turn."""
    share = min(t / TURN, 1.0)
    radius, growth = RADIUS * share, RADIUS / TURN if share < 1.0 else 0.0
    rate = 2 * np.pi / TURN
    ahead = np.array([np.cos(rate * t), np.sin(rate * t), 0.0])
    aside = np.array([-ahead[1], ahead[0], 0.0])
    return control.Motion(
        control.Pose(begin + radius * ahead, orientation),
        control.Twist(radius * rate * aside + growth * ahead, (0.0, 0.0, 0.0)),
    )


errors = []
y = robot.latest_observation()
for i in range(12000):
    if i == PUSH.start:
        simulation.pull(FRAME, target=arm.pose(FRAME, y.position)[0] + [0, 0, 0.3], stiffness=5000)
    if i == PUSH.stop:
        simulation.let_go()
    place, turn = arm.pose(FRAME, y.position)
    jacobian = arm.jacobian(FRAME, y.position)
    velocity = jacobian @ y.velocity
    motion = desired(1e-3 * i)
    wrench = control.object_impedance(
        motion,
        control.Pose(place, turn),
        control.Twist(velocity[:3], velocity[3:]),
        no_mass,
        SPRING,
    )
    posture = 20 * (home - y.position) - 4 * y.velocity
    torque = (
        jacobian.T @ np.concatenate([wrench.force, wrench.moment])
        + arm.bias_torques(y.position, y.velocity)
        + arm.null_space_torques(FRAME, y.position, posture)
    )
    y = robot.get_observation(robot.append_desired_action(robot.new_action(torque=torque)))
    errors.append(np.linalg.norm(motion.pose.position - place))

circle = np.array(errors[4000 : PUSH.start])
rms = np.sqrt((circle**2).mean())
pushed, back = max(errors[PUSH.start : PUSH.stop + 200]), max(errors[-1000:])
print(
    f"on the circle within {1e3 * rms:.2f} mm (rms); a push of 20 N moved it by "
    f"{1e3 * pushed:.1f} mm; back within {1e3 * back:.2f} mm"
)
assert rms < 1e-3
assert pushed > 3e-3
assert back < 1.5e-3
