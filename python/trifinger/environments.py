# SPDX-License-Identifier: BSD-3-Clause
"""Tasks for learning, as environments of Gymnasium.

    import gymnasium
    import trifinger.environments

    gymnasium.register_envs(trifinger.environments)
    environment = gymnasium.make("TriFinger/Reach-v0")
    observation, info = environment.reset(seed=1)

`Environment` drives a simulation or a real robot, through the mappings of `trifinger.mappings`.
`VectorEnvironment` drives many simulations at once; it is C++ inside and gives the same numbers,
bit for bit. docs/environments.md has the tasks, spaces and options.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt

from trifinger import _trifinger, mappings
from trifinger._trifinger import Frontend, Simulation
from trifinger._trifinger import Observation as Observed
from trifinger.environment_options import OptionFields
from trifinger.errors import InvalidArgument, RobotStopped
from trifinger.extras import sentence
from trifinger.picture import Painter, Sight, View, draw_marks
from trifinger.tasks import Task

try:
    import gymnasium
    from gymnasium import spaces
    from gymnasium.vector import AutoresetMode
    from gymnasium.vector.utils import batch_space
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(sentence("learning", "gymnasium"), name=error.name) from error

__all__ = [
    "TASKS",
    "Environment",
    "GoalEnvironment",
    "Options",
    "VectorEnvironment",
    "policy_metadata",
    "register",
]

Array = npt.NDArray[Any]
Observation = Array | dict[str, Array]
Info = dict[str, Any]

TASKS: tuple[str, ...] = tuple(_trifinger.task_names())

OBJECT = "object"  # the companion with the poses of objects
_MAPPINGS: dict[str, Callable[..., mappings.DecisionProcess[Any]]] = {
    "approximation": mappings.Approximation,
    "state_augmentation": mappings.StateAugmentation,
}
_FARTHEST = 10.0  # bound of all coordinates of goals [m]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options(OptionFields):
    """Settings of an environment; `Options.of(task)` has the defaults of a task.

    A range is (low, high): for each episode, a simulation draws a value from it, uniformly. A
    factor multiplies the value of the configuration.
    """

    @classmethod
    def of(cls, task: str, **changes: Any) -> Self:
        """The defaults of a task, with some changes. Raises InvalidArgument for unknown tasks."""
        return cls.from_json(_trifinger.default_environment_options(task)).changed(**changes)

    def changed(self, **changes: Any) -> Self:
        """A copy with some changes. Raises InvalidArgument for unknown names."""
        names = {field.name for field in dataclasses.fields(self)}
        for name in changes:
            if name not in names:
                raise InvalidArgument.of_name("option", name, names)
        return dataclasses.replace(self, **changes)

    def to_json(self) -> str:
        """The options as JSON, as files of policies hold them."""
        return json.dumps(dataclasses.asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Options from the text that to_json() returned."""

        def of(value: Any) -> Any:
            if isinstance(value, dict):
                return {name: of(part) for name, part in value.items()}
            return tuple(value) if isinstance(value, list) else value

        return cls(**of(json.loads(text)))


def _overrides(
    task: str | Task, options: Options, config_overrides: dict[str, object] | None
) -> dict[str, object]:
    # A session with a short history begins faster.
    needed: dict[str, object] = {"backend.history": 1024}
    own = task if isinstance(task, str) else None
    needed |= _trifinger.environment_overrides(own, options.to_json())
    if isinstance(task, Task):
        needed |= task.config_overrides
    return needed | (config_overrides or {})


def _default_options(task: str | Task, **changes: Any) -> Options:
    if isinstance(task, str):
        return Options.of(task, **changes)
    return Options(**dataclasses.asdict(task.options)).changed(**changes)


def _observation_space(core: Any, options: Options) -> spaces.Space[Any]:
    def box(entry: tuple[str, str, list[float], list[float]]) -> spaces.Box:
        low, high = (np.asarray(bounds, np.float32) for bounds in entry[2:])
        return spaces.Box(low, high, dtype=np.float32)

    flat = spaces.Box(-1.0, 1.0, (core.observation.shape[-1],), np.float32)
    if options.observation == "flat":
        return flat
    if options.observation == "dictionary":
        return spaces.Dict({entry[0]: box(entry) for entry in core.entries})
    goal = spaces.Box(-_FARTHEST, _FARTHEST, (core.achieved.shape[-1],), np.float64)
    return spaces.Dict({"observation": flat, "achieved_goal": goal, "desired_goal": goal})


def _slices(core: Any) -> dict[str, slice]:
    slices, begin = {}, 0
    for name, _, low, _ in core.entries:
        slices[name] = slice(begin, begin + len(low))
        begin += len(low)
    return slices


class _Views:
    """Views of the arrays that C++ writes, in the form that the options ask for."""

    def __init__(self, core: Any, options: Options) -> None:
        self._layout = options.observation
        self._slices = _slices(core)

    def __call__(self, observation: Array, achieved: Array, desired: Array) -> Observation:
        if self._layout == "flat":
            return observation
        if self._layout == "dictionary":
            return {name: observation[..., part] for name, part in self._slices.items()}
        return {"observation": observation, "achieved_goal": achieved, "desired_goal": desired}


class _Entries:
    """Splits flat observations into their entries."""

    def __init__(self, core: Any, options: Options) -> None:
        self._is_flat = options.observation != "dictionary"
        place = {name: index for index, name in enumerate(core.flat_names)}
        self._parts = {
            name: ([place[f"{name}[{i}]"] for i in range(len(low))], np.array(low), np.array(high))
            for name, _, low, high in core.entries
        }

    def __call__(self, observations: Array) -> dict[str, Array]:
        if not self._is_flat:
            raise InvalidArgument('observation is "dictionary": it has its entries already')
        return {
            name: low + 0.5 * (observations[..., places] + 1.0) * (high - low)
            for name, (places, low, high) in self._parts.items()
        }


def _copied(value: Observation) -> Observation:
    if isinstance(value, dict):
        return {name: part.copy() for name, part in value.items()}
    return value.copy()


def _compute_reward(core: Any, achieved: npt.ArrayLike, desired: npt.ArrayLike) -> Any:
    rows = [np.atleast_2d(np.ascontiguousarray(goal, np.float64)) for goal in (achieved, desired)]
    rewards = core.compute_reward(*rows)
    return float(rewards[0]) if np.ndim(achieved) == 1 else rewards


def _seed_of(environment: Any) -> int:
    # Gymnasium draws longer seeds than ours can be; the last 32 bits are used.
    return int(environment.np_random_seed % 2**32)


# The driver's own code of the fault, or -1 for any other fault.
def _code_of(stopped: RobotStopped) -> int:
    fault = stopped.fault
    return fault.detail if fault is not None and fault.code == "driver" else -1


def _observed(state: Any) -> Observed:
    observed: Observed = state.observation if isinstance(state, mappings.AugmentedState) else state
    return observed


class Environment(gymnasium.Env[Any, Array]):
    """A task on one robot: on its own simulation, or on a robot that `connect` attaches to.

    `connect` returns a front-end in a new session: `lambda: trifinger.connect("trifinger-edu")`.
    `config` and `config_overrides` must describe that robot. reset() moves it by actions to where
    the episode begins; objects stay where they are. Noise of joints in `options` is added only in
    the environment's own simulation, never to what a connected robot measures. `view` is the camera
    and the size of what `render` draws; a window starts with it.
    """

    metadata = {"render_modes": ["rgb_array", "human"], "render_fps": 50}  # noqa: RUF012

    def __init__(
        self,
        task: str | Task,
        *,
        options: Options | None = None,
        connect: Callable[[], Frontend] | None = None,
        config: str = "trifinger_edu",
        config_overrides: dict[str, object] | None = None,
        render_mode: Literal["rgb_array", "human"] | None = None,
        view: View | None = None,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise InvalidArgument(f"render_mode is '{render_mode}', must be 'rgb_array' or 'human'")
        self.task = task if isinstance(task, str) else task.name
        self.options = options or _default_options(task)
        if (self.options.observation == "goal") != isinstance(self, GoalEnvironment):
            raise InvalidArgument(
                f'observation is "{self.options.observation}"; GoalEnvironment needs "goal", '
                "Environment any other"
            )
        self.render_mode = render_mode
        overrides = _overrides(task, self.options, config_overrides)
        observed = self.options
        if connect is not None:
            observed = dataclasses.replace(observed, position_noise=0.0, velocity_noise=0.0)
        self._core = _trifinger.Episodes(task, observed.to_json(), config, overrides)
        self._views = _Views(self._core, self.options)
        self._entries = _Entries(self._core, self.options)
        self._object = self._core.object_name
        self._scene = (config, overrides)
        self._simulation = None
        if connect is None:
            self._simulation = Simulation(config, overrides)
            connect = self._simulation.connect
        self._process: mappings.DecisionProcess[Any] = _MAPPINGS[self.options.mapping](
            connect, self.options.steps_per_action
        )
        self.observation_space = _observation_space(self._core, self.options)
        self.action_space = spaces.Box(-1.0, 1.0, (self._core.num_joints,), np.float32)
        self._seed: int | None = None
        self._episode = 0
        self._is_running = False
        self._drawing: Any = None
        self._view = view or View()
        metadata = dict(type(self).metadata)
        metadata["render_fps"] = round(self.episode_actions / self.options.duration)
        self.metadata = metadata

    def __repr__(self) -> str:
        return f"Environment('{self.task}', {self.options})"

    @property
    def simulation(self) -> Simulation | None:
        """The environment's own simulation; None for a connected robot."""
        return self._simulation

    @property
    def process(self) -> mappings.DecisionProcess[Any]:
        """The mapping; `process.robot` is the front-end of the session."""
        return self._process

    @property
    def episode_actions(self) -> int:
        """Number of actions in an episode that is not terminated early."""
        return self._core.episode_actions

    def entries(self, observations: Array) -> dict[str, Array]:
        """Splits flat observations (..., numbers) into entries (..., its numbers), in SI units.

        With per_finger=True goals are in the frames of their fingers. With observation="goal", pass
        the vector "observation" of the dictionary.
        """
        return self._entries(observations)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, Info]:
        """Begins episode 0 of `seed`; without `seed`, the next episode of the last seed.

        If no seed was ever given, one is drawn: `np_random_seed` modulo 2^32. `options` may be
        {"episode": n} to begin episode n instead. Raises what `connect` raises: ControlHeld if
        somebody else controls the robot, RobotStopped if a fault was not yet recovered. The
        environment recovers faults of its own simulation by itself.
        """
        super().reset(seed=seed)
        if seed is not None:
            self._seed, self._episode = seed, 0
        elif self._seed is None:
            self._seed = _seed_of(self)
        if options and "episode" in options:
            self._episode = int(options["episode"])
        self._is_running = False
        position, object_position, orientation, velocity, variation, stream = self._core.begin(
            self._seed, self._episode
        )
        self._episode += 1
        simulation = self._simulation
        if simulation is not None:
            simulation.vary(variation)
            simulation.reset(position, self._seed, stream)
            if self._object:
                simulation.place_object(self._object, object_position, orientation)
                simulation.set_object_velocity(self._object, velocity)
        try:
            state = self._begin_session()
            if simulation is None:
                state = self._move_there(state)
            *_, success = self._look(state)
        except BaseException:
            # A robot that has begun to move must not stay without control.
            self._process.close()
            raise
        self._is_running = True
        if self.render_mode == "human":
            self.render()
        return self._observation(), self._info(is_success=success)

    def _begin_session(self) -> Any:
        try:
            return self._process.reset()
        except RobotStopped:
            if self._simulation is None:
                raise
            self._process.robot.recover()
            return self._process.reset()

    def step(self, action: Array) -> tuple[Observation, float, bool, bool, Info]:
        """Applies `action`; numbers are clipped to -1 to 1.

        A fault of the robot truncates the episode, with the reward of the last observation.
        info["fault"] is the number of the fault, info["fault_text"] says what it is. Raises
        gymnasium.error.ResetNeeded after the end of the episode, InvalidArgument for a wrong shape
        or NaN.
        """
        if not self._is_running:
            raise gymnasium.error.ResetNeeded(
                "the episode has ended, or none has begun: call reset() first"
            )
        numbers = np.ascontiguousarray(action, np.float32)
        if numbers.shape != self.action_space.shape:
            raise InvalidArgument(
                f"the action has shape {numbers.shape}, must have {self.action_space.shape}"
            )
        torque, position = self._core.take_action(numbers)
        robot = self._process.robot
        try:
            state = self._process.step(robot.new_action(torque=torque, position=position))
            reward, terminated, truncated, success = self._look(state)
        except RobotStopped as stopped:
            self._is_running = False
            info = self._info(is_success=False, fault=_code_of(stopped), fault_text=str(stopped))
            return self._observation(), self._last_reward, False, True, info
        if terminated or truncated:
            self._is_running = False
            # Actions that have not acted yet may cause a fault; the episode has ended before it.
            with contextlib.suppress(RobotStopped):
                self._process.finish()
        if self.render_mode == "human":
            self.render()
        return self._observation(), reward, terminated, truncated, self._info(is_success=success)

    def render(self) -> Any:
        """Draws the scene: as an image, height x width x 3, or in a window with mode "human"."""
        if self.render_mode is None:
            raise InvalidArgument(
                'render_mode is None; make the environment with render_mode="rgb_array" or "human"'
            )
        if self._drawing is None:
            if self.render_mode == "human":
                self._drawing = _Window(self._mjcf(), self._view, 1 / self.metadata["render_fps"])
            else:
                self._drawing = Painter(self._mjcf(), is_plain=True, view=self._view)
        goal = self._core.desired
        marks = (
            goal if len(goal) % 3 == 0 else np.append(goal[:2], goal[2:3] if len(goal) > 2 else 0.0)
        )
        return self._drawing.draw(self._configuration(), marks)

    def close(self) -> None:
        """Gives the robot back and closes the drawing."""
        self._is_running = False
        self._process.close()
        if self._drawing is not None:
            self._drawing.close()
            self._drawing = None

    def _look(self, state: Any) -> tuple[float, bool, bool, bool]:
        observation = _observed(state)
        pose = None
        if self._object:
            seen = self._process.robot.companion(OBJECT).get_latest_at(self._process.time_index)
            if seen is None:
                raise InvalidArgument(f"nobody has said where the {self._object} is")
            part = seen[self._object]
            pose = (part["position"], part["orientation"])
        outcome = self._core.observe(observation.position, observation.velocity, pose)
        self._last_reward = outcome[0]
        return outcome

    def _observation(self) -> Observation:
        return _copied(self._views(self._core.observation, self._core.achieved, self._core.desired))

    def _info(self, **more: Any) -> Info:
        core = self._core
        info: Info = {
            "is_success": False,
            "achieved_goal": core.achieved.copy(),
            "desired_goal": core.desired.copy(),
            "fault": 0,
        }
        if self._object:
            info["distance"] = float(core.distance[0])
        else:
            fingers = core.num_joints // 3
            info["distance"] = core.distance[:fingers].copy()
            info["finger_rewards"] = core.finger_rewards[:fingers].copy()
        return info | more

    # Moves a connected robot to where the episode begins.
    def _move_there(self, state: Any) -> Any:
        configuration = self._process.robot.documents().get("configuration.yml")
        if configuration is not None:
            self._core.check_robot(configuration)
        if self._object:
            self._process.robot.companion(OBJECT)  # raises if there is none
        for point in self._core.way(_observed(state).position):
            state = self._process.step(self._process.robot.new_action(position=point))
        return state

    def _mjcf(self) -> str:
        config, overrides = self._scene
        return _trifinger.export_mjcf(config, overrides)

    def _configuration(self) -> Array:
        if self._simulation is not None:
            return np.asarray(self._simulation.configuration())
        robot = self._process.robot
        parts = [np.asarray(robot.latest_observation().position)]
        if self._object:
            pose = robot.companion(OBJECT).latest_observation()[self._object]
            parts += [pose["position"], pose["orientation"]]
        return np.concatenate(parts)


class GoalEnvironment(Environment):
    """The goal-conditioned variant: observations hold the achieved and the desired goal."""

    def __init__(
        self, task: str | Task, *, options: Options | None = None, **arguments: Any
    ) -> None:
        """Takes the arguments of Environment; the options need observation="goal"."""
        super().__init__(
            task, options=options or _default_options(task, observation="goal"), **arguments
        )

    def compute_reward(
        self, achieved_goal: npt.ArrayLike, desired_goal: npt.ArrayLike, _info: object = None
    ) -> Any:
        """The reward for an achieved goal, or one reward for each row of a batch."""
        return _compute_reward(self._core, achieved_goal, desired_goal)


class _Window:
    """A window of MuJoCo's viewer, which shows an episode at real speed."""

    def __init__(self, mjcf: str, view: View, frame_time: float) -> None:
        if sys.platform.startswith("linux") and not (
            os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        ):
            raise InvalidArgument(
                'there is no screen for a window; render_mode="rgb_array" needs none'
            )
        try:
            import mujoco
            import mujoco.viewer
        except ImportError as error:
            raise InvalidArgument(f"{sentence('window', 'glfw')} ({error})") from error
        self._mujoco = mujoco
        self._model = mujoco.MjModel.from_xml_string(mjcf)
        self._data = mujoco.MjData(self._model)
        self._sight = Sight(self._model, view)
        others = threading.enumerate()
        self._viewer = mujoco.viewer.launch_passive(
            self._model, self._data, show_left_ui=False, show_right_ui=False
        )
        with self._viewer.lock():
            begin, camera = self._sight.camera, self._viewer.cam
            camera.type, camera.fixedcamid = begin.type, begin.fixedcamid
            camera.azimuth, camera.elevation = begin.azimuth, begin.elevation
            camera.lookat[:], camera.distance = begin.lookat, begin.distance
        self._threads = [thread for thread in threading.enumerate() if thread not in others]
        self._frame_time = frame_time
        self._next = time.monotonic()

    def draw(self, configuration: Array, marks: Array) -> None:
        with self._viewer.lock():
            self._data.qpos[:] = configuration[: self._model.nq]
            self._mujoco.mj_forward(self._model, self._data)
            self._sight.clear(self._data, self._viewer.cam)
            draw_marks(self._viewer.user_scn, marks)
        self._viewer.sync()
        time.sleep(max(0.0, self._next - time.monotonic()))
        self._next = max(self._next, time.monotonic()) + self._frame_time

    def close(self) -> None:
        self._viewer.close()
        # The viewer does not wait for its thread, which must end before its model is deleted.
        for thread in self._threads:
            thread.join(timeout=5.0)


class VectorEnvironment(gymnasium.vector.VectorEnv[Any, Array, Any]):
    """A task on many simulations at once, in C++ on several threads.

    A simulation with seed s gives the same numbers, bit for bit, as `Environment` with seed s. With
    `copy=False` the next call overwrites the observations: they are the memory that C++ writes.
    """

    def __init__(
        self,
        task: str,
        num_envs: int,
        *,
        options: Options | None = None,
        num_threads: int = 0,
        autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
        copy: bool = True,
        config: str = "trifinger_edu",
        config_overrides: dict[str, object] | None = None,
    ) -> None:
        if not isinstance(task, str):
            raise InvalidArgument(
                "the task is in Python, must be the name of one in C++: docs/environments.md"
            )
        self.task = task
        self.options = options or Options.of(task)
        self.num_envs = num_envs
        self.metadata = {"autoreset_mode": AutoresetMode(autoreset_mode)}
        self.render_mode = None
        overrides = _overrides(task, self.options, config_overrides)
        self._core = _trifinger.EnvironmentBatch(
            task, self.options.to_json(), num_envs, num_threads, config, overrides
        )
        self._mode: str = self.metadata["autoreset_mode"].value
        self._views = _Views(self._core, self.options)
        self._entries = _Entries(self._core, self.options)
        self._copy = copy
        self._has_object = bool(self._core.object_name)
        self._has_begun = False
        self._has_ended = np.zeros(num_envs, bool)
        self.single_observation_space = _observation_space(self._core, self.options)
        self.single_action_space = spaces.Box(-1.0, 1.0, (self._core.num_joints,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def __repr__(self) -> str:
        return f"VectorEnvironment('{self.task}', {self.num_envs}, {self.options})"

    @property
    def episode_actions(self) -> int:
        """Number of actions in an episode that is not terminated early."""
        return self._core.episode_actions

    @property
    def num_threads(self) -> int:
        """Number of threads that step, including the calling thread."""
        return self._core.num_threads

    def entries(self, observations: Array) -> dict[str, Array]:
        """Splits flat observations (..., numbers) into entries (..., its numbers), in SI units.

        With per_finger=True goals are in the frames of their fingers. With observation="goal", pass
        the vector "observation" of the dictionary.
        """
        return self._entries(observations)

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
        options = options or {}
        if seed is None and not self._has_begun:
            seed = _seed_of(self)
        elif isinstance(seed, int):
            super().reset(seed=seed)
        if seed is not None:
            seeds = range(seed, seed + self.num_envs) if isinstance(seed, int) else seed
            if len(seeds) != self.num_envs:
                raise InvalidArgument(
                    f"there are {len(seeds)} seeds for {self.num_envs} simulations"
                )
            episodes = np.broadcast_to(options.get("episode", 0), self.num_envs)
            for index, one in enumerate(seeds):
                if one is not None:
                    self._core.seed(index, one, int(episodes[index]))
        elif "episode" in options:
            raise InvalidArgument('options["episode"] needs a seed, which is missing')
        mask = options.get("reset_mask")
        if mask is not None and not self._has_begun:
            raise InvalidArgument("the first reset must be of all simulations, without reset_mask")
        self._core.reset(mask)
        self._has_begun = True
        self._has_ended[... if mask is None else mask] = False
        return self._observation(), self._info(
            np.ones(self.num_envs, bool) if mask is None else mask
        )

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
        self._core.step(numbers, self._mode)
        core = self._core
        terminated, truncated = core.terminated.astype(bool), core.truncated.astype(bool)
        info = self._info(np.ones(self.num_envs, bool))
        self._has_ended = ended = terminated | truncated
        if self._mode == "SameStep" and ended.any():
            final = self._views(core.final_observation, core.final_achieved, core.final_desired)
            last = np.full(self.num_envs, None, object)
            for index in np.flatnonzero(ended):
                last[index] = (
                    {name: part[index].copy() for name, part in final.items()}
                    if isinstance(final, dict)
                    else final[index].copy()
                )
            info["final_info"] = self._info(ended, "final_")
            info["fault"] = np.where(ended, 0, info["fault"])
            info["final_obs"] = last
            info["_final_obs"] = info["_final_info"] = ended
        return self._observation(), core.reward.copy(), terminated, truncated, info

    def compute_reward(
        self, achieved_goal: npt.ArrayLike, desired_goal: npt.ArrayLike, _info: object = None
    ) -> Any:
        """The reward for an achieved goal, or one reward for each row of a batch."""
        return _compute_reward(self._core, achieved_goal, desired_goal)

    def _observation(self) -> Observation:
        seen = self._views(self._core.observation, self._core.achieved, self._core.desired)
        return _copied(seen) if self._copy else seen

    def _info(self, mask: Array, part: Literal["", "final_"] = "") -> Info:
        core = self._core
        info: Info = {
            "is_success": getattr(core, f"{part}success").astype(bool),
            "achieved_goal": getattr(core, f"{part}achieved").copy(),
            "desired_goal": getattr(core, f"{part}desired").copy(),
            "fault": core.fault.copy(),
        }
        distance = getattr(core, f"{part}distance")
        if self._has_object:
            info["distance"] = distance[:, 0].copy()
        else:
            fingers = core.num_joints // 3
            info["distance"] = distance[:, :fingers].copy()
            info["finger_rewards"] = getattr(core, f"{part}finger_rewards")[:, :fingers].copy()
        return info | {f"_{name}": mask.copy() for name in info}


def policy_metadata(
    task: str,
    options: Options,
    config: str = "trifinger_edu",
    config_overrides: dict[str, object] | None = None,
) -> dict[str, str]:
    """The metadata that `trifinger run-policy` needs in the file of a policy.

    The arguments are those of the `Environment` in which the policy was trained.
    """
    overrides = _overrides(task, options, config_overrides)
    return {
        "task": task,
        "options": options.to_json(),
        "robot": config,
        "configuration": _trifinger.robot_configuration(config, overrides),
    }


def _gymnasium_id(task: str) -> str:
    return f"TriFinger/{''.join(word.capitalize() for word in task.split('_'))}-v0"


# An argument that the class does not have is an option: gymnasium.make(id, steps_per_action=10).
def _with_options(task: str, arguments: dict[str, Any], own: set[str]) -> dict[str, Any]:
    chosen = {name: arguments.pop(name) for name in own & arguments.keys()}
    options = chosen.get("options") or Options.of(task)
    chosen["options"] = options.changed(**arguments)
    return chosen


def _make(task: str, render_mode: Any = None, **arguments: Any) -> Environment:
    own = {"options", "connect", "config", "config_overrides", "view"}
    chosen = _with_options(task, arguments, own)
    kind = GoalEnvironment if chosen["options"].observation == "goal" else Environment
    return kind(task, render_mode=render_mode, **chosen)


def _make_vector(task: str, num_envs: int, **arguments: Any) -> VectorEnvironment:
    own = {"options", "num_threads", "autoreset_mode", "copy", "config", "config_overrides"}
    return VectorEnvironment(task, num_envs, **_with_options(task, arguments, own))


def register() -> None:
    """Makes the tasks known to Gymnasium: "TriFinger/Reach-v0" and so on."""
    import functools

    for task in TASKS:
        name = _gymnasium_id(task)
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point=functools.partial(_make, task),
                vector_entry_point=functools.partial(_make_vector, task),
            )


register()
