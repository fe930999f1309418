# SPDX-License-Identifier: BSD-3-Clause
"""Elements as NumPy shows them, and values that are refused as actions."""

import pickle
import re
import sys
from collections.abc import Callable

import numpy as np
import pytest
import trifinger
from conftest import StartChild
from hypothesis import HealthCheck, given, settings, strategies as st

pytestmark = pytest.mark.bindings

NOT_ACTIONS: dict[str, Callable[[trifinger.Frontend], object]] = {
    "a number": lambda _: 1.0,
    "nothing": lambda _: None,
    "a tuple": lambda _: (1.0,),
    "a dict": lambda _: {"setpoint": 1.0},
    "an array of numbers": lambda _: np.zeros(1),
    "an observation": lambda robot: robot.latest_observation(),
    "another width": lambda _: np.zeros((), [("setpoint", "f4")])[()],
    "another name": lambda _: np.zeros((), [("position", "f8")])[()],
    "another byte order": lambda _: np.zeros((), [("setpoint", ">f8")])[()],
    "another type of the same size": lambda _: np.zeros((), [("setpoint", "i8")])[()],
    "a field more": lambda _: np.zeros((), [("setpoint", "f8"), ("more", "f8")])[()],
    "a gap": lambda _: np.zeros(
        (), {"names": ["setpoint"], "formats": ["f8"], "offsets": [8], "itemsize": 16}
    )[()],
    "many": lambda robot: np.zeros(2, robot.action_dtype),
    "an array of one": lambda robot: np.zeros(1, robot.action_dtype),
    "raw bytes": lambda _: np.zeros((), "V8")[()],
}

NOT_BURSTS: dict[str, Callable[[trifinger.Frontend], object]] = {
    "one action": lambda robot: robot.new_action(),
    "a list of actions": lambda robot: [robot.new_action()],
    "two dimensions": lambda robot: np.zeros((2, 2), robot.action_dtype),
    "no dimension": lambda robot: np.zeros((), robot.action_dtype),
    "no action": lambda robot: np.zeros(0, robot.action_dtype),
    "numbers": lambda _: np.zeros(3),
    "observations": lambda robot: np.zeros(3, robot.observation_dtype),
}


@pytest.mark.parametrize("kind", NOT_ACTIONS)
def test_fault_09_only_an_action_of_the_robot_is_appended(
    robot: trifinger.Frontend, kind: str
) -> None:
    with pytest.raises(trifinger.InvalidArgument):
        robot.append_desired_action(NOT_ACTIONS[kind](robot))  # type: ignore[arg-type]
    assert robot.session_info().phase == "holding", "nothing has reached the robot"
    assert robot.append_desired_action(robot.new_action()) == 0


@pytest.mark.parametrize("kind", NOT_BURSTS)
def test_only_actions_of_the_robot_are_a_burst(robot: trifinger.Frontend, kind: str) -> None:
    with pytest.raises(trifinger.InvalidArgument):
        robot.append_desired_actions(NOT_BURSTS[kind](robot))  # type: ignore[arg-type]
    assert robot.append_desired_action(robot.new_action()) == 0


def test_fault_09_a_wrong_dtype_is_named_beside_the_right_one(robot: trifinger.Frontend) -> None:
    with pytest.raises(ValueError, match=r"float32.*expected.*'setpoint', '<f8'"):
        robot.append_desired_action(np.float32(3))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"'setpoint', '<f4'.*expected.*'setpoint', '<f8'"):
        robot.append_desired_actions(np.zeros(3, [("setpoint", "f4")]))


def test_fault_09_a_wrong_shape_is_named_beside_the_right_one(robot: trifinger.Frontend) -> None:
    with pytest.raises(ValueError, match=r"shape \(2, 3\); expected is one dimension"):
        robot.append_desired_actions(np.zeros((2, 3), robot.action_dtype))


@pytest.mark.parametrize(
    "make",
    [
        lambda robot: robot.new_action(setpoint=3.0),
        lambda robot: np.array((3.0,), robot.action_dtype),
        lambda robot: np.array([(3.0,)], robot.action_dtype)[0],
        lambda _: np.array((3.0,), [("setpoint", "f8")])[()],
        lambda robot: pickle.loads(pickle.dumps(robot.new_action(setpoint=3.0))),  # noqa: S301
        lambda robot: robot.new_action(setpoint=3.0).copy(),
    ],
)
def test_whatever_has_the_dtype_of_an_action_is_one(
    robot: trifinger.Frontend, make: Callable[[trifinger.Frontend], np.record]
) -> None:
    robot.append_desired_action(make(robot))
    robot.wait_until_time_index(0)
    assert robot.get_desired_action(0).setpoint == 3.0


def test_an_action_can_be_changed_and_appended_again(robot: trifinger.Frontend) -> None:
    action = robot.new_action()
    for setpoint in (1.0, 2.0):
        action["setpoint"] = setpoint
        robot.append_desired_action(action)
    action.setpoint = 3.0
    robot.append_desired_action(action)
    robot.finish()
    assert robot.get_desired_actions(0, 3)["setpoint"].tolist() == [1.0, 2.0, 3.0]


def test_an_unknown_field_is_an_error_with_a_suggestion(robot: trifinger.Frontend) -> None:
    with pytest.raises(trifinger.InvalidArgument, match=r"'setpont'.*Did you mean 'setpoint'\?"):
        robot.new_action(setpont=1.0)
    with pytest.raises(trifinger.InvalidArgument, match=r"'zzz'; its fields are setpoint$"):
        robot.new_action(zzz=1.0)


@pytest.mark.parametrize("value", ["x", {}, 1j])
def test_what_a_field_cannot_hold_is_an_error(robot: trifinger.Frontend, value: object) -> None:
    with pytest.raises(trifinger.InvalidArgument, match="field 'setpoint' holds float64"):
        robot.new_action(setpoint=value)  # type: ignore[arg-type]


def test_a_field_of_another_length_is_refused_with_both_lengths(
    robot: trifinger.Frontend,
) -> None:
    with pytest.raises(
        trifinger.InvalidArgument, match=r"^field 'setpoint' has one number; given are 2 numbers$"
    ):
        robot.new_action(setpoint=[1.0, 2.0])
    with trifinger.simulate() as simulated:
        action = simulated.new_action()
        for value, given in (
            ([0.1] * 8, "8 numbers"),
            (np.zeros((3, 3)), r"numbers of the shape \(3, 3\)"),
            ([[0.1], [0.1, 0.2]], "lists of several lengths"),
        ):
            said = rf"^field 'torque' has 9 numbers; given are {given}$"
            with pytest.raises(trifinger.InvalidArgument, match=said):
                simulated.new_action(torque=value)
            with pytest.raises(trifinger.InvalidArgument, match=said):
                action.torque = value
        with pytest.raises(ValueError, match="could not convert string to float"):
            action.torque = "x"
        action.torque = 0.1
        assert action.torque.tolist() == [0.1] * 9


def test_fault_06_nan_is_refused_where_it_does_not_stand_for_not_given(
    robot: trifinger.Frontend,
) -> None:
    with pytest.raises(trifinger.InvalidArgument, match="number 0 of field 'setpoint' is NaN"):
        robot.append_desired_action(robot.new_action(setpoint=np.nan))
    burst = np.zeros(3, robot.action_dtype)
    burst["setpoint"][2] = np.nan
    with pytest.raises(trifinger.InvalidArgument, match="NaN"):
        robot.append_desired_actions(burst)
    assert robot.session_info().phase == "holding", "not even the first two have been appended"


@given(st.floats(allow_nan=False))
def test_fault_10_every_other_number_arrives_bit_for_bit(setpoint: float) -> None:
    robot = trifinger.fake()
    robot.append_desired_action(robot.new_action(setpoint=setpoint))
    robot.wait_until_time_index(0)
    assert robot.get_desired_action(0).setpoint.tobytes() == np.float64(setpoint).tobytes()


def test_elements_are_independent_copies(robot: trifinger.Frontend) -> None:
    robot.append_desired_action(robot.new_action(setpoint=1.0))
    robot.wait_until_time_index(0)
    first = robot.get_desired_action(0)
    first.setpoint = 5.0
    assert first.setpoint == 5.0
    assert robot.get_desired_action(0).setpoint == 1.0


def test_a_field_is_an_attribute_even_if_numpy_has_one_of_that_name(
    robot: trifinger.Frontend,
) -> None:
    robot.append_desired_action(robot.new_action())
    robot.wait_until_time_index(0)
    status = robot.get_status(0)
    assert np.void.flags.__get__(status) is not None, "every record has this one"
    assert status.flags == status["flags"] == 0
    status.flags = 3
    assert status["flags"] == 3


def test_a_misspelt_attribute_is_an_error(robot: trifinger.Frontend) -> None:
    action = robot.new_action()
    with pytest.raises(AttributeError, match="setpont"):
        action.setpont = 1.0
    with pytest.raises(AttributeError, match="setpont"):
        _ = action.setpont


def test_elements_of_arrays_are_elements(robot: trifinger.Frontend) -> None:
    robot.append_desired_action(robot.new_action(setpoint=4.0))
    robot.wait_until_time_index(0)
    assert type(robot.get_desired_actions(0, 1)[0]) is trifinger.Action
    assert robot.get_desired_actions(0, 1)[0].setpoint == 4.0


def test_elements_survive_a_trip_to_another_process(robot: trifinger.Frontend) -> None:
    action = pickle.loads(pickle.dumps(robot.new_action(setpoint=4.0)))  # noqa: S301
    assert type(action) is trifinger.Action
    assert isinstance(action, trifinger.Element)
    assert action.dtype == robot.action_dtype
    assert action.setpoint == 4.0


# ---- printed ----


def test_an_element_prints_with_its_fields_and_units() -> None:
    with trifinger.simulate() as robot:
        action = robot.new_action(torque=np.arange(9) / 8)
        t = robot.append_desired_action(action)
        y = robot.get_observation(t)
        assert repr(y) == (
            "Observation(\n"
            "  position=[0 0.9 -1.7 0 0.9 -1.7 0 0.9 -1.7] rad,\n"
            "  velocity=[0 0 0 0 0 0 0 0 0] rad/s,\n"
            "  torque=[0 0 0 0 0 0 0 0 0] Nm,\n"
            f"  tip_force=[{' '.join(f'{force:.5g}' for force in y.tip_force)}] N,\n"
            ")"
        )
        assert str(y) == repr(y) == f"{y}"
        assert "torque=[0 0.125 0.25 0.375 0.5 0.625 0.75 0.875 1] Nm" in repr(action)
        assert "position=[nan nan nan" in repr(action)
        robot.append_desired_action(action)
        applied = robot.get_applied_action(0)
        assert re.match(r"AppliedAction\(\n  torque=\[.*\] Nm,\n", repr(applied))
        status = repr(robot.get_status(0))
        assert re.match(r"StatusElement\(\n  time=\d+ ns,\n  tick=0,\n  lateness=0 ns,\n", status)
        cube = robot.companion("object").get_latest_at(0)
        text = repr(cube)
        assert re.search(r"stamp\.capture_time=-?\d+ ns", text)
        assert re.search(r"cube\.position=\[\S+ \S+ \S+\] m", text)
        assert repr(cube.stamp).startswith("Element(\n  arrival_index=")
        assert f"stamp.capture_time={cube.stamp.capture_time} ns" in text


def test_a_short_element_is_one_line(robot: trifinger.Frontend) -> None:
    assert repr(robot.new_action(setpoint=1.5)) == "Action(setpoint=1.5)"


def test_what_is_not_an_element_of_a_robot_prints_too() -> None:
    wide = np.zeros((), np.dtype((trifinger.Element, [("a", "u1", (300, 200)), ("b", "f4")])))
    assert repr(wide[()]) == "Element(a=[0 0 0 ... 0 0 0] (300, 200), b=0)"
    assert (
        repr(np.zeros((), np.dtype((trifinger.Element, [("text", "U5")])))[()]) == "Element(text=)"
    )
    assert repr(np.empty(0, trifinger.Element).dtype)


def test_an_element_prints_whatever_goes_wrong(
    robot: trifinger.Frontend, monkeypatch: pytest.MonkeyPatch
) -> None:
    action = robot.new_action()
    monkeypatch.setattr("trifinger.element_text.text_of", lambda _: 1 / 0)
    assert repr(action) == "<Element>"
    monkeypatch.setitem(sys.modules, "trifinger.element_text", None)
    assert repr(action) == "<Element>"


# ---- robots that Python has never heard of ----


def test_a_robot_never_seen_is_described_by_its_session(start_foreign: StartChild) -> None:
    start_foreign("odd", "odd")
    robot = trifinger.observe("odd")
    assert robot.session_info().type == "odd"
    assert robot.action_dtype == np.dtype([("speed", "f4", 2), ("gear", "i1", 2), ("colour", "u2")])
    assert robot.applied_action_dtype == np.dtype([("gear", "i1", 2), ("was_clipped", "u1")])
    wheel = [("angle", "f4"), ("speed", "f4")]
    assert robot.observation_dtype == np.dtype(
        [("left", wheel), ("right", wheel), ("gears", "i1", (2, 2))]
    )


def test_a_robot_never_seen_is_driven_by_its_description(start_foreign: StartChild) -> None:
    start_foreign("odd", "odd")
    with trifinger.connect("odd") as robot:
        lamp = robot.companion("lamp")
        for k in range(6):
            action = robot.new_action(speed=[1.0, -1.0], gear=k + 1, colour=100 + k)
            t = robot.append_desired_action(action)
            robot.wait_until_time_index(t)
        y = robot.get_observation(5)
        assert y.left.angle > 0 > y.right.angle
        assert y.left.speed == -y.right.speed == robot.get_observations(0, 6)["left"]["speed"][5]
        assert y.gears.tolist() == [[5, 5], [4, 4]]
        assert robot.get_applied_action(5).was_clipped == 1
        assert robot.get_applied_action(5).gear.tolist() == [5, 5]
        reading = lamp.get_latest_at(5)
        assert reading is not None
        assert reading.stamp.capture_index == 3
        assert reading.colour.tolist() == [102, 0, 0]


@given(
    speed=st.lists(st.floats(width=32, allow_nan=False), min_size=2, max_size=2),
    gear=st.lists(st.integers(-128, 127), min_size=2, max_size=2),
    colour=st.integers(0, 65535),
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_the_fields_of_any_action_are_what_was_filled_in(
    odd: trifinger.Frontend, speed: list[float], gear: list[int], colour: int
) -> None:
    action = odd.new_action(speed=speed, gear=gear, colour=colour)
    t = odd.append_desired_action(action)
    odd.wait_until_time_index(t)
    taken = odd.get_desired_action(t)
    assert taken.tobytes() == action.tobytes()
    assert taken.speed.tolist() == speed
    assert taken.gear.tolist() == gear
    assert taken.colour == colour


@given(st.integers())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_an_integer_is_kept_or_refused(odd: trifinger.Frontend, colour: int) -> None:
    if 0 <= colour <= 65535:
        assert odd.new_action(colour=colour).colour == colour
    else:
        with pytest.raises(trifinger.InvalidArgument, match="field 'colour' holds uint16"):
            odd.new_action(colour=colour)


@pytest.mark.parametrize("value", [1.5, [1, 2, 3], [[1, 2]] * 2, "3x", np.nan])
def test_an_integer_field_is_not_cut(odd: trifinger.Frontend, value: object) -> None:
    with pytest.raises(trifinger.InvalidArgument, match=r"field 'gear' (holds|has 2 numbers)"):
        odd.new_action(gear=value)  # type: ignore[arg-type]


@pytest.fixture
def odd(start_foreign: StartChild) -> trifinger.Frontend:
    start_foreign("odd", "odd")
    return trifinger.connect("odd")


def test_nan_says_not_given_where_the_default_action_has_it(start_foreign: StartChild) -> None:
    start_foreign("aiming", "aiming")
    with trifinger.connect("aiming") as robot:
        default = robot.new_action()
        assert robot.new_action(target=None).tobytes() == robot.new_action(target=np.nan).tobytes()
        assert np.isnan(default.target).tolist() == [True, True, False]
        robot.append_desired_action(default)
        robot.append_desired_action(robot.new_action(target=[1.0, np.nan, 2.0]))
        for fields, place in (
            ({"target": [1.0, 2.0, np.nan]}, "number 2 of field 'target'"),
            ({"force": [0.0, np.nan]}, "number 1 of field 'force'"),
            ({"target": np.nan}, "number 2 of field 'target'"),
        ):
            with pytest.raises(trifinger.InvalidArgument, match=place):
                robot.append_desired_action(robot.new_action(**fields))
