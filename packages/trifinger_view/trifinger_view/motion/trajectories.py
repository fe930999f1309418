# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories between two states of a robot's joints, and how long they must take."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
from trifinger.errors import InvalidArgument

from trifinger_view.motion.limits import Samples, violations

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from trifinger_view.motion.facts import JointFacts

SEARCH_POINTS = 100
LONGEST = 60.0  # [s]


@dataclasses.dataclass(frozen=True)
class Trajectory:
    """The curve of least jerk from one position and velocity to another, without accelerations.

    With s = t / duration it is a polynomial of fifth degree in s for each joint.
    """

    start: NDArray[np.float64]
    start_velocity: NDArray[np.float64]
    end: NDArray[np.float64]
    end_velocity: NDArray[np.float64]
    duration: float

    def at(self, times: NDArray[np.float64]) -> Samples:
        """The curve at these times, from 0 to the duration [s]."""
        s = (times / self.duration)[:, None]
        v0, v1 = self.start_velocity * self.duration, self.end_velocity * self.duration
        gap = self.end - self.start
        c3 = 10 * gap - 6 * v0 - 4 * v1
        c4 = -15 * gap + 8 * v0 + 7 * v1
        c5 = 6 * gap - 3 * v0 - 3 * v1
        return Samples(
            times,
            self.start + s * (v0 + s**2 * (c3 + s * (c4 + s * c5))),
            (v0 + s**2 * (3 * c3 + s * (4 * c4 + s * 5 * c5))) / self.duration,
            s * (6 * c3 + s * (12 * c4 + s * 20 * c5)) / self.duration**2,
        )


def find_trajectory(
    facts: JointFacts,
    start: NDArray[np.float64],
    start_velocity: NDArray[np.float64],
    end: NDArray[np.float64] | None,
    end_velocity: NDArray[np.float64],
    speed: float = np.inf,
) -> Trajectory:
    """The shortest trajectory within the limits on which no joint is faster than `speed` [rad/s].

    Without an `end` the robot comes to rest where it is soonest. A robot that starts beyond a soft
    limit may be there at the start. Raises InvalidArgument with what stands in the way.
    """
    # What is already so at both ends is no fault of the trajectory.
    ends = [start] if end is None else [start, end]
    widened = dataclasses.replace(
        facts,
        soft_lower=np.minimum(facts.soft_lower, start),
        soft_upper=np.maximum(facts.soft_upper, start),
        max_velocity=np.maximum(
            np.minimum(facts.max_velocity, speed),
            np.maximum(np.abs(start_velocity), np.abs(end_velocity)),
        ),
    )
    gap = 0.0 if end is None else float(np.max(np.abs(end - start)))
    least = max(0.05, 1.5 * gap / min(speed, float(np.max(widened.max_velocity))))
    problem = ""
    duration = least
    while duration <= max(LONGEST, 4 * least):
        goal = start + start_velocity * duration / 2 if end is None else end
        trajectory = Trajectory(start, start_velocity, goal, end_velocity, duration)
        samples = trajectory.at(np.linspace(0, duration, SEARCH_POINTS))
        found = violations(widened, samples)
        if not found:
            return trajectory
        problem = problem or str(found[0])
        duration *= 1.1
    where = " to ".join(np.array2string(one, precision=3, separator=", ") for one in ends)
    raise InvalidArgument(
        f"there is no trajectory within the limits from {where}: {problem}; "
        "a motion that begins and ends at rest, away from the limits, has one"
    )
