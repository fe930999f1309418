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
import time
from pathlib import Path
from typing import Any

# This import comes first because its error says what to install.
from trifinger.arrays import Array
from trifinger.environments import Environment, Options

# isort: split
import gymnasium
import numpy as np

from trifinger._trifinger import Recorder, task_names
from trifinger.data_sets.marks import ENDING, Decisions, EpisodeMarks, Mark
from trifinger.errors import InvalidArgument


def make(
    task: str,
    options: str,
    config: str,
    config_overrides: dict[str, object],
    render_mode: Any = None,
) -> Environment:
    """The environment of a recorded episode; `options` are the JSON of its options."""
    return Environment(
        task,
        options=Options.from_json(options),
        config=config,
        config_overrides=config_overrides,
        render_mode=render_mode,
    )


class RecordEpisodes(gymnasium.Wrapper[Any, Array, Any, Array]):
    """Records each episode of an `Environment` with flat observations.

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
        if base.task not in task_names():
            raise InvalidArgument.of_name("task", base.task, task_names())
        self._base = base
        self._sentence = sentence
        config, overrides = base.scene
        self._made = json.dumps(
            {
                "task": base.task,
                "options": base.options.to_json(),
                "config": config,
                "config_overrides": overrides,
            }
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
        self._actions.append(np.clip(np.asarray(action, np.float32), -1, 1).tolist())
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
