# SPDX-License-Identifier: BSD-3-Clause
import inspect
import pickle

import pytest
import trifinger
from trifinger import errors

pytestmark = pytest.mark.bindings

CLASSES = [
    value
    for value in vars(errors).values()
    if inspect.isclass(value) and issubclass(value, errors.Error)
]


@pytest.mark.parametrize("error", CLASSES)
def test_every_error_is_part_of_the_package(error: type[Exception]) -> None:
    assert getattr(trifinger, error.__name__) is error


@pytest.mark.parametrize("error", CLASSES)
def test_every_error_survives_a_trip_to_another_process(error: type[Exception]) -> None:
    original = error("the text")
    original.fault = trifinger.Fault("driver", detail=3, time_index=4)  # type: ignore[attr-defined]
    copy = pickle.loads(pickle.dumps(original))  # noqa: S301
    assert type(copy) is error
    assert str(copy) == "the text"
    assert copy.fault == original.fault  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("error", "builtin"),
    [
        (trifinger.InvalidArgument, ValueError),
        (trifinger.TimedOut, TimeoutError),
        (trifinger.RobotStopped, RuntimeError),
    ],
)
def test_errors_are_what_python_programs_expect(
    error: type[Exception], builtin: type[Exception]
) -> None:
    assert issubclass(error, builtin)
    assert issubclass(error, trifinger.Error)
