# SPDX-License-Identifier: BSD-3-Clause
"""The simulated robot inside a Python program."""

import gc
import math
import re
import signal
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import trifinger
from conftest import diverging_state

pytestmark = pytest.mark.bindings


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
    assert (applied.reasons & own_check > 0).tolist() == [False] + [True] * 8


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


class UnprintableError(Exception):
    """An exception that cannot even say what it is."""

    def __str__(self) -> str:
        raise ValueError


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(
    ("error", "text"),
    [
        (ValueError("too near"), "ValueError: too near"),
        (KeyError(), "KeyError"),
        (UnprintableError(), "UnprintableError"),
        (RuntimeError("two\nlines, \udcff and \0"), r"RuntimeError: two lines, \\udcff and  "),
        (RuntimeError("\N{SNOWMAN}" * 1000), "RuntimeError: \N{SNOWMAN}+\\.\\.\\."),
    ],
)
def test_fault_16_a_check_that_raises_ends_the_session_with_a_fault_and_its_text(
    error: Exception, text: str, tmp_path: Path
) -> None:
    def broken(_: trifinger.Element, __: trifinger.Element) -> None:
        raise error

    text = rf"the driver gave up at step 0: a safety check threw an exception: {text}"
    with (
        pytest.raises(trifinger.RobotStopped, match=rf"robot 'sim' has stopped: {text}$") as raised,
        trifinger.simulate(checks=[broken], record=tmp_path) as robot,
    ):
        robot.get_observation(robot.append_desired_action(robot.new_action()) + 1)
    assert raised.value.fault is not None
    assert raised.value.fault.code == "driver"
    assert re.fullmatch(text, robot_of(tmp_path).fault_text)


def collect_until(is_done: Callable[[], bool]) -> None:
    """Collects garbage: a call does nothing while another thread of the test runner collects."""
    gc.collect()
    while not is_done():
        gc.collect()


def robot_of(folder: Path) -> trifinger.LoggedSession:
    """The session of the only log in a folder, once it is finished."""
    # The simulation is collected, and its recorder with it.
    collect_until(lambda: trifinger.Log(folder).is_finished)
    return trifinger.Log(folder).session()


class Asked(BaseException):
    """An exception that a user's handler of signals may raise."""


@pytest.mark.parametrize("interrupt", [KeyboardInterrupt, SystemExit, Asked, "signal"])
def test_fault_63_ctrl_c_in_a_check_is_an_interrupt_and_no_fault(
    interrupt: type[BaseException] | str, capfd: pytest.CaptureFixture[str]
) -> None:
    is_pressed = False

    def check(_: trifinger.Element, action: trifinger.Element) -> None:
        if not is_pressed:
            return
        action.torque[:] = 0.1
        if isinstance(interrupt, str):
            signal.raise_signal(signal.SIGINT)
        else:
            raise interrupt

    simulation = trifinger.Simulation()
    simulation.add_check(check)
    expected = KeyboardInterrupt if isinstance(interrupt, str) else interrupt
    robot = simulation.connect()
    robot.get_applied_action(robot.append_desired_action(robot.new_action()))
    is_pressed = True
    t = robot.append_desired_action(robot.new_action())
    # The observation would come at the end, but the interrupt of its step is raised at once.
    with pytest.raises(expected) as raised:
        robot.get_observation(t)
    # The traceback shows where Ctrl-C was pressed.
    assert raised.traceback[-1].name == "check"
    assert robot.fault() == trifinger.Fault("detached", 0, 1, needs_recovery=False)
    assert "xception" not in "".join(capfd.readouterr())

    is_pressed = False
    step(simulation)


def test_fault_63_ctrl_c_in_a_check_reaches_who_finishes_or_closes() -> None:
    def check(_: trifinger.Element, __: trifinger.Element) -> None:
        raise KeyboardInterrupt

    simulation = trifinger.Simulation()
    simulation.add_check(check)
    robot = simulation.connect()
    robot.append_desired_action(robot.new_action())
    with pytest.raises(KeyboardInterrupt):
        robot.finish()
    # The interrupt is raised once; later calls get the end of the session.
    with pytest.raises(trifinger.RobotStopped, match=r"let go at step 0 without finish\(\)"):
        robot.finish()
    with pytest.raises(trifinger.RobotStopped, match=r"let go at step 0 without finish\(\)"):
        robot.append_desired_action(robot.new_action())


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
    collect_until(lambda: check() is None)


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

    # Any simulation of this model diverges again from that state.
    other = trifinger.Simulation()
    other.restore(simulation.state_before_divergence())
    with pytest.raises(trifinger.RobotStopped, match="the simulation diverged"):
        step(other)
    assert other.state_before_divergence() == simulation.state_before_divergence()


def test_fault_06_a_rejected_action_says_what_was_not_fit_and_what_is_allowed() -> None:
    robot = trifinger.simulate("trifinger_pro")
    hold = robot.latest_observation().position
    action = robot.new_action(position=hold, position_kd=[0.1, 1.0, 1.0] + [0.1] * 6)
    for _ in range(12):
        t = robot.append_desired_action(action)
    with pytest.raises(trifinger.RobotStopped) as raised:
        robot.get_status(t + 1)
    assert str(raised.value) == (
        "robot 'trifinger-pro' has stopped: 11 actions in a row up to step 11 were not fit to "
        "apply; the last: position_kd of joint 1 (finger_upper_to_middle_joint_0) is 1, "
        "allowed are 0 to 0.5 (max_kd); of the same action 1 more value was not fit"
    )
    # The first of these actions was already marked.
    reasons = trifinger.Reason(int(robot.get_applied_action(0).reasons[1]))
    assert reasons == trifinger.Reason.KD_OUT_OF_BOUNDS


def test_errors_name_the_robot_of_the_configuration(tmp_path: Path) -> None:
    simulation = trifinger.Simulation("finger_pro", {"name": "left"})
    recorder = simulation.record(tmp_path)
    robot = simulation.connect()
    assert robot.session_info().name == "left"
    with pytest.raises(trifinger.ControlHeld, match="robot 'left' is controlled by"):
        simulation.connect()
    robot.append_desired_action(robot.new_action())
    robot.close()
    recorder.stop()
    assert recorder.file is not None
    assert trifinger.Log(recorder.file).session("left").steps == 0


@pytest.mark.parametrize("kept", ["companion", "session", "element"])
def test_fault_19_a_closed_handle_gives_control_back_whatever_else_is_kept(kept: str) -> None:
    simulation = trifinger.Simulation()
    robot = simulation.connect()
    t = robot.append_desired_action(robot.new_action())
    robot.wait_until_time_index(t + 1)
    other: object
    if kept == "companion":
        other = robot.companion("object")
    elif kept == "session":
        other = robot.session_info(), robot.documents()
    else:
        other = robot.get_observation(t).position
    robot.close()
    with simulation.connect() as next_robot:
        assert next_robot.append_desired_action(next_robot.new_action()) == 0
    if kept == "companion":
        assert isinstance(other, trifinger.Frontend)
        assert other.get_latest_at(t) is not None


def wait(simulation: trifinger.Simulation, steps: int) -> None:
    with simulation.connect() as robot:
        hold = robot.new_action(position=robot.latest_observation().position)
        for _ in range(steps):
            robot.get_observation(robot.append_desired_action(hold))


def test_an_object_flies_as_it_was_thrown() -> None:
    simulation = trifinger.Simulation()
    simulation.place_object("cube", [0.0, 0.0, 1.0])
    simulation.set_object_velocity("cube", [0.5, 0.0, 1.0], angular=[0.0, 0.0, 3.0])
    wait(simulation, 100)
    position, orientation = simulation.object_pose("cube")
    assert position == pytest.approx([0.05, 0.0, 1.05], abs=1e-3)
    assert orientation == pytest.approx([math.cos(0.15), 0.0, 0.0, math.sin(0.15)], abs=1e-6)
    linear, angular = simulation.object_velocity("cube")
    assert linear == pytest.approx([0.5, 0.0, 1.0 - 0.981], abs=1e-6)
    assert angular == pytest.approx([0.0, 0.0, 3.0], abs=1e-6)


def test_a_configuration_says_how_objects_move_at_the_start() -> None:
    simulation = trifinger.Simulation(
        overrides={"objects.0.velocity": [0.1, 0, 2], "objects.0.angular_velocity": [1, 2, 3]}
    )
    for _ in range(2):
        linear, angular = simulation.object_velocity("cube")
        assert linear == pytest.approx([0.1, 0.0, 2.0])
        assert angular == pytest.approx([1.0, 2.0, 3.0])
        wait(simulation, 10)
        simulation.reset()


def test_a_robot_as_built_measures_what_is_not_quite_true() -> None:
    built = trifinger.Variation.of("as built", seed=3)
    assert built.homing_error == 0.005
    assert built.backlash == trifinger.Variation.of("as built", seed=3).backlash
    assert built.backlash != trifinger.Variation.of("as built", seed=4).backlash
    assert trifinger.Variation.of("as documented", seed=3).homing_error == 0
    with pytest.raises(trifinger.InvalidArgument, match="'new' is no condition of a robot"):
        trifinger.Variation.of("new", seed=3)

    def seen(variation: trifinger.Variation) -> list[float]:
        simulation = trifinger.Simulation()
        simulation.vary(variation)
        simulation.reset()
        with simulation.connect() as robot:
            return list(robot.latest_observation().position)

    true = seen(trifinger.Variation.of("as documented", seed=3))
    for one, other in zip(seen(built), true, strict=True):
        assert 0 < abs(one - other) <= 0.005


def test_the_friction_of_one_pair_can_vary() -> None:
    def slide(**variation: Any) -> float:
        simulation = trifinger.Simulation()
        simulation.vary(**variation)
        simulation.set_object_velocity("cube", [0.3, 0.0, 0.0])
        wait(simulation, 100)
        return float(simulation.object_pose("cube")[0][0])

    usual = slide()
    assert slide(pair_friction={"tip_object": 0.1}) == pytest.approx(usual)
    assert slide(pair_friction={"object_table": 0.0}) > 1.3 * usual
    assert slide(friction=0.0) > 1.3 * usual
    with pytest.raises(trifinger.InvalidArgument, match="'tip_floor'; there are 'tip_tip'"):
        slide(pair_friction={"tip_floor": 1.0})


def test_joints_can_have_other_rotors_damping_and_friction() -> None:
    def turned(**variation: float) -> float:
        simulation = trifinger.Simulation()
        simulation.vary(**variation)
        with simulation.connect() as robot:
            for _ in range(100):
                t = robot.append_desired_action(robot.new_action(torque=[0.1] * 9))
            start, end = (robot.get_observation(step).position[0] for step in (0, t))
        return float(abs(end - start))

    usual = turned()
    assert turned(rotor_inertia=3.0) < 0.95 * usual
    assert turned(joint_damping=100.0) < 0.9 * usual
    assert turned(joint_friction=0.02) < 0.9 * usual


def test_a_force_pushes_an_object() -> None:
    simulation = trifinger.Simulation()
    with simulation.connect() as robot:
        hold = robot.new_action(position=robot.latest_observation().position)
        simulation.push_object("cube", [1.0, 0.0, 0.0])
        for _ in range(100):
            robot.get_observation(robot.append_desired_action(hold))
        assert simulation.object_pose("cube")[0][0] > 0.01
