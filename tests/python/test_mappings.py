# SPDX-License-Identifier: BSD-3-Clause
"""Robots as Markov decision processes: which actions a state depends on, and how long a policy has.

In this file a_c is the action of cycle c, from the hold action a_0 on, and acts for k steps.
"""

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trifinger
from conftest import Child, StartChild
from test_waits import interrupt_wait, suspend
from trifinger import Status
from trifinger.mappings import (
    Approximation,
    AugmentedState,
    DecisionProcess,
    StateAugmentation,
    hold_position,
)

pytestmark = pytest.mark.bindings

Connect = Callable[[], trifinger.Frontend]
State = AugmentedState | trifinger.Element

FACTORS = (1, 2, 5, 20)
both_mappings = pytest.mark.parametrize("mapping", [StateAugmentation, Approximation])
every_mapping = pytest.mark.parametrize(
    ("mapping", "k"), [(way, k) for way in (StateAugmentation, Approximation) for k in FACTORS]
)


def observation_of(state: State) -> trifinger.Element:
    return state.observation if isinstance(state, AugmentedState) else state


def hold_fake(robot: trifinger.Frontend) -> trifinger.Element:
    return robot.new_action(setpoint=0.0)


def setpoint(robot: DecisionProcess[State], value: float) -> trifinger.Element:
    return robot.robot.new_action(setpoint=value)


def flags_of(robot: DecisionProcess[State]) -> np.ndarray:
    """The flags of all steps that can still be read."""
    return robot.robot.get_statuses(*robot.robot.range("status"))["flags"]


# ---- which actions a state depends on ----


def hold_probe(robot: trifinger.Frontend) -> trifinger.Element:
    return robot.new_action(label=0)


def causes(state: State) -> list[int]:
    """The cycles c whose actions an observation of the probe depends on, step by step."""
    y = observation_of(state)
    known = min(int(y.applied_actions), len(y.labels))
    return [int(label) for label in y.labels[:known][::-1]]


def run_probe(robot: DecisionProcess[State], cycles: int) -> list[State]:
    states = [robot.reset()]
    for c in range(1, cycles):
        states.append(robot.step(robot.robot.new_action(label=c)))
    return states


@pytest.mark.parametrize("k", FACTORS)
def test_an_augmented_state_depends_on_the_state_before_and_its_action(
    start_foreign: StartChild, k: int
) -> None:
    start_foreign("probe", "probe")
    with StateAugmentation(lambda: trifinger.connect("probe"), k, hold=hold_probe) as robot:
        states = run_probe(robot, 6)
        for c, state in enumerate(states):
            assert state.action.label == c
            assert state.observation.applied_actions == c * k
        # Between two observations, only the action in the state acts, k times.
        for c in range(1, 6):
            assert causes(states[c])[-k:] == [c - 1] * k
            assert causes(states[c])[:-k][-20:] == causes(states[c - 1])[-20:]
        assert not np.any(flags_of(robot))


@pytest.mark.parametrize("k", FACTORS)
def test_an_approximate_state_depends_on_the_action_before_through_one_step(
    start_foreign: StartChild, k: int
) -> None:
    start_foreign("probe", "probe")
    with Approximation(lambda: trifinger.connect("probe"), k, hold=hold_probe) as robot:
        states = run_probe(robot, 6)
        for c, state in enumerate(states):
            assert observation_of(state).applied_actions == c * k
        # The mapping ignores the first of the k steps, in which the old action acts.
        for c in range(1, 6):
            assert causes(states[c])[-k:] == [c - 1] + [c] * (k - 1)
            assert causes(states[c])[:-k][-20:] == causes(states[c - 1])[-20:]
        assert not np.any(flags_of(robot))


@every_mapping
def test_an_action_changes_the_states_after_it_and_no_others(
    mapping: type[DecisionProcess[State]], k: int
) -> None:
    cycles = 6
    simulation = trifinger.Simulation("sim", {"objects": []})

    def run(changed: int | None) -> list[State]:
        def action(robot: trifinger.Frontend, c: int) -> trifinger.Element:
            return robot.new_action(torque=0.02 if c == changed else 0.01)

        with mapping(simulation.connect, k, hold=lambda robot: action(robot, 0)) as robot:
            first = robot.reset()
            return [first, *(robot.step(action(robot.robot, c)) for c in range(1, cycles))]

    def observations(states: list[State]) -> list[bytes]:
        return [observation_of(state).tobytes() for state in states]

    def actions_of(states: list[State]) -> list[bytes]:
        return [state.action.tobytes() for state in states if isinstance(state, AugmentedState)]

    before = run(changed=None)
    assert observations(run(changed=None)) == observations(before), "nothing else changes"
    for changed in range(cycles):
        after = run(changed)
        pairs = zip(observations(before), observations(after), strict=True)
        differs = [c for c, (a, b) in enumerate(pairs) if a != b]
        # Augmentation measures y_(c k) when a_c begins to act. Approximation measures it when a_c
        # has acted for k - 1 steps; for c = 0 that is at once.
        is_seen = mapping is Approximation and k > 1 and changed > 0
        first = changed if is_seen else changed + 1
        assert differs == list(range(first, cycles))
        if mapping is StateAugmentation:
            pairs = zip(actions_of(before), actions_of(after), strict=True)
            assert [a == b for a, b in pairs] == [c != changed for c in range(cycles)]


# ---- how long a policy has ----


def periods_to_compute(mapping: type[DecisionProcess[State]], k: int) -> int:
    return k if mapping is StateAugmentation else 1


@every_mapping
@pytest.mark.parametrize("cycles", [1, 2, 4])
def test_a_robot_goes_on_for_as_long_as_its_policy_may_compute(
    mapping: type[DecisionProcess[State]], k: int, cycles: int
) -> None:
    robot = mapping(trifinger.fake, k, hold=hold_fake)
    robot.reset()
    for c in range(1, cycles):
        robot.step(setpoint(robot, c))
    # A wait lets an inline robot take steps, until it needs the next action.
    deadline = robot.time_index + periods_to_compute(mapping, k)
    robot.robot.wait_until_time_index(deadline)
    with pytest.raises(trifinger.ActionMissing):
        robot.robot.wait_until_time_index(deadline + 1)


class Clocked:
    """The front-end of a robot in real time, with a clock that this test moves.

    A wait for an observation moves the clock to the instant of that observation.
    """

    def __init__(self, backend: Child) -> None:
        self.backend = backend
        self.robot = trifinger.connect("probe", strict=True)
        self.eighths_before_burst = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self.robot, name)

    def pass_time(self, eighths: int) -> None:
        """Lets eighths of a period pass, with all that the back-end does in them."""
        for _ in range(eighths):
            self.backend.write_line()
            assert self.backend.read_line() == "done"

    def append_desired_actions(self, actions: np.ndarray) -> int:
        self.pass_time(self.eighths_before_burst)
        return self.robot.append_desired_actions(actions)

    def get_observation(self, t: int) -> trifinger.Element:
        while self.robot.current_time_index() < t:
            self.pass_time(1)
        return self.robot.get_observation(t)


@pytest.fixture
def start_clocked(start_foreign: StartChild) -> Callable[..., tuple[Any, Clocked]]:
    def start(mapping: type[DecisionProcess[State]], k: int) -> tuple[Any, Clocked]:
        clocked = Clocked(start_foreign("probe", "probe", "clocked"))
        return mapping(lambda: clocked, k, hold=hold_probe), clocked  # type: ignore[arg-type, return-value]

    return start


@every_mapping
def test_a_policy_in_time_gives_every_step_its_action(
    start_clocked: Callable[..., tuple[Any, Clocked]], mapping: type[DecisionProcess[State]], k: int
) -> None:
    robot, clocked = start_clocked(mapping, k)
    last_moment = 8 * periods_to_compute(mapping, k) - 1
    robot.reset()
    for c in range(1, 5):
        clocked.pass_time(last_moment if c % 2 else 0)
        robot.step(robot.robot.new_action(label=c))
        assert robot.time_index == c * k
    clocked.pass_time(8 * k)
    labels = robot.robot.get_desired_actions(0, 4 * k)["label"].tolist()
    first = k if mapping is StateAugmentation else 1
    assert labels == ([0] * first + [c for c in range(1, 5) for _ in range(k)])[: 4 * k]
    assert not np.any(robot.robot.get_statuses(0, 4 * k)["flags"])


@every_mapping
@pytest.mark.parametrize("periods_late", [1, 3])
def test_a_policy_that_is_late_is_told_by_the_time_index(
    start_clocked: Callable[..., tuple[Any, Clocked]],
    mapping: type[DecisionProcess[State]],
    k: int,
    periods_late: int,
) -> None:
    robot, clocked = start_clocked(mapping, k)
    robot.reset()
    robot.step(robot.robot.new_action(label=1))
    missed = robot.time_index + periods_to_compute(mapping, k)
    clocked.pass_time(8 * (periods_to_compute(mapping, k) + periods_late - 1))
    robot.step(robot.robot.new_action(label=2))
    assert robot.time_index == 2 * k + periods_late
    robot.step(robot.robot.new_action(label=3))
    assert robot.time_index == 3 * k + periods_late

    statuses = robot.robot.get_statuses(0, robot.time_index)
    repeated = range(missed, missed + periods_late)
    assert np.flatnonzero(statuses["flags"] & Status.ACTION_REPEATED).tolist() == list(repeated)
    assert not np.any(statuses["flags"] & Status.ACAUSAL)
    # After the repeated steps, the late action is applied for all its steps.
    labels = robot.robot.get_desired_actions(0, robot.time_index)["label"].tolist()
    begin = missed + periods_late
    assert labels[begin : begin + k] == [2] * min(k, len(labels) - begin)


@both_mappings
def test_a_program_that_is_held_up_while_it_appends_gets_the_states_that_belong_to_its_actions(
    start_clocked: Callable[..., tuple[Any, Clocked]], mapping: type[DecisionProcess[State]]
) -> None:
    k = 5
    robot, clocked = start_clocked(mapping, k)
    robot.reset()
    clocked.pass_time(8 * periods_to_compute(mapping, k) - 1)
    clocked.eighths_before_burst = 8 * 3
    state = robot.step(robot.robot.new_action(label=1))
    labels = robot.robot.get_desired_actions(0, robot.time_index + 1)["label"].tolist()
    if mapping is StateAugmentation:
        assert labels == [0] * k + [1], "the first step with this action, and none of it seen yet"
        assert 1 not in causes(state)
    else:
        # The action is repeated once for each of the two missed steps.
        assert labels == [0] + [1] * (k + 2)
        assert causes(state) == labels[:-1]


@both_mappings
@pytest.mark.parametrize("k", [1, 10])
@pytest.mark.parametrize("real_time", [True, False])
def test_the_same_program_runs_with_and_without_real_time(
    start_fake: StartChild, mapping: type[DecisionProcess[State]], k: int, real_time: bool
) -> None:
    start_fake("robot", real_time=real_time, max_skipped_ticks=10**6, max_action_repeats=10**6)
    cycles = 50
    seen = [0]
    with mapping(lambda: trifinger.connect("robot", strict=True), k, hold=hold_fake) as robot:
        state = robot.reset()
        for c in range(1, cycles):
            state = robot.step(setpoint(robot, observation_of(state).applied_actions + c))
            seen.append(robot.time_index)
        robot.finish()
        flags = flags_of(robot)
    assert (np.diff(seen) >= k).all()
    if not real_time:
        assert seen == [c * k for c in range(cycles)]
    assert not np.any(flags & Status.ACAUSAL)
    # Each step has its own action, or its flags say that it has none.
    own = np.flatnonzero(flags & (Status.ACTION_REPEATED | Status.END) == 0)
    appended = cycles * k if mapping is StateAugmentation else (cycles - 1) * k + 1
    assert len(own) == appended


# ---- sessions ----


def run_on(robot: DecisionProcess[State], **fields: float) -> None:
    """Repeats one action until the session ends."""
    while True:
        robot.step(robot.robot.new_action(**fields))


@both_mappings
def test_reset_begins_a_simulation_where_it_was_put(mapping: type[DecisionProcess[State]]) -> None:
    simulation = trifinger.Simulation()
    with mapping(simulation.connect, 5) as robot:
        first = observation_of(robot.reset())
        push = robot.robot.new_action(torque=-0.1)
        moved = [observation_of(robot.step(push)).tobytes() for _ in range(5)]
        assert observation_of(robot.reset()).tobytes() == first.tobytes()
        assert robot.time_index == 0
        assert [observation_of(robot.step(push)).tobytes() for _ in range(5)] == moved

        pose = np.array([0.1, 0.9, -1.7] * 3)
        simulation.reset(pose.tolist())
        assert (observation_of(robot.reset()).position == pose).all()
        held = robot.robot.get_desired_action(0)
        for _ in range(20):
            y = observation_of(robot.step(held))
        assert y.position == pytest.approx(pose, abs=0.05)


@both_mappings
def test_the_first_state_is_that_of_step_0_with_the_hold_action(
    mapping: type[DecisionProcess[State]],
) -> None:
    simulation = trifinger.Simulation()
    start = simulation.connect().latest_observation()
    with mapping(simulation.connect, 3) as robot:
        state = robot.reset()
        assert robot.time_index == 0
        assert observation_of(state).tobytes() == start.tobytes()
        held = hold_position(robot.robot)
        assert robot.robot.get_observation(0).tobytes() == start.tobytes()
        if isinstance(state, AugmentedState):
            assert state.action.tobytes() == held.tobytes()
        robot.finish()
        actions = robot.robot.get_desired_actions(*robot.robot.range("desired_action"))
    count = 3 if mapping is StateAugmentation else 1
    assert [a.tobytes() for a in actions] == [held.tobytes()] * count


@both_mappings
def test_reset_finishes_the_session_of_a_connected_robot_and_begins_the_next(
    start_fake: StartChild, mapping: type[DecisionProcess[State]]
) -> None:
    start_fake("robot")
    k = 4
    with mapping(lambda: trifinger.connect("robot"), k, hold=hold_fake) as robot:
        sessions = set()
        for _ in range(3):
            robot.reset()
            observer = trifinger.observe("robot")
            sessions.add(observer.session_info().session_id)
            for c in range(1, 4):
                robot.step(setpoint(robot, c))
            appended = 4 * k if mapping is StateAugmentation else 3 * k + 1
            robot.finish()
            robot.finish()
            assert observer.fault() == trifinger.Fault("finished", time_index=appended)
            assert observer.range("applied_action") == (0, appended), "no action is lost"
        assert len(sessions) == 3


@both_mappings
def test_a_log_is_played_again_by_every_reset(
    tmp_path: Path, mapping: type[DecisionProcess[State]]
) -> None:
    k = 5
    simulation = trifinger.Simulation()

    def run(robot: DecisionProcess[State]) -> list[bytes]:
        states = [robot.reset()]
        push = robot.robot.new_action(torque=-0.05)
        states.extend(robot.step(push) for _ in range(10))
        return [observation_of(state).tobytes() for state in states]

    with simulation.record(tmp_path), mapping(simulation.connect, k) as robot:
        seen = run(robot)
    log = trifinger.Log(tmp_path).session()
    robot = mapping(lambda: trifinger.replay(log), k)
    for _ in range(2):
        assert run(robot) == seen
        assert not np.any(flags_of(robot)), "the actions are those of the log, too"
    with pytest.raises(trifinger.RobotStopped, match="log") as stopped:
        run_on(robot)
    assert stopped.value.fault is not None
    assert stopped.value.fault.code == "exhausted"
    assert run(robot) == seen


@both_mappings
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_fault_stays_until_somebody_recovers_the_robot(
    mapping: type[DecisionProcess[State]],
) -> None:
    simulation = trifinger.Simulation("sim", {"objects": []})

    def fail(_: trifinger.Element, action: trifinger.Element) -> None:
        if action.torque[0] == 0.25:
            raise ValueError

    simulation.add_check(fail)
    robot = mapping(simulation.connect, 2)
    robot.reset()
    with pytest.raises(trifinger.RobotStopped, match="threw an exception"):
        run_on(robot, torque=0.25)
    for _ in range(2):
        with pytest.raises(trifinger.RobotStopped, match=r"with recover\(\)"):
            robot.reset()
    robot.robot.recover()
    robot.reset()
    robot.step(robot.robot.new_action())
    assert robot.time_index == 2


@both_mappings
def test_a_block_finishes_or_lets_go(
    start_fake: StartChild, mapping: type[DecisionProcess[State]]
) -> None:
    start_fake("robot")

    def connect() -> trifinger.Frontend:
        return trifinger.connect("robot")

    with mapping(connect, 2, hold=hold_fake) as robot:
        robot.reset()
        first = trifinger.observe("robot")
    appended = 2 if mapping is StateAugmentation else 1
    assert first.fault() == trifinger.Fault("finished", time_index=appended)

    def fail() -> None:
        with mapping(connect, 2, hold=hold_fake) as robot:
            robot.reset()
            observers.append(trifinger.observe("robot"))
            raise KeyError

    observers: list[trifinger.Frontend] = []
    with pytest.raises(KeyError):
        fail()
    with pytest.raises(trifinger.RobotStopped, match=r"let go at step \d without finish\(\)"):
        observers[0].get_observation(9)

    # Without reset() there is no session to finish or to give back.
    with mapping(connect, 2, hold=hold_fake):
        pass
    robot.close()
    robot.close()
    robot.reset()


def test_reset_after_letting_go_begins_anew() -> None:
    robot = StateAugmentation(trifinger.fake, hold=hold_fake)
    for _ in range(2):
        robot.reset()
        robot.step(setpoint(robot, 1.0))
        robot.close()


INTERRUPTED = """
import trifinger
from trifinger.mappings import {mapping}
try:
    with {mapping}(
        lambda: trifinger.connect("robot"), 3, hold=lambda robot: robot.new_action()
    ) as robot:
        robot.reset()
        print("ready", flush=True)
        while True:
            robot.step(robot.robot.new_action())
except KeyboardInterrupt:
    print("interrupted")
"""


@both_mappings
def test_ctrl_c_ends_a_step_and_lets_go_of_the_robot(
    start_fake: StartChild, start_python: StartChild, mapping: type[DecisionProcess[State]]
) -> None:
    backend = start_fake("robot")
    observer = trifinger.observe("robot")
    child = start_python(INTERRUPTED.format(mapping=mapping.__name__))
    suspend(backend)
    interrupt_wait(child)
    assert child.finish() == (0, "interrupted\n")
    os.kill(backend.pid, signal.SIGCONT)
    with pytest.raises(trifinger.RobotStopped, match=r"let go at step \d+ without finish\(\)"):
        observer.get_observation(10**9)


# ---- what a user may get wrong ----


@both_mappings
def test_a_state_does_not_change_when_its_action_is_used_again(
    mapping: type[DecisionProcess[State]],
) -> None:
    robot = mapping(trifinger.fake, 2, hold=hold_fake)
    robot.reset()
    action = setpoint(robot, 1.0)
    states = []
    for value in (1.0, 2.0, 3.0):
        action.setpoint = value
        states.append(robot.step(action))
    for value, state in zip((1.0, 2.0, 3.0), states, strict=True):
        if isinstance(state, AugmentedState):
            assert state.action.setpoint == value
        else:
            assert state.setpoint == value


@pytest.mark.parametrize("k", [0, -1])
@both_mappings
def test_an_action_acts_for_one_step_at_least(
    mapping: type[DecisionProcess[State]], k: int
) -> None:
    with pytest.raises(trifinger.InvalidArgument, match=f"steps_per_action is {k}; allowed are 1"):
        mapping(trifinger.fake, k)


@both_mappings
def test_a_part_of_a_step_is_refused(mapping: type[DecisionProcess[State]]) -> None:
    with pytest.raises(TypeError, match="integer"):
        mapping(trifinger.fake, 2.5)  # type: ignore[arg-type]


@both_mappings
def test_a_front_end_in_place_of_a_function_is_refused(
    mapping: type[DecisionProcess[State]], robot: trifinger.Frontend
) -> None:
    with pytest.raises(trifinger.InvalidArgument, match="is a Frontend; expected is a function"):
        mapping(robot, 2)  # type: ignore[arg-type]
    one = mapping(lambda: robot, 2, hold=hold_fake)
    one.reset()
    with pytest.raises(trifinger.InvalidArgument, match="front-end of the last session"):
        one.reset()


@both_mappings
def test_a_step_before_the_first_reset_is_refused(mapping: type[DecisionProcess[State]]) -> None:
    robot = mapping(trifinger.fake, 2)
    assert robot.time_index == -1
    for call in (lambda: robot.step(trifinger.fake().new_action()), lambda: robot.robot):
        with pytest.raises(trifinger.InvalidArgument, match=r"call reset\(\) first"):
            call()


@both_mappings
def test_anything_but_an_action_of_the_robot_is_refused(
    mapping: type[DecisionProcess[State]],
) -> None:
    robot = mapping(trifinger.fake, 2, hold=hold_fake)
    robot.reset()
    wrong: tuple[Any, ...] = (1.0, None, robot.robot.latest_observation())
    t = robot.time_index
    for action in wrong:
        with pytest.raises(trifinger.InvalidArgument, match="expected is dtype"):
            robot.step(action)
    with pytest.raises(trifinger.InvalidArgument, match="is NaN"):
        robot.step(setpoint(robot, np.nan))
    robot.step(setpoint(robot, 1.0))
    assert robot.time_index == t + 2, "nothing of it was appended"


def test_a_robot_without_joints_must_be_told_how_it_holds() -> None:
    with pytest.raises(
        trifinger.InvalidArgument, match=r"type 'fake' has no joint positions.*hold=lambda robot"
    ):
        StateAugmentation(trifinger.fake).reset()


@both_mappings
def test_a_killed_back_end_ends_a_step(
    start_fake: StartChild, mapping: type[DecisionProcess[State]]
) -> None:
    child = start_fake("robot")
    robot = mapping(lambda: trifinger.connect("robot"), 2, hold=hold_fake)
    robot.reset()
    child.kill()
    with pytest.raises(trifinger.RobotStopped, match="the back-end died"):
        run_on(robot, setpoint=1.0)
    with pytest.raises(trifinger.SessionNotFound, match="start it again"):
        robot.reset()
