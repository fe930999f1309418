# SPDX-License-Identifier: BSD-3-Clause
"""Reads YAML files of other programs, in any style in which their tools write them.

Files of this project are strict: C++ reads them, and refuses whatever a person may have written by
mistake. A file that another program wrote is right as it is. So a whole reader of YAML reads it,
which knows lists in brackets and with dashes, lists in lists, aliases, and the tags of OpenCV. It
runs nothing: tags that would make an object of Python are refused.
"""

import re
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from trifinger.errors import InvalidArgument

_CORE = "tag:yaml.org,2002:"
_MAX_NUMBERS = 10_000  # of a matrix; those of cameras have 16
_LONGEST = 40  # of a value in an error


class _Loader(yaml.SafeLoader):  # type: ignore[misc]  # PyYAML has no types
    """The safe reader, with numbers as in YAML 1.2 and tags of OpenCV and of tuples."""

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        # PyYAML's functions for single values let Python's own errors through.
        try:
            return super().construct_object(node, deep)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            text = f"{str(node.value)[:_LONGEST]!r} is no {node.tag.removeprefix(_CORE)}"
            raise yaml.constructor.ConstructorError(None, None, text, node.start_mark) from error


# YAML 1.1 takes 1e-05 for a word, and OpenCV writes .Nan and .Inf.
_Loader.add_implicit_resolver(
    f"{_CORE}float",
    re.compile(r"[-+]?(?:(?:\d+\.?\d*|\.\d+)[eE][-+]?\d+|\.(?i:inf|nan))$"),
    list("-+.0123456789"),
)
_Loader.add_multi_constructor(
    f"{_CORE}opencv-", lambda loader, _, node: loader.construct_mapping(node, deep=True)
)
_Loader.add_constructor(
    f"{_CORE}python/tuple", lambda loader, node: loader.construct_sequence(node, deep=True)
)


def parse(text: str) -> dict[str, Any]:
    """The content of a file; raises InvalidArgument if it is not YAML, or if it has no keys."""
    # OpenCV writes this first line with a colon that YAML does not have there.
    text = re.sub(r"\A\s*%YAML:1\.0[^\n]*\n", "", text)
    try:
        content = yaml.load(text, _Loader)  # noqa: S506  # it is a safe loader
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"line {mark.line + 1}: " if mark else ""
        raise InvalidArgument(f"it is not YAML: {where}{error.problem}") from error
    except (yaml.YAMLError, RecursionError) as error:
        raise InvalidArgument(f"it is not YAML: {error}") from error
    if not isinstance(content, dict):
        raise InvalidArgument("it is not YAML with keys and values")
    return content


def matrix(data: Any) -> NDArray[np.float64]:
    """A matrix: {rows, cols, data}, with all numbers or all rows in `data`, or a list of its rows.

    Raises InvalidArgument if it is no matrix.
    """
    rows, columns, numbers = _parts(data)
    if rows * columns <= _MAX_NUMBERS and isinstance(numbers, list):
        # Aliases can make endless lists of a short text, so lengths are compared before they meet.
        if len(numbers) == rows and all(isinstance(r, list) and len(r) == columns for r in numbers):
            numbers = [number for row in numbers for number in row]
        try:
            return np.array([float(each) for each in numbers]).reshape(rows, columns)
        except (TypeError, ValueError):
            pass  # said below
    raise InvalidArgument(f"it must have {rows} x {columns} numbers")


def _parts(data: Any) -> tuple[int, int, Any]:
    """Rows, columns and numbers of a matrix; raises InvalidArgument if it has none."""
    if isinstance(data, list) and data and isinstance(data[0], list):
        return len(data), len(data[0]), data
    try:
        return int(data["rows"]), int(data["cols"]), data["data"]
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidArgument("it must have 'rows', 'cols' and 'data'") from error
