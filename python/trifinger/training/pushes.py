# SPDX-License-Identifier: BSD-3-Clause
"""Makes more of transitions of a push by three fingers: other goals, and turned tables."""

# This import comes first because its error says what to install.
from trifinger.stable_baselines import Flat, Rows

# isort: split
import numpy as np
import torch
from stable_baselines3.common.type_aliases import ReplayBufferSamples

from trifinger.arrays import Array
from trifinger.training.plan import Plan

THIRDS, QUARTERS = 3, 4
REACH = 0.2  # unit of offsets [m]


class Pushes:
    """An `augment` of EpisodeReplayBuffer, for flat observations of the task "push".

    The share `relabelled` of the goals is replaced: one half by places to which the cube came later
    in the episode (Andrychowicz et al. 2017, "Hindsight Experience Replay"), the other half by
    goals of other episodes. With `symmetry` transitions are turned by thirds of a circle, and their
    cube by quarters about its own axis, by chance: the fingers are turned copies of one, and the
    faces of a cube are equal.
    """

    def __init__(self, plan: Plan, rows: Rows) -> None:
        """Of a plan that says `relabelled` or `symmetry`."""
        recipe = plan.recipe
        self._rows, self._relabelled = rows, recipe.relabelled
        self._flat = rows.flat
        self._random = np.random.default_rng(plan.seed)
        self._goal = self._flat["goal"][0][:2]
        turns = [(third, quarter) for third in range(THIRDS) for quarter in range(QUARTERS)]
        self._turns = turns if recipe.symmetry else turns[:1]
        self._matrices = [turn_of(self._flat, *turn) for turn in self._turns]

    def __call__(
        self, samples: ReplayBufferSamples, later: Array, other: Array
    ) -> ReplayBufferSamples:
        """The transitions with other goals, turned, and with the rewards of both."""
        before, actions, after, terminated, rewards = (one.numpy() for one in samples[:5])
        count = len(before)
        is_new = self._random.random(count) < self._relabelled
        is_later = self._random.random(count) < 0.5
        goals = np.where(is_later[:, None], self._reached(later), other[:, self._goal])
        for seen in (before, after):
            seen[:, self._goal] = np.where(is_new[:, None], goals, seen[:, self._goal])
        turns = self._random.integers(0, len(self._turns), count)
        for turn, matrix in enumerate(self._matrices):
            rows = turns == turn
            before[rows], after[rows] = before[rows] @ matrix.T, after[rows] @ matrix.T
            actions[rows] = actions[rows][:, fingers_of(self._turns[turn][0])]
        quaternion = self._flat["object_orientation"][0]
        for seen in (before, after):  # w is never negative
            seen[:, quaternion] *= np.where(seen[:, quaternion[:1]] < 0, -1, 1)
        if self._relabelled > 0:  # turns change no rewards
            rewards = self._rows.rewards(before, after, terminated.ravel())[:, None]
        arrays = (before, actions, after, terminated, rewards)
        return ReplayBufferSamples(*map(torch.from_numpy, arrays))

    # Where the cube is, scaled like goals.
    def _reached(self, observations: Array) -> Array:
        _, low, high = self._flat["goal"]
        place = self._rows.entries(observations)["object_position"]
        return np.asarray(np.clip(2 * (place - low) / (high - low) - 1, -1.0, 1.0)[:, :2])


def offsets_of(flat: Flat) -> Array:
    """The matrix from an observation to x and y of the goal and of the tips, from the object.

    The bounds of all these positions are symmetrical.
    """
    names = ("goal", "tip_position", "object_position")
    numbers = sum(len(places) for places, _, _ in flat.values())
    goal, tips, thing = (
        np.eye(numbers)[places] * high[:, None] / REACH
        for places, _, high in (flat[name] for name in names)
    )
    return np.concatenate([end[:2] - thing[:2] for end in (goal, *tips.reshape(-1, 3, numbers))])


def fingers_of(third: int) -> Array:
    """For each joint, the one whose numbers it has after a turn."""
    return (3 * ((np.arange(3)[:, None] + third) % 3) + np.arange(3)).ravel()


def turn_of(flat: Flat, third: int, quarter: int) -> Array:
    """The matrix that turns an observation; `w` of its quaternion may become negative.

    Numbers that are scaled turn as others do: the bounds of x and y are equal and symmetrical.
    """
    place = {name: np.array(places) for name, (places, _, _) in flat.items()}
    numbers = sum(len(one) for one in place.values())
    matrix, fingers = np.zeros((numbers, numbers), np.float32), fingers_of(third)
    angle = 2 * np.pi / 3 * third
    turn = np.eye(3)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    for name in {"joint_position", "joint_velocity", "action"} & place.keys():
        matrix[place[name], place[name][fingers]] = 1.0
    tips = place["tip_position"]
    points = list(zip(tips.reshape(3, 3), tips[fingers].reshape(3, 3), strict=True))
    points += [(place[name], place[name]) for name in ("object_position", "goal")]
    for to, source in points:
        matrix[np.ix_(to, source)] = turn
    orientation = place["object_orientation"]
    both = _about_z(angle, 1) @ _about_z(np.pi / 2 * quarter, -1)
    matrix[np.ix_(orientation, orientation)] = both
    return matrix


# A product of quaternions with a turn about z: from the left (side 1), or from the right (-1).
def _about_z(angle: float, side: int) -> Array:
    c, s = np.cos(angle / 2), np.sin(angle / 2)
    return np.array([[c, 0, 0, -s], [0, c, -side * s, 0], [0, side * s, c, 0], [s, 0, 0, c]])
