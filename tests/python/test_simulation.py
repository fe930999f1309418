# SPDX-License-Identifier: BSD-3-Clause
"""The simulated robot inside a Python program."""

import gc
import weakref

import pytest
import trifinger
from conftest import diverging_state


def step(simulation: trifinger.Simulation) -> None:
    with simulation.connect() as robot:
        robot.wait_until_time_index(robot.append_desired_action(robot.new_action()) + 1)


def test_a_check_changes_actions_and_is_named_as_the_reason() -> None:
    def only_joint_0(_: trifinger.Element, action: trifinger.Element) -> None:
        action.torque[1:] = 0.0

    with trifinger.simulate(checks=[only_joint_0]) as robot:
        t = robot.append_desired_action(robot.new_action(torque=[0.1] * 9))
        applied = robot.get_applied_action(t)
    assert applied.torque[0] == pytest.approx(0.1)
    assert (applied.torque[1:] == 0.0).all()
    own_check = trifinger.Reason.OWN_CHECK.value
    assert [bool(reasons & own_check) for reasons in applied.reasons] == [False] + [True] * 8


def test_checks_run_in_their_order_and_before_the_robots_own() -> None:
    seen = []

    def first(y: trifinger.Element, action: trifinger.Element) -> None:
        seen.append(y.position.copy())
        action.torque[0] = 0.2

    def second(_: trifinger.Element, action: trifinger.Element) -> None:
        assert action.torque[0] == 0.2
        action.torque[0] = 1e9

    with trifinger.simulate(checks=(first, second)) as robot:
        t = robot.append_desired_action(robot.new_action())
        applied = robot.get_applied_action(t)
        assert (robot.get_observation(t).position == seen[-1]).all()
    assert applied.torque[0] == pytest.approx(0.36)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_check_that_raises_ends_the_session_with_a_fault() -> None:
    def broken(_: trifinger.Element, __: trifinger.Element) -> None:
        raise ValueError("no")

    with (
        pytest.raises(trifinger.RobotStopped, match="threw an exception"),
        trifinger.simulate(checks=[broken]) as robot,
    ):
        robot.get_observation(robot.append_desired_action(robot.new_action()) + 1)


def test_a_check_that_is_no_function_is_refused() -> None:
    with pytest.raises(ValueError, match="a check is a function"):
        trifinger.simulate(checks=[3])  # type: ignore[list-item]


@pytest.mark.parametrize("way", ["simulate", "Simulation", "companion"])
def test_a_robot_that_its_own_check_refers_to_is_collected(way: str) -> None:
    def made() -> weakref.ref[object]:
        known: list[object] = []

        def check(_: trifinger.Element, __: trifinger.Element) -> None:
            assert known is not None

        if way == "simulate":
            robot = trifinger.simulate(checks=[check])
        else:
            simulation = trifinger.Simulation()
            simulation.add_check(check)
            robot = simulation.connect()
            known.append(simulation)
        robot.get_applied_action(robot.append_desired_action(robot.new_action()))
        known.append(robot.companion("object") if way == "companion" else robot)
        return weakref.ref(check)

    check = made()
    gc.collect()
    assert check() is None


def test_a_check_stays_as_long_as_any_handle_of_its_robot() -> None:
    calls = []
    robot = trifinger.simulate(checks=[lambda *_: calls.append(1)])
    for _ in range(3):
        gc.collect()
        robot.get_applied_action(robot.append_desired_action(robot.new_action()))
    assert len(calls) == 3


def test_fault_47_a_warm_motor_shows_in_the_thermal_margin() -> None:
    heat = {"safety.thermal_time": 2, "safety.continuous_torque": 0.3, "objects": []}
    with trifinger.simulate("trifinger_edu", heat) as robot:
        for _ in range(3000):
            t = robot.append_desired_action(robot.new_action(torque=[-1.0] * 9))
        margin = robot.get_applied_actions(0, t + 1)["thermal_margin"]
    assert (margin[0] == 1.0).all()
    assert (margin[-1] < 0.6).all()
    assert (margin >= 0.0).all()
    assert (margin * 256 % 1 == 0).all()


def test_fault_61_a_divergence_leaves_the_state_before() -> None:
    simulation = trifinger.Simulation()
    step(simulation)
    assert simulation.state_before_divergence() == b""

    start = diverging_state()
    simulation.restore(start)
    with pytest.raises(trifinger.RobotStopped, match="the simulation diverged") as raised:
        step(simulation)
    assert raised.value.fault is not None
    assert raised.value.fault.code == "driver"

    # From that state it happens again, in any simulation of this model.
    other = trifinger.Simulation()
    other.restore(simulation.state_before_divergence())
    with pytest.raises(trifinger.RobotStopped, match="the simulation diverged"):
        step(other)
    assert other.state_before_divergence() == simulation.state_before_divergence()
