# SPDX-License-Identifier: BSD-3-Clause
"""Robots as Markov decision processes: the mappings of the paper, for learning.

A learner wants step(a) to return a state that says all there is to know about the next one. A robot
in real time does not wait for it: y_t is measured at the instant t * period, when a_t begins to
act, so no action depends on the observation of its own step. `StateAugmentation` and
`Approximation` are two ways to close this gap; docs/learning.md says which one to take.

    simulation = trifinger.Simulation()
    with mappings.StateAugmentation(simulation.connect, steps_per_action=10) as robot:
        state = robot.reset()
        while True:
            state = robot.step(policy(state.observation, state.action))
"""

import contextlib
import operator
import types
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Generic, NamedTuple, Self, TypeVar

import numpy as np
import numpy.typing as npt

from trifinger._trifinger import Action, Frontend, Observation
from trifinger.errors import InvalidArgument, RobotStopped

__all__ = [
    "Approximation",
    "AugmentedState",
    "DecisionProcess",
    "StateAugmentation",
    "hold_position",
]


class AugmentedState(NamedTuple):
    """What `StateAugmentation` takes for the state: what is seen, and what is already decided."""

    observation: Observation
    action: Action
    """The action that began to act when `observation` was measured."""


State_co = TypeVar("State_co", covariant=True)


def hold_position(robot: Frontend) -> Action:
    """The action that keeps the pose which the robot has now, as `hold_position` of C++.

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
    """A robot as a Markov decision process: what both mappings have in common.

    `connect` is called by every reset() and returns a front-end in a new session: that of a
    `Simulation`, `lambda: trifinger.connect("sim")`, `lambda: trifinger.replay(log)`. Each action
    acts for `steps_per_action` steps of the robot, the k of the paper. `hold` makes the action a_0
    of a session.

    No step is lost: all k actions are appended, and all observations can be read from `robot`. The
    same program runs with and without real time. In real time an action that comes too late acts
    later, if the robot allows that at all; see `time_index`.

    As a context manager it calls finish() after a clean end of the block and lets go after an
    exception, Ctrl-C included. One thread at a time.
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

        The session before ends behind its last action; where a simulation begins the next one, its
        reset(), place_object() and restore() have said.

        Raises what `connect` raises. After a fault that is RobotStopped until somebody has called
        recover() of `robot`, or trifinger.recover(name).
        """

    @abstractmethod
    def step(self, action: Action) -> State_co:
        """Lets `action` act for its steps, and returns the next state.

        Raises RobotStopped once the session has ended, InvalidArgument for anything but an action
        of this robot, or before reset().
        """

    @property
    def steps_per_action(self) -> int:
        """For how many steps of the robot each action acts."""
        return self._steps_per_action

    @property
    def robot(self) -> Frontend:
        """The front-end of the session: for new actions, statuses, companions, the time between.

        To read observations newer than `time_index` makes the next action acausal.
        """
        if self._robot is None:
            raise InvalidArgument("there is no session yet; call reset() first")
        return self._robot

    @property
    def time_index(self) -> int:
        """The step at which the newest state was measured; -1 before the first reset().

        It grows by `steps_per_action`, and by more if an action came too late and the robot
        repeated the one before.
        """
        return self._time_index

    def finish(self) -> None:
        """Ends the session behind the last action; its series can still be read.

        To be called before a program thinks for longer than its mapping allows: after an episode,
        say. reset() does so, too.
        """
        if self._robot is not None:
            self._robot.finish()

    def close(self) -> None:
        """Lets go of the robot. If the session still runs, it ends ("detached")."""
        robot, self._robot = self._robot, None
        if robot is not None:
            robot.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: types.TracebackType | None,
    ) -> None:
        try:
            if kind is None:
                self.finish()
        finally:
            self.close()

    def _begin(self) -> Action:
        # Ends the session, begins the next one and returns the action that holds the robot.
        before = self._robot
        if before is not None:
            # However it ended, connect() knows whether there may be another one.
            with contextlib.suppress(RobotStopped):
                before.finish()
        # With the old handle in place: if a fault is in the way, recover() needs it.
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
            # Behind the first one: a burst tells its last step only, which says nothing about its
            # first one where the robot did not wait for this program.
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

        y_t does not depend on `action` yet. y_(t + k), of the next state, depends on nothing but
        y_t and `action`, if the observations are Markovian. The next action begins to act at t + k:
        there are k periods to compute it.
        """
        first, _ = self._append(action)
        # A copy: the caller may go on changing its action.
        return AugmentedState(self._observe(first), action.copy())


class Approximation(DecisionProcess[Observation]):
    """The approximate mapping, for many steps per action: the state is an observation alone."""

    def reset(self) -> Observation:
        """Begins a new session with the hold action a_0 for one step, and returns y_0."""
        hold = self._begin()
        return self._observe(self.robot.append_desired_action(hold))

    def step(self, action: Action) -> Observation:
        """Returns y_t, where t is the last of the k steps in which `action` acts.

        Of the k steps since the last state, `action` has acted in k - 1 and the action before in
        one, which is ignored. So with k = 1 a state would not depend on the action that leads to
        it. The next action begins to act at t + 1: there is one period to compute it, whatever k.
        """
        _, last = self._append(action)
        return self._observe(last)
