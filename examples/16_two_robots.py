# SPDX-License-Identifier: BSD-3-Clause
"""One program controls two robots of different kinds on one machine, each at 1 kHz.

An arm follows a finger of a TriFinger. Start both first: `trifinger run sim` and
`trifinger run examples/arm.yml`.

Each robot has a loop in a thread of its own, which only this robot paces. A loop that needs to know
about the other robot reads its newest observation, which never waits. So nothing that happens to
one robot can delay the other.
"""

import math
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt
import trifinger

STEPS = 2000

Positions = npt.NDArray[np.float64]


def control(robot: trifinger.Frontend, target: Callable[[int], Positions]) -> str:
    """Lets the robot follow `target`, the positions of its joints in step t [rad].

    Raises RobotStopped if the robot stopped before its time.
    """
    t = -1
    while t + 1 < STEPS:
        t = robot.append_desired_action(robot.new_action(position=target(t + 1)))
        robot.wait_until_time_index(t)
    robot.finish()
    return f"{robot.session_info().name}: {t + 1} steps"


names = sys.argv[1:] or ["sim", "arm"]
fingers, arm = (trifinger.connect(name) for name in names)

begin = fingers.latest_observation().position


def wave(t: int) -> Positions:
    """Bends and stretches finger 0 once per second."""
    target = begin.copy()
    target[2] += 0.3 * (1 - math.cos(2 * math.pi * t / 1000))
    return target


def shadow(t: int) -> Positions:  # noqa: ARG001, the arm does not care which step it is
    """Lets the joints of the arm follow the last two of the finger."""
    return fingers.latest_observation().position[1:3]


with ThreadPoolExecutor() as threads:
    loops = [threads.submit(control, fingers, wave), threads.submit(control, arm, shadow)]
exit_code = 0
for loop in loops:
    try:
        print(loop.result())
    except trifinger.RobotStopped as stopped:
        print(stopped)
        exit_code = 1
sys.exit(exit_code)
