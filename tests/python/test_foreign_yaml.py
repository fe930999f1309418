# SPDX-License-Identifier: BSD-3-Clause
"""YAML of others is read as their own tools write it."""

from typing import Any

import numpy as np
import pytest
import yaml
from foreign_writers import WRITERS
from hypothesis import given, strategies as st
from trifinger import foreign_yaml
from trifinger.errors import InvalidArgument

NUMBERS = st.floats(-1e6, 1e6) | st.sampled_from([1e-05, -2.5e-17, 1e22, 0.0, -0.0])


@pytest.mark.parametrize("writer", WRITERS)
@given(st.tuples(st.integers(1, 4), st.integers(1, 5)), st.data())
def test_matrices_come_back_from_every_writer(
    writer: str, shape: tuple[int, int], data: st.DataObject
) -> None:
    count = shape[0] * shape[1]
    numbers = data.draw(st.lists(NUMBERS, min_size=count, max_size=count))
    written = np.array(numbers).reshape(shape)
    text = WRITERS[writer]({"camera_name": "camera60", "image_width": 540, "m": written})
    content = foreign_yaml.parse(text)
    assert (content["camera_name"], content["image_width"]) == ("camera60", 540)
    assert np.array_equal(foreign_yaml.matrix(content["m"]), written)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a: 1e-05", 1e-05),
        ("a: 587.", 587.0),
        ("a: [ .5, -.Inf ]", [0.5, -np.inf]),
        ("%YAML:1.0\n---\na: 2", 2),
        ("%YAML 1.1\n---\na: 2", 2),
        ("a: &x [1, 2]\nb: *x", [1, 2]),
        ("a: !!python/tuple [1, 2]", [1, 2]),
        ('a: "0x10" # no number', "0x10"),
        ("\ufeffa: 3\r\n", 3),
    ],
)
def test_spellings_of_others(text: str, value: Any) -> None:
    assert foreign_yaml.parse(text)["a"] == value


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("{[", "it is not YAML: line 1: "),
        ("a: 1\nb: [1,", "it is not YAML: line 2: "),
        ("- 1", "keys and values"),
        ("", "keys and values"),
        ("a: !!python/object/apply:os.getcwd []", "line 1: could not determine a constructor"),
        ("[" * 5000, "it is not YAML"),
        ("a: 1\0", "it is not YAML"),
        ("b: 1\na: 2024-13-45", "line 2: '2024-13-45' is no timestamp"),
        ("a: 0x_", "line 1: '0x_' is no int"),
        ("a: !!int x", "line 1: 'x' is no int"),
        ("a: [\n!!float x]", "line 2: 'x' is no float"),
        ("a: !!bool x", "line 1: 'x' is no bool"),
        ("a: !!timestamp x", "line 1: 'x' is no timestamp"),
    ],
)
def test_what_is_no_such_file_is_refused_with_its_place(text: str, sentence: str) -> None:
    with pytest.raises(InvalidArgument, match=sentence):
        foreign_yaml.parse(text)


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        ({"rows": 1, "cols": 2}, "must have 'rows', 'cols' and 'data'"),
        (3, "must have 'rows', 'cols' and 'data'"),
        ({"rows": 2, "cols": 2, "data": [1, 2, 3]}, "must have 2 x 2 numbers"),
        ({"rows": 1, "cols": 1, "data": ["one"]}, "must have 1 x 1 numbers"),
        ({"rows": -1, "cols": -1, "data": [1]}, "must have -1 x -1 numbers"),
        ([[1, 2], [3]], "must have 2 x 2 numbers"),
    ],
)
def test_what_is_no_matrix_is_refused(data: Any, sentence: str) -> None:
    with pytest.raises(InvalidArgument, match=sentence):
        foreign_yaml.matrix(data)


def nested(first: str, more: str) -> str:
    """A text whose lines refer ten times to the line before."""
    lines = [f"a0: &a0 {first}"]
    for i in range(1, 12):
        lines.append(f"a{i}: &a{i} " + more.format(", ".join([f"*a{i - 1}"] * 10)))
    return "\n".join(lines)


def test_aliases_cannot_fill_the_memory() -> None:
    content = foreign_yaml.parse(nested("[1, 2, 3, 4, 5, 6, 7, 8, 9, 0]", "[{}]"))
    with pytest.raises(InvalidArgument, match="10 x 10 numbers"):
        foreign_yaml.matrix({"rows": 10, "cols": 10, "data": content["a11"]})
    assert foreign_yaml.parse(nested("{k: 1}", "{{<<: [{}]}}"))["a11"] == {"k": 1}
    recursive = foreign_yaml.parse("a: &a [*a]")["a"]
    with pytest.raises(InvalidArgument, match="1 x 1 numbers"):
        foreign_yaml.matrix({"rows": 1, "cols": 1, "data": recursive})


def test_what_pyyaml_writes_is_what_it_reads() -> None:
    content = {
        "kp": [1e-05, 15, 9.5],
        "can_ports": ["can0", "can1"],
        "has_endstop": True,
        "n": None,
    }
    for style in (None, True, False):
        assert foreign_yaml.parse(yaml.dump(content, default_flow_style=style)) == content
