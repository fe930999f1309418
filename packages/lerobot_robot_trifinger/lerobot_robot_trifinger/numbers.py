# SPDX-License-Identifier: BSD-3-Clause
"""Numbers by name, as LeRobot passes them, and fields of elements, as TriFinger has them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from trifinger.errors import InvalidArgument


def names_of(fields: Mapping[str, int]) -> list[str]:
    """The names of all numbers: "position[0]" and so on."""
    return [f"{name}[{i}]" for name, size in fields.items() for i in range(size)]


def numbers_of(element: Any, fields: Mapping[str, int]) -> dict[str, float]:
    """The numbers of some fields of an element."""
    return {
        f"{name}[{i}]": float(number)
        for name in fields
        for i, number in enumerate(np.ravel(element[name]))
    }


def fields_of(numbers: Mapping[str, float], fields: Mapping[str, int]) -> dict[str, Any]:
    """The fields that numbers belong to. Raises InvalidArgument if one is missing or unknown."""
    names = set(names_of(fields))
    if names != set(numbers):
        missing, unknown = sorted(names - set(numbers)), sorted(set(numbers) - names)
        raise InvalidArgument(
            f"the action lacks {missing or 'nothing'} and has {unknown or 'nothing'} that the "
            "robot does not know; action_fields says what it has"
        )
    return {
        name: np.array([numbers[f"{name}[{i}]"] for i in range(size)])
        for name, size in fields.items()
    }


def check_fields(what: str, fields: Mapping[str, int], dtype: np.dtype[Any]) -> None:
    """Raises InvalidArgument if a robot's element does not have these fields."""
    there = {
        name: int(np.prod(dtype[name].shape, dtype=int))
        for name in dtype.names or ()
        if dtype[name].names is None
    }
    for name, size in fields.items():
        if there.get(name) != size:
            raise InvalidArgument(
                f"{what} says that the robot has the field '{name}' of {size} numbers; it has "
                f"{', '.join(f'{one} of {count}' for one, count in there.items())}"
            )
