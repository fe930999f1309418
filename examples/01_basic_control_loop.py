# SPDX-License-Identifier: BSD-3-Clause
"""The paper's basic control loop: once as fast as the simulation can, once at 1 kHz.

The lines are the same.
"""

import numpy as np
import trifinger

GOAL = np.array([0.1, 0.8, -1.5] * 3)  # [rad]


def without_deadlines() -> None:
    """The back-end waits for every action, and the simulated time stands still meanwhile.

    Here it even runs inside of `get_observation`: no thread, nothing to wait for.
    """

    def policy(y: trifinger.Element) -> trifinger.Element:
        """a[t+1] as a function of y[t]: a target that the robot's own PD follows."""
        target = y.position + np.clip(GOAL - y.position, -0.1, 0.1)
        return robot.new_action(position=target)

    robot = trifinger.simulate()
    hold = robot.new_action(position=robot.latest_observation().position)

    t = robot.append_desired_action(hold)
    while t < 1000:
        t = robot.append_desired_action(policy(robot.get_observation(t)))
    robot.finish()

    error = np.abs(GOAL - robot.get_observation(t + 1).position).max()
    print(f"without deadlines: {t + 1} steps, {error:.3f} rad from the goal")
    assert error < 0.05


def in_real_time() -> None:
    """There is a new observation every millisecond, and it is `get_observation` that waits.

    A policy that is late ends the session with a fault, unless the back-end may repeat the action
    before. This machine may be busy with other things, so here it may.
    """

    def policy(y: trifinger.Element) -> trifinger.Element:
        return robot.new_action(setpoint=0.5 * y.setpoint)

    with (
        trifinger.run_fake(
            "example", real_time=True, max_action_repeats=5000, max_skipped_ticks=5000
        ),
        trifinger.connect("example") as robot,
    ):
        t = robot.append_desired_action(robot.new_action(setpoint=1.0))
        while t < 600:
            t = robot.append_desired_action(policy(robot.get_observation(t)))
        robot.finish()

        ticks = robot.get_status(t + 1).tick  # the last status says how it ended
        print(f"in real time: {t + 1} steps in {ticks} ms")
        assert ticks > t


if __name__ == "__main__":
    without_deadlines()
    in_real_time()
