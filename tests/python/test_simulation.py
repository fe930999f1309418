# SPDX-License-Identifier: BSD-3-Clause
"""The simulated robot inside a Python program."""

import pytest
import trifinger
from conftest import diverging_state


def step(simulation: trifinger.Simulation) -> None:
    with simulation.connect() as robot:
        robot.wait_until_time_index(robot.append_desired_action(robot.new_action()) + 1)


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
