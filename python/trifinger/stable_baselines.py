# SPDX-License-Identifier: BSD-3-Clause
"""Lets Stable-Baselines3 train on the environments of this package."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

# This import comes first because its error says what to install.
from trifinger.arrays import Array
from trifinger.environments import Environment, VectorEnvironment

# isort: split
import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.vector import AutoresetMode

from trifinger.errors import InvalidArgument
from trifinger.extras import sentence

try:
    from stable_baselines3.common.vec_env import VecEnv
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(sentence("learning", str(error.name)), name=error.name) from error

Flat = Mapping[str, tuple[Sequence[int], Array, Array]]  # places, low and high of each entry
Vector = gymnasium.vector.VectorEnv[Any, Any, Any]

JOINTS = 3  # joints of a finger
# From a pushing tip to the middle of a cube, nearly that of a ball [m]; the same as kPushedFrom of
# src/learning/environment_observation.cpp.
PUSHED_FROM = 0.045


class Step(NamedTuple):
    """What a step of all environments has led to."""

    observations: Array
    """A row each, of the next episode where one has ended."""
    rewards: Array
    """Single precision, one for each row."""
    terminated: Array
    """Of each environment: nothing can follow."""
    truncated: Array
    """Of each environment: the time of the episode is over."""
    returns: Array
    """Of each environment: the sum of the task's rewards since the episode began."""
    lengths: Array
    """Of each environment: the number of actions since then."""
    info: dict[str, Any]
    """Of the environment, with "final_obs" and "final_info" of episodes that have ended."""

    @property
    def ended(self) -> Array:
        """The environments in which an episode has ended."""
        return self.terminated | self.truncated


class Rows(VecEnv):
    """Environments in the form that Stable-Baselines3 needs, with one row for each.

    With `is_shared`, each finger has its own row, as if it were a robot: so one policy learns from
    all fingers. This needs options with per_finger=True.
    """

    def __init__(
        self,
        environment: Vector,
        *,
        is_per_finger: bool = False,
        is_shared: bool = False,
        reward_scale: float = 1.0,
        approach: float = 0.0,
        kernel: float = 0.0,
        gamma: float = 1.0,
    ) -> None:
        """`environment` must reset itself by AutoresetMode.SAME_STEP.

        `is_per_finger` is the value of its options. `approach` [1/m] adds a reward for a tip that
        comes nearer to where it could push the object to its goal. An object that comes nearer to
        its goal gets twice as much. The reward is the change of a potential (Ng, Harada and Russell
        1999), so the best policy stays the same; with `gamma` 1.0 it is the plain difference, and
        an episode that is terminated gains nothing by its end. `kernel` is the reward of each
        action for an object at its goal; at a distance of 2 cm it is 0.43 of that, at 5 cm 0.07.
        """
        if environment.metadata["autoreset_mode"] != AutoresetMode.SAME_STEP:
            raise InvalidArgument("the environment must have AutoresetMode.SAME_STEP")
        if not environment.single_observation_space.shape:
            raise InvalidArgument('Stable-Baselines3 needs vectors: set observation="flat"')
        (seen,) = environment.single_observation_space.shape
        (acted,) = environment.single_action_space.shape or (0,)
        self.environment = environment
        first: Any = environment
        is_batch = isinstance(environment, VectorEnvironment)
        self.one: VectorEnvironment | Environment = first if is_batch else first.envs[0].unwrapped
        """Has what all environments have in common: the layout of observations, and rewards."""
        self.rows = acted // JOINTS if is_shared else 1
        """Number of rows of an environment."""
        self.episodes = np.zeros(environment.num_envs, np.int64)
        """Number of episodes that have ended, for each environment."""
        self._reward_scale, self._approach, self._gamma = reward_scale, approach, gamma
        self._kernel = kernel
        self._is_per_finger = is_per_finger
        self._lengths = np.zeros(environment.num_envs, np.int64)
        self._returns = np.zeros(environment.num_envs)
        self._potentials = np.zeros(environment.num_envs)
        self._last_goals = np.zeros((environment.num_envs, 0))
        super().__init__(
            environment.num_envs * self.rows,
            spaces.Box(-1.0, 1.0, (seen // self.rows,), np.float32),
            spaces.Box(-1.0, 1.0, (acted // self.rows,), np.float32),
        )

    def begin(self, seed: int, episodes: npt.ArrayLike) -> Array:
        """Begins episode `episodes[i]` of environment i and returns the observations."""
        self.episodes = np.array(episodes, np.int64)
        # A single robot takes one number, not an array.
        of_all = self.one is self.environment
        episode: Any = self.episodes if of_all else int(self.episodes[0])
        return self._begin_next(seed=seed, options={"episode": episode})

    def reset(self) -> Any:
        """Begins the next episodes, or episode 0 of the seed that seed() was given."""
        if self._seeds[0] is not None:
            seed = self._seeds[0]
            self._reset_seeds()
            return self.begin(seed, np.zeros_like(self.episodes))
        return self._begin_next()

    def step_async(self, actions: Array) -> None:
        """Keeps the actions for step_wait()."""
        self._actions = actions

    def move(self, actions: Array) -> Step:
        """Applies an action in each row."""
        environment = self.environment
        actions = actions.reshape(environment.num_envs, -1)
        observations, rewards, terminated, truncated, info = environment.step(actions)
        ended = terminated | truncated
        self._lengths += 1
        self._returns += rewards
        potentials, near = self._potential(observations)
        reached, goals = potentials.copy(), self._goals(observations)
        if self._looks_at_objects and ended.any():
            last = np.stack(list(info["final_obs"][ended]))
            reached[ended], near[ended] = self._potential(last)
        # A new goal is as far as it is: nobody has gained or lost by that.
        is_new = (goals != self._last_goals).any(axis=1) & ~ended
        before = np.where(is_new, reached, self._potentials)
        rewards = self._with_approach(rewards, before, reached, near, terminated)
        self._potentials, self._last_goals = potentials, goals
        returns, lengths = self._returns.copy(), self._lengths.copy()
        self._returns[ended] = self._lengths[ended] = 0
        if self.rows > 1:
            rewards = _of_step("finger_rewards", info, ended).ravel() * self._reward_scale
        self.episodes = self.episodes + ended
        return Step(
            self._split(observations),
            np.asarray(rewards, np.float32),
            terminated,
            truncated,
            returns,
            lengths,
            info,
        )

    def step_wait(self) -> Any:
        """Applies the actions of step_async()."""
        step = self.move(self._actions)
        info, ended = step.info, step.ended
        achieved = self._split(self._shown(_of_step("achieved_goal", info, ended)))
        success = _of_step("is_success", info, ended)
        infos: list[dict[str, Any]] = [
            {"achieved_goal": achieved[row], "is_success": bool(success[row // self.rows])}
            for row in range(self.num_envs)
        ]
        for index in np.flatnonzero(ended):
            episode = {"r": step.returns[index], "l": int(step.lengths[index])}
            last = info["final_obs"][index].reshape(self.rows, -1)
            for part in range(self.rows):
                infos[index * self.rows + part] |= {
                    "terminal_observation": last[part],
                    "TimeLimit.truncated": bool(
                        step.truncated[index] and not step.terminated[index]
                    ),
                    "episode": episode,
                }
        return step.observations, step.rewards, np.repeat(ended, self.rows), infos

    def judge(self, before: Array, after: Array, *, terminated: bool) -> tuple[Array, Array]:
        """The reward of each row and what it achieved, of one transition of a single robot.

        For transitions that step() did not make: `before` and `after` are records with an
        "observation", the "reward" of the task, and the goals "achieved" and "desired".
        """
        rewards = np.full(self.rows, float(after["reward"]))
        if self.rows > 1:
            offsets = (after["achieved"] - after["desired"]).reshape(self.rows, -1)
            rewards = -np.linalg.norm(offsets, axis=1).astype(float)
        (old, _), (new, near) = (
            self._potential(one["observation"][None]) for one in (before, after)
        )
        rewards = self._with_approach(rewards, old, new, near, np.array([terminated]))
        shown = self._shown(after["achieved"][None]).reshape(self.rows, -1)
        return rewards, shown

    def rewards(self, before: Array, after: Array, terminated: Array) -> Array:
        """The rewards of transitions (N x numbers) for the goals in their observations.

        Only for tasks in which the position of an object is the goal.
        """
        seen = self.entries(after)
        rewards = self.one._compute_reward(seen["object_position"], seen["goal"])
        (old, _), (new, near) = map(self._potential, (before, after))
        return self._with_approach(rewards, old, new, near, terminated)

    def entries(self, observations: Array) -> dict[str, Array]:
        """The entries of flat observations in SI units."""
        return self.one.entries(observations)

    @property
    def flat(self) -> Flat:
        """Where each entry is in a flat observation, and its bounds in SI units."""
        return self.one._flat

    @property
    def hidden(self) -> Array:
        """What simulations know and policies do not (VectorEnvironment.hidden), in each row."""
        return self._repeated("hidden")

    @property
    def final_hidden(self) -> Array:
        """The same of the episodes that have ended."""
        return self._repeated("final_hidden")

    def _repeated(self, name: str) -> Array:
        if not isinstance(self.one, VectorEnvironment):
            raise InvalidArgument(
                "only a VectorEnvironment knows what is hidden: num_envs of 2 or more"
            )
        return np.repeat(getattr(self.one._core, name), self.rows, axis=0)

    def close(self) -> None:
        """Closes the environments."""
        self.environment.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The attribute of the environments, repeated for each index."""
        value = getattr(self.environment, attr_name)
        return [value for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, *_: Any, **__: Any) -> None:
        """Raises AttributeError: rows are not separate environments."""
        raise AttributeError(f"{attr_name} of single rows cannot be set")

    def env_method(self, method_name: str, *_: Any, **__: Any) -> list[Any]:
        """Raises AttributeError: rows are not separate environments."""
        raise AttributeError(f"{method_name} of single rows cannot be called")

    def env_is_wrapped(self, _: Any, indices: Any = None) -> list[bool]:
        """False for each row: nothing is wrapped."""
        return [False for _ in self._get_indices(indices)]

    # Begins episodes by a reset of all environments with these arguments.
    def _begin_next(self, **arguments: Any) -> Array:
        self._lengths[:] = 0
        self._returns[:] = 0
        observations, _ = self.environment.reset(**arguments)
        self._potentials, _ = self._potential(observations)
        self._last_goals = self._goals(observations)
        return self._split(observations)

    # Rewards of the task in their scale, and what the potential has gained. After the end of a task
    # nothing follows, so the potential there is 0.
    def _with_approach(
        self, rewards: Array, before: Array, after: Array, near: Array, terminated: Array
    ) -> Array:
        ending = before if self._gamma == 1.0 else 0.0
        gained = self._gamma * np.where(terminated, ending, after) - before
        return np.asarray(self._reward_scale * rewards + gained + self._kernel * near, np.float32)

    @property
    def _looks_at_objects(self) -> bool:
        return self._approach > 0 or self._kernel > 0

    # The goals as they are observed; no numbers if nobody looks at objects.
    def _goals(self, observations: Array) -> Array:
        return observations[:, self.flat["goal"][0] if self._looks_at_objects else []]

    # The potential of `approach`, and how near the object is to its goal, from 0 to 1. The
    # potential rises as the nearest tip comes nearer to the place from which it would push the
    # object, and twice as much as the object comes nearer to its goal. The place is on the side of
    # the object away from the goal; at the goal, it is the object's middle.
    def _potential(self, observations: Array) -> tuple[Array, Array]:
        if not self._looks_at_objects:
            return np.zeros(len(observations)), np.zeros(len(observations))
        seen = self.entries(observations)
        tips = seen["tip_position"].reshape(len(observations), -1, 3)
        place, goal = seen["object_position"], seen["goal"][:, :3]
        offset = goal - place[:, : goal.shape[1]]
        aside = np.linalg.norm(offset[:, :2], axis=1, keepdims=True)
        behind = place.copy()
        behind[:, :2] -= offset[:, :2] * (PUSHED_FROM / np.maximum(aside, PUSHED_FROM))
        away = np.linalg.norm(tips - behind[:, None], axis=2).min(axis=1)
        left = np.linalg.norm(offset, axis=1)
        if "goal_keypoints" in seen:  # an orientation counts, too
            corners = seen["object_keypoints"] - seen["goal_keypoints"]
            left = np.linalg.norm(corners.reshape(len(left), -1, 3), axis=2).mean(axis=1)
        potential = np.asarray(-self._approach * (away + 2 * left))
        near = 0.8 * np.exp(-((left / 0.02) ** 2)) + 0.2 * np.exp(-left / 0.05)
        return potential, near

    # Achieved positions in the frames in which goals are observed, finger by finger.
    def _shown(self, achieved: Array) -> Array:
        if not self._is_per_finger:
            return achieved
        return turned_to_first(achieved.reshape(len(achieved), -1, 3))

    def _split(self, whole: Array) -> Array:
        return whole.reshape(self.num_envs, -1)


def _of_step(name: str, info: dict[str, Any], ended: Array) -> Array:
    # If an episode has ended, `info` already belongs to the next one.
    values = np.array(info[name])
    if "final_info" in info:
        values[ended] = info["final_info"][name][ended]
    return values


def turned_to_first(points: Array) -> Array:
    """Points (..., fingers, 3), each rotated about z from its finger to finger 0."""
    fingers = points.shape[-2]
    angles = 2 * np.pi * np.arange(fingers) / fingers  # the fingers stand clockwise
    cosine, sine = np.cos(angles), np.sin(angles)
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack([cosine * x - sine * y, sine * x + cosine * y, z], axis=-1)
