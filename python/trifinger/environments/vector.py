# SPDX-License-Identifier: BSD-3-Clause
"""Many simulations of a task at once."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from trifinger import _trifinger
from trifinger.arrays import Array
from trifinger.environments.options import (
    AnyTask,
    Options,
    require,
    reset_options,
    whole_number,
)
from trifinger.environments.reset_states import ResetStates
from trifinger.environments.task_environment import (
    AGE,
    MODES,
    Info,
    Mode,
    Observation,
    Part,
    TaskEnvironment,
    copied,
    seed_of,
)
from trifinger.errors import InvalidArgument
from trifinger.picture import View


class VectorEnvironment(TaskEnvironment, gymnasium.vector.VectorEnv[Any, Array, Any]):
    """A task on many simulations at once, in C++ on several threads.

    `task` is the name of a task, MODULE:CLASS for one in Python, or an object of such a class.
    A simulation with seed s gives the same numbers, bit for bit, as `Environment` with seed s. With
    `copy=False` the next call overwrites the observations: they are the memory that C++ writes.
    `num_threads` is one per processor that this process may use by default (0). With a
    `physics_step` of 0.004 or 0.005 s training takes a quarter of the time, and is a little less
    exact: motors and safety checks take these steps, too. The arguments that `Environment` has,
    too, mean the same.
    """

    _core: _trifinger.EnvironmentBatch
    compute_reward = TaskEnvironment._compute_reward

    def __init__(
        self,
        task: AnyTask,
        num_envs: int,
        *,
        options: Options | None = None,
        num_threads: int = 0,
        physics_step: float = 0.001,
        autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
        copy: bool = True,
        config: str | None = None,
        config_overrides: dict[str, object] | None = None,
        render_mode: Mode | None = None,
        view: View | None = None,
        **changes: Any,
    ) -> None:
        num_envs = whole_number("num_envs", num_envs, 31)
        num_threads = whole_number("num_threads", num_threads, 31)
        require(isinstance(copy, bool), "copy", copy, "True or False")
        is_step = isinstance(physics_step, float) and 0.0 < physics_step <= 1.0
        require(is_step, "physics_step", physics_step, "a positive number of seconds")
        try:
            mode = AutoresetMode(autoreset_mode)
        except ValueError:
            raise InvalidArgument(
                f"autoreset_mode is {autoreset_mode!r}, must be an AutoresetMode, such as "
                "AutoresetMode.SAME_STEP"
            ) from None

        super().__init__(
            task,
            num_envs,
            lambda known, options, scene: _trifinger.EnvironmentBatch(
                known, options.to_json(), num_envs, num_threads, physics_step, *scene
            ),
            options=options,
            config=config,
            config_overrides=config_overrides,
            render_mode=render_mode,
            view=view,
            changes=changes,
        )
        self.num_envs = num_envs
        self.metadata = {
            "autoreset_mode": mode,
            "render_modes": [*MODES],
            "render_fps": self._frame_rate,
        }
        self._mode: str = mode.value
        self._copy = copy
        self._cameras = [name for name, *_ in self._core.cameras]
        self._has_begun = False
        self._has_ended = np.zeros(num_envs, bool)
        self.single_observation_space = self._observation_space()
        self.single_action_space = self._action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def __repr__(self) -> str:
        return f"VectorEnvironment('{self.task}', {self.num_envs}, {self.options})"

    @property
    def hidden(self) -> dict[str, Array]:
        """What simulations know and policies do not, for a critic, in SI units.

        Entries of num_envs rows each: where the object really is, its velocities, and what varies
        from robot to robot.
        """
        return self._split_hidden("")

    @property
    def final_hidden(self) -> dict[str, Array]:
        """The same of episodes that have ended, with AutoresetMode.SAME_STEP."""
        return self._split_hidden("final_")

    def _split_hidden(self, part: Part) -> dict[str, Array]:
        sizes = {name: len(low) for name, _, low, _ in self._core.hidden_entries}
        numbers = getattr(self._core, f"{part}hidden")
        parts = np.split(numbers.copy(), np.cumsum([*sizes.values()])[:-1], axis=1)
        return dict(zip(sizes, parts, strict=True))

    @property
    def num_threads(self) -> int:
        """Number of threads that step, including the calling thread."""
        return self._core.num_threads

    def set_reset_states(self, states: ResetStates, share: float) -> None:
        """Lets a share of the later episodes begin in one of these states, each as likely.

        For trainings. Goals and what varies stay those of the episode. Not for tasks that remember
        where an episode has begun: they remember the start that was drawn. Raises InvalidArgument
        if this robot cannot begin in one of the states, such as a robot from a file with joints
        that no motor drives.
        """
        self._core.set_reset_states(states.position, states.torque, states.object, share)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observation, Info]:
        """Begins an episode in all simulations, or in those of options["reset_mask"].

        Simulation i gets the seed `seed` + i, or entry i of a list. If the first call gives no
        seed, it is drawn: `np_random_seed` modulo 2^32. Later calls without a seed begin the next
        episodes. With a seed, options["episode"] may be the number of the episode, or a list.
        """
        options = reset_options(options)
        if seed is None and not self._has_begun:
            seed = seed_of(self)
        elif isinstance(seed, int | np.integer):
            seed = whole_number("seed", seed, 64)
            super().reset(seed=seed)
        if seed is not None:
            seeds = range(seed, seed + self.num_envs) if isinstance(seed, int) else seed
            self._require_one_for_each("seed", seeds)
            episodes = options.get("episode", 0)
            if np.ndim(episodes) == 0:
                episodes = [episodes] * self.num_envs
            self._require_one_for_each('options["episode"]', episodes)
            for index, one in enumerate(seeds):
                if one is not None:
                    episode = whole_number('options["episode"]', episodes[index], 64)
                    self._core.seed(index, whole_number("seed", one, 64), episode)
        elif "episode" in options:
            raise InvalidArgument('options["episode"] needs a seed, which is missing')
        mask = options.get("reset_mask")
        if mask is not None:
            given, mask = mask, np.asarray(mask)
            is_right = mask.dtype == np.bool_ and mask.ndim == 1
            require(is_right, 'options["reset_mask"]', given, "True or False for each simulation")
        if mask is not None and not self._has_begun:
            raise InvalidArgument("the first reset must be of all simulations, without reset_mask")
        try:
            self._core.reset(mask)
            self._has_begun = True
        finally:
            # Nobody knows how episodes go on that a task in Python could not begin.
            self._has_ended = self._ends()[2]
        if self.render_mode == "human":
            self.render()
        return self._observation(), self._info(
            np.ones(self.num_envs, bool) if mask is None else mask
        )

    def _require_one_for_each(self, name: str, values: Any) -> None:
        is_list = isinstance(values, Sequence | np.ndarray) and not isinstance(values, str)
        require(is_list, name, values, "a whole number, or one for each simulation")
        if len(values) != self.num_envs:
            kind = "seeds" if name == "seed" else "episodes"
            raise InvalidArgument(f"there are {len(values)} {kind} for {self.num_envs} simulations")

    def step(self, actions: Array) -> tuple[Observation, Array, Array, Array, Info]:
        """Applies an action in each simulation: num_envs rows of numbers from -1 to 1.

        With AutoresetMode.SAME_STEP, info["final_obs"] and info["final_info"] hold the last
        observations and the infos of episodes that have ended; the rest of `info` belongs to the
        episodes that begin. With AutoresetMode.DISABLED, ended episodes must be reset before the
        next step.
        """
        if not self._has_begun:
            raise gymnasium.error.ResetNeeded("no episode has begun: call reset() first")
        if self._mode == "Disabled" and self._has_ended.any():
            raise gymnasium.error.ResetNeeded(
                f"the episodes of the simulations {np.flatnonzero(self._has_ended).tolist()} have "
                'ended: reset(options={"reset_mask": ...}) begins others'
            )
        numbers = np.ascontiguousarray(actions, np.float32)
        if numbers.shape != self.action_space.shape:
            raise InvalidArgument(
                f"the actions have shape {numbers.shape}, must have {self.action_space.shape}"
            )
        arrays = self._arrays
        try:
            self._core.step(numbers, self._mode)
        finally:
            # Episodes in which an image could not be drawn have ended, too.
            terminated, truncated, ended = self._ends()
            self._has_ended = ended
        info = self._info(np.ones(self.num_envs, bool))
        if self._mode == "SameStep" and ended.any():
            final = self._views("final_")
            last = np.full(self.num_envs, None, object)
            for index in np.flatnonzero(ended):
                last[index] = copied(final, index)
            info["final_info"] = self._info(ended, "final_")
            info["fault"] = np.where(ended, 0, info["fault"])
            info["final_obs"] = last
            info["_final_obs"] = info["_final_info"] = ended
        if self.render_mode == "human":
            self.render()
        return self._observation(), arrays["reward"].copy(), terminated, truncated, info

    # Which episodes are terminated, truncated, or either.
    def _ends(self) -> tuple[Array, Array, Array]:
        terminated = self._arrays["terminated"].astype(bool)
        truncated = self._arrays["truncated"].astype(bool)
        return terminated, truncated, terminated | truncated

    def render(self) -> Any:
        """Draws all simulations, as a tuple of images, height x width x 3.

        With mode "human", a window shows simulation 0.
        """
        self._require_render_mode()
        if self.render_mode == "human":
            return self._draw_one(0)
        return tuple(map(self._draw_one, range(self.num_envs)))

    def _draw_one(self, index: int) -> Any:
        configuration = np.array(self._core.configuration(index))
        return self._draw(configuration, self._arrays["desired"][index])

    def close_extras(self, **_: Any) -> None:
        """Closes the drawing; close() calls it."""
        self._close_drawing()

    def _observation(self) -> Observation:
        seen = self._views()
        return copied(seen) if self._copy else seen

    def _images(self, part: Part) -> dict[str, Array]:
        if not self._cameras:
            return {}
        images = self._core.final_images if part else self._core.images
        age = self._arrays[f"{part}{AGE}"]
        return dict(zip(self._cameras, images, strict=True)) | {AGE: age}

    def _object_age(self, part: Part) -> Array:
        return self._arrays[f"{part}object_age"].copy()

    def _info(self, mask: Array, part: Part = "") -> Info:
        info = self._measures(part)
        info["is_success"] = self._arrays[f"{part}success"].astype(bool)
        info["fault"] = self._arrays["fault"].copy()
        return info | {f"_{name}": mask.copy() for name in info}
