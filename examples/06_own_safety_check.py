# SPDX-License-Identifier: BSD-3-Clause
"""A safety check for one task is a plain function. After it, the robot's own limits still hold."""

import numpy as np
import trifinger

MAX_SPEED = 1.0  # limit of this task [rad/s]


def slow_down(y: trifinger.Observation, action: trifinger.Action) -> None:
    """Brakes joints that are too fast.

    It gets the newest observation and an action that is finite, with all gains filled in, and may
    change the action. In Python, checks are for simulations only: a check runs in the loop, and a
    robot in real time cannot wait for an interpreter.
    """
    too_fast = np.abs(y.velocity) > MAX_SPEED
    action.torque[too_fast] = -0.1 * y.velocity[too_fast]
    action.position[too_fast] = np.nan  # not given


def swing(simulation: trifinger.Simulation) -> tuple[float, int]:
    """Swings joint 0 of the first finger to the side, as fast as allowed."""
    with simulation.connect() as robot:
        action = robot.new_action(position=robot.latest_observation().position)
        action.position[0] += 0.3
        for _ in range(300):
            t = robot.append_desired_action(action)
        speeds = np.abs(robot.get_observations(0, t + 1)["velocity"][:, 0])
        # The applied action says, as a reason, what the check did to it.
        reasons = robot.get_applied_actions(0, t + 1)["reasons"][:, 0]
        return speeds.max(), np.count_nonzero(reasons & trifinger.Reason.OWN_CHECK.value)


def main() -> None:
    simulation = trifinger.Simulation()
    speed_without, acted_without = swing(simulation)

    simulation.add_check(slow_down)  # only between sessions
    speed_with, acted_with = swing(simulation)

    print(f"fastest without the check: {speed_without:.2f} rad/s")
    print(f"fastest with it:           {speed_with:.2f} rad/s; it acted in {acted_with} steps")
    assert speed_without > 1.5 * MAX_SPEED
    assert acted_without == 0
    assert speed_with < 1.2 * MAX_SPEED
    assert acted_with > 0


if __name__ == "__main__":
    main()
