# SPDX-License-Identifier: BSD-3-Clause
"""Records the episodes of an environment: a log, and marks with what it saw, chose and got.

    environment = RecordEpisodes(Environment("reach"), "logs")
    observation, info = environment.reset(seed=1)
    ...
    environment.close()

`trifinger export minari logs --episodes marks -o trifinger/reach-v0` makes a data set of it.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
import warnings
import weakref
from pathlib import Path
from typing import Any

# This import comes first because its error says what to install.
from trifinger.arrays import Array
from trifinger.environments import Environment, Options

# isort: split
import gymnasium
import numpy as np
from gymnasium.envs.registration import WrapperSpec
from gymnasium.utils import RecordConstructorArgs
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker
from trifinger._trifinger import Recorder, limits_of_file_robot, task_names
from trifinger.errors import InvalidArgument

from trifinger_data_sets.marks import ENDING, Decisions, EpisodeMarks, Mark


def make(
    task: str,
    options: str,
    config: str,
    config_overrides: dict[str, object],
    render_mode: Any = None,
    files: dict[str, str] | None = None,
) -> Environment:
    """The environment of a recorded episode; `options` are the JSON of its options.

    With `files`, texts by their names, `config` is one of them.
    """
    folder: tempfile.TemporaryDirectory[str] | None = None
    if files is not None:
        folder = tempfile.TemporaryDirectory(prefix="trifinger_")
        for name, text in files.items():
            (Path(folder.name) / Path(name).name).write_text(text, encoding="utf-8")
        config = str(Path(folder.name) / Path(config).name)
    environment = Environment(
        task,
        options=Options.from_json(options),
        config=config,
        config_overrides=config_overrides,
        render_mode=render_mode,
    )
    if folder is not None:
        weakref.finalize(environment, folder.cleanup)
    return environment


def is_path(config: str) -> bool:
    """Whether a configuration is a file, not one of those that are found by their names."""
    return "/" in config or config.endswith(".yml")


def wrappers_around(environment: gymnasium.Env[Any, Any]) -> list[WrapperSpec]:
    """What makes the wrappers of an environment again, from the inside to the outside.

    Wrappers that change nothing are left out. Raises InvalidArgument for one that cannot be made
    from its name and JSON.
    """
    base = environment.unwrapped
    found: list[tuple[gymnasium.Wrapper[Any, Any, Any, Any], WrapperSpec]] = []
    around = environment
    while isinstance(around, gymnasium.Wrapper):
        if not isinstance(around, OrderEnforcing | PassiveEnvChecker):
            found.append((around, _spec_of(around)))
        around = around.env
    found.reverse()
    again: Any = _Blank(base.observation_space, base.action_space)
    for wrapper, spec in found:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the user has seen them
                again = type(wrapper)(again, **(spec.kwargs or {}))
            same = (again.observation_space, again.action_space) == (
                wrapper.observation_space,
                wrapper.action_space,
            )
        except Exception as error:
            raise _not_recorded(wrapper, f"making it again fails: {error}") from error
        if not same:
            raise _not_recorded(wrapper, "made again from its arguments it has other spaces")
    return [spec for _, spec in found]


class _Blank(gymnasium.Env[Any, Any]):
    # Spaces without an environment.
    def __init__(self, observation_space: Any, action_space: Any) -> None:
        self.observation_space = observation_space
        self.action_space = action_space


def _spec_of(wrapper: gymnasium.Wrapper[Any, Any, Any, Any]) -> WrapperSpec:
    kind = type(wrapper)
    if hasattr(wrapper, "obs_rms") or hasattr(wrapper, "return_rms"):
        raise _not_recorded(wrapper, "its statistics change with every step")
    if not isinstance(wrapper, RecordConstructorArgs):
        raise _not_recorded(
            wrapper, "it does not say how it was made; gymnasium.utils.RecordConstructorArgs does"
        )
    if kind.__module__ == "__main__" or "." in kind.__qualname__:
        raise _not_recorded(wrapper, "its class cannot be imported by other programs")
    try:
        text = json.dumps(wrapper._saved_kwargs, default=lambda value: value.tolist())
    except (AttributeError, TypeError, ValueError):
        names = ", ".join(wrapper._saved_kwargs)
        raise _not_recorded(wrapper, f"its arguments ({names}) are not all JSON") from None
    return kind.wrapper_spec(**json.loads(text))


def _not_recorded(wrapper: Any, reason: str) -> InvalidArgument:
    name = type(wrapper).__name__
    return InvalidArgument(
        f"a data set cannot say how the wrapper {name} is made: {reason}. Put it around the "
        f"recording instead: {name}(RecordEpisodes(environment, ...), ...)"
    )


class RecordEpisodes(gymnasium.Wrapper[Any, Array, Any, Array]):
    """Records each episode of an `Environment` with flat observations.

    Wrappers inside of the recording belong to what is recorded: a data set names them, so that the
    environment can be recovered. A wrapper that cannot be made from its name and JSON is refused;
    it can be around the recording.

    `folder` gets the marks, and the log if the environment has its own simulation. A connected
    robot is recorded by `trifinger record` or `trifinger run --record`. `sentence` says for people
    and for language models what is to be done.
    """

    def __init__(
        self,
        environment: gymnasium.Env[Any, Array],
        folder: str | os.PathLike[str],
        *,
        sentence: str = "",
    ) -> None:
        super().__init__(environment)
        base = environment.unwrapped
        if not isinstance(base, Environment):
            raise InvalidArgument(
                f"a {type(base).__name__} cannot be recorded; expected is a "
                "trifinger.environments.Environment"
            )
        if base.options.observation != "flat":
            raise InvalidArgument(
                f'observation is "{base.options.observation}"; episodes are recorded with "flat"'
            )
        if ":" not in base.task and base.task not in task_names():
            raise InvalidArgument.of_name("task", base.task, task_names())
        if not isinstance(environment.observation_space, gymnasium.spaces.Box) or not isinstance(
            environment.action_space, gymnasium.spaces.Box
        ):
            raise InvalidArgument(
                f"the wrappers make observations of {environment.observation_space} and actions of "
                f"{environment.action_space}; recorded are arrays of numbers (Box)"
            )
        wrappers = wrappers_around(environment)
        self._base = base
        self._bounds = (environment.action_space.low, environment.action_space.high)
        self._sentence = sentence
        config, overrides = base.scene
        if is_path(config):
            config = str(Path(config).absolute())  # an export may be made in another folder
        self._made = json.dumps(
            {
                "task": base.task,
                "options": base.options.to_json(),
                "config": config,
                "config_overrides": overrides,
            }
            # The robot's file may say them, and the model in the log does not.
            | ({"limits": limits} if (limits := limits_of_file_robot(config, overrides)) else {})
            | ({"wrappers": [vars(one) for one in wrappers]} if wrappers else {})
        )
        name = f"{base.task}_{time.strftime('%Y-%m-%d_%H-%M-%S', time.gmtime())}_{os.getpid()}"
        self._marks = EpisodeMarks(Path(folder) / f"{name}{ENDING}")
        self._recorder: Recorder | None = None
        if base.simulation is not None:
            self._recorder = base.simulation.record(folder)
        self._forget()

    def _forget(self) -> None:
        self._steps: list[int] = []
        self._observations: list[list[float]] = []
        self._actions: list[list[float]] = []
        self._rewards: list[float] = []

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begins an episode. One that has not ended yet is marked as truncated."""
        self._end(terminated=False, success=None)
        observation, info = self.env.reset(seed=seed, options=options)
        self._session = self._base.process.robot.session_info().session_id
        self._seed, self._episode = self._base.episode
        self._see(observation)
        return observation, info

    def step(self, action: Array) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Applies and records an action."""
        step = self.env.step(action)
        observation, reward, terminated, truncated, info = step
        # What the environment has done with it: numbers beyond the bounds are clipped.
        self._actions.append(np.clip(np.asarray(action, np.float32), *self._bounds).tolist())
        self._rewards.append(float(reward))
        self._see(observation)
        if terminated or truncated:
            self._end(terminated=terminated, success=bool(info.get("is_success")))
        return observation, float(reward), terminated, truncated, info

    def close(self) -> None:
        """Marks the last episode, ends the log and closes the environment."""
        self._end(terminated=False, success=None)
        self._marks.close()
        self.env.close()
        if self._recorder is not None:
            self._recorder.stop()
            self._recorder = None

    def _see(self, observation: Array) -> None:
        self._steps.append(self._base.process.time_index)
        self._observations.append(np.asarray(observation, np.float32).tolist())

    def _end(self, *, terminated: bool, success: bool | None) -> None:
        if self._actions and self._steps[-1] > self._steps[0]:
            self._marks.write(
                Mark(
                    session_id=self._session,
                    first=self._steps[0],
                    end=self._steps[-1],
                    task=self._sentence,
                    terminated=terminated,
                    success=success,
                    decisions=Decisions(
                        environment=self._made,
                        seed=self._seed,
                        episode=self._episode,
                        steps=np.array(self._steps),
                        observations=np.array(self._observations),
                        actions=np.array(self._actions),
                        rewards=np.array(self._rewards),
                    ),
                )
            )
        self._forget()
