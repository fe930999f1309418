# SPDX-License-Identifier: BSD-3-Clause
"""What will be removed warns whoever uses it, with what docs/stability.md asks for."""

import warnings

import pytest
from trifinger._deprecation import deprecated

STOP = "stop is deprecated and goes with version 0.3: call finish"


@deprecated(STOP)
def stop(times: int, *, name: str = "sim") -> str:
    """Ends something."""
    return f"{name} {times}"


class Robot:
    @deprecated(STOP)
    def stop(self) -> int:
        return 1


@deprecated("Arm is deprecated and goes with version 0.3: use Robot")
class Arm(Robot):
    def __init__(self, length: float) -> None:
        self.length = length


def test_a_call_warns_in_the_line_of_the_caller_and_works_as_before() -> None:
    with pytest.warns(DeprecationWarning, match=f"^{STOP}$") as caught:
        said = stop(2, name="left")
    assert said == "left 2"
    (warning,) = caught
    assert warning.filename == __file__
    with pytest.warns(DeprecationWarning, match=f"^{STOP}$"):
        assert Robot().stop() == 1
    assert stop.__name__ == "stop"
    assert stop.__doc__ == "Ends something."


def test_a_class_warns_when_an_object_is_made_and_stays_a_class() -> None:
    with pytest.warns(DeprecationWarning, match="goes with version 0.3: use Robot"):
        arm = Arm(0.16)
    assert isinstance(arm, Arm)
    assert arm.length == 0.16


def test_who_uses_what_is_new_sees_no_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Robot()
