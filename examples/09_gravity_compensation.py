# SPDX-License-Identifier: BSD-3-Clause
"""Makes the fingers float.

The fingers get the torques that carry their weight and nothing else. People can push them, and they
stay where they are left. Afterwards the fingers get no torque at all.
"""

import sys

import numpy as np
import trifinger
from trifinger import control

# The robot of the name that this program is given, or one in this process.
robot = trifinger.connect(sys.argv[1]) if sys.argv[1:] else trifinger.simulate()
kinematics = control.Kinematics()


def push(*, compensates: bool) -> tuple[float, float]:
    """Pushes one joint for a fifth of a second.

    Returns how far the joints move during that time, and in the second after it.
    """
    y = robot.latest_observation()
    begin = left = y.position
    for i in range(1200):
        torque = kinematics.gravity_torques(y.position) if compensates else np.zeros(9)
        if i < 200:
            torque[1] += 0.05
        y = robot.get_observation(robot.append_desired_action(robot.new_action(torque=torque)))
        if i == 199:
            left = y.position
    return float(np.abs(left - begin).max()), float(np.abs(y.position - left).max())


pushed, drifted = push(compensates=True)
fallen = push(compensates=False)[1]
print(
    f"floating, a joint was pushed by {pushed:.3f} rad and moved by {drifted:.3f} rad when left "
    f"alone; falling, by {fallen:.3f} rad"
)
# A machine that is late gives emulated boards less time to move in.
assert pushed > 0.03
assert drifted < 0.03
assert fallen > 3 * drifted
