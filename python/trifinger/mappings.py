# SPDX-License-Identifier: BSD-3-Clause
"""Robots as Markov decision processes: the paper's mappings for learning.

A learner wants step(a) to return a Markovian state: the next state depends only on it and on the
next action. A robot in real time does not wait for the learner. It measures y_t at the instant
t * period, when a_t begins to act, so no action can depend on the observation of its own step.
`StateAugmentation` and `Approximation` are two ways to close this gap; docs/learning.md says which
one to take.

    simulation = trifinger.Simulation()
    with mappings.StateAugmentation(simulation.connect, steps_per_action=10) as robot:
        state = robot.reset()
        while True:
            state = robot.step(policy(state.observation, state.action))
"""

import contextlib
import operator
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Generic, NamedTuple, Self, TypeVar

import numpy as np
import numpy.typing as npt

from trifinger._trifinger import Action, Frontend, Observation
from trifinger.errors import InvalidArgument, RobotStopped


class AugmentedState(NamedTuple):
    """State of `StateAugmentation`: an observation, and the action that was already chosen."""

    observation: Observation
    action: Action
    """The action that began to act when `observation` was measured."""


State_co = TypeVar("State_co", covariant=True)


def hold_position(robot: Frontend) -> Action:
    """The action that keeps the robot in its present pose, like `hold_position` in C++.

    Raises InvalidArgument for a robot without joint positions.
    """
    for dtype in (robot.action_dtype, robot.observation_dtype):
        if "position" not in (dtype.names or ()):
            raise InvalidArgument(
                f"a robot of type '{robot.session_info().type}' has no joint positions to hold; "
                "say how it holds: hold=lambda robot: robot.new_action(...)"
            )
    return robot.new_action(position=robot.latest_observation().position)


class DecisionProcess(ABC, Generic[State_co]):
    """A robot as a Markov decision process: the common base of both mappings.

    Every reset() calls `connect`, which returns a front-end in a new session: the `connect` of a
    `Simulation`, `lambda: trifinger.connect("sim")` or `lambda: trifinger.replay(log)`. Each action
    acts for `steps_per_action` steps of the robot, the k of the paper. `hold` returns the action
    a_0 of a session.

    No step is lost: all k actions are appended, and all observations can be read from `robot`. The
    same program runs with and without real time. In real time, an action that comes too late acts
    later if the robot allows late actions; see `time_index`.

    A `with` block calls close() at its end. Before that it calls finish(), unless an exception or
    Ctrl-C has ended the block. Use an object from one thread at a time.
    """

    def __init__(
        self,
        connect: Callable[[], Frontend],
        steps_per_action: int,
        *,
        hold: Callable[[Frontend], Action] = hold_position,
    ) -> None:
        if not callable(connect):
            raise InvalidArgument(
                f"connect is a {type(connect).__name__}; expected is a function that returns a "
                "front-end in a new session: the `connect` of a Simulation, or "
                "lambda: trifinger.connect(name)"
            )
        self._connect = connect
        self._steps_per_action = operator.index(steps_per_action)
        if self._steps_per_action < 1:
            raise InvalidArgument(f"steps_per_action is {steps_per_action}; allowed are 1 and more")
        self._hold = hold
        self._robot: Frontend | None = None
        self._burst: npt.NDArray[Action] = np.empty(0, Action)
        self._time_index = -1

    @abstractmethod
    def reset(self) -> State_co:
        """Begins a new session, in which the robot holds, and returns the first state.

        The old session ends after its last action. A simulation begins the new one where its
        reset(), place_object() or restore() has put it.

        Raises what `connect` raises. After a fault, this is RobotStopped until somebody has called
        recover() of `robot`, or trifinger.recover(name).
        """

    @abstractmethod
    def step(self, action: Action) -> State_co:
        """Applies `action` for its steps and returns the next state.

        Raises RobotStopped once the session has ended. Raises InvalidArgument before reset(), or if
        `action` is not an action of this robot.
        """

    @property
    def steps_per_action(self) -> int:
        """Number of steps of the robot for which each action acts."""
        return self._steps_per_action

    @property
    def robot(self) -> Frontend:
        """The front-end of the session: for new actions, statuses, companions and other steps.

        Reading an observation newer than `time_index` makes the next action acausal.
        """
        if self._robot is None:
            raise InvalidArgument("there is no session yet; call reset() first")
        return self._robot

    @property
    def time_index(self) -> int:
        """The step at which the newest state was measured; -1 before the first reset().

        It grows by `steps_per_action`. It grows by more if an action came too late and the robot
        repeated the previous one.
        """
        return self._time_index

    def stepped_to(self, time_index: int) -> None:
        """Says that `robot` was given its actions elsewhere, up to a state at `time_index`."""
        self._time_index = time_index

    def finish(self) -> None:
        """Ends the session after the last action; its series can still be read.

        Call it before a computation that takes longer than the mapping allows, such as a learning
        step after an episode. reset() calls it as well.
        """
        if self._robot is not None:
            self._robot.finish()

    def close(self) -> None:
        """Gives the robot back. A session that still runs ends as "detached"."""
        robot, self._robot = self._robot, None
        if robot is not None:
            robot.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None:
                self.finish()
        finally:
            self.close()

    def _begin(self) -> Action:
        # Ends the session, begins the next one and returns the action that holds the robot.
        before = self._robot
        if before is not None:
            # If it ended with a fault, connect() decides whether there may be another session.
            with contextlib.suppress(RobotStopped):
                before.finish()
        # The old handle is still kept: if connect() fails because of a fault, recover() needs it.
        robot = self._connect()
        if robot is before:
            raise InvalidArgument(
                "connect has returned the front-end of the last session; expected is a new one"
            )
        self._robot = robot
        if before is not None:
            before.close()
        self._burst = np.empty(self._steps_per_action - 1, robot.action_dtype)
        return self._hold(robot)

    def _append(self, action: Action) -> tuple[int, int]:
        # Appends the action for all its steps and returns the first and the last of them.
        robot = self.robot
        first = last = robot.append_desired_action(action)
        if len(self._burst) > 0:
            # The first action is appended alone, to know its step. A burst returns only its last
            # step, and in real time its steps need not be successive.
            self._burst[:] = action
            last = robot.append_desired_actions(self._burst)
        return first, last

    def _observe(self, t: int) -> Observation:
        observation = self.robot.get_observation(t)
        self._time_index = t
        return observation


class StateAugmentation(DecisionProcess[AugmentedState]):
    """The exact mapping: the state is an observation and the action that begins to act with it."""

    def __init__(
        self,
        connect: Callable[[], Frontend],
        steps_per_action: int = 1,
        *,
        hold: Callable[[Frontend], Action] = hold_position,
    ) -> None:
        super().__init__(connect, steps_per_action, hold=hold)

    def reset(self) -> AugmentedState:
        """Begins a new session with the hold action a_0 for k steps, and returns (y_0, a_0)."""
        return self.step(self._begin())

    def step(self, action: Action) -> AugmentedState:
        """Returns (y_t, action), where t is the first of the k steps in which `action` acts.

        y_t does not depend on `action` yet. The next state has y_(t + k), which depends only on y_t
        and `action` if the observations are Markovian. The next action begins to act at t + k, so
        there are k periods to compute it.
        """
        first, _ = self._append(action)
        # A copy, because the caller may change its action afterwards.
        return AugmentedState(self._observe(first), action.copy())


class Approximation(DecisionProcess[Observation]):
    """The approximate mapping, for many steps per action: the state is an observation alone."""

    def reset(self) -> Observation:
        """Begins a new session with the hold action a_0 for one step, and returns y_0."""
        hold = self._begin()
        return self._observe(self.robot.append_desired_action(hold))

    def step(self, action: Action) -> Observation:
        """Returns y_t, where t is the last of the k steps in which `action` acts.

        In the k steps since the last state, `action` acted in k - 1 steps and the previous action
        in one; the mapping ignores this one step. With k = 1 a state would not depend on the action
        that leads to it. The next action begins to act at t + 1, so there is one period to compute
        it, for every k.
        """
        _, last = self._append(action)
        return self._observe(last)
