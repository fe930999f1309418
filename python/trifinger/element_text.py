# SPDX-License-Identifier: BSD-3-Clause
"""How elements are printed: field names, values and units.

    Observation(position=[0 0.9 -1.7] rad, velocity=[0 0 0] rad/s, stamp.capture_time=1000 ns)

An element that does not fit into one line has a line for each field.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from trifinger._trifinger import Element

# Units of the fields, by the layout of an element. NumPy's types cannot hold units in a way that
# survives saving. None if two robots with this layout have different units.
UNITS: dict[np.dtype[Any], dict[str, str] | None] = {}

LINE = 88  # longest line [characters]
MAX_NUMBERS = 16  # most numbers of a field that are all printed
DIGITS = 5


def learn(dtype: np.dtype[Any], units: dict[str, str]) -> None:
    """Notes the units of the fields of `dtype`; nested fields have names with dots."""
    if UNITS.setdefault(dtype, units) != units:
        UNITS[dtype] = None
    for name in dtype.names or ():
        inner = dtype[name]
        if inner.names is not None:
            start = f"{name}."
            learn(
                inner,
                {
                    key.removeprefix(start): unit
                    for key, unit in units.items()
                    if key.startswith(start)
                },
            )


def text_of(element: Element) -> str:
    """The text that `repr` shows for an element."""
    units = UNITS.get(element.dtype) or {}
    parts = [
        f"{name}={_values(value)}" + (f" {unit}" if (unit := units.get(name, "")) else "")
        for name, value in fields_of(element)
    ]
    name = type(element).__name__
    line = f"{name}({', '.join(parts)})"
    if len(line) <= LINE:
        return line
    return f"{name}(\n" + "".join(f"  {part},\n" for part in parts) + ")"


def fields_of(elements: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yields name and value of each field of an element or of an array; names are "left.angle"."""
    for name in elements.dtype.names:
        if elements.dtype[name].names is None:
            yield prefix + name, elements[name]
        else:
            yield from fields_of(elements[name], f"{prefix}{name}.")


def _values(value: Any) -> str:
    if np.ndim(value) == 0:
        return _number(value)
    numbers = np.ravel(value)
    if len(numbers) <= MAX_NUMBERS:
        shown = " ".join(_number(number) for number in numbers)
    else:
        ends = [" ".join(_number(number) for number in end) for end in (numbers[:3], numbers[-3:])]
        shown = f"{ends[0]} ... {ends[1]}"
    shape = "" if np.ndim(value) == 1 and len(numbers) <= MAX_NUMBERS else f" {np.shape(value)}"
    return f"[{shown}]{shape}"


def _number(number: Any) -> str:
    return f"{number:.{DIGITS}g}" if isinstance(number, np.floating) else str(number)


def positions_field(fields: Collection[str]) -> str:
    """The field of an observation that has the positions of all joints of the model.

    A robot whose motors do not drive its joints one by one has "joint_position".
    """
    return "joint_position" if "joint_position" in fields else "position"
