# SPDX-License-Identifier: BSD-3-Clause
"""What all environments of a task have in common."""

import weakref
from collections.abc import Callable, Mapping
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec

from trifinger import _trifinger
from trifinger.arrays import Array
from trifinger.environments.options import (
    AnyTask,
    Options,
    options_of,
    overrides_of,
    require,
    robot_of,
    task_of,
)
from trifinger.environments.window import Window
from trifinger.errors import InvalidArgument
from trifinger.picture import Painter, View
from trifinger.tasks import Task

Observation = Array | dict[str, Array]
Info = dict[str, Any]
Part = Literal["", "final_"]
Mode = Literal["rgb_array", "human"]
# The configuration of a robot, and what differs from it for a task.
Scene = tuple[str, dict[str, object]]
# Makes the part in C++ of a task, its options and its scene.
MakeCore = Callable[[str | Task, Options, Scene], Any]

MODES: tuple[Mode, ...] = ("rgb_array", "human")

AGE = "image_age"
# Arrays of the part in C++, one row for each simulation. Those of many simulations have all.
ARRAYS = (
    *("observation", "achieved", "desired", "distance", "finger_rewards", "scores"),
    *("reward", "terminated", "truncated", "success", "fault", "object_age", "image_age"),
)
FARTHEST = 10.0  # bound of all coordinates of goals [m]
# The environments of tasks in Python, by the identity of the task, which they keep.
_ENVIRONMENTS: "weakref.WeakValueDictionary[int, TaskEnvironment]" = weakref.WeakValueDictionary()


class TaskEnvironment:
    """A task with its options: spaces, layout of observations, rewards and drawing.

    `make_core` makes the part in C++, for one robot or many. Its arrays end with the same
    dimensions. It needs a task in Python as long as it lives. A copy, also one by pickle, is a new
    environment with the same arguments, in which no episode has begun.
    """

    spec: EnvSpec | None
    _arguments: tuple[tuple[Any, ...], dict[str, Any]]

    def __new__(cls, *arguments: Any, **named: Any) -> Self:
        """Keeps the arguments for copies."""
        self = super().__new__(cls)
        self._arguments = (arguments, named)
        return self

    def __init__(
        self,
        task: AnyTask,
        num_robots: int,
        make_core: MakeCore,
        *,
        options: Options | None,
        config: str | None,
        config_overrides: dict[str, object] | None,
        render_mode: Mode | None,
        view: View | None,
        changes: Mapping[str, Any],
    ) -> None:
        allowed = "'rgb_array' or 'human'"
        require(render_mode in (None, *MODES), "render_mode", render_mode, allowed)
        require(view is None or isinstance(view, View), "view", view, "a View: View(width=640)")
        self.options = options = options_of(task, options, **changes)
        config = robot_of(task, config)
        self.scene: Scene = (config, overrides_of(task, options, config, config_overrides))
        """The configuration of the robot, and what differs from it for this task."""
        known, own = prepared(task, num_robots)
        self._core = core = make_core(known, options, self.scene)
        self.task = task if isinstance(task, str) else task.name
        self._own = own
        if own is not None:
            _ENVIRONMENTS[id(own)] = self
        self.render_mode: str | None = render_mode
        self._view = view or View()
        self._drawing: Painter | Window | None = None
        # Memory that C++ writes: it stays the same as long as `core` lives.
        self._arrays: dict[str, Array] = {
            f"{part}{name}": getattr(core, f"{part}{name}")
            for part in ("", "final_")
            for name in ARRAYS
            if hasattr(core, f"{part}{name}")
        }
        # What is read after each step: each question to C++ takes its time.
        self._score_names: list[str] = core.score_names
        self._has_goals_of_fingers: bool = core.has_goals_of_fingers
        self._tells_age = bool(core.object_name) and options.observation != "images"
        self._oldest_sure_age: int = core.oldest_sure_age
        self._oldest_image_age: int = core.oldest_image_age
        place = {name: index for index, name in enumerate(core.flat_names)}
        self._slices: dict[str, slice] = {}
        self._flat: dict[str, tuple[list[int], Array, Array]] = {}  # places, bounds
        begin = 0
        cameras = {name for name, *_ in core.cameras}
        for name, _, low, high in core.entries:
            if name in cameras:
                raise InvalidArgument(f"an entry of {own!r} is called '{name}', as a camera is")
            self._slices[name] = slice(begin, begin + len(low))
            begin += len(low)
            places = [place[f"{name}[{i}]"] for i in range(len(low))]
            self._flat[name] = (places, np.array(low), np.array(high))

    def __reduce__(self) -> tuple[Any, ...]:
        """What makes a copy: the class and its arguments."""
        arguments, named = self._arguments
        return _made, (type(self), arguments, named), {"spec": self.spec}

    @property
    def episode_actions(self) -> int:
        """Number of actions in an episode that is not terminated early."""
        return int(self._core.episode_actions)

    @property
    def goal_unit(self) -> str:
        """Unit of the numbers of a goal, such as "m" or "m, 1"."""
        return str(self._core.goal[1])

    def entries(self, observations: Array) -> dict[str, Array]:
        """Splits flat observations (..., numbers) into entries (..., its numbers), in SI units.

        With per_finger=True goals are in the frames of their fingers. With observation="goal", pass
        the vector "observation" of the dictionary.
        """
        if self.options.observation in ("dictionary", "images"):
            raise InvalidArgument(
                f'observation is "{self.options.observation}": it has its entries already'
            )
        return {
            name: low + 0.5 * (observations[..., places] + 1.0) * (high - low)
            for name, (places, low, high) in self._flat.items()
        }

    def _observation_space(self) -> spaces.Space[Any]:
        core = self._core
        flat = spaces.Box(-1.0, 1.0, (core.observation.shape[-1],), np.float32)
        if self.options.observation == "flat":
            return flat
        if self.options.observation in ("dictionary", "images"):
            entries: dict[str, spaces.Space[Any]] = {
                name: spaces.Box(np.float32(low), np.float32(high), dtype=np.float32)
                for name, (_, low, high) in self._flat.items()
            }
            for name, height, width in core.cameras:
                entries[name] = spaces.Box(0, 255, (height, width, 3), np.uint8)
            if core.cameras:
                entries[AGE] = spaces.Box(
                    0.0, core.oldest_image_age, (len(core.cameras),), np.float32
                )
            return spaces.Dict(entries)
        goal = spaces.Box(-FARTHEST, FARTHEST, (core.achieved.shape[-1],), np.float64)
        return spaces.Dict({"observation": flat, "achieved_goal": goal, "desired_goal": goal})

    def _action_space(self) -> spaces.Box:
        return spaces.Box(-1.0, 1.0, (self._core.num_joints,), np.float32)

    # Views of the newest arrays, or of those of the `final_` state of episodes, in the form that
    # the options ask for.
    def _views(self, part: Part = "") -> Observation:
        arrays = self._arrays
        observation = arrays[f"{part}observation"]
        if self.options.observation == "flat":
            return observation
        if self.options.observation in ("dictionary", "images"):
            entries = {name: observation[..., place] for name, place in self._slices.items()}
            return entries | self._images(part)
        return {
            "observation": observation,
            "achieved_goal": arrays[f"{part}achieved"],
            "desired_goal": arrays[f"{part}desired"],
        }

    # The images that are observed, with their ages.
    def _images(self, part: Part) -> dict[str, Array]:
        raise NotImplementedError

    # The age of the object's pose that is observed; -1 if it was not found yet [steps].
    def _object_age(self, part: Part) -> Any:
        raise NotImplementedError

    # What single and vector environments tell, as of now or of the `final_` state of episodes.
    def _measures(self, part: Part = "") -> Info:
        arrays = self._arrays
        info: Info = {
            f"{goal}_goal": arrays[f"{part}{goal}"].copy() for goal in ("achieved", "desired")
        }
        scores = arrays[f"{part}scores"]
        info |= {name: scores[..., i].copy() for i, name in enumerate(self._score_names)}
        if self._tells_age:
            age = self._object_age(part)
            info["object_age"] = age
            info["object_is_sure"] = (age >= 0) & (age <= self._oldest_sure_age)
        distance = arrays[f"{part}distance"]
        if not self._has_goals_of_fingers:
            return info | {"distance": distance[..., 0].copy()}
        rewards = arrays[f"{part}finger_rewards"]
        return info | {"distance": distance.copy(), "finger_rewards": rewards.copy()}

    def _compute_reward(
        self, achieved_goal: npt.ArrayLike, desired_goal: npt.ArrayLike, _info: object = None
    ) -> Any:
        """The reward for an achieved goal, or one reward for each row of a batch."""
        goals = (achieved_goal, desired_goal)
        rows = [np.atleast_2d(np.ascontiguousarray(goal, np.float64)) for goal in goals]
        rewards = self._core.compute_reward(*rows)
        return float(rewards[0]) if np.ndim(achieved_goal) == 1 else rewards

    @property
    def _frame_rate(self) -> int:
        return round(self.episode_actions / self.options.duration)

    # Draws a robot in this configuration, and its goal.
    def _draw(self, configuration: Array, goal: Array) -> Any:
        if self._drawing is None:
            mjcf = _trifinger.export_mjcf(*self.scene)
            if self.render_mode == "human":
                instead = 'render_mode="rgb_array"'
                self._drawing = Window(mjcf, self._view, 1 / self._frame_rate, instead)
            else:
                self._drawing = Painter(mjcf, self._view)
        return self._drawing.draw(configuration, self._marks(goal))

    def _require_render_mode(self) -> None:
        if self.render_mode is None:
            raise InvalidArgument(
                'render_mode is None; make the environment with render_mode="rgb_array" or "human"'
            )

    # The centres of the balls that show a goal: none if goals are no places.
    def _marks(self, goal: Array) -> Array:
        if not self.goal_unit.startswith("m"):
            return np.zeros(0)
        if len(goal) % 3 == 0:
            return goal
        return np.append(goal[:2], goal[2:3] if len(goal) > 2 else 0.0)

    def _close_drawing(self) -> None:
        if self._drawing is not None:
            self._drawing.close()
            self._drawing = None


def _made(kind: Any, arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
    return kind(*arguments, **named)


def prepared(task: AnyTask, num_robots: int) -> tuple[str | Task, Task | None]:
    """What C++ takes as a task, and the object if it is one in Python, ready for its robots."""
    known = task_of(task)
    if isinstance(known, str):
        return known, None
    other = _ENVIRONMENTS.get(id(known))
    if other is not None and other._own is known:
        kind = type(known)
        raise InvalidArgument(
            f"this {known!r} serves another environment; make another object, or pass "
            f"'{kind.__module__}:{kind.__qualname__}'"
        )
    known.prepare(num_robots)
    return known, known


def copied(value: Observation, rows: Any = ...) -> Observation:
    """A copy of an observation, or of some rows of it, which C++ does not overwrite."""
    if isinstance(value, dict):
        return {name: part[rows].copy() for name, part in value.items()}
    return np.array(value[rows])


def seed_of(environment: Any) -> int:
    """The seed that Gymnasium has drawn; the last 32 bits of it, because ours are not longer."""
    return int(environment.np_random_seed % 2**32)
